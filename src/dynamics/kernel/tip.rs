//! A child that the modes of its parent move: the frame O+ that carries it, and what crosses that frame.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use super::cyclic::{columns, symmetric_columns};
use super::record::{Motion, Outboard};
use super::rows::{Block, two_products};
use super::six::{Pair, Six};
use crate::model::Attachment;
use crate::spatial::lanes::Lanes;
use crate::spatial::rotation::{skew, turning_frame};
use crate::spatial::shift::spatial;
use nalgebra::{Matrix3, Vector3, Vector6};

/// Such a child; in the axes of the parent's frame B where nothing else is said.
#[derive(Debug, Clone)]
pub struct Tip {
    /// Body index of the child.
    pub child: usize,
    /// Frame O+ in inertial axes.
    pub motion: Motion,
    /// Velocity of the origin of O+ in inertial axes, for systems with loads.
    pub velocity: Vector3<f64>,
    /// What the child leaves at O+, inertial axes.
    pub felt: Outboard,
    /// Acceleration of O+ (angular; linear), inertial axes.
    pub acceleration: [f64; 6],
    /// `Phi r`.
    pub e: [[f64; 4]; 2],
    /// `Z`.
    pub Z: Six,
    /// `F' Phi'` at the present deformation, for inertia of order 1 and 2.
    pub coupling: Six,
    /// O+ in B (m).
    pub position: Vector3<f64>,
    /// The interface in B (m).
    interface: Vector3<f64>,
    /// Bias acceleration of O+.
    bias: Vector6<f64>,
    /// Left halves of `T`: angular rows, linear rows. Its right halves are zero and one.
    turn: Matrix3<f64>,
    lift: Matrix3<f64>,
    /// Velocity of O+ that the modes make.
    rate: Vector6<f64>,
}

impl Tip {
    /// Of body `child`.
    pub fn new(child: usize) -> Self {
        Self {
            child,
            motion: Motion::REST,
            velocity: Vector3::zeros(),
            felt: Outboard::default(),
            acceleration: [0.0; 6],
            e: [[0.0; 4]; 2],
            Z: Six::ZERO,
            coupling: Six::ZERO,
            position: Vector3::zeros(),
            interface: Vector3::zeros(),
            bias: Vector6::zeros(),
            turn: Matrix3::identity(),
            lift: Matrix3::zeros(),
            rate: Vector6::zeros(),
        }
    }

    /// Pose, rates and bias of the frame at the modal coordinates and rates, on a body at `rotation` that turns with `omega`.
    ///
    /// As [`crate::dynamics::frame_motion`], which says where it comes from.
    #[inline(always)]
    pub fn follow<L: Lanes>(
        &mut self,
        s: L,
        side: &Attachment,
        rows: &[Block<6>],
        [eta, eta_dot]: [&[[f64; 4]]; 2],
        rotation: &Matrix3<f64>,
        omega: &Vector3<f64>,
    ) {
        let [displacement, rate] = two_products(s, rows, eta, eta_dot);
        let (theta, u) = (Vector3::from(s.three(displacement[0])), Vector3::from(s.three(displacement[1])));
        let (theta_dot, u_dot) = (Vector3::from(s.three(rate[0])), Vector3::from(s.three(rate[1])));
        let (turned, jacobian, jacobian_rate) = turning_frame(&theta, &theta_dot);
        let axes = turned * side.rotation;
        self.interface = side.position + u;
        let lever = axes * side.offset;
        self.position = self.interface + lever;
        self.turn = jacobian;
        self.lift = -skew(&lever) * jacobian;
        let relative = jacobian * theta_dot;
        self.rate = spatial(&relative, &(u_dot + relative.cross(&lever)));
        let spin = jacobian_rate + omega.cross(&relative);
        let of_frame = omega + relative;
        let linear = omega.cross(&omega.cross(&self.interface))
            + omega.cross(&u_dot) * 2.0
            + spin.cross(&lever)
            + of_frame.cross(&of_frame.cross(&lever));
        self.bias = spatial(&spin, &linear);
        self.motion = Motion::new(&(rotation * (axes * side.offset_rotation)), &(rotation * of_frame));
    }

    /// Velocity of O+ on a body whose frame B moves with (`omega`, `v`).
    pub fn follow_velocity(&mut self, rotation: &Matrix3<f64>, omega: &Vector3<f64>, v: &Vector3<f64>) {
        let own = Vector3::new(self.rate[3], self.rate[4], self.rate[5]);
        self.velocity = rotation * (v + omega.cross(&self.position) + own);
    }

    /// `S` and the force felt at O+, its bias included.
    #[inline(always)]
    pub fn gather<L: Lanes>(&self, s: L, rotation: &Matrix3<f64>) -> (Six, Pair<L::V>) {
        let (inertia, wrench) = (self.felt.inertia(s), self.felt.wrench(s));
        let back = rows_of(s, rotation);
        let rotational = turned(s, symmetric_columns(s, inertia.rotational), rotation, back);
        let coupling = turned(s, columns(s, inertia.coupling), rotation, back);
        let translational = turned(s, symmetric_columns(s, inertia.translational), rotation, back);
        let (x, y, z) = (s.three(coupling[0]), s.three(coupling[1]), s.three(coupling[2]));
        let mut S = Six::ZERO;
        for j in 0..3 {
            S.put(s, j, [rotational[j], s.of_three([x[j], y[j], z[j]])]);
            S.put(s, j + 3, [coupling[j], translational[j]]);
        }
        let b = &self.bias;
        let [moment, force] = S.combine(s, [b[0], b[1], b[2], b[3], b[4], b[5]]);
        let own = [s.combine(back, wrench[0]), s.combine(back, wrench[1])];
        (S, [s.add(own[0], moment), s.add(own[1], force)])
    }

    /// `T' f`.
    #[inline(always)]
    pub fn turn_back<L: Lanes>(&self, s: L, f: Pair<L::V>) -> Pair<L::V> {
        let top = s.combine(rows_of(s, &self.turn), f[0]);
        [s.combine_add(rows_of(s, &self.lift), f[1], top), f[1]]
    }

    /// `T' S T`.
    #[inline(always)]
    pub fn turn_inertia<L: Lanes>(&self, s: L, S: &Six, out: &mut Six) {
        let (turn, lift) = (&self.turn, &self.lift);
        for j in 0..3 {
            let moved = S.combine(s, [turn[(0, j)], turn[(1, j)], turn[(2, j)], lift[(0, j)], lift[(1, j)], lift[(2, j)]]);
            out.put(s, j, self.turn_back(s, moved));
            out.put(s, j + 3, self.turn_back(s, S.column(s, j + 3)));
        }
    }

    /// Leaves `Z = X - F' Phi'` (`coupling`), `X = (T^-1 phi*)'`; false where the interface's rotation vector is singular.
    #[inline(always)]
    pub fn reach<L: Lanes>(&mut self, s: L, coupling: &Six) -> bool {
        let t = &self.turn;
        let column = |j: usize| Vector3::new(t[(0, j)], t[(1, j)], t[(2, j)]);
        let (a, b, c) = (column(0), column(1), column(2));
        // the transposed inverse of a matrix of columns a, b, c
        let (x, y, z) = (b.cross(&c), c.cross(&a), a.cross(&b));
        let inverse = 1.0 / a.dot(&x);
        let p = &self.interface;
        let columns = [
            [x.x * inverse, x.y * inverse, x.z * inverse, 0.0, 0.0, 0.0],
            [y.x * inverse, y.y * inverse, y.z * inverse, 0.0, 0.0, 0.0],
            [z.x * inverse, z.y * inverse, z.z * inverse, 0.0, 0.0, 0.0],
            [0.0, p.z, -p.y, 1.0, 0.0, 0.0],
            [-p.z, 0.0, p.x, 0.0, 1.0, 0.0],
            [p.y, -p.x, 0.0, 0.0, 0.0, 1.0],
        ];
        for j in 0..6 {
            let (x, [top, bottom]) = (columns[j], coupling.column(s, j));
            let own = [s.of_three([x[0], x[1], x[2]]), s.of_three([x[3], x[4], x[5]])];
            self.Z.put(s, j, [s.sub(own[0], top), s.sub(own[1], bottom)]);
        }
        inverse.is_finite()
    }

    /// Leaves the acceleration of O+ on a body at `rotation` that accelerates with `alpha`, when the modes move the interface with `moved`.
    #[inline(always)]
    pub fn accelerate<L: Lanes>(&mut self, s: L, rotation: &Matrix3<f64>, alpha: Pair<L::V>, moved: Pair<L::V>) {
        let b = &self.bias;
        let at = s.of_three(self.position.into());
        let angular = s.combine_add(columns_of(s, &self.turn), moved[0], s.add(alpha[0], s.of_three([b[0], b[1], b[2]])));
        let carried = s.add(s.add(alpha[1], s.cross(alpha[0], at)), s.of_three([b[3], b[4], b[5]]));
        let linear = s.combine_add(columns_of(s, &self.lift), moved[0], s.add(carried, moved[1]));
        let axes = columns_of(s, rotation);
        let (a, b) = (s.three(s.combine(axes, angular)), s.three(s.combine(axes, linear)));
        self.acceleration = [a[0], a[1], a[2], b[0], b[1], b[2]];
    }
}

/// Columns of a matrix in registers.
#[inline(always)]
pub fn columns_of<L: Lanes>(s: L, m: &Matrix3<f64>) -> [L::V; 3] {
    [s.of_three([m[0], m[1], m[2]]), s.of_three([m[3], m[4], m[5]]), s.of_three([m[6], m[7], m[8]])]
}

/// Rows of a matrix in registers: the columns of its transpose.
#[inline(always)]
pub fn rows_of<L: Lanes>(s: L, m: &Matrix3<f64>) -> [L::V; 3] {
    [s.of_three([m[0], m[3], m[6]]), s.of_three([m[1], m[4], m[7]]), s.of_three([m[2], m[5], m[8]])]
}

/// `R' B R`; `back` holds the rows of R.
#[inline(always)]
fn turned<L: Lanes>(s: L, block: [L::V; 3], r: &Matrix3<f64>, back: [L::V; 3]) -> [L::V; 3] {
    [
        s.combine(back, s.combine_numbers(block, [r[0], r[1], r[2]])),
        s.combine(back, s.combine_numbers(block, [r[3], r[4], r[5]])),
        s.combine(back, s.combine_numbers(block, [r[6], r[7], r[8]])),
    ]
}
