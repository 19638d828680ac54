//! Second pass: articulated inertias and residual forces, from the tips to the base. Source: Paper Eq. 9 to 12, in inertial axes.

use super::hinge::external_force;
use super::layout::{Passage, Shape};
use super::six::{Pair, Six};
use super::tip::columns_of;
use super::{Arm, Doubtful, Gain, Outboard, RECORD, TreeKernel, angular_velocity, arm, attitude, parent_motion};
use crate::dynamics::sweep::inertia_inward::SINGULAR;
use crate::model::{State, System};
use crate::spatial::SpatialInertia;
use crate::spatial::lanes::{Lanes, quad};
use crate::spatial::shift::spatial;
use nalgebra::{Matrix3, Vector3, Vector6};

/// Inertia `[[rotational, coupling], [coupling', translational]]` by columns, and residual force, in registers.
#[derive(Clone, Copy)]
pub struct Felt<V> {
    pub rotational: [V; 3],
    pub coupling: [V; 3],
    /// Transpose of `coupling`.
    pub coupled: [V; 3],
    pub translational: [V; 3],
    pub moment: V,
    pub force: V,
}

/// Fills the gains, and what loads are made of.
#[inline(always)]
pub fn inward<L: Lanes>(s: L, tree: &mut TreeKernel, system: &System, state: &State) -> Result<(), Doubtful> {
    let TreeKernel { layout, motion, gains, outboard, branches, general, flexible, modal_shapes, external, .. } = tree;
    for branch in branches.iter_mut() {
        branch.felt = [0.0; RECORD];
    }
    let mut felt = Felt::none(s);
    for (k, link) in layout.links.iter().enumerate().rev() {
        let shape = &layout.shapes[link.shape as usize];
        let (turn, omega) = (attitude(s, &motion[k]), angular_velocity(s, &motion[k]));
        if let Some(branch) = branches.get(link.branch as usize) {
            felt.add(s, &branch.felt);
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
            let (inertia, force) = felt.plain(s);
            let (inertia, force) = own.filter(system, state, &inertia, &force)?;
            felt = Felt::of_plain(s, &inertia, &force);
            s.of_three(own.l.into())
        } else {
            let (parent_turn, parent_omega) = parent_motion(s, link, layout, motion, flexible);
            let at = arm(s, link, shape, state, parent_turn, parent_omega, turn[2]);
            match link.passage {
                Passage::Revolute => gains[k] = felt.pass_revolute(s, turn[2], link.applied(system, state, layout), &at)?,
                Passage::Slide => gains[k] = felt.pass_slide(s, turn[2], shape, link.applied(system, state, layout), &at)?,
                Passage::Fixed | Passage::General => felt.take_bias(s, &at, [s.splat(0.0); 2]),
            }
            at.l
        };
        if let Some(out) = outboard.get_mut(k) {
            felt.write(s, out);
        }
        felt.shift(s, l);
        if let Some(&(body, tip)) = layout.tips.get(link.tip as usize) {
            felt.write(s, &mut flexible[body as usize].tips[tip as usize].felt);
            felt = Felt::none(s);
        } else if link.parent as usize + 1 != k || k == 0 {
            if let Some(branch) = layout.links.get(link.parent as usize).and_then(|p| branches.get_mut(p.branch as usize)) {
                felt.add(s, &branch.felt);
                felt.write(s, &mut branch.felt);
            }
            felt = Felt::none(s);
        }
    }
    Ok(())
}

impl<V: Copy> Felt<V> {
    #[inline(always)]
    fn none<L: Lanes<V = V>>(s: L) -> Self {
        let zero = s.splat(0.0);
        let block = [zero; 3];
        Self { rotational: block, coupling: block, coupled: block, translational: block, moment: zero, force: zero }
    }

    /// Adds the body itself: its inertia about O, and what its motion asks for.
    #[inline(always)]
    fn add_body<L: Lanes<V = V>>(&mut self, s: L, shape: &Shape, turn: [V; 3], omega: V) {
        let i = &shape.inertia;
        // R I R'
        let half: [V; 3] = [
            s.combine_numbers(turn, [i[0], i[1], i[2]]),
            s.combine_numbers(turn, [i[3], i[4], i[5]]),
            s.combine_numbers(turn, [i[6], i[7], i[8]]),
        ];
        let own = [
            s.combine_lanes(half, [s.all_x(turn[0]), s.all_x(turn[1]), s.all_x(turn[2])]),
            s.combine_lanes(half, [s.all_y(turn[0]), s.all_y(turn[1]), s.all_y(turn[2])]),
            s.combine_lanes(half, [s.all_z(turn[0]), s.all_z(turn[1]), s.all_z(turn[2])]),
        ];
        let first_moment = s.combine_numbers(turn, shape.first_moment);
        self.moment = s.add(self.moment, s.cross(omega, s.combine(own, omega)));
        self.force = s.add(self.force, s.cross(omega, s.cross(omega, first_moment)));
        let [x, y, z] = s.three(first_moment);
        let skew = [s.of_three([0.0, z, -y]), s.of_three([-z, 0.0, x]), s.of_three([y, -x, 0.0])];
        let m = shape.mass;
        let mass = [s.load([m, 0.0, 0.0, 0.0]), s.load([0.0, m, 0.0, 0.0]), s.load([0.0, 0.0, m, 0.0])];
        for j in 0..3 {
            self.rotational[j] = s.add(self.rotational[j], own[j]);
            self.coupling[j] = s.add(self.coupling[j], skew[j]);
            self.coupled[j] = s.sub(self.coupled[j], skew[j]);
            self.translational[j] = s.add(self.translational[j], mass[j]);
        }
    }

    /// Through a revolute hinge about `axis` with the torque `applied`: what is left is `P+` and `z+`.
    #[inline(always)]
    fn pass_revolute<L: Lanes<V = V>>(&mut self, s: L, axis: V, applied: f64, at: &Arm<V>) -> Result<Gain, Doubtful> {
        // P H*, D and its inverse
        let (angular, linear) = (s.combine(self.rotational, axis), s.combine(self.coupled, axis));
        let pivot = s.dot(axis, angular);
        if !(pivot > SINGULAR * trace(s, self.rotational) && pivot >= f64::MIN_POSITIVE) {
            return Err(Doubtful);
        }
        Ok(self.pass(s, [angular, linear], 1.0 / pivot, applied - s.dot(axis, self.moment), at))
    }

    /// The same through a hinge that travels along `axis`, and turns about it or not.
    #[inline(always)]
    fn pass_slide<L: Lanes<V = V>>(&mut self, s: L, axis: V, shape: &Shape, applied: f64, at: &Arm<V>) -> Result<Gain, Doubtful> {
        let (turn, travel) = (s.mul(axis, s.splat(shape.turn_rate)), s.mul(axis, s.splat(shape.travel_rate)));
        let angular = s.combine_add(self.coupling, travel, s.combine(self.rotational, turn));
        let linear = s.combine_add(self.translational, travel, s.combine(self.coupled, turn));
        let pivot = s.dot_two(turn, angular, travel, linear);
        let size = shape.turn_rate * shape.turn_rate * trace(s, self.rotational)
            + shape.travel_rate * shape.travel_rate * trace(s, self.translational);
        if !(pivot > SINGULAR * size && pivot >= f64::MIN_POSITIVE) {
            return Err(Doubtful);
        }
        let epsilon = applied - s.dot_two(turn, self.moment, travel, self.force);
        Ok(self.pass(s, [angular, linear], 1.0 / pivot, epsilon, at))
    }

    /// `P+ = P - G D G*` and `z+ = z + G epsilon + P+ a`, with `P H*` and the inverse of D at hand.
    #[inline(always)]
    fn pass<L: Lanes<V = V>>(&mut self, s: L, [angular, linear]: Pair<V>, inverse: f64, epsilon: f64, at: &Arm<V>) -> Gain {
        let nu = epsilon * inverse;
        let (gain_angular, gain_linear) = (s.mul(angular, s.splat(inverse)), s.mul(linear, s.splat(inverse)));
        let by_angular = [s.all_x(gain_angular), s.all_y(gain_angular), s.all_z(gain_angular)];
        let by_linear = [s.all_x(gain_linear), s.all_y(gain_linear), s.all_z(gain_linear)];
        for j in 0..3 {
            self.rotational[j] = s.mul_take(angular, by_angular[j], self.rotational[j]);
            self.coupled[j] = s.mul_take(linear, by_angular[j], self.coupled[j]);
            self.coupling[j] = s.mul_take(angular, by_linear[j], self.coupling[j]);
            self.translational[j] = s.mul_take(linear, by_linear[j], self.translational[j]);
        }
        self.take_bias(s, at, [s.mul(angular, s.splat(nu)), s.mul(linear, s.splat(nu))]);
        let ([gx, gy, gz], [fx, fy, fz]) = (s.three(gain_angular), s.three(gain_linear));
        [gx, gy, gz, fx, fy, fz, nu, 0.0]
    }

    /// `z <- z + added + P a`.
    #[inline(always)]
    fn take_bias<L: Lanes<V = V>>(&mut self, s: L, at: &Arm<V>, added: Pair<V>) {
        let moment = s.combine_add(self.rotational, at.angular, s.add(self.moment, added[0]));
        let force = s.combine_add(self.coupled, at.angular, s.add(self.force, added[1]));
        self.moment = s.combine_add(self.coupling, at.linear, moment);
        self.force = s.combine_add(self.translational, at.linear, force);
    }

    /// From O to the origin of the parent, which lies at `-l`: `phi P phi*` and `phi z`.
    #[inline(always)]
    pub fn shift<L: Lanes<V = V>>(&mut self, s: L, l: V) {
        let turned = [s.yzx(l), s.zxy(l)];
        let lanes = [s.all_x(l), s.all_y(l), s.all_z(l)];
        // A = C + l~ L, A' = C' - L l~, J + l~ C' - A l~
        for j in 0..3 {
            self.coupling[j] = s.add(self.coupling[j], across(s, turned, self.translational[j]));
            self.rotational[j] = s.add(self.rotational[j], across(s, turned, self.coupled[j]));
        }
        self.coupled = take_right(s, self.translational, lanes, self.coupled);
        self.rotational = take_right(s, self.coupling, lanes, self.rotational);
        self.moment = s.add(self.moment, across(s, turned, self.force));
    }

    /// An inertia and force in axes that `rotation` turns into these.
    #[inline(always)]
    pub fn turned<L: Lanes<V = V>>(s: L, inertia: &Six, force: Pair<V>, rotation: &Matrix3<f64>) -> Self {
        let (axes, mut out) = (columns_of(s, rotation), Self::none(s));
        let (mut rotational, mut coupling, mut translational) = ([axes[0]; 3], [axes[0]; 3], [axes[0]; 3]);
        for j in 0..3 {
            rotational[j] = inertia.column(s, j)[0];
            [coupling[j], translational[j]] = inertia.column(s, j + 3);
        }
        // R B R' column by column: the columns of B R' are B times the rows of R
        for j in 0..3 {
            let row = [rotation[(j, 0)], rotation[(j, 1)], rotation[(j, 2)]];
            out.rotational[j] = s.combine(axes, s.combine_numbers(rotational, row));
            out.coupling[j] = s.combine(axes, s.combine_numbers(coupling, row));
            out.translational[j] = s.combine(axes, s.combine_numbers(translational, row));
        }
        let (x, y, z) = (s.three(out.coupling[0]), s.three(out.coupling[1]), s.three(out.coupling[2]));
        for j in 0..3 {
            out.coupled[j] = s.of_three([x[j], y[j], z[j]]);
        }
        (out.moment, out.force) = (s.combine(axes, force[0]), s.combine(axes, force[1]));
        out
    }

    /// Adds another.
    #[inline(always)]
    fn join<L: Lanes<V = V>>(&mut self, s: L, other: &Self) {
        for j in 0..3 {
            self.rotational[j] = s.add(self.rotational[j], other.rotational[j]);
            self.coupling[j] = s.add(self.coupling[j], other.coupling[j]);
            self.coupled[j] = s.add(self.coupled[j], other.coupled[j]);
            self.translational[j] = s.add(self.translational[j], other.translational[j]);
        }
        self.moment = s.add(self.moment, other.moment);
        self.force = s.add(self.force, other.force);
    }

    /// Adds what a record holds.
    #[inline(always)]
    fn add<L: Lanes<V = V>>(&mut self, s: L, f: &Outboard) {
        for j in 0..3 {
            self.rotational[j] = s.add(self.rotational[j], get(s, f, 3 * j));
            self.coupling[j] = s.add(self.coupling[j], get(s, f, 3 * j + 9));
            self.coupled[j] = s.add(self.coupled[j], s.of_three([f[j + 9], f[j + 12], f[j + 15]]));
            self.translational[j] = s.add(self.translational[j], get(s, f, 3 * j + 18));
        }
        self.moment = s.add(self.moment, get(s, f, 27));
        self.force = s.add(self.force, get(s, f, 30));
    }

    /// To memory: three blocks by columns, moment, force.
    #[inline(always)]
    fn write<L: Lanes<V = V>>(&self, s: L, out: &mut Outboard) {
        for j in 0..3 {
            put(s, self.rotational[j], out, 3 * j);
        }
        for j in 0..3 {
            put(s, self.coupling[j], out, 3 * j + 9);
        }
        for j in 0..3 {
            put(s, self.translational[j], out, 3 * j + 18);
        }
        put(s, self.moment, out, 27);
        put(s, self.force, out, 30);
    }

    /// As the plain algebra of general hinges wants it.
    #[inline(always)]
    fn plain<L: Lanes<V = V>>(&self, s: L) -> (SpatialInertia, Vector6<f64>) {
        let mut record = [0.0; RECORD];
        self.write(s, &mut record);
        plain(&record)
    }

    #[inline(always)]
    fn of_plain<L: Lanes<V = V>>(s: L, inertia: &SpatialInertia, force: &Vector6<f64>) -> Self {
        let mut felt = Self::none(s);
        felt.add(s, &numbers(inertia, force));
        felt
    }
}

/// Three numbers of memory to a register.
#[inline(always)]
fn get<L: Lanes>(s: L, f: &Outboard, at: usize) -> L::V {
    s.load(quad(f, at))
}

/// Three numbers of a register to memory; what follows them is written later.
#[inline(always)]
fn put<L: Lanes>(s: L, a: L::V, out: &mut Outboard, at: usize) {
    if let Some(place) = out[at..].first_chunk_mut() {
        *place = s.store(a);
    }
}

/// Trace of a block.
#[inline(always)]
fn trace<L: Lanes>(s: L, block: [L::V; 3]) -> f64 {
    let (a, b, c) = (s.three(block[0]), s.three(block[1]), s.three(block[2]));
    (a[0] + b[1]) + c[2]
}

/// `l x b` of an arm whose permutations (y, z, x) and (z, x, y) are at hand.
#[inline(always)]
fn across<L: Lanes>(s: L, l: [L::V; 2], b: L::V) -> L::V {
    s.mul_take(l[1], s.yzx(b), s.mul(l[0], s.zxy(b)))
}

/// `to - block l~`.
#[inline(always)]
fn take_right<L: Lanes>(s: L, block: [L::V; 3], [x, y, z]: [L::V; 3], to: [L::V; 3]) -> [L::V; 3] {
    [
        s.mul_add(block[2], y, s.mul_take(block[1], z, to[0])),
        s.mul_add(block[0], z, s.mul_take(block[2], x, to[1])),
        s.mul_add(block[1], x, s.mul_take(block[0], y, to[2])),
    ]
}

/// Inertia and force of a record.
#[inline(never)]
pub fn plain(f: &Outboard) -> (SpatialInertia, Vector6<f64>) {
    let block = |at: usize| Matrix3::from_column_slice(&f[at..at + 9]);
    let symmetric = |m: Matrix3<f64>| (m + m.transpose()) * 0.5;
    let inertia = SpatialInertia { rotational: symmetric(block(0)), coupling: block(9), translational: symmetric(block(18)) };
    (inertia, spatial(&Vector3::new(f[27], f[28], f[29]), &Vector3::new(f[30], f[31], f[32])))
}

/// The record of an inertia and force.
#[inline(never)]
fn numbers(inertia: &SpatialInertia, force: &Vector6<f64>) -> Outboard {
    let mut out = [0.0; RECORD];
    out[..9].copy_from_slice(inertia.rotational.as_slice());
    out[9..18].copy_from_slice(inertia.coupling.as_slice());
    out[18..27].copy_from_slice(inertia.translational.as_slice());
    out[27..33].copy_from_slice(force.as_slice());
    out
}
