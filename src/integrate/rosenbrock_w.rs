//! Linearly implicit steps at the cost of explicit ones: a Rosenbrock W-method whose Jacobian holds what makes systems stiff, the
//! stiffness K and damping C of modes and hinges, and nothing else.
//!
//! With q increments, v rates, `q' = B v` and `v' = a`, take `A = [0, B; -M^-1 K, -M^-1 C]`, everything at the step's start. A stage
//! with `u = B v` and `a` evaluated at its point, `s = sum_{j<i} gamma_ij k_j` and `g = gamma` then reads
//!
//! ```text
//! k_q = u + h B (s_v + g k_v)
//! k_v = a - h M^-1 (K (s_q + g k_q) + C (s_v + g k_v))
//! ```
//!
//! (K acts on `B^-1 q`). Eliminating `k_q` and writing `k_v = a + x` leaves forces on single modes and hinges on the right, so that M
//! is never multiplied with anything:
//!
//! ```text
//! (M + h g C + h^2 g^2 K) x = -h K (B^-1 (s_q + g u) + h g (s_v + g a)) - h C (s_v + g a)
//! ```
//!
//! The matrix is that of the inertia sweep with `Lambda = 1 + h g c + (h g)^2 k` and the like on hinges; it is factored once per step, at
//! the step's start, since W-methods have their order only if all stages share one `A`. A stage costs one plain evaluation
//! and two passes over those factors ([`ImplicitMatrix`]); with its share of the step at most 2.2
//! evaluations, to which a test holds it. K of a full modal stiffness is its diagonal. Prescribed hinges have no rows, and df/dt no term.
//!
//! Closures: x must not open them, so that `G x = 0` with G at the step's start. Embedded ones see to that themselves, since the sweeps
//! solve for independent coordinates; cut ones by multipliers on the same factored matrix. The Jacobian is then that of the closed system
//! but for the curvature of the closures.
//!
//! What is not resolved is damped: an undamped mode loses of its energy in one period, from |R| on the imaginary axis, 8e-8 at 1000
//! steps per period, 8e-5 at 100, 1e-3 at 40, 1e-2 at 20, 0.3 at 5.
//!
//! Sources: Rang and Angermann 2005 for the method; DESIGN 3.6 for its use here.

use super::Stepper;
use super::chart::Chart;
use super::runge_kutta::{combine, hermite};
use super::step_control::{Tolerance, error_norm};
use super::w_tableau::{STAGES, WTableau};
use crate::dynamics::DynamicsError;
use crate::dynamics::added_inertia::HingeBlock;
use crate::dynamics::implicit_matrix::ImplicitMatrix;
use crate::model::hinge::{MAX_RATES, quaternion_in};
use crate::model::{Body, HingeKind, State, System};
use crate::spatial::rotation::matrix_of_quaternion;
use nalgebra::{Matrix3, Vector3};

/// A W-method at work.
#[derive(Debug)]
pub struct RosenbrockW {
    tableau: WTableau,
    tolerance: Tolerance,
    h: f64,
    y0: Vec<f64>,
    y1: Vec<f64>,
    y: Vec<f64>,
    /// Rates of y at the step's start and end.
    f0: Vec<f64>,
    f1: Vec<f64>,
    /// Stages, then the error.
    k: Vec<Vec<f64>>,
    /// `sum_{j<i} gamma_ij k_j`.
    s: Vec<f64>,
    end: State,
    /// Diagonals of K and C, indexed like increments; K of springs about turns is in `turning`.
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    /// Hinges whose increments are not the integrals of their rates.
    turning: Vec<TurningHinge>,
    /// `M + h g C + h^2 g^2 K`.
    matrix: ImplicitMatrix,
}

/// A hinge with a quaternion.
#[derive(Debug)]
struct TurningHinge {
    body: usize,
    /// Rate of the travel of a free hinge, which is measured in O axes, to that of its increment, in O+ axes, at the step's start.
    travel: Option<Matrix3<f64>>,
    /// Stiffness of its springs on its rates at the step's start; none without springs.
    spring: Option<HingeBlock>,
}

impl RosenbrockW {
    /// A method for the chart's system.
    #[must_use]
    pub fn new(tableau: WTableau, tolerance: Tolerance, chart: &Chart<'_>) -> Self {
        let (n, system) = (chart.len(), chart.system);
        let zeros = || vec![0.0; n];
        let [stiffness, damping] = diagonals(system);
        let turns = |(body, b): (usize, &Body)| {
            (b.hinge.kind.has_quaternion() && !b.hinge.is_prescribed()).then_some(TurningHinge { body, travel: None, spring: None })
        };
        let turning: Vec<_> = system.bodies.iter().enumerate().filter_map(turns).collect();
        let mut matrix = ImplicitMatrix::new(system);
        matrix.added.blocks.reserve(turning.len());
        Self {
            tableau,
            tolerance,
            h: 0.0,
            y0: zeros(),
            y1: zeros(),
            y: zeros(),
            f0: zeros(),
            f1: zeros(),
            k: vec![zeros(); STAGES + 1],
            s: zeros(),
            end: chart.base.clone(),
            stiffness,
            damping,
            turning,
            matrix,
        }
    }

    /// What stays the same over all tries of a step from the chart's base.
    fn begin(&mut self, chart: &Chart<'_>) {
        for own in &mut self.turning {
            let body = &chart.system.bodies[own.body];
            let q = &chart.base.position[body.position_range()];
            own.spring = spring_stiffness(body, q);
            own.travel = matches!(body.hinge.kind, HingeKind::Free).then(|| matrix_of_quaternion(&quaternion_in(&q[3..7])));
        }
    }

    /// Factors `M + h g C + h^2 g^2 K`.
    fn factor(&mut self, chart: &Chart<'_>, h: f64) -> Result<(), DynamicsError> {
        let (hg, nv) = (h * self.tableau.gamma, chart.system.velocity_count);
        let added = &mut self.matrix.added;
        let rows = self.damping.iter().zip(&self.stiffness);
        for (l, (c, k)) in added.hinge.iter_mut().zip(rows.clone()) {
            *l = hg * c + hg * hg * k;
        }
        for (l, (c, k)) in added.modal.iter_mut().zip(rows.skip(nv)) {
            *l = 1.0 + hg * c + hg * hg * k;
        }
        added.blocks.clear();
        for own in &self.turning {
            let Some(mut block) = own.spring else { continue };
            block.iter_mut().flatten().for_each(|x| *x *= hg * hg);
            chart.system.bodies[own.body].velocity_range().enumerate().for_each(|(i, v)| block[i][i] += hg * self.damping[v]);
            added.blocks.push((own.body, block));
        }
        self.matrix.factor(chart.system, &chart.base)
    }

    /// Turns the rate of y that stands in stage `i` into its `k_i`.
    fn solve_stage(&mut self, chart: &Chart<'_>, i: usize) {
        let (h, g, n) = (self.h, self.tableau.gamma, chart.increments());
        let nv = chart.system.velocity_count;
        let (done, open) = self.k.split_at_mut(i);
        self.s.fill(0.0);
        for (w, k) in self.tableau.gamma_rows[i].iter().zip(done.iter()) {
            self.s.iter_mut().zip(k).for_each(|(s, k)| *s += w * k);
        }
        let (s_q, s_v) = self.s[..2 * n].split_at(n);
        let (k_q, k_v) = open[0][..2 * n].split_at_mut(n);
        let response = &mut self.matrix.response;
        for (forces, first) in [(&mut response.applied, 0), (&mut response.external_modal, nv)] {
            // slices of one length need no check of an index in the loop
            let rows = first..first + forces.len();
            let ([s_q, s_v], [k_q, k_v]) = ([&s_q[rows.clone()], &s_v[rows.clone()]], [&k_q[rows.clone()], &k_v[rows.clone()]]);
            let (stiffness, damping) = (&self.stiffness[rows.clone()], &self.damping[rows]);
            for j in 0..forces.len() {
                let rate = s_v[j] + g * k_v[j];
                let way = s_q[j] + g * k_q[j] + h * g * rate;
                forces[j] = -h * (stiffness[j] * way + damping[j] * rate);
            }
        }
        for own in &self.turning {
            let Some(spring) = &own.spring else { continue };
            let v = chart.system.bodies[own.body].velocity_range();
            let mut way = [0.0; MAX_RATES];
            v.clone().zip(&mut way).for_each(|(j, w)| *w = s_q[j] + g * k_q[j]);
            turn_travel(own.travel.map(|t| t.transpose()), &mut way);
            v.clone().zip(&mut way).for_each(|(j, w)| *w += h * g * (s_v[j] + g * k_v[j]));
            for (j, row) in v.zip(spring) {
                response.applied[j] -= h * row.iter().zip(&way).map(|(k, w)| k * w).sum::<f64>();
            }
        }
        self.matrix.solve(chart.system);
        let response = &self.matrix.response;
        k_v[..nv].iter_mut().zip(&response.hinge).for_each(|(k, x)| *k += x);
        k_v[nv..].iter_mut().zip(&response.modal).for_each(|(k, x)| *k += x);
        // rows of prescribed hinges are zero throughout
        for j in 0..n {
            k_q[j] += h * (s_v[j] + g * k_v[j]);
        }
        for own in self.turning.iter().filter(|own| own.travel.is_some()) {
            let v = chart.system.bodies[own.body].velocity_range();
            let mut way = [0.0; MAX_RATES];
            v.clone().zip(&mut way).for_each(|(j, w)| *w = h * (s_v[j] + g * k_v[j]));
            let straight = way;
            turn_travel(own.travel, &mut way);
            v.zip(way.iter().zip(&straight)).for_each(|(j, (w, s))| k_q[j] += w - s);
        }
    }

    /// y at the fraction `theta` of the step, entry by entry: the cubic Hermite interpolant.
    fn dense(&self, theta: f64, i: usize) -> f64 {
        hermite(theta, self.h, [self.y0[i], self.y1[i]], [self.f0[i], self.f1[i]], 0.0)
    }
}

/// Travel of a free hinge from its rates to its increments by `rotation`, or back.
fn turn_travel(rotation: Option<Matrix3<f64>>, x: &mut [f64; MAX_RATES]) {
    if let Some(rotation) = rotation {
        let turned = rotation * Vector3::new(x[3], x[4], x[5]);
        x[3..6].copy_from_slice(turned.as_slice());
    }
}

/// Diagonals of K and C, indexed like increments: zero for prescribed hinges, and K for hinges with a quaternion.
fn diagonals(system: &System) -> [Vec<f64>; 2] {
    let nv = system.velocity_count;
    let mut both = [vec![0.0; nv + system.modal_count], vec![0.0; nv + system.modal_count]];
    let [stiffness, damping] = &mut both;
    for body in &system.bodies {
        if !body.hinge.is_prescribed() {
            let springs = if body.hinge.kind.has_quaternion() { &[][..] } else { &body.hinge.stiffness };
            stiffness[body.velocity_range()].iter_mut().zip(springs).for_each(|(own, k)| *own = *k);
            damping[body.velocity_range()].iter_mut().zip(&body.hinge.damping).for_each(|(own, c)| *own = *c);
        }
        if let Some(flexible) = body.flexible() {
            let modes = nv + body.modal_range().start..nv + body.modal_range().end;
            stiffness[modes.clone()].copy_from_slice(&flexible.stiffness);
            damping[modes].copy_from_slice(&flexible.damping);
        }
    }
    both
}

/// Stiffness `T' diag(k) T` of a hinge's springs on its rates, `T` the rate of the displacement per rate: without the springs' own
/// force, which turns with a large rotation, so that it is positive semidefinite everywhere.
fn spring_stiffness(body: &Body, q: &[f64]) -> Option<HingeBlock> {
    let (hinge, m) = (&body.hinge, body.hinge.kind.rate_count());
    if hinge.stiffness.iter().all(|k| *k == 0.0) {
        return None;
    }
    let mut displacement = [0.0; MAX_RATES];
    hinge.kind.displacement(q, &mut displacement[..m]);
    let mut block = HingeBlock::default();
    for (c, k) in hinge.stiffness.iter().enumerate() {
        // force on the rates by a unit force on displacement c: row c of T
        let mut row = [0.0; MAX_RATES];
        row[c] = 1.0;
        hinge.kind.force_on_rates(q, &displacement[..m], &mut row[..m]);
        for i in 0..m {
            for j in 0..m {
                block[i][j] += k * row[i] * row[j];
            }
        }
    }
    Some(block)
}

impl Stepper for RosenbrockW {
    fn name(&self) -> &'static str {
        self.tableau.name
    }

    fn restart(&mut self, chart: &mut Chart<'_>) -> Result<(), DynamicsError> {
        chart.base_vector(&mut self.y0);
        self.begin(chart);
        chart.rate(chart.base.time, &self.y0, &mut self.f0)
    }

    fn attempt(&mut self, chart: &mut Chart<'_>, h: f64) -> Result<Option<f64>, DynamicsError> {
        self.h = h;
        let start = chart.base.time;
        chart.base_vector(&mut self.y0);
        self.factor(chart, h)?;
        for i in 0..STAGES {
            let (done, open) = self.k.split_at_mut(i);
            if i == 0 {
                open[0].copy_from_slice(&self.f0);
            } else {
                combine(&self.y0, h, self.tableau.alpha[i], done, &mut self.y);
                chart.rate(start + self.tableau.node(i) * h, &self.y, &mut open[0])?;
            }
            self.solve_stage(chart, i);
        }
        combine(&self.y0, h, &self.tableau.b, &self.k, &mut self.y1);
        chart.rate(start + h, &self.y1, &mut self.f1)?;
        let (stages, error) = self.k.split_at_mut(STAGES);
        error[0].fill(0.0);
        for (k, (b, e)) in stages.iter().zip(self.tableau.b.iter().zip(&self.tableau.embedded)) {
            error[0].iter_mut().zip(k).for_each(|(x, k)| *x += h * (b - e) * k);
        }
        chart.state_of(start + h, &self.y1, &mut self.end);
        Ok(Some(error_norm(chart.system, &self.tolerance, &error[0], &chart.base, &self.end)))
    }

    fn interpolate(&self, chart: &Chart<'_>, theta: f64, out: &mut State) {
        let y: Vec<f64> = (0..self.y0.len()).map(|i| self.dense(theta, i)).collect();
        chart.state_of(chart.base.time + theta * self.h, &y, out);
    }

    fn interpolate_work(&self, theta: f64) -> f64 {
        self.dense(theta, self.y0.len() - 1)
    }

    fn embedded(&mut self, chart: &Chart<'_>, out: &mut State) -> bool {
        let (n, nv) = (chart.increments(), chart.system.velocity_count);
        self.y.iter_mut().zip(self.y1.iter().zip(&self.k[STAGES])).for_each(|(y, (y1, e))| *y = y1 - e);
        // modes that the step does not resolve are damped in the solution that goes on, and must be in its error (Hairer and Wanner
        // 1996, IV.8: the estimate is filtered by the matrix of the stages)
        for (m, lambda) in self.matrix.added.modal.iter().enumerate() {
            for i in [nv + m, n + nv + m] {
                self.y[i] = self.y1[i] - self.k[STAGES][i] / lambda;
            }
        }
        chart.state_of(chart.base.time + self.h, &self.y, out);
        true
    }

    fn accept(&mut self, chart: &mut Chart<'_>) {
        // the rate at the end of this step is the first rate of the next
        chart.rebase(self.h, &self.y1, &mut self.f1);
        self.f0.copy_from_slice(&self.f1);
        self.begin(chart);
    }

    fn controlled_order(&self) -> Option<u8> {
        Some(self.tableau.order)
    }
}
