//! The matrix of linearly implicit steps: the kernel's responses against those of the sweeps, which have their own proofs, and what a stage
//! costs.

use crate::kernel::{random_flexible_tree, random_rigid_tree};
use crate::stiff::panel;
use crate::support::assert_close;
use crate::support::lumped::lumped_body_of;
use crate::support::scenes::{chain, flexible, hinge, rigid, rods};
use crate::support::trees::{Recipe, random_tree};
use nalgebra::Vector3;
use pliant::dynamics::added_inertia::{AddedInertia, HingeBlock};
use pliant::dynamics::implicit_matrix::ImplicitMatrix;
use pliant::dynamics::sweep::inertia_inward::{InertiaScratch, inertia_inward_with};
use pliant::dynamics::sweep::pose_outward::{PoseScratch, pose_outward};
use pliant::dynamics::sweep::response::Response;
use pliant::dynamics::{Workspace, accelerations, dense};
use pliant::integrate::chart::Chart;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::w_tableau::ROS34PW2;
use pliant::integrate::{RosenbrockW, Stepper};
use pliant::model::build::{Definition, WORLD};
use pliant::model::modal_body::Boundary;
use pliant::model::{State, System};
use pliant::spatial::lanes::Processor;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use std::time::Instant;

const EPS: f64 = f64::EPSILON;

/// Nothing, little or much on every rate and mode, and full blocks `B B'` on some hinges of several rates.
fn random_added(system: &System, rng: &mut StdRng) -> AddedInertia {
    let mut added = AddedInertia::none(system);
    let size = |rng: &mut StdRng| [0.0, 1e-3, 1.0, 1e3][rng.random_range(0..4)] * rng.random::<f64>();
    added.hinge.iter_mut().for_each(|x| *x = size(rng));
    added.modal.iter_mut().for_each(|x| *x += size(rng));
    for (k, body) in system.bodies.iter().enumerate().filter(|(k, b)| b.hinge.kind.rate_count() > 1 && !k.is_multiple_of(3)) {
        let m = body.hinge.kind.rate_count();
        let root: HingeBlock = std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-2.0..2.0)));
        let entry = |i: usize, j: usize| if i < m && j < m { (0..m).map(|c| root[i][c] * root[j][c]).sum() } else { 0.0 };
        added.blocks.push((k, std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))));
    }
    added
}

/// Condition number of the mass matrix of the free coordinates with what is added.
fn condition(system: &System, state: &State, added: &AddedInertia) -> f64 {
    let equations = dense::equations(system, state);
    let (mut matrix, nv) = (equations.mass.clone(), system.velocity_count);
    added.modal.iter().enumerate().for_each(|(j, x)| matrix[(nv + j, nv + j)] += x - 1.0);
    for (k, body) in system.bodies.iter().enumerate() {
        let Some(block) = added.block(system, k) else { continue };
        for (i, j) in body.velocity_range().flat_map(|i| body.velocity_range().map(move |j| (i, j))) {
            matrix[(i, j)] += block[i - body.velocity][j - body.velocity];
        }
    }
    let values = matrix.select_rows(&equations.free).select_columns(&equations.free).singular_values();
    if values.is_empty() { 1.0 } else { values.max() / values.min() }
}

#[test]
fn kernel_responds_as_the_sweeps_do_on_every_processor() {
    for seed in 0..400 {
        let mut rng = StdRng::seed_from_u64(seed);
        let definition = if seed < 200 { random_rigid_tree(seed) } else { random_flexible_tree(seed) };
        let (system, mut state) = definition.build().unwrap();
        state.time = 0.3;
        state.apply_prescribed(&system);
        let added = if seed % 10 == 0 { AddedInertia::none(&system) } else { random_added(&system, &mut rng) };
        let mut force = |n: usize| -> Vec<f64> { (0..n).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let (applied, external_modal) = (force(system.velocity_count), force(system.modal_count));

        let (mut pose, mut inertia, mut swept) = (PoseScratch::new(&system), InertiaScratch::new(&system), Response::new(&system));
        pose_outward(&system, &state, &mut pose);
        inertia_inward_with(&system, &pose, Some(&added), &mut inertia).unwrap();
        (swept.applied, swept.external_modal) = (applied.clone(), external_modal.clone());
        swept.solve(&system, &pose, &inertia, &(0..system.bodies.len()).collect::<Vec<_>>());

        // both lose condition x eps in solving; the factor covers the sums that lead there, as for accelerations
        let allowed = 200.0 * EPS * condition(&system, &state, &added).max(10.0);
        for processor in [Processor::plain(), Processor::detect()] {
            let name = format!("seed {seed}, {}", processor.name());
            let mut matrix = ImplicitMatrix::on(processor, &system);
            matrix.added = added.clone();
            matrix.factor(&system, &state).unwrap();
            assert!(matrix.is_by_kernel(), "{name}");
            (matrix.response.applied, matrix.response.external_modal) = (applied.clone(), external_modal.clone());
            // factors serve any number of forces
            for _ in 0..2 {
                matrix.solve(&system);
                let [found, wanted] = [&matrix.response, &swept].map(|r| [&r.hinge[..], &r.modal].concat());
                assert_close(&found, &wanted, allowed, &name);
            }
        }
    }
}

#[test]
fn what_the_kernel_finds_doubtful_is_left_to_the_sweeps() {
    // a needle that spins about itself: nothing beside its other inertias, and yet exact
    let needle = rigid("needle", 1.0, [0.0; 3], [1e-17, 1.0, 1.0]);
    let mut definition = chain(vec![rigid("arm", 1.0, [0.0; 3], [0.1; 3]), needle], &[[1.0, 0.0, 0.0]]);
    definition.hinges[1].axes = vec![[1.0, 0.0, 0.0].into()];
    let (system, state) = definition.build().unwrap();
    let mut matrix = ImplicitMatrix::new(&system);
    matrix.factor(&system, &state).unwrap();
    assert!(!matrix.is_by_kernel());
    matrix.response.applied = vec![0.0, 1e-17];
    matrix.solve(&system);
    assert_close(&matrix.response.hinge, &[0.0, 1.0], 4.0 * EPS, "acceleration of the needle");
    // what is added gives the hinge inertia enough
    matrix.added.hinge[1] = 1.0;
    matrix.factor(&system, &state).unwrap();
    assert!(matrix.is_by_kernel());
    matrix.response.applied = vec![0.0, 1.0];
    matrix.solve(&system);
    assert_close(&matrix.response.hinge, &[0.0, 1.0], 4.0 * EPS, "acceleration of the needle with a damper");

    // modes whose diagonal has no root: what a stiffness below zero makes of a long step
    let (system, state) = hub_with_panels().build().unwrap();
    let mut matrix = ImplicitMatrix::new(&system);
    matrix.added.modal[7] = -3.0;
    matrix.factor(&system, &state).unwrap();
    assert!(!matrix.is_by_kernel());
}

/// Every hinge of one rate with a spring and a damper.
fn sprung(mut definition: Definition) -> Definition {
    for (k, joint) in definition.hinges.iter_mut().enumerate() {
        (joint.stiffness, joint.damping) = (vec![50.0], vec![2.0]);
        (joint.position, joint.velocity) = (vec![0.3 * (k as f64 + 1.0).sin()], vec![0.2 * (2.0 * k as f64 + 1.0).cos()]);
    }
    definition
}

/// A hub that turns freely in space with `arms` arms of `rods` rods.
fn hub_with_arms(arms: usize, rods: usize) -> Definition {
    let mut definition = Definition { gravity: Vector3::zeros(), ..Definition::default() };
    for arm in 0..arms {
        for i in 0..rods {
            let name = format!("rod {arm} {i}");
            let (parent, at) =
                if i == 0 { ("hub".to_owned(), [0.5, 0.2 * arm as f64, 0.0]) } else { (format!("rod {arm} {}", i - 1), [1.0, 0.0, 0.0]) };
            definition.hinges.push(hinge(&format!("to {name}"), "revolute", &[[0.0, 0.6, 0.8]], &parent, &name, at));
            definition.bodies.push(rigid(&name, 1.0, [0.5, 0.0, 0.0], [0.002, 0.08, 0.08]));
        }
    }
    definition = sprung(definition);
    definition.bodies.insert(0, rigid("hub", 50.0, [0.0; 3], [30.0; 3]));
    definition.hinges.insert(0, hinge("base", "free", &[], WORLD, "hub", [0.0; 3]));
    definition
}

/// A hub that turns freely in space with four sprung panels of twelve modes.
fn hub_with_panels() -> Definition {
    let modal = lumped_body_of(&mut StdRng::seed_from_u64(7), Boundary::Cantilever, 12, vec![0.25; 40]).modal;
    let mut definition = Definition { gravity: Vector3::zeros(), ..Definition::default() };
    for k in 0..4 {
        let name = format!("panel {k}");
        definition.hinges.push(hinge(&format!("to {name}"), "revolute", &[[0.0, 0.6, 0.8]], "hub", &name, [0.5, 0.2 * f64::from(k), 0.0]));
        definition.bodies.push(flexible(&name, modal.clone()));
    }
    definition = sprung(definition);
    definition.bodies.insert(0, rigid("hub", 50.0, [0.0; 3], [30.0; 3]));
    definition.hinges.insert(0, hinge("base", "free", &[], WORLD, "hub", [0.0; 3]));
    definition
}

/// A chain of sprung rods that carries a panel of twelve modes.
fn rods_with_panel(count: usize) -> Definition {
    let mut definition = rods(&vec![(1.0, 1.0); count]);
    let modal = lumped_body_of(&mut StdRng::seed_from_u64(7), Boundary::Cantilever, 12, vec![0.25; 40]).modal;
    definition.bodies.push(flexible("panel", modal));
    definition.hinges.push(hinge("to panel", "revolute", &[[0.0, 0.6, 0.8]], &format!("rod{count}"), "panel", [1.0, 0.0, 0.0]));
    sprung(definition)
}

/// Least times (s) over `rounds` of an evaluation and of a stage of `system`, in turns, so that a busy machine disturbs both.
fn times(system: &System, start: &State, rounds: usize) -> [f64; 2] {
    const LOOSE: Tolerance = Tolerance { relative: 1e6, absolute: 1e6 };
    let mut workspace = Workspace::new(system);
    let mut chart = Chart::new(system, start);
    let mut stepper = RosenbrockW::new(ROS34PW2, LOOSE, &chart);
    stepper.restart(&mut chart).unwrap();
    // short enough to fit between two turns of other processes, long enough for the clock
    let begin = Instant::now();
    accelerations(system, start, &mut workspace).unwrap();
    let calls = (5e-5 / begin.elapsed().as_secs_f64()).clamp(1.0, 100.0) as usize;
    let mut least = [f64::INFINITY; 2];
    for _ in 0..rounds {
        let begin = Instant::now();
        for _ in 0..calls {
            accelerations(system, start, &mut workspace).unwrap();
        }
        let evaluated = Instant::now();
        for _ in 0..calls {
            stepper.attempt(&mut chart, 1e-4).unwrap();
        }
        let seconds = [evaluated.duration_since(begin).as_secs_f64(), evaluated.elapsed().as_secs_f64() / 4.0];
        least = [0, 1].map(|i| least[i].min(seconds[i] / calls as f64));
    }
    least
}

/// Trees of every kind: stiff and soft, rigid, flexible and both, for the kernel and (modes that move their own hinge) for the sweeps.
fn systems() -> Vec<(String, (System, State))> {
    let modes = Recipe { bodies: 30, flexible: 0.7, ..Recipe::default() };
    let mut systems = vec![("panel".to_owned(), panel(300.0))];
    for count in [8, 32, 1000] {
        systems.push((format!("chain of {count} rods"), sprung(rods(&vec![(1.0, 1.0); count])).build().unwrap()));
    }
    systems.push(("hub with four arms of 8 rods".to_owned(), hub_with_arms(4, 8).build().unwrap()));
    systems.push(("hub with four panels".to_owned(), hub_with_panels().build().unwrap()));
    systems.push(("chain of 16 rods with a panel".to_owned(), rods_with_panel(16).build().unwrap()));
    for seed in 5..8 {
        systems.push((format!("random tree {seed}"), random_tree(seed, &modes).build().unwrap()));
        systems.push((format!("random tree {seed} of held modes"), random_flexible_tree(seed).build().unwrap()));
    }
    systems
}

#[test]
fn a_stage_costs_at_most_2_2_evaluations_on_trees_of_every_kind() {
    let mut dear = vec![];
    for (name, (system, start)) in systems() {
        let [evaluation, stage] = times(&system, &start, 300);
        let ratio = stage / evaluation;
        println!("{name}: evaluation {:.2} us, stage {ratio:.2} of it", evaluation * 1e6);
        if ratio > 2.2 {
            dear.push(format!("{name}: {ratio}"));
        }
    }
    assert!(dear.is_empty(), "{dear:?}");
}

#[test]
#[ignore = "prints times"]
fn time_of_the_parts_of_a_stage() {
    for (name, (system, start)) in systems() {
        let [mut with, mut without] = [Workspace::new(&system), Workspace::without_loads(&system)];
        let mut chart = Chart::new(&system, &start);
        let (mut y, mut rate) = (vec![0.0; chart.len()], vec![0.0; chart.len()]);
        chart.base_vector(&mut y);
        let mut matrix = ImplicitMatrix::new(&system);
        matrix.added.hinge.fill(0.1);
        matrix.factor(&system, &start).unwrap();
        matrix.response.applied.fill(1.0);
        let mut least = [f64::INFINITY; 5];
        for _ in 0..50 {
            for (i, least) in least.iter_mut().enumerate() {
                let calls = (1000 / system.bodies.len()).clamp(1, 100);
                let begin = Instant::now();
                for _ in 0..calls {
                    match i {
                        0 => accelerations(&system, &start, &mut with).unwrap(),
                        1 => accelerations(&system, &start, &mut without).unwrap(),
                        2 => chart.rate(start.time, &y, &mut rate).unwrap(),
                        3 => matrix.factor(&system, &start).unwrap(),
                        _ => matrix.solve(&system),
                    }
                }
                *least = least.min(begin.elapsed().as_secs_f64() / calls as f64);
            }
        }
        let [loads, bare, rate, factor, solve] = least.map(|t| t * 1e6);
        println!("{name}, us: evaluation {loads:.2}, without loads {bare:.2}, chart {rate:.2}, factors {factor:.2}, response {solve:.2}");
    }
}
