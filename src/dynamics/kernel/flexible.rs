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

use super::inward::Felt;
use super::modal_shape::{ModalShape, leave_residual};
use super::rows::{Block, block_count, fill, gram, product, spill, take_transposed};
use super::six::{Six, inverse_sum, inverse_sum_of_blocks};
use super::tip::{Tip, columns_of, rows_of};
use super::{Doubtful, Motion};
use crate::dynamics::flexible_inertia::FlexibleInertia;
use crate::dynamics::sweep::force_inward::load_shape;
use crate::model::{FlexibleBody, InertiaOrder, LoadAxes, State, System};
use crate::spatial::SpatialInertia;
use crate::spatial::lanes::Lanes;
use crate::spatial::shift::{force_from, rotate, rotate_back, spatial};
use nalgebra::{Matrix3, Vector3, Vector6};

/// One flexible body.
#[derive(Debug, Clone)]
pub struct FlexibleLink {
    body: usize,
    /// Index of its constants.
    pub shape: usize,
    /// B axes to link axes.
    frame: Matrix3<f64>,
    /// O in B (m), and whether it lies elsewhere than B.
    pub origin: Vector3<f64>,
    pub is_offset: bool,
    /// B axes to inertial axes.
    pub rotation: Matrix3<f64>,
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
    /// `S~` of all tips.
    pub inertia: Vec<Six>,
    /// `N` of all pairs of tips, row by row.
    pub N: Vec<Six>,
    /// `y` of all tips.
    pub y: Vec<[[f64; 4]; 2]>,
    /// Room to find N of several tips.
    pub work: Vec<f64>,
    /// For inertia of order 1 and 2: at the present deformation.
    deformed: Option<Box<Deformed>>,
}

/// What the deformation changes.
#[derive(Debug, Clone)]
struct Deformed {
    inertia: FlexibleInertia,
    rows: Vec<Block<6>>,
    residual: Six,
    b_modal: Vec<f64>,
}

impl FlexibleLink {
    /// Of body `body` with the constants `shape` (number `index`), whose link axes are `turn` in O axes.
    pub fn new(
        system: &System,
        body: usize,
        flexible: &FlexibleBody,
        children: &[usize],
        shape: &ModalShape,
        index: usize,
        turn: &Matrix3<f64>,
    ) -> Self {
        let (n, blocks, tips) = (shape.modes, block_count(shape.modes), children.len());
        let loaded = !system.loads_of(body).is_empty();
        let deformed =
            || Deformed { inertia: FlexibleInertia::new(n), rows: shape.rows.clone(), residual: Six::ZERO, b_modal: vec![0.0; n] };
        Self {
            body,
            shape: index,
            frame: turn.transpose() * flexible.inboard.rotation.transpose(),
            origin: flexible.inboard.position,
            is_offset: flexible.inboard.position != Vector3::zeros(),
            rotation: Matrix3::identity(),
            omega: Vector3::zeros(),
            alpha: Vector6::zeros(),
            bias: Vector6::zeros(),
            velocity: Vector3::zeros(),
            tips: children.iter().map(|&child| Tip::new(child)).collect(),
            position: vec![[0.0; 4]; blocks],
            rate: vec![[0.0; 4]; blocks],
            r: vec![[0.0; 4]; blocks],
            external: vec![0.0; if loaded { n } else { 0 }],
            loaded,
            external_force: Vector6::zeros(),
            shape_at_load: vec![Vector6::zeros(); if loaded { n } else { 0 }],
            b: Vector6::zeros(),
            inertia: vec![Six::ZERO; tips],
            N: vec![Six::ZERO; tips * tips],
            y: vec![[[0.0; 4]; 2]; tips],
            work: vec![0.0; if tips > 1 { 72 * tips * tips } else { 0 }],
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
        self.rotation = motion.rotation() * self.frame;
        self.omega = self.rotation.tr_mul(&motion.angular_velocity());
        let omega = self.omega;
        self.bias = spatial(&Vector3::zeros(), &-omega.cross(&omega.cross(&self.origin)));
        fill(eta, &mut self.position);
        fill(eta_dot, &mut self.rate);
        if let Some(now) = &mut self.deformed {
            now.inertia.evaluate(&flexible.integrals, flexible.order, eta, eta_dot);
            self.b = now.inertia.velocity_terms(&flexible.integrals, flexible.order, &omega, eta_dot, &mut now.b_modal);
            fill(&now.b_modal, &mut self.r);
            self.r.iter_mut().flatten().for_each(|r| *r = -*r);
        } else {
            self.velocity_terms(s, shape);
        }
        self.take_elastic(s, shape, flexible, eta, eta_dot);
        for (tip, rows) in self.tips.iter_mut().zip(&shape.interfaces) {
            let side = &system.bodies[tip.child].parent_side;
            tip.follow(s, side, rows, [&self.position, &self.rate], &self.rotation, &omega);
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
        let sums = [
            s.store(s.sums_of_four([sums[0], sums[1], sums[2], sums[3]])),
            s.store(s.sums_of_four([sums[4], sums[5], sums[6], sums[7]])),
            s.store(s.sums_of_four([sums[8], sums[9], sums[10], sums[11]])),
        ];
        let D = Matrix3::from_row_slice(&sums.as_flattened()[..9]);
        let momentum = Vector3::from_column_slice(&sums.as_flattened()[9..]);
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
        for load in system.loads_of(self.body) {
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
    pub fn filter<L: Lanes>(&mut self, s: L, shape: &ModalShape) -> Result<Felt<L::V>, Doubtful> {
        let own = self.b - self.external_force;
        let mut z = [s.of_three([own[0], own[1], own[2]]), s.of_three([own[3], own[4], own[5]])];
        for ((tip, rows), inertia) in self.tips.iter().zip(&shape.interfaces).zip(&mut self.inertia) {
            let (S, felt) = tip.gather(s, &self.rotation);
            z = [s.add(s.add(z[0], felt[0]), s.cross(s.of_three(tip.position.into()), felt[1])), s.add(z[1], felt[1])];
            take_transposed(s, rows, tip.turn_back(s, felt), &mut self.r);
            tip.turn_inertia(s, &S, inertia);
        }
        let (rows, residual) = match &mut self.deformed {
            None => (&shape.rows, &shape.residual),
            Some(now) => {
                now.gather_rows();
                leave_residual(s, &now.inertia.rigid, &now.rows, &mut now.residual);
                (&now.rows, &now.residual)
            }
        };
        let constant = shape.order == InertiaOrder::Zeroth;
        for (c, (tip, phi)) in self.tips.iter_mut().zip(&shape.interfaces).enumerate() {
            let e = product(s, phi, &self.r);
            tip.e = [s.store(e[0]), s.store(e[1])];
            let reached = if constant {
                tip.reach(s, &shape.coupling[c])
            } else {
                let mut coupling = Six::ZERO;
                gram(s, rows, phi, &mut coupling);
                tip.coupling = coupling;
                tip.reach(s, &coupling)
            };
            if !reached {
                return Err(Doubtful);
            }
        }
        match self.tips.len() {
            0 => {}
            1 => inverse_sum(s, &self.inertia[0], &shape.flexibility[0], &mut self.N[0]).ok_or(Doubtful)?,
            tips => inverse_sum_of_blocks(tips, &self.inertia, &shape.flexibility, &mut self.work, &mut self.N).ok_or(Doubtful)?,
        }
        let mut P = *residual;
        let felt = product(s, rows, &self.r);
        z = [s.add(z[0], felt[0]), s.add(z[1], felt[1])];
        for (a, left) in self.tips.iter().enumerate() {
            for (b, right) in self.tips.iter().enumerate() {
                let reach = left.Z.times(s, &self.N[a * self.tips.len() + b]);
                let felt = reach.combine(s, [right.e[0][0], right.e[0][1], right.e[0][2], right.e[1][0], right.e[1][1], right.e[1][2]]);
                z = [s.add(z[0], felt[0]), s.add(z[1], felt[1])];
                reach.add_times_transposed(s, &right.Z, &mut P);
            }
        }
        // the bias of B, to inertial axes, and from B to O, which lies at `origin`
        let b = &self.bias;
        let biased = P.combine(s, [0.0, 0.0, 0.0, b[3], b[4], b[5]]);
        let mut felt = Felt::turned(s, &P, [s.add(z[0], biased[0]), s.add(z[1], biased[1])], &self.rotation);
        if self.is_offset {
            felt.shift(s, s.combine(columns_of(s, &self.rotation), s.of_three((-self.origin).into())));
        }
        Ok(felt)
    }

    /// Third pass: accelerations of the modes into `modal`, and those of the moved children's frames; `outer` is the acceleration at O,
    /// inertial axes.
    #[inline(always)]
    pub fn accelerate<L: Lanes>(&mut self, s: L, shape: &ModalShape, outer: [L::V; 2], modal: &mut [f64]) {
        let back = rows_of(s, &self.rotation);
        let (turning, at_origin) = (s.combine(back, outer[0]), s.combine(back, outer[1]));
        let b = &self.bias;
        let arm = s.of_three((-self.origin).into());
        let alpha = [turning, s.add(s.add(at_origin, s.cross(turning, arm)), s.of_three([b[3], b[4], b[5]]))];
        let (a, l) = (s.three(alpha[0]), s.three(alpha[1]));
        self.alpha = Vector6::new(a[0], a[1], a[2], l[0], l[1], l[2]);
        let rows = self.deformed.as_ref().map_or(&shape.rows, |now| &now.rows);
        take_transposed(s, rows, alpha, &mut self.r);
        // Phi eta_ddot = e - F' Phi' alpha - Phi Phi' y, y = N (e + Z' alpha)
        let tips = self.tips.len();
        for a in 0..tips {
            let mut y = [s.splat(0.0); 2];
            for (b, tip) in self.tips.iter().enumerate() {
                let (e, reached) = (tip.e, tip.Z.apply_transposed(s, alpha));
                let driven = [s.add(s.load(e[0]), reached[0]), s.add(s.load(e[1]), reached[1])];
                let part = self.N[a * tips + b].apply(s, driven);
                y = [s.add(y[0], part[0]), s.add(y[1], part[1])];
            }
            take_transposed(s, &shape.interfaces[a], y, &mut self.r);
            self.y[a] = [s.store(y[0]), s.store(y[1])];
        }
        spill(&self.r, modal);
        let constant = shape.order == InertiaOrder::Zeroth;
        for (a, tip) in self.tips.iter_mut().enumerate() {
            let carried = if constant { &shape.coupling[a] } else { &tip.coupling }.apply_transposed(s, alpha);
            let mut moved = [s.sub(s.load(tip.e[0]), carried[0]), s.sub(s.load(tip.e[1]), carried[1])];
            for (b, y) in self.y.iter().enumerate() {
                let held = shape.flexibility[a * tips + b].combine(s, [y[0][0], y[0][1], y[0][2], y[1][0], y[1][1], y[1][2]]);
                moved = [s.sub(moved[0], held[0]), s.sub(moved[1], held[1])];
            }
            tip.accelerate(s, &self.rotation, alpha, moved);
        }
    }

    /// `M_fr` and `M_rr` at the deformation of the first pass.
    #[inline(always)]
    pub fn present<'a>(&'a mut self, shape: &'a ModalShape) -> (&'a [Block<6>], &'a SpatialInertia) {
        match &mut self.deformed {
            None => (&shape.rows, &shape.rigid),
            Some(now) => {
                now.gather_rows();
                (&now.rows, &now.inertia.rigid)
            }
        }
    }

    /// Velocities of B and of the moved children's frames from that of O, inertial axes (m/s).
    pub fn follow_velocity(&mut self, at_origin: &Vector3<f64>) {
        self.velocity = self.rotation.tr_mul(at_origin) - self.omega.cross(&self.origin);
        for tip in &mut self.tips {
            tip.follow_velocity(&self.rotation, &self.omega, &self.velocity);
        }
    }

    /// Power (W) of modal damping and external loads.
    pub fn power(&self, system: &System, state: &State, shape: &ModalShape) -> f64 {
        let body = &system.bodies[self.body];
        let rates = &state.modal_velocity[body.modal_range()];
        let mut damped = [0.0; 4];
        for (c, e) in shape.damping.iter().zip(&self.rate) {
            for i in 0..4 {
                damped[i] += c[i] * e[i] * e[i];
            }
        }
        let damping: f64 = damped.iter().sum();
        let modal: f64 = self.external.iter().zip(rates).map(|(f, e)| f * e).sum();
        modal + self.external_force.dot(&spatial(&self.omega, &self.velocity)) - damping
    }

    /// Trace of the body's rotational inertia about B at the present deformation (kg m^2), where the deformation changes it.
    pub fn inertia_trace(&self) -> Option<f64> {
        self.deformed.as_ref().map(|now| now.inertia.inertia.trace())
    }
}

impl Deformed {
    /// The rows of `M_fr` into their blocks.
    #[inline(always)]
    fn gather_rows(&mut self) {
        for (block, rows) in self.rows.iter_mut().zip(self.inertia.row.chunks(4)) {
            for (i, row) in rows.iter().enumerate() {
                for c in 0..6 {
                    block[c][i] = row[c];
                }
            }
        }
    }
}
