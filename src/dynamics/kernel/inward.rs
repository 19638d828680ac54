//! Second pass: articulated inertias and residual forces, from the tips to the base. Source: Paper Eq. 9 to 12, in inertial axes.

use super::cyclic::{Inertia, Symmetric, Turns, general_product, square, symmetric_product, symmetric_times, transposed_times};
use super::hinge::external_force;
use super::layout::{Passage, Shape};
use super::record::{Hinge, Outboard, block};
use super::six::{Pair, Six};
use super::tip::columns_of;
use super::{Arm, Doubtful, TreeKernel, arm, parent_motion};
use crate::dynamics::sweep::inertia_inward::SINGULAR;
use crate::model::{State, System};
use crate::spatial::lanes::Lanes;
use crate::spatial::shift::{angular, linear};
use nalgebra::Matrix3;

/// Inertia and residual force in registers.
#[derive(Clone, Copy)]
pub struct Felt<V> {
    pub inertia: Inertia<V>,
    moment: V,
    force: V,
}

/// Fills the hinges, and what loads are made of.
#[inline(always)]
pub fn inward<L: Lanes, const LOADS: bool>(s: L, tree: &mut TreeKernel, system: &System, state: &State) -> Result<(), Doubtful> {
    let TreeKernel { layout, motion, applied, hinges, outboard, branches, general, flexible, modal_shapes, external, .. } = tree;
    for branch in branches.iter_mut() {
        branch.felt = Outboard::default();
    }
    let mut felt = Felt::none(s);
    // slices of one length need no check of an index in the loop
    let n = layout.links.len();
    let (links, motion, applied, hinges) = (&layout.links[..n], &motion[..n], &applied[..n], &mut hinges[..n]);
    let outboard = if LOADS { &mut outboard[..n] } else { &mut outboard[..0] };
    let mut k = n;
    while k > 0 {
        k -= 1;
        // most bodies of most systems: in a loop that asks no questions and calls nothing, so that what is felt stays in registers
        while links[k].is_plain && links[k].passage == Passage::Revolute && k > 0 {
            let (link, parent) = (&links[k], &motion[k - 1]);
            let shape = &layout.shapes[link.shape as usize];
            let (turn, omega) = (block(s, &motion[k].turn), s.load(motion[k].omega));
            felt.add_body(s, shape, turn, omega);
            let at = arm(s, link, shape, state, block(s, &parent.turn), s.load(parent.omega), turn[2]);
            let place = if LOADS { Some(&mut outboard[k]) } else { None };
            hinges[k] = felt.pass_revolute(s, turn[2], applied[k], &at, place)?;
            felt.shift(s, at.l);
            k -= 1;
        }
        let link = &links[k];
        let shape = &layout.shapes[link.shape as usize];
        let (turn, omega) = (block(s, &motion[k].turn), s.load(motion[k].omega));
        if let Some(branch) = branches.get(link.branch as usize) {
            felt.join(s, &Felt::of(s, &branch.felt));
        }
        if let Some(own) = flexible.get_mut(link.flexible as usize) {
            let constants = &modal_shapes[own.shape];
            own.gather_loads(system, state);
            felt.join(s, &own.filter(s, constants)?);
        } else {
            felt.add_body(s, shape, turn, omega);
        }
        if let Some(load) = external.get_mut(link.load as usize) {
            *load = external_force(system, state, k, &motion[k], &shape.turn);
            felt.moment = s.sub(felt.moment, s.of_three([load[0], load[1], load[2]]));
            felt.force = s.sub(felt.force, s.of_three([load[3], load[4], load[5]]));
        }

        let l = if link.passage == Passage::General {
            let own = &mut general[link.general as usize];
            let (inertia, force) = felt.stored(s).plain();
            felt = if own.is_free {
                let transmitted = own.release(system, state, &inertia, &force)?;
                let zero = Felt::none(s);
                Felt { moment: s.of_three(angular(&transmitted).into()), force: s.of_three(linear(&transmitted).into()), ..zero }
            } else {
                let (inertia, force) = own.filter(system, state, &inertia, &force)?;
                Felt::of(s, &Outboard::new(&inertia, &force))
            };
            s.of_three(own.l.into())
        } else {
            let (parent_turn, parent_omega) = parent_motion(s, link, layout, motion, flexible);
            let at = arm(s, link, shape, state, parent_turn, parent_omega, turn[2]);
            match link.passage {
                Passage::Revolute => hinges[k] = felt.pass_revolute(s, turn[2], applied[k], &at, None)?,
                Passage::Slide => hinges[k] = felt.pass_slide(s, turn[2], shape, applied[k], &at)?,
                Passage::Fixed | Passage::General => {
                    felt.take_bias(s, &at);
                    hinges[k] = Hinge { l: s.store(at.l), bias_linear: s.store(at.linear), ..Hinge::default() };
                }
            }
            at.l
        };
        if LOADS {
            outboard[k] = felt.stored(s);
        }
        felt.shift(s, l);
        if let Some(&(body, tip)) = layout.tips.get(link.tip as usize) {
            flexible[body as usize].tips[tip as usize].felt = felt.stored(s);
            felt = Felt::none(s);
        } else if link.parent as usize + 1 != k || k == 0 {
            if let Some(branch) = layout.links.get(link.parent as usize).and_then(|p| branches.get_mut(p.branch as usize)) {
                felt.join(s, &Felt::of(s, &branch.felt));
                branch.felt = felt.stored(s);
            }
            felt = Felt::none(s);
        }
    }
    Ok(())
}

/// Rotational inertia about O and first moment of a rigid body at `turn`.
#[inline(always)]
pub fn rigid_inertia<L: Lanes>(s: L, shape: &Shape, turn: [L::V; 3]) -> (Symmetric<L::V>, Turns<L::V>) {
    let i = &shape.inertia;
    // R I R'
    let half: [L::V; 3] = [
        s.combine_numbers(turn, [i[0], i[1], i[2]]),
        s.combine_numbers(turn, [i[3], i[4], i[5]]),
        s.combine_numbers(turn, [i[6], i[7], i[8]]),
    ];
    let own = symmetric_product(s, half, turn);
    (own, Turns::new(s, s.combine_numbers(turn, shape.first_moment)))
}

impl<V: Copy> Felt<V> {
    #[inline(always)]
    pub fn none<L: Lanes<V = V>>(s: L) -> Self {
        let zero = s.splat(0.0);
        let inertia = Inertia { rotational: [zero; 2], coupling: [zero; 3], translational: [zero; 2] };
        Self { inertia, moment: zero, force: zero }
    }

    /// Adds the body itself: its inertia about O, and what its motion asks for.
    #[inline(always)]
    fn add_body<L: Lanes<V = V>>(&mut self, s: L, shape: &Shape, turn: [V; 3], omega: V) {
        let (own, first_moment) = rigid_inertia(s, shape, turn);
        self.moment = s.add(self.moment, s.cross(omega, symmetric_times(s, own, omega)));
        self.force = s.add(self.force, s.cross(omega, s.cross(omega, first_moment.x)));
        self.inertia = self.inertia.with_rigid(s, own, &first_moment, shape.mass);
    }

    /// Through a revolute hinge about `axis` with the torque `applied`: what is left is `P+` and `z+`, which are put into `place` as soon as
    /// they are known.
    #[inline(always)]
    fn pass_revolute<L: Lanes<V = V>>(
        &mut self,
        s: L,
        axis: V,
        applied: f64,
        at: &Arm<V>,
        place: Option<&mut Outboard>,
    ) -> Result<Hinge, Doubtful> {
        // P H*, D and its inverse
        let angular = symmetric_times(s, self.inertia.rotational, axis);
        let linear = transposed_times(s, self.inertia.coupling, axis);
        let pivot = square(s, self.inertia.rotational, axis);
        let size = s.first(pivot);
        if !(size > SINGULAR * s.sum(self.inertia.rotational[0]) && size >= f64::MIN_POSITIVE) {
            return Err(Doubtful);
        }
        let epsilon = s.sub(s.splat(applied), s.total(s.mul(axis, self.moment)));
        Ok(self.pass(s, [angular, linear], s.inverse(pivot), epsilon, at, place))
    }

    /// The same through a hinge that travels along `axis`, and turns about it or not.
    #[inline(always)]
    fn pass_slide<L: Lanes<V = V>>(&mut self, s: L, axis: V, shape: &Shape, applied: f64, at: &Arm<V>) -> Result<Hinge, Doubtful> {
        let (turn, travel) = (s.mul(axis, s.splat(shape.turn_rate)), s.mul(axis, s.splat(shape.travel_rate)));
        let [angular, linear] = self.inertia.times_add(s, turn, travel, [s.splat(0.0); 2]);
        let pivot = s.dot_two(turn, angular, travel, linear);
        let size = shape.turn_rate * shape.turn_rate * s.sum(self.inertia.rotational[0])
            + shape.travel_rate * shape.travel_rate * s.sum(self.inertia.translational[0]);
        if !(pivot > SINGULAR * size && pivot >= f64::MIN_POSITIVE) {
            return Err(Doubtful);
        }
        let epsilon = applied - s.dot_two(turn, self.moment, travel, self.force);
        Ok(self.pass(s, [angular, linear], s.splat(1.0 / pivot), s.splat(epsilon), at, None))
    }

    /// `P+ = P - G D G*` and `z+ = z + G epsilon + P+ a`, with `P H*` at hand, and the inverse of D and epsilon everywhere.
    #[inline(always)]
    fn pass<L: Lanes<V = V>>(
        &mut self,
        s: L,
        [angular, linear]: Pair<V>,
        inverse: V,
        epsilon: V,
        at: &Arm<V>,
        mut place: Option<&mut Outboard>,
    ) -> Hinge {
        let nu = s.mul(epsilon, inverse);
        self.inertia = self.inertia.less(s, [angular, linear], inverse);
        if let Some(place) = &mut place {
            place.put_inertia(s, &self.inertia);
        }
        self.moment = s.mul_add(angular, nu, self.moment);
        self.force = s.mul_add(linear, nu, self.force);
        self.take_bias(s, at);
        if let Some(place) = &mut place {
            place.put_wrench(s, [self.moment, self.force]);
        }
        let [x, y, z] = s.three(s.mul(angular, inverse));
        Hinge {
            gain_angular: [x, y, z, s.first(nu)],
            gain_linear: s.store(s.mul(linear, inverse)),
            l: s.store(at.l),
            bias_angular: s.store(at.angular),
            bias_linear: s.store(at.linear),
        }
    }

    /// `z <- z + P a`.
    #[inline(always)]
    fn take_bias<L: Lanes<V = V>>(&mut self, s: L, at: &Arm<V>) {
        [self.moment, self.force] = self.inertia.times_add(s, at.angular, at.linear, [self.moment, self.force]);
    }

    /// From O to the origin of the parent, which lies at `-l`: `phi P phi*` and `phi z`.
    #[inline(always)]
    pub fn shift<L: Lanes<V = V>>(&mut self, s: L, l: V) {
        let l = Turns::new(s, l);
        self.inertia = self.inertia.shifted(s, &l);
        self.moment = s.mul_take(l.zxy, s.yzx(self.force), s.mul_add(l.yzx, s.zxy(self.force), self.moment));
    }

    /// An inertia and force in axes that `rotation` turns into these.
    #[inline(always)]
    pub fn turned<L: Lanes<V = V>>(s: L, inertia: &Six, force: Pair<V>, rotation: &Matrix3<f64>) -> Self {
        let axes = columns_of(s, rotation);
        let (mut rotational, mut coupling, mut translational) = ([axes[0]; 3], [axes[0]; 3], [axes[0]; 3]);
        // R B, then times R'
        for j in 0..3 {
            rotational[j] = s.combine(axes, inertia.column(s, j)[0]);
            let [upper, lower] = inertia.column(s, j + 3);
            (coupling[j], translational[j]) = (s.combine(axes, upper), s.combine(axes, lower));
        }
        let inertia = Inertia {
            rotational: symmetric_product(s, rotational, axes),
            coupling: general_product(s, coupling, axes),
            translational: symmetric_product(s, translational, axes),
        };
        Self { inertia, moment: s.combine(axes, force[0]), force: s.combine(axes, force[1]) }
    }

    /// Adds another.
    #[inline(always)]
    fn join<L: Lanes<V = V>>(&mut self, s: L, other: &Self) {
        self.inertia = self.inertia.plus(s, &other.inertia);
        self.moment = s.add(self.moment, other.moment);
        self.force = s.add(self.force, other.force);
    }

    /// From a record.
    #[inline(always)]
    fn of<L: Lanes<V = V>>(s: L, record: &Outboard) -> Self {
        let [moment, force] = record.wrench(s);
        Self { inertia: record.inertia(s), moment, force }
    }

    /// As a record.
    #[inline(always)]
    fn stored<L: Lanes<V = V>>(&self, s: L) -> Outboard {
        Outboard::of(s, &self.inertia, [self.moment, self.force])
    }
}
