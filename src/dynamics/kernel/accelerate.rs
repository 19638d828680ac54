//! Third pass: accelerations and hinge loads, from the base to the tips. Source: Paper Eq. 13 and 18, in inertial axes.

use super::layout::Passage;
use super::record::Load;
use super::{Branch, NONE, TreeKernel};
use crate::dynamics::sweep::force_inward::world_acceleration;
use crate::model::System;
use crate::spatial::lanes::Lanes;
use crate::spatial::shift::spatial;
use nalgebra::Vector3;

/// Records that are together larger than this (bytes) lie in memory rather than in caches.
const FAR: usize = 8 << 20;

/// How many bodies ahead those are asked for.
const AHEAD: usize = 8;

/// How many bodies behind the accelerations the loads are made: of numbers that are there, so that they wait for nothing.
const BEHIND: usize = 2;

/// Fills `hinge` with the accelerations of the hinge rates, and the loads if `LOADS`.
#[inline(always)]
pub fn accelerate<L: Lanes, const LOADS: bool>(s: L, tree: &mut TreeKernel, system: &System, hinge: &mut [f64], modal: &mut [f64]) {
    let TreeKernel { layout, motion, hinges, outboard, loads, branches, general, flexible, modal_shapes, .. } = tree;
    let world = world_acceleration(system);
    let at_world = (s.of_three([world[0], world[1], world[2]]), s.of_three([world[3], world[4], world[5]]));
    let mut last = NONE;
    let (mut angular, mut linear) = at_world;
    let is_far = size_of_val(outboard.as_slice()) > FAR;
    // slices of one length need no check of an index in the loop
    let n = layout.links.len();
    let (links, motion, hinges) = (&layout.links[..n], &motion[..n], &hinges[..n]);
    let (outboard, loads) = if LOADS { (&outboard[..n], &mut loads[..n]) } else { (&outboard[..0], &mut loads[..0]) };
    for k in 0..n {
        let link = &links[k];
        if link.is_plain {
            // its parent came just before
        } else if let Some(&(body, tip)) = layout.tips.get(link.tip as usize) {
            let a = &flexible[body as usize].tips[tip as usize].acceleration;
            (angular, linear) = (s.of_three([a[0], a[1], a[2]]), s.of_three([a[3], a[4], a[5]]));
        } else if link.parent != last {
            (angular, linear) = match layout.links.get(link.parent as usize).and_then(|p| branches.get(p.branch as usize)) {
                Some(Branch { acceleration: a, .. }) => (s.load(a[0]), s.load(a[1])),
                None => at_world,
            };
        }
        if LOADS {
            if is_far && let Some(next) = outboard.get(k + AHEAD) {
                s.fetch(next);
            }
            if k >= BEHIND {
                loads[k - BEHIND].settle(s, &outboard[k - BEHIND]);
            }
        }
        if link.passage != Passage::General {
            let own = &hinges[k];
            // alpha+ = phi* alpha of the parent
            linear = s.sub(linear, s.cross(s.load(own.l), angular));
            if LOADS {
                loads[k] = Load::of(s, angular, linear);
            }
            (angular, linear) = (s.add(angular, s.load(own.bias_angular)), s.add(linear, s.load(own.bias_linear)));
            if link.passage != Passage::Fixed {
                let axis = s.load(motion[k].turn[2]);
                let acceleration = own.gain_angular[3] - s.dot_two(s.load(own.gain_angular), angular, s.load(own.gain_linear), linear);
                hinge[link.v as usize] = acceleration;
                if link.passage == Passage::Revolute {
                    angular = s.mul_add(axis, s.splat(acceleration), angular);
                } else {
                    let shape = &layout.shapes[link.shape as usize];
                    angular = s.mul_add(axis, s.splat(shape.turn_rate * acceleration), angular);
                    linear = s.mul_add(axis, s.splat(shape.travel_rate * acceleration), linear);
                }
            }
        } else {
            let own = &general[link.general as usize];
            linear = s.sub(linear, s.cross(s.of_three(own.l.into()), angular));
            if LOADS {
                loads[k] = Load::of(s, angular, linear);
            }
            let rates = system.bodies[k].velocity_range();
            let outer = spatial(&Vector3::from(s.three(angular)), &Vector3::from(s.three(linear)));
            let alpha = own.accelerate(system, &outer, &mut hinge[rates]);
            (angular, linear) = (s.of_three([alpha[0], alpha[1], alpha[2]]), s.of_three([alpha[3], alpha[4], alpha[5]]));
        }
        last = u32::try_from(k).unwrap_or(NONE);
        if link.is_plain {
            continue;
        }
        if let Some(own) = flexible.get_mut(link.flexible as usize) {
            let constants = &modal_shapes[own.shape];
            own.accelerate(s, constants, [angular, linear], &mut modal[system.bodies[k].modal_range()]);
        }
        if let Some(branch) = branches.get_mut(link.branch as usize) {
            branch.acceleration = [s.store(angular), s.store(linear)];
        }
    }
    if LOADS {
        for k in n.saturating_sub(BEHIND)..n {
            loads[k].settle(s, &outboard[k]);
        }
    }
}
