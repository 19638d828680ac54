//! What the rates of an aggregate make of its accelerations: `X_dot` times the independent rates (Paper Eq. 58 to 60).
//!
//! With the root and every free coordinate at rest the members' frames still accelerate, by their biases and by prescribed hinges; the
//! dependent coordinates accelerate so that the closures do not open by it.

use super::spread::spread_outward;
use crate::dynamics::closed_chain::constraint::Motion;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::sweep::velocity_outward::VelocityScratch;
use crate::model::{Aggregate, System};
use nalgebra::Vector6;

/// Accelerations that the rates of one aggregate make alone.
#[derive(Debug, Clone)]
pub struct EmbeddedBias {
    /// Accelerations of the members' frames with the root and all coordinates at rest but prescribed ones.
    pub alpha: Vec<Vector6<f64>>,
    /// `X_dot u_R`: accelerations of the dependent coordinates that close the loop then; zero for the others.
    pub particular: Vec<f64>,
    /// Part of the closures' accelerations that no coordinate reaches, and their size.
    pub missed: [f64; 2],
    alpha_plus: Vec<Vector6<f64>>,
    violation: Vec<f64>,
    step: Vec<f64>,
}

impl EmbeddedBias {
    /// Room for `aggregate`.
    #[must_use]
    pub fn new(aggregate: &Aggregate) -> Self {
        let zeros = vec![Vector6::zeros(); aggregate.members.len()];
        Self {
            alpha: zeros.clone(),
            particular: vec![0.0; aggregate.size()],
            missed: [0.0; 2],
            alpha_plus: zeros,
            violation: vec![0.0; aggregate.row_count],
            step: vec![0.0; aggregate.row_count.min(aggregate.size())],
        }
    }

    /// Takes in the rates; `velocity` holds those of all bodies, the closures' own biases, and prescribed accelerations.
    pub fn follow_rates(&mut self, system: &System, pose: &PoseScratch, velocity: &VelocityScratch, index: usize) {
        let (aggregate, embedding) = (&system.aggregates[index], &pose.embeddings[index]);
        self.particular.fill(0.0);
        let Self { alpha, particular, alpha_plus, violation, step, missed } = self;
        spread_outward(system, pose, Some(velocity), aggregate, &Vector6::zeros(), particular, alpha_plus, alpha);
        let motion = Motion {
            body: |k: usize| aggregate.member_of(k).map_or_else(Vector6::zeros, |m| alpha[m]),
            world: Vector6::zeros(),
            hinge: &velocity.prescribed,
            modal: None,
        };
        let (mut row, mut size) = (0, 0.0_f64);
        for &index in &aggregate.closures {
            let closure = &system.closures[index];
            let own = &mut violation[row..row + closure.row_count()];
            pose.closures[index].along(closure, system, &motion, own);
            for (v, b) in own.iter_mut().zip(&velocity.closure_bias[closure.rows()]) {
                size = size.max(v.abs()).max(b.abs());
                *v += b;
            }
            row += closure.row_count();
        }
        *missed = [embedding.dependent_step(violation, step), size];
        for (&d, s) in embedding.dependent.iter().zip(step.iter()) {
            particular[d] = *s;
        }
    }
}
