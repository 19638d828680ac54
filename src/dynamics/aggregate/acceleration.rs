//! Accelerations of an aggregate's members from that of its root (Paper Eq. 66 and 67).

use super::spread::spread_outward;
use crate::dynamics::sweep::inertia_inward::InertiaScratch;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::sweep::velocity_outward::VelocityScratch;
use crate::model::{Aggregate, System};
use nalgebra::Vector6;

/// Motion of one aggregate.
#[derive(Debug, Clone)]
pub struct AggregateAcceleration {
    /// Accelerations of all coordinates; zero for prescribed ones.
    pub u_dot: Vec<f64>,
    /// `alpha+` at O in O axes, one per member.
    pub alpha_plus: Vec<Vector6<f64>>,
    /// `alpha` of the recursion's frames, one per member.
    pub alpha: Vec<Vector6<f64>>,
    independent: Vec<f64>,
}

impl AggregateAcceleration {
    /// Room for `aggregate`.
    #[must_use]
    pub fn new(aggregate: &Aggregate) -> Self {
        let zeros = vec![Vector6::zeros(); aggregate.members.len()];
        Self { u_dot: vec![0.0; aggregate.size()], alpha_plus: zeros.clone(), alpha: zeros, independent: vec![0.0; aggregate.size()] }
    }

    /// Follows the root's frame, which accelerates as `base`; with the biases in `velocity`, or without any.
    #[expect(clippy::too_many_arguments, reason = "a sweep step reads every earlier sweep")]
    pub fn follow(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        velocity: Option<&VelocityScratch>,
        inertia: &InertiaScratch,
        index: usize,
        nu: &[f64],
        base: &Vector6<f64>,
    ) {
        let (aggregate, embedding) = (&system.aggregates[index], &pose.embeddings[index]);
        let independent = &mut self.independent[..embedding.independent.len()];
        for ((u, nu), w) in independent.iter_mut().zip(nu).zip(&inertia.aggregates[index].W) {
            *u = nu - w.dot(base);
        }
        embedding.expand(independent, velocity.map(|v| v.embedded[index].particular.as_slice()), &mut self.u_dot);
        spread_outward(system, pose, velocity, aggregate, base, &self.u_dot, &mut self.alpha_plus, &mut self.alpha);
    }

    /// Writes the motion to the places of its bodies among those of the system.
    pub fn scatter(
        &self,
        system: &System,
        index: usize,
        hinge: &mut [f64],
        modal: &mut [f64],
        alpha_plus: &mut [Vector6<f64>],
        alpha: &mut [Vector6<f64>],
    ) {
        let aggregate = &system.aggregates[index];
        for (m, member) in aggregate.members.iter().enumerate() {
            let body = &system.bodies[member.body];
            modal[body.modal_range()].copy_from_slice(&self.u_dot[member.modes.clone()]);
            alpha[member.body] = self.alpha[m];
            if aggregate.holds_root_modes && m == 0 {
                continue;
            }
            alpha_plus[member.body] = self.alpha_plus[m];
            if !body.hinge.is_prescribed() {
                hinge[body.velocity_range()].copy_from_slice(&self.u_dot[member.rates.clone()]);
            }
        }
    }
}
