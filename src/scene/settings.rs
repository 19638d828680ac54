//! `[simulation]` of a scene to a method with its step or tolerance.

use super::error::{SceneError, Source};
use super::locate::Step;
use super::spec::SimulationSpec;
use crate::integrate::choice::choose;
use crate::integrate::simulate::Method;
use crate::integrate::stability::{fastest_mode, stable_step};
use crate::integrate::step_control::Tolerance;
use crate::integrate::tableau;
use crate::model::System;

/// Integrators by name, with one line of help each.
pub const INTEGRATORS: [(&str, &str); 4] = [
    ("auto", "rosenbrock_w if the fastest mode would hold dormand_prince to smaller steps, else dormand_prince"),
    ("dormand_prince", "explicit Runge-Kutta pair 5(4) with error control"),
    (
        "rosenbrock_w",
        "linearly implicit, order 3(2) with error control: stiff modes and springs do not limit the step; damps what it does not resolve",
    ),
    ("rk4", "explicit Runge-Kutta of order 4 with fixed steps ([simulation] step)"),
];

/// Share of the stable step that a fixed step takes when the scene gives none.
const DEFAULT_SHARE: f64 = 0.25;

/// The method that a scene asks for, and why where pliant chose.
///
/// # Errors
/// If the name is unknown, or a step or tolerance cannot be.
pub fn method(
    spec: &SimulationSpec,
    name: Option<&str>,
    system: &System,
    rate_hz: f64,
    source: &Source,
) -> Result<(Method, Option<String>), SceneError> {
    let at = |key| [Step::Key("simulation"), Step::Key(key)];
    for (key, value) in [("step", spec.step), ("largest_step", spec.largest_step)] {
        if let Some(value) = value.filter(|v| !(*v > 0.0)) {
            return Err(source.value(&at(key), format!("{value} s must be positive")));
        }
    }
    for (key, value) in [("relative_tolerance", spec.relative_tolerance), ("absolute_tolerance", spec.absolute_tolerance)] {
        if !(value > 0.0 && value < 1.0) {
            return Err(source.value(&at(key), format!("{value} must lie between 0 and 1")));
        }
    }
    let tolerance = Tolerance { relative: spec.relative_tolerance, absolute: spec.absolute_tolerance };
    let largest_step = spec.largest_step.unwrap_or(f64::INFINITY);
    match name.or(spec.integrator.as_deref()).unwrap_or("auto") {
        "auto" => {
            let choice = choose(system, tolerance, largest_step, rate_hz);
            Ok((choice.method, Some(choice.reason)))
        }
        "dormand_prince" => Ok((Method::DormandPrince { tolerance, largest_step }, None)),
        "rosenbrock_w" => Ok((Method::RosenbrockW { tolerance, largest_step }, None)),
        "rk4" => {
            let stable = fastest_mode(system).map(|m| stable_step(&tableau::RK4, m.frequency_hz, m.damping_ratio));
            let step = spec.step.unwrap_or_else(|| stable.map_or(f64::INFINITY, |h| DEFAULT_SHARE * h).min(1.0 / rate_hz));
            Ok((Method::RungeKutta4 { step }, None))
        }
        other => {
            let known = INTEGRATORS.map(|i| i.0).join(", ");
            let message = format!("\"{other}\" is not an integrator; known: {known}");
            Err(refused(name, message, source))
        }
    }
}

/// An integrator that cannot be, named by the command line or by the scene.
fn refused(name: Option<&str>, message: String, source: &Source) -> SceneError {
    match name {
        Some(_) => SceneError::Override { option: "--integrator", message },
        None => source.value(&[Step::Key("simulation"), Step::Key("integrator")], message),
    }
}
