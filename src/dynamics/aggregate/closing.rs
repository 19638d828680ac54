//! Closing an aggregate: the dependent coordinates of a state moved until the closures close to rounding, and their rates with them.
//!
//! Newton steps on the dependent coordinates alone, which keep their Jacobian while it serves; the independent ones stay as they are, so that
//! a motion is that of the independent coordinates whatever their followers were predicted to be.

use super::embedding::Embedding;
use crate::dynamics::DynamicsError;
use crate::dynamics::sweep::pose_outward::{PoseScratch, place};
use crate::model::hinge::MAX_RATES;
use crate::model::{Aggregate, State, System};

/// Residuals (m or rad) that are taken for rounding at once.
const CLOSED: f64 = 4.0 * f64::EPSILON;
/// Residuals (m or rad) that may be left where rounding allows no less.
const ROUNDING: f64 = 1e-10;
const LARGEST_COUNT: usize = 30;

/// Room for closing one aggregate.
#[derive(Debug, Clone)]
pub struct Closing {
    violation: Vec<f64>,
    step: Vec<f64>,
    u: Vec<f64>,
    /// Coordinates before a step.
    position: Vec<f64>,
}

impl Closing {
    /// Room for `aggregate`.
    #[must_use]
    pub fn new(aggregate: &Aggregate) -> Self {
        Self {
            violation: vec![0.0; aggregate.row_count],
            step: vec![0.0; aggregate.row_count],
            u: vec![0.0; aggregate.size()],
            position: vec![0.0; MAX_RATES + 1],
        }
    }

    /// Closes aggregate `index` of `state`; poses of its members and their closures are left in `pose`.
    ///
    /// # Errors
    /// If no state nearby closes, or the closures lose rank there.
    pub fn close(&mut self, system: &System, state: &mut State, pose: &mut PoseScratch, index: usize) -> Result<(), DynamicsError> {
        let aggregate = &system.aggregates[index];
        let mut embedding = std::mem::replace(&mut pose.embeddings[index], Embedding::empty());
        let done = self.close_positions(system, state, pose, aggregate, &mut embedding);
        if done.is_ok() {
            self.close_rates(system, state, aggregate, &embedding);
        }
        pose.embeddings[index] = embedding;
        done
    }

    fn close_positions(
        &mut self,
        system: &System,
        state: &mut State,
        pose: &mut PoseScratch,
        aggregate: &Aggregate,
        embedding: &mut Embedding,
    ) -> Result<(), DynamicsError> {
        let mut residual = self.measure(system, state, pose, aggregate);
        embedding.follow_pose(system, pose, &pose.closures, aggregate);
        // whether the Jacobian is that of the present poses
        let mut fresh = true;
        for _ in 0..LARGEST_COUNT {
            if residual <= CLOSED {
                break;
            }
            if embedding.is_lost() {
                return Err(failed(system, pose, aggregate, residual, true));
            }
            embedding.dependent_step(&self.violation, &mut self.step);
            self.advance(system, state, aggregate, embedding, 1.0);
            let left = self.measure(system, state, pose, aggregate);
            if !(left < 0.5 * residual) && residual <= ROUNDING {
                if !(left < residual) {
                    self.advance(system, state, aggregate, embedding, -1.0);
                    self.measure(system, state, pose, aggregate);
                }
                break;
            }
            if fresh && !(left < 0.5 * residual) {
                return Err(failed(system, pose, aggregate, left, false));
            }
            fresh = !(left < 0.1 * residual);
            if fresh {
                embedding.follow_pose(system, pose, &pose.closures, aggregate);
            }
            residual = left;
        }
        if !(residual <= ROUNDING) {
            return Err(failed(system, pose, aggregate, residual, false));
        }
        if !fresh {
            embedding.follow_pose(system, pose, &pose.closures, aggregate);
        }
        if embedding.is_lost() {
            return Err(failed(system, pose, aggregate, residual, true));
        }
        Ok(())
    }

    /// Places the members and their closures; returns the largest residual.
    fn measure(&mut self, system: &System, state: &State, pose: &mut PoseScratch, aggregate: &Aggregate) -> f64 {
        aggregate.members.iter().for_each(|m| place(system, state, m.body, pose));
        let mut closures = std::mem::take(&mut pose.closures);
        let (mut row, mut largest) = (0, 0.0_f64);
        for &c in &aggregate.closures {
            let closure = &system.closures[c];
            closures[c].follow_pose(closure, system, state, pose);
            let own = closures[c].residual(closure);
            self.violation[row..row + own.len()].copy_from_slice(own);
            largest = own.iter().fold(largest, |m, r| if r.is_nan() { f64::INFINITY } else { m.max(r.abs()) });
            row += own.len();
        }
        pose.closures = closures;
        largest
    }

    /// Moves the dependent coordinates by `sign` times the step.
    fn advance(&mut self, system: &System, state: &mut State, aggregate: &Aggregate, embedding: &Embedding, sign: f64) {
        for member in &aggregate.members {
            let body = &system.bodies[member.body];
            let mut delta = [0.0; MAX_RATES];
            let mut moves = false;
            for (&d, s) in embedding.dependent.iter().zip(&self.step) {
                if member.rates.contains(&d) {
                    delta[d - member.rates.start] = sign * s;
                    moves = true;
                } else if member.modes.contains(&d) {
                    state.modal_position[body.modal + d - member.modes.start] += sign * s;
                }
            }
            if moves {
                let range = body.position_range();
                let before = &mut self.position[..range.len()];
                before.copy_from_slice(&state.position[range.clone()]);
                body.hinge.kind.displace(before, &delta[..member.rates.len()], &mut state.position[range]);
            }
        }
    }

    /// Rates of the dependent coordinates from those of the others: one linear step.
    fn close_rates(&mut self, system: &System, state: &mut State, aggregate: &Aggregate, embedding: &Embedding) {
        for member in &aggregate.members {
            let body = &system.bodies[member.body];
            if !member.rates.is_empty() {
                self.u[member.rates.clone()].copy_from_slice(&state.velocity[body.velocity_range()]);
            }
            self.u[member.modes.clone()].copy_from_slice(&state.modal_velocity[body.modal_range()]);
        }
        embedding.closure_rates(&self.u, &mut self.violation);
        embedding.dependent_step(&self.violation, &mut self.step);
        for (&d, s) in embedding.dependent.iter().zip(&self.step) {
            let Some(member) = aggregate.members.iter().find(|m| (m.rates.start..m.modes.end).contains(&d)) else { continue };
            let body = &system.bodies[member.body];
            if member.rates.contains(&d) {
                state.velocity[body.velocity + d - member.rates.start] += s;
            } else {
                state.modal_velocity[body.modal + d - member.modes.start] += s;
            }
        }
    }
}

/// The closure that is furthest open.
fn failed(system: &System, pose: &PoseScratch, aggregate: &Aggregate, residual: f64, lost: bool) -> DynamicsError {
    let open = |c: usize| pose.closures[c].residual(&system.closures[c]).iter().fold(0.0_f64, |m, r| m.max(r.abs()));
    let worst = aggregate.closures.iter().copied().max_by(|&a, &b| open(a).total_cmp(&open(b))).unwrap_or(0);
    let closure = system.closures[worst].name.clone();
    if lost { DynamicsError::ChangePoint { closure } } else { DynamicsError::Unclosed { closure, residual } }
}
