//! Energies, momenta and the power of everything that is not conservative.

use super::Workspace;
use super::hinge_load::hinge_load;
use super::world::{WorldFrame, world_frames};
use crate::model::{BodyKind, State, System};
use crate::spatial::shift::{angular, linear};
use nalgebra::{Vector3, Vector6};

/// Energies (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energy {
    /// Of motion, modes included.
    pub kinetic: f64,
    /// Of modes and hinge springs.
    pub strain: f64,
    /// Of uniform gravity; zero with the mass at the inertial origin.
    pub potential: f64,
}

impl Energy {
    /// Sum of the three.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.kinetic + self.strain + self.potential
    }
}

/// Momenta in inertial axes, angular about the inertial origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Momentum {
    /// kg m/s.
    pub linear: Vector3<f64>,
    /// kg m^2/s.
    pub angular: Vector3<f64>,
}

/// Momentum of one body at the origin of its frame, in its axes: (angular; linear), first moment, and twice its kinetic energy.
fn body_momentum(system: &System, state: &State, workspace: &Workspace, k: usize) -> (Vector6<f64>, Vector3<f64>, f64) {
    let body = &system.bodies[k];
    let velocity = workspace.velocity.bodies[k].V;
    match (&body.kind, workspace.pose.bodies[k].flexible) {
        (BodyKind::Flexible(_), Some(index)) => {
            let inertia = &workspace.pose.flexible[index].inertia;
            let eta_dot = &state.modal_velocity[body.modal_range()];
            let modal: Vector6<f64> = inertia.row.iter().zip(eta_dot).map(|(r, e)| r * *e).sum();
            let momentum = inertia.rigid.times(&velocity) + modal;
            let twice = velocity.dot(&(momentum + modal)) + eta_dot.iter().map(|e| e * e).sum::<f64>();
            (momentum, inertia.first_moment, twice)
        }
        (BodyKind::Rigid(inertia), _) => {
            let momentum = inertia.times(&velocity);
            let first_moment = inertia.first_moment();
            (momentum, first_moment, velocity.dot(&momentum))
        }
        (BodyKind::Flexible(_), None) => (Vector6::zeros(), Vector3::zeros(), 0.0),
    }
}

/// Energies and momenta at the state of the last evaluation in `workspace`; `frames` is room for one frame per body.
pub fn balance(system: &System, state: &State, workspace: &Workspace, frames: &mut [WorldFrame]) -> (Energy, Momentum) {
    world_frames(system, &workspace.pose, frames);
    let (mut energy, mut total) = (Energy::default(), Momentum::default());
    for (k, body) in system.bodies.iter().enumerate() {
        let (momentum, first_moment, twice_kinetic) = body_momentum(system, state, workspace, k);
        energy.kinetic += 0.5 * twice_kinetic;
        energy.strain += body.hinge.spring_energy(&state.position[body.position_range()]);
        if let Some(flexible) = body.flexible() {
            energy.strain += flexible.strain_energy(&state.modal_position[body.modal_range()]);
        }
        let frame = &frames[k];
        energy.potential -= system.gravity.dot(&(frame.position * body.mass() + frame.rotation * first_moment));
        let linear_part = frame.rotation * linear(&momentum);
        total.linear += linear_part;
        total.angular += frame.rotation * angular(&momentum) + frame.position.cross(&linear_part);
    }
    (energy, total)
}

/// Power (W) of motors, dampers, prescribed motions, modal damping and external loads at the last evaluation in `workspace`: the rate of
/// the total energy.
#[must_use]
pub fn power(system: &System, state: &State, workspace: &Workspace) -> f64 {
    if let Some(tree) = workspace.kernel() {
        return tree.power(system, state);
    }
    let mut total = 0.0;
    for (k, body) in system.bodies.iter().enumerate() {
        let v = &state.velocity[body.velocity_range()];
        if body.hinge.is_prescribed() {
            // the drive does what the load along the hinge does, less what the hinge's spring stores
            let load = hinge_load(workspace, k);
            let map = &workspace.pose.bodies[k].hinge.map;
            total += v.iter().enumerate().map(|(i, v)| map[i].dot(&load) * v).sum::<f64>();
            total += spring_power(system, state, k);
        } else {
            for (i, v) in v.iter().enumerate() {
                total += workspace.force.applied[body.velocity + i] * v;
            }
            total += spring_power(system, state, k);
        }
        if let Some(flexible) = body.flexible() {
            let eta_dot = &state.modal_velocity[body.modal_range()];
            total -= flexible.damping.iter().zip(eta_dot).map(|(c, e)| c * e * e).sum::<f64>();
        }
        if let Some(external) = workspace.force.external.get(k) {
            total += external.dot(&workspace.velocity.bodies[k].V);
            let eta_dot = &state.modal_velocity[body.modal_range()];
            total += workspace.force.external_modal[body.modal_range()].iter().zip(eta_dot).map(|(f, e)| f * e).sum::<f64>();
        }
    }
    total
}

/// Rate at which the springs of hinge `k` take up energy.
fn spring_power(system: &System, state: &State, k: usize) -> f64 {
    let body = &system.bodies[k];
    if body.hinge.stiffness.is_empty() {
        return 0.0;
    }
    let (q, v) = (&state.position[body.position_range()], &state.velocity[body.velocity_range()]);
    let spring = body.hinge.spring_force(q);
    -spring.iter().zip(v).map(|(f, v)| f * v).sum::<f64>()
}
