//! Cost of both methods for loops: against the number of loops, their size, and modes inside.

use crate::support::linkages::{closure, rod};
use crate::support::loops::{METHODS, close_here, held_by};
use crate::support::lumped::lumped_body;
use crate::support::scenes::{G, Z, flexible, hinge, rk4};
use nalgebra::Vector3;
use pliant::dynamics::closed_chain::assembly;
use pliant::integrate::{Outcome, Settings, simulate};
use pliant::model::build::{Definition, WORLD};
use pliant::model::modal_body::Boundary;
use rand::SeedableRng;
use rand::rngs::StdRng;
use std::time::Instant;

/// Best time of a step of rk4 (s), everything that keeps the loops closed included, by each method in turn.
fn time_per_step(definition: &Definition, steps: usize) -> [f64; 2] {
    let mut best = [f64::INFINITY; 2];
    for _ in 0..5 {
        for (best, method) in best.iter_mut().zip(METHODS) {
            let (system, mut state) = held_by(method, definition.clone()).build().unwrap();
            assembly::assemble(&system, &mut state).unwrap();
            let settings = Settings { duration: steps as f64 * 1e-4, method: rk4(1e-4), rate_hz: 1e-3 };
            let start = Instant::now();
            let summary = simulate(&system, &state, &settings, &mut []);
            let taken = start.elapsed().as_secs_f64() / summary.steps as f64;
            assert_eq!(summary.outcome, Outcome::Completed, "{method}");
            *best = best.min(taken);
        }
    }
    best
}

/// `count` crank-rockers one on the other: each hangs on the coupler of the one before.
fn tower(count: usize) -> Definition {
    let mut definition = Definition { gravity: Vector3::new(0.0, -G, 0.0), ..Definition::default() };
    let (mut base, mut at) = (WORLD.to_owned(), [0.0; 3]);
    for i in 0..count {
        let name = |part: &str| format!("{part}{i}");
        let angle = |mut h: pliant::model::build::HingeDefinition, q: f64| {
            (h.position, h.velocity) = (vec![q], vec![0.0]);
            h
        };
        definition.bodies.extend([rod(&name("crank"), 0.5), rod(&name("coupler"), 1.0), rod(&name("rocker"), 0.8)]);
        definition.hinges.extend([
            angle(hinge(&name("a"), "revolute", &[Z], &base, &name("crank"), at), 1.1),
            angle(hinge(&name("b"), "revolute", &[Z], &name("crank"), &name("coupler"), [0.5, 0.0, 0.0]), -0.8),
            angle(hinge(&name("d"), "revolute", &[Z], &base, &name("rocker"), [at[0] + 1.0, at[1], 0.0]), 1.3),
        ]);
        definition.closures.push(closure(
            &name("c"),
            "spherical",
            &[],
            &name("coupler"),
            [1.0, 0.0, 0.0],
            &name("rocker"),
            [0.8, 0.0, 0.0],
        ));
        (base, at) = (name("coupler"), [0.1, 0.05, 0.0]);
    }
    definition
}

/// A ring of `count` links on spherical and revolute hinges, pinned to the world at both ends.
fn ring(count: usize) -> Definition {
    let mut definition = Definition { gravity: Vector3::new(0.0, -G, 0.0), ..Definition::default() };
    for i in 0..count {
        let (parent, at) = if i == 0 { (WORLD.into(), [0.0; 3]) } else { (format!("rod{}", i - 1), [0.5, 0.0, 0.0]) };
        definition.bodies.push(rod(&format!("rod{i}"), 0.5));
        let mut h = hinge(&format!("h{i}"), "revolute", &[Z], &parent, &format!("rod{i}"), at);
        h.position = vec![if i == 0 { 1.2 } else { -2.0 / count as f64 }];
        definition.hinges.push(h);
    }
    definition.closures.push(closure("end", "spherical", &[], WORLD, [0.0; 3], &format!("rod{}", count - 1), [0.5, 0.0, 0.0]));
    let closure = definition.closures.last_mut().unwrap();
    // the frame on the world is moved: the ring closes where its last link ends
    std::mem::swap(&mut closure.a, &mut closure.b);
    std::mem::swap(&mut closure.frame_a, &mut closure.frame_b);
    close_here(&mut definition);
    definition
}

/// A four-bar whose coupler has `modes` modes and closes on its tip.
fn flexible_loop(modes: usize) -> Definition {
    let rng = &mut StdRng::seed_from_u64(7);
    let mut coupler = flexible("coupler", lumped_body(rng, Boundary::Cantilever, modes).modal);
    coupler.name = "coupler".into();
    let mut on = hinge("b", "revolute", &[Z], "crank", "coupler", [0.5, 0.0, 0.0]);
    on.position = vec![-0.8];
    let mut crank = hinge("a", "revolute", &[Z], WORLD, "crank", [0.0; 3]);
    crank.position = vec![1.0];
    let rocker = hinge("d", "spherical", &[], WORLD, "rocker", [1.0, 0.0, 0.0]);
    let mut closing = closure("c", "spherical", &[], "coupler", [0.0; 3], "rocker", [0.8, 0.0, 0.0]);
    closing.node_a = Some("tip".into());
    let mut definition = Definition {
        gravity: Vector3::new(0.0, -G, 0.0),
        bodies: vec![rod("crank", 0.5), coupler, rod("rocker", 0.8)],
        hinges: vec![crank, on, rocker],
        closures: vec![closing],
        ..Definition::default()
    };
    // the rocker's slim rod needs inertia about its own axis on a ball
    if let pliant::model::build::BodyDefinitionKind::Rigid { inertia, .. } = &mut definition.bodies[2].kind {
        inertia[(0, 0)] = 1e-3;
    }
    close_here(&mut definition);
    definition
}

#[test]
fn embedding_costs_with_the_size_of_a_loop_and_cutting_with_their_number() {
    let show = |what: &str, times: [f64; 2]| println!("loop cost: {what}: {:.2} us cut, {:.2} us embedded", times[0] * 1e6, times[1] * 1e6);
    let mut towers = Vec::new();
    for count in [1, 2, 4, 8, 16, 32] {
        towers.push(time_per_step(&tower(count), 400 / count));
        show(&format!("{count} four-bars one on the other"), towers[towers.len() - 1]);
    }
    for count in [3, 6, 12, 24, 48] {
        show(&format!("one ring of {count} links"), time_per_step(&ring(count), 1200 / count));
    }
    for modes in [4, 8, 16, 32, 64] {
        show(&format!("one loop with {modes} modes inside"), time_per_step(&flexible_loop(modes), 400));
    }
    // 32 loops: aggregates that stay apart grow linearly, multipliers towards the cube; measured in turn, so that a busy machine slows both
    let ratio = |i: usize| towers[i][1] / towers[i][0];
    assert!(ratio(5) < 0.5 && ratio(5) < 0.5 * ratio(0), "{:?}", [ratio(0), ratio(5)]);
}
