//! Flexible bodies with known answers: the uniform beam by its exact Euler-Bernoulli modes (F01, F02, F05). Labels are those of the project's list of reference problems; all values there are closed forms.

use crate::support::assert_close;
use crate::support::scenes::{Z, exact_beam, flexible, hinge, rigid};
use nalgebra::DMatrix;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, dense, forward_dynamics};
use pliant::model::build::{BodyDefinition, Definition, WORLD};
use pliant::model::{State, System, TimeFunction};
use std::f64::consts::{FRAC_PI_2, TAU};

const EPS: f64 = f64::EPSILON;

/// F01: the numbers that the beam of the other tests is made of.
#[test]
fn published_cantilever_has_its_modal_constants() {
    let beam = exact_beam(3);
    let beta: Vec<f64> = beam.frequency_hz.iter().map(|f| (TAU * f).sqrt()).collect();
    assert_close(&beta, &[1.875_104_068_711_961_166_4, 4.694_091_132_974_174_576_4, 7.854_757_438_237_612_564_9], 4.0 * EPS, "beta L");
    let a: Vec<f64> = beam.momentum.iter().map(|p| p.y).collect();
    assert_close(&a, &[0.782_991_756_039_625_737, 0.433_935_895_110_719_272, 0.254_425_296_866_105_711], 16.0 * EPS, "int phi");
    let b: Vec<f64> = beam.first_moment.iter().map(|q| q[(0, 1)]).collect();
    assert_close(&b, &[0.568_825_743_709_910_742, 0.090_766_786_886_386_966_4, 0.032_416_374_369_744_434_3], 16.0 * EPS, "int x phi");
}

/// A hub pinned at its centre with one beam clamped there.
fn pinned_hub(modes: usize) -> (System, State) {
    let pin = hinge("pin", "revolute", &[Z], WORLD, "hub", [0.0; 3]);
    let clamp = hinge("clamp", "fixed", &[], "hub", "beam", [0.0; 3]);
    let bodies = vec![rigid("hub", 1.0, [0.0; 3], [1.0; 3]), flexible("beam", exact_beam(modes))];
    Definition { bodies, hinges: vec![pin, clamp], ..Definition::default() }.build().unwrap()
}

/// Lowest frequency (rad/s) with the hub free: eigenvalues of `K^-1/2 (M_ff - M_fr M_rr^-1 M_rf) K^-1/2` are 1/omega^2.
fn lowest_unconstrained(system: &System, state: &State) -> f64 {
    let mass = dense::equations(system, state).mass;
    let stiffness = &system.bodies[1].flexible().unwrap().stiffness;
    let n = stiffness.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        (mass[(i + 1, j + 1)] - mass[(i + 1, 0)] * mass[(0, j + 1)] / mass[(0, 0)]) / (stiffness[i] * stiffness[j]).sqrt()
    });
    1.0 / scaled.symmetric_eigenvalues().max().sqrt()
}

/// F02: hub of unit inertia and radius zero with one beam, by n constrained modes. Exact: 4.04011335592363361.
#[test]
fn published_constrained_modes_give_the_unconstrained_frequency() {
    for (modes, expected) in [(1, 4.040_254_831_807_5), (2, 4.040_115_725_447_91), (4, 4.040_113_381_374_74)] {
        let (system, state) = pinned_hub(modes);
        assert_close(&[lowest_unconstrained(&system, &state)], &[expected], 1e-12, &format!("{modes} modes"));
    }
    // one mode: omega_1 / sqrt(1 - b_1^2 / J)
    let (system, state) = pinned_hub(1);
    assert_close(&[lowest_unconstrained(&system, &state)], &[4.040_254_831_807_504_18], 1e-13, "one mode");
    // from above, towards the exact one, with the residual inertia of the modes left out (eighth mode: 1e-8 of the first)
    let (system, state) = pinned_hub(12);
    let found = lowest_unconstrained(&system, &state);
    println!("12 modes: {:e} above", found / 4.040_113_355_923_633_61 - 1.0);
    assert!(found > 4.040_113_355_923_633_61 && found < 4.040_113_355_923_633_61 * (1.0 + 1e-10), "{found}");
}

/// F02 by the recursion itself: a deflection held at rest accelerates as the same matrices say.
#[test]
fn recursion_feels_the_hub_through_the_constrained_modes() {
    let (system, mut state) = pinned_hub(1);
    state.modal_position = vec![1e-6];
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &state, &mut workspace).unwrap();
    let omega_squared = -workspace.acceleration.modal[0] / state.modal_position[0];
    // inertia changes with eta^2 = 1e-12
    assert_close(&[omega_squared.sqrt()], &[4.040_254_831_807_504_18], 1e-11, "frequency");
}

/// F05: the root of the beam starts to move sideways with a unit acceleration.
#[test]
fn published_prescribed_base_step_loads_the_root_with_the_residual_mass() {
    // 1 - cos t: no displacement, no rate and a unit acceleration at t = 0
    let cosine = TimeFunction::Sine { amplitude: vec![-1.0], frequency_hz: 1.0 / TAU, phase: FRAC_PI_2 };
    let mut base = hinge("base", "prismatic", &[[0.0, 1.0, 0.0]], WORLD, "beam", [0.0; 3]);
    base.motion = Some(TimeFunction::Sum(vec![TimeFunction::Constant(vec![1.0]), cosine]));
    let bodies = vec![flexible("beam", exact_beam(2))];
    let (system, state) = Definition { bodies, hinges: vec![base], ..Definition::default() }.build().unwrap();
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &state, &mut workspace).unwrap();
    let load = hinge_load(&workspace, 0);
    // differences of numbers near one: 1 - sum a^2 and 1/2 - sum a b lose up to 1 / 0.015 in relative terms
    assert_close(&[load[4]], &[0.198_623_548_908_442_056], 1e-13, "force at 0+");
    assert_close(&[load[2]], &[0.015_227_165_138_162_670_5], 1e-13, "moment at 0+");
}

#[test]
fn a_flexible_body_of_no_retained_modes_is_the_rigid_one() {
    let load = |body: BodyDefinition| {
        let mut pin = hinge("pin", "universal", &[[0.0, 1.0, 0.0], Z], WORLD, &body.name, [0.0; 3]);
        (pin.position, pin.velocity) = (vec![0.3, -0.2], vec![1.1, 0.7]);
        let gravity = nalgebra::Vector3::new(0.0, 0.0, -9.81);
        let (system, state) =
            Definition { gravity, bodies: vec![body], hinges: vec![pin], loads: vec![], closures: vec![] }.build().unwrap();
        let mut workspace = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        [workspace.acceleration.hinge.as_slice(), hinge_load(&workspace, 0).as_slice()].concat()
    };
    let bare = load(flexible("beam", exact_beam(3).with_modes(&[])));
    let rod = load(rigid("rod", 1.0, [0.5, 0.0, 0.0], [0.0, 1.0 / 12.0, 1.0 / 12.0]));
    assert_close(&bare, &rod, 64.0 * EPS, "accelerations and load");
}
