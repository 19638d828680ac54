//! Initial assembly: a state given as a guess is moved until its closures close, or refused with the closure's name.
//!
//! Damped Gauss-Newton steps of least norm on the hinges that may move; modes move only if hinges alone cannot close the loops. A
//! position that fits within 1e-10 is left as given, and so are rates.

use super::ClosedChain;
use super::drift::measure;
use super::least_norm::least_norm;
use crate::dynamics::Workspace;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::model::hinge::MAX_RATES;
use crate::model::{State, System};
use crate::spatial::shift::{force_from, rotate, rotate_back};
use nalgebra::{DMatrix, DVector};
use thiserror::Error;

/// Violations that are left as given (m or rad, and per second).
pub const FITS: f64 = 1e-10;
const CLOSED: f64 = 1e-13;
const LARGEST_COUNT: usize = 100;
/// Singular values below this multiple of the largest are not followed.
const SMALL: f64 = 1e-9;

/// A closure that cannot be closed.
#[derive(Debug, Error, Clone, PartialEq)]
#[error(
    "closure \"{name}\" cannot be assembled: it stays open by {residual:.3e} {unit} in the nearest state found ({nearest}); change its frames, the initial positions, or which hinges are held or prescribed"
)]
pub struct AssemblyError {
    /// Index of the closure.
    pub closure: usize,
    /// Its name.
    pub name: String,
    /// What is left open.
    pub residual: f64,
    /// "m or rad", or that per second.
    pub unit: &'static str,
    /// Hinge coordinates of the nearest state.
    pub nearest: String,
}

/// What assembly did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Assembled {
    /// Whether positions were moved.
    pub positions: bool,
    /// Whether rates were changed.
    pub rates: bool,
    /// What hinges alone left open (m or rad), if modes had to be moved too.
    pub bent: Option<f64>,
}

/// Closes the loops of `state`; nothing happens without closures or if it fits.
///
/// # Errors
/// [`AssemblyError`] if no state close by fits; `state` is then the nearest one found.
pub fn assemble(system: &System, state: &mut State) -> Result<Assembled, AssemblyError> {
    let mut workspace = Workspace::new(system);
    let mut done = Assembled::default();
    let mut drift = measure(system, state, &mut workspace);
    if drift.position > FITS {
        done.positions = true;
        for modes in [false, true] {
            if drift.position > FITS && (!modes || system.modal_count > 0) {
                done.bent = modes.then_some(drift.position);
                close_positions(system, state, &mut workspace, modes);
                drift = measure(system, state, &mut workspace);
            }
        }
        if drift.position > FITS {
            return Err(refusal(system, state, &workspace, true));
        }
    }
    let speed = workspace.velocity.bodies.iter().map(|b| b.V.amax()).fold(1.0, f64::max);
    if drift.rate > FITS * speed {
        done.rates = true;
        for modes in [false, true] {
            if drift.rate > FITS * speed && (!modes || system.modal_count > 0) {
                close_rates(system, state, &mut workspace, modes);
                drift = measure(system, state, &mut workspace);
            }
        }
        if drift.rate > FITS * speed {
            return Err(refusal(system, state, &workspace, false));
        }
    }
    Ok(done)
}

fn violations(system: &System, state: &State, workspace: &Workspace, positions: bool) -> DVector<f64> {
    let mut out = DVector::zeros(system.closure_rows());
    if let Some(chain) = &workspace.closed {
        if positions {
            workspace.pose.residuals(system, out.as_mut_slice());
        } else {
            chain.rates(system, state, &workspace.pose, &workspace.velocity, out.as_mut_slice());
        }
    }
    out
}

fn refusal(system: &System, state: &State, workspace: &Workspace, positions: bool) -> AssemblyError {
    let found = violations(system, state, workspace, positions);
    let worst = |i: usize| system.closures[i].rows().map(|r| found[r].abs()).fold(0.0, f64::max);
    let closure = (0..system.closures.len()).max_by(|&i, &j| worst(i).total_cmp(&worst(j))).unwrap_or(0);
    let numbers = |x: &[f64]| x.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(", ");
    let moving = system.bodies.iter().filter(|b| !b.position_range().is_empty());
    let coordinates = |b: &crate::model::Body| {
        let x = if positions { &state.position[b.position_range()] } else { &state.velocity[b.velocity_range()] };
        format!("{} = [{}]", b.hinge.name, numbers(x))
    };
    AssemblyError {
        closure,
        name: system.closures[closure].name.clone(),
        residual: worst(closure),
        unit: if positions { "m or rad" } else { "m/s or rad/s" },
        nearest: moving.map(coordinates).collect::<Vec<_>>().join("; "),
    }
}

/// Rows of G on the coordinates that may move: hinge rates, then modes. Held and prescribed hinges have zero columns.
fn jacobian(system: &System, pose: &PoseScratch, chain: &mut ClosedChain, modes: bool) -> DMatrix<f64> {
    let (rows, nv) = (system.closure_rows(), system.velocity_count);
    let mut jacobian = DMatrix::zeros(rows, nv + system.modal_count);
    let mut unit = vec![0.0; rows];
    for row in 0..rows {
        unit.fill(0.0);
        unit[row] = 1.0;
        chain.response.clear();
        chain.push(system, pose, &unit);
        let (external, modal) = (&mut chain.response.external, &mut chain.response.external_modal);
        for k in (0..system.bodies.len()).rev() {
            let (body, own) = (&system.bodies[k], &pose.bodies[k]);
            let mut force = external[k];
            if let Some(index) = own.flexible {
                let part = &pose.flexible[index];
                for (m, s) in modal[body.modal_range()].iter_mut().zip(&part.shape_inboard) {
                    *m -= s.dot(&force);
                }
                force = rotate_back(&part.inboard.rotation, &force_from(&-part.inboard.position, &force));
            }
            if !body.hinge.is_prescribed() && !body.hinge.held {
                for (i, m) in body.velocity_range().enumerate() {
                    jacobian[(row, m)] = own.hinge.map[i].dot(&force) + chain.response.applied[m];
                }
            }
            if let Some(parent) = body.parent {
                let felt = rotate(&own.rotation, &force);
                for (m, s) in modal[system.bodies[parent].modal_range()].iter_mut().zip(pose.shape_of(system, k)) {
                    *m += s.dot(&felt);
                }
                external[parent] += force_from(&own.l, &felt);
            }
        }
        if modes {
            for (m, x) in modal.iter().enumerate() {
                jacobian[(row, nv + m)] = *x;
            }
        }
    }
    chain.response.clear();
    jacobian
}

/// Step of least norm that takes the violations away, damped by `damping` relative to the largest singular value; zero if nothing can move.
fn step(jacobian: &DMatrix<f64>, violation: &DVector<f64>, damping: f64) -> DVector<f64> {
    least_norm(jacobian, &-violation, SMALL, damping).unwrap_or_else(|| DVector::zeros(jacobian.ncols()))
}

fn moved(system: &System, state: &State, step: &DVector<f64>) -> State {
    let mut out = state.clone();
    for body in &system.bodies {
        let (q, v) = (body.position_range(), body.velocity_range());
        let mut delta = [0.0; MAX_RATES];
        let delta = &mut delta[..v.len()];
        delta.iter_mut().zip(v).for_each(|(d, m)| *d = step[m]);
        if delta.iter().any(|d| *d != 0.0) {
            body.hinge.kind.displace(&state.position[q.clone()], delta, &mut out.position[q]);
        }
    }
    for (m, eta) in out.modal_position.iter_mut().enumerate() {
        *eta += step[system.velocity_count + m];
    }
    out
}

fn close_positions(system: &System, state: &mut State, workspace: &mut Workspace, modes: bool) {
    let mut damping = 0.0;
    let mut size = violations(system, state, workspace, true).norm();
    for _ in 0..LARGEST_COUNT {
        if size <= CLOSED {
            return;
        }
        let found = violations(system, state, workspace, true);
        let Workspace { pose, closed, .. } = workspace;
        let Some(chain) = closed else { return };
        let rows = jacobian(system, pose, chain, modes);
        let mut change = step(&rows, &found, damping);
        // a step of more than half a radian or half a metre leaves what the linear rows know
        let longest = change.amax();
        if longest > 0.5 {
            change *= 0.5 / longest;
        }
        let trial = moved(system, state, &change);
        measure(system, &trial, workspace);
        let left = violations(system, &trial, workspace, true).norm();
        if left < size {
            (*state, size) = (trial, left);
            damping *= 0.1;
        } else {
            measure(system, state, workspace);
            if size <= FITS || damping > 1e3 {
                return;
            }
            damping = if damping < 1e-6 { 1e-4 } else { damping * 10.0 };
        }
    }
}

fn close_rates(system: &System, state: &mut State, workspace: &mut Workspace, modes: bool) {
    // one step would do but for rounding
    for _ in 0..2 {
        let found = violations(system, state, workspace, false);
        let Workspace { pose, closed, .. } = workspace;
        let Some(chain) = closed else { return };
        let change = step(&jacobian(system, pose, chain, modes), &found, 0.0);
        let (hinge, modal) = change.as_slice().split_at(system.velocity_count);
        state.velocity.iter_mut().zip(hinge).for_each(|(v, d)| *v += d);
        state.modal_velocity.iter_mut().zip(modal).for_each(|(v, d)| *v += d);
        measure(system, state, workspace);
    }
}
