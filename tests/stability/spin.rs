//! Spin beyond what modes bear, with and without geometric stiffness (S06), and spin at 1e4 rad/s (S08).

use crate::order_8;
use crate::row::{EPS, Row, assert_rows, componentwise};
use crate::support::scenes::{
    Z, difference, dormand_prince, end_of, exact_beam, flexible, hinge, rate_at_start, rigid, rk4, run, spinning, stiffened, stiffened_beam,
};
use nalgebra::{DMatrix, Matrix3, Vector3};
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::model::build::{BodyDefinition, Definition, WORLD};
use pliant::model::modal_body::ModalBody;
use pliant::model::{State, System};
use pliant::output::stiffening::StiffeningGauge;
use pliant::spatial::rotation::product;
use std::f64::consts::TAU;

/// Two modes of unit mass along x and y with the natural frequencies `omega`, which a spin couples by Coriolis forces only.
fn two_modes(omega: [f64; 2]) -> ModalBody {
    let mut body = exact_beam(2);
    body.frequency_hz = omega.map(|w| w / TAU).to_vec();
    body.momentum = vec![Vector3::zeros(); 2];
    body.first_moment = vec![Matrix3::zeros(); 2];
    body.second_moment = (0..4).map(|i| Matrix3::from_fn(|a, b| if (a, b) == (i / 2, i % 2) { 1.0 } else { 0.0 })).collect();
    body
}

/// Eigenvalues of the linear motion of the modes at the steady spin `rate` about z.
fn eigenvalues(body: BodyDefinition, rate: f64) -> Vec<nalgebra::Complex<f64>> {
    let (system, mut state) = spinning(body, Z, 0.0, rate_at_start(rate));
    state.apply_prescribed(&system);
    let n = state.modal_position.len();
    let mut workspace = Workspace::new(&system);
    let mut matrix = DMatrix::zeros(2 * n, 2 * n);
    for k in 0..2 * n {
        let unit = |j: usize| if j == k { 1.0 } else { 0.0 };
        (0..n).for_each(|j| (state.modal_position[j], state.modal_velocity[j]) = (unit(j), unit(n + j)));
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        for j in 0..n {
            matrix[(j, k)] = unit(n + j);
            matrix[(n + j, k)] = workspace.acceleration.modal[j];
        }
    }
    matrix.complex_eigenvalues().iter().copied().collect()
}

fn growth(body: BodyDefinition, rate: f64) -> f64 {
    eigenvalues(body, rate).iter().fold(0.0_f64, |a, z| a.max(z.re))
}

/// Frequencies (rad/s) of the motion about the spin, ascending.
fn turning(rate: f64) -> Vec<f64> {
    let mut found: Vec<f64> =
        eigenvalues(flexible("beam", two_modes([1.0, 2.0])), rate).iter().map(|z| z.im).filter(|x| *x > 0.0).collect();
    found.sort_by(f64::total_cmp);
    found
}

/// One mode of 1 rad/s.
fn one_mode() -> ModalBody {
    let mut body = exact_beam(1);
    body.frequency_hz = vec![1.0 / TAU];
    body
}

/// S06: the plain model leaves exactly as its own equations say.
#[test]
fn spin_beyond_the_natural_frequency_grows_as_the_plain_model_says() {
    // eigenvalues of four by four matrices keep some 1e-14 of the largest entry, 1e8 at the spin of 1e4, where pairs lie 3 apart
    let of_two = || flexible("beam", two_modes([1.0, 2.0]));
    let at_most = |what: &str, found: &[f64], expected: &[f64]| Row::at_most("S06", what, componentwise(found, expected), 1e-8, "");
    let mut rows = vec![
        at_most("modes of 1 and 2 rad/s at a spin of 1.5 rad/s: growth", &[growth(of_two(), 1.5)], &[0.474_275_432_141_598]),
        at_most("the same at 3 rad/s, stable again: frequencies", &turning(3.0), &[1.376_703_905_656_81, 4.593_983_713_091_42]),
        at_most("the same at 1e4 rad/s: frequencies", &turning(1e4), &[9_998.418_861_168_14, 10_001.581_138_831_9]),
        Row::at_most("S06", "the same at 3 rad/s: growth", growth(of_two(), 3.0), 1e-12, "none"),
        at_most(
            "one mode at 1.01 times its frequency: growth",
            &[growth(flexible("beam", one_mode()), 1.01)],
            &[0.141_774_468_787_578_252],
        ),
    ];
    // a hub too heavy to feel the beam keeps the spin; reaction changes it by 1e-13
    let spin = hinge("spin", "revolute", &[Z], WORLD, "hub", [0.0; 3]);
    let clamp = hinge("clamp", "fixed", &[], "hub", "beam", [0.0; 3]);
    let hub = rigid("hub", 1.0, [0.0; 3], [1e13; 3]);
    let definition = Definition { bodies: vec![hub, flexible("beam", one_mode())], hinges: vec![spin, clamp], ..Definition::default() };
    let (system, mut state) = definition.build().unwrap();
    (state.velocity[0], state.modal_position[0]) = (1.01, 1e-3);
    let mut end = 0.0;
    let mut gauge = StiffeningGauge::new(&system);
    run(&system, &state, dormand_prince(1e-12), 10.0, 1.0, |s| {
        gauge.follow(s);
        end = s.state.modal_position[0];
    });
    rows.push(at_most("the same: deflection after 10 s", &[end / 1e-3], &[2.185_030_114_346_834_51]));
    // 1.01^2
    let words = ["spin takes 102.01 % of the stiffness of mode 1", "without bound", "no geometric stiffness"];
    rows.push(Row::says("S06", "the same: warning", gauge.warnings(&system).first().cloned(), &words).named("a warning that says so"));
    assert_rows(&rows);
}

/// A beam's own tension stiffens it by more than the spin softens: 1.1933 against 1 for the first mode.
#[test]
fn spin_with_geometric_stiffness_stays_bounded_at_any_rate() {
    // first bending frequency 3.516 rad/s; eight cantilever modes
    let rows = [4.0, 12.0, 100.0].map(|rate| {
        let plain = growth(flexible("beam", stiffened_beam(8)), rate);
        let found = growth(stiffened("beam", stiffened_beam(8)), rate);
        let what = format!("beam of 3.516 rad/s at a spin of {rate} rad/s with geometric stiffness: growth (without: {plain:.3})");
        // eigenvalues of a matrix whose largest entry is the square of the highest frequency, 563 rad/s at least
        Row::at_most("S06", what, found, 1e-8, "none")
    });
    assert_rows(&rows);
}

/// The wheel of S08: inertia (1, 1, 1.5) at (10, 0, 1e4) rad/s.
fn wheel() -> (System, State) {
    let mut pivot = hinge("pivot", "spherical", &[], WORLD, "wheel", [0.0; 3]);
    pivot.velocity = vec![10.0, 0.0, 1e4];
    let wheel = rigid("wheel", 1.0, [0.0; 3], [1.0, 1.0, 1.5]);
    Definition { bodies: vec![wheel], hinges: vec![pivot], ..Definition::default() }.build().unwrap()
}

/// Its attitude after 1 s and 1000 s, and its rates across the spin after 1000 s; closed form.
const AFTER_1: [f64; 4] = [0.156_314_678_043_046_651, -0.000_431_635_962_477_433, 0.000_369_319_747_911_892, -0.987_707_142_184_169_066];
const AFTER_1000: [f64; 4] = [0.992_669_636_990_582_848, -0.000_354_739_457_007_217, 0.000_441_479_714_703_465, -0.120_858_061_595_259_833];
const RATES_AFTER_1000: [f64; 2] = [-2.153_248_868_782_478_18, -9.765_426_846_570_829_22];

/// Angle (rad) of the rotation between two attitudes.
fn angle_between(found: &[f64], expected: &[f64; 4]) -> f64 {
    let [w, x, y, z] = *expected;
    let relative = product(&[w, -x, -y, -z], &[found[0], found[1], found[2], found[3]]);
    2.0 * relative[1].hypot(relative[2]).hypot(relative[3]).min(1.0).asin()
}

/// Largest relative departures of angular momentum and energy.
#[derive(Default)]
struct Drift {
    momentum: f64,
    energy: f64,
}

impl Drift {
    fn follow(&mut self, start: &State, state: &State) {
        let momentum = |v: &[f64]| (v[0] * v[0] + v[1] * v[1] + 2.25 * v[2] * v[2]).sqrt();
        let energy = |v: &[f64]| 0.5 * (v[0] * v[0] + v[1] * v[1] + 1.5 * v[2] * v[2]);
        let off = |of: fn(&[f64]) -> f64| (of(&state.velocity) / of(&start.velocity) - 1.0).abs();
        (self.momentum, self.energy) = (self.momentum.max(off(momentum)), self.energy.max(off(energy)));
    }
}

/// S08 for one second, with the program's own method.
#[test]
fn spin_of_1e4_rad_per_s_keeps_attitude_energy_and_momentum() {
    let (system, start) = wheel();
    let end = end_of(&system, &start, rk4(2e-6), 1.0);
    let mut drift = Drift::default();
    drift.follow(&start, &end);
    assert_rows(&[
        Row::at_most("S08", "1e4 rad/s for 1 s in 5e5 steps of rk4: attitude (rad)", angle_between(&end.position, &AFTER_1), 1e-9, ""),
        Row::at_most("S08", "the same: angular momentum", drift.momentum, 1e-12, ""),
        Row::at_most("S08", "the same: energy", drift.energy, 1e-12, ""),
    ]);
}

/// S08 for the whole 1000 s: 1.6 million turns. The rates across the spin turn at 5e3 rad/s in body axes; what a step of theirs loses in
/// amplitude shows in momentum and energy, and so in the precession; what it loses in phase shows in the attitude.
fn long_spin(duration: f64, steps: u32, expected: &[f64; 4], rates: Option<[f64; 2]>) {
    let (system, start) = wheel();
    let mut drift = Drift::default();
    let end = order_8::run(&system, &start, duration, steps, steps / 1000, |state| drift.follow(&start, state));
    let count = f64::from(steps);
    let (phase, loss) = order_8::step_errors(5e3 * duration / count);
    let angle = 1e4 * duration;
    // the rates across the spin carry this share of the square of the momentum, and the precession turns at |H| / 1
    let share = 100.0 / 2.25e8;
    let precession = 1.5e4 * duration;
    let mut rows = vec![
        Row::at_most(
            "S08",
            format!("1e4 rad/s for {duration} s in {count:.0e} steps of order 8: attitude (rad)"),
            angle_between(&end.position, expected),
            2.0 * count * (phase * 1e-3 + 0.5 * loss * share * precession) + 8.0 * EPS * angle,
            "twice steps x (phase of a step of the wobble x 1e-3 + its loss of momentum x precession / 2) + 8 eps x angle",
        ),
        Row::at_most("S08", "the same: angular momentum, at all times", drift.momentum, 1e-12, ""),
        Row::at_most("S08", "the same: energy, at all times", drift.energy, 1e-12, ""),
    ];
    if let Some(rates) = rates {
        let off = difference(&end.velocity[..2], &rates);
        rows.push(Row::at_most(
            "S08",
            "the same: rates across the spin",
            off,
            2.0 * count * phase + 8.0 * EPS * 0.5 * angle,
            "twice steps x phase of a step + 8 eps x their angle",
        ));
    }
    assert_rows(&rows);
}

#[test]
fn order_8_spends_fewer_steps_on_a_spin_of_1e4_rad_per_s() {
    long_spin(1.0, 20_000, &AFTER_1, None);
}

/// 2.4e8 evaluations.
#[test]
fn a_thousand_seconds_of_spin_at_1e4_rad_per_s() {
    long_spin(1000.0, 20_000_000, &AFTER_1000, Some(RATES_AFTER_1000));
}
