//! The recursion against its dense twin, its audit, and itself.

use crate::support::assert_close;
use crate::support::trees::{Recipe, random_tree};
use nalgebra::DVector;
use pliant::dynamics::added_inertia::AddedInertia;
use pliant::dynamics::inverse::NewtonEuler;
use pliant::dynamics::sweep::inertia_inward::{InertiaScratch, inertia_inward_with};
use pliant::dynamics::sweep::pose_outward::{PoseScratch, pose_outward};
use pliant::dynamics::sweep::response::Response;
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
        Recipe { flexible: 1.0, second_order: Some(0.05), ..all },
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

#[test]
fn response_to_generalised_forces_solves_with_the_mass_matrix_and_what_is_added_to_it() {
    for (name, system, state) in systems(10) {
        let equations = dense::equations(&system, &state);
        let (nv, n) = (system.velocity_count, system.velocity_count + system.modal_count);
        let mut pose = PoseScratch::new(&system);
        pose_outward(&system, &state, &mut pose);
        let mut inertia = InertiaScratch::new(&system);
        let mut found = Response::new(&system);
        let everything: Vec<usize> = (0..system.bodies.len()).collect();
        let wave = |i: usize| (1.7 * i as f64 + 0.3).sin();
        let force: Vec<f64> = (0..n).map(wave).collect();
        // every block: nothing on some hinges, a full matrix on others
        let hinge = |k: usize| {
            let block = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 9.0 } else { wave(i + j) }));
            (!k.is_multiple_of(3) && system.bodies[k].hinge.kind.rate_count() > 1).then_some((k, block))
        };
        let added = AddedInertia {
            modal: (0..system.modal_count).map(|j| 1.0 + 50.0 * (j as f64)).collect(),
            hinge: (0..nv).map(|i| 1.0 + wave(i)).collect(),
            blocks: (0..system.bodies.len()).filter_map(hinge).collect(),
        };
        for added in [None, Some(&added)] {
            let mut matrix = equations.mass.clone();
            if let Some(added) = added {
                added.modal.iter().enumerate().for_each(|(j, x)| matrix[(nv + j, nv + j)] += x - 1.0);
                for (k, body) in system.bodies.iter().enumerate() {
                    let block = added.block(&system, k);
                    for (i, j) in body.velocity_range().flat_map(|i| body.velocity_range().map(move |j| (i, j))) {
                        matrix[(i, j)] += block.map_or(0.0, |b| b[i - body.velocity][j - body.velocity]);
                    }
                }
            }
            let free = matrix.select_rows(&equations.free).select_columns(&equations.free);
            let right = DVector::from_iterator(equations.free.len(), equations.free.iter().map(|&i| force[i]));
            let solution = free.lu().solve(&right).unwrap();
            let mut expected = vec![0.0; n];
            equations.free.iter().zip(&solution).for_each(|(&i, x)| expected[i] = *x);
            inertia_inward_with(&system, &pose, added, &mut inertia).unwrap();
            found.applied.copy_from_slice(&force[..nv]);
            found.external_modal.copy_from_slice(&force[nv..]);
            found.solve(&system, &pose, &inertia, &everything);
            let found = [&found.hinge[..], &found.modal].concat();
            assert_close(&found, &expected, 400.0 * EPS * equations.condition().max(10.0), &name);
        }
    }
}
