//! Loads inside an aggregate: across its hinges, and at its closures (Paper Eq. 61, 68 and 69).
//!
//! `f_E = phi_E f'_E` is gathered from the members' inertial forces and the loads of what hangs on them. Along the dependent coordinates it
//! is more than springs and motors give: that is what the closures give, `G_d' lambda`, and of all multipliers that give it those of
//! least norm are taken. The loads that are seen are `f_E` less what the multipliers' forces make of it.

use super::projection::{MemberForces, project_inward};
use crate::dynamics::closed_chain::constraint::SystemForces;
use crate::dynamics::sweep::acceleration_outward::AccelerationScratch;
use crate::dynamics::sweep::force_inward::ForceScratch;
use crate::dynamics::sweep::inertia_inward::InertiaScratch;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::sweep::velocity_outward::VelocityScratch;
use crate::model::{Aggregate, BodyKind, HingeKind, State, System};
use crate::spatial::shift::{force_from, rotate};
use nalgebra::Vector6;

/// The sweeps of one evaluation that loads are recovered from.
#[derive(Debug, Clone, Copy)]
pub struct Swept<'a> {
    /// The system.
    pub system: &'a System,
    /// State of the evaluation.
    pub state: &'a State,
    /// Poses.
    pub pose: &'a PoseScratch,
    /// Velocities and biases.
    pub velocity: &'a VelocityScratch,
    /// Articulated inertias.
    pub inertia: &'a InertiaScratch,
    /// All accelerations, those of correction passes added.
    pub acceleration: &'a AccelerationScratch,
}

/// Room for the loads of one aggregate.
#[derive(Debug, Clone)]
pub struct AggregateLoad {
    /// Children of each member that do not belong to the aggregate.
    outside: Vec<Vec<usize>>,
    wrench: Vec<Vector6<f64>>,
    generalised: Vec<f64>,
    of_closures: Vec<Vector6<f64>>,
    dependent: Vec<f64>,
    lambda: Vec<f64>,
}

impl AggregateLoad {
    /// Room for `aggregate`.
    #[must_use]
    pub fn new(system: &System, aggregate: &Aggregate) -> Self {
        let mut outside = vec![Vec::new(); aggregate.members.len()];
        for (child, body) in system.bodies.iter().enumerate() {
            if let Some(m) = body.parent.and_then(|p| aggregate.member_of(p)).filter(|_| aggregate.member_of(child).is_none()) {
                outside[m].push(child);
            }
        }
        let zeros = vec![Vector6::zeros(); aggregate.members.len()];
        Self {
            outside,
            wrench: zeros.clone(),
            generalised: vec![0.0; aggregate.size()],
            of_closures: zeros,
            dependent: vec![0.0; aggregate.row_count],
            lambda: vec![0.0; aggregate.row_count],
        }
    }

    /// Finds the multipliers of the aggregate's closures (written to `lambda`, all closures' multipliers) and the loads at its hinges, which
    /// become `z+` with no `P+`; adds the closures' forces to the external ones. All accelerations and the loads outside are known.
    pub fn recover(&mut self, swept: &Swept<'_>, index: usize, force: &mut ForceScratch, lambda: &mut [f64]) {
        let Swept { system, pose, .. } = *swept;
        let (aggregate, embedding) = (&system.aggregates[index], &pose.embeddings[index]);
        for m in 0..aggregate.members.len() {
            self.inertial_force(swept, aggregate, m, force);
        }
        project_inward(system, pose, aggregate, &mut self.wrench, &mut self.generalised);

        for (x, &d) in self.dependent.iter_mut().zip(&embedding.dependent) {
            *x = self.generalised[d];
        }
        embedding.multipliers(&mut self.dependent, &mut self.lambda);
        self.of_closures.fill(Vector6::zeros());
        let mut row = 0;
        for &c in &aggregate.closures {
            let closure = &system.closures[c];
            let own = &self.lambda[row..row + closure.row_count()];
            lambda[closure.rows()].copy_from_slice(own);
            let mut inside = MemberForces { aggregate, system, wrench: &mut self.of_closures, generalised: &mut self.generalised };
            pose.closures[c].push(closure, own, &mut inside);
            let ForceScratch { external, external_modal, applied, .. } = force;
            pose.closures[c].push(closure, own, &mut SystemForces { system, external, modal: external_modal, applied });
            row += closure.row_count();
        }
        project_inward(system, pose, aggregate, &mut self.of_closures, &mut self.generalised);
        for (m, member) in aggregate.members.iter().enumerate().skip(usize::from(aggregate.holds_root_modes)) {
            let body = &system.bodies[member.body];
            force.bodies[member.body].z_plus = if matches!(body.hinge.kind, HingeKind::Free) {
                Vector6::from_column_slice(&force.applied[body.velocity_range()])
            } else {
                self.wrench[m] - self.of_closures[m]
            };
        }
    }

    /// Inertial force of member m with the loads of what hangs on it outside, and the same on its coordinates, less what acts on them.
    fn inertial_force(&mut self, swept: &Swept<'_>, aggregate: &Aggregate, m: usize, force: &ForceScratch) {
        let Swept { system, state, pose, velocity, inertia, acceleration } = *swept;
        let member = &aggregate.members[m];
        let (k, body) = (member.body, &system.bodies[member.body]);
        let alpha = &acceleration.alpha[k];
        let mut wrench = velocity.bodies[k].b - force.external[k];
        self.generalised[member.rates.clone()].iter_mut().zip(&force.applied[body.velocity_range()]).for_each(|(g, a)| *g = -a);
        match (&body.kind, pose.bodies[k].flexible) {
            (BodyKind::Rigid(own), _) => wrench += own.times(alpha),
            (BodyKind::Flexible(flexible), index) => {
                let own = &pose.flexible[index.unwrap_or_default()].inertia;
                let range = body.modal_range();
                let modes = &mut self.generalised[member.modes.clone()];
                flexible.elastic_force(&state.modal_position[range.clone()], &state.modal_velocity[range.clone()], modes);
                wrench += own.rigid.times(alpha);
                for (j, (g, at)) in modes.iter_mut().zip(range).enumerate() {
                    wrench += own.row[j] * acceleration.modal[at];
                    *g += acceleration.modal[at] + own.row[j].dot(alpha) + velocity.b_modal[at] - force.external_modal[at];
                }
            }
        }
        for &child in &self.outside[m] {
            let load = inertia.bodies[child].P_plus.times(&acceleration.alpha_plus[child]) + force.bodies[child].z_plus;
            let felt = rotate(&pose.bodies[child].rotation, &load);
            wrench += force_from(&pose.bodies[child].l, &felt);
            let modes = &mut self.generalised[member.modes.clone()];
            modes.iter_mut().zip(pose.shape_of(system, child)).for_each(|(g, y)| *g += y.dot(&felt));
        }
        self.wrench[m] = wrench;
    }
}
