//! Independent coordinates of an aggregate: `u = X u_R` for rates, and its derivative for accelerations (Paper Eq. 53 and 58).
//!
//! `G u = 0` holds the closures' blocked directions. Dependent coordinates are chosen by column pivoting on a scaled G, hinges before
//! modes; they stay as long as the pivots of `G_d = Q R` do, and are chosen again when one falls below a tenth of what it was.
//! `X_d = -R^-1 Q' G_i`. Redundant rows cost nothing: they lie in the span of Q, and multipliers in that span have least norm.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/aggregate/mod.rs")]

use super::projection::{MemberForces, project_inward};
use crate::dynamics::closed_chain::constraint::ClosureAt;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::model::closure::MAX_ROWS;
use crate::model::{Aggregate, ClosureJoint, System};
use nalgebra::Vector6;

/// Scaled columns below this are redundant: closures that are assembled to 1e-10 leave no more.
const REDUNDANT: f64 = 1e-9;
/// Hinges are dependent rather than modes as long as their scaled columns are above this.
const PREFERRED: f64 = 0.02;
/// Share of its first value at which a pivot is ill and coordinates are chosen again.
const ILL: f64 = 0.1;
/// Share at which kept coordinates have no meaning left.
const LOST: f64 = 1e-7;

/// The kinematics of one aggregate at the last poses.
#[derive(Debug, Clone)]
pub struct Embedding {
    /// Coordinates that follow the others, in pivot order.
    pub dependent: Vec<usize>,
    /// The others but prescribed ones, ascending.
    pub independent: Vec<usize>,
    /// True while the choice must stay, whatever the pivots: within a step.
    pub held: bool,
    /// Smallest pivot relative to its value when the coordinates were chosen.
    pub pivot_ratio: f64,
    /// Smallest scaled pivot of the choice: how far from losing rank the closures were; infinite if nothing is dependent.
    pub smallest_pivot: f64,
    rows: usize,
    /// c x n, by columns.
    G: Vec<f64>,
    /// c x r, by columns, orthonormal.
    Q: Vec<f64>,
    /// Upper triangle, r x r by columns of c.
    R: Vec<f64>,
    /// r x m, by columns of c.
    X: Vec<f64>,
    pivots: Vec<f64>,
    scaled: Vec<f64>,
    column_scale: Vec<f64>,
    right: Vec<f64>,
    wrench: Vec<Vector6<f64>>,
    generalised: Vec<f64>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn subtract(x: &mut [f64], q: &[f64], share: f64) {
    x.iter_mut().zip(q).for_each(|(x, q)| *x -= share * q);
}

fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

impl Embedding {
    /// Room for `aggregate`.
    #[must_use]
    pub fn new(aggregate: &Aggregate) -> Self {
        let (c, n) = (aggregate.row_count, aggregate.size());
        let r = c.min(n);
        Self {
            dependent: Vec::with_capacity(r),
            independent: Vec::with_capacity(n),
            held: false,
            pivot_ratio: 0.0,
            smallest_pivot: 0.0,
            rows: c,
            G: vec![0.0; c * n],
            Q: vec![0.0; c * r],
            R: vec![0.0; c * r],
            X: vec![0.0; c * n],
            pivots: Vec::with_capacity(r),
            scaled: vec![0.0; c * n],
            column_scale: vec![0.0; n],
            right: vec![0.0; c],
            wrench: vec![Vector6::zeros(); aggregate.members.len()],
            generalised: vec![0.0; n],
        }
    }

    /// A stand-in without room, while the real one is at work.
    pub(super) fn empty() -> Self {
        let none = Vec::new();
        Self {
            dependent: Vec::new(),
            independent: Vec::new(),
            held: false,
            pivot_ratio: 0.0,
            smallest_pivot: 0.0,
            rows: 0,
            G: none.clone(),
            Q: none.clone(),
            R: none.clone(),
            X: none.clone(),
            pivots: none.clone(),
            scaled: none.clone(),
            column_scale: none.clone(),
            right: none.clone(),
            wrench: Vec::new(),
            generalised: none,
        }
    }

    /// Share of multiplier `row` that the closures leave undetermined, from zero to one.
    #[must_use]
    pub fn redundancy(&self, row: usize) -> f64 {
        let inside: f64 = (0..self.dependent.len()).map(|d| self.Q[d * self.rows + row].powi(2)).sum();
        let outside = 1.0 - inside;
        // rounding of a sum of squares
        if outside > 1e-12 { outside.sqrt() } else { 0.0 }
    }

    /// Blocked directions that are independent.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.dependent.len()
    }

    /// Blocked directions.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    fn G_column(&self, j: usize) -> &[f64] {
        &self.G[j * self.rows..(j + 1) * self.rows]
    }

    /// Column q of X: rates of the dependent coordinates per rate of the independent coordinate q.
    #[must_use]
    pub fn X_column(&self, q: usize) -> &[f64] {
        &self.X[q * self.rows..q * self.rows + self.dependent.len()]
    }

    /// Rate of coordinate `d` per rate of the independent coordinate q: zero unless it is dependent.
    #[must_use]
    pub fn share(&self, d: usize, q: usize) -> f64 {
        self.dependent.iter().position(|&e| e == d).map_or(0.0, |e| self.X_column(q)[e])
    }

    /// True if the kept coordinates can no longer carry the closures.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        !(self.pivot_ratio > LOST)
    }

    /// Takes in the poses: G, the choice of coordinates and X.
    pub fn follow_pose(&mut self, system: &System, pose: &PoseScratch, closures: &[ClosureAt], aggregate: &Aggregate) {
        self.fill_G(system, pose, closures, aggregate);
        let fresh = self.dependent.is_empty() && self.independent.is_empty();
        if fresh {
            self.choose(system, pose, closures, aggregate);
        }
        self.factor();
        let ill = self.pivot_ratio < ILL || (!self.held && self.uncovered(aggregate) > 100.0 * REDUNDANT);
        if ill && !self.held && !fresh {
            self.choose(system, pose, closures, aggregate);
            self.factor();
        }
        self.solve_X();
    }

    fn fill_G(&mut self, system: &System, pose: &PoseScratch, closures: &[ClosureAt], aggregate: &Aggregate) {
        let mut row = 0;
        for &index in &aggregate.closures {
            let closure = &system.closures[index];
            for i in 0..closure.row_count() {
                let mut unit = [0.0; MAX_ROWS];
                unit[i] = 1.0;
                self.wrench.fill(Vector6::zeros());
                self.generalised.fill(0.0);
                let mut sink = MemberForces { aggregate, system, wrench: &mut self.wrench, generalised: &mut self.generalised };
                closures[index].push(closure, &unit[..closure.row_count()], &mut sink);
                project_inward(system, pose, aggregate, &mut self.wrench, &mut self.generalised);
                for (j, g) in self.generalised.iter().enumerate() {
                    self.G[j * self.rows + row] = *g;
                }
                row += 1;
            }
        }
    }

    /// Scales G into lengths per natural motion: blocked rotations by the aggregate's size, columns by what their coordinates move at that
    /// distance.
    fn scale_G(&mut self, system: &System, pose: &PoseScratch, closures: &[ClosureAt], aggregate: &Aggregate) {
        let length = aggregate.members.iter().map(|m| pose.bodies[m.body].l.norm()).fold(0.0, f64::max);
        let length = if length > 0.0 { length } else { 1.0 };
        let mut row = 0;
        for &index in &aggregate.closures {
            let closure = &system.closures[index];
            for i in 0..closure.row_count() {
                let scale = match closure.joint {
                    ClosureJoint::Gear { ratio, .. } => length / ratio.abs().max(1.0),
                    ClosureJoint::Frames { .. } if closures[index].blocks_turning(i) => length,
                    ClosureJoint::Frames { .. } => 1.0,
                };
                for j in 0..aggregate.size() {
                    self.scaled[j * self.rows + row] = self.G[j * self.rows + row] * scale;
                }
                row += 1;
            }
        }
        // what the modes move anywhere in the aggregate, so that a mode that does nothing for the closures shows as rounding
        let natural = |s: &Vector6<f64>| s.fixed_rows::<3>(0).norm() * length + s.fixed_rows::<3>(3).norm();
        let inside = aggregate.members.iter().filter(|m| m.parent.is_some()).flat_map(|m| pose.shape_of(system, m.body));
        let inboard = aggregate.members.iter().filter_map(|m| pose.bodies[m.body].flexible).flat_map(|f| &pose.flexible[f].shape_inboard);
        let at_closures = aggregate.closures.iter().flat_map(|&c| closures[c].shapes());
        let modal = inside.chain(inboard).chain(at_closures).map(natural).fold(0.0, f64::max);
        for member in &aggregate.members {
            for (i, j) in member.rates.clone().enumerate() {
                let map = &pose.bodies[member.body].hinge.map[i];
                self.column_scale[j] = 1.0 / (map.fixed_rows::<3>(0).norm() * length + map.fixed_rows::<3>(3).norm());
            }
            for j in member.modes.clone() {
                self.column_scale[j] = if modal > 0.0 { 1.0 / modal } else { 0.0 };
            }
        }
        for (column, scale) in self.scaled.chunks_exact_mut(self.rows.max(1)).zip(&self.column_scale) {
            column.iter_mut().for_each(|x| *x *= scale);
        }
    }

    /// Chooses the dependent coordinates by pivoting.
    fn choose(&mut self, system: &System, pose: &PoseScratch, closures: &[ClosureAt], aggregate: &Aggregate) {
        self.scale_G(system, pose, closures, aggregate);
        let (c, n) = (self.rows, aggregate.size());
        self.dependent.clear();
        self.independent.clear();
        self.pivots.clear();
        self.smallest_pivot = f64::INFINITY;
        while self.dependent.len() < c.min(n) {
            // the best hinge, and the best of all
            let (mut hinge, mut any) = ((0.0, 0), (0.0, 0));
            for member in &aggregate.members {
                for j in member.rates.start..member.modes.end {
                    if !aggregate.free[j] || self.dependent.contains(&j) {
                        continue;
                    }
                    let size = norm(&self.scaled[j * c..(j + 1) * c]);
                    any = if size > any.0 { (size, j) } else { any };
                    hinge = if j < member.rates.end && size > hinge.0 { (size, j) } else { hinge };
                }
            }
            let (size, pivot) = if hinge.0 > PREFERRED { hinge } else { any };
            if !(size > REDUNDANT) {
                break;
            }
            self.smallest_pivot = self.smallest_pivot.min(size);
            self.dependent.push(pivot);
            // take the pivot's direction out of all others, twice for orthogonality
            self.right.copy_from_slice(&self.scaled[pivot * c..(pivot + 1) * c]);
            self.right.iter_mut().for_each(|x| *x /= size);
            for j in (0..n).filter(|&j| j != pivot) {
                let column = &mut self.scaled[j * c..(j + 1) * c];
                for _ in 0..2 {
                    let share = dot(&self.right, column);
                    subtract(column, &self.right, share);
                }
            }
        }
        self.independent.extend((0..n).filter(|j| aggregate.free[*j] && !self.dependent.contains(j)));
    }

    /// `G_d = Q R` by Gram-Schmidt, twice; the pivots' sizes are kept the first time after a choice.
    fn factor(&mut self) {
        let (c, r) = (self.rows, self.dependent.len());
        for d in 0..r {
            let start = self.dependent[d] * c;
            self.Q[d * c..(d + 1) * c].copy_from_slice(&self.G[start..start + c]);
            let (done, open) = self.Q.split_at_mut(d * c);
            let own = &mut open[..c];
            self.R[d * c..(d + 1) * c].fill(0.0);
            for _ in 0..2 {
                for (p, q) in done.chunks_exact(c).enumerate() {
                    let share = dot(q, own);
                    subtract(own, q, share);
                    self.R[d * c + p] += share;
                }
            }
            let size = norm(own);
            self.R[d * c + d] = size;
            if size > 0.0 {
                own.iter_mut().for_each(|x| *x /= size);
            }
        }
        if self.pivots.is_empty() {
            self.pivots.extend((0..r).map(|d| self.R[d * c + d]));
        }
        let ratio = |d: usize| self.R[d * c + d] / self.pivots[d];
        // what is not a number must not be lost in the minimum
        self.pivot_ratio = (0..r).map(ratio).fold(1.0, |m: f64, x| if x >= m { m } else { x });
    }

    /// Largest part of an independent column outside the span of Q, relative to the column: blocked directions that nothing holds.
    fn uncovered(&mut self, aggregate: &Aggregate) -> f64 {
        let c = self.rows;
        let mut largest = 0.0_f64;
        for j in (0..aggregate.size()).filter(|j| aggregate.free[*j] && !self.dependent.contains(j)) {
            let size = norm(&self.G[j * c..(j + 1) * c]);
            self.right.copy_from_slice(&self.G[j * c..(j + 1) * c]);
            for q in self.Q.chunks_exact(c.max(1)).take(self.dependent.len()) {
                let share = dot(q, &self.right);
                subtract(&mut self.right, q, share);
            }
            if size > 0.0 && self.column_scale[j] * size > REDUNDANT {
                largest = largest.max(norm(&self.right) / size);
            }
        }
        largest
    }

    fn solve_X(&mut self) {
        let (c, r) = (self.rows, self.dependent.len());
        let mut X = std::mem::take(&mut self.X);
        for (q, &j) in self.independent.iter().enumerate() {
            self.dependent_step(self.G_column(j), &mut X[q * c..q * c + r]);
        }
        self.X = X;
    }

    /// The change of the dependent coordinates that takes `violation` (one per blocked direction) away, `-R^-1 Q' violation`; returns how
    /// much of it no coordinate reaches.
    pub fn dependent_step(&self, violation: &[f64], out: &mut [f64]) -> f64 {
        let (c, r) = (self.rows, self.dependent.len());
        for (o, q) in out.iter_mut().zip(self.Q.chunks_exact(c.max(1))) {
            *o = dot(q, violation);
        }
        let missed = dot(violation, violation) - dot(&out[..r], &out[..r]);
        for d in (0..r).rev() {
            for e in d + 1..r {
                out[d] -= self.R[e * c + d] * out[e];
            }
            out[d] /= self.R[d * c + d];
        }
        out[..r].iter_mut().for_each(|x| *x = -*x);
        missed.max(0.0).sqrt()
    }

    /// Multipliers of least norm whose forces on the dependent coordinates are `force`: `Q R'^-1 force`; `force` is used up.
    pub fn multipliers(&self, force: &mut [f64], out: &mut [f64]) {
        let (c, r) = (self.rows, self.dependent.len());
        out.fill(0.0);
        for d in 0..r {
            for e in 0..d {
                force[d] -= self.R[d * c + e] * force[e];
            }
            force[d] /= self.R[d * c + d];
            out.iter_mut().zip(&self.Q[d * c..]).for_each(|(o, q)| *o += force[d] * q);
        }
    }

    /// Rates of the blocked directions for the rates `u` of all coordinates.
    pub fn closure_rates(&self, u: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (column, u) in self.G.chunks_exact(self.rows.max(1)).zip(u) {
            out.iter_mut().zip(column).for_each(|(o, g)| *o += g * u);
        }
    }

    /// `u = X u_R + particular`: accelerations of all coordinates from those of the independent ones; prescribed ones are zero.
    pub fn expand(&self, independent: &[f64], particular: Option<&[f64]>, out: &mut [f64]) {
        match particular {
            Some(particular) => out.copy_from_slice(particular),
            None => out.fill(0.0),
        }
        for (q, (&j, u)) in self.independent.iter().zip(independent).enumerate() {
            out[j] += u;
            for (&d, x) in self.dependent.iter().zip(self.X_column(q)) {
                out[d] += x * u;
            }
        }
    }

    /// `X' f`: forces on the independent coordinates from those on all.
    pub fn reduce(&self, force: &[f64], out: &mut [f64]) {
        for (q, (&j, o)) in self.independent.iter().zip(out).enumerate() {
            *o = force[j] + self.dependent.iter().zip(self.X_column(q)).map(|(&d, x)| x * force[d]).sum::<f64>();
        }
    }
}
