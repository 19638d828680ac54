//! Cost of an evaluation against the number of modes.

use crate::support::lumped::lumped_body_of;
use crate::support::scenes::{flexible, hinge};
use nalgebra::Vector3;
use pliant::dynamics::{Workspace, accelerations};
use pliant::model::build::{BodyDefinitionKind, Definition, WORLD};
use pliant::model::modal_body::Boundary;
use pliant::model::{InertiaOrder, State, System};
use rand::SeedableRng;
use rand::rngs::StdRng;
use std::time::Instant;

/// `count` equal cantilever bodies of `modes` modes, each hinged about y at the tip of the one before.
pub fn flexible_chain(count: usize, modes: usize, order: InertiaOrder) -> (System, State) {
    let modal = lumped_body_of(&mut StdRng::seed_from_u64(7), Boundary::Cantilever, modes, vec![0.25; 40]).modal;
    let mut definition = Definition { gravity: Vector3::new(0.0, 0.0, -9.81), ..Definition::default() };
    let mut body = flexible("b0", modal);
    for k in 0..count {
        body.name = format!("b{k}");
        if let BodyDefinitionKind::Flexible(own) = &mut body.kind {
            own.order = order;
            own.modal_position = (0..modes).map(|j| 1e-3 * (1.3 * (k * modes + j) as f64).sin()).collect();
            own.modal_velocity = (0..modes).map(|j| 0.1 * (0.7 * (k * modes + j) as f64).cos()).collect();
        }
        let parent = if k == 0 { WORLD.to_owned() } else { format!("b{}", k - 1) };
        let mut joint = hinge(&format!("h{k}"), "revolute", &[[0.0, 1.0, 0.0]], &parent, &body.name, [0.0; 3]);
        joint.parent_node = (k > 0).then(|| "tip".into());
        (joint.position, joint.velocity) = (vec![0.3 * (k as f64 + 1.0).sin()], vec![0.2 * (2.0 * k as f64 + 1.0).cos()]);
        definition.hinges.push(joint);
        definition.bodies.push(body.clone());
    }
    definition.build().unwrap()
}

/// Best time (s) of an evaluation over `rounds`.
fn time_of(system: &System, state: &State, rounds: usize) -> f64 {
    let mut workspace = Workspace::new(system);
    let calls = 200;
    let once = || {
        let start = Instant::now();
        for _ in 0..calls {
            accelerations(system, state, &mut workspace).unwrap();
        }
        start.elapsed().as_secs_f64() / f64::from(calls)
    };
    std::iter::repeat_with(once).take(rounds).fold(f64::INFINITY, f64::min)
}

/// Time (s) of a flexible body with one child: the difference of a long and a short chain, so that the tip does not count.
fn time_per_body(modes: usize, order: InertiaOrder) -> f64 {
    let (long, short) = (flexible_chain(9, modes, order), flexible_chain(5, modes, order));
    (time_of(&long.0, &long.1, 20) - time_of(&short.0, &short.1, 20)) / 4.0
}

#[test]
#[ignore = "prints times"]
fn time_per_flexible_body() {
    for modes in [6, 12, 24, 48, 96] {
        let [zeroth, first, second] =
            [InertiaOrder::Zeroth, InertiaOrder::First, InertiaOrder::Second].map(|order| time_per_body(modes, order) * 1e9);
        println!("{modes:>3} modes: {zeroth:.0} ns per body of order 0, {first:.0} of order 1, {second:.0} of order 2");
    }
}
