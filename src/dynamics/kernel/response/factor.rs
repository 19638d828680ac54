//! Articulated inertias and what hinges make of them, from the tips to the base. Source: Paper Eq. 9, 10 and 32, in inertial axes.

use super::{Factor, Outboard, Passage, TreeResponse};
use crate::dynamics::added_inertia::AddedInertia;
use crate::dynamics::kernel::cyclic::{Inertia, Turns, square, symmetric_times, transposed_times};
use crate::dynamics::kernel::inward::{Felt, rigid_inertia};
use crate::dynamics::kernel::layout::Shape;
use crate::dynamics::kernel::record::block;
use crate::dynamics::kernel::{Doubtful, TreeKernel, arm, parent_motion};
use crate::dynamics::sweep::inertia_inward::SINGULAR;
use crate::model::System;
use crate::spatial::lanes::Lanes;
use nalgebra::Vector6;

/// Fills the factors for the poses that the first pass of the tree has left.
#[inline(always)]
pub fn factor<L: Lanes>(s: L, of: &mut TreeResponse, system: &System, added: &AddedInertia) -> Result<(), Doubtful> {
    let TreeResponse { tree, rest, factors, flexible: modal_factors } = of;
    let TreeKernel { layout, motion, branches, general, flexible, modal_shapes, .. } = tree;
    for branch in branches.iter_mut() {
        branch.felt = Outboard::default();
    }
    let zero = s.splat(0.0);
    let mut felt = Felt::none(s).inertia;
    // slices of one length need no check of an index in the loop
    let n = layout.links.len();
    let (links, motion, factors) = (&layout.links[..n], &motion[..n], &mut factors[..n]);
    for k in (0..n).rev() {
        let link = &links[k];
        let shape = &layout.shapes[link.shape as usize];
        let turn = block(s, &motion[k].turn);
        if let Some(branch) = branches.get(link.branch as usize) {
            felt = felt.plus(s, &branch.felt.inertia(s));
        }
        if let Some(own) = flexible.get_mut(link.flexible as usize) {
            let (constants, lambda) = (&modal_shapes[own.shape], &added.modal[system.bodies[k].modal_range()]);
            let of_modes = &mut modal_factors[link.flexible as usize];
            felt = felt.plus(s, &of_modes.factor(s, own, constants, lambda)?);
        } else {
            let (own, first_moment) = rigid_inertia(s, shape, turn);
            felt = felt.with_rigid(s, own, &first_moment, shape.mass);
        }

        let l = if link.passage == Passage::General {
            let own = &mut general[link.general as usize];
            let (inertia, _) = Outboard::of(s, &felt, [zero; 2]).plain();
            let block = added.block(system, k);
            let left = own.factor(system, &inertia, block.as_ref())?;
            felt = Outboard::new(&left, &Vector6::zeros()).inertia(s);
            let l = s.of_three(own.l.into());
            factors[k] = Factor { l: s.store(l), ..Factor::default() };
            l
        } else {
            let (parent_turn, _) = parent_motion(s, link, layout, motion, flexible);
            let l = arm(s, link, shape, rest, parent_turn, zero, turn[2]).l;
            factors[k] = match link.passage {
                Passage::Revolute => pass_revolute(s, &mut felt, turn[2], added.hinge[link.v as usize], l)?,
                Passage::Slide => pass_slide(s, &mut felt, turn[2], shape, added.hinge[link.v as usize], l)?,
                Passage::Fixed | Passage::General => Factor { l: s.store(l), ..Factor::default() },
            };
            l
        };
        felt = felt.shifted(s, &Turns::new(s, l));
        if let Some(&(body, tip)) = layout.tips.get(link.tip as usize) {
            flexible[body as usize].tips[tip as usize].felt = Outboard::of(s, &felt, [zero; 2]);
            felt = Felt::none(s).inertia;
        } else if link.parent as usize + 1 != k || k == 0 {
            if let Some(branch) = layout.links.get(link.parent as usize).and_then(|p| branches.get_mut(p.branch as usize)) {
                branch.felt = Outboard::of(s, &felt.plus(s, &branch.felt.inertia(s)), [zero; 2]);
            }
            felt = Felt::none(s).inertia;
        }
    }
    Ok(())
}

/// Through a revolute hinge about `axis`: what is left is `P+`.
#[inline(always)]
fn pass_revolute<L: Lanes>(s: L, inertia: &mut Inertia<L::V>, axis: L::V, added: f64, l: L::V) -> Result<Factor, Doubtful> {
    let angular = symmetric_times(s, inertia.rotational, axis);
    let linear = transposed_times(s, inertia.coupling, axis);
    let pivot = s.add(square(s, inertia.rotational, axis), s.splat(added));
    let size = s.first(pivot);
    if !(size > SINGULAR * s.sum(inertia.rotational[0]) && size >= f64::MIN_POSITIVE) {
        return Err(Doubtful);
    }
    Ok(pass(s, inertia, axis, [angular, linear], s.inverse(pivot), l))
}

/// The same through a hinge that travels along `axis`, and turns about it or not.
#[inline(always)]
fn pass_slide<L: Lanes>(s: L, inertia: &mut Inertia<L::V>, axis: L::V, shape: &Shape, added: f64, l: L::V) -> Result<Factor, Doubtful> {
    let (turn, travel) = (s.mul(axis, s.splat(shape.turn_rate)), s.mul(axis, s.splat(shape.travel_rate)));
    let [angular, linear] = inertia.times_add(s, turn, travel, [s.splat(0.0); 2]);
    let pivot = s.dot_two(turn, angular, travel, linear) + added;
    let size = shape.turn_rate * shape.turn_rate * s.sum(inertia.rotational[0])
        + shape.travel_rate * shape.travel_rate * s.sum(inertia.translational[0]);
    if !(pivot > SINGULAR * size && pivot >= f64::MIN_POSITIVE) {
        return Err(Doubtful);
    }
    Ok(pass(s, inertia, axis, [angular, linear], s.splat(1.0 / pivot), l))
}

/// `P+ = P - G D G*`, and the gain, with `P H*` at hand.
#[inline(always)]
fn pass<L: Lanes>(s: L, inertia: &mut Inertia<L::V>, axis: L::V, [angular, linear]: [L::V; 2], inverse: L::V, l: L::V) -> Factor {
    *inertia = inertia.less(s, [angular, linear], inverse);
    let gain = s.mul(linear, inverse);
    let [x, y, z] = s.three(s.mul_add(angular, inverse, s.cross(l, gain)));
    Factor { axis: s.store(axis), gain_angular: [x, y, z, s.first(inverse)], gain_linear: s.store(gain), l: s.store(l) }
}
