//! Third pass: accelerations and hinge loads, from the base to the tips. Source: Paper Eq. 13 and 18, in inertial axes.

use super::layout::{Passage, Shape};
use super::{Branch, Motion, NONE, Outboard, TreeKernel, arm, attitude, parent_motion};
use crate::dynamics::sweep::force_inward::world_acceleration;
use crate::model::{State, System};
use crate::spatial::lanes::{Lanes, quad};
use crate::spatial::shift::spatial;
use nalgebra::Vector3;

/// Fills `hinge` with the accelerations of the hinge rates, and the loads where there is room for them.
#[inline(always)]
pub fn accelerate<L: Lanes>(s: L, tree: &mut TreeKernel, system: &System, state: &State, hinge: &mut [f64], modal: &mut [f64]) {
    let TreeKernel { layout, motion, gains, outboard, branches, general, flexible, modal_shapes, .. } = tree;
    let world = world_acceleration(system);
    let at_world = (s.of_three([world[0], world[1], world[2]]), s.of_three([world[3], world[4], world[5]]));
    let mut last = NONE;
    let (mut angular, mut linear) = at_world;
    for (k, link) in layout.links.iter().enumerate() {
        if let Some(&(body, tip)) = layout.tips.get(link.tip as usize) {
            let a = &flexible[body as usize].tips[tip as usize].acceleration;
            (angular, linear) = (s.of_three([a[0], a[1], a[2]]), s.of_three([a[3], a[4], a[5]]));
        } else if link.parent != last {
            (angular, linear) = match layout.links.get(link.parent as usize).and_then(|p| branches.get(p.branch as usize)) {
                Some(Branch { acceleration: a, .. }) => (s.of_three([a[0], a[1], a[2]]), s.of_three([a[3], a[4], a[5]])),
                None => at_world,
            };
        }
        let shape = &layout.shapes[link.shape as usize];
        if link.passage != Passage::General {
            let (turn, omega) = parent_motion(s, link, layout, motion, flexible);
            let m = &motion[k];
            let axis = s.load(quad(m, 6));
            let at = arm(s, link, shape, state, turn, omega, axis);
            // alpha+ = phi* alpha of the parent
            linear = s.sub(linear, s.cross(at.l, angular));
            if let Some(out) = outboard.get_mut(k) {
                write_load(s, out, &motion[k], shape, angular, linear);
            }
            (angular, linear) = (s.add(angular, at.angular), s.add(linear, at.linear));
            if link.passage != Passage::Fixed {
                let g = &gains[k];
                let (gain_angular, gain_linear) = (s.load(quad(g, 0)), s.load(quad(g, 3)));
                let acceleration = g[6] - s.dot_two(gain_angular, angular, gain_linear, linear);
                hinge[link.v as usize] = acceleration;
                if link.passage == Passage::Revolute {
                    angular = s.mul_add(axis, s.splat(acceleration), angular);
                } else {
                    angular = s.mul_add(axis, s.splat(shape.turn_rate * acceleration), angular);
                    linear = s.mul_add(axis, s.splat(shape.travel_rate * acceleration), linear);
                }
            }
        } else {
            let own = &general[link.general as usize];
            linear = s.sub(linear, s.cross(s.of_three(own.l.into()), angular));
            if let Some(out) = outboard.get_mut(k) {
                write_load(s, out, &motion[k], shape, angular, linear);
            }
            let rates = system.bodies[k].velocity_range();
            let outer = spatial(&Vector3::from(s.three(angular)), &Vector3::from(s.three(linear)));
            let alpha = own.accelerate(system, &outer, &mut hinge[rates]);
            (angular, linear) = (s.of_three([alpha[0], alpha[1], alpha[2]]), s.of_three([alpha[3], alpha[4], alpha[5]]));
        }
        if let Some(own) = flexible.get_mut(link.flexible as usize) {
            let constants = &modal_shapes[own.shape];
            own.accelerate(s, constants, [angular, linear], &mut modal[system.bodies[k].modal_range()]);
        }
        if let Some(branch) = branches.get_mut(link.branch as usize) {
            let (a, b) = (s.three(angular), s.three(linear));
            branch.acceleration = [a[0], a[1], a[2], b[0], b[1], b[2]];
        }
        last = u32::try_from(k).unwrap_or(NONE);
    }
}

/// `P+ alpha+ + z+`, turned into O axes.
#[inline(always)]
fn write_load<L: Lanes>(s: L, out: &mut Outboard, motion: &Motion, shape: &Shape, angular: L::V, linear: L::V) {
    let rotational = [column(s, out, 0), column(s, out, 3), column(s, out, 6)];
    let coupling = [column(s, out, 9), column(s, out, 12), column(s, out, 15)];
    let translational = [column(s, out, 18), column(s, out, 21), column(s, out, 24)];
    let turned = [s.mul(coupling[0], angular), s.mul(coupling[1], angular), s.mul(coupling[2], angular)];
    let moving = [s.all_x(linear), s.all_y(linear), s.all_z(linear)];
    let moment = s.add(s.combine_add(rotational, angular, column(s, out, 27)), s.combine_lanes(coupling, moving));
    let force = s.add(s.combine_lanes(translational, moving), s.add(column(s, out, 30), s.sums(turned)));
    let axes = attitude(s, motion);
    let (mut moment, mut force) = (in_axes(s, axes, moment), in_axes(s, axes, force));
    if shape.is_turned {
        let t = &shape.turn_columns;
        let turn = [s.load(t[0]), s.load(t[1]), s.load(t[2])];
        (moment, force) = (s.combine(turn, moment), s.combine(turn, force));
    }
    let (moment, force) = (s.three(moment), s.three(force));
    *out.first_chunk_mut().unwrap_or(&mut [0.0; 6]) = [moment[0], moment[1], moment[2], force[0], force[1], force[2]];
}

/// Inertial axes to those of columns `axes`.
#[inline(always)]
fn in_axes<L: Lanes>(s: L, axes: [L::V; 3], f: L::V) -> L::V {
    s.sums([s.mul(axes[0], f), s.mul(axes[1], f), s.mul(axes[2], f)])
}

#[inline(always)]
fn column<L: Lanes>(s: L, out: &Outboard, at: usize) -> L::V {
    s.load(quad(out, at))
}
