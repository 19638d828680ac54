//! A million undamped periods (S16), and a thousand seconds of a spinning body with a damped appendage (S17).

use crate::row::{Row, assert_rows};
use crate::steps::oscillator;
use crate::support::scenes::{dormand_prince, end_of, hinge, rigid, rk4, run};
use pliant::dynamics::energy::balance;
use pliant::dynamics::world::WorldFrame;
use pliant::model::State;
use pliant::model::build::{Definition, WORLD};
use std::f64::consts::TAU;

/// S16: |R|^2 - 1 per step and the phase per period of RK4 at omega h = 2 pi / N, closed form.
#[test]
fn a_million_periods_lose_what_the_method_says() {
    let loss = |what: &str, logarithm: f64, steps: f64, growth: f64| {
        let off = (logarithm / steps / f64::ln_1p(growth) - 1.0).abs();
        Row::at_most("S16", what, off, 0.01, "against the closed form")
    };
    // a mass on a spring of the frequency of 1 Hz, the cheapest oscillator of all
    let mut slide = hinge("slide", "prismatic", &[[1.0, 0.0, 0.0]], WORLD, "mass", [0.0; 3]);
    (slide.position, slide.stiffness) = (vec![0.01], vec![TAU * TAU]);
    let bodies = vec![rigid("mass", 1.0, [0.0; 3], [0.1; 3])];
    let (system, start) = Definition { bodies, hinges: vec![slide], ..Definition::default() }.build().unwrap();
    let end = end_of(&system, &start, rk4(0.05), 1e6);
    let energy = |s: &State| (TAU * s.position[0]).powi(2) + s.velocity[0].powi(2);
    let million = (energy(&end) / energy(&start)).ln();
    let mut rows = vec![loss("1e6 periods of 20 steps of rk4: loss of energy", million, 2e7, -1.318_789_624_73e-5)];

    let (system, start) = oscillator(1.0);
    let end = end_of(&system, &start, rk4(0.01), 1e4);
    let energy = |s: &State| (TAU * s.modal_position[0]).powi(2) + s.modal_velocity[0].powi(2);
    let found = (energy(&end) / energy(&start)).ln();
    rows.push(loss("1e4 periods of a mode, 100 steps of rk4 each: loss of energy", found, 1e6, -8.541_464_595_77e-10));
    let phase = -end.modal_velocity[0].atan2(end.modal_position[0] * TAU) / TAU / 1e4;
    rows.push(Row::at_most("S16", "the same: phase per period", (phase / -1.296_957e-7 - 1.0).abs(), 0.01, "against the closed form"));
    assert_rows(&rows);
}

/// S17: Explorer 1. A body that spins about its axis of least inertia, with a damped mass on a spring, ends in a flat spin.
#[test]
fn a_damped_appendage_turns_a_spin_about_the_least_axis_flat() {
    let mut base = hinge("base", "free", &[], WORLD, "bus", [0.0; 3]);
    // no momentum: that of the tip, 0.5 kg at 1 m, is taken off both
    let drift = 0.5 / 10.5 * 0.3;
    base.velocity = vec![2.0, 0.3, 0.3, 0.0, -drift, drift];
    let mut whip = hinge("whip", "prismatic", &[[0.0, 0.0, 1.0]], "bus", "tip", [1.0, 0.0, 0.0]);
    (whip.stiffness, whip.damping) = (vec![1.0], vec![0.5]);
    let bodies = vec![rigid("bus", 10.0, [0.0; 3], [1.0, 2.0, 2.4]), rigid("tip", 0.5, [0.0; 3], [1e-3; 3])];
    let (system, start) = Definition { bodies, hinges: vec![base, whip], ..Definition::default() }.build().unwrap();
    let mut frames = vec![WorldFrame::default(); 2];
    let mut seen = Vec::new();
    let end = run(&system, &start, dormand_prince(1e-13), 1000.0, 1.0, |s| {
        let (energy, momentum) = balance(s.system, s.state, s.workspace, &mut frames);
        seen.push((energy.total(), momentum.angular));
    })
    .end;
    let (first, held) = seen[0];
    let drift = seen.iter().map(|(_, h)| (h - held).norm() / held.norm()).fold(0.0, f64::max);
    let rise = seen.windows(2).map(|e| e[1].0 / e[0].0 - 1.0).fold(f64::NEG_INFINITY, f64::max);
    // about the centre of mass the tip adds 10 / 10.5 of its 0.5 kg m^2 to two axes; below the energy of a spin about the middle axis the
    // body's own axis of greatest inertia is the one that the spin stays about
    let separatrix = held.norm_squared() / (2.0 * (2.0 + 5.0 / 10.5));
    let last = seen[seen.len() - 1].0;
    println!("energy {first} -> {last}, end {:?}", end.velocity);
    assert_rows(&[
        Row::at_most("S17", "spin about the least axis with a damped appendage, 1000 s: angular momentum", drift, 1e-10, ""),
        Row::at_most("S17", "the same: rise of energy in any second", rise, 1e-10, "falls; rounding of the tolerance at rest"),
        Row::at_most("S17", "the same: energy at the end over that of a spin about the middle axis", last / separatrix, 1.0, "flat spin"),
    ]);
}
