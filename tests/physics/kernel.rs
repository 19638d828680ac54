//! The kernel of trees against the sweeps, which have their own proofs.

use crate::support::assert_close;
use crate::support::scenes::{chain, rigid, rods};
use crate::support::trees::{Recipe, random_tree};
use pliant::dynamics::energy::power;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::kernel::TreeKernel;
use pliant::dynamics::{Workspace, accelerations, dense, forward_dynamics};
use pliant::model::build::Definition;
use pliant::model::modal_body::Boundary;
use pliant::model::{HingeKind, InertiaOrder, State, System};
use pliant::spatial::lanes::Processor;
use std::time::Instant;

const EPS: f64 = f64::EPSILON;

/// Trees in which every second hinge is a revolute one, the others of any kind.
pub fn random_rigid_tree(seed: u64) -> Definition {
    let recipe = Recipe { bodies: 12, flexible: 0.0, prescribed: 0.2, ..Recipe::default() };
    let mut definition = random_tree(seed, &recipe);
    for hinge in definition.hinges.iter_mut().skip(seed as usize % 2).step_by(2) {
        let prescribed = hinge.motion.is_some();
        let axis = [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.6, 0.48, -0.64]][(hinge.name.len() + seed as usize) % 4];
        let first = |list: &[f64], default: f64| if prescribed { vec![] } else { vec![list.first().copied().unwrap_or(default)] };
        (hinge.kind, hinge.axes, hinge.pitch) = ("revolute".into(), vec![axis.into()], None);
        (hinge.position, hinge.velocity) = (first(&hinge.position, 0.4), first(&hinge.velocity, -0.9));
        hinge.stiffness.truncate(1);
        hinge.rest.truncate(1);
        for function in [&mut hinge.motion, &mut hinge.torque].into_iter().flatten() {
            if let pliant::model::TimeFunction::Sine { amplitude, .. } = function {
                amplitude.resize(1, 0.7);
            }
        }
    }
    definition
}

/// Trees of rigid and flexible bodies that are held by their roots, with children anywhere.
pub fn random_flexible_tree(seed: u64) -> Definition {
    let orders = [InertiaOrder::Zeroth, InertiaOrder::First, InertiaOrder::Second];
    let recipe = Recipe {
        bodies: 9,
        flexible: 0.6,
        boundary: Some(Boundary::Cantilever),
        prescribed: 0.2,
        order: orders[seed as usize % 3],
        second_order: (seed % 4 == 3).then_some(0.02),
        ..Recipe::default()
    };
    let mut definition = random_tree(seed, &recipe);
    for hinge in &mut definition.hinges {
        if let Some(node) = &mut hinge.child_node {
            *node = "root".into();
        }
    }
    definition
}

fn coordinates(workspace: &Workspace) -> Vec<f64> {
    workspace.acceleration.hinge.iter().chain(&workspace.acceleration.modal).copied().collect()
}

#[test]
fn kernel_agrees_with_the_sweeps_on_every_processor() {
    for seed in 0..400 {
        let definition = if seed < 200 { random_rigid_tree(seed) } else { random_flexible_tree(seed) };
        let (system, mut state) = definition.build().unwrap();
        state.time = 0.3;
        state.apply_prescribed(&system);
        let mut swept = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut swept).unwrap();
        let loads =
            |workspace: &Workspace| -> Vec<f64> { (0..system.bodies.len()).flat_map(|k| hinge_load(workspace, k).data.0[0]).collect() };
        let wanted = loads(&swept);
        // both lose condition x eps in solving; the factor covers the sums that lead there, as for the dense twin
        let allowed = 200.0 * EPS * dense::equations(&system, &state).condition().max(10.0);
        for processor in [Processor::plain(), Processor::detect()] {
            let name = format!("seed {seed}, {}", processor.name());
            let mut kernel = Workspace::on(processor, &system);
            accelerations(&system, &state, &mut kernel).unwrap();
            assert!(kernel.is_by_kernel(), "{name}");
            assert_close(&coordinates(&kernel), &coordinates(&swept), allowed, &name);
            for k in (0..system.bodies.len()).filter(|&k| system.bodies[k].flexible().is_some()) {
                let [(omega, alpha), (spin, acceleration)] = [&kernel, &swept].map(|w| w.frame_motion(k));
                assert!((omega - spin).norm() <= allowed * spin.norm(), "{name}, {k}: {omega} {spin}");
                assert!((alpha - acceleration).norm() <= allowed * (1.0 + acceleration.norm()), "{name}, {k}: {alpha} {acceleration}");
            }
            assert_close(&loads(&kernel), &wanted, allowed, &format!("loads, {name}"));
            let powers = (power(&system, &state, &kernel), power(&system, &state, &swept));
            // a power is a sum of products of loads and rates
            let size = wanted.iter().fold(0.0_f64, |m, x| m.max(x.abs())) * 10.0;
            assert!((powers.0 - powers.1).abs() <= allowed * size, "power, {name}: {powers:?}");
        }
    }
}

#[test]
fn loads_that_nobody_asked_for_are_not_numbers() {
    let (system, state) = rods(&[(1.0, 1.0); 3]).build().unwrap();
    let mut workspace = Workspace::without_loads(&system);
    accelerations(&system, &state, &mut workspace).unwrap();
    assert!(hinge_load(&workspace, 1).iter().all(|x| x.is_nan()));
    forward_dynamics(&system, &state, &mut workspace).unwrap();
    assert!(hinge_load(&workspace, 1).iter().all(|x| x.is_finite()));
}

#[test]
fn hinge_inertia_at_the_edge_of_rounding_is_left_to_the_sweeps() {
    // a needle that spins about itself: nothing beside its other inertias, and yet exact
    let needle = rigid("needle", 1.0, [0.0; 3], [1e-17, 1.0, 1.0]);
    let mut definition = chain(vec![rigid("arm", 1.0, [0.0; 3], [0.1; 3]), needle], &[[1.0, 0.0, 0.0]]);
    definition.hinges[1].axes = vec![[1.0, 0.0, 0.0].into()];
    let (system, state) = definition.build().unwrap();
    let [mut by_either, mut swept] = [Workspace::new(&system), Workspace::new(&system)];
    accelerations(&system, &state, &mut by_either).unwrap();
    forward_dynamics(&system, &state, &mut swept).unwrap();
    assert!(!by_either.is_by_kernel());
    assert_eq!(coordinates(&by_either), coordinates(&swept));
}

/// All masses and inertias times a number: accelerations stay, loads are multiplied, whatever the products of inertias would become.
#[test]
fn systems_of_extreme_mass_move_like_ordinary_ones() {
    let scaled = |factor: f64| {
        let links = (0..3).map(|k| rigid(&k.to_string(), factor, [0.5, 0.1, 0.2], [0.1 * factor, 0.2 * factor, 0.25 * factor]));
        let (system, mut state) = chain(links.collect(), &[[1.0, 0.0, 0.0]; 3]).build().unwrap();
        for (k, (q, v)) in state.position.iter_mut().zip(&mut state.velocity).enumerate() {
            (*q, *v) = (0.3 + 0.4 * k as f64, 0.5 - 0.3 * k as f64);
        }
        let mut workspace = Workspace::new(&system);
        accelerations(&system, &state, &mut workspace).unwrap();
        let loads: Vec<f64> = (0..3).flat_map(|k| (hinge_load(&workspace, k) / factor).iter().copied().collect::<Vec<_>>()).collect();
        (workspace.acceleration.hinge.clone(), loads, workspace.is_by_kernel())
    };
    let (acceleration, loads, by_kernel) = scaled(1.0);
    assert!(by_kernel);
    for (factor, expected) in [(1e-165, false), (1e-155, false), (1e-58, true), (1e58, true), (1e155, false), (1e160, false)] {
        let found = scaled(factor);
        assert_eq!(found.2, expected, "{factor:e}");
        // sums of some hundred products
        assert_close(&found.0, &acceleration, 1e-13, &format!("accelerations at {factor:e}"));
        assert_close(&found.1, &loads, 1e-13, &format!("loads at {factor:e}"));
    }
}

#[test]
fn kernel_leaves_to_the_sweeps_what_it_cannot_do() {
    // modes that move their own hinge
    let (system, _) = random_tree(3, &Recipe { flexible: 1.0, boundary: Some(Boundary::FreeFree), ..Recipe::default() }).build().unwrap();
    assert!(TreeKernel::new(&system, true).is_none());
    // masses that differ by more than the plain recursion bears
    let (system, _) = rods(&[(1e-3, 1.0), (1e3, 1.0)]).build().unwrap();
    assert!(TreeKernel::new(&system, true).is_none());
}

/// Chain of the benchmarks of peers: links of 1 kg and 0.5 m whose axes take turns.
fn turning_chain(count: usize) -> (System, State) {
    let links = (0..count).map(|k| rigid(&format!("link {k}"), 1.0, [0.25, 0.0, 0.0], [0.002, 0.022, 0.022])).collect();
    let ends = vec![[0.5, 0.0, 0.0]; count - 1];
    let mut definition = chain(links, &ends);
    definition.gravity = [0.0, 0.0, -9.81].into();
    for (k, hinge) in definition.hinges.iter_mut().enumerate() {
        let j = k as f64;
        hinge.axes = vec![if k % 2 == 0 { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] }.into()];
        hinge.position = vec![0.3 * (j + 1.0).sin()];
        hinge.velocity = vec![0.2 * (2.0 * j + 1.0).cos()];
        hinge.torque = Some(pliant::model::TimeFunction::Constant(vec![0.1 * (3.0 * j + 2.0).sin()]));
    }
    let (system, state) = definition.build().unwrap();
    assert!(system.bodies.iter().all(|b| matches!(b.hinge.kind, HingeKind::Revolute { .. })));
    (system, state)
}

#[test]
fn turning_chain_accelerates_as_other_engines_say() {
    // sum of |accelerations| printed to nine digits by Pinocchio 4.1, MuJoCo 3 and Drake for these chains
    for (count, wanted) in [(16, 64.144_881_9), (64, 76.895_930_8), (256, 111.082_849)] {
        let (system, state) = turning_chain(count);
        let mut workspace = Workspace::new(&system);
        accelerations(&system, &state, &mut workspace).unwrap();
        let sum: f64 = workspace.acceleration.hinge.iter().map(|x| x.abs()).sum();
        assert!((sum - wanted).abs() < 1e-8 * wanted, "{count} links: {sum}");
    }
}

#[test]
#[ignore = "prints times"]
fn time_per_hinge_kind() {
    for (kind, axes) in [
        ("revolute", vec![[0.0, 0.6, 0.8]]),
        ("fixed", vec![]),
        ("prismatic", vec![[0.0, 1.0, 0.0]]),
        ("universal", vec![[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ("spherical", vec![]),
        ("free", vec![]),
    ] {
        let links = (0..64).map(|k| rigid(&format!("link {k}"), 1.0, [0.25, 0.0, 0.0], [0.002, 0.022, 0.022])).collect();
        let mut definition = chain(links, &[[0.5, 0.0, 0.0]; 63]);
        for hinge in &mut definition.hinges {
            (hinge.kind, hinge.axes) = (kind.into(), axes.iter().map(|&a| a.into()).collect());
        }
        let (system, state) = definition.build().unwrap();
        let [mut by_kernel, mut swept] = [Workspace::new(&system), Workspace::new(&system)];
        let mut best = [f64::INFINITY; 2];
        for _ in 0..20 {
            for (i, best) in best.iter_mut().enumerate() {
                let start = Instant::now();
                for _ in 0..500 {
                    match i {
                        0 => accelerations(&system, &state, &mut by_kernel).unwrap(),
                        _ => forward_dynamics(&system, &state, &mut swept).unwrap(),
                    }
                }
                *best = best.min(start.elapsed().as_secs_f64() / (500.0 * 64.0));
            }
        }
        println!("{kind}: {:.1} ns per body, {:.1} by the sweeps", best[0] * 1e9, best[1] * 1e9);
    }
}

#[test]
#[ignore = "prints times"]
fn time_per_body() {
    for count in [4, 16, 64, 256, 1_000, 10_000, 100_000] {
        let (system, state) = turning_chain(count);
        let mut best = [f64::INFINITY; 4];
        let mut spaces = [Workspace::without_loads(&system), Workspace::new(&system), Workspace::on(Processor::plain(), &system)];
        for _ in 0..20 {
            for (i, best) in best.iter_mut().enumerate() {
                let calls = (200_000 / count).max(1);
                let start = Instant::now();
                for _ in 0..calls {
                    match i {
                        3 => forward_dynamics(&system, &state, &mut spaces[1]).unwrap(),
                        _ => accelerations(&system, &state, &mut spaces[i]).unwrap(),
                    }
                }
                *best = best.min(start.elapsed().as_secs_f64() / (calls * count) as f64);
            }
        }
        let [bare, loads, plain, sweeps] = best.map(|t| t * 1e9);
        println!(
            "{count:>7} bodies: {bare:.1} ns per body, {loads:.1} with loads, {plain:.1} with loads by plain instructions, {sweeps:.1} by the sweeps"
        );
    }
}
