//! Random loops: random trees with closures that close at the present pose by construction.

use super::lumped::vector;
use super::trees::{Recipe, random_tree};
use nalgebra::Vector3;
use pliant::dynamics::frame_motion::FramePose;
use pliant::dynamics::sweep::pose_outward::{PoseScratch, pose_outward};
use pliant::dynamics::world::{WorldFrame, world_frames};
use pliant::model::build::{BodyDefinitionKind, Definition, Frame, WORLD};
use pliant::model::build_closure::ClosureDefinition;
use pliant::model::{ClosureJoint, ClosureSide, State, System};
use pliant::spatial::rotation;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

/// Every method that holds closures, by the name that scenes use: tests of loops run with each.
pub const METHODS: [&str; 2] = ["tree_augmented", "constraint_embedding"];

/// The same system with all its closures held by `method`.
pub fn held_by(method: &str, mut definition: Definition) -> Definition {
    definition.closures.iter_mut().for_each(|c| c.method = Some(method.into()));
    definition
}

/// Kinds with their number of axes.
pub const CLOSURES: [(&str, usize); 7] =
    [("fixed", 0), ("revolute", 1), ("universal", 2), ("spherical", 0), ("cylindrical", 1), ("prismatic", 1), ("planar", 1)];

/// World pose of one side of a closure.
fn side_pose(system: &System, state: &State, frames: &[WorldFrame], side: &ClosureSide) -> WorldFrame {
    let body = side.body.map_or_else(WorldFrame::default, |k| frames[k]);
    let eta = side.body.map_or(&[][..], |k| &state.modal_position[system.bodies[k].modal_range()]);
    let own = FramePose::of(&side.attachment, eta);
    WorldFrame { rotation: body.rotation * own.rotation, position: body.position + body.rotation * own.position }
}

/// Moves frame b of every closure onto frame a at the initial state.
pub fn close_here(definition: &mut Definition) {
    let (system, state) = definition.build().unwrap();
    let mut pose = PoseScratch::new(&system);
    pose_outward(&system, &state, &mut pose);
    let mut frames = vec![WorldFrame::default(); system.bodies.len()];
    world_frames(&system, &pose, &mut frames);
    for (closure, given) in system.closures.iter().zip(&mut definition.closures) {
        let ClosureJoint::Frames { a, b, .. } = &closure.joint else { continue };
        let (target, from) = (side_pose(&system, &state, &frames, a), side_pose(&system, &state, &frames, b));
        given.frame_b = Frame {
            position: from.rotation.tr_mul(&(target.position - from.position)),
            quaternion: rotation::quaternion_of_matrix(&(from.rotation.transpose() * target.rotation)),
        };
    }
}

/// A random tree with `count` random closures; every seventh side is the world.
pub fn random_loops(seed: u64, recipe: &Recipe, count: usize) -> Definition {
    let mut definition = random_tree(seed, recipe);
    let rng = &mut StdRng::seed_from_u64(seed ^ 0x5eed);
    for i in 0..count {
        let (kind, axes) = CLOSURES[(seed as usize + i) % CLOSURES.len()];
        let a = if rng.random_range(0..7) == 0 { None } else { Some(rng.random_range(0..recipe.bodies)) };
        let b = loop {
            let b = rng.random_range(0..recipe.bodies);
            if Some(b) != a {
                break b;
            }
        };
        let name = |k: Option<usize>| k.map_or(WORLD.to_owned(), |k| format!("b{k}"));
        let node = |k: Option<usize>, node: &str| {
            k.filter(|&k| matches!(definition.bodies[k].kind, BodyDefinitionKind::Flexible(_))).map(|_| node.to_owned())
        };
        let frame_a = Frame { position: vector(rng, 0.5), quaternion: rotation::quaternion_of_vector(&vector(rng, 1.0)) };
        let closure = ClosureDefinition {
            name: format!("c{i}"),
            kind: kind.into(),
            axes: (0..axes).map(|_| vector(rng, 1.0)).collect::<Vec<Vector3<f64>>>(),
            a: name(a),
            node_a: node(a, "mid"),
            frame_a,
            b: name(Some(b)),
            node_b: node(Some(b), "tip"),
            ..ClosureDefinition::default()
        };
        definition.closures.push(closure);
    }
    close_here(&mut definition);
    definition
}

/// Adds `count` gears between random coordinates, closed at the initial state: between branches, along a chain, within one hinge.
pub fn add_gears(definition: &mut Definition, seed: u64, count: usize) {
    let rng = &mut StdRng::seed_from_u64(seed ^ 0x9ea5);
    let (system, state) = definition.build().unwrap();
    let plain = system.bodies.iter().filter(|b| !b.hinge.kind.has_quaternion());
    let coordinates: Vec<_> =
        plain.flat_map(|b| (0..b.hinge.kind.rate_count()).map(|i| (b.hinge.name.clone(), i, state.position[b.position + i]))).collect();
    if coordinates.len() < 2 {
        return;
    }
    for g in 0..count {
        let a = rng.random_range(0..coordinates.len());
        let b = (a + rng.random_range(1..coordinates.len())) % coordinates.len();
        let ratio: f64 = rng.random_range(0.3..3.0);
        let [(hinge_a, i, qa), (hinge_b, j, qb)] = [&coordinates[a], &coordinates[b]];
        definition.closures.push(ClosureDefinition {
            name: format!("g{g}"),
            kind: "gear".into(),
            a: hinge_a.clone(),
            b: hinge_b.clone(),
            coordinates: [Some(i + 1), Some(j + 1)],
            ratio: Some(ratio),
            offset: Some(qb - ratio * qa),
            ..ClosureDefinition::default()
        });
    }
}
