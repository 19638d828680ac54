//! Links without mass or inertia, hinges whose inertia vanishes, and gimbal lock (S03 to S05).

use crate::order_8;
use crate::row::{EPS, Row, assert_rows};
use crate::support::scenes::{Z, chain, difference, dormand_prince, hinge, rigid, rk4};
use nalgebra::Vector3;
use pliant::dynamics::{DynamicsError, Workspace, forward_dynamics};
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Outcome, Settings, simulate};
use pliant::model::build::{BodyDefinition, Definition, WORLD};
use pliant::model::{State, System};
use pliant::spatial::rotation::quaternion_of_vector;
use std::f64::consts::FRAC_PI_2;

fn massless(name: &str) -> BodyDefinition {
    rigid(name, 0.0, [0.0; 3], [0.0; 3])
}

fn evaluated(system: &System, state: &State) -> Result<Workspace, DynamicsError> {
    let mut workspace = Workspace::new(system);
    forward_dynamics(system, state, &mut workspace).map(|()| workspace)
}

/// A massless link of 1 m and a bead of 1 kg on another, at the angle `q2` to the first.
fn bead_on_massless_link(q2: f64) -> (System, State) {
    let mut definition = chain(vec![massless("inner"), rigid("outer", 1.0, [1.0, 0.0, 0.0], [0.0; 3])], &[[1.0, 0.0, 0.0]; 2]);
    definition.hinges[1].position = vec![q2];
    definition.build().unwrap()
}

/// S03: `D_1 = m l^2 sin^2 q2` is physics, not error, while it is above rounding.
#[test]
fn massless_intermediate_links_are_accepted_and_their_hinge_inertia_is_right() {
    let mut rows: Vec<Row> = [1.0, 1e-2, 1e-4, 1e-6]
        .map(|q2: f64| {
            let (system, state) = bead_on_massless_link(q2);
            let (found, expected) = (evaluated(&system, &state).unwrap().inertia.bodies[0].D[0][0], q2.sin().powi(2));
            let quantity = format!("massless link, bead at {q2:.0e} rad: inertia of the inner hinge");
            Row::at_most("S03", quantity, (found / expected - 1.0).abs(), 10.0 * EPS / expected, "10 eps / sin^2 q")
        })
        .into();
    for q2 in [0.0, 1e-8] {
        let (system, state) = bead_on_massless_link(q2);
        let error = evaluated(&system, &state).err().map(|e| e.to_string());
        let quantity = format!("the same at {q2:.0e} rad, inertia below 8 eps of its terms");
        rows.push(Row::says("S03", quantity, error, &["\"h1\"", "\"inner\"", "rate 1"]));
    }
    // two massless links and a body: the middle hinge has nothing of its own
    let links = vec![massless("a"), massless("b"), rigid("bead", 1.0, [1.0, 0.0, 0.0], [0.1; 3])];
    let mut definition = chain(links, &[[1.0, 0.0, 0.0]; 3]);
    for (h, q) in definition.hinges.iter_mut().zip([0.1, 0.7, -0.9]) {
        h.position = vec![q];
    }
    let (system, state) = definition.build().unwrap();
    let found = evaluated(&system, &state).unwrap().acceleration.hinge;
    // with a thousandth of a thousandth of the mass the same chain has accelerations within 1e-6 of these
    let mut light = definition.clone();
    for (i, name) in ["a", "b"].into_iter().enumerate() {
        light.bodies[i] = rigid(name, 1e-9, [0.5, 0.0, 0.0], [1e-10; 3]);
    }
    let (system, state) = light.build().unwrap();
    let nearly = evaluated(&system, &state).unwrap().acceleration.hinge;
    rows.push(Row::at_most(
        "S03",
        "two massless links and a body, against links of 1e-9 kg: accelerations",
        difference(&found, &nearly),
        1e-6,
        "1e3 times the mass",
    ));
    assert_rows(&rows);
}

/// S04, S18: nothing at the end of a branch, no inertia about an axis, or so little that its inverse overflows.
#[test]
fn hinges_that_move_nothing_are_refused_when_the_system_is_built() {
    let ends = &[[1.0, 0.0, 0.0]; 2];
    let boom = || rigid("boom", 1.0, [0.5, 0.0, 0.0], [0.1; 3]);
    let refusal = |vane: BodyDefinition| chain(vec![boom(), vane], ends).build().err().map(|e| e.to_string());
    let words = ["\"h2\"", "\"boom\"", "\"vane\"", "rate 1", "fix or prescribe"];
    let mut rows: Vec<Row> = [
        ("massless link at the end of a chain", massless("vane")),
        ("link of 1e-310 kg at the end of a chain", rigid("vane", 1e-310, [1.0, 0.0, 0.0], [0.0; 3])),
        ("bead on its hinge's axis", rigid("vane", 1.0, [0.0, 0.0, 0.4], [0.0; 3])),
        ("rod along its hinge's axis", rigid("vane", 1.0, [0.0, 0.0, 0.4], [0.1, 0.1, 0.0])),
    ]
    .into_iter()
    .map(|(what, vane)| Row::says("S04", what, refusal(vane), &words))
    .collect();
    // several links without mass: the one nearest to what has some is to blame
    let branch = chain(vec![boom(), massless("vane"), massless("tip")], &[[1.0, 0.0, 0.0]; 3]).build().err().map(|e| e.to_string());
    rows.push(Row::says("S04", "two massless links at the end of a chain", branch, &words));
    let mut ball = hinge("ball", "spherical", &[], WORLD, "needle", [0.0; 3]);
    ball.velocity = vec![0.0, 1.0, 0.0];
    let needle =
        Definition { bodies: vec![rigid("needle", 1.0, [0.5, 0.0, 0.0], [0.0, 0.1, 0.1])], hinges: vec![ball], ..Definition::default() };
    let refused = needle.build().err().map(|e| e.to_string());
    rows.push(Row::says("S04", "needle on a spherical hinge", refused, &["\"ball\"", "\"needle\"", "rate 1"]));
    let mut legal = chain(vec![massless("inner"), boom()], ends);
    legal.hinges[1].position = vec![0.5];
    let (system, state) = legal.build().unwrap();
    let runs = evaluated(&system, &state).is_ok_and(|w| w.acceleration.hinge.iter().all(|x| x.is_finite()));
    rows.push(Row::holds("S04", "massless link that carries a body", "accepted", if runs { "accepted" } else { "refused" }, runs));
    assert_rows(&rows);
}

/// D -> 0 while it moves: a bead on a massless link swings through the line of the link.
#[test]
fn an_inertia_that_vanishes_in_a_run_ends_it_by_name_or_is_passed() {
    let (system, mut start) = bead_on_massless_link(0.5);
    start.velocity = vec![0.0, -1.0];
    let rows = [rk4(1e-3), dormand_prince(1e-8)].map(|method| {
        let summary = simulate(&system, &start, &Settings { duration: 2.0, method, rate_hz: 10.0 }, &mut []);
        let (name, finite) = (method.name(), summary.end.velocity.iter().all(|x| x.is_finite()));
        let what = format!("bead swings through the line of its massless link, {name}");
        match summary.outcome {
            Outcome::Failed(failure) => Row::says("S03", what, Some(failure.to_string()), &["\"h"]),
            _ => Row::holds("S03", what, "finite, or an error that names the hinge", "passed", finite),
        }
    });
    assert_rows(&rows);
}

const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], Z];

fn dish(kind: &str, inertia: [f64; 3], position: Vec<f64>, velocity: Vec<f64>) -> (System, State) {
    let axes = if kind == "gimbal" { &AXES[..] } else { &[] };
    let mut mount = hinge("mount", kind, axes, WORLD, "dish", [0.0; 3]);
    (mount.position, mount.velocity) = (position, velocity);
    Definition { bodies: vec![rigid("dish", 1.0, [0.0; 3], inertia)], hinges: vec![mount], ..Definition::default() }.build().unwrap()
}

/// S05: three axes in one plane.
#[test]
fn gimbal_lock_is_an_error_that_names_the_hinge() {
    let words = ["\"mount\"", "\"dish\"", "gimbal lock", "spherical"];
    let mut rows = Vec::new();
    for off in [0.0, 1e-8] {
        let (system, state) = dish("gimbal", [2.0; 3], vec![0.4, FRAC_PI_2 - off, -0.3], vec![0.1, 0.2, 0.3]);
        let error = evaluated(&system, &state).err().map(|e| e.to_string());
        rows.push(Row::says("S05", format!("gimbal {off:.0e} rad from lock: evaluation"), error, &words));
    }
    // the second angle runs into lock while the first turns: its rate grows with the inverse of the distance
    let (system, start) = dish("gimbal", [2.0, 3.0, 4.0], vec![0.4, 1.2, -0.3], vec![0.5, 1.0, 0.2]);
    let implicit = match dormand_prince(1e-8) {
        Method::DormandPrince { tolerance, largest_step } => Method::RosenbrockW { tolerance, largest_step },
        other => other,
    };
    for method in [dormand_prince(1e-8), implicit, rk4(1e-3)] {
        let started = std::time::Instant::now();
        let summary = simulate(&system, &start, &Settings { duration: 100.0, method, rate_hz: 1.0 }, &mut []);
        let what = format!("gimbal that turns near lock for 100 s: {}", method.name());
        let finite = summary.end.position.iter().chain(&summary.end.velocity).all(|x| x.is_finite());
        let quick = started.elapsed().as_secs_f64() < 20.0;
        rows.push(match summary.outcome {
            Outcome::Failed(failure) => Row::says("S05", what, Some(failure.to_string()), &words[..3]),
            _ => Row::holds("S05", what, "finite, or an error that names the hinge", "passed", finite && quick),
        });
    }
    // exactly into it: the only motion there is turns the second axis through lock
    for method in [dormand_prince(1e-8), implicit, rk4(1e-3)] {
        let (system, start) = dish("gimbal", [2.0; 3], vec![0.4, FRAC_PI_2 - 0.5, -0.3], vec![1e-3, 1.0, 1e-3]);
        let summary = simulate(&system, &start, &Settings { duration: 2.0, method, rate_hz: 1.0 }, &mut []);
        let what = format!("gimbal driven all but exactly through lock: {}", method.name());
        let finite = summary.end.position.iter().chain(&summary.end.velocity).all(|x| x.is_finite());
        rows.push(match summary.outcome {
            Outcome::Failed(failure) => Row::says("S05", what, Some(failure.to_string()), &words[..3]),
            _ => Row::holds("S05", what, "finite, or an error that names the hinge", "passed", finite),
        });
    }
    assert_rows(&rows);
}

/// S05: with the angle q between its outer axes' planes, a gimbal's inertia has the determinant `a b c cos^2 q`.
#[test]
fn inertia_of_a_gimbal_falls_with_the_square_of_the_cosine() {
    let rows = [1.2, 0.1, 1e-3, 1e-5].map(|off: f64| {
        let (system, state) = dish("gimbal", [2.0, 3.0, 4.0], vec![0.4, FRAC_PI_2 - off, -0.3], vec![0.0; 3]);
        let pivots = evaluated(&system, &state).unwrap().inertia.bodies[0].D;
        // the cosine of the angle that the state holds
        let cosine = state.position[1].cos();
        let found = (0..3).map(|i| pivots[i][i]).product::<f64>() / (24.0 * cosine * cosine);
        let what = format!("gimbal {off:.0e} rad from lock: determinant of its inertia");
        Row::at_most("S05", what, (found - 1.0).abs(), 20.0 * EPS / (cosine * cosine), "20 eps / cos^2 q")
    });
    assert_rows(&rows);
}

/// A spring that settles in the lock itself: whatever the method, the run ends there and says where.
#[test]
fn a_run_into_gimbal_lock_names_the_hinge() {
    let mut mount = hinge("mount", "gimbal", &AXES, WORLD, "dish", [0.0; 3]);
    (mount.position, mount.velocity) = (vec![0.4, 0.9, -0.3], vec![0.0; 3]);
    (mount.stiffness, mount.damping, mount.rest) = (vec![0.0, 50.0, 0.0], vec![0.0, 20.0, 0.0], vec![0.0, FRAC_PI_2, 0.0]);
    let dish = rigid("dish", 1.0, [0.0; 3], [2.0; 3]);
    let (system, start) = Definition { bodies: vec![dish], hinges: vec![mount], ..Definition::default() }.build().unwrap();
    let tolerance = Tolerance { relative: 1e-8, absolute: 1e-8 };
    let rows = [dormand_prince(1e-8), Method::RosenbrockW { tolerance, largest_step: f64::INFINITY }, rk4(1e-3)].map(|method| {
        let started = std::time::Instant::now();
        let summary = simulate(&system, &start, &Settings { duration: 100.0, method, rate_hz: 1.0 }, &mut []);
        println!("{}: {} s, {:?}, {} steps in {:?}", method.name(), summary.time, summary.end.position, summary.steps, started.elapsed());
        let message = match summary.outcome {
            Outcome::Failed(failure) => Some(failure.to_string()),
            _ => None,
        };
        Row::says(
            "S05",
            format!("gimbal that a spring takes into lock: {}", method.name()),
            message,
            &["\"mount\"", "\"dish\"", "gimbal lock"],
        )
    });
    assert_rows(&rows);
}

/// S05 with R05: the angular velocity in body axes is the same from every attitude. Few fixed steps make the same error from all of them; steps
/// that an error estimate chooses differ by its rounding.
#[test]
fn a_spherical_hinge_does_not_know_gimbal_lock() {
    let expected = [-0.999_964_488_599_380_366, 0.013_077_520_413_042_319_8, 0.577_387_500_863_391_946];
    let ends = [[0.0; 3], [0.0, FRAC_PI_2, 0.0], [3.1, 0.0, 0.0], [1.0, -2.0, 1.5]].map(|attitude| {
        let position = quaternion_of_vector(&Vector3::from(attitude)).to_vec();
        let (system, start) = dish("spherical", [1.0, 2.0, 3.0], position, vec![0.01, 1.0, 0.01]);
        order_8::run(&system, &start, 50.0, 1000, 1000, |_| {}).velocity
    });
    let off = |reference: &[f64]| ends.iter().map(|end| difference(end, reference)).fold(0.0, f64::max);
    // flips multiply what was rounded before them by 100 each, the inverse of the small rates that they start from
    assert_rows(&[
        Row::at_most("S05", "Euler's top on a spherical hinge from four attitudes, 50 s: angular velocity", off(&expected), 1e-10, ""),
        Row::at_most("S05", "the same: one attitude against another", off(&ends[0]), 1e-10, ""),
    ]);
}
