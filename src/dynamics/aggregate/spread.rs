//! Motion of an aggregate's members from that of its root and of all its coordinates.

use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::sweep::velocity_outward::VelocityScratch;
use crate::model::{Aggregate, System};
use crate::spatial::shift::{motion_to, rotate, rotate_back};
use nalgebra::Vector6;

/// Accelerations of the members' frames: `alpha+` at O in O axes and `alpha` of the recursion's frames, from the acceleration `base` of the
/// root's frame and `u_dot` of the coordinates; with the biases in `velocity`, or without any.
#[expect(clippy::too_many_arguments, reason = "a sweep step reads every earlier sweep")]
pub fn spread_outward(
    system: &System,
    pose: &PoseScratch,
    velocity: Option<&VelocityScratch>,
    aggregate: &Aggregate,
    base: &Vector6<f64>,
    u_dot: &[f64],
    alpha_plus: &mut [Vector6<f64>],
    alpha: &mut [Vector6<f64>],
) {
    for (m, member) in aggregate.members.iter().enumerate() {
        let (k, own) = (member.body, &pose.bodies[member.body]);
        let mut at_hinge = *base;
        if !(aggregate.holds_root_modes && m == 0) {
            let outer = match member.parent {
                None => motion_to(&own.l, base),
                Some(p) => {
                    let eta_ddot = &u_dot[aggregate.members[p].modes.clone()];
                    motion_to(&own.l, &alpha[p]) + pose.shape_of(system, k).iter().zip(eta_ddot).map(|(s, e)| s * *e).sum::<Vector6<f64>>()
                }
            };
            at_hinge = rotate_back(&own.rotation, &outer);
            alpha_plus[m] = at_hinge;
            at_hinge += velocity.map_or_else(Vector6::zeros, |v| v.bodies[k].a);
            for (i, j) in member.rates.clone().enumerate().filter(|(_, j)| aggregate.free[*j]) {
                at_hinge += own.hinge.map[i] * u_dot[j];
            }
        }
        alpha[m] = match own.flexible {
            None => at_hinge,
            Some(index) => {
                let part = &pose.flexible[index];
                let x = -part.inboard.position;
                let mut at_frame = motion_to(&x, &rotate(&part.inboard.rotation, &at_hinge));
                for (s, e) in part.shape_inboard.iter().zip(&u_dot[member.modes.clone()]) {
                    at_frame -= s * *e;
                }
                let bias = velocity.map_or_else(Vector6::zeros, |v| v.bodies[k].a_inboard);
                // a moved root's bias is that of O seen from B
                at_frame + if part.shape_inboard.is_empty() { bias } else { -motion_to(&x, &bias) }
            }
        };
    }
}
