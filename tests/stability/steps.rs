//! Steps far too small and far too large (S09).

use crate::row::{EPS, Row, assert_rows, componentwise};
use crate::support::scenes::{G, dormand_prince, end_of, exact_beam, flexible, hinge, rigid, rk4, run};
use nalgebra::Vector3;
use pliant::integrate::simulate::Method;
use pliant::integrate::stability::stable_step;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::tableau::RK4;
use pliant::integrate::{Outcome, Settings, Summary, simulate};
use pliant::model::build::{BodyDefinitionKind, Definition, WORLD};
use pliant::model::{State, System};
use std::time::Instant;

fn falling_stone() -> (System, State) {
    let bodies = vec![rigid("stone", 2.0, [0.0; 3], [1.0; 3])];
    let hinges = vec![hinge("fall", "free", &[], WORLD, "stone", [0.0; 3])];
    Definition { gravity: Vector3::new(0.0, 0.0, -G), bodies, hinges, ..Definition::default() }.build().unwrap()
}

/// One cantilever mode on a fixed base, a linear oscillator of the modal coordinate.
pub fn oscillator(frequency_hz: f64) -> (System, State) {
    let mut modal = exact_beam(1);
    modal.frequency_hz = vec![frequency_hz];
    let mut beam = flexible("beam", modal);
    if let BodyDefinitionKind::Flexible(f) = &mut beam.kind {
        f.modal_position = vec![0.01];
    }
    let hinges = vec![hinge("clamp", "fixed", &[], WORLD, "beam", [0.0; 3])];
    Definition { bodies: vec![beam], hinges, ..Definition::default() }.build().unwrap()
}

/// A parabola is exact for every method of order 2 or more, whatever the step.
#[test]
fn free_fall_is_exact_for_any_step() {
    let (system, start) = falling_stone();
    let rows = [(1e-15, 1e-12), (1e-3, 1.0), (1.0, 1e3), (1e3, 1e5)].map(|(step, duration)| {
        let end = end_of(&system, &start, rk4(step), duration);
        let off = componentwise(&end.position[2..3], &[-0.5 * G * duration * duration]);
        // each step rounds position, rate and clock; a single one rounds some products
        let bound = (2.0 * EPS * (duration / step)).max(8.0 * EPS);
        Row::at_most("S09", format!("free fall in steps of {step:.0e} s"), off, bound, "2 N eps")
    });
    assert_rows(&rows);
}

fn outcome(start: &(System, State), method: Method, duration: f64) -> (Summary, f64) {
    let begin = Instant::now();
    let summary = simulate(&start.0, &start.1, &Settings { duration, method, rate_hz: 10.0 / duration }, &mut []);
    (summary, begin.elapsed().as_secs_f64())
}

fn failure(summary: &Summary) -> Option<String> {
    match &summary.outcome {
        Outcome::Failed(failure) => Some(failure.to_string()),
        _ => None,
    }
}

/// Steps that cannot advance the clock, and tolerances that nothing meets, end at once.
#[test]
fn steps_below_the_clock_are_refused() {
    let stone = falling_stone();
    let beam = oscillator(1.0);
    let mut rows = Vec::new();
    for step in [1e-17, 1e-300, f64::from_bits(1)] {
        let (summary, seconds) = outcome(&stone, rk4(step), 1.0);
        rows.push(Row::says("S09", format!("steps of {step:.0e} s over 1 s"), failure(&summary), &["t = 0 s"]));
        rows.push(Row::at_most("S09", "the same: time until it says so (s)", seconds, 1.0, ""));
    }
    for tolerance in [1e-30, 1e-300] {
        let (summary, seconds) = outcome(&beam, dormand_prince(tolerance), 1.0);
        rows.push(Row::says(
            "S09",
            format!("a tolerance of {tolerance:.0e}"),
            failure(&summary),
            &["the step fell to", "loosen relative_tolerance"],
        ));
        rows.push(Row::at_most("S09", "the same: time until it says so (s)", seconds, 5.0, ""));
    }
    assert_rows(&rows);
}

#[test]
fn the_predicted_stable_step_divides_bounded_from_diverging_runs() {
    let (system, start) = oscillator(100.0);
    let limit = stable_step(&RK4, 100.0, 0.0);
    let largest = |factor: f64| {
        let mut largest = 0.0_f64;
        run(&system, &start, rk4(factor * limit), 3000.0 * limit, 10.0 / limit, |s| largest = largest.max(s.state.modal_position[0].abs()));
        largest / 0.01
    };
    let above = largest(1.001);
    assert_rows(&[
        // between samples the cubic overshoots the steps, by less than the step's own length in phase
        Row::at_most(
            "S09",
            "mode of 100 Hz, 3000 steps of 0.999 of the stable step: growth",
            largest(0.999),
            3.0,
            "2 sqrt 2, the phase of a step",
        ),
        Row::holds("S09", "the same at 1.001 of it", "diverges", format!("{above:.1e}"), above > 1e3),
    ]);
}

/// Steps of a thousand seconds and more on a mode of 100 Hz.
#[test]
fn steps_far_too_large_end_in_a_message_or_stay_bounded() {
    let beam = oscillator(100.0);
    let mut rows = Vec::new();
    for step in [1.0, 1e3, 1e100] {
        let (summary, _) = outcome(&beam, rk4(step), 200.0 * step);
        rows.push(Row::says(
            "S09",
            format!("mode of 100 Hz in rk4 steps of {step:.0e} s"),
            failure(&summary),
            &["mode 1", "\"beam\"", "smaller step"],
        ));
        let loose = Tolerance { relative: 1e6, absolute: 1e6 };
        let (summary, _) = outcome(&beam, Method::RosenbrockW { tolerance: loose, largest_step: step }, 200.0 * step);
        let size = summary.end.modal_position[0].abs() / 0.01;
        rows.push(Row::at_most("S09", format!("the same in rosenbrock_w steps of up to {step:.0e} s: growth"), size, 1.0, "L-stable"));
    }
    assert_rows(&rows);
}
