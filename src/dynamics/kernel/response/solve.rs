//! A response: residual forces from the tips to the base, accelerations from the base to the tips. Source: Paper Eq. 34 to 41, in inertial axes.

use super::{Passage, TreeResponse};
use crate::dynamics::kernel::{NONE, TreeKernel};
use crate::model::System;
use crate::spatial::lanes::Lanes;
use crate::spatial::shift::spatial;
use nalgebra::Vector3;

/// Leaves `nu` of hinges of one rate in `hinge`, of all others with them.
#[inline(always)]
pub fn inward<L: Lanes>(s: L, of: &mut TreeResponse, system: &System, applied: &[f64], external_modal: &[f64], hinge: &mut [f64]) {
    let TreeResponse { tree, factors, flexible: modal_factors, .. } = of;
    let TreeKernel { layout, branches, general, flexible, .. } = tree;
    let zero = s.splat(0.0);
    for branch in branches.iter_mut() {
        (branch.felt.moment, branch.felt.force) = ([0.0; 4], [0.0; 4]);
    }
    let (mut moment, mut force) = (zero, zero);
    let n = layout.links.len();
    let (links, factors) = (&layout.links[..n], &factors[..n]);
    for k in (0..n).rev() {
        let (link, own) = (&links[k], &factors[k]);
        if !link.is_plain {
            if let Some(branch) = branches.get(link.branch as usize) {
                (moment, force) = (s.add(moment, s.load(branch.felt.moment)), s.add(force, s.load(branch.felt.force)));
            }
            if let Some(body) = flexible.get_mut(link.flexible as usize) {
                let of_modes = &mut modal_factors[link.flexible as usize];
                let felt = of_modes.take_forces(s, body, &external_modal[system.bodies[k].modal_range()]);
                (moment, force) = (s.add(moment, felt[0]), s.add(force, felt[1]));
            }
        }
        let l = s.load(own.l);
        if link.passage == Passage::Revolute {
            // what does not wait for the sum comes first
            let push = s.splat(applied[link.v as usize]);
            let (gain_angular, gain_linear) = (s.load(own.gain_angular), s.load(own.gain_linear));
            let carried = s.mul_add(gain_angular, push, s.add(moment, s.cross(l, force)));
            let felt = s.total(s.mul(s.load(own.axis), moment));
            force = s.mul_add(gain_linear, s.sub(push, felt), force);
            moment = s.mul_take(gain_angular, felt, carried);
            hinge[link.v as usize] = s.first(s.sub(push, felt)) * own.gain_angular[3];
        } else if link.passage == Passage::Slide {
            let shape = &layout.shapes[link.shape as usize];
            let axis = s.load(own.axis);
            let (turn, travel) = (s.mul(axis, s.splat(shape.turn_rate)), s.mul(axis, s.splat(shape.travel_rate)));
            let felt = s.total(s.mul_add(travel, force, s.mul(turn, moment)));
            let epsilon = s.sub(s.splat(applied[link.v as usize]), felt);
            moment = s.mul_add(s.load(own.gain_angular), epsilon, s.add(moment, s.cross(l, force)));
            force = s.mul_add(s.load(own.gain_linear), epsilon, force);
            hinge[link.v as usize] = s.first(epsilon) * own.gain_angular[3];
        } else {
            if link.passage == Passage::General {
                let felt = spatial(&Vector3::from(s.three(moment)), &Vector3::from(s.three(force)));
                let left = general[link.general as usize].respond(system, &applied[system.bodies[k].velocity_range()], &felt);
                (moment, force) = (s.of_three([left[0], left[1], left[2]]), s.of_three([left[3], left[4], left[5]]));
            }
            moment = s.add(moment, s.cross(l, force));
        }
        if link.is_plain {
            continue;
        }
        if let Some(&(body, tip)) = layout.tips.get(link.tip as usize) {
            let felt = &mut flexible[body as usize].tips[tip as usize].felt;
            (felt.moment, felt.force) = (s.store(moment), s.store(force));
            (moment, force) = (zero, zero);
        } else if link.parent as usize + 1 != k || k == 0 {
            if let Some(branch) = layout.links.get(link.parent as usize).and_then(|p| branches.get_mut(p.branch as usize)) {
                branch.felt.moment = s.store(s.add(moment, s.load(branch.felt.moment)));
                branch.felt.force = s.store(s.add(force, s.load(branch.felt.force)));
            }
            (moment, force) = (zero, zero);
        }
    }
}

/// Fills `hinge`, which holds `nu` of hinges of one rate, and `modal` with the accelerations.
#[inline(always)]
pub fn outward<L: Lanes>(s: L, of: &mut TreeResponse, system: &System, hinge: &mut [f64], modal: &mut [f64]) {
    let TreeResponse { tree, factors, flexible: modal_factors, .. } = of;
    let TreeKernel { layout, branches, general, flexible, .. } = tree;
    let zero = s.splat(0.0);
    let mut last = NONE;
    let (mut angular, mut linear) = (zero, zero);
    let n = layout.links.len();
    let (links, factors) = (&layout.links[..n], &factors[..n]);
    for k in 0..n {
        let (link, own) = (&links[k], &factors[k]);
        if link.is_plain {
            // its parent came just before
        } else if let Some(&(body, tip)) = layout.tips.get(link.tip as usize) {
            let a = &flexible[body as usize].tips[tip as usize].acceleration;
            (angular, linear) = (s.of_three([a[0], a[1], a[2]]), s.of_three([a[3], a[4], a[5]]));
        } else if link.parent != last {
            (angular, linear) = match layout.links.get(link.parent as usize).and_then(|p| branches.get(p.branch as usize)) {
                Some(branch) => (s.load(branch.acceleration[0]), s.load(branch.acceleration[1])),
                None => (zero, zero),
            };
        }
        let carried = s.sub(linear, s.cross(s.load(own.l), angular));
        if link.passage == Passage::Revolute {
            let reached = s.total(s.mul_add(s.load(own.gain_angular), angular, s.mul(s.load(own.gain_linear), linear)));
            let acceleration = s.sub(s.splat(hinge[link.v as usize]), reached);
            hinge[link.v as usize] = s.first(acceleration);
            (angular, linear) = (s.mul_add(s.load(own.axis), acceleration, angular), carried);
        } else if link.passage == Passage::Slide {
            let shape = &layout.shapes[link.shape as usize];
            let reached = s.total(s.mul_add(s.load(own.gain_angular), angular, s.mul(s.load(own.gain_linear), linear)));
            let acceleration = s.sub(s.splat(hinge[link.v as usize]), reached);
            hinge[link.v as usize] = s.first(acceleration);
            let along = s.mul(s.load(own.axis), acceleration);
            angular = s.mul_add(along, s.splat(shape.turn_rate), angular);
            linear = s.mul_add(along, s.splat(shape.travel_rate), carried);
        } else if link.passage == Passage::General {
            let outer = spatial(&Vector3::from(s.three(angular)), &Vector3::from(s.three(carried)));
            let rates = system.bodies[k].velocity_range();
            let alpha = general[link.general as usize].follow_response(system, &outer, &mut hinge[rates]);
            (angular, linear) = (s.of_three([alpha[0], alpha[1], alpha[2]]), s.of_three([alpha[3], alpha[4], alpha[5]]));
        } else {
            linear = carried;
        }
        last = u32::try_from(k).unwrap_or(NONE);
        if link.is_plain {
            continue;
        }
        if let Some(body) = flexible.get_mut(link.flexible as usize) {
            modal_factors[link.flexible as usize].follow(s, body, [angular, linear], &mut modal[system.bodies[k].modal_range()]);
        }
        if let Some(branch) = branches.get_mut(link.branch as usize) {
            branch.acceleration = [s.store(angular), s.store(linear)];
        }
    }
}
