//! Frequencies from 1e-3 to 1e6 Hz in one body (S10 to S12), and hinge springs of 1e12.

use crate::row::{EPS, Row, assert_rows, componentwise};
use crate::support::scenes::{Z, difference, dormand_prince, exact_beam, flexible, hinge, rods, run};
use nalgebra::{DMatrix, Matrix3, Vector3};
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::model::build::{BodyDefinitionKind, Definition, WORLD};
use pliant::model::{InertiaOrder, State, System, TimeFunction};
use std::f64::consts::TAU;

const fn rosenbrock_w(tolerance: f64) -> Method {
    Method::RosenbrockW { tolerance: Tolerance { relative: tolerance, absolute: tolerance }, largest_step: f64::INFINITY }
}

/// One body (J = 1 about its hinge) with modes of the given frequencies, each coupled to the hinge by `coupling`; linear.
fn coupled(frequency_hz: Vec<f64>, coupling: f64, damping_ratio: f64) -> (System, State) {
    let n = frequency_hz.len();
    let mut modal = exact_beam(n);
    let about_z = Matrix3::from_fn(|i, j| if (i, j) == (0, 1) { coupling } else { 0.0 });
    modal.center_of_mass = Vector3::zeros();
    modal.inertia = Matrix3::identity();
    (modal.momentum, modal.first_moment) = (vec![Vector3::zeros(); n], vec![about_z; n]);
    (modal.frequency_hz, modal.damping_ratio) = (frequency_hz, vec![damping_ratio; n]);
    let mut body = flexible("body", modal);
    if let BodyDefinitionKind::Flexible(f) = &mut body.kind {
        f.order = InertiaOrder::Zeroth;
    }
    let mut base = hinge("base", "revolute", &[Z], WORLD, "body", [0.0; 3]);
    base.torque = Some(TimeFunction::Constant(vec![1.0]));
    Definition { gravity: Vector3::zeros(), bodies: vec![body], hinges: vec![base], loads: vec![], closures: vec![] }.build().unwrap()
}

fn ten_frequencies() -> Vec<f64> {
    (0..10).map(|i| 10.0_f64.powi(i - 3)).collect()
}

/// S10: closed form; ten modes, each displaced by the same elastic force, so that theta'' = (1 + 0.01 delta) / J_eff.
#[test]
fn ten_modes_cost_only_the_digits_of_what_inertia_is_left() {
    let rows = [
        (0.3, 0.1, 10.03),
        (0.316_227_607_902_915_4, 1e-6, 1_003_162.276_079_029_2),
        (((1.0 - 1e-12_f64) / 10.0).sqrt(), 1e-12, 1_003_162_277_660.166_8),
    ]
    .map(|(coupling, inertia, expected)| {
        let (system, mut state) = coupled(ten_frequencies(), coupling, 0.0);
        state.modal_position = ten_frequencies().iter().map(|f| 1e-3 / (TAU * f).powi(2)).collect();
        let mut workspace = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        let off = componentwise(&workspace.acceleration.hinge[..1], &[expected]);
        let quantity = format!("modes of 1e-3 to 1e6 Hz, {inertia:.0e} of the inertia left: hinge acceleration");
        Row::at_most("S10", quantity, off, 4.0 * EPS / inertia, "4 eps J / J_eff")
    });
    assert_rows(&rows);
}

/// S11: a pulse of one second on modes from 1e-3 to 1e5 Hz; matrix exponential in high precision. RK4 would need 2.3e6 steps.
#[test]
fn a_stiff_transient_is_met_in_few_steps() {
    let (mut system, start) = coupled([1e-3, 1e-1, 1e1, 1e3, 1e5].to_vec(), 0.05_f64.sqrt(), 0.005);
    let method = rosenbrock_w(1e-8);
    let pulse = run(&system, &start, method, 1.0, 1.0, |_| {});
    system.bodies[0].hinge.torque = None;
    let rest = run(&system, &pulse.end, method, 9.0, 1.0, |_| {});
    let steps = pulse.steps + pulse.rejected + rest.steps + rest.rejected;
    let rest_of = |state: &State, duration| run(&system, state, method, duration, 1.0, |_| {});
    let late = rest_of(&rest.end, 90.0);
    let angle = componentwise(&rest.end.position[..1], &[9.986_558_575_223_235_89]);
    let rate = componentwise(&rest.end.velocity[..1], &[1.107_606_976_319_479]);
    // the modes of 1e-3, 0.1 and 10 Hz; those of 1e3 and 1e5 Hz are at 1e-14 and not resolved
    let modes = difference(&rest.end.modal_position[..3], &[-2.231_051_572_84, 0.055_091_491_129_6, 3.983_298_149_55e-6]);
    let end = componentwise(&late.end.position[..1], &[104.432_019_933_835_2]);
    println!("{:?} {:?} {:?}, {} more steps", rest.end.position, rest.end.velocity, rest.end.modal_position, late.steps);
    assert_rows(&[
        Row::at_most("S11", "pulse on modes of 1e-3 to 1e5 Hz, t = 10 s: angle", angle, 1e-6, ""),
        Row::at_most("S11", "the same: rate", rate, 1e-6, ""),
        Row::at_most("S11", "the same: modal coordinates", modes, 1e-6, ""),
        Row::at_most("S11", "the same: steps", steps as f64, 2e4, "RK4: 2.3e6"),
        Row::at_most("S11", "the same, t = 100 s: angle", end, 1e-6, ""),
    ]);
}

/// Eigenvalues of a graded symmetric positive definite matrix, ascending, each to its own digits: Jacobi rotations until every entry is
/// rounding beside the diagonal entries of its row and column.
fn graded_eigenvalues(mut a: DMatrix<f64>) -> Vec<f64> {
    let n = a.nrows();
    for _ in 0..100 {
        let mut turned = false;
        for p in 0..n {
            for q in p + 1..n {
                if a[(p, q)].abs() <= EPS * (a[(p, p)] * a[(q, q)]).sqrt() {
                    continue;
                }
                turned = true;
                let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
                let t = 1.0_f64.copysign(theta) / (theta.abs() + theta.hypot(1.0));
                let (c, tangent) = (1.0 / t.hypot(1.0), t);
                let s = tangent * c;
                let change = tangent * a[(p, q)];
                let (app, aqq) = (a[(p, p)] - change, a[(q, q)] + change);
                for k in 0..n {
                    let (x, y) = (a[(p, k)], a[(q, k)]);
                    (a[(p, k)], a[(q, k)]) = (c * x - s * y, s * x + c * y);
                    (a[(k, p)], a[(k, q)]) = (a[(p, k)], a[(q, k)]);
                }
                (a[(p, p)], a[(q, q)], a[(p, q)], a[(q, p)]) = (app, aqq, 0.0, 0.0);
            }
        }
        if !turned {
            break;
        }
    }
    let mut values: Vec<f64> = a.diagonal().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    values
}

/// S12: frequencies of the ten modes with their hinge free: roots `lambda = omega^2` of `1 + lambda delta^2 sum 1 / (omega_k^2 - lambda) = 0`,
/// one above each `omega_k^2` (`tests/data/stability_references.py`).
#[test]
fn coupled_frequencies_keep_their_digits() {
    let (mut system, mut state) = coupled(ten_frequencies(), 0.3, 0.0);
    system.bodies[0].hinge.torque = None;
    let mut workspace = Workspace::new(&system);
    let omega: Vec<f64> = ten_frequencies().iter().map(|f| TAU * f).collect();
    let mut matrix = DMatrix::zeros(10, 10);
    for k in 0..10 {
        // a unit elastic force on mode k gives column k of the inverse modal mass
        state.modal_position = vec![0.0; 10];
        state.modal_position[k] = -1.0 / (omega[k] * omega[k]);
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        for j in 0..10 {
            matrix[(j, k)] = omega[j] * omega[k] * workspace.acceleration.modal[j];
        }
    }
    let found: Vec<f64> = graded_eigenvalues((&matrix + matrix.transpose()) * 0.5).iter().map(|x| x.sqrt() / TAU).collect();
    let expected = [
        0.001_048_232_542_549_234_930_8,
        0.010_534_368_091_419_235_800_9,
        0.105_983_544_677_476_157_993_8,
        1.067_975_305_722_691_256_606_9,
        10.786_808_974_664_164_092_8,
        109.339_407_749_010_414_011,
        1_114.888_379_605_024_123_61,
        11_492.733_452_201_383_630_9,
        121_321.447_545_128_543_658,
        1_379_978.147_503_270_516_02,
    ];
    let off = componentwise(&found, &expected);
    assert_rows(&[Row::at_most("S12", "modes of 1e-3 to 1e6 Hz on a free hinge: all ten coupled frequencies, each", off, 1e-9, "")]);
}

#[test]
fn energy_of_a_mode_that_is_not_resolved_only_falls() {
    let (mut system, mut start) = coupled([0.1, 1e4].to_vec(), 0.3, 0.0);
    system.bodies[0].hinge.torque = None;
    let omega: Vec<f64> = [0.1, 1e4].iter().map(|f| TAU * f).collect();
    start.modal_position = vec![1.0 / omega[0], 1.0 / omega[1]];
    let mut energies = Vec::new();
    run(&system, &start, rosenbrock_w(1e-4), 20.0, 10.0, |s| {
        let (v, e) = (s.state.velocity[0], &s.state.modal_velocity);
        let elastic: f64 = omega.iter().zip(&s.state.modal_position).map(|(w, x)| 0.5 * (w * x).powi(2)).sum();
        energies.push(0.5 * (v * v + e[0] * e[0] + e[1] * e[1]) + 0.3 * v * (e[0] + e[1]) + elastic);
    });
    let rise = energies.windows(2).map(|e| e[1] / e[0] - 1.0).fold(0.0, f64::max);
    // half of the energy is in the mode of 1e4 Hz: followed while it is large, damped by then; the slow mode, which is resolved, loses
    // 0.2 % in two periods at this tolerance
    assert!((energies[0] - 1.0).abs() < 1e-12 && energies[20] < 0.501 && energies[200] > 0.498);
    assert_rows(&[Row::at_most(
        "S11",
        "undamped modes of 0.1 and 1e4 Hz, 20 s of rosenbrock_w: rise of energy",
        rise,
        1e-5,
        "a tenth of the tolerance",
    )]);
}

/// A spring of 1e12 N m/rad is a weld to 1e-10 rad, and costs an implicit method no steps.
#[test]
fn hinge_springs_of_1e12_are_welds() {
    let arm = |welded: bool, method| {
        let mut definition = rods(&[(1.0, 1.0), (1.0, 1.0)]);
        if welded {
            definition.hinges[0].kind = "fixed".into();
            definition.hinges[0].axes.clear();
        } else {
            definition.hinges[0].stiffness = vec![1e12];
        }
        let (system, start) = definition.build().unwrap();
        let summary = run(&system, &start, method, 1.0, 1.0, |_| {});
        let at = system.bodies[1].position;
        (vec![summary.end.position[at], summary.end.velocity[at]], summary.steps + summary.rejected)
    };
    let (exact, _) = arm(true, dormand_prince(1e-12));
    let (found, steps) = arm(false, rosenbrock_w(1e-5));
    let mut definition = rods(&[(1.0, 1.0)]);
    (definition.hinges[0].stiffness, definition.hinges[0].position) = (vec![1e12], vec![0.1]);
    definition.gravity = Vector3::zeros();
    let (system, start) = definition.build().unwrap();
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &start, &mut workspace).unwrap();
    let acceleration = componentwise(&workspace.acceleration.hinge, &[-3e11]);
    assert_rows(&[
        Row::at_most("springs", "hinge spring of 1e12 N m/rad: acceleration at 0.1 rad", acceleration, 16.0 * EPS, "16 eps"),
        Row::at_most(
            "springs",
            "rod on a rod held by such a spring, against a weld: motion after 1 s",
            difference(&found, &exact),
            1e-3,
            "tolerance 1e-5 per step, a hundred steps",
        ),
        Row::at_most("springs", "the same: steps", steps as f64, 1e4, "an explicit method: 1e6"),
    ]);
}
