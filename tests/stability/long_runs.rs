//! A million undamped periods (S16).

use crate::row::{Row, assert_rows};
use crate::steps::oscillator;
use crate::support::scenes::{end_of, hinge, rigid, rk4};
use pliant::model::build::{Definition, WORLD};
use pliant::model::{State, System};
use std::f64::consts::TAU;

/// A mass on a spring of the frequency of 1 Hz, the cheapest oscillator of all.
fn mass_on_a_spring() -> (System, State) {
    let mut slide = hinge("slide", "prismatic", &[[1.0, 0.0, 0.0]], WORLD, "mass", [0.0; 3]);
    (slide.position, slide.stiffness) = (vec![0.01], vec![TAU * TAU]);
    let bodies = vec![rigid("mass", 1.0, [0.0; 3], [0.1; 3])];
    Definition { bodies, hinges: vec![slide], ..Definition::default() }.build().unwrap()
}

/// `|R|^2 - 1` per step of RK4 at `omega h = 2 pi / 20` and `2 pi / 100`, and the phase per period at the latter; closed form.
const GROWTH_20: f64 = -1.318_789_624_73e-5;
const GROWTH_100: f64 = -8.541_464_595_77e-10;
const PHASE_100: f64 = -1.296_957e-7;

/// Loss of energy with the logarithm `logarithm` in `steps` steps, against `growth` per step.
fn loss(what: &str, logarithm: f64, steps: f64, growth: f64) -> Row {
    Row::at_most("S16", what, (logarithm / steps / f64::ln_1p(growth) - 1.0).abs(), 0.01, "against the closed form")
}

/// Logarithm of what is left of the energy after `periods` of the mass in steps of `step`, and phase per period.
fn after(periods: f64, step: f64) -> (f64, f64) {
    let (system, start) = mass_on_a_spring();
    let end = end_of(&system, &start, rk4(step), periods);
    let energy = |s: &State| (TAU * s.position[0]).powi(2) + s.velocity[0].powi(2);
    let phase = -end.velocity[0].atan2(end.position[0] * TAU) / TAU / periods;
    ((energy(&end) / energy(&start)).ln(), phase)
}

/// S16.
#[test]
fn a_million_periods_lose_what_the_method_says() {
    let mut rows = vec![loss("1e6 periods of 20 steps of rk4: loss of energy", after(1e6, 0.05).0, 2e7, GROWTH_20)];
    let (system, start) = oscillator(1.0);
    let end = end_of(&system, &start, rk4(0.01), 1e4);
    let energy = |s: &State| (TAU * s.modal_position[0]).powi(2) + s.modal_velocity[0].powi(2);
    rows.push(loss("1e4 periods of a mode, 100 steps of rk4 each: loss of energy", (energy(&end) / energy(&start)).ln(), 1e6, GROWTH_100));
    let phase = -end.modal_velocity[0].atan2(end.modal_position[0] * TAU) / TAU / 1e4;
    rows.push(Row::at_most("S16", "the same: phase per period", (phase / PHASE_100 - 1.0).abs(), 0.01, "against the closed form"));
    assert_rows(&rows);
}

#[test]
fn a_million_periods_of_a_hundred_steps_lose_what_the_method_says() {
    let (logarithm, phase) = after(1e6, 0.01);
    assert_rows(&[
        loss("1e6 periods of 100 steps of rk4: loss of energy", logarithm, 1e8, GROWTH_100),
        Row::at_most("S16", "the same: phase per period", (phase / PHASE_100 - 1.0).abs(), 0.01, "against the closed form"),
    ]);
}
