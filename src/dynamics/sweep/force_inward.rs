//! Force sweep: residual forces `z`, innovations and `nu`, from the tips to the base.
//!
//! Reads: state, [`PoseScratch`], [`VelocityScratch`], [`InertiaScratch`]. Writes: [`ForceScratch`].
//! Source: Paper Eq. 34 and 35. Cost: O(bodies + modes + loads).

use super::inertia_inward::{FlexibleElimination, InertiaScratch, solve_hinge};
use super::pose_outward::PoseScratch;
use super::velocity_outward::VelocityScratch;
use crate::dynamics::aggregate::force::{AggregateForce, filter_aggregate};
use crate::dynamics::frame_motion::FramePose;
use crate::dynamics::world::{WorldFrame, world_frames};
use crate::model::hinge::MAX_RATES;
use crate::model::{Body, HingeKind, Load, LoadAxes, LoadPoint, Role, State, System};
use crate::spatial::shift::{force_from, motion_to, rotate, rotate_back, spatial};
use nalgebra::{Vector3, Vector6};

/// Residual forces at one hinge.
#[derive(Debug, Clone, Copy)]
pub struct BodyForce {
    /// Rigid rows of `z` in the recursion's frame.
    pub z: Vector6<f64>,
    /// `z+(k')` at O in O axes.
    pub z_plus: Vector6<f64>,
    /// `D^-1 epsilon` of the hinge.
    pub nu: [f64; MAX_RATES],
    /// Acceleration of B without a force at O; only for bodies whose modes move O.
    pub alpha_free: Vector6<f64>,
    /// Acceleration of O without a force there, bias included, in B axes; only for bodies whose modes move O.
    pub alpha_inboard: Vector6<f64>,
}

/// Forces on bodies and modes beside those of the system's loads.
#[derive(Debug, Clone)]
pub struct AddedForces {
    /// On the rigid rows of each body, in the recursion's frame.
    pub external: Vec<Vector6<f64>>,
    /// On the modes, indexed like the modal coordinates.
    pub modal: Vec<f64>,
}

/// What the force sweep writes.
#[derive(Debug, Clone)]
pub struct ForceScratch {
    /// One per body.
    pub bodies: Vec<BodyForce>,
    /// External force on the rigid rows of each body, in the recursion's frame; empty without loads and closures.
    pub external: Vec<Vector6<f64>>,
    /// External force on the modes, indexed like the modal coordinates; empty without loads and closures.
    pub external_modal: Vec<f64>,
    /// `nu` of the modes, indexed like the modal coordinates.
    pub nu_modal: Vec<f64>,
    /// Hinge forces of springs, dampers and motors, indexed like the hinge rates.
    pub applied: Vec<f64>,
    /// Added to the external forces at every sweep; none unless room was made for it.
    pub added: Option<AddedForces>,
    /// One per aggregate.
    pub aggregates: Vec<AggregateForce>,
    /// World frames of the bodies; empty unless a load is given in inertial axes.
    world: Vec<WorldFrame>,
    shape: Vec<Vector6<f64>>,
}

impl ForceScratch {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        let (loaded, closed) = (!system.loads.is_empty(), !system.closures.is_empty());
        Self {
            bodies: vec![
                BodyForce {
                    z: Vector6::zeros(),
                    z_plus: Vector6::zeros(),
                    nu: [0.0; MAX_RATES],
                    alpha_free: Vector6::zeros(),
                    alpha_inboard: Vector6::zeros(),
                };
                system.bodies.len()
            ],
            external: vec![Vector6::zeros(); if loaded || closed { system.bodies.len() } else { 0 }],
            external_modal: vec![0.0; if loaded || closed { system.modal_count } else { 0 }],
            nu_modal: vec![0.0; system.modal_count],
            applied: vec![0.0; system.velocity_count],
            added: None,
            aggregates: system.aggregates.iter().map(AggregateForce::new).collect(),
            world: vec![WorldFrame::default(); if system.has_world_loads() { system.bodies.len() } else { 0 }],
            shape: vec![Vector6::zeros(); if loaded { system.largest_mode_count() } else { 0 }],
        }
    }

    /// Room for forces that are added to those of the loads; zero at first.
    pub fn make_room_for_added(&mut self, system: &System) {
        self.external.resize(system.bodies.len(), Vector6::zeros());
        self.external_modal.resize(system.modal_count, 0.0);
        self.added = Some(AddedForces { external: self.external.clone(), modal: self.external_modal.clone() });
    }
}

/// Fills `out` from the state and the earlier sweeps.
pub fn force_inward(
    system: &System,
    state: &State,
    pose: &PoseScratch,
    velocity: &VelocityScratch,
    inertia: &InertiaScratch,
    out: &mut ForceScratch,
) {
    gather_applied(system, state, pose, out);
    for k in 0..system.bodies.len() {
        let external = out.external.get(k).copied().unwrap_or_default();
        out.bodies[k].z = velocity.bodies[k].b - external;
    }
    for (k, body) in system.bodies.iter().enumerate().rev() {
        let own = &velocity.bodies[k];
        let z_hinge = match (system.role(k), pose.bodies[k].flexible) {
            (Role::Member(_), _) => continue,
            (Role::Heads(index), _) => {
                let aggregate = &system.aggregates[index];
                for member in &aggregate.members {
                    if let Some(flexible) = pose.bodies[member.body].flexible {
                        gather_innovations(system, state, pose, velocity, &inertia.flexible[flexible], member.body, out);
                    }
                }
                let felt = filter_aggregate(system, pose, velocity, inertia, index, out);
                if !aggregate.holds_root_modes {
                    if let Some(root) = aggregate.root {
                        out.bodies[root].z += felt;
                    }
                    continue;
                }
                felt
            }
            (Role::Own, None) => out.bodies[k].z,
            (Role::Own, Some(index)) => {
                let z = filter_modes(system, state, pose, velocity, inertia, k, index, out);
                rotate_back(&pose.flexible[index].inboard.rotation, &z)
            }
        };
        let z_hinge = z_hinge + inertia.bodies[k].P_hinge.times(&own.a);
        filter_hinge(body, &pose.bodies[k].hinge.map, &inertia.bodies[k], z_hinge, out, k);
        if let Some(parent) = body.parent {
            let felt = force_from(&pose.bodies[k].l, &rotate(&pose.bodies[k].rotation, &out.bodies[k].z_plus));
            out.bodies[parent].z += felt;
        }
    }
}

/// Forces of loads, springs, dampers and motors at `state`: the part of the sweep that needs no inertias.
pub fn gather_applied(system: &System, state: &State, pose: &PoseScratch, out: &mut ForceScratch) {
    // closures add their forces after the free pass, so that these start anew in every evaluation
    out.external.fill(Vector6::zeros());
    out.external_modal.fill(0.0);
    if let Some(added) = &out.added {
        out.external.copy_from_slice(&added.external);
        out.external_modal.copy_from_slice(&added.modal);
    }
    if !system.loads.is_empty() {
        apply_loads(system, state, pose, out);
    }
    for body in &system.bodies {
        let applied = &mut out.applied[body.velocity_range()];
        body.hinge.applied_force(state.time, &state.position[body.position_range()], &state.velocity[body.velocity_range()], applied);
    }
}

/// Modes of flexible body `k` (Eq. 34); returns `z(k')` at O in B axes, less the bias of the hinge.
#[expect(clippy::too_many_arguments, reason = "a sweep step reads every earlier sweep")]
fn filter_modes(
    system: &System,
    state: &State,
    pose: &PoseScratch,
    velocity: &VelocityScratch,
    inertia: &InertiaScratch,
    k: usize,
    index: usize,
    out: &mut ForceScratch,
) -> Vector6<f64> {
    let (part, elimination) = (&pose.flexible[index], &inertia.flexible[index]);
    gather_innovations(system, state, pose, velocity, elimination, k, out);
    let nu = &mut out.nu_modal[system.bodies[k].modal_range()];
    let Some(root) = &elimination.root else {
        // a held root: B moves with O, and its bias enters through P_fr and P_rr, which hold the children
        let a = velocity.bodies[k].a_inboard;
        nu.iter_mut().zip(&elimination.mu).for_each(|(e, mu)| *e -= mu.dot(&a));
        elimination.modal_block.solve(nu);
        let z = out.bodies[k].z + inertia.bodies[k].P.times(&a) + weighted_sum(&elimination.mu, nu);
        return force_from(&-part.inboard.position, &z);
    };
    // a root that modes move: accelerations with no force at O, then the force that moves O as it must
    elimination.modal_block.solve(nu);
    let alpha_free = -(root.frame_inverse * (out.bodies[k].z + weighted_sum(&elimination.mu, nu)));
    for (nu, e) in nu.iter_mut().zip(&elimination.gain_modal) {
        *nu -= e.dot(&alpha_free);
    }
    let free = motion_to(&part.inboard.position, &alpha_free) + weighted_sum(&root.shape, nu);
    out.bodies[k].alpha_free = alpha_free;
    out.bodies[k].alpha_inboard = free + velocity.bodies[k].a_inboard;
    -(root.P * out.bodies[k].alpha_inboard)
}

/// `epsilon = -z_m` of the modes of flexible body `k`, without what the bias of its hinge adds; left in `nu_modal`.
fn gather_innovations(
    system: &System,
    state: &State,
    pose: &PoseScratch,
    velocity: &VelocityScratch,
    elimination: &FlexibleElimination,
    k: usize,
    out: &mut ForceScratch,
) {
    let body = &system.bodies[k];
    let range = body.modal_range();
    let nu = &mut out.nu_modal[range.clone()];
    if let Some(flexible) = body.flexible() {
        flexible.elastic_force(&state.modal_position[range.clone()], &state.modal_velocity[range.clone()], nu);
    }
    for (nu, b) in nu.iter_mut().zip(&velocity.b_modal[range.clone()]) {
        *nu = -(*nu + b);
    }
    if let Some(external) = out.external_modal.get(range) {
        nu.iter_mut().zip(external).for_each(|(e, x)| *e += x);
    }
    for &child in &elimination.moved_children {
        let child_pose = &pose.bodies[child];
        let Some(start) = child_pose.shape else { continue };
        let felt = rotate(&child_pose.rotation, &out.bodies[child].z_plus);
        nu.iter_mut().zip(&pose.shape[start..]).for_each(|(e, s)| *e -= s.dot(&felt));
    }
}

/// `sum_j x_j rows_j`.
fn weighted_sum(rows: &[Vector6<f64>], x: &[f64]) -> Vector6<f64> {
    rows.iter().zip(x).map(|(r, x)| r * *x).sum()
}

/// Hinge of body `k` (Eq. 35).
fn filter_hinge(
    body: &Body,
    map: &[Vector6<f64>; MAX_RATES],
    inertia: &super::inertia_inward::BodyInertia,
    z: Vector6<f64>,
    out: &mut ForceScratch,
    k: usize,
) {
    let own = &mut out.bodies[k];
    own.z_plus = z;
    let m = body.hinge.kind.rate_count();
    if m == 0 || body.hinge.is_prescribed() {
        return;
    }
    let applied = &out.applied[body.velocity_range()];
    for i in 0..m {
        let epsilon = applied[i] - map[i].dot(&z);
        own.nu[i] = epsilon;
        own.z_plus += inertia.G[i] * epsilon;
    }
    solve_hinge(&inertia.D, &mut own.nu[..m]);
    if matches!(body.hinge.kind, HingeKind::Free) {
        // the hinge transmits what acts on its rates and nothing else
        own.z_plus = Vector6::from_iterator(applied.iter().copied());
    }
}

/// External loads on the rows of their bodies.
fn apply_loads(system: &System, state: &State, pose: &PoseScratch, out: &mut ForceScratch) {
    if !out.world.is_empty() {
        world_frames(system, pose, &mut out.world);
    }
    for load in &system.loads {
        let body = &system.bodies[load.body];
        let value = match load.axes {
            LoadAxes::World => rotate_back(&out.world[load.body].rotation, &load.value(state.time)),
            LoadAxes::Body => rotate(&body.frame_rotation, &load.value(state.time)),
        };
        let eta = &state.modal_position[body.modal_range()];
        let shape = &mut out.shape[..eta.len()];
        let point = load_shape(load, eta, shape);
        out.external[load.body] += force_from(&point, &value);
        for (x, s) in out.external_modal[body.modal_range()].iter_mut().zip(shape.iter()) {
            *x += s.dot(&value);
        }
    }
}

/// Present point of a load (m) in the recursion's frame of its body, and the mode shape there.
pub(in crate::dynamics) fn load_shape(load: &Load, eta: &[f64], shape: &mut [Vector6<f64>]) -> Vector3<f64> {
    match &load.point {
        LoadPoint::Rigid(point) => *point,
        LoadPoint::Interface(attachment) => {
            let frame = FramePose::of(attachment, eta);
            shape.fill(Vector6::zeros());
            frame.shape_at(attachment, &frame.position, shape);
            frame.position
        }
        LoadPoint::Node { position, mode_shape } => {
            shape.copy_from_slice(mode_shape);
            let displacement: Vector6<f64> = mode_shape.iter().zip(eta).map(|(s, e)| s * *e).sum();
            position + displacement.fixed_rows::<3>(3)
        }
    }
}

/// Force of gravity is not here: it enters as the acceleration of the world. This is that acceleration.
#[must_use]
pub fn world_acceleration(system: &System) -> Vector6<f64> {
    spatial(&Vector3::zeros(), &-system.gravity)
}
