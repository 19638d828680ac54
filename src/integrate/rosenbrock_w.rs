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
//! The matrix is that of the inertia sweep with `Lambda = 1 + h g c + (h g)^2 k` and the like on hinges; it is swept once per step, at
//! the step's start, since W-methods have their order only if all stages share one `A`. A stage costs one plain evaluation
//! and two sweeps ([`Response`]). K of a full modal stiffness is its diagonal. Prescribed hinges have no rows, and df/dt no term.
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
use crate::dynamics::closed_chain::ClosedChain;
use crate::dynamics::sweep::inertia_inward::{AddedInertia, InertiaScratch, inertia_inward_with};
use crate::dynamics::sweep::pose_outward::{PoseScratch, pose_outward};
use crate::dynamics::sweep::response::Response;
use crate::model::hinge::MAX_RATES;
use crate::model::{Body, HingeKind, State};
use nalgebra::{Matrix3, Vector3};

/// A square block of one hinge's rates.
type Block = [[f64; MAX_RATES]; MAX_RATES];

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
    pose: PoseScratch,
    inertia: InertiaScratch,
    added: AddedInertia,
    /// Stiffness of the springs on the rates of each hinge at the step's start, none without springs.
    spring: Vec<Option<Block>>,
    /// Generalised forces of a stage, and what they cause.
    response: Response,
    all: Vec<usize>,
    /// Cut closures, held in every stage; none for a tree.
    closed: Option<Box<ClosedChain>>,
}

impl RosenbrockW {
    /// A method for the chart's system.
    #[must_use]
    pub fn new(tableau: WTableau, tolerance: Tolerance, chart: &Chart<'_>) -> Self {
        let (n, system) = (chart.len(), chart.system);
        let zeros = || vec![0.0; n];
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
            pose: PoseScratch::new(system),
            inertia: InertiaScratch::new(system),
            added: AddedInertia { modal: vec![1.0; system.modal_count], hinge: vec![None; system.bodies.len()] },
            spring: vec![None; system.bodies.len()],
            response: Response::new(system),
            all: (0..system.bodies.len()).collect(),
            closed: ClosedChain::new(system),
        }
    }

    /// What stays the same over all tries of a step from the chart's base.
    fn begin(&mut self, chart: &Chart<'_>) {
        pose_outward(chart.system, &chart.base, &mut self.pose);
        for (body, spring) in chart.system.bodies.iter().zip(&mut self.spring) {
            *spring = spring_stiffness(body, &chart.base.position[body.position_range()]);
        }
    }

    /// Factors `M + h g C + h^2 g^2 K`.
    fn factor(&mut self, chart: &Chart<'_>, h: f64) -> Result<(), DynamicsError> {
        let hg = h * self.tableau.gamma;
        for (k, body) in chart.system.bodies.iter().enumerate() {
            if let Some(flexible) = body.flexible() {
                let rows = flexible.damping.iter().zip(&flexible.stiffness);
                for (l, (c, k)) in self.added.modal[body.modal_range()].iter_mut().zip(rows) {
                    *l = 1.0 + hg * c + hg * hg * k;
                }
            }
            let damping = &body.hinge.damping;
            self.added.hinge[k] = if body.hinge.is_prescribed() || (damping.is_empty() && self.spring[k].is_none()) {
                None
            } else {
                let mut block = self.spring[k].unwrap_or_default();
                block.iter_mut().flatten().for_each(|x| *x *= hg * hg);
                damping.iter().enumerate().for_each(|(i, c)| block[i][i] += hg * c);
                Some(block)
            };
        }
        inertia_inward_with(chart.system, &self.pose, Some(&self.added), &mut self.inertia)?;
        self.closed.as_mut().map_or(Ok(()), |c| c.prepare(chart.system, &self.pose, &self.inertia))
    }

    /// Turns the rate of y that stands in stage `i` into its `k_i`.
    fn solve_stage(&mut self, chart: &Chart<'_>, i: usize) {
        let (system, h, g) = (chart.system, self.h, self.tableau.gamma);
        let (n, nv) = (chart.increments(), system.velocity_count);
        let (done, open) = self.k.split_at_mut(i);
        let k = &mut open[0];
        let s = &mut self.s;
        s.fill(0.0);
        for (w, k) in self.tableau.gamma_rows[i].iter().zip(done.iter()) {
            s.iter_mut().zip(k).for_each(|(s, k)| *s += w * k);
        }
        for (b, body) in system.bodies.iter().enumerate() {
            if let Some(flexible) = body.flexible() {
                for (j, m) in body.modal_range().enumerate() {
                    let rate = s[n + nv + m] + g * k[n + nv + m];
                    let way = s[nv + m] + g * k[nv + m] + h * g * rate;
                    self.response.external_modal[m] = -h * (flexible.stiffness[j] * way + flexible.damping[j] * rate);
                }
            }
            let v = body.velocity_range();
            let force = &mut self.response.applied[v.clone()];
            force.fill(0.0);
            if self.added.hinge[b].is_none() {
                continue;
            }
            let (mut way, mut rate) = ([0.0; MAX_RATES], [0.0; MAX_RATES]);
            for (i, r) in v.clone().enumerate() {
                way[i] = s[r] + g * k[r];
                rate[i] = s[n + r] + g * k[n + r];
            }
            turn_travel(body, &self.pose.bodies[b].hinge.rotation.transpose(), &mut way);
            way.iter_mut().zip(&rate).for_each(|(w, r)| *w += h * g * r);
            if let Some(spring) = &self.spring[b] {
                for (f, row) in force.iter_mut().zip(spring) {
                    *f -= h * row.iter().zip(&way).map(|(k, w)| k * w).sum::<f64>();
                }
            }
            for (f, (c, r)) in force.iter_mut().zip(body.hinge.damping.iter().zip(&rate)) {
                *f -= h * c * r;
            }
        }
        self.response.solve(system, &self.pose, &self.inertia, &self.all);
        if let Some(chain) = &mut self.closed {
            chain.hold(system, &self.pose, &self.inertia, &mut self.response);
        }
        k[n..n + nv].iter_mut().zip(&self.response.hinge).for_each(|(k, x)| *k += x);
        k[n + nv..2 * n].iter_mut().zip(&self.response.modal).for_each(|(k, x)| *k += x);
        for m in 0..n - nv {
            k[nv + m] += h * (s[n + nv + m] + g * k[n + nv + m]);
        }
        for (b, body) in system.bodies.iter().enumerate().filter(|(_, b)| !b.hinge.is_prescribed()) {
            let mut way = [0.0; MAX_RATES];
            for (i, r) in body.velocity_range().enumerate() {
                way[i] = h * (s[n + r] + g * k[n + r]);
            }
            turn_travel(body, &self.pose.bodies[b].hinge.rotation, &mut way);
            k[body.velocity_range()].iter_mut().zip(&way).for_each(|(k, w)| *k += w);
        }
    }

    /// y at the fraction `theta` of the step, entry by entry: the cubic Hermite interpolant.
    fn dense(&self, theta: f64, i: usize) -> f64 {
        hermite(theta, self.h, [self.y0[i], self.y1[i]], [self.f0[i], self.f1[i]], 0.0)
    }
}

/// Between rates and increments of a free hinge: its travel is measured in O axes as a rate, in O+ axes as an increment.
fn turn_travel(body: &Body, rotation: &Matrix3<f64>, x: &mut [f64; MAX_RATES]) {
    if matches!(body.hinge.kind, HingeKind::Free) {
        let turned = rotation * Vector3::new(x[3], x[4], x[5]);
        x[3..6].copy_from_slice(turned.as_slice());
    }
}

/// Stiffness `T' diag(k) T` of a hinge's springs on its rates, `T` the rate of the displacement per rate: without the springs' own
/// force, which turns with a large rotation, so that it is positive semidefinite everywhere.
fn spring_stiffness(body: &Body, q: &[f64]) -> Option<Block> {
    let (hinge, m) = (&body.hinge, body.hinge.kind.rate_count());
    if hinge.is_prescribed() || hinge.stiffness.iter().all(|k| *k == 0.0) {
        return None;
    }
    let mut displacement = [0.0; MAX_RATES];
    hinge.kind.displacement(q, &mut displacement[..m]);
    let mut block = Block::default();
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
        for (m, lambda) in self.added.modal.iter().enumerate() {
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
