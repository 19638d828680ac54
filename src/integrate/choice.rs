//! Which method an integrator called `auto` stands for, and why.

use super::simulate::Method;
use super::stability::{FastestMode, fastest_mode, stable_step};
use super::step_control::Tolerance;
use super::tableau::DORMAND_PRINCE;
use crate::model::System;
use std::f64::consts::TAU;

/// A method and the reason for it, as a sentence.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// What to run.
    pub method: Method,
    /// Why, with the numbers that decided.
    pub reason: String,
}

/// Steps of rosenbrock_w per period of the motion that it resolves, times the cube root of the tolerance: 10 per period at 1e-3 were
/// measured on a driven hub with a sprung panel whose slow modes end at 1.6 Hz (tests/physics/stiff.rs).
const STEPS_PER_PERIOD: f64 = 0.63;

/// Explicit pair or linearly implicit method, whichever may take the larger steps; a step of either costs about the same.
///
/// The explicit pair is held to its stable step with the fastest retained mode. The linearly implicit method is held by accuracy, which
/// is of order 3, to steps of `tolerance^(1/3) / (0.63 f)`: f is the fastest retained mode that the output can show, which is one below
/// half of the output rate, or that half itself if there is none.
#[must_use]
pub fn choose(system: &System, tolerance: Tolerance, largest_step: f64, rate_hz: f64) -> Choice {
    let explicit = Method::DormandPrince { tolerance, largest_step };
    let Some(FastestMode { body, mode, frequency_hz, damping_ratio }) = fastest_mode(system) else {
        return Choice { method: explicit, reason: "dormand_prince: no modes".into() };
    };
    let stable = stable_step(&DORMAND_PRINCE, frequency_hz, damping_ratio);
    let frequencies = system.bodies.iter().filter_map(|b| b.flexible()).flat_map(|f| &f.stiffness).map(|k| k.max(0.0).sqrt() / TAU);
    let shown = frequencies.filter(|f| *f <= 0.5 * rate_hz).fold(0.0, f64::max);
    let shown = if shown > 0.0 { shown } else { 0.5 * rate_hz };
    let accurate = tolerance.relative.cbrt() / (STEPS_PER_PERIOD * shown);
    let name = format!("{mode} of \"{body}\" at {frequency_hz:.4} Hz");
    if stable < accurate.min(largest_step) {
        let reason = format!(
            "rosenbrock_w: {name} would hold dormand_prince to steps of {stable:.2e} s, while motion up to {shown:.4} Hz, all that \
             {rate_hz} output times per second show, needs {accurate:.2e} s"
        );
        Choice { method: Method::RosenbrockW { tolerance, largest_step }, reason }
    } else {
        let reason =
            format!("dormand_prince: {name} allows steps of {stable:.2e} s, and rosenbrock_w would need {accurate:.2e} s for accuracy");
        Choice { method: explicit, reason }
    }
}
