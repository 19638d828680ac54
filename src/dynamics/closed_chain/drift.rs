//! Drift control: the state moved back onto the closures by the least change in the metric of the mass matrix.
//!
//! Positions by Newton steps `M^-1 G' (G M^-1 G')^+ (-residual)`, then rates by one such step: the least kinetic energy that does it, as an
//! impulse would. Loads are untouched: they come from the state alone. Near a loss of rank, directions that would
//! need large moves for small residuals are left to the acceleration level.

use crate::dynamics::sweep::{inertia_inward, pose_outward, velocity_outward};
use crate::dynamics::{DynamicsError, Workspace};
use crate::model::hinge::MAX_RATES;
use crate::model::{State, System};

/// Residuals that are left alone (m or rad, and per second relative to the rates).
const CLOSED: f64 = 1e-13;
/// Directions whose loop inertia is below this multiple of the largest are not corrected.
const NEAR_RANK_LOSS: f64 = 1e-8;
const LARGEST_COUNT: usize = 4;

/// Largest violations after a projection.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drift {
    /// m or rad.
    pub position: f64,
    /// m/s or rad/s.
    pub rate: f64,
    /// Whether the state was moved.
    pub moved: bool,
}

/// Largest magnitude; infinite if one is not a number.
fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| if x.is_nan() { f64::INFINITY } else { x.abs().max(m) })
}

/// Largest violations at `state`, which is left as it is; `workspace` holds its poses and velocities afterwards.
pub fn measure(system: &System, state: &State, workspace: &mut Workspace) -> Drift {
    let Workspace { pose, velocity, closed, .. } = workspace;
    let Some(chain) = closed else { return Drift::default() };
    pose_outward::pose_outward(system, state, pose);
    velocity_outward::velocity_outward(system, state, pose, velocity);
    let mut found = std::mem::take(&mut chain.right);
    pose.residuals(system, &mut found);
    let position = largest(&found);
    chain.rates(system, state, pose, velocity, &mut found);
    let rate = largest(&found);
    chain.right = found;
    Drift { position, rate, moved: false }
}

/// Moves `state` onto the closures; nothing happens without closures or if it is there already.
///
/// # Errors
/// If an inertia is singular on the way, or an aggregate cannot be closed.
pub fn project(system: &System, state: &mut State, workspace: &mut Workspace) -> Result<Drift, DynamicsError> {
    workspace.close_aggregates(system, state)?;
    let mut drift = measure(system, state, workspace);
    if workspace.closed.as_ref().is_none_or(|c| c.cut.is_empty()) {
        return Ok(drift);
    }
    let mut moved = false;
    for _ in 0..LARGEST_COUNT {
        if drift.position <= CLOSED {
            break;
        }
        let before = (drift.position, state.clone());
        if !correct(system, state, workspace, true)? {
            break;
        }
        drift = measure(system, state, workspace);
        if drift.position >= before.0 {
            // rounding, or a direction that is left alone
            *state = before.1;
            drift = measure(system, state, workspace);
            break;
        }
        moved = true;
    }
    let speed = workspace.velocity.bodies.iter().map(|b| b.V.amax()).fold(1.0, f64::max);
    if drift.rate > CLOSED * speed && correct(system, state, workspace, false)? {
        moved = true;
        drift = measure(system, state, workspace);
    }
    drift.moved = moved;
    Ok(drift)
}

/// One Newton step on positions or rates; false if the loop inertia cannot be factored.
fn correct(system: &System, state: &mut State, workspace: &mut Workspace, positions: bool) -> Result<bool, DynamicsError> {
    let Workspace { pose, velocity, inertia, closed, .. } = workspace;
    let Some(chain) = closed else { return Ok(false) };
    inertia_inward::inertia_inward(system, pose, inertia)?;
    chain.assemble_loop_inertia(system, pose, inertia);
    if chain.schur.factor(NEAR_RANK_LOSS).is_err() {
        return Ok(false);
    }
    let mut right = std::mem::take(&mut chain.right);
    if positions {
        pose.residuals(system, &mut right);
    } else {
        chain.rates(system, state, pose, velocity, &mut right);
    }
    for (x, &row) in chain.cut_right.iter_mut().zip(&chain.cut) {
        *x = -right[row];
    }
    chain.right = right;
    chain.schur.solve(&chain.cut_right, &mut chain.cut_lambda);
    chain.respond(system, pose, inertia);
    let (hinge, modal) = (&chain.response.hinge, &chain.response.modal);
    for body in system.bodies.iter().filter(|b| !b.hinge.is_prescribed()) {
        let (q, v) = (body.position_range(), body.velocity_range());
        if positions {
            let mut base = [0.0; MAX_RATES + 1];
            let base = &mut base[..q.len()];
            base.copy_from_slice(&state.position[q.clone()]);
            body.hinge.kind.displace(base, &hinge[v], &mut state.position[q]);
        } else {
            state.velocity[v.clone()].iter_mut().zip(&hinge[v]).for_each(|(a, b)| *a += b);
        }
    }
    let modes = if positions { &mut state.modal_position } else { &mut state.modal_velocity };
    modes.iter_mut().zip(modal).for_each(|(a, b)| *a += b);
    workspace.close_aggregates(system, state)?;
    Ok(true)
}
