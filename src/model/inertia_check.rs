//! Hinges that move nothing: what no state of a system can give an acceleration is refused when it is built.
//!
//! A body without mass or inertia is legal wherever something outboard of it, or a closure, gives its hinge inertia. At the end of a
//! branch nothing does.

use super::build::place;
use super::definition::Definition;
use super::error::ModelError;
use super::hinge::{HingePose, LOCKED};
use super::{BodyKind, ClosureJoint, State, System};

/// Inertia at or below this multiple of the terms that it is the sum of is rounding.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Refuses the first hinge outboard of which nothing has inertia along one of its rates.
pub(super) fn check(definition: &Definition, system: &System, state: &State) -> Result<(), ModelError> {
    let count = system.bodies.len();
    let (mut massive, mut held, mut leaf) = (vec![false; count], vec![false; count], vec![true; count]);
    for closure in &system.closures {
        let ends = match &closure.joint {
            ClosureJoint::Frames { a, b, .. } => [a.body, b.body],
            ClosureJoint::Gear { a, b, .. } => [Some(a.body), Some(b.body)],
        };
        ends.into_iter().flatten().for_each(|k| held[k] = true);
    }
    for (k, body) in system.bodies.iter().enumerate().rev() {
        massive[k] |= match &body.kind {
            BodyKind::Rigid(inertia) => {
                inertia.translational[(0, 0)] >= f64::MIN_POSITIVE || inertia.rotational.trace() >= f64::MIN_POSITIVE
            }
            BodyKind::Flexible(_) => true,
        };
        if let Some(parent) = body.parent {
            massive[parent] |= massive[k];
            held[parent] |= held[k];
            leaf[parent] = false;
        }
    }
    for (k, body) in system.bodies.iter().enumerate() {
        let moves = body.hinge.kind.rate_count() > 0 && !body.hinge.is_prescribed();
        if held[k] || !moves {
            continue;
        }
        let empty = if massive[k] { empty_rate(system, state, k).filter(|_| leaf[k]) } else { Some(0) };
        if let Some(rate) = empty {
            let index = definition.hinges.iter().position(|h| h.name == body.hinge.name).unwrap_or_default();
            return Err(ModelError::NoInertia {
                place: place("hinge", index, "child"),
                hinge: body.hinge.name.clone(),
                parent: body.parent.map_or_else(|| super::build::WORLD.to_owned(), |p| system.bodies[p].name.clone()),
                child: body.name.clone(),
                rate: rate + 1,
            });
        }
    }
    Ok(())
}

/// The first rate of the hinge of rigid body `k` along which the body alone has no inertia; none in gimbal lock, which passes.
fn empty_rate(system: &System, state: &State, k: usize) -> Option<usize> {
    let body = &system.bodies[k];
    let BodyKind::Rigid(inertia) = &body.kind else { return None };
    let mut pose = HingePose::default();
    body.hinge.kind.pose(&state.position[body.position_range()], &mut pose);
    if body.hinge.kind.axis_spread(&pose.map) < LOCKED {
        return None;
    }
    let m = body.hinge.kind.rate_count();
    let matrix = inertia.matrix();
    // columns of P H* less what the rates before them take up
    let mut left = [nalgebra::Vector6::zeros(); super::hinge::MAX_RATES];
    for i in 0..m {
        left[i] = matrix * pose.map[i];
    }
    for i in 0..m {
        let pivot = pose.map[i].dot(&left[i]);
        let terms = pose.map[i].abs().dot(&(matrix.abs() * pose.map[i].abs()));
        // what is not finite is left to the evaluation, which names it
        if pivot <= ROUNDING * terms || pivot < f64::MIN_POSITIVE {
            return Some(i);
        }
        for r in i + 1..m {
            let share = pose.map[r].dot(&left[i]) / pivot;
            let taken = left[i] * share;
            left[r] -= taken;
        }
    }
    None
}
