//! Explicit Runge-Kutta steps with dense output, fixed or error-controlled.

use super::Stepper;
use super::chart::Chart;
use super::step_control::{Tolerance, error_norm};
use super::tableau::Tableau;
use crate::dynamics::DynamicsError;
use crate::model::State;

/// An explicit method at work.
#[derive(Debug)]
pub struct RungeKutta {
    tableau: Tableau,
    tolerance: Option<Tolerance>,
    h: f64,
    y0: Vec<f64>,
    y1: Vec<f64>,
    y: Vec<f64>,
    error: Vec<f64>,
    /// Rates at the stages, then at the step's end.
    k: Vec<Vec<f64>>,
    end: State,
}

impl RungeKutta {
    /// A method for the chart's system; with a tolerance, the tableau's error estimate is used.
    #[must_use]
    pub fn new(tableau: Tableau, tolerance: Option<Tolerance>, chart: &Chart<'_>) -> Self {
        let n = chart.len();
        Self {
            tableau,
            tolerance,
            h: 0.0,
            y0: vec![0.0; n],
            y1: vec![0.0; n],
            y: vec![0.0; n],
            error: vec![0.0; n],
            k: vec![vec![0.0; n]; tableau.b.len() + 1],
            end: chart.base.clone(),
        }
    }

    /// y at the fraction `theta` of the step, entry by entry.
    fn dense(&self, theta: f64, i: usize) -> f64 {
        let last = self.k.len() - 1;
        let quintic = self.tableau.dense.iter().zip(&self.k).map(|(d, k)| d * k[i]).sum::<f64>() * self.h;
        hermite(theta, self.h, [self.y0[i], self.y1[i]], [self.k[0][i], self.k[last][i]], quintic)
    }
}

/// Cubic Hermite interpolant of the values `y` and rates `f` at both ends of a step of `h`, at its fraction `theta`, and a method's own
/// `quintic` term, which vanishes with its slope at both ends.
pub(super) fn hermite(theta: f64, h: f64, y: [f64; 2], f: [f64; 2], quintic: f64) -> f64 {
    let rest = 1.0 - theta;
    let change = y[1] - y[0];
    let begin = h * f[0] - change;
    let close = change - h * f[1] - begin;
    y[0] + theta * (change + rest * (begin + theta * (close + rest * quintic)))
}

/// `out = y0 + h sum_j weights_j k_j`.
pub(super) fn combine(y0: &[f64], h: f64, weights: &[f64], k: &[Vec<f64>], out: &mut [f64]) {
    out.copy_from_slice(y0);
    for (w, k) in weights.iter().zip(k) {
        if *w != 0.0 {
            out.iter_mut().zip(k).for_each(|(o, k)| *o += h * w * k);
        }
    }
}

impl Stepper for RungeKutta {
    fn name(&self) -> &'static str {
        self.tableau.name
    }

    fn restart(&mut self, chart: &mut Chart<'_>) -> Result<(), DynamicsError> {
        chart.base_vector(&mut self.y0);
        chart.rate(chart.base.time, &self.y0, &mut self.k[0])
    }

    fn attempt(&mut self, chart: &mut Chart<'_>, h: f64) -> Result<Option<f64>, DynamicsError> {
        self.h = h;
        let start = chart.base.time;
        let stages = self.tableau.b.len();
        chart.base_vector(&mut self.y0);
        for i in 1..stages {
            combine(&self.y0, h, self.tableau.a[i], &self.k, &mut self.y);
            chart.rate(start + self.tableau.c[i] * h, &self.y, &mut self.k[i])?;
        }
        combine(&self.y0, h, self.tableau.b, &self.k, &mut self.y1);
        chart.rate(start + h, &self.y1, &mut self.k[stages])?;
        let Some(tolerance) = &self.tolerance else {
            return Ok(None);
        };
        self.error.fill(0.0);
        for (w, k) in self.tableau.error.iter().zip(&self.k) {
            self.error.iter_mut().zip(k).for_each(|(e, k)| *e += h * w * k);
        }
        chart.state_of(start + h, &self.y1, &mut self.end);
        Ok(Some(error_norm(chart.system, tolerance, &self.error, &chart.base, &self.end)))
    }

    fn interpolate(&self, chart: &Chart<'_>, theta: f64, out: &mut State) {
        let y: Vec<f64> = (0..self.y0.len()).map(|i| self.dense(theta, i)).collect();
        chart.state_of(chart.base.time + theta * self.h, &y, out);
    }

    fn interpolate_work(&self, theta: f64) -> f64 {
        self.dense(theta, self.y0.len() - 1)
    }

    fn embedded(&mut self, chart: &Chart<'_>, out: &mut State) -> bool {
        self.y.iter_mut().zip(self.y1.iter().zip(&self.error)).for_each(|(y, (y1, e))| *y = y1 - e);
        chart.state_of(chart.base.time + self.h, &self.y, out);
        self.tolerance.is_some()
    }

    fn accept(&mut self, chart: &mut Chart<'_>) {
        let last = self.k.len() - 1;
        chart.rebase(self.h, &self.y1, &mut self.k[last]);
        // the rate at the end of this step is the first rate of the next
        if let Some((last, rest)) = self.k.split_last_mut() {
            rest[0].copy_from_slice(last);
        }
    }

    fn controlled_order(&self) -> Option<u8> {
        self.tolerance.map(|_| self.tableau.order)
    }
}
