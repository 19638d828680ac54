//! Forces on an aggregate's members as forces on its coordinates and on its root: the transpose of the members' motion.

use crate::dynamics::closed_chain::constraint::ForceSink;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::model::{Aggregate, System};
use crate::spatial::shift::{force_from, rotate, rotate_back};
use nalgebra::Vector6;

/// Forces on members: rigid rows in the recursion's frames, and forces on coordinates. What acts on the root is left out.
#[derive(Debug)]
pub struct MemberForces<'a> {
    /// The aggregate.
    pub aggregate: &'a Aggregate,
    /// The system.
    pub system: &'a System,
    /// One per member.
    pub wrench: &'a mut [Vector6<f64>],
    /// One per coordinate.
    pub generalised: &'a mut [f64],
}

impl ForceSink for MemberForces<'_> {
    fn on_body(&mut self, body: usize, wrench: &Vector6<f64>) {
        if let Some(m) = self.aggregate.member_of(body) {
            self.wrench[m] += wrench;
        }
    }

    fn on_modes(&mut self, body: usize, shape: &[Vector6<f64>], force: &Vector6<f64>) {
        if let Some(m) = self.aggregate.member_of(body) {
            let modes = self.aggregate.members[m].modes.clone();
            self.generalised[modes].iter_mut().zip(shape).for_each(|(g, s)| *g += s.dot(force));
        }
    }

    fn on_rate(&mut self, body: usize, velocity: usize, force: f64) {
        if let Some(m) = self.aggregate.member_of(body) {
            self.generalised[self.aggregate.members[m].rates.start + velocity - self.system.bodies[body].velocity] += force;
        }
    }
}

/// Carries the forces `wrench` (one per member, recursion's frames) inward: adds what they do on every coordinate to `generalised`, leaves
/// the force across each member's hinge (at O, O axes) in `wrench`, and returns the force on the root's frame.
pub fn project_inward(
    system: &System,
    pose: &PoseScratch,
    aggregate: &Aggregate,
    wrench: &mut [Vector6<f64>],
    generalised: &mut [f64],
) -> Vector6<f64> {
    let mut base = Vector6::zeros();
    for (m, member) in aggregate.members.iter().enumerate().rev() {
        let (k, own) = (member.body, &pose.bodies[member.body]);
        let mut f = wrench[m];
        if let Some(index) = own.flexible {
            let part = &pose.flexible[index];
            for (g, s) in generalised[member.modes.clone()].iter_mut().zip(&part.shape_inboard) {
                *g -= s.dot(&f);
            }
            f = rotate_back(&part.inboard.rotation, &force_from(&-part.inboard.position, &f));
        }
        wrench[m] = f;
        for (i, g) in generalised[member.rates.clone()].iter_mut().enumerate() {
            *g += own.hinge.map[i].dot(&f);
        }
        if aggregate.holds_root_modes && m == 0 {
            base += f;
            continue;
        }
        let felt = rotate(&own.rotation, &f);
        match member.parent {
            None => base += force_from(&own.l, &felt),
            Some(p) => {
                let modes = aggregate.members[p].modes.clone();
                generalised[modes].iter_mut().zip(pose.shape_of(system, k)).for_each(|(g, s)| *g += s.dot(&felt));
                wrench[p] += force_from(&own.l, &felt);
            }
        }
    }
    base
}
