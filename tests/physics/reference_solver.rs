//! The linearly implicit method against an implicit solver that is not ours: the ESDIRK method of order 4(3) of diffsol, with full Newton
//! iterations on the whole Jacobian, on a hub with a sprung flexible appendage whose modes go up to 30 kHz.

use crate::support::scenes::{Z, difference, exact_beam, flexible, hinge, rigid, run};
use diffsol::{MatrixCommon, NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod};
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::integrate::Outcome;
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::model::build::{Definition, WORLD};
use pliant::model::{State, System, TimeFunction};
use std::cell::RefCell;

const FREQUENCIES_HZ: [f64; 4] = [0.8, 4.0, 500.0, 3e4];
const DURATION: f64 = 2.0;

/// A driven hub and a beam on a damped spring, planar, without quaternions: y is (q, eta, v, eta_dot).
fn hub_and_beam() -> (System, State) {
    let mut beam = exact_beam(4);
    beam.frequency_hz = FREQUENCIES_HZ.to_vec();
    beam.stiffness = None;
    beam.damping_ratio = vec![0.02; 4];
    let mut drive = hinge("drive", "revolute", &[Z], WORLD, "hub", [0.0; 3]);
    drive.torque = Some(TimeFunction::SmoothStep { from: vec![0.0], to: vec![0.4], start: 0.0, end: 0.5 });
    let mut root = hinge("root", "revolute", &[Z], "hub", "beam", [0.3, 0.0, 0.0]);
    root.stiffness = vec![40.0];
    root.damping = vec![0.3];
    let bodies = vec![rigid("hub", 2.0, [0.0; 3], [1.0, 1.0, 2.0]), flexible("beam", beam)];
    Definition { bodies, hinges: vec![drive, root], ..Definition::default() }.build().unwrap()
}

/// y as one list, and back.
fn state_of(system: &System, time: f64, y: &[f64]) -> State {
    let (n, m) = (system.velocity_count, system.modal_count);
    State {
        time,
        position: y[..n].to_vec(),
        modal_position: y[n..n + m].to_vec(),
        velocity: y[n + m..2 * n + m].to_vec(),
        modal_velocity: y[2 * n + m..].to_vec(),
    }
}

fn list_of(state: &State) -> Vec<f64> {
    [&state.position, &state.modal_position, &state.velocity, &state.modal_velocity].into_iter().flatten().copied().collect()
}

/// The end by diffsol at a relative tolerance.
fn by_diffsol(system: &System, start: &State, tolerance: f64) -> Vec<f64> {
    let workspace = RefCell::new(Workspace::new(system));
    let (n, m) = (system.velocity_count, system.modal_count);
    let rate = |y: &[f64], time: f64, out: &mut [f64]| {
        let mut workspace = workspace.borrow_mut();
        forward_dynamics(system, &state_of(system, time, y), &mut workspace).unwrap();
        out[..n + m].copy_from_slice(&y[n + m..]);
        out[n + m..2 * n + m].copy_from_slice(&workspace.acceleration.hinge);
        out[2 * n + m..].copy_from_slice(&workspace.acceleration.modal);
    };
    let size = 2 * (n + m);
    let along = |y: &[f64], time: f64, v: &[f64], out: &mut [f64]| {
        // what is stiff is linear, so that the difference is exact for it
        let epsilon = 1e-6;
        let side = |sign: f64| {
            let moved: Vec<f64> = y.iter().zip(v).map(|(y, v)| y + sign * epsilon * v).collect();
            let mut rates = vec![0.0; size];
            rate(&moved, time, &mut rates);
            rates
        };
        let (above, below) = (side(1.0), side(-1.0));
        out.iter_mut().zip(above.iter().zip(below)).for_each(|(o, (a, b))| *o = (a - b) / (2.0 * epsilon));
    };
    let initial = list_of(start);
    let problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tolerance)
        .atol([1e-3 * tolerance])
        .rhs_implicit(|y, _p, t, out| rate(y, t, out), |y, _p, t, v, out| along(y, t, v, out))
        .init(|_p, _t, y| y.copy_from_slice(&initial), size)
        .build()
        .unwrap();
    let mut solver = problem.esdirk34::<NalgebraLU<f64>>().unwrap();
    let (ys, _) = solver.solve_dense(&[DURATION]).unwrap();
    ys.inner().column(0).iter().copied().collect()
}

#[test]
fn an_independent_implicit_solver_finds_the_same_motion() {
    let (system, start) = hub_and_beam();
    let reference = by_diffsol(&system, &start, 1e-9);
    let coarser = by_diffsol(&system, &start, 1e-8);
    let trust = difference(&coarser, &reference);
    assert!(trust < 1e-6, "{trust:e}");
    let mut last = f64::INFINITY;
    for (tolerance, most_steps) in [(1e-4, 2_000), (1e-6, 8_000), (1e-8, 40_000)] {
        let method =
            Method::RosenbrockW { tolerance: Tolerance { relative: tolerance, absolute: 1e-3 * tolerance }, largest_step: f64::INFINITY };
        let done = run(&system, &start, method, DURATION, 1.0, |_| {});
        assert_eq!(done.outcome, Outcome::Completed);
        let error = difference(&list_of(&done.end), &reference);
        println!("rosenbrock_w at {tolerance:e}: {} steps, {error:.1e} from diffsol, which is good to {trust:.1e}", done.steps);
        // local errors of the tolerance's size add up over some hundred periods' worth of steps
        assert!(error < 100.0 * tolerance + trust, "{tolerance:e}: {error:e}");
        assert!(error < 0.3 * last && done.steps < most_steps);
        last = error;
    }
}
