//! Response sweeps: accelerations that forces alone cause, `M^-1` applied by one inward and one outward pass over the factors that an
//! inertia sweep left.
//!
//! Reads: [`PoseScratch`], [`InertiaScratch`]. Writes: [`Response`]. Source: Paper Eq. 34 to 41 (64 to 67 for aggregates) without rates,
//! gravity, springs and prescribed accelerations; what is left is linear in the forces. Prescribed hinges do not move.
//! Cost: O(bodies + modes) of the bodies passed over, about two of the five sweeps of an evaluation.

use super::inertia_inward::{InertiaScratch, solve_hinge};
use super::pose_outward::PoseScratch;
use crate::dynamics::aggregate::acceleration::AggregateAcceleration;
use crate::dynamics::aggregate::force::AggregateForce;
use crate::model::hinge::MAX_RATES;
use crate::model::{HingeKind, Role, System};
use crate::spatial::shift::{angular, force_from, linear, motion_to, rotate, rotate_back};
use nalgebra::Vector6;

/// Forces, and the accelerations that they cause.
#[derive(Debug, Clone)]
pub struct Response {
    /// Force on the rigid rows of each body, in the recursion's frame.
    pub external: Vec<Vector6<f64>>,
    /// Force on the modes.
    pub external_modal: Vec<f64>,
    /// Force on the hinge rates.
    pub applied: Vec<f64>,
    /// `z+` at O in O axes.
    pub z_plus: Vec<Vector6<f64>>,
    /// `alpha+` at O in O axes.
    pub alpha_plus: Vec<Vector6<f64>>,
    /// Accelerations of the recursion's frames.
    pub alpha: Vec<Vector6<f64>>,
    /// Accelerations of the hinge rates.
    pub hinge: Vec<f64>,
    /// Accelerations of the modal coordinates.
    pub modal: Vec<f64>,
    /// What the forces' power on the accelerations would be if nothing cancelled in it: an upper bound that shows what is rounding.
    pub bound: f64,
    z: Vec<Vector6<f64>>,
    /// Moment and force of z if nothing cancelled in it.
    size: Vec<[f64; 2]>,
    nu: Vec<[f64; MAX_RATES]>,
    nu_modal: Vec<f64>,
    alpha_free: Vec<Vector6<f64>>,
    alpha_inboard: Vec<Vector6<f64>>,
    aggregates: Vec<(AggregateForce, AggregateAcceleration)>,
}

fn weighted_sum(rows: &[Vector6<f64>], x: &[f64]) -> Vector6<f64> {
    rows.iter().zip(x).map(|(r, x)| r * *x).sum()
}

/// `|a . z|` if nothing cancelled, for a z of the given moment and force.
fn uncancelled(a: &Vector6<f64>, [moment, force]: [f64; 2]) -> f64 {
    angular(a).norm() * moment + linear(a).norm() * force
}

impl Response {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        let zeros = vec![Vector6::zeros(); system.bodies.len()];
        Self {
            external: zeros.clone(),
            external_modal: vec![0.0; system.modal_count],
            applied: vec![0.0; system.velocity_count],
            z_plus: zeros.clone(),
            alpha_plus: zeros.clone(),
            alpha: zeros.clone(),
            hinge: vec![0.0; system.velocity_count],
            modal: vec![0.0; system.modal_count],
            bound: 0.0,
            z: zeros.clone(),
            size: vec![[0.0; 2]; system.bodies.len()],
            nu: vec![[0.0; MAX_RATES]; system.bodies.len()],
            nu_modal: vec![0.0; system.modal_count],
            alpha_free: zeros.clone(),
            alpha_inboard: zeros,
            aggregates: system.aggregates.iter().map(|a| (AggregateForce::new(a), AggregateAcceleration::new(a))).collect(),
        }
    }

    /// Takes all forces away.
    pub fn clear(&mut self) {
        self.external.fill(Vector6::zeros());
        self.external_modal.fill(0.0);
        self.applied.fill(0.0);
    }

    /// Accelerations of the bodies `over` (ascending, with every parent of a listed body and whole aggregates) under the forces on them.
    pub fn solve(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, over: &[usize]) {
        self.pass::<false>(system, pose, inertia, over);
    }

    /// The same, and the [`bound`](Self::bound).
    pub fn solve_bounded(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, over: &[usize]) {
        self.pass::<true>(system, pose, inertia, over);
    }

    fn pass<const BOUND: bool>(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, over: &[usize]) {
        for &k in over {
            self.z[k] = -self.external[k];
            if BOUND {
                self.size[k] = [angular(&self.z[k]).norm(), linear(&self.z[k]).norm()];
            }
            // a child that is not passed over transmits nothing
            self.z_plus[k] = Vector6::zeros();
        }
        self.bound = 0.0;
        for &k in over.iter().rev() {
            match system.role(k) {
                Role::Member(_) => {}
                Role::Heads(index) => {
                    let felt = self.filter_aggregate::<BOUND>(system, pose, inertia, index);
                    let aggregate = &system.aggregates[index];
                    if aggregate.holds_root_modes {
                        self.filter_hinge::<BOUND>(system, pose, inertia, k, felt);
                    } else if let Some(root) = aggregate.root {
                        self.z[root] += felt;
                    }
                }
                Role::Own => {
                    let z = self.filter_modes::<BOUND>(system, pose, inertia, k);
                    self.filter_hinge::<BOUND>(system, pose, inertia, k, z);
                }
            }
        }
        for &k in over {
            match system.role(k) {
                Role::Member(_) => {}
                Role::Heads(index) => {
                    let aggregate = &system.aggregates[index];
                    let base = if aggregate.holds_root_modes {
                        self.cross_hinge(system, pose, inertia, k)
                    } else {
                        aggregate.root.map_or_else(Vector6::zeros, |root| self.alpha[root])
                    };
                    let (force, motion) = &mut self.aggregates[index];
                    motion.follow(system, pose, None, inertia, index, &force.nu, &base);
                    motion.scatter(system, index, &mut self.hinge, &mut self.modal, &mut self.alpha_plus, &mut self.alpha);
                }
                Role::Own => self.outward(system, pose, inertia, k),
            }
        }
    }

    /// Residual force of an aggregate on its root's frame.
    fn filter_aggregate<const BOUND: bool>(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        inertia: &InertiaScratch,
        index: usize,
    ) -> Vector6<f64> {
        let aggregate = &system.aggregates[index];
        let mut own = std::mem::take(&mut self.aggregates[index].0);
        for (m, member) in aggregate.members.iter().enumerate() {
            let (k, body) = (member.body, &system.bodies[member.body]);
            own.wrench[m] = self.z[k];
            own.generalised[member.rates.clone()].iter_mut().zip(&self.applied[body.velocity_range()]).for_each(|(g, a)| *g = -a);
            let modes = &mut own.generalised[member.modes.clone()];
            modes.iter_mut().zip(&self.external_modal[body.modal_range()]).for_each(|(g, e)| *g = -e);
            let Some(flexible) = pose.bodies[k].flexible else { continue };
            for &child in &inertia.flexible[flexible].moved_children {
                let felt = rotate(&pose.bodies[child].rotation, &self.z_plus[child]);
                modes.iter_mut().zip(pose.shape_of(system, child)).for_each(|(g, s)| *g += s.dot(&felt));
            }
        }
        if BOUND {
            self.bound_aggregate(system, pose, inertia, index, &own.generalised);
        }
        let felt = own.filter(system, pose, inertia, index, None);
        self.aggregates[index].0 = own;
        felt
    }

    /// Adds to the bound what an aggregate's coordinates would do if nothing cancelled, and carries the forces' sizes to its root.
    fn bound_aggregate(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, index: usize, generalised: &[f64]) {
        let (aggregate, embedding) = (&system.aggregates[index], &pose.embeddings[index]);
        for (m, member) in aggregate.members.iter().enumerate().rev() {
            let (k, own) = (member.body, &pose.bodies[member.body]);
            let part = own.flexible.map(|f| &pose.flexible[f]);
            if let Some(part) = part {
                self.size[k][0] += part.inboard.position.norm() * self.size[k][1];
            }
            let eliminated = &inertia.aggregates[index];
            for (q, &j) in embedding.independent.iter().enumerate() {
                // every coordinate that the independent one moves, through X
                let through = |d: usize| if d == j { 1.0 } else { embedding.share(d, q) };
                for (i, d) in member.rates.clone().enumerate() {
                    let size = (uncancelled(&own.hinge.map[i], self.size[k]) + generalised[d].abs()) * through(d).abs();
                    self.bound += size * size / eliminated.diagonal(q);
                }
                for d in member.modes.clone() {
                    let moved =
                        part.and_then(|p| p.shape_inboard.get(d - member.modes.start)).map_or(0.0, |s| uncancelled(s, self.size[k]));
                    let size = (generalised[d].abs() + moved) * through(d).abs();
                    self.bound += size * size / eliminated.diagonal(q);
                }
            }
            if aggregate.holds_root_modes && m == 0 {
                continue;
            }
            if let Some(parent) = system.bodies[k].parent {
                let [moment, force] = self.size[k];
                self.size[parent][0] += moment + own.l.norm() * force;
                self.size[parent][1] += force;
            }
        }
    }

    /// Modes of body `k` (Eq. 34); returns `z(k')` at O in O axes.
    fn filter_modes<const BOUND: bool>(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, k: usize) -> Vector6<f64> {
        let body = &system.bodies[k];
        match pose.bodies[k].flexible {
            None => self.z[k],
            Some(index) => {
                let (range, part, elimination) = (body.modal_range(), &pose.flexible[index], &inertia.flexible[index]);
                let nu = &mut self.nu_modal[range.clone()];
                nu.copy_from_slice(&self.external_modal[range]);
                for &child in &elimination.moved_children {
                    let Some(start) = pose.bodies[child].shape else { continue };
                    let felt = rotate(&pose.bodies[child].rotation, &self.z_plus[child]);
                    for (e, s) in nu.iter_mut().zip(&pose.shape[start..]) {
                        *e -= s.dot(&felt);
                        if BOUND {
                            self.bound += uncancelled(s, self.size[child]).powi(2);
                        }
                    }
                }
                if BOUND {
                    self.bound += nu.iter().map(|e| e * e).sum::<f64>();
                }
                elimination.modal_block.solve(nu);
                let z = self.z[k] + weighted_sum(&elimination.mu, nu);
                let x = &part.inboard.position;
                if BOUND {
                    self.size[k][0] += x.norm() * self.size[k][1];
                }
                let z = match &elimination.root {
                    None => force_from(&-x, &z),
                    Some(root) => {
                        let alpha_free = -(root.frame_inverse * z);
                        if BOUND {
                            let spread = root.frame_inverse.diagonal();
                            let [moment, force] = self.size[k];
                            self.bound += spread.rows(0, 3).sum() * moment * moment + spread.rows(3, 3).sum() * force * force;
                        }
                        nu.iter_mut().zip(&elimination.gain_modal).for_each(|(nu, e)| *nu -= e.dot(&alpha_free));
                        self.alpha_free[k] = alpha_free;
                        self.alpha_inboard[k] = motion_to(x, &alpha_free) + weighted_sum(&root.shape, nu);
                        -(root.P * self.alpha_inboard[k])
                    }
                };
                rotate_back(&part.inboard.rotation, &z)
            }
        }
    }

    /// Hinge of body `k` (Eq. 35), and what its parent feels.
    fn filter_hinge<const BOUND: bool>(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        inertia: &InertiaScratch,
        k: usize,
        z: Vector6<f64>,
    ) {
        let body = &system.bodies[k];
        self.z_plus[k] = z;
        let m = body.hinge.kind.rate_count();
        if m > 0 && !body.hinge.is_prescribed() {
            let (map, own) = (&pose.bodies[k].hinge.map, &inertia.bodies[k]);
            let nu = &mut self.nu[k];
            for i in 0..m {
                let applied = self.applied[body.velocity + i];
                let epsilon = applied - map[i].dot(&z);
                nu[i] = epsilon;
                self.z_plus[k] += own.G[i] * epsilon;
                if BOUND {
                    let size = applied.abs() + uncancelled(&map[i], self.size[k]);
                    self.bound += size * size / own.D[i][i];
                }
            }
            solve_hinge(&own.D, &mut nu[..m]);
            if matches!(body.hinge.kind, HingeKind::Free) && !inertia.with_added {
                self.z_plus[k] = Vector6::from_column_slice(&self.applied[body.velocity_range()]);
            }
        }
        if let Some(parent) = body.parent {
            if BOUND {
                let [moment, force] = self.size[k];
                self.size[parent][0] += moment + pose.bodies[k].l.norm() * force;
                self.size[parent][1] += force;
            }
            self.z[parent] += force_from(&pose.bodies[k].l, &rotate(&pose.bodies[k].rotation, &self.z_plus[k]));
        }
    }

    /// Eq. 36 to 39: the acceleration of O on the child's side.
    fn cross_hinge(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, k: usize) -> Vector6<f64> {
        let (body, own) = (&system.bodies[k], &pose.bodies[k]);
        let mut outer = Vector6::zeros();
        if let Some(parent) = body.parent {
            let eta_ddot = &self.modal[system.bodies[parent].modal_range()];
            outer = motion_to(&own.l, &self.alpha[parent]) + weighted_sum(pose.shape_of(system, k), eta_ddot);
        }
        let alpha_plus = rotate_back(&own.rotation, &outer);
        self.alpha_plus[k] = alpha_plus;
        let mut alpha = alpha_plus;
        if !body.hinge.is_prescribed() {
            for i in 0..body.hinge.kind.rate_count() {
                let acceleration = self.nu[k][i] - inertia.bodies[k].G[i].dot(&alpha_plus);
                self.hinge[body.velocity + i] = acceleration;
                alpha += own.hinge.map[i] * acceleration;
            }
        }
        alpha
    }

    fn outward(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, k: usize) {
        let mut alpha = self.cross_hinge(system, pose, inertia, k);
        let (body, own) = (&system.bodies[k], &pose.bodies[k]);
        if let Some(index) = own.flexible {
            let (part, elimination, range) = (&pose.flexible[index], &inertia.flexible[index], body.modal_range());
            let alpha_o = rotate(&part.inboard.rotation, &alpha);
            let modal = &mut self.modal[range.clone()];
            modal.copy_from_slice(&self.nu_modal[range]);
            alpha = match &elimination.root {
                None => {
                    let alpha_b = motion_to(&-part.inboard.position, &alpha_o);
                    modal.iter_mut().zip(&elimination.gain_modal).for_each(|(m, e)| *m -= e.dot(&alpha_b));
                    alpha_b
                }
                Some(root) => {
                    let f = root.P * (alpha_o - self.alpha_inboard[k]);
                    modal.iter_mut().zip(&root.modal_per_force).for_each(|(m, e)| *m += e.dot(&f));
                    self.alpha_free[k] + root.frame_per_force * f
                }
            };
        }
        self.alpha[k] = alpha;
    }
}
