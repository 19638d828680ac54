//! Inertia `M_fl(eta)` and velocity terms `b_fl` of a flexible body from its modal integrals: nothing here depends on the mesh.
//!
//! With `x = r + sum_k eta_k phi_k` and `W_j,ab = int rho phi_ja x_b`:
//! `M_ff = 1`, `M_fv = p_j`, `M_fw row j = int rho x x phi_j` (antisymmetric part of W),
//! `m c(eta) = m c + sum p_j eta_j`, `J(eta)` from `int rho x x'`; and the node accelerations `omega x (omega x x) + 2 omega x u_dot`
//! integrated with 1, x and phi_j give b. Source: DESIGN of the project, section 3.1; checked against nodal sums in the tests.
//!
//! Geometric stiffness is the displacement `s = 1/2 eta' Gamma eta` that comes with a deformation (a bent beam grows shorter). The kinetic
//! energy gains `int rho D(r) . D(s)`, D the rate in inertial axes: the product of `s` with the motion of the undeformed body. Products of
//! `s` with the modes and with itself are dropped (higher powers of eta in every equation). What is kept is a Lagrangian, so energy is
//! conserved exactly:
//! `W_j,ab += int rho (Gamma_a eta)_j r_b`, `p_j += (int rho Gamma eta)_j`, `m c += 1/2 eta' int rho Gamma eta`, `J` from `r s' + s r'`;
//! virtual displacements `Gamma eta` of the modes meet the acceleration of the undeformed body only, which W holds already, and the
//! accelerations `Gamma(eta_dot, eta_dot) + 2 omega x s_dot + omega x (omega x s)` load the rigid rows only.
//! The energy is no longer a sum of squares: where modes carry nearly all inertia about a hinge (as they should), it stays positive only
//! up to deflections whose `1/2 eta' int rho r Gamma eta` is below what the modes leave over.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use crate::model::flexible_body::{InertiaOrder, ModalIntegrals, TENSOR};
use crate::model::mode_products::ProductSums;
use crate::spatial::SpatialInertia;
use crate::spatial::lanes::{Kernel, Lanes, Processor};
use crate::spatial::shift::{linear, spatial};
use nalgebra::{Matrix3, Vector3, Vector6};

/// Inertia of a flexible body at its present deformation.
#[derive(Debug, Clone)]
pub struct FlexibleInertia {
    /// Rigid rows: mass, `m c(eta)`, `J(eta)` about the body origin.
    pub rigid: SpatialInertia,
    /// `m c(eta)` (kg m).
    pub first_moment: Vector3<f64>,
    /// `J(eta)` (kg m^2).
    pub inertia: Matrix3<f64>,
    /// Rows j of M_fr: (angular; linear).
    pub row: Vec<Vector6<f64>>,
    /// Nine planes of n: `W_j,ab` at `(3 a + b) * n + j`.
    W: Vec<f64>,
    /// What the n^2 integrals make of the modal coordinates and rates.
    sums: ProductSums,
    processor: Processor,
}

impl FlexibleInertia {
    /// Room for n modes.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self {
            rigid: SpatialInertia::default(),
            first_moment: Vector3::zeros(),
            inertia: Matrix3::zeros(),
            row: vec![Vector6::zeros(); n],
            W: vec![0.0; TENSOR * n],
            sums: ProductSums::new(n),
            processor: Processor::detect(),
        }
    }

    /// Evaluates the inertia at the modal coordinates `eta`, and what [`Self::velocity_terms`] needs of the rates `eta_dot`.
    pub fn evaluate(&mut self, integrals: &ModalIntegrals, order: InertiaOrder, eta: &[f64], eta_dot: &[f64]) {
        self.processor.run(Evaluate { inertia: self, integrals, order, eta, eta_dot });
    }

    #[inline(always)]
    fn evaluate_with<L: Lanes>(&mut self, s: L, integrals: &ModalIntegrals, order: InertiaOrder, eta: &[f64], eta_dot: &[f64]) {
        let n = integrals.mode_count();
        self.W.copy_from_slice(&integrals.shape_position);
        if order >= InertiaOrder::First {
            self.sums.multiply(s, &integrals.products, eta, eta_dot);
            integrals.products.add_shapes(&self.sums, n, &mut self.W);
        }
        let mut first_moment = integrals.first_moment;
        let mut second_moment = integrals.second_moment;
        if order >= InertiaOrder::First {
            for (p, e) in integrals.momentum.iter().zip(eta) {
                first_moment += p * *e;
            }
            let undeformed = contract(&integrals.shape_position, eta).transpose();
            let other = if order == InertiaOrder::Second { contract(&self.W, eta) } else { undeformed.transpose() };
            second_moment += undeformed + other;
        }
        let second_order = if order >= InertiaOrder::First { integrals.second_order.as_slice() } else { &[] };
        for (row, p) in self.row.iter_mut().zip(&integrals.momentum) {
            *row = spatial(&Vector3::zeros(), p);
        }
        // the angular planes are in W
        for (c, plane) in second_order.chunks_exact((n * n).max(1)).enumerate().skip(3) {
            let mut shift = 0.0;
            for ((row, column), e) in self.row.iter_mut().zip(plane.chunks_exact(n)).zip(eta) {
                let of_mode = dot(column, eta);
                row[c] += of_mode;
                shift += 0.5 * of_mode * e;
            }
            if order == InertiaOrder::Second {
                first_moment[c - 3] += shift;
            }
        }
        self.first_moment = first_moment;
        self.inertia = Matrix3::from_diagonal_element(second_moment.trace()) - second_moment;
        self.inertia = (self.inertia + self.inertia.transpose()) * 0.5;
        self.rigid = SpatialInertia::rigid(integrals.mass, &self.first_moment, &self.inertia);
        let W = |a: usize, b: usize, j: usize| self.W[(3 * a + b) * n + j];
        for j in 0..n {
            let angular = Vector3::new(W(2, 1, j) - W(1, 2, j), W(0, 2, j) - W(2, 0, j), W(1, 0, j) - W(0, 1, j));
            let rotary = integrals.rotary.get(j).copied().unwrap_or_default();
            self.row[j].fixed_rows_mut::<3>(0).copy_from(&(angular + rotary));
        }
    }

    /// Velocity terms for angular velocity `omega` (body axes) and the modal rates that [`Self::evaluate`] had: returns the rigid rows of b,
    /// writes the modal rows.
    pub fn velocity_terms(
        &self,
        integrals: &ModalIntegrals,
        order: InertiaOrder,
        omega: &Vector3<f64>,
        eta_dot: &[f64],
        b_modal: &mut [f64],
    ) -> Vector6<f64> {
        self.processor.run(VelocityTerms { inertia: self, integrals, order, omega, eta_dot, b_modal })
    }

    #[inline(always)]
    fn velocity_terms_here(
        &self,
        integrals: &ModalIntegrals,
        order: InertiaOrder,
        omega: &Vector3<f64>,
        eta_dot: &[f64],
        b_modal: &mut [f64],
    ) -> Vector6<f64> {
        let n = integrals.mode_count();
        // D_ab = int rho u_dot_a x_b
        let D = contract(&self.W, eta_dot);
        let momentum: Vector3<f64> = self.row.iter().zip(eta_dot).map(|(r, e)| linear(r) * *e).sum();
        let moment = omega.cross(&(self.inertia * omega)) + (omega * D.trace() - D * omega) * 2.0;
        let force = omega.cross(&omega.cross(&self.first_moment)) + omega.cross(&momentum) * 2.0;
        // (omega omega' - omega^2) : W_j
        let square = omega.norm_squared();
        b_modal.fill(0.0);
        for a in 0..3 {
            for b in 0..3 {
                let factor = omega[a] * omega[b] - if a == b { square } else { 0.0 };
                let plane = &self.W[(3 * a + b) * n..][..n];
                add_scaled(factor, plane, b_modal);
            }
        }
        if order >= InertiaOrder::First {
            integrals.products.add_coriolis(&self.sums, (omega * 2.0).into(), b_modal);
        }
        let mut b = spatial(&moment, &force);
        if order >= InertiaOrder::First {
            // int rho (r x, 1) Gamma(eta_dot, eta_dot)
            for (b, plane) in b.iter_mut().zip(integrals.second_order.chunks_exact((n * n).max(1))) {
                *b += plane.chunks_exact(n).zip(eta_dot).map(|(column, e)| dot(column, eta_dot) * e).sum::<f64>();
            }
        }
        b
    }
}

/// [`FlexibleInertia::evaluate`] in the instructions of the processor.
struct Evaluate<'a> {
    inertia: &'a mut FlexibleInertia,
    integrals: &'a ModalIntegrals,
    order: InertiaOrder,
    eta: &'a [f64],
    eta_dot: &'a [f64],
}

impl Kernel for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        self.inertia.evaluate_with(lanes, self.integrals, self.order, self.eta, self.eta_dot);
    }
}

/// [`FlexibleInertia::velocity_terms`] in the instructions of the processor.
struct VelocityTerms<'a> {
    inertia: &'a FlexibleInertia,
    integrals: &'a ModalIntegrals,
    order: InertiaOrder,
    omega: &'a Vector3<f64>,
    eta_dot: &'a [f64],
    b_modal: &'a mut [f64],
}

impl Kernel for VelocityTerms<'_> {
    type Output = Vector6<f64>;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Vector6<f64> {
        self.inertia.velocity_terms_here(self.integrals, self.order, self.omega, self.eta_dot, self.b_modal)
    }
}

/// `out += factor x`.
#[inline(always)]
fn add_scaled(factor: f64, x: &[f64], out: &mut [f64]) {
    let ((x, x_rest), (out, out_rest)) = (x.as_chunks::<4>(), out.as_chunks_mut::<4>());
    for (out, x) in out.iter_mut().zip(x) {
        for i in 0..4 {
            out[i] += factor * x[i];
        }
    }
    for (out, x) in out_rest.iter_mut().zip(x_rest) {
        *out += factor * x;
    }
}

/// `a . b` by four sums that do not wait for each other.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for i in 0..4 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// The nine `planes . x`, n numbers each, by tensor component.
#[inline(always)]
fn contract(planes: &[f64], x: &[f64]) -> Matrix3<f64> {
    let n = x.len();
    let mut out = Matrix3::zeros();
    for a in 0..3 {
        for b in 0..3 {
            out[(a, b)] = dot(&planes[(3 * a + b) * n..][..n], x);
        }
    }
    out
}
