//! Residual forces of an aggregate, from what hangs on its members to its root (Paper Eq. 64 and 65).

use crate::dynamics::sweep::force_inward::ForceScratch;
use crate::dynamics::sweep::inertia_inward::InertiaScratch;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::sweep::velocity_outward::VelocityScratch;
use crate::model::{Aggregate, System};
use nalgebra::Vector6;

use super::projection::project_inward;

/// What the force sweep leaves of one aggregate.
#[derive(Debug, Clone, Default)]
pub struct AggregateForce {
    /// `D_E^-1 epsilon_E`, one per independent coordinate; entries past them are unused.
    pub nu: Vec<f64>,
    /// Forces across the members' hinges; scratch.
    pub wrench: Vec<Vector6<f64>>,
    /// Forces on all coordinates; scratch.
    pub generalised: Vec<f64>,
}

impl AggregateForce {
    /// Room for `aggregate`.
    #[must_use]
    pub fn new(aggregate: &Aggregate) -> Self {
        let n = aggregate.size();
        Self { nu: vec![0.0; n], wrench: vec![Vector6::zeros(); aggregate.members.len()], generalised: vec![0.0; n] }
    }

    /// Residual force on the root's frame from the forces in `wrench` and `generalised`; leaves `nu`.
    pub fn filter(
        &mut self,
        system: &System,
        pose: &PoseScratch,
        inertia: &InertiaScratch,
        index: usize,
        particular: Option<&[f64]>,
    ) -> Vector6<f64> {
        let (aggregate, embedding, eliminated) = (&system.aggregates[index], &pose.embeddings[index], &inertia.aggregates[index]);
        let mut base = project_inward(system, pose, aggregate, &mut self.wrench, &mut self.generalised);
        if let Some(particular) = particular {
            base += eliminated.add_times(particular, &mut self.generalised);
        }
        let nu = &mut self.nu[..embedding.independent.len()];
        embedding.reduce(&self.generalised, nu);
        nu.iter_mut().for_each(|x| *x = -*x);
        eliminated.solve(nu);
        base + eliminated.U.iter().zip(nu.iter()).map(|(u, nu)| u * *nu).sum::<Vector6<f64>>()
    }
}

/// Residual force of aggregate `index` on its root's frame; the members' own residual forces, and what reaches them from outside the
/// aggregate, stand in `out` already.
pub fn filter_aggregate(
    system: &System,
    pose: &PoseScratch,
    velocity: &VelocityScratch,
    inertia: &InertiaScratch,
    index: usize,
    out: &mut ForceScratch,
) -> Vector6<f64> {
    let (aggregate, bias) = (&system.aggregates[index], &velocity.embedded[index]);
    let mut own = std::mem::take(&mut out.aggregates[index]);
    for (m, member) in aggregate.members.iter().enumerate() {
        let (k, body) = (member.body, &system.bodies[member.body]);
        let alpha = &bias.alpha[m];
        own.wrench[m] = out.bodies[k].z + inertia.bodies[k].P.times(alpha);
        own.generalised[member.rates.clone()].iter_mut().zip(&out.applied[body.velocity_range()]).for_each(|(g, a)| *g = -a);
        if let Some(flexible) = pose.bodies[k].flexible {
            let rows = inertia.flexible[flexible].mu.iter().zip(&out.nu_modal[body.modal_range()]);
            own.generalised[member.modes.clone()].iter_mut().zip(rows).for_each(|(g, (mu, e))| *g = mu.dot(alpha) - e);
        }
    }
    let felt = own.filter(system, pose, inertia, index, Some(&bias.particular));
    out.aggregates[index] = own;
    felt
}
