//! First pass: attitude and angular velocity of every body, from the base to the tips. Source: Paper Eq. 8, in inertial axes.

use super::layout::{Passage, Shape};
use super::record::{Motion, block, stored};
use super::{NONE, TreeKernel, carrier, parent_motion};
use crate::model::{State, System};
use crate::spatial::lanes::Lanes;

/// Fills the motions, and what general hinges make of them.
#[inline(always)]
pub fn outward<L: Lanes>(s: L, tree: &mut TreeKernel, system: &System, state: &State) {
    let TreeKernel { layout, motion, applied, general, flexible, modal_shapes, velocity, .. } = tree;
    let (mut last, mut turn, mut omega) = (NONE, block(s, &Motion::REST.turn), s.splat(0.0));
    for (k, link) in layout.links.iter().enumerate() {
        if !link.is_plain && (link.parent != last || link.tip != NONE) {
            (turn, omega) = parent_motion(s, link, layout, motion, flexible);
        }
        let shape = &layout.shapes[link.shape as usize];
        if link.passage == Passage::General {
            let own = &mut general[link.general as usize];
            let parent = carrier(link, layout, motion, flexible).copied();
            motion[k] = own.follow(system, state, shape, parent.as_ref());
            (turn, omega) = (block(s, &motion[k].turn), s.load(motion[k].omega));
        } else {
            turn = fixed(s, shape, turn);
            if link.passage != Passage::Fixed {
                applied[k] = link.applied(system, state, layout);
            }
            match link.passage {
                Passage::Revolute => {
                    turn = turned(s, turn, state.position[link.q as usize]);
                    omega = s.mul_add(turn[2], s.splat(state.velocity[link.v as usize]), omega);
                }
                Passage::Slide if shape.turn_rate != 0.0 => {
                    turn = turned(s, turn, shape.turn_rate * state.position[link.q as usize]);
                    omega = s.mul_add(turn[2], s.splat(shape.turn_rate * state.velocity[link.v as usize]), omega);
                }
                _ => {}
            }
            motion[k] = Motion { turn: stored(s, turn), omega: s.store(omega) };
        }
        if !link.is_plain
            && let Some(own) = flexible.get_mut(link.flexible as usize)
        {
            let constants = &modal_shapes[own.shape];
            own.follow(s, system, state, constants, &motion[k]);
        }
        last = u32::try_from(k).unwrap_or(NONE);
    }
    if !velocity.is_empty() {
        super::hinge::velocities(state, layout, motion, general, flexible, velocity);
    }
}

/// Attitude of the link axes with the hinge at zero.
#[inline(always)]
fn fixed<L: Lanes>(s: L, shape: &Shape, parent: [L::V; 3]) -> [L::V; 3] {
    let f = &shape.fixed;
    [
        s.combine_numbers(parent, [f[0], f[1], f[2]]),
        s.combine_numbers(parent, [f[3], f[4], f[5]]),
        s.combine_numbers(parent, [f[6], f[7], f[8]]),
    ]
}

/// The same after a turn by `angle` (rad) about the third axis.
#[inline(always)]
fn turned<L: Lanes>(s: L, [x, y, z]: [L::V; 3], angle: f64) -> [L::V; 3] {
    let (sine, cosine) = angle.sin_cos();
    let (sine, cosine) = (s.splat(sine), s.splat(cosine));
    [s.mul_add(x, cosine, s.mul(y, sine)), s.mul_take(x, sine, s.mul(y, cosine)), z]
}
