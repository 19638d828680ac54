//! Velocity sweep: spatial velocities, bias accelerations `a` and gyroscopic forces `b`.
//!
//! Reads: state rates, [`PoseScratch`]. Writes: [`VelocityScratch`]. Source: Paper Eq. 27 and 30; b_fl after DESIGN 3.1.
//! Cost: O(bodies + modes), plus O(modes^2) per flexible body for the coupling of modal rates.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use super::pose_outward::PoseScratch;
use crate::dynamics::aggregate::bias::EmbeddedBias;
use crate::model::hinge::MAX_RATES;
use crate::model::{BodyKind, State, System};
use crate::spatial::shift::{angular, linear, motion_to, rotate, rotate_back, spatial};
use nalgebra::Vector6;

/// Velocity of one body and what depends on it.
#[derive(Debug, Clone, Copy, Default)]
pub struct BodyVelocity {
    /// Velocity at O in O axes.
    pub V_hinge: Vector6<f64>,
    /// Velocity of the recursion's frame (O, or B of a flexible body) in its axes.
    pub V: Vector6<f64>,
    /// Bias acceleration at O in O axes: of O+ on its parent and of the hinge; with `H* theta_ddot` of a prescribed hinge.
    pub a: Vector6<f64>,
    /// Of a flexible body, in B axes: bias acceleration of O seen from B if modes move O, else that of B seen from O.
    pub a_inboard: Vector6<f64>,
    /// Rigid rows of b in the recursion's frame.
    pub b: Vector6<f64>,
}

/// What the velocity sweep writes.
#[derive(Debug, Clone)]
pub struct VelocityScratch {
    /// One per body.
    pub bodies: Vec<BodyVelocity>,
    /// Modal rows of b, indexed like the modal coordinates.
    pub b_modal: Vec<f64>,
    /// Accelerations of prescribed hinges, indexed like the hinge rates; zero for the others.
    pub prescribed: Vec<f64>,
    /// What the rates alone make of the closures' accelerations, one per blocked direction.
    pub closure_bias: Vec<f64>,
    /// One per aggregate.
    pub embedded: Vec<EmbeddedBias>,
}

impl VelocityScratch {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        Self {
            bodies: vec![BodyVelocity::default(); system.bodies.len()],
            b_modal: vec![0.0; system.modal_count],
            prescribed: vec![0.0; system.velocity_count],
            closure_bias: vec![0.0; system.closure_rows()],
            embedded: system.aggregates.iter().map(EmbeddedBias::new).collect(),
        }
    }
}

/// Fills `out` from the rates in `state`.
pub fn velocity_outward(system: &System, state: &State, pose: &PoseScratch, out: &mut VelocityScratch) {
    for (k, body) in system.bodies.iter().enumerate() {
        let own = &pose.bodies[k];
        let (q, v) = (&state.position[body.position_range()], &state.velocity[body.velocity_range()]);

        // velocity of the point of O+ that coincides with O, then across the hinge
        let (V_plus, a_parent) = match body.parent {
            None => (Vector6::zeros(), Vector6::zeros()),
            Some(parent) => {
                let V_parent = out.bodies[parent].V;
                let eta_dot = &state.modal_velocity[system.bodies[parent].modal_range()];
                let shape = pose.shape_of(system, k);
                let V_outer = motion_to(&own.l, &V_parent) + shape.iter().zip(eta_dot).map(|(s, e)| s * *e).sum::<Vector6<f64>>();
                let a = own.outer.bias_at(&body.parent_side, &own.l, &angular(&V_parent), eta_dot);
                (rotate_back(&own.rotation, &V_outer), rotate_back(&own.rotation, &a))
            }
        };
        let mut relative = Vector6::zeros();
        for (i, v) in v.iter().enumerate() {
            relative += own.hinge.map[i] * *v;
        }
        let V_hinge = V_plus + relative;
        let omega_plus = angular(&V_plus);
        let coriolis = spatial(&omega_plus.cross(&angular(&relative)), &(omega_plus.cross(&linear(&relative)) * 2.0));
        let mut a = a_parent + coriolis;
        if !v.is_empty() {
            a += body.hinge.kind.map_rate(q, v, &own.hinge);
        }
        if let Some(motion) = &body.hinge.motion {
            for i in 0..v.len().min(MAX_RATES) {
                let [_, _, acceleration] = motion.sample(state.time, i);
                out.prescribed[body.velocity + i] = acceleration;
                a += own.hinge.map[i] * acceleration;
            }
        }

        let mut result = BodyVelocity { V_hinge, V: V_hinge, a, a_inboard: Vector6::zeros(), b: Vector6::zeros() };
        match &body.kind {
            BodyKind::Rigid(inertia) => {
                let w = angular(&V_hinge);
                let first_moment = inertia.first_moment();
                result.b = spatial(&w.cross(&(inertia.rotational * w)), &w.cross(&w.cross(&first_moment)));
            }
            BodyKind::Flexible(flexible) => {
                let eta_dot = &state.modal_velocity[body.modal_range()];
                if let Some(index) = own.flexible {
                    let part = &pose.flexible[index];
                    let x = part.inboard.position;
                    let mut V = motion_to(&-x, &rotate(&part.inboard.rotation, &V_hinge));
                    for (s, e) in part.shape_inboard.iter().zip(eta_dot) {
                        V -= s * *e;
                    }
                    let bias = part.inboard.bias_at(&flexible.inboard, &x, &angular(&V), eta_dot);
                    result.V = V;
                    // where modes move O the sweeps need its bias there, else that of B
                    result.a_inboard = if flexible.inboard.moves() { bias } else { -motion_to(&-x, &bias) };
                    let b_modal = &mut out.b_modal[body.modal_range()];
                    result.b = part.inertia.velocity_terms(&flexible.integrals, flexible.order, &angular(&V), eta_dot, b_modal);
                }
            }
        }
        out.bodies[k] = result;
    }
    if !system.closures.is_empty() {
        let mut bias = std::mem::take(&mut out.closure_bias);
        for (closure, at) in system.closures.iter().zip(&pose.closures) {
            at.bias(closure, system, state, |k| out.bodies[k].V, &mut bias[closure.rows()]);
        }
        out.closure_bias = bias;
        let mut embedded = std::mem::take(&mut out.embedded);
        for (index, own) in embedded.iter_mut().enumerate() {
            own.follow_rates(system, pose, out, index);
        }
        out.embedded = embedded;
    }
}
