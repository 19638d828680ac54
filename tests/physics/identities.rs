//! The recursion against its dense twin, its audit, and itself.

use crate::support::assert_close;
use crate::support::trees::{Recipe, random_tree};
use pliant::dynamics::inverse::NewtonEuler;
use pliant::dynamics::{Workspace, dense, forward_dynamics};
use pliant::model::modal_body::Boundary;
use pliant::model::{State, System};

const EPS: f64 = f64::EPSILON;

fn recipes() -> Vec<Recipe> {
    let all = Recipe::default();
    vec![
        Recipe { flexible: 0.0, ..all },
        Recipe { flexible: 1.0, boundary: Some(Boundary::Cantilever), ..all },
        Recipe { flexible: 1.0, boundary: Some(Boundary::FreeFree), ..all },
        Recipe { flexible: 1.0, boundary: Some(Boundary::General), ..all },
        Recipe { bodies: 12, ..all },
        Recipe { prescribed: 0.5, bodies: 9, ..all },
        Recipe { base: Some("free"), gravity: false, ..all },
    ]
}

fn systems(count: u64) -> impl Iterator<Item = (String, System, State)> {
    recipes().into_iter().enumerate().flat_map(move |(r, recipe)| {
        (0..count).map(move |seed| {
            let (system, mut state) = random_tree(seed + 100 * r as u64, &recipe).build().unwrap();
            state.time = 0.3;
            state.apply_prescribed(&system);
            (format!("recipe {r} seed {seed}"), system, state)
        })
    })
}

#[test]
fn recursion_agrees_with_the_dense_twin() {
    for (name, system, state) in systems(25) {
        let mut workspace = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        let equations = dense::equations(&system, &state);
        let expected = equations.accelerations();
        let found: Vec<f64> = workspace.acceleration.hinge.iter().chain(&workspace.acceleration.modal).copied().collect();
        // both solves lose condition x eps; the factor covers the sums that form M and C
        assert_close(&found, expected.as_slice(), 200.0 * EPS * equations.condition().max(10.0), &name);
    }
}

#[test]
fn mass_matrix_of_the_dense_twin_is_symmetric() {
    for (name, system, state) in systems(3) {
        let mass = dense::equations(&system, &state).mass;
        assert!((&mass - mass.transpose()).amax() <= 1e3 * EPS * mass.amax(), "{name}");
    }
}

#[test]
fn hinge_loads_and_equations_pass_the_independent_audit() {
    for (name, system, state) in systems(25) {
        let mut workspace = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        let residual = NewtonEuler::new(&system).audit(&system, &state, &workspace);
        let condition = dense::equations(&system, &state).condition();
        assert!(residual.load <= 200.0 * EPS * condition.max(10.0), "{name}: {residual:?}, condition {condition:e}");
        assert!(residual.equation <= 2000.0 * EPS * condition.max(10.0), "{name}: {residual:?}, condition {condition:e}");
    }
}
