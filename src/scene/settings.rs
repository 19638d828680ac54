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

/// What error-controlled integrators are held to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Of the local error.
    pub tolerance: Tolerance,
    /// s.
    pub largest_step: f64,
}

impl Control {
    /// The same at another relative tolerance; the absolute one keeps its ratio to it.
    #[must_use]
    pub fn at(&self, relative: f64) -> Self {
        let absolute = self.tolerance.absolute * (relative / self.tolerance.relative);
        Self { tolerance: Tolerance { relative, absolute }, ..*self }
    }
}

/// How closely an integrator shall follow the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Accuracy {
    /// Relative tolerance of an error-controlled integrator.
    Tolerance(f64),
    /// Step of rk4 (s).
    Step(f64),
}

/// The tolerances and the bound on the step that a scene asks for.
///
/// # Errors
/// If one of them cannot be.
pub fn control(spec: &SimulationSpec, source: &Source) -> Result<Control, SceneError> {
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
    Ok(Control { tolerance, largest_step: spec.largest_step.unwrap_or(f64::INFINITY) })
}

/// The method that a scene asks for, and why where pliant chose.
///
/// # Errors
/// If the name is unknown.
pub fn method(
    spec: &SimulationSpec,
    control: &Control,
    name: Option<&str>,
    system: &System,
    rate_hz: f64,
    source: &Source,
) -> Result<(Method, Option<String>), SceneError> {
    let asked = name.or(spec.integrator.as_deref()).unwrap_or("auto");
    named(asked, control, spec.step, system, rate_hz).ok_or_else(|| {
        let known = INTEGRATORS.map(|i| i.0).join(", ");
        refused(name, format!("\"{asked}\" is not an integrator; known: {known}"), source)
    })
}

/// The method of that name, and why where pliant chose; none for a name that is not known. `step` is of rk4.
#[must_use]
pub fn named(name: &str, control: &Control, step: Option<f64>, system: &System, rate_hz: f64) -> Option<(Method, Option<String>)> {
    let Control { tolerance, largest_step } = *control;
    match name {
        "auto" => {
            let choice = choose(system, tolerance, largest_step, rate_hz);
            Some((choice.method, Some(choice.reason)))
        }
        "dormand_prince" => Some((Method::DormandPrince { tolerance, largest_step }, None)),
        "rosenbrock_w" => Some((Method::RosenbrockW { tolerance, largest_step }, None)),
        "rk4" => {
            let stable = fastest_mode(system).map(|m| stable_step(&tableau::RK4, m.frequency_hz, m.damping_ratio));
            let step = step.unwrap_or_else(|| stable.map_or(f64::INFINITY, |h| DEFAULT_SHARE * h).min(1.0 / rate_hz));
            Some((Method::RungeKutta4 { step }, None))
        }
        _ => None,
    }
}

/// An integrator that cannot be, named by the command line or by the scene.
fn refused(name: Option<&str>, message: String, source: &Source) -> SceneError {
    match name {
        Some(_) => SceneError::Override { option: "--integrator", message },
        None => source.value(&[Step::Key("simulation"), Step::Key("integrator")], message),
    }
}
