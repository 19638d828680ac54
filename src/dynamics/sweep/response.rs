//! Response sweeps: accelerations per generalised force, `x = M^-1 tau`, with the factors that an inertia sweep left.
//!
//! Reads: [`PoseScratch`], [`InertiaScratch`]. Writes: [`ResponseScratch`]. Source: Paper Eq. 34 to 41 without velocities, gravity,
//! biases and loads, so that forces act on hinge rates and modes alone. Prescribed hinges do not move.
//! Cost: O(bodies + modes), about two of the five sweeps of an evaluation.

use super::inertia_inward::{FlexibleElimination, InertiaScratch, solve_hinge};
use super::pose_outward::{FlexiblePose, PoseScratch};
use crate::model::hinge::MAX_RATES;
use crate::model::{Body, System};
use crate::spatial::shift::{force_from, motion_to, rotate, rotate_back};
use nalgebra::Vector6;

/// Residual force and motion of one body.
#[derive(Debug, Clone, Copy)]
struct BodyResponse {
    z: Vector6<f64>,
    z_plus: Vector6<f64>,
    alpha: Vector6<f64>,
    nu: [f64; MAX_RATES],
    /// Accelerations of B and O without a force at O, in B axes; only where modes move O.
    alpha_free: Vector6<f64>,
    alpha_inboard: Vector6<f64>,
}

/// What the response sweeps write.
#[derive(Debug, Clone)]
pub struct ResponseScratch {
    bodies: Vec<BodyResponse>,
    /// Accelerations of the hinge rates.
    pub hinge: Vec<f64>,
    /// Accelerations of the modal coordinates.
    pub modal: Vec<f64>,
}

impl ResponseScratch {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        let zero = Vector6::zeros();
        let empty = BodyResponse { z: zero, z_plus: zero, alpha: zero, nu: [0.0; MAX_RATES], alpha_free: zero, alpha_inboard: zero };
        Self { bodies: vec![empty; system.bodies.len()], hinge: vec![0.0; system.velocity_count], modal: vec![0.0; system.modal_count] }
    }
}

/// Fills `out` with the accelerations due to `hinge_force` and `modal_force`, indexed like hinge rates and modal coordinates.
pub fn response(
    system: &System,
    pose: &PoseScratch,
    inertia: &InertiaScratch,
    hinge_force: &[f64],
    modal_force: &[f64],
    out: &mut ResponseScratch,
) {
    out.modal.copy_from_slice(modal_force);
    for body in &mut out.bodies {
        body.z = Vector6::zeros();
    }
    for (k, body) in system.bodies.iter().enumerate().rev() {
        let z = match pose.bodies[k].flexible {
            None => out.bodies[k].z,
            Some(index) => {
                let z = filter_modes(body, pose, &pose.flexible[index], &inertia.flexible[index], k, out);
                rotate_back(&pose.flexible[index].inboard.rotation, &z)
            }
        };
        let own = &mut out.bodies[k];
        own.z_plus = z;
        if !body.hinge.is_prescribed() {
            let m = body.hinge.kind.rate_count();
            for i in 0..m {
                let epsilon = hinge_force[body.velocity + i] - pose.bodies[k].hinge.map[i].dot(&z);
                own.nu[i] = epsilon;
                own.z_plus += inertia.bodies[k].G[i] * epsilon;
            }
            solve_hinge(&inertia.bodies[k].D, &mut own.nu[..m]);
        }
        if let Some(parent) = body.parent {
            let felt = force_from(&pose.bodies[k].l, &rotate(&pose.bodies[k].rotation, &out.bodies[k].z_plus));
            out.bodies[parent].z += felt;
        }
    }
    move_outward(system, pose, inertia, out);
}

/// Modes of flexible body `k` (Eq. 34); returns `z(k')` at O in B axes.
fn filter_modes(
    body: &Body,
    pose: &PoseScratch,
    part: &FlexiblePose,
    elimination: &FlexibleElimination,
    k: usize,
    out: &mut ResponseScratch,
) -> Vector6<f64> {
    let weighted_sum = |rows: &[Vector6<f64>], x: &[f64]| rows.iter().zip(x).map(|(r, x)| r * *x).sum::<Vector6<f64>>();
    let nu = &mut out.modal[body.modal_range()];
    for &child in &elimination.moved_children {
        let Some(start) = pose.bodies[child].shape else { continue };
        let felt = rotate(&pose.bodies[child].rotation, &out.bodies[child].z_plus);
        nu.iter_mut().zip(&pose.shape[start..]).for_each(|(e, s)| *e -= s.dot(&felt));
    }
    elimination.modal_block.solve(nu);
    let own = &mut out.bodies[k];
    let z = own.z + weighted_sum(&elimination.mu, nu);
    let Some(root) = &elimination.root else {
        return force_from(&-part.inboard.position, &z);
    };
    own.alpha_free = -(root.frame_inverse * z);
    nu.iter_mut().zip(&elimination.gain_modal).for_each(|(nu, e)| *nu -= e.dot(&own.alpha_free));
    own.alpha_inboard = motion_to(&part.inboard.position, &own.alpha_free) + weighted_sum(&root.shape, nu);
    -(root.P * own.alpha_inboard)
}

/// Eq. 36 to 41.
fn move_outward(system: &System, pose: &PoseScratch, inertia: &InertiaScratch, out: &mut ResponseScratch) {
    for (k, body) in system.bodies.iter().enumerate() {
        let own = &pose.bodies[k];
        let mut alpha_outer = Vector6::zeros();
        if let Some(parent) = body.parent {
            alpha_outer = motion_to(&own.l, &out.bodies[parent].alpha);
            let eta_ddot = &out.modal[system.bodies[parent].modal_range()];
            pose.shape_of(system, k).iter().zip(eta_ddot).for_each(|(s, e)| alpha_outer += s * *e);
        }
        let alpha_plus = rotate_back(&own.rotation, &alpha_outer);
        let mut alpha = alpha_plus;
        for i in 0..body.hinge.kind.rate_count() {
            let mut acceleration = 0.0;
            if !body.hinge.is_prescribed() {
                acceleration = out.bodies[k].nu[i] - inertia.bodies[k].G[i].dot(&alpha_plus);
                alpha += own.hinge.map[i] * acceleration;
            }
            out.hinge[body.velocity + i] = acceleration;
        }
        if let Some(index) = own.flexible {
            let (part, elimination) = (&pose.flexible[index], &inertia.flexible[index]);
            let alpha_o = rotate(&part.inboard.rotation, &alpha);
            let modal = &mut out.modal[body.modal_range()];
            alpha = match &elimination.root {
                None => {
                    let alpha_b = motion_to(&-part.inboard.position, &alpha_o);
                    modal.iter_mut().zip(&elimination.gain_modal).for_each(|(m, e)| *m -= e.dot(&alpha_b));
                    alpha_b
                }
                Some(root) => {
                    let f = root.P * (alpha_o - out.bodies[k].alpha_inboard);
                    modal.iter_mut().zip(&root.modal_per_force).for_each(|(m, e)| *m += e.dot(&f));
                    out.bodies[k].alpha_free + root.frame_per_force * f
                }
            };
        }
        out.bodies[k].alpha = alpha;
    }
}
