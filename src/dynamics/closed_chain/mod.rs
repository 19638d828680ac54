//! Closed chains: a tree whose closures are held by multipliers.
//!
//! [`constraint`] says what a closure blocks; [`response`] applies `M^-1` to forces with the factors of the free pass; [`schur`] solves for
//! the multipliers, whatever the rank; [`tree_augmented`] puts the three together (Paper section 4); [`assembly`] closes the loops of an
//! initial state; [`drift`] keeps them closed during a run.
//!
//! | Paper | here | meaning | shape |
//! |---|---|---|---|
//! | G | `ClosureAt::along`, `ClosureAt::push` for G' | blocked directions of b relative to a | c x n |
//! | U | `bias` with the sign of `G u_dot + bias = 0` | what rates make of the blocked accelerations | c |
//! | lambda | `lambda` | multipliers: forces on b | c |
//! | G M^-1 G' | `Schur` | loop inertia | c x c |
//!
//! The sign follows `M u_dot + C = Q + G' lambda` (Eq. 43 prints the opposite).

pub mod assembly;
pub mod constraint;
pub mod drift;
pub mod least_norm;
pub mod response;
pub mod schur;
pub mod tree_augmented;

use super::sweep::acceleration_outward::AccelerationScratch;
use super::sweep::inertia_inward::InertiaScratch;
use super::sweep::pose_outward::PoseScratch;
use super::sweep::velocity_outward::VelocityScratch;
use crate::model::{Closure, ClosureJoint, State, System};
use constraint::{ClosureAt, Motion};
use nalgebra::Vector6;
use response::Response;
use schur::Schur;

/// Everything that closures need of an evaluation, allocated once; systems without closures have none.
#[derive(Debug, Clone)]
pub struct ClosedChain {
    /// One per closure.
    pub closures: Vec<ClosureAt>,
    /// Multipliers of the last evaluation.
    pub lambda: Vec<f64>,
    /// Loop inertia of the last evaluation.
    pub schur: Schur,
    response: Response,
    right: Vec<f64>,
    column: Vec<f64>,
    unit: Vec<f64>,
    /// Bodies that a closure loads, with all that carry them.
    support: Vec<usize>,
    all: Vec<usize>,
}

/// What the closures leave undetermined.
#[derive(Debug, Clone, PartialEq)]
pub struct RankReport {
    /// Blocked directions.
    pub rows: usize,
    /// Independent ones.
    pub rank: usize,
    /// Closures whose loads are not determined: they are those of least norm.
    pub redundant: Vec<String>,
    /// Smallest singular value of the scaled rows kept, relative to the largest.
    pub smallest: f64,
}

/// Bodies that a closure acts on.
fn bodies_of(closure: &Closure) -> [Option<usize>; 2] {
    match &closure.joint {
        ClosureJoint::Frames { a, b, .. } => [a.body, b.body],
        ClosureJoint::Gear { a, b, .. } => [Some(a.body), Some(b.body)],
    }
}

impl ClosedChain {
    /// Room for the closures of `system`; none without any.
    #[must_use]
    pub fn new(system: &System) -> Option<Box<Self>> {
        if system.closures.is_empty() {
            return None;
        }
        let mut carried = vec![false; system.bodies.len()];
        for end in system.closures.iter().flat_map(bodies_of) {
            let mut open = end;
            while let Some(k) = open {
                carried[k] = true;
                open = system.bodies[k].parent;
            }
        }
        let rows = system.closure_rows();
        Some(Box::new(Self {
            closures: system.closures.iter().map(ClosureAt::new).collect(),
            lambda: vec![0.0; rows],
            schur: Schur::new(rows),
            response: Response::new(system),
            right: vec![0.0; rows],
            column: vec![0.0; rows],
            unit: vec![0.0; rows],
            support: (0..carried.len()).filter(|&k| carried[k]).collect(),
            all: (0..carried.len()).collect(),
        }))
    }

    fn pairs<'s>(&'s self, system: &'s System) -> impl Iterator<Item = (&'s Closure, &'s ClosureAt)> {
        system.closures.iter().zip(&self.closures)
    }

    /// Takes in the poses of an evaluation.
    pub fn follow_pose(&mut self, system: &System, state: &State, pose: &PoseScratch) {
        for (closure, at) in system.closures.iter().zip(&mut self.closures) {
            at.follow_pose(closure, system, state, pose);
        }
    }

    /// Takes in the rates of an evaluation.
    pub fn follow_rates(&mut self, system: &System, state: &State, velocity: &VelocityScratch) {
        for (closure, at) in system.closures.iter().zip(&mut self.closures) {
            at.follow_rates(closure, system, state, |k| velocity.bodies[k].V);
        }
    }

    /// Largest violation of closure `index` (m or rad) at the last poses.
    #[must_use]
    pub fn residual(&self, system: &System, index: usize) -> f64 {
        self.closures[index].residual(&system.closures[index]).iter().fold(0.0, |m, r| r.abs().max(m))
    }

    /// Load of closure `index`: on b at b's point, in a's axes.
    #[must_use]
    pub fn load(&self, system: &System, index: usize) -> Vector6<f64> {
        let closure = &system.closures[index];
        self.closures[index].load(closure, &self.lambda[closure.rows()])
    }

    /// Residuals of all blocked directions.
    pub fn residuals(&self, system: &System, out: &mut [f64]) {
        for (closure, at) in self.pairs(system) {
            out[closure.rows()].copy_from_slice(at.residual(closure));
        }
    }

    /// Rates of all blocked directions.
    pub fn rates(&self, system: &System, state: &State, velocity: &VelocityScratch, out: &mut [f64]) {
        let motion =
            Motion { body: |k: usize| velocity.bodies[k].V, world: Vector6::zeros(), hinge: &state.velocity, modal: &state.modal_velocity };
        for (closure, at) in self.pairs(system) {
            at.along(closure, system, &motion, &mut out[closure.rows()]);
        }
    }

    /// Accelerations of all blocked directions; `world` is the acceleration of the world.
    fn accelerations(&self, system: &System, acceleration: &AccelerationScratch, world: Vector6<f64>, out: &mut [f64]) {
        let motion = Motion { body: |k: usize| acceleration.alpha[k], world, hinge: &acceleration.hinge, modal: &acceleration.modal };
        for (closure, at) in self.pairs(system) {
            at.along(closure, system, &motion, &mut out[closure.rows()]);
        }
    }

    /// Forces of the multipliers `lambda` into the response, alone.
    fn push(&mut self, system: &System, lambda: &[f64]) {
        let Response { external, external_modal, applied, .. } = &mut self.response;
        for &k in &self.support {
            external[k] = Vector6::zeros();
            external_modal[system.bodies[k].modal_range()].fill(0.0);
            applied[system.bodies[k].velocity_range()].fill(0.0);
        }
        for (closure, at) in system.closures.iter().zip(&self.closures) {
            let own = &lambda[closure.rows()];
            if own.iter().any(|l| *l != 0.0) {
                at.push(closure, system, own, external, external_modal, applied);
            }
        }
    }

    /// `Lambda = G M^-1 G'`, one column per blocked direction.
    pub fn assemble_loop_inertia(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch) {
        let rows = self.lambda.len();
        for row in 0..rows {
            let mut unit = std::mem::take(&mut self.unit);
            unit.fill(0.0);
            unit[row] = 1.0;
            self.push(system, &unit);
            self.unit = unit;
            self.response.solve(system, pose, inertia, &self.support);
            self.schur.bound[row] = self.response.bound;
            let motion = Motion {
                body: |k: usize| self.response.alpha[k],
                world: Vector6::zeros(),
                hinge: &self.response.hinge,
                modal: &self.response.modal,
            };
            for (closure, at) in system.closures.iter().zip(&self.closures) {
                at.along(closure, system, &motion, &mut self.column[closure.rows()]);
            }
            for (i, x) in self.column.iter().enumerate() {
                self.schur.matrix[(i, row)] = *x;
            }
        }
    }

    /// What the last factored loop inertia leaves undetermined.
    #[must_use]
    pub fn rank_report(&self, system: &System) -> RankReport {
        let shared = |c: &&Closure| c.rows().any(|row| self.schur.redundancy(row) > 1e-6);
        RankReport {
            rows: self.lambda.len(),
            rank: self.schur.rank(),
            redundant: system.closures.iter().filter(shared).map(|c| c.name.clone()).collect(),
            smallest: self.schur.distance_to_rank_loss(),
        }
    }
}
