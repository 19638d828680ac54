//! Planar and spatial linkages that several tests close.

use super::loops::held_by;
use super::scenes::{G, Z, hinge, rigid};
use nalgebra::{Matrix3, Vector3};
use pliant::dynamics::closed_chain::assembly;
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, Frame, HingeDefinition, WORLD};
use pliant::model::build_closure::ClosureDefinition;
use pliant::model::{State, System};

/// A closure at the points `at_a`, `at_b`.
pub fn closure(name: &str, kind: &str, axes: &[[f64; 3]], a: &str, at_a: [f64; 3], b: &str, at_b: [f64; 3]) -> ClosureDefinition {
    let frame = |x: [f64; 3]| Frame { position: Vector3::from(x), ..Frame::default() };
    ClosureDefinition {
        name: name.into(),
        kind: kind.into(),
        axes: axes.iter().map(|a| Vector3::from(*a)).collect(),
        a: a.into(),
        frame_a: frame(at_a),
        b: b.into(),
        frame_b: frame(at_b),
        ..ClosureDefinition::default()
    }
}

/// Uniform rod along x.
pub fn rod(name: &str, length: f64) -> BodyDefinition {
    let j = length.powi(3) / 12.0;
    rigid(name, length, [0.5 * length, 0.0, 0.0], [0.0, j, j])
}

pub const CRANK: f64 = 0.5;
pub const COUPLER: f64 = 1.75;
pub const ROCKER: f64 = 1.5;

/// The four-bar cut at joint `cut`: A crank-ground, B crank-coupler, C coupler-rocker, D rocker-ground. Rods from A to D along the loop,
/// the rocker from D to C.
pub fn four_bar(cut: char, method: &str) -> (System, State) {
    let bodies = vec![rod("crank", CRANK), rod("coupler", COUPLER), rod("rocker", ROCKER)];
    let ground = [2.0, 0.0, 0.0];
    let end = |l: f64| [l, 0.0, 0.0];
    let angle = |mut h: HingeDefinition, q: f64, v: f64, held: bool| {
        (h.position, h.velocity, h.held) = (vec![q], vec![v], held);
        h
    };
    let revolute = |name: &str, parent: &str, child: &str, at| hinge(name, "revolute", &[Z], parent, child, at);
    let from = |mut h: HingeDefinition, at: [f64; 3]| {
        h.child_frame.position = Vector3::from(at);
        h
    };
    let crank = angle(revolute("A", WORLD, "crank", [0.0; 3]), std::f64::consts::FRAC_PI_3, 2.0, true);
    let join = |name, a: &str, at_a, b: &str, at_b| closure(name, "revolute", &[Z], a, at_a, b, at_b);
    let (hinges, closing) = match cut {
        'D' => {
            let coupler = angle(revolute("B", "crank", "coupler", end(CRANK)), -0.7, 0.0, false);
            let rocker = angle(from(revolute("C", "coupler", "rocker", end(COUPLER)), end(ROCKER)), 1.6, 0.0, false);
            (vec![crank, coupler, rocker], join("D", WORLD, ground, "rocker", [0.0; 3]))
        }
        'C' => {
            let coupler = angle(revolute("B", "crank", "coupler", end(CRANK)), -0.7, 0.0, false);
            let rocker = angle(revolute("D", WORLD, "rocker", ground), 1.8, 0.0, false);
            (vec![crank, coupler, rocker], join("C", "coupler", end(COUPLER), "rocker", end(ROCKER)))
        }
        _ => {
            let rocker = angle(revolute("D", WORLD, "rocker", ground), 1.8, 0.0, false);
            let coupler = angle(from(revolute("C", "rocker", "coupler", end(ROCKER)), end(COUPLER)), -1.5, 0.0, false);
            (vec![crank, rocker, coupler], join("B", "crank", end(CRANK), "coupler", [0.0; 3]))
        }
    };
    let gravity = Vector3::new(0.0, -G, 0.0);
    let (system, mut state) =
        held_by(method, Definition { gravity, bodies, hinges, closures: vec![closing], ..Definition::default() }).build().unwrap();
    let done = assembly::assemble(&system, &mut state).unwrap();
    assert!(done.positions && done.rates);
    (system, state)
}

/// N four-bars side by side: rockers on the ground, couplers on the rockers, closures where a coupler meets the next rocker.
pub fn row_of_four_bars(count: usize, method: &str) -> (System, State) {
    let (mut bodies, mut hinges, mut closures) = (Vec::new(), Vec::new(), Vec::new());
    let end = [1.0, 0.0, 0.0];
    for i in 0..=count {
        bodies.push(rod(&format!("rocker{i}"), 1.0));
        let mut foot = hinge(&format!("foot{i}"), "revolute", &[Z], WORLD, &format!("rocker{i}"), [i as f64, 0.0, 0.0]);
        (foot.position, foot.velocity) = (vec![std::f64::consts::FRAC_PI_2], vec![-1.0]);
        hinges.push(foot);
    }
    for i in 0..count {
        bodies.push(rod(&format!("coupler{i}"), 1.0));
        let mut head = hinge(&format!("head{i}"), "revolute", &[Z], &format!("rocker{i}"), &format!("coupler{i}"), end);
        (head.position, head.velocity) = (vec![-std::f64::consts::FRAC_PI_2], vec![1.0]);
        hinges.push(head);
        closures.push(closure(&format!("close{i}"), "revolute", &[Z], &format!("coupler{i}"), end, &format!("rocker{}", i + 1), end));
    }
    let definition = Definition { gravity: Vector3::new(0.0, -G, 0.0), bodies, hinges, closures, ..Definition::default() };
    held_by(method, definition).build().unwrap()
}

/// Five moving rods of the Bricard linkage; the sixth side is the ground.
pub fn bricard(method: &str) -> (System, State) {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, -1.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]];
    let axes = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    let (slim, long) = (0.02 / 12.0, 1.01 / 12.0);
    let (mut bodies, mut hinges) = (Vec::new(), Vec::new());
    let mut before = Vector3::zeros();
    for i in 0..5 {
        let along = Vector3::from(points[i + 1]) - Vector3::from(points[i]);
        let inertia = Matrix3::from_diagonal_element(long) - along * along.transpose() * (long - slim);
        let kind = BodyDefinitionKind::Rigid { mass: 1.0, center_of_mass: along * 0.5, inertia };
        bodies.push(BodyDefinition { name: format!("rod{i}"), kind });
        let parent = if i == 0 { WORLD.to_owned() } else { format!("rod{}", i - 1) };
        hinges.push(hinge(&format!("P{i}"), "revolute", &[axes[i]], &parent, &format!("rod{i}"), before.into()));
        before = along;
    }
    let closures = vec![closure("P5", "revolute", &[axes[5]], WORLD, points[5], "rod4", before.into())];
    let definition = Definition { gravity: Vector3::new(0.0, -G, 0.0), bodies, hinges, closures, ..Definition::default() };
    held_by(method, definition).build().unwrap()
}
