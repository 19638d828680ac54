//! Acceleration sweep: hinge and modal accelerations, from the base to the tips.
//!
//! Reads: the earlier sweeps. Writes: [`AccelerationScratch`]. Source: Paper Eq. 36 to 41 (the last line of Eq. 41 ends in `z+(k')`).
//! Cost: O(bodies + modes).

use super::force_inward::{ForceScratch, world_acceleration};
use super::inertia_inward::InertiaScratch;
use super::pose_outward::PoseScratch;
use super::velocity_outward::VelocityScratch;
use crate::dynamics::aggregate::acceleration::AggregateAcceleration;
use crate::model::{Role, System};
use crate::spatial::shift::{motion_to, rotate, rotate_back};
use nalgebra::Vector6;

/// What the acceleration sweep writes.
#[derive(Debug, Clone)]
pub struct AccelerationScratch {
    /// `alpha+(k')` at O in O axes, one per body.
    pub alpha_plus: Vec<Vector6<f64>>,
    /// `alpha(k)` of the recursion's frame in its axes, one per body; its linear part is acceleration less gravity.
    pub alpha: Vec<Vector6<f64>>,
    /// Accelerations of the hinge rates.
    pub hinge: Vec<f64>,
    /// Accelerations of the modal coordinates.
    pub modal: Vec<f64>,
    /// One per aggregate.
    pub aggregates: Vec<AggregateAcceleration>,
}

impl AccelerationScratch {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        Self {
            alpha_plus: vec![Vector6::zeros(); system.bodies.len()],
            alpha: vec![Vector6::zeros(); system.bodies.len()],
            hinge: vec![0.0; system.velocity_count],
            modal: vec![0.0; system.modal_count],
            aggregates: system.aggregates.iter().map(AggregateAcceleration::new).collect(),
        }
    }

    /// True if the accelerations of all coordinates are numbers.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.hinge.iter().chain(&self.modal).fold(true, |finite, x| finite & x.is_finite())
    }
}

/// Fills `out` from the earlier sweeps.
pub fn acceleration_outward(
    system: &System,
    pose: &PoseScratch,
    velocity: &VelocityScratch,
    inertia: &InertiaScratch,
    force: &ForceScratch,
    out: &mut AccelerationScratch,
) {
    let world = world_acceleration(system);
    for (k, body) in system.bodies.iter().enumerate() {
        let own = &pose.bodies[k];
        let role = system.role(k);
        match role {
            Role::Member(_) => continue,
            Role::Heads(index) if !system.aggregates[index].holds_root_modes => {
                let base = system.aggregates[index].root.map_or(world, |root| out.alpha[root]);
                follow_aggregate(system, pose, velocity, inertia, force, index, &base, out);
                continue;
            }
            Role::Heads(_) | Role::Own => {}
        }
        let mut alpha_outer = motion_to(&own.l, &body.parent.map_or(world, |p| out.alpha[p]));
        if let Some(parent) = body.parent {
            let eta_ddot = &out.modal[system.bodies[parent].modal_range()];
            for (s, e) in pose.shape_of(system, k).iter().zip(eta_ddot) {
                alpha_outer += s * *e;
            }
        }
        let alpha_plus = rotate_back(&own.rotation, &alpha_outer);
        out.alpha_plus[k] = alpha_plus;

        let mut alpha = alpha_plus + velocity.bodies[k].a;
        if body.hinge.is_prescribed() {
            let range = body.velocity_range();
            out.hinge[range.clone()].copy_from_slice(&velocity.prescribed[range]);
        } else {
            for i in 0..body.hinge.kind.rate_count() {
                let acceleration = force.bodies[k].nu[i] - inertia.bodies[k].G[i].dot(&alpha_plus);
                out.hinge[body.velocity + i] = acceleration;
                alpha += own.hinge.map[i] * acceleration;
            }
        }
        if let Role::Heads(index) = role {
            follow_aggregate(system, pose, velocity, inertia, force, index, &alpha, out);
            continue;
        }
        if let Some(index) = own.flexible {
            let (part, elimination) = (&pose.flexible[index], &inertia.flexible[index]);
            let alpha_o = rotate(&part.inboard.rotation, &alpha);
            let (range, free) = (body.modal_range(), &force.bodies[k]);
            let modal = &mut out.modal[range.clone()];
            modal.copy_from_slice(&force.nu_modal[range]);
            alpha = match &elimination.root {
                None => {
                    let alpha_b = motion_to(&-part.inboard.position, &alpha_o);
                    modal.iter_mut().zip(&elimination.gain_modal).for_each(|(m, e)| *m -= e.dot(&alpha_b));
                    alpha_b + velocity.bodies[k].a_inboard
                }
                Some(root) => {
                    let f = root.P * (alpha_o - free.alpha_inboard);
                    modal.iter_mut().zip(&root.modal_per_force).for_each(|(m, e)| *m += e.dot(&f));
                    free.alpha_free + root.frame_per_force * f
                }
            };
        }
        out.alpha[k] = alpha;
    }
}

/// Aggregate `index`, whose root's frame accelerates as `base` (Eq. 66 and 67).
#[expect(clippy::too_many_arguments, reason = "a sweep step reads every earlier sweep")]
fn follow_aggregate(
    system: &System,
    pose: &PoseScratch,
    velocity: &VelocityScratch,
    inertia: &InertiaScratch,
    force: &ForceScratch,
    index: usize,
    base: &Vector6<f64>,
    out: &mut AccelerationScratch,
) {
    let AccelerationScratch { alpha_plus, alpha, hinge, modal, aggregates } = out;
    for member in &system.aggregates[index].members {
        let range = system.bodies[member.body].velocity_range();
        if system.bodies[member.body].hinge.is_prescribed() && !member.rates.is_empty() {
            hinge[range.clone()].copy_from_slice(&velocity.prescribed[range]);
        }
    }
    aggregates[index].follow(system, pose, Some(velocity), inertia, index, &force.aggregates[index].nu, base);
    aggregates[index].scatter(system, index, hinge, modal, alpha_plus, alpha);
}
