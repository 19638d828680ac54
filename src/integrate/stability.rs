//! How large a step a method can take with the fastest retained mode.

use super::tableau::Tableau;
use crate::model::System;
use std::f64::consts::TAU;

/// The fastest retained mode of a system.
#[derive(Debug, Clone, PartialEq)]
pub struct FastestMode {
    /// Body that has it.
    pub body: String,
    /// Its name, as "mode 3".
    pub mode: String,
    /// Hz.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
}

/// The fastest retained mode of `system`, none for rigid systems.
#[must_use]
pub fn fastest_mode(system: &System) -> Option<FastestMode> {
    let modes = system.bodies.iter().filter_map(|b| b.flexible().map(|f| (b, f))).flat_map(|(b, f)| {
        f.stiffness.iter().enumerate().map(move |(j, k)| {
            let omega = k.max(0.0).sqrt();
            let damping_ratio = if omega > 0.0 { 0.5 * f.damping[j] / omega } else { 0.0 };
            FastestMode { body: b.name.clone(), mode: f.mode_names[j].clone(), frequency_hz: omega / TAU, damping_ratio }
        })
    });
    modes.max_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz))
}

/// Largest step (s) with which the method does not amplify an oscillation of `frequency_hz` and `damping_ratio`.
///
/// Follows |R(h lambda)| along the ray of lambda = omega (-zeta + i sqrt(1 - zeta^2)) to the first crossing of 1.
#[must_use]
pub fn stable_step(tableau: &Tableau, frequency_hz: f64, damping_ratio: f64) -> f64 {
    let omega = TAU * frequency_hz;
    let zeta = damping_ratio.min(1.0);
    let direction = [-zeta, (1.0 - zeta * zeta).sqrt()];
    let polynomial = tableau.stability_polynomial();
    // rounding in R is a few eps; a growth below this is below 1e-3 over 1e10 steps
    let stable = |z: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for c in polynomial.iter().rev() {
            (re, im) = (re * direction[0] * z - im * direction[1] * z + c, re * direction[1] * z + im * direction[0] * z);
        }
        re * re + im * im <= 1.0 + 1e-13
    };
    let (mut inside, step) = (0.0, 0.01);
    while stable(inside + step) && inside < 100.0 {
        inside += step;
    }
    let (mut low, mut high) = (inside, inside + step);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if stable(middle) { low = middle } else { high = middle }
    }
    low / omega
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::tableau::{DORMAND_PRINCE, RK4};

    #[test]
    fn rk4_is_stable_on_the_imaginary_axis_up_to_two_root_two() {
        let h = stable_step(&RK4, 1.0 / TAU, 0.0);
        assert!((h - 8.0_f64.sqrt()).abs() < 1e-9, "{h}");
    }

    #[test]
    fn dormand_prince_has_a_stable_step_for_undamped_and_damped_modes() {
        let undamped = stable_step(&DORMAND_PRINCE, 1.0 / TAU, 0.0);
        let damped = stable_step(&DORMAND_PRINCE, 1.0 / TAU, 1.0);
        // |R| = 1 at about 1.0 on the imaginary and 3.31 on the negative real axis (Hairer and Wanner, Fig. IV.2.1)
        assert!(undamped > 0.9 && undamped < 1.1, "{undamped}");
        assert!(damped > 3.2 && damped < 3.4, "{damped}");
    }
}
