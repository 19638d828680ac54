//! Tolerances, error norm and step size.

use crate::model::{State, System};

/// Relative and absolute tolerance of the local error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Relative to the largest entry of each block (a hinge's coordinates, its rates, a body's modal coordinates, their rates).
    pub relative: f64,
    /// In the coordinates' own units; for modes in those of the modal rates (m kg^(1/2) / s).
    pub absolute: f64,
}

/// Root mean square, over all coordinates, of the local error in units of the tolerance.
///
/// `error` is laid out like y of [`super::chart::Chart`]; a coordinate is weighed by the largest entry of its block at either end, a
/// rotation by one radian. Modal coordinates count by their energy: `omega_j eta_j` together with the modal rates, since a stiff
/// mode's load is `omega_j^2 eta_j` and an error that is small beside the slow modes' coordinates is not small in it.
#[must_use]
pub fn error_norm(system: &System, tolerance: &Tolerance, error: &[f64], start: &State, end: &State) -> f64 {
    let (nv, nm) = (system.velocity_count, system.modal_count);
    let n = nv + nm;
    let (mut sum, mut count) = (0.0, 0_usize);
    let size = |a: &[f64], b: &[f64]| a.iter().chain(b).fold(0.0_f64, |m, x| m.max(x.abs()));
    let scale_of = |size: f64| tolerance.absolute + tolerance.relative * size;
    let mut add = |ratios: &mut dyn Iterator<Item = f64>| {
        for ratio in ratios {
            sum += ratio * ratio;
            count += 1;
        }
    };
    for body in &system.bodies {
        let (q, v, m) = (body.position_range(), body.velocity_range(), body.modal_range());
        if !body.hinge.is_prescribed() && !v.is_empty() {
            let turn = if body.hinge.kind.has_quaternion() { 1.0 } else { 0.0 };
            let scale = scale_of(size(&start.position[q.clone()], &end.position[q]).max(turn));
            add(&mut error[v.clone()].iter().map(|e| e / scale));
            let scale = scale_of(size(&start.velocity[v.clone()], &end.velocity[v.clone()]));
            add(&mut error[n + v.start..n + v.end].iter().map(|e| e / scale));
        }
        if let Some(flexible) = body.flexible() {
            let omega = || flexible.stiffness.iter().map(|k| k.max(0.0).sqrt());
            let elastic = |eta: &[f64]| omega().zip(eta).fold(0.0_f64, |m, (w, e)| m.max((w * e).abs()));
            let rates = size(&start.modal_velocity[m.clone()], &end.modal_velocity[m.clone()]);
            let scale = scale_of(rates.max(elastic(&start.modal_position[m.clone()])).max(elastic(&end.modal_position[m.clone()])));
            add(&mut error[nv + m.start..nv + m.end].iter().zip(omega()).map(|(e, w)| e * w / scale));
            add(&mut error[n + nv + m.start..n + nv + m.end].iter().map(|e| e / scale));
        }
    }
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}

/// Proportional-integral step controller (Gustafsson).
#[derive(Debug, Clone)]
pub struct Controller {
    order: f64,
    previous: f64,
}

const SAFETY: f64 = 0.9;
const LARGEST_GROWTH: f64 = 5.0;
const LARGEST_CUT: f64 = 0.2;

impl Controller {
    /// For an error estimate of the given order.
    #[must_use]
    pub fn new(order: u8) -> Self {
        Self { order: f64::from(order), previous: 1.0 }
    }

    /// Factor for the next step after an accepted one with this error (in units of the tolerance).
    pub fn accepted(&mut self, error: f64) -> f64 {
        let error = error.max(1e-10);
        let factor = SAFETY * error.powf(-0.7 / self.order) * self.previous.powf(0.4 / self.order);
        self.previous = error;
        factor.clamp(LARGEST_CUT, LARGEST_GROWTH)
    }

    /// Factor for another try after a rejected step.
    #[must_use]
    pub fn rejected(&self, error: f64) -> f64 {
        if error.is_finite() { (SAFETY * error.powf(-1.0 / self.order)).clamp(LARGEST_CUT, 0.9) } else { 0.1 }
    }
}
