//! Closed chains: a tree whose closures are held by multipliers, or embedded in aggregate bodies ([`super::aggregate`]).
//!
//! [`constraint`] says what a closure blocks; [`schur`] solves for the multipliers of cut joints, whatever the rank; [`tree_augmented`] puts
//! this together with the response sweep (Paper section 4); [`assembly`] closes the loops of an initial state; [`drift`] keeps them
//! closed during a run, whichever method holds them.
//!
//! | Paper | here | meaning | shape |
//! |---|---|---|---|
//! | G | `ClosureAt::along`, `ClosureAt::push` for G' | blocked directions of b relative to a | c x n |
//! | U | `closure_bias` with the sign of `G u_dot + bias = 0` | what rates make of the blocked accelerations | c |
//! | lambda | `lambda` | multipliers: forces on b | c |
//! | G M^-1 G' | `Schur` | loop inertia | c x c |
//!
//! The sign follows `M u_dot + C = Q + G' lambda` (Eq. 43 prints the opposite).

pub mod assembly;
pub mod constraint;
pub mod drift;
pub mod embedded;
pub mod least_norm;
pub mod schur;
pub mod tree_augmented;

use super::DynamicsError;
use super::aggregate::Embedding;
use super::aggregate::closing::Closing;
use super::aggregate::load::AggregateLoad;
use super::sweep::acceleration_outward::AccelerationScratch;
use super::sweep::force_inward::world_acceleration;
use super::sweep::inertia_inward::InertiaScratch;
use super::sweep::pose_outward::PoseScratch;
use super::sweep::response::Response;
use super::sweep::velocity_outward::VelocityScratch;
use crate::model::{Aggregate, Closure, ClosureJoint, ClosureMethod, State, System};
use constraint::{Motion, SystemForces};
pub use embedded::check_embedded;
use nalgebra::Vector6;
use schur::Schur;

/// Everything that closures need of an evaluation, allocated once; systems without closures have none.
#[derive(Debug, Clone)]
pub struct ClosedChain {
    /// Multipliers of the last evaluation, one per blocked direction of all closures.
    pub lambda: Vec<f64>,
    /// Loop inertia of the closures that are cut.
    pub schur: Schur,
    /// Loads inside aggregates, and their closing.
    loads: Vec<AggregateLoad>,
    closings: Vec<Closing>,
    /// Aggregates, those that hang on another's members before it.
    inner_first: Vec<usize>,
    response: Response,
    /// Blocked directions of cut closures, among those of all.
    cut: Vec<usize>,
    /// One number per blocked direction of all closures.
    right: Vec<f64>,
    column: Vec<f64>,
    unit: Vec<f64>,
    /// One number per blocked direction of the cut closures.
    cut_right: Vec<f64>,
    cut_lambda: Vec<f64>,
    /// Bodies that a closure loads.
    loaded: Vec<usize>,
    /// Bodies that a cut closure loads, with all that carry them.
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
    /// How far the closures are from losing rank: of cut ones the smallest singular value of the scaled rows kept, relative to the
    /// largest; of embedded ones the smallest pivot of the scaled rows.
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
        let is_cut = |c: &&Closure| c.method == ClosureMethod::TreeAugmented;
        let mut carried = vec![false; system.bodies.len()];
        let carry = |carried: &mut [bool], mut open: Option<usize>| {
            while let Some(k) = open.filter(|&k| !carried[k]) {
                carried[k] = true;
                open = system.bodies[k].parent;
            }
        };
        system.closures.iter().filter(is_cut).flat_map(bodies_of).for_each(|end| carry(&mut carried, end));
        // an aggregate moves as a whole
        let partly =
            |carried: &[bool], a: &&Aggregate| a.members.iter().any(|m| carried[m.body]) && !a.members.iter().all(|m| carried[m.body]);
        while let Some(aggregate) = system.aggregates.iter().find(|a| partly(&carried, a)) {
            aggregate.members.iter().for_each(|m| carry(&mut carried, Some(m.body)));
        }
        let rows = system.closure_rows();
        let cut: Vec<usize> = system.closures.iter().filter(is_cut).flat_map(Closure::rows).collect();
        let mut inner_first: Vec<usize> = (0..system.aggregates.len()).collect();
        inner_first.sort_by_key(|&a| std::cmp::Reverse(system.aggregates[a].members[0].body));
        let mut loaded: Vec<usize> = system.closures.iter().flat_map(bodies_of).flatten().collect();
        loaded.sort_unstable();
        loaded.dedup();
        Some(Box::new(Self {
            lambda: vec![0.0; rows],
            schur: Schur::new(cut.len()),
            loads: system.aggregates.iter().map(|a| AggregateLoad::new(system, a)).collect(),
            closings: system.aggregates.iter().map(Closing::new).collect(),
            inner_first,
            response: Response::new(system),
            right: vec![0.0; rows],
            column: vec![0.0; rows],
            unit: vec![0.0; rows],
            cut_right: vec![0.0; cut.len()],
            cut_lambda: vec![0.0; cut.len()],
            cut,
            loaded,
            support: (0..carried.len()).filter(|&k| carried[k]).collect(),
            all: (0..carried.len()).collect(),
        }))
    }

    /// Rates of all blocked directions.
    pub fn rates(&self, system: &System, state: &State, pose: &PoseScratch, velocity: &VelocityScratch, out: &mut [f64]) {
        let motion = Motion {
            body: |k: usize| velocity.bodies[k].V,
            world: Vector6::zeros(),
            hinge: &state.velocity,
            modal: Some(&state.modal_velocity),
        };
        along(system, pose, &motion, out);
    }

    /// Forces of the multipliers `lambda` (of all closures) into the response, alone.
    fn push(&mut self, system: &System, pose: &PoseScratch, lambda: &[f64]) {
        let Response { external, external_modal, applied, .. } = &mut self.response;
        for &k in self.loaded.iter().chain(&self.support) {
            external[k] = Vector6::zeros();
            external_modal[system.bodies[k].modal_range()].fill(0.0);
            applied[system.bodies[k].velocity_range()].fill(0.0);
        }
        for (closure, at) in system.closures.iter().zip(&pose.closures) {
            let own = &lambda[closure.rows()];
            if own.iter().any(|l| *l != 0.0) {
                at.push(closure, own, &mut SystemForces { system, external, modal: external_modal, applied });
            }
        }
    }

    /// `Lambda = G M^-1 G'` of the cut closures, one column per blocked direction.
    pub fn assemble_loop_inertia(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch) {
        for c in 0..self.cut.len() {
            let mut unit = std::mem::take(&mut self.unit);
            unit.fill(0.0);
            unit[self.cut[c]] = 1.0;
            self.push(system, pose, &unit);
            self.unit = unit;
            self.response.solve_bounded(system, pose, inertia, &self.support);
            self.schur.bound[c] = self.response.bound;
            let response = &self.response;
            let motion = Motion {
                body: |k: usize| response.alpha[k],
                world: Vector6::zeros(),
                hinge: &response.hinge,
                modal: Some(&response.modal),
            };
            for (closure, at) in system.closures.iter().zip(&pose.closures).filter(|(c, _)| c.method == ClosureMethod::TreeAugmented) {
                at.along(closure, system, &motion, &mut self.column[closure.rows()]);
            }
            for (i, &row) in self.cut.iter().enumerate() {
                self.schur.matrix[(i, c)] = self.column[row];
            }
        }
    }

    /// What the last evaluation's closures leave undetermined.
    #[must_use]
    pub fn rank_report(&self, system: &System, pose: &PoseScratch) -> RankReport {
        let mut shares = vec![0.0; self.lambda.len()];
        for (c, &row) in self.cut.iter().enumerate() {
            shares[row] = self.schur.redundancy(c);
        }
        let mut smallest = self.cut_distance_to_rank_loss();
        let mut rank = self.schur.rank();
        for (aggregate, embedding) in system.aggregates.iter().zip(&pose.embeddings) {
            let rows = aggregate.closures.iter().flat_map(|&c| system.closures[c].rows());
            rows.enumerate().for_each(|(own, row)| shares[row] = embedding.redundancy(own));
            rank += embedding.rank();
            smallest = smallest.min(embedding.smallest_pivot * embedding.pivot_ratio);
        }
        let shared = |c: &&Closure| c.rows().any(|row| shares[row] > 1e-6);
        RankReport {
            rows: self.lambda.len(),
            rank,
            redundant: system.closures.iter().filter(shared).map(|c| c.name.clone()).collect(),
            smallest,
        }
    }

    /// How near the loops are to a change point, where they lose rank; see [`RankReport::smallest`].
    #[must_use]
    pub fn distance_to_rank_loss(&self, pose: &PoseScratch) -> f64 {
        pose.embeddings.iter().map(|e| e.smallest_pivot * e.pivot_ratio).fold(self.cut_distance_to_rank_loss(), f64::min)
    }

    /// The same of the cut closures alone; infinite without any.
    #[must_use]
    pub fn cut_distance_to_rank_loss(&self) -> f64 {
        if self.cut.is_empty() { f64::INFINITY } else { self.schur.distance_to_rank_loss() }
    }

    /// Refuses accelerations that open a closure: what no multiplier or coordinate reaches, whatever the scales of its rows.
    ///
    /// # Errors
    /// Naming the closure that opens fastest.
    pub fn check_closed(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        velocity: &VelocityScratch,
        acceleration: &AccelerationScratch,
    ) -> Result<(), DynamicsError> {
        let mut opening = std::mem::take(&mut self.right);
        self.accelerations(system, pose, acceleration, world_acceleration(system), &mut opening);
        let (mut worst, mut fastest, mut felt) = (0, 0.0_f64, 0.0_f64);
        for (index, closure) in system.closures.iter().enumerate() {
            for row in closure.rows() {
                let open = (opening[row] + velocity.closure_bias[row]).abs();
                felt = felt.max(velocity.closure_bias[row].abs());
                // what is not a number is left to those who look for it
                if open > fastest {
                    (worst, fastest) = (index, open);
                }
            }
        }
        self.right = opening;
        felt = self.loaded.iter().map(|&k| acceleration.alpha[k].amax()).fold(felt, f64::max);
        if fastest <= OPENING * felt + rounding_of_rates(velocity) {
            return Ok(());
        }
        let rank = self.schur.rank() + pose.embeddings.iter().map(Embedding::rank).sum::<usize>();
        Err(DynamicsError::ContradictoryClosures { closure: system.closures[worst].name.clone(), rank, rows: self.lambda.len() })
    }

    /// Accelerations of all blocked directions; `world` is the acceleration of the world.
    fn accelerations(&self, system: &System, pose: &PoseScratch, acceleration: &AccelerationScratch, world: Vector6<f64>, out: &mut [f64]) {
        let motion = Motion { body: |k: usize| acceleration.alpha[k], world, hinge: &acceleration.hinge, modal: Some(&acceleration.modal) };
        along(system, pose, &motion, out);
    }
}

/// Share of the largest acceleration by which a closure may yet open once all loops are solved: rounding, which near a change point grows.
const OPENING: f64 = 1e-5;

/// Share of the closures' accelerations that may lie where nothing reaches before they are said to contradict one another: closures
/// assembled to 1e-10 leave less, and motions that no loop allows leave all.
const CONTRADICTION: f64 = 1e-6;

/// Accelerations (m/s^2 or rad/s^2) that rates make which assembly leaves as rounding: below these nothing contradicts.
fn rounding_of_rates(velocity: &VelocityScratch) -> f64 {
    let speed = velocity.bodies.iter().map(|b| b.V.amax()).fold(1.0, f64::max);
    assembly::FITS * speed * speed
}

/// Motion along the blocked directions of all closures.
fn along<F: Fn(usize) -> Vector6<f64>>(system: &System, pose: &PoseScratch, motion: &Motion<'_, F>, out: &mut [f64]) {
    for (closure, at) in system.closures.iter().zip(&pose.closures) {
        at.along(closure, system, motion, &mut out[closure.rows()]);
    }
}
