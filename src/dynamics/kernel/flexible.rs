//! Flexible bodies whose modes hold the inboard hinge: what the passes do with their modes.
//!
//! With `S_c = P+` of the children that the modes move, `Y_c = T_c Phi_c` their mode shapes (`Phi_c` constant, `T_c` 6 x 6 of the present
//! rotation) and `S~ = T' S T`, the modal block is `D = 1 + Phi' S~ Phi` and `mu = F + Phi' S~ X'`, `X' = T^-1 phi*`. Everything that Eq.
//! 32 to 41 ask of `D^-1` then comes down to `N = (1 + S~ Phi Phi')^-1 S~` and products of constants:
//!
//! - `P_cr+ = (P_rr - F' F) + Z N Z'`, `Z = X - F' Phi'`: a sum, so that heavy children cost no digits;
//! - `mu' D^-1 r = F' r + Z N Phi r`;
//! - `eta_ddot = r - F alpha - Phi' N (Phi r + Z' alpha)`.
//!
//! What is left per mode is a few passes over constant rows ([`super::rows`]). With inertia of order 0 `F` is constant too.
//! Source: Paper Eq. 32 to 41 with DESIGN 3.3 carried through; all in the axes of frame B.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use super::modal_shape::ModalShape;
use super::rows::{
    Block, block_count, fill, gram, inverse_sum, product, spill, sum_of, take_transposed, times, times_transposed, two_products,
};
use super::{Doubtful, Motion, Outboard, RECORD};
use crate::dynamics::flexible_inertia::FlexibleInertia;
use crate::dynamics::frame_motion::FramePose;
use crate::dynamics::sweep::force_inward::load_shape;
use crate::model::{FlexibleBody, InertiaOrder, LoadAxes, State, System};
use crate::spatial::SpatialInertia;
use crate::spatial::lanes::Lanes;
use crate::spatial::rotation::skew;
use crate::spatial::shift::{angular, force_from, linear, motion_to, rotate, rotate_back, spatial};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// A child that the modes move.
#[derive(Debug, Clone)]
pub struct Tip {
    child: usize,
    frame: FramePose,
    /// Frame O+ in inertial axes.
    pub motion: Motion,
    /// Velocity of the origin of O+ in inertial axes, for systems with loads.
    pub velocity: Vector3<f64>,
    /// Bias acceleration of O+, B axes.
    bias: Vector6<f64>,
    /// Rate of the interface's displacement.
    rate: Vector6<f64>,
    /// What the child leaves at O+, inertial axes.
    pub felt: Outboard,
    /// `T`.
    turn: Matrix6<f64>,
    /// `Z`.
    Z: Matrix6<f64>,
    /// `F' Phi'`.
    coupling: Matrix6<f64>,
    /// `Phi r`, then `Phi eta_ddot`.
    e: Vector6<f64>,
    /// Acceleration of O+, inertial axes.
    pub acceleration: [f64; 6],
}

/// One flexible body.
#[derive(Debug, Clone)]
pub struct FlexibleLink {
    body: usize,
    /// Index of its constants.
    pub shape: usize,
    /// B axes to link axes.
    frame: Matrix3<f64>,
    /// O in B (m).
    origin: Vector3<f64>,
    /// B axes to inertial axes.
    rotation: Matrix3<f64>,
    /// Angular velocity, B axes.
    pub omega: Vector3<f64>,
    /// Acceleration of B, B axes.
    pub alpha: Vector6<f64>,
    /// Bias acceleration of B seen from O, B axes.
    bias: Vector6<f64>,
    /// Velocity of the origin of B, B axes, for systems with loads.
    velocity: Vector3<f64>,
    pub tips: Vec<Tip>,
    position: Vec<[f64; 4]>,
    rate: Vec<[f64; 4]>,
    /// `r` of the modes.
    r: Vec<[f64; 4]>,
    /// Forces of external loads on the modes, for systems with loads.
    external: Vec<f64>,
    loaded: bool,
    external_force: Vector6<f64>,
    shape_at_load: Vec<Vector6<f64>>,
    /// Rigid rows of b.
    b: Vector6<f64>,
    /// `S~` of all tips, `N`, and room to find it.
    inertia: Vec<f64>,
    N: Vec<f64>,
    work: Vec<f64>,
    /// For inertia of order 1 and 2: at the present deformation.
    deformed: Option<Box<Deformed>>,
}

/// What the deformation changes.
#[derive(Debug, Clone)]
struct Deformed {
    inertia: FlexibleInertia,
    rows: Vec<Block<6>>,
    residual: Matrix6<f64>,
    b_modal: Vec<f64>,
}

impl FlexibleLink {
    /// Of body `body` with the constants `shape` (number `index`), whose link axes are `turn` in O axes.
    pub fn new(system: &System, body: usize, flexible: &FlexibleBody, children: &[usize], shape: &ModalShape, index: usize, turn: &Matrix3<f64>) -> Self {
        let (n, blocks, size) = (shape.modes, block_count(shape.modes), 6 * children.len());
        let loaded = system.loads.iter().any(|l| l.body == body);
        let tip = |&child: &usize| Tip {
            child,
            frame: FramePose::default(),
            motion: [0.0; 12],
            velocity: Vector3::zeros(),
            bias: Vector6::zeros(),
            rate: Vector6::zeros(),
            felt: [0.0; RECORD],
            turn: Matrix6::identity(),
            Z: Matrix6::zeros(),
            coupling: Matrix6::zeros(),
            e: Vector6::zeros(),
            acceleration: [0.0; 6],
        };
        let deformed = || Deformed {
            inertia: FlexibleInertia::new(n),
            rows: shape.rows.clone(),
            residual: Matrix6::zeros(),
            b_modal: vec![0.0; n],
        };
        Self {
            body,
            shape: index,
            frame: turn.transpose() * flexible.inboard.rotation.transpose(),
            origin: flexible.inboard.position,
            rotation: Matrix3::identity(),
            omega: Vector3::zeros(),
            alpha: Vector6::zeros(),
            bias: Vector6::zeros(),
            velocity: Vector3::zeros(),
            tips: children.iter().map(tip).collect(),
            position: vec![[0.0; 4]; blocks],
            rate: vec![[0.0; 4]; blocks],
            r: vec![[0.0; 4]; blocks],
            external: vec![0.0; if loaded { n } else { 0 }],
            loaded,
            external_force: Vector6::zeros(),
            shape_at_load: vec![Vector6::zeros(); if loaded { n } else { 0 }],
            b: Vector6::zeros(),
            inertia: vec![0.0; size * size],
            N: vec![0.0; size * size],
            work: vec![0.0; 2 * size * size],
            deformed: (shape.order != InertiaOrder::Zeroth).then(|| Box::new(deformed())),
        }
    }

    /// First pass: frame B, the forces that the rates ask of the modes, and the frames of the moved children.
    #[inline(always)]
    pub fn follow<L: Lanes>(&mut self, s: L, system: &System, state: &State, shape: &ModalShape, motion: &Motion) {
        let body = &system.bodies[self.body];
        let Some(flexible) = body.flexible() else { return };
        let range = body.modal_range();
        let (eta, eta_dot) = (&state.modal_position[range.clone()], &state.modal_velocity[range]);
        self.rotation = Matrix3::from_column_slice(&motion[..9]) * self.frame;
        self.omega = self.rotation.tr_mul(&Vector3::new(motion[9], motion[10], motion[11]));
        let omega = self.omega;
        self.bias = spatial(&Vector3::zeros(), &-omega.cross(&omega.cross(&self.origin)));
        fill(eta, &mut self.position);
        fill(eta_dot, &mut self.rate);
        if let Some(now) = &mut self.deformed {
            now.inertia.evaluate(&flexible.integrals, flexible.order, eta);
            self.b = now.inertia.velocity_terms(&flexible.integrals, flexible.order, &omega, eta_dot, &mut now.b_modal);
            fill(&now.b_modal, &mut self.r);
            self.r.iter_mut().flatten().for_each(|r| *r = -*r);
        } else {
            self.velocity_terms(s, shape);
        }
        self.take_elastic(s, shape, flexible, eta, eta_dot);
        for (tip, rows) in self.tips.iter_mut().zip(&shape.interfaces) {
            let [displacement, rate] = two_products(s, rows, &self.position, &self.rate);
            tip.follow(&system.bodies[tip.child].parent_side, displacement, rate, &self.rotation, &omega);
        }
    }

    /// Gyroscopic forces of the undeformed body (DESIGN 3.1, order 0): rigid rows, and the modal ones into `r`.
    #[inline(always)]
    fn velocity_terms<L: Lanes>(&mut self, s: L, shape: &ModalShape) {
        let w = &self.omega;
        let square = w.norm_squared();
        let mut factors = [s.splat(0.0); 9];
        for a in 0..3 {
            for b in 0..3 {
                factors[3 * a + b] = s.splat(w[a] * w[b] - if a == b { square } else { 0.0 });
            }
        }
        let mut sums = [s.splat(0.0); 12];
        for ((block, rate), r) in shape.integrals.iter().zip(&self.rate).zip(&mut self.r) {
            let rate = s.load(*rate);
            let mut felt = s.splat(0.0);
            for i in 0..12 {
                let row = s.load(block[i]);
                sums[i] = s.mul_add(row, rate, sums[i]);
                if i < 9 {
                    felt = s.mul_take(row, factors[i], felt);
                }
            }
            *r = s.store(felt);
        }
        let mut D = Matrix3::zeros();
        let mut momentum = Vector3::zeros();
        for a in 0..3 {
            for b in 0..3 {
                D[(a, b)] = sum_of(s, sums[3 * a + b]);
            }
            momentum[a] = sum_of(s, sums[9 + a]);
        }
        let first_moment = shape.rigid.first_moment();
        let moment = w.cross(&(shape.rigid.rotational * w)) + (w * D.trace() - D * w) * 2.0;
        let force = w.cross(&w.cross(&first_moment)) + w.cross(&momentum) * 2.0;
        self.b = spatial(&moment, &force);
    }

    /// `r <- r - K eta - C eta_dot`.
    #[inline(always)]
    fn take_elastic<L: Lanes>(&mut self, s: L, shape: &ModalShape, flexible: &FlexibleBody, eta: &[f64], eta_dot: &[f64]) {
        if flexible.full_stiffness.is_some() {
            for (j, r) in self.r.iter_mut().flatten().enumerate().take(eta.len()) {
                *r -= flexible.elastic_force_on(j, eta, eta_dot);
            }
            return;
        }
        let coordinates = self.position.iter().zip(&self.rate);
        for ((r, (x, v)), (k, c)) in self.r.iter_mut().zip(coordinates).zip(shape.stiffness.iter().zip(&shape.damping)) {
            let left = s.mul_take(s.load(*k), s.load(*x), s.load(*r));
            *r = s.store(s.mul_take(s.load(*c), s.load(*v), left));
        }
    }

    /// External loads: their force on B (B axes) and on the modes.
    pub fn gather_loads(&mut self, system: &System, state: &State) {
        let body = &system.bodies[self.body];
        if !self.loaded {
            return;
        }
        self.external_force = Vector6::zeros();
        self.external.fill(0.0);
        let eta = &state.modal_position[body.modal_range()];
        let first = system.loads.partition_point(|l| l.body < self.body);
        for load in system.loads[first..].iter().take_while(|l| l.body == self.body) {
            let value = load.value(state.time);
            let value = match load.axes {
                LoadAxes::World => rotate_back(&self.rotation, &value),
                LoadAxes::Body => rotate(&body.frame_rotation, &value),
            };
            let point = load_shape(load, eta, &mut self.shape_at_load);
            self.external_force += force_from(&point, &value);
            for (x, shape) in self.external.iter_mut().zip(&self.shape_at_load) {
                *x += shape.dot(&value);
            }
        }
        for (r, x) in self.r.iter_mut().flatten().zip(&self.external) {
            *r += x;
        }
    }

    /// Second pass: inertia and residual force of the body with its modes, at O in inertial axes.
    #[inline(always)]
    pub fn filter<L: Lanes>(&mut self, s: L, shape: &ModalShape) -> Result<(SpatialInertia, Vector6<f64>), Doubtful> {
        let size = 6 * self.tips.len();
        let mut z = self.b - self.external_force;
        for (c, (tip, rows)) in self.tips.iter_mut().zip(&shape.interfaces).enumerate() {
            let (S, felt) = tip.gather(&self.rotation);
            z += force_from(&tip.frame.position, &felt);
            take_transposed(s, rows, &tip.turn.tr_mul(&felt), &mut self.r);
            let turned = times(s, &tip.turn.transpose(), &times(s, &S, &tip.turn));
            for i in 0..6 {
                for j in 0..6 {
                    self.inertia[(6 * c + i) * size + 6 * c + j] = turned[(i, j)];
                }
            }
        }
        let (rows, residual) = match &mut self.deformed {
            None => (&shape.rows, &shape.residual),
            Some(now) => {
                let of = &now.inertia;
                for (b, block) in now.rows.iter_mut().enumerate() {
                    for (i, row) in of.row.iter().skip(4 * b).take(4).enumerate() {
                        for c in 0..6 {
                            block[c][i] = row[c];
                        }
                    }
                }
                now.residual = of.rigid.matrix() - gram(s, &now.rows, &now.rows);
                (&now.rows, &now.residual)
            }
        };
        for (c, (tip, phi)) in self.tips.iter_mut().zip(&shape.interfaces).enumerate() {
            tip.e = product(s, phi, &self.r);
            tip.coupling = if shape.order == InertiaOrder::Zeroth { shape.coupling[c] } else { gram(s, rows, phi) };
            tip.Z = tip.reach().ok_or(Doubtful)? - tip.coupling;
        }
        let solved = match size {
            0 => true,
            6 => inverse_sum(6, &self.inertia, &shape.flexibility, &mut self.work, &mut self.N),
            _ => inverse_sum(size, &self.inertia, &shape.flexibility, &mut self.work, &mut self.N),
        };
        if !solved {
            return Err(Doubtful);
        }
        let mut P = *residual;
        z += product(s, rows, &self.r);
        for a in 0..self.tips.len() {
            for b in 0..self.tips.len() {
                let N = Matrix6::from_fn(|i, j| self.N[(6 * a + i) * size + 6 * b + j]);
                P += times_transposed(s, &times(s, &self.tips[a].Z, &N), &self.tips[b].Z);
                z += self.tips[a].Z * (N * self.tips[b].e);
            }
        }
        // from B to O, which lies at `origin`
        let P = SpatialInertia::from_matrix(&P);
        let back = -self.origin;
        let z = force_from(&back, &(z + P.times(&self.bias)));
        Ok((P.moved_by(&back).rotated(&self.rotation), rotate(&self.rotation, &z)))
    }

    /// Third pass: accelerations of the modes into `modal`, and those of the moved children's frames; `outer` is the acceleration at O,
    /// inertial axes.
    #[inline(always)]
    pub fn accelerate<L: Lanes>(&mut self, s: L, shape: &ModalShape, outer: &Vector6<f64>, modal: &mut [f64]) {
        let size = 6 * self.tips.len();
        self.alpha = motion_to(&-self.origin, &rotate_back(&self.rotation, outer)) + self.bias;
        let rows = self.deformed.as_ref().map_or(&shape.rows, |now| &now.rows);
        take_transposed(s, rows, &self.alpha, &mut self.r);
        // Phi eta_ddot = e - F' Phi' alpha - Phi Phi' y, y = N (e + Z' alpha)
        for a in 0..self.tips.len() {
            let mut y = Vector6::zeros();
            for (b, tip) in self.tips.iter().enumerate() {
                let driven = tip.e + tip.Z.tr_mul(&self.alpha);
                for i in 0..6 {
                    for j in 0..6 {
                        y[i] += self.N[(6 * a + i) * size + 6 * b + j] * driven[j];
                    }
                }
            }
            take_transposed(s, &shape.interfaces[a], &y, &mut self.r);
            self.work[6 * a..6 * a + 6].copy_from_slice(y.as_slice());
        }
        spill(&self.r, modal);
        for (a, tip) in self.tips.iter_mut().enumerate() {
            let mut moved = tip.e - tip.coupling.tr_mul(&self.alpha);
            for i in 0..6 {
                for j in 0..size {
                    moved[i] -= shape.flexibility[(6 * a + i) * size + j] * self.work[j];
                }
            }
            let alpha = motion_to(&tip.frame.position, &self.alpha) + tip.turn * moved + tip.bias;
            let alpha = rotate(&self.rotation, &alpha);
            tip.acceleration.copy_from_slice(alpha.as_slice());
        }
    }

    /// Velocities of B and of the moved children's frames from that of O, inertial axes (m/s).
    pub fn follow_velocity(&mut self, at_origin: &Vector3<f64>) {
        self.velocity = self.rotation.tr_mul(at_origin) - self.omega.cross(&self.origin);
        for tip in &mut self.tips {
            let own = linear(&(tip.turn * tip.rate));
            tip.velocity = self.rotation * (self.velocity + self.omega.cross(&tip.frame.position) + own);
        }
    }

    /// Power (W) of modal damping and external loads.
    pub fn power(&self, system: &System, state: &State) -> f64 {
        let body = &system.bodies[self.body];
        let rates = &state.modal_velocity[body.modal_range()];
        let damping = body.flexible().map_or(0.0, |f| f.damping.iter().zip(rates).map(|(c, e)| c * e * e).sum());
        let modal: f64 = self.external.iter().zip(rates).map(|(f, e)| f * e).sum();
        modal + self.external_force.dot(&spatial(&self.omega, &self.velocity)) - damping
    }

    /// Trace of the body's rotational inertia about B at the present deformation (kg m^2), where the deformation changes it.
    pub fn inertia_trace(&self) -> Option<f64> {
        self.deformed.as_ref().map(|now| now.inertia.inertia.trace())
    }
}

impl Tip {
    /// Pose, rates and bias of the frame on a body at `rotation` that turns with `omega` (B axes).
    #[inline(always)]
    fn follow(
        &mut self,
        side: &crate::model::Attachment,
        displacement: Vector6<f64>,
        rate: Vector6<f64>,
        rotation: &Matrix3<f64>,
        omega: &Vector3<f64>,
    ) {
        self.frame = FramePose::displaced(side, &displacement);
        self.rate = rate;
        let jacobian = self.frame.jacobian();
        let lever = self.frame.position - self.frame.interface();
        self.turn = Matrix6::identity();
        self.turn.fixed_view_mut::<3, 3>(0, 0).copy_from(&jacobian);
        self.turn.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-skew(&lever) * jacobian));
        self.bias = self.frame.bias_of(&rate, &self.frame.position, omega);
        let axes = rotation * self.frame.rotation;
        let spin = rotation * (omega + jacobian * angular(&rate));
        self.motion[..9].copy_from_slice(axes.as_slice());
        self.motion[9..].copy_from_slice(spin.as_slice());
    }

    /// `S` and the force felt at O+ in B axes, its bias included.
    #[inline(always)]
    fn gather(&self, rotation: &Matrix3<f64>) -> (Matrix6<f64>, Vector6<f64>) {
        let (inertia, force) = super::inward::plain(&self.felt);
        let inertia = inertia.rotated(&rotation.transpose());
        let felt = rotate_back(rotation, &force) + inertia.times(&self.bias);
        (inertia.matrix(), felt)
    }

    /// `X = (T^-1 phi*)'`, unless the interface has turned to where its rotation vector is singular.
    #[inline(always)]
    fn reach(&self) -> Option<Matrix6<f64>> {
        let jacobian = self.turn.fixed_view::<3, 3>(0, 0).into_owned();
        let mut reach = Matrix6::identity();
        reach.fixed_view_mut::<3, 3>(0, 0).copy_from(&jacobian.try_inverse()?.transpose());
        // -interface~ transposed
        reach.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew(&self.frame.interface()));
        Some(reach)
    }
}
