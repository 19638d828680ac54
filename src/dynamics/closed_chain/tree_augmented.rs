//! The correction pass: from the free accelerations of the tree to those of the closed chain, and all loads with them.
//!
//! `lambda = -(G M^-1 G')^-1 (G u_dot_free + bias)`, then one more pass with `G' lambda` as external forces; its accelerations and
//! residual forces are added to those of the free pass, so that every hinge load is the sum of both passes (Paper Eq. 42 to 46).
//! Cost: O(N n_c + n_c^3), N bodies of the loops and n_c blocked directions.

use super::constraint::Motion;
use super::schur::{NotFactored, REDUNDANT};
use super::{CONTRADICTION, ClosedChain, along, rounding_of_rates};
use crate::dynamics::DynamicsError;
use crate::dynamics::sweep::acceleration_outward::AccelerationScratch;
use crate::dynamics::sweep::force_inward::{ForceScratch, world_acceleration};
use crate::dynamics::sweep::inertia_inward::InertiaScratch;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::sweep::response::Response;
use crate::dynamics::sweep::velocity_outward::VelocityScratch;
use crate::model::System;
use nalgebra::Vector6;

impl ClosedChain {
    /// Adds the correction pass of the cut closures to the free pass in `force` and `acceleration`; nothing happens if none is cut.
    ///
    /// # Errors
    /// If the closures and prescribed motions contradict one another.
    pub fn close(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        velocity: &VelocityScratch,
        inertia: &InertiaScratch,
        force: &mut ForceScratch,
        acceleration: &mut AccelerationScratch,
    ) -> Result<(), DynamicsError> {
        if self.cut.is_empty() {
            return Ok(());
        }
        self.assemble_loop_inertia(system, pose, inertia);
        self.factor(system, REDUNDANT)?;
        let mut right = std::mem::take(&mut self.right);
        self.accelerations(system, pose, acceleration, world_acceleration(system), &mut right);
        let mut sizes = 0.0_f64;
        for (x, &row) in self.cut_right.iter_mut().zip(&self.cut) {
            let bias = velocity.closure_bias[row];
            sizes = sizes.max(right[row].abs()).max(bias.abs());
            *x = -(right[row] + bias);
        }
        self.right = right;
        let (missed, size) = self.schur.solve(&self.cut_right, &mut self.cut_lambda);
        let unmoved = (0..self.cut.len()).filter(|&c| !self.schur.responds(c));
        let rigid = unmoved.fold(0.0_f64, |m, c| m.max(self.cut_right[c].abs()));
        // a right-hand side of rounding has no direction: it is measured against the accelerations it is the difference of
        let felt = self.support.iter().map(|&k| acceleration.alpha[k].amax()).fold(sizes, f64::max);
        let scale = self.schur.largest_scale();
        let rounding = (1e-9 * felt).max(rounding_of_rates(velocity));
        if (missed > CONTRADICTION * size && missed > rounding * scale) || rigid > rounding {
            return Err(self.contradiction(system));
        }

        self.respond(system, pose, inertia);
        let part = &self.response;
        for k in 0..system.bodies.len() {
            force.bodies[k].z_plus += part.z_plus[k];
            acceleration.alpha_plus[k] += part.alpha_plus[k];
            acceleration.alpha[k] += part.alpha[k];
        }
        let add = |into: &mut [f64], more: &[f64]| into.iter_mut().zip(more).for_each(|(a, b)| *a += b);
        add(&mut acceleration.modal, &part.modal);
        for body in system.bodies.iter().filter(|b| !b.hinge.is_prescribed()) {
            add(&mut acceleration.hinge[body.velocity_range()], &part.hinge[body.velocity_range()]);
        }
        // to audits and power the closures are forces like any other
        force.external.iter_mut().zip(&part.external).for_each(|(a, b)| *a += b);
        add(&mut force.external_modal, &part.external_modal);
        add(&mut force.applied, &part.applied);
        Ok(())
    }

    /// Assembles and factors the loop inertia of the cut closures for responses over the factors in `inertia`.
    ///
    /// # Errors
    /// If it holds what is not a number.
    pub fn prepare(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch) -> Result<(), DynamicsError> {
        if self.cut.is_empty() {
            return Ok(());
        }
        self.assemble_loop_inertia(system, pose, inertia);
        self.factor(system, REDUNDANT)
    }

    /// Takes the motion along the cut closures' blocked directions out of `response`, whose factors were [prepared](Self::prepare).
    pub fn hold(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch, response: &mut Response) {
        if self.cut.is_empty() {
            return;
        }
        let motion =
            Motion { body: |k: usize| response.alpha[k], world: Vector6::zeros(), hinge: &response.hinge, modal: Some(&response.modal) };
        along(system, pose, &motion, &mut self.right);
        for (x, &row) in self.cut_right.iter_mut().zip(&self.cut) {
            *x = -self.right[row];
        }
        self.schur.solve(&self.cut_right, &mut self.cut_lambda);
        self.respond(system, pose, inertia);
        response.hinge.iter_mut().zip(&self.response.hinge).for_each(|(x, d)| *x += d);
        response.modal.iter_mut().zip(&self.response.modal).for_each(|(x, d)| *x += d);
    }

    /// Factors the loop inertia.
    pub(super) fn factor(&mut self, system: &System, threshold: f64) -> Result<(), DynamicsError> {
        let first = self.cut.first().copied();
        let name = || system.closures.iter().find(|c| first.is_some_and(|row| c.rows().contains(&row))).map(|c| c.name.clone());
        self.schur.factor(threshold).map_err(|_: NotFactored| DynamicsError::BrokenClosures { closure: name().unwrap_or_default() })
    }

    /// Response of all bodies to the multipliers of the cut closures, which take their places among those of all; zero for the others.
    pub(super) fn respond(&mut self, system: &System, pose: &PoseScratch, inertia: &InertiaScratch) {
        self.lambda.fill(0.0);
        for (&row, l) in self.cut.iter().zip(&self.cut_lambda) {
            self.lambda[row] = *l;
        }
        let lambda = std::mem::take(&mut self.lambda);
        self.push(system, pose, &lambda);
        self.lambda = lambda;
        self.response.solve(system, pose, inertia, &self.all);
    }

    /// The closure that has most of its directions where no multiplier reaches.
    fn contradiction(&self, system: &System) -> DynamicsError {
        let share = |i: usize| {
            let own = system.closures[i].rows();
            let rows = self.cut.iter().enumerate().filter(|(_, row)| own.contains(*row));
            rows.map(|(c, _)| self.schur.redundancy(c)).fold(0.0, f64::max)
        };
        let worst = (0..system.closures.len()).max_by(|&i, &j| share(i).total_cmp(&share(j))).unwrap_or(0);
        DynamicsError::ContradictoryClosures {
            closure: system.closures[worst].name.clone(),
            rank: self.schur.rank(),
            rows: self.schur.size(),
        }
    }
}
