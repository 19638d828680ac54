//! Loops that lose rank, never have it, or nearly lose it (S15), by both methods.

use crate::row::{Row, assert_rows};
use crate::support::linkages::{bricard, closure, rod, row_of_four_bars};
use crate::support::loops::{METHODS, held_by};
use crate::support::scenes::{G, Z, difference, dormand_prince, hinge, rk4, run};
use nalgebra::{DMatrix, Vector3};
use pliant::dynamics::energy::balance;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::world::{WorldFrame, world_frames};
use pliant::dynamics::{Workspace, dense, forward_dynamics};
use pliant::model::build::{Definition, WORLD};
use pliant::model::{State, System};

fn evaluated(system: &System, state: &State) -> Workspace {
    let mut workspace = Workspace::new(system);
    forward_dynamics(system, state, &mut workspace).unwrap();
    workspace
}

/// Largest opening of a closure and largest change of energy (over `size`) in a run of rk4, and the last state.
fn followed(system: &System, start: &State, step: f64, duration: f64, size: f64) -> (f64, f64, State) {
    let (mut residual, mut energies) = (0.0_f64, Vec::new());
    let mut frames = vec![WorldFrame::default(); system.bodies.len()];
    let end = run(system, start, rk4(step), duration, 50.0, |s| {
        let (energy, _) = balance(s.system, s.state, s.workspace, &mut frames);
        energies.push(energy.total());
        residual = (0..s.system.closures.len()).map(|i| s.workspace.pose.closure_residual(s.system, i)).fold(residual, f64::max);
    })
    .end;
    (residual, energies.iter().map(|e| (e - energies[0]).abs()).fold(0.0, f64::max) / size, end)
}

/// C01: through a change point every half turn, where the rank drops from N to 1 and more motions open.
#[test]
fn two_four_bars_pass_their_change_points() {
    let mut rows = Vec::new();
    let mut ends = Vec::new();
    for method in METHODS {
        let (system, start) = row_of_four_bars(2, method);
        let (residual, drift, end) = followed(&system, &start, 1e-3, 10.0, 2.0 * G);
        let first = system.hinge_index("foot0").unwrap();
        let (q, v) = (end.position[system.bodies[first].position], end.velocity[system.bodies[first].velocity]);
        let found = [q.cos(), q.sin(), -v * q.sin(), v * q.cos()];
        let expected = [0.328_458_111_540_815_4, 0.944_518_538_178_601, 1.423_051_470_206_944_1, -0.494_868_845_487_042_96];
        let what = |of: &str| format!("two four-bars through their change points, 10 s, {method}: {of}");
        rows.push(Row::at_most("S15", what("motion"), difference(&found, &expected), 1e-6, ""));
        rows.push(Row::at_most("S15", what("opening (m)"), residual, 1e-9, ""));
        rows.push(Row::at_most("S15", what("energy"), drift, 1e-7, ""));
        ends.push(found);
    }
    rows.push(Row::at_most("S15", "the same, one method against the other: motion", difference(&ends[0], &ends[1]), 1e-6, ""));
    assert_rows(&rows);
}

/// C04: one blocked direction too many at all times.
#[test]
fn bricard_linkage_moves_with_a_redundant_closure() {
    let mut rows = Vec::new();
    for method in METHODS {
        let (system, start) = bricard(method);
        let workspace = evaluated(&system, &start);
        let report = workspace.closed.as_ref().unwrap().rank_report(&system, &workspace.pose);
        let found = format!("{} of {}", report.rank, report.rows);
        let holds = (report.rank, report.rows) == (4, 5) && report.redundant == ["P5"];
        rows.push(Row::holds("S15", format!("Bricard's linkage, {method}: rank, redundant closure named"), "4 of 5", found, holds));
        let end = run(&system, &start, dormand_prince(1e-9), 1.0, 20.0, |_| {}).end;
        let workspace = evaluated(&system, &end);
        let mut frames = vec![WorldFrame::default(); 5];
        world_frames(&system, &workspace.pose, &mut frames);
        let off = difference(frames[3].position.as_slice(), &[0.510_501_46, -1.649_167_60, 0.140_123_11]);
        rows.push(Row::at_most("S15", format!("the same, {method}, after 1 s: place of P3"), off, 1e-6, ""));
        let (residual, drift, _) = followed(&system, &start, 1e-3, 1.0, 5.0 * G);
        rows.push(Row::at_most("S15", format!("the same, {method}: opening (m)"), residual, 1e-9, ""));
        rows.push(Row::at_most("S15", format!("the same, {method}: energy"), drift, 1e-6, ""));
    }
    assert_rows(&rows);
}

/// C11: reactions that equilibrium does not determine are those of least norm.
#[test]
fn bar_pinned_at_both_ends_carries_its_weight_and_no_axial_force() {
    let mut rows = Vec::new();
    for method in METHODS {
        let hinges = vec![hinge("left", "revolute", &[Z], WORLD, "bar", [0.0; 3])];
        let closures = vec![closure("right", "spherical", &[], WORLD, [2.0, 0.0, 0.0], "bar", [2.0, 0.0, 0.0])];
        let gravity = Vector3::new(0.0, -G, 0.0);
        let definition = Definition { gravity, bodies: vec![rod("bar", 2.0)], hinges, closures, ..Definition::default() };
        let (system, state) = held_by(method, definition).build().unwrap();
        let workspace = evaluated(&system, &state);
        let chain = workspace.closed.as_ref().unwrap();
        let right: Vec<f64> = workspace.closure_load(&system, 0).as_slice()[3..].to_vec();
        let left = hinge_load(&workspace, 0);
        let off = difference(&right, &[0.0, G, 0.0]).max(difference(&left.as_slice()[3..], &[0.0, G, 0.0]));
        rows.push(Row::at_most("S15", format!("bar pinned at both ends, {method}: reactions of least norm"), off, 1e-14, ""));
        let redundant = chain.rank_report(&system, &workspace.pose).redundant;
        rows.push(Row::holds(
            "S15",
            format!("the same, {method}: redundant closure"),
            "named",
            redundant.join(", "),
            redundant == ["right"],
        ));
    }
    assert_rows(&rows);
}

/// C10: crank and rocker of 1 m, coupler and ground of 2 m, all but in line.
#[test]
fn parallelogram_tells_how_near_it_is_to_its_change_point() {
    let mut rows = Vec::new();
    for method in METHODS {
        let mut figures = vec![];
        let (mut off, mut rank) = (0.0_f64, vec![]);
        for e in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6_f64] {
            let bodies = vec![rod("crank", 1.0), rod("coupler", 2.0), rod("rocker", 1.0)];
            let at = |name: &str, parent: &str, place: f64, angle: f64| {
                let mut pin = hinge(name, "revolute", &[Z], parent, name, [place, 0.0, 0.0]);
                pin.position = vec![angle];
                pin
            };
            let hinges = vec![at("crank", WORLD, 0.0, e), at("coupler", "crank", 1.0, -e), at("rocker", WORLD, 2.0, e)];
            let closing = closure("head", "revolute", &[Z], "coupler", [2.0, 0.0, 0.0], "rocker", [1.0, 0.0, 0.0]);
            let definition = Definition { bodies, hinges, closures: vec![closing], ..Definition::default() };
            let (system, state) = held_by(method, definition).build().unwrap();

            // per absolute angles of the three links, as the closed form has it
            let map = dense::equations(&system, &state).closure_map;
            let column = |name: &str| map.column(system.bodies[system.hinge_index(name).unwrap()].velocity).into_owned();
            let (crank, coupler, rocker) = (column("crank"), column("coupler"), column("rocker"));
            let absolute = DMatrix::from_columns(&[crank - &coupler, coupler, rocker]);
            let mut values: Vec<f64> = absolute.singular_values().iter().copied().collect();
            values.sort_by(|a, b| b.total_cmp(a));
            let expected = 2.0 * e.sin() / 3.0_f64.sqrt();
            let workspace = evaluated(&system, &state);
            let report = workspace.closed.as_ref().unwrap().rank_report(&system, &workspace.pose);
            // the closed form is the limit: off by e^2
            off = off.max((values[1] / expected - 1.0).abs() / (e * e + 1e-9));
            rank.push(report.rank);
            figures.push(report.smallest / values[1]);
        }
        let what = |of: &str| format!("parallelogram 1e-1 to 1e-6 rad from flat, {method}: {of}");
        rows.push(Row::at_most("S15", what("least singular value over e^2 + 1e-9"), off, 1.0, "the closed form is the limit e -> 0"));
        // in the plane two directions are blocked; the other three answer to no motion
        rows.push(Row::holds("S15", what("rank"), "2", format!("{rank:?}"), rank.iter().all(|r| *r == 2)));
        // the report measures rows in the metric of the mass and relative to the largest: proportional, to the 10 % that a warning needs
        let spread = figures.iter().map(|f| (f / figures[5] - 1.0).abs()).fold(0.0, f64::max);
        rows.push(Row::at_most("S15", what("reported distance over it"), spread, 0.1, "10 %"));
    }
    assert_rows(&rows);
}
