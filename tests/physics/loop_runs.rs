//! Loops over long times: closed to rounding, with the energy drift of the integrator and no other.

use crate::support::linkages::{closure, four_bar, rod, row_of_four_bars};
use crate::support::loops::{METHODS, held_by};
use crate::support::scenes::{G, Z, dormand_prince, hinge, rk4, run};
use nalgebra::Vector3;
use pliant::dynamics::Workspace;
use pliant::dynamics::closed_chain::drift;
use pliant::dynamics::energy::balance;
use pliant::dynamics::world::WorldFrame;
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use pliant::model::build::{Definition, WORLD};
use std::f64::consts::TAU;

/// What a long run is watched for.
struct Watch {
    /// Turns of the crank.
    periods: usize,
    /// Crank angle at the start.
    angle: f64,
    /// Total energy (J) at the start, and its largest change.
    energy: Option<f64>,
    drift: f64,
    /// Largest residuals: m or rad, and per second.
    residuals: [f64; 2],
    limit: usize,
    frames: Vec<WorldFrame>,
    measure: Workspace,
}

impl Observer for Watch {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        self.periods = ((sample.state.position[0] - self.angle).abs() / TAU) as usize;
        let energy = balance(sample.system, sample.state, sample.workspace, &mut self.frames).0.total();
        self.drift = self.drift.max((energy - *self.energy.get_or_insert(energy)).abs());
        let found = drift::measure(sample.system, sample.state, &mut self.measure);
        self.residuals = [self.residuals[0].max(found.position), self.residuals[1].max(found.rate)];
        if self.periods >= self.limit { Flow::Stop } else { Flow::Continue }
    }
}

fn watched(method: &str, by: Method, periods: usize) -> (Watch, f64, u64) {
    let (system, start) = four_bar('D', method);
    let mut watch = Watch {
        periods: 0,
        angle: start.position[0],
        energy: None,
        drift: 0.0,
        residuals: [0.0; 2],
        limit: periods,
        frames: vec![WorldFrame::default(); system.bodies.len()],
        measure: Workspace::new(&system),
    };
    // a turn takes about a second
    let settings = Settings { duration: 4.0 * periods as f64, method: by, rate_hz: 13.0 };
    let summary = simulate(&system, &start, &settings, &mut [&mut watch]);
    assert_eq!((summary.outcome, watch.periods), (Outcome::Stopped, periods));
    (watch, summary.time, summary.steps)
}

fn runs_long(method: &str, allowed: f64) {
    let run = |by: Method, periods| {
        let (watch, time, steps) = watched(method, by, periods);
        println!(
            "{method}, {}: {periods} turns, {time:.0} s, {steps} steps; residuals {:?}, energy off by {:e} J",
            by.name(),
            watch.residuals,
            watch.drift
        );
        watch
    };
    let (long, short) = (run(dormand_prince(1e-6), 10_000), run(dormand_prince(1e-6), 1_000));
    assert!(long.residuals[0] < allowed && long.residuals[1] < allowed, "{:?}", long.residuals);
    // the integrator's drift and no other: steady in time, and for rk4 of the order h^5
    let growth = long.drift / short.drift;
    let gain = run(rk4(8e-3), 200).drift / run(rk4(4e-3), 200).drift;
    assert!(growth > 5.0 && growth < 20.0 && gain > 20.0 && gain < 50.0, "growth {growth}, gain {gain}");
}

#[test]
fn cut_four_bar_stays_closed_over_ten_thousand_turns_with_the_energy_drift_of_the_integrator() {
    runs_long("tree_augmented", 1e-8);
}

#[test]
fn embedded_four_bar_stays_closed_over_ten_thousand_turns_with_the_energy_drift_of_the_integrator() {
    runs_long("constraint_embedding", 1e-10);
}

/// C01: rods side by side pass the horizontal, where all loops lose rank at once, when the closed solution says.
#[test]
fn published_rows_of_four_bars_lie_flat_at_their_time() {
    for (count, expected) in [(2, 0.714_355_529_292_960_5), (40, 0.721_581_024_825_656_8)] {
        for method in METHODS {
            let (system, start) = row_of_four_bars(count, method);
            let first = system.hinge_index("foot0").unwrap();
            let (q, v) = (system.bodies[first].position, system.bodies[first].velocity);
            // closest sample before and after, each carried to the horizontal by its rate and acceleration
            let mut passages = Vec::new();
            run(&system, &start, dormand_prince(1e-9), expected + 0.05, 200.0, |s| {
                let (angle, rate, change) = (s.state.position[q], s.state.velocity[v], s.workspace.acceleration.hinge[v]);
                if angle.abs() < 0.1 {
                    // 0 = angle + rate t + change t^2 / 2
                    let t = -2.0 * angle / (rate - (rate * rate - 2.0 * change * angle).sqrt());
                    passages.push((angle.abs(), s.state.time + t));
                }
            });
            let nearest = passages.iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            let through = passages.iter().any(|p| p.1 < expected + 1e-3);
            println!(
                "{count} four-bars, {method}: flat at {} s, off by {:e}, from {:e} rad away",
                nearest.1,
                nearest.1 - expected,
                nearest.0
            );
            // the cubic term left out: less than (5 ms)^3 times a jerk of some hundred
            assert!(through && (nearest.1 - expected).abs() < 1e-6, "{method}: {} against {expected}", nearest.1);
        }
    }
}

/// Three rods stretched to their full length: a structure that cannot move to first order, at its only state. No integrator hangs on it.
#[test]
fn stretched_chain_ends_with_a_result_or_a_message() {
    let rosenbrock_w = Method::RosenbrockW { tolerance: Tolerance { relative: 1e-6, absolute: 1e-6 }, largest_step: f64::INFINITY };
    for (method, by) in METHODS.into_iter().flat_map(|m| [rosenbrock_w, dormand_prince(1e-6), rk4(1e-3)].map(|by| (m, by))) {
        let mut last = hinge("D", "revolute", &[Z], WORLD, "rod2", [3.0, 0.0, 0.0]);
        last.position = vec![std::f64::consts::PI];
        let hinges = vec![
            hinge("A", "revolute", &[Z], WORLD, "rod0", [0.0; 3]),
            hinge("B", "revolute", &[Z], "rod0", "rod1", [1.0, 0.0, 0.0]),
            last,
        ];
        let bodies = (0..3).map(|i| rod(&format!("rod{i}"), 1.0)).collect();
        let closures = vec![closure("C", "revolute", &[Z], "rod1", [1.0, 0.0, 0.0], "rod2", [1.0, 0.0, 0.0])];
        let definition = Definition { gravity: Vector3::new(0.0, -G, 0.0), bodies, hinges, closures, ..Definition::default() };
        let (system, state) = held_by(method, definition).build().unwrap();
        let summary = simulate(&system, &state, &Settings { duration: 0.2, method: by, rate_hz: 10.0 }, &mut []);
        println!("stretched chain, {method}, {}: {:?} after {} steps", by.name(), summary.outcome, summary.steps);
        let Outcome::Failed(failure) = summary.outcome else { continue };
        assert!(!failure.to_string().is_empty());
    }
}

/// C01: at each change point another rod must carry the others, so that the independent coordinate changes hands during the run.
#[test]
fn independent_coordinates_are_chosen_again_where_they_grow_ill() {
    let (system, start) = row_of_four_bars(2, "constraint_embedding");
    let mut chosen = std::collections::BTreeSet::new();
    let mut ratio = f64::INFINITY;
    run(&system, &start, rk4(1e-3), 3.0, 100.0, |s| {
        let embedding = &s.workspace.pose.embeddings[0];
        ratio = ratio.min(embedding.pivot_ratio);
        chosen.insert(embedding.independent.clone());
    });
    println!("independent coordinates {chosen:?}, smallest pivot ratio {ratio}");
    // chosen again below a tenth
    assert!(chosen.len() > 1 && ratio >= 0.1, "{chosen:?}, {ratio}");
}
