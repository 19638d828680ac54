//! Energy and momenta of free trees, and energy less work of driven ones, to the integrator's order.

use crate::support::scenes::{rk4, run, slopes};
use crate::support::trees::{Recipe, random_tree};
use nalgebra::Vector3;
use pliant::dynamics::energy::{Energy, Momentum, balance};
use pliant::dynamics::world::WorldFrame;
use pliant::model::modal_body::Boundary;
use pliant::model::{InertiaOrder, State, System};

const DURATION: f64 = 0.4;
/// Steps per run: three halvings, from where the vibrations of these trees (10 to 60 rad/s) turn by about 0.1 rad a step.
const STEPS: [f64; 4] = [200.0, 400.0, 800.0, 1600.0];

/// Largest drifts over a run: of energy less work over the largest kinetic energy, of momenta over their largest size.
struct Drift {
    energy: f64,
    linear: f64,
    angular: f64,
}

fn drift(system: &System, start: &State, steps: f64) -> Drift {
    let mut frames = vec![WorldFrame::default(); system.bodies.len()];
    let mut samples: Vec<(Energy, Momentum, f64)> = Vec::new();
    run(system, start, rk4(DURATION / steps), DURATION, 20.0 / DURATION, |s| {
        let (energy, momentum) = balance(s.system, s.state, s.workspace, &mut frames);
        samples.push((energy, momentum, s.work));
    });
    let largest = |f: &dyn Fn(&(Energy, Momentum, f64)) -> f64| samples.iter().map(f).fold(0.0, f64::max);
    let first = samples[0];
    let off = |part: fn(&Momentum) -> Vector3<f64>| largest(&|s| (part(&s.1) - part(&first.1)).norm()) / largest(&|s| part(&s.1).norm());
    Drift {
        energy: largest(&|s| (s.0.total() - s.2 - first.0.total()).abs()) / largest(&|s| s.0.kinetic),
        linear: off(|m| m.linear),
        angular: off(|m| m.angular),
    }
}

/// Errors summed over seeds fall with order 4 within 0.2, or faster: what a Runge-Kutta method does to the energy of a linear vibration
/// is of order 5. Below 1e-13 they are rounding: sums over 1e3 steps and all bodies.
fn assert_order(name: &str, errors: &[f64]) {
    let slopes = slopes(errors);
    println!("{name}: orders {slopes:.2?} down to {:.1e}", errors[errors.len() - 1]);
    assert!(errors[1] > 1e-12, "{name}: {errors:?} show rounding only");
    for (slope, error) in slopes.iter().zip(&errors[1..]) {
        assert!(*slope > 3.8 || *error < 1e-13, "{name}: orders {slopes:?} of {errors:?}");
    }
}

fn free_recipe() -> Recipe {
    Recipe { base: Some("free"), gravity: false, loads: false, dampers: false, ..Recipe::default() }
}

/// `seeds` are those whose gimbals stay away from lock during the run: 22, 25, 30 and 36 run into it, which no method passes.
fn assert_conserved(name: &str, recipe: &Recipe, seeds: &[u64], momenta: bool) {
    let mut sums = [[0.0; STEPS.len()]; 3];
    for seed in seeds {
        let mut definition = random_tree(*seed, recipe);
        if momenta {
            // a spring to the world takes up momentum
            definition.hinges[0].stiffness.clear();
        }
        let (system, start) = definition.build().unwrap();
        for (i, steps) in STEPS.iter().enumerate() {
            let drift = drift(&system, &start, *steps);
            for (sum, error) in sums.iter_mut().zip([drift.energy, drift.linear, drift.angular]) {
                sum[i] += error / seeds.len() as f64;
            }
        }
    }
    for (what, errors) in ["energy", "linear momentum", "angular momentum"].into_iter().zip(&sums).take(if momenta { 3 } else { 1 }) {
        assert_order(&format!("{name}, {what}"), errors);
    }
}

#[test]
fn free_kernels_conserve_energy_and_momenta_to_the_order_of_the_steps() {
    assert_conserved("rigid", &Recipe { flexible: 0.0, ..free_recipe() }, &[10, 11, 12, 13, 14, 15, 16], true);
}

#[test]
fn free_flexible_trees_conserve_energy_and_momenta_to_the_order_of_the_steps() {
    for boundary in [Boundary::Cantilever, Boundary::FreeFree, Boundary::General] {
        assert_conserved(
            boundary.name(),
            &Recipe { flexible: 0.7, boundary: Some(boundary), ..free_recipe() },
            &[20, 21, 23, 24, 26],
            true,
        );
    }
}

#[test]
fn trees_with_geometric_stiffness_conserve_energy_and_momenta_to_the_order_of_the_steps() {
    // larger displacements of second order leave random bodies, whose modes carry most of the mass, without inertia
    for (boundary, size) in [(Boundary::Cantilever, 0.1), (Boundary::FreeFree, 0.1), (Boundary::General, 0.1)] {
        let recipe = Recipe { flexible: 0.7, boundary: Some(boundary), second_order: Some(size), ..free_recipe() };
        assert_conserved(&format!("geometric, {}", boundary.name()), &recipe, &[20, 21, 23, 24, 26], true);
    }
    let recipe = Recipe { base: None, gravity: true, second_order: Some(0.1), ..free_recipe() };
    assert_conserved("geometric, gravity", &recipe, &[31, 32, 33, 34, 35], false);
}

#[test]
fn trees_on_any_base_conserve_energy_with_that_of_gravity() {
    assert_conserved("gravity", &Recipe { base: None, gravity: true, ..free_recipe() }, &[31, 32, 33, 34, 35], false);
}

#[test]
fn energy_of_driven_and_damped_trees_changes_by_the_work_done() {
    let recipe = Recipe { prescribed: 0.4, bodies: 7, ..Recipe::default() };
    assert_conserved("driven", &recipe, &[40, 41, 42, 43, 44, 45, 46], false);
}

/// What the truncated inertias give away: orders zero and one are consistent only to their power of the modal coordinates.
#[test]
fn truncated_inertia_changes_energy_by_the_terms_it_leaves_out() {
    let energy = |order| {
        let recipe = Recipe { flexible: 1.0, boundary: Some(Boundary::Cantilever), order, ..free_recipe() };
        let (system, start) = random_tree(21, &recipe).build().unwrap();
        drift(&system, &start, STEPS[3]).energy
    };
    let [zeroth, first, exact] = [InertiaOrder::Zeroth, InertiaOrder::First, InertiaOrder::Second].map(energy);
    println!("energy drift by inertia order: {zeroth:.1e}, {first:.1e}, {exact:.1e}");
    // deflections of 0.15 against arms of 1: neither truncation can be mistaken for an integration error
    assert!(exact < 1e-3 * first && exact < 1e-3 * zeroth);
}
