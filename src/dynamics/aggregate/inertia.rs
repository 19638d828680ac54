//! Inertia of an aggregate: its reduced mass matrix `D_E`, and what its root feels of it (Paper Eq. 62 and 63).
//!
//! The mass matrix of the members' sub-tree has `P_E` for inertias: every member's own and what hangs on it outside the aggregate. It is
//! built by composite bodies, tips first; `D_E = X' M X` and `P+ = P - U D_E^-1 U'` at the root's frame follow.
//! Cost: O(n^2) for n coordinates, O(m^3) for m independent ones.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/aggregate/mod.rs")]

use super::embedding::Embedding;
use crate::dynamics::added_inertia::AddedInertia;
use crate::dynamics::sweep::inertia_inward::{BodyInertia, FlexibleElimination, SINGULAR};
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::model::{Aggregate, System};
use crate::spatial::SpatialInertia;
use crate::spatial::shift::{force_from, rotate, rotate_back};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::{Mat, Par, Spec};
use nalgebra::{Matrix6, Vector6};

/// What the inertia sweep leaves of one aggregate.
#[derive(Debug)]
pub struct AggregateInertia {
    /// Mass matrix of the sub-tree, all coordinates.
    mass: Mat<f64>,
    /// Force on the root per acceleration of each coordinate.
    base: Vec<Vector6<f64>>,
    /// Cholesky factor of `D_E`, lower triangle.
    D: Mat<f64>,
    /// `X' base`: force on the root per independent acceleration.
    pub U: Vec<Vector6<f64>>,
    /// `D_E^-1 U`.
    pub W: Vec<Vector6<f64>>,
    diagonal: Vec<f64>,
    product: Vec<f64>,
    composite: Vec<SpatialInertia>,
    /// Modal rows of the composite bodies, by coordinate.
    row: Vec<Vector6<f64>>,
    memory: Memory,
}

/// Scratch of the factorisation.
struct Memory(MemBuffer);

impl std::fmt::Debug for Memory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Memory")
    }
}

impl Clone for AggregateInertia {
    fn clone(&self) -> Self {
        Self {
            mass: self.mass.clone(),
            base: self.base.clone(),
            D: self.D.clone(),
            U: self.U.clone(),
            W: self.W.clone(),
            diagonal: self.diagonal.clone(),
            product: self.product.clone(),
            composite: self.composite.clone(),
            row: self.row.clone(),
            memory: room(self.D.nrows()),
        }
    }
}

fn room(n: usize) -> Memory {
    Memory(MemBuffer::new(cholesky_in_place_scratch::<f64>(n, Par::Seq, Spec::default())))
}

/// An independent coordinate that moves no mass: its index among all, its pivot and what that was formed from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingularCoordinate {
    /// Index among the aggregate's coordinates.
    pub coordinate: usize,
    /// Pivot found.
    pub inertia: f64,
    /// Diagonal entry before elimination.
    pub scale: f64,
}

impl AggregateInertia {
    /// Room for `aggregate`.
    #[must_use]
    pub fn new(aggregate: &Aggregate) -> Self {
        let n = aggregate.size();
        let zeros = vec![Vector6::zeros(); n];
        Self {
            mass: Mat::zeros(n, n),
            base: zeros.clone(),
            D: Mat::zeros(n, n),
            U: zeros.clone(),
            W: zeros.clone(),
            diagonal: vec![0.0; n],
            product: vec![0.0; n],
            composite: vec![SpatialInertia::default(); aggregate.members.len()],
            row: zeros,
            memory: room(n),
        }
    }

    /// Factors the aggregate; returns the inertia that its root feels, at the root's frame.
    ///
    /// `bodies` and `flexible` hold `P` and the modal rows of all members with what hangs on them outside the aggregate.
    ///
    /// # Errors
    /// If some independent coordinate moves no mass.
    #[expect(clippy::too_many_arguments, reason = "a sweep step reads every earlier sweep")]
    pub fn eliminate(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        aggregate: &Aggregate,
        embedding: &Embedding,
        added: Option<&AddedInertia>,
        bodies: &[BodyInertia],
        flexible: &[FlexibleElimination],
    ) -> Result<SpatialInertia, SingularCoordinate> {
        let whole = self.build(system, pose, aggregate, added, bodies, flexible);
        self.reduce(embedding);
        self.factor(embedding)?;
        let m = embedding.independent.len();
        let mut felt = whole.matrix();
        // P - V V' with V = U L'^-1, symmetric as formed
        let mut taken = Matrix6::zeros();
        for p in 0..m {
            let mut v = self.U[p];
            for q in 0..p {
                v -= self.W[q] * self.D[(p, q)];
            }
            self.W[p] = v / self.D[(p, p)];
            taken.ger(1.0, &self.W[p], &self.W[p], 1.0);
        }
        felt -= taken;
        for p in (0..m).rev() {
            let mut w = self.W[p];
            for q in p + 1..m {
                w -= self.W[q] * self.D[(q, p)];
            }
            self.W[p] = w / self.D[(p, p)];
        }
        Ok(SpatialInertia::from_matrix(&felt))
    }

    /// Diagonal entry q of `D_E`.
    #[must_use]
    pub fn diagonal(&self, q: usize) -> f64 {
        self.diagonal[q]
    }

    /// `x <- D_E^-1 x`.
    pub fn solve(&self, x: &mut [f64]) {
        let m = x.len();
        for p in 0..m {
            let done: f64 = (0..p).map(|q| self.D[(p, q)] * x[q]).sum();
            x[p] = (x[p] - done) / self.D[(p, p)];
        }
        for p in (0..m).rev() {
            let done: f64 = (p + 1..m).map(|q| self.D[(q, p)] * x[q]).sum();
            x[p] = (x[p] - done) / self.D[(p, p)];
        }
    }

    /// Adds the forces that the accelerations `u_dot` of all coordinates take to `generalised`; returns that on the root.
    pub fn add_times(&self, u_dot: &[f64], generalised: &mut [f64]) -> Vector6<f64> {
        let mut base = Vector6::zeros();
        for (j, u) in u_dot.iter().enumerate().filter(|(_, u)| **u != 0.0) {
            base += self.base[j] * *u;
            generalised.iter_mut().enumerate().for_each(|(i, g)| *g += self.mass[(i, j)] * u);
        }
        base
    }

    /// Mass matrix and its coupling to the root, by composite bodies; returns the inertia of all members held together.
    fn build(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        aggregate: &Aggregate,
        added: Option<&AddedInertia>,
        bodies: &[BodyInertia],
        flexible: &[FlexibleElimination],
    ) -> SpatialInertia {
        for (m, member) in aggregate.members.iter().enumerate() {
            let body = &system.bodies[member.body];
            self.composite[m] = bodies[member.body].P;
            let Some(index) = pose.bodies[member.body].flexible else { continue };
            let start = member.modes.start;
            self.row[member.modes.clone()].copy_from_slice(&flexible[index].mu);
            for j in member.modes.clone() {
                for i in member.modes.clone() {
                    self.mass[(i, j)] = 0.0;
                }
                self.mass[(j, j)] = added.map_or(1.0, |a| a.modal[body.modal + j - start]);
            }
            for &child in &flexible[index].moved_children {
                self.add_to_modes(pose.shape_of(system, child), &bodies[child].S, start);
            }
        }
        let mut whole = SpatialInertia::default();
        for (m, member) in aggregate.members.iter().enumerate().rev() {
            let (k, own) = (member.body, &pose.bodies[member.body]);
            let mut at_hinge = self.composite[m];
            if let Some(index) = own.flexible {
                let part = &pose.flexible[index];
                self.hold_hinge(m, member.modes.clone(), &part.shape_inboard);
                let (x, turned) = (-part.inboard.position, part.inboard.rotation.transpose());
                at_hinge = at_hinge.moved_by(&x).rotated(&turned);
                for j in member.modes.clone() {
                    self.row[j] = rotate(&turned, &force_from(&x, &self.row[j]));
                }
            }
            let block = added.and_then(|a| a.block(system, k));
            for (i, j) in member.rates.clone().enumerate().filter(|(_, j)| aggregate.free[*j]) {
                let force = at_hinge.times(&own.hinge.map[i]);
                self.row[j] = force;
                for (e, l) in member.rates.clone().enumerate() {
                    self.mass[(l, j)] = own.hinge.map[e].dot(&force) + block.map_or(0.0, |n| n[e][i]);
                }
            }
            for j in member.modes.clone() {
                for (e, l) in member.rates.clone().enumerate() {
                    let x = own.hinge.map[e].dot(&self.row[j]);
                    (self.mass[(l, j)], self.mass[(j, l)]) = (x, x);
                }
            }
            for j in member.rates.start..member.modes.end {
                if aggregate.free[j] {
                    self.couple_inward(system, pose, aggregate, m, j);
                }
            }
            if aggregate.holds_root_modes && m == 0 {
                whole = whole.plus(&at_hinge);
                continue;
            }
            let felt = at_hinge.rotated(&own.rotation);
            let moved = felt.moved_by(&own.l);
            match member.parent {
                None => whole = whole.plus(&moved),
                Some(p) => {
                    let modes = aggregate.members[p].modes.clone();
                    let shape = pose.shape_of(system, k);
                    for (row, y) in self.row[modes.clone()].iter_mut().zip(shape) {
                        *row += force_from(&own.l, &felt.times(y));
                    }
                    self.add_to_modes(shape, &felt, modes.start);
                    self.composite[p] = self.composite[p].plus(&moved);
                }
            }
        }
        whole
    }

    /// `Y' S Y` of a child with mode shape `shape` on a member whose modes start at `start`.
    fn add_to_modes(&mut self, shape: &[Vector6<f64>], S: &SpatialInertia, start: usize) {
        for (j, y) in shape.iter().enumerate() {
            let force = S.times(y);
            for (i, x) in shape.iter().enumerate() {
                self.mass[(start + i, start + j)] += x.dot(&force);
            }
        }
    }

    /// From modes with B held to modes with O held, which move B by `-shape`.
    fn hold_hinge(&mut self, member: usize, modes: std::ops::Range<usize>, shape: &[Vector6<f64>]) {
        let start = modes.start;
        for (j, s) in shape.iter().enumerate() {
            let row = self.row[start + j];
            let carried = self.composite[member].times(s);
            for (i, t) in shape.iter().enumerate() {
                // rows of the others are still those with B held
                self.mass[(start + i, start + j)] -= row.dot(t) - carried.dot(t) * 0.5;
                self.mass[(start + j, start + i)] -= row.dot(t) - carried.dot(t) * 0.5;
            }
        }
        for (j, s) in shape.iter().enumerate() {
            let carried = self.composite[member].times(s);
            self.row[start + j] -= carried;
        }
    }

    /// Carries the force of coordinate `j`, at O of `member`'s hinge, inward: its coupling to every coordinate on the way and to the root.
    fn couple_inward(&mut self, system: &System, pose: &PoseScratch, aggregate: &Aggregate, member: usize, j: usize) {
        let (mut at, mut f) = (member, self.row[j]);
        loop {
            let k = aggregate.members[at].body;
            let own = &pose.bodies[k];
            if aggregate.holds_root_modes && at == 0 {
                break;
            }
            let felt = rotate(&own.rotation, &f);
            f = force_from(&own.l, &felt);
            let Some(p) = aggregate.members[at].parent else { break };
            let parent = &aggregate.members[p];
            if let Some(index) = pose.bodies[parent.body].flexible {
                let part = &pose.flexible[index];
                for (l, y) in parent.modes.clone().zip(pose.shape_of(system, k)) {
                    self.mass[(l, j)] = y.dot(&felt);
                }
                if pose.shape_of(system, k).is_empty() {
                    parent.modes.clone().for_each(|l| self.mass[(l, j)] = 0.0);
                }
                for (l, s) in parent.modes.clone().zip(&part.shape_inboard) {
                    self.mass[(l, j)] -= s.dot(&f);
                }
                f = rotate_back(&part.inboard.rotation, &force_from(&-part.inboard.position, &f));
                parent.modes.clone().for_each(|l| self.mass[(j, l)] = self.mass[(l, j)]);
            }
            for (e, l) in parent.rates.clone().enumerate() {
                let x = pose.bodies[parent.body].hinge.map[e].dot(&f);
                (self.mass[(l, j)], self.mass[(j, l)]) = (x, x);
            }
            at = p;
        }
        self.base[j] = f;
    }

    /// `D_E = X' M X` (lower triangle) and `U = X' base`.
    fn reduce(&mut self, embedding: &Embedding) {
        let n = self.base.len();
        for (q, &j) in embedding.independent.iter().enumerate() {
            let x = embedding.X_column(q);
            for i in 0..n {
                self.product[i] = self.mass[(i, j)];
            }
            let mut u = self.base[j];
            for (&d, x) in embedding.dependent.iter().zip(x) {
                u += self.base[d] * *x;
                for i in 0..n {
                    self.product[i] += self.mass[(i, d)] * x;
                }
            }
            self.U[q] = u;
            for (p, &i) in embedding.independent.iter().enumerate().skip(q) {
                let through: f64 = embedding.dependent.iter().zip(embedding.X_column(p)).map(|(&d, x)| x * self.product[d]).sum();
                self.D[(p, q)] = self.product[i] + through;
            }
            self.diagonal[q] = self.D[(q, q)];
        }
    }

    fn factor(&mut self, embedding: &Embedding) -> Result<(), SingularCoordinate> {
        let m = embedding.independent.len();
        let stack = MemStack::new(&mut self.memory.0);
        let view = self.D.as_mut().submatrix_mut(0, 0, m, m);
        let singular = |q: usize, inertia| SingularCoordinate { coordinate: embedding.independent[q], inertia, scale: self.diagonal[q] };
        cholesky_in_place(view, LltRegularization::default(), Par::Seq, stack, Spec::default()).map_err(
            |faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index }| singular(index.min(m.saturating_sub(1)), 0.0),
        )?;
        for q in 0..m {
            let pivot = self.D[(q, q)] * self.D[(q, q)];
            if !(pivot > SINGULAR * self.diagonal[q]) {
                return Err(SingularCoordinate { coordinate: embedding.independent[q], inertia: pivot, scale: self.diagonal[q] });
            }
        }
        Ok(())
    }
}
