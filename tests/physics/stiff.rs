//! The linearly implicit method: its order, and stiff modes that cost neither steps nor time. Stiff transients of known motion are in the
//! stability suite.

use crate::published_loops::governor;
use crate::support::assert_close;
use crate::support::loops::{METHODS, held_by, random_loops};
use crate::support::lumped::lumped_body;
use crate::support::scenes::{Z, difference, dormand_prince, flexible, hinge, numbers, rigid, run, slopes};
use crate::support::trees::{Recipe, random_tree};
use nalgebra::Vector3;
use pliant::dynamics::closed_chain::assembly;
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::integrate::choice::choose;
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Outcome, Settings, simulate};
use pliant::model::build::{BodyDefinitionKind, Definition, WORLD};
use pliant::model::modal_body::Boundary;
use pliant::model::{State, System, TimeFunction};
use rand::SeedableRng;
use rand::rngs::StdRng;
use std::time::Instant;

const fn rosenbrock_w(tolerance: f64) -> Method {
    Method::RosenbrockW { tolerance: Tolerance { relative: tolerance, absolute: tolerance }, largest_step: f64::INFINITY }
}

/// A tolerance that nothing exceeds: steps of one length after a short start.
const LOOSE: Tolerance = Tolerance { relative: 1e6, absolute: 1e6 };
const fn fixed(step: f64) -> Method {
    Method::RosenbrockW { tolerance: LOOSE, largest_step: step }
}

/// Root mean square, over ten times, of the errors against the explicit pair at steps (s) whose own error is below rounding.
fn errors(system: &System, start: &State, methods: &[Method], reference: f64, duration: f64) -> Vec<f64> {
    let samples = |method: Method| {
        let mut seen = Vec::new();
        run(system, start, method, duration, 10.0 / duration, |s| seen.push(numbers(s.state)));
        seen
    };
    let exact = samples(Method::DormandPrince { tolerance: LOOSE, largest_step: reference });
    let error = |m: &Method| samples(*m).iter().zip(&exact).map(|(s, e)| difference(s, e).powi(2)).sum::<f64>().sqrt();
    methods.iter().map(error).collect()
}

#[test]
fn order_is_3_on_every_sort_of_tree() {
    let all = Recipe { bodies: 4, flexible: 1.0, ..Recipe::default() };
    let recipes = [
        Recipe { flexible: 0.0, ..all },
        Recipe { boundary: Some(Boundary::Cantilever), ..all },
        Recipe { boundary: Some(Boundary::FreeFree), ..all },
        Recipe { boundary: Some(Boundary::General), ..all },
        Recipe { prescribed: 0.6, bodies: 6, flexible: 0.5, ..all },
        Recipe { base: Some("free"), ..all },
        Recipe { base: Some("spherical"), flexible: 0.5, ..all },
    ];
    for (r, recipe) in recipes.iter().enumerate() {
        let mut seen = 0;
        for seed in 0..5 {
            let (system, mut start) = random_tree(seed + 50 * r as u64, recipe).build().unwrap();
            start.apply_prescribed(&system);
            // within what random modes bear
            start.modal_position.iter_mut().chain(&mut start.modal_velocity).for_each(|x| *x *= 0.3);
            // a random mode may yet be carried to where its body has an inertia that no body has
            let settings = Settings { duration: 0.1, method: Method::DormandPrince { tolerance: LOOSE, largest_step: 1e-4 }, rate_hz: 1.0 };
            if simulate(&system, &start, &settings, &mut []).outcome != Outcome::Completed {
                continue;
            }
            seen += 1;
            let steps: Vec<_> = (0..4).map(|i| fixed(0.002 * 0.5_f64.powi(i))).collect();
            let errors = errors(&system, &start, &steps, 1e-4, 0.1);
            println!("recipe {r} seed {seed}: {errors:?}, orders {:.2?}", slopes(&errors));
            assert!(slopes(&errors).iter().all(|s| (s - 3.0).abs() < 0.2), "recipe {r} seed {seed}: orders {:?}", slopes(&errors));
        }
        assert!(seen >= 3, "recipe {r}: {seen} trees ran");
    }
}

/// The same with loops, cut and embedded: x is held on the closures by multipliers, or by independent coordinates.
#[test]
fn order_is_3_with_loops_by_either_method() {
    let all = Recipe { bodies: 7, base: Some("revolute"), ..Recipe::default() };
    let recipes =
        [Recipe { flexible: 0.0, ..all }, Recipe { boundary: Some(Boundary::Cantilever), ..all }, Recipe { prescribed: 0.2, ..all }];
    for (r, recipe) in recipes.iter().enumerate() {
        let mut seen = 0;
        for seed in 0..12 {
            for method in METHODS {
                let (system, mut start) = held_by(method, random_loops(900 + 20 * r as u64 + seed, recipe, 1)).build().unwrap();
                start.modal_position.iter_mut().chain(&mut start.modal_velocity).for_each(|x| *x *= 0.3);
                start.apply_prescribed(&system);
                let mut workspace = Workspace::new(&system);
                if assembly::assemble(&system, &mut start).is_err()
                    || forward_dynamics(&system, &start, &mut workspace).is_err()
                    || workspace.distance_to_rank_loss() < 0.1
                {
                    continue;
                }
                let settings =
                    Settings { duration: 0.04, method: Method::DormandPrince { tolerance: LOOSE, largest_step: 1e-4 }, rate_hz: 1.0 };
                if simulate(&system, &start, &settings, &mut []).outcome != Outcome::Completed {
                    continue;
                }
                seen += 1;
                let steps: Vec<_> = (0..4).map(|i| fixed(0.001 * 0.5_f64.powi(i))).collect();
                let errors = errors(&system, &start, &steps, 5e-5, 0.04);
                println!("recipe {r} seed {seed} {method}: {errors:?}, orders {:.2?}", slopes(&errors));
                let last = slopes(&errors)[2];
                assert!((last - 3.0).abs() < 0.3, "recipe {r} seed {seed} {method}: orders {:?}", slopes(&errors));
            }
        }
        assert!(seen >= 8, "recipe {r}: {seen} loops ran");
    }
}

/// C05: a spring and damper of 1e-4 s in a loop hold the explicit pair to fifteen thousand steps.
#[test]
fn stiff_governor_takes_few_steps_by_either_method() {
    for method in METHODS {
        let (system, start) = held_by(method, governor()).build().unwrap();
        let mut found = vec![];
        let slide = system.bodies[system.hinge_index("slide").unwrap()].position;
        let summary = run(&system, &start, rosenbrock_w(1e-6), 10.0, 2.0, |s| {
            if [0.5, 1.0, 10.0].iter().any(|t| (s.state.time - t).abs() < 1e-9) {
                found.push(s.state.position[slide]);
            }
        });
        println!("{method}: s {found:?}, {} steps", summary.steps);
        // 1e-6 per step over two thousand steps, most of it phase
        assert_close(&found, &[0.743_249_424_79, 0.501_420_922_38, 0.619_622_917_06], 1e-4, "slider at t = 0.5, 1 and 10 s");
        assert!(summary.steps < 2_500, "{} steps", summary.steps);
    }
}

/// Hub on a driven hinge, sprung panel of four modes, tip mass; the last mode has `fastest_hz`.
pub fn panel(fastest_hz: f64) -> (System, State) {
    let mut modal = lumped_body(&mut StdRng::seed_from_u64(11), Boundary::Cantilever, 4).modal;
    modal.frequency_hz = vec![0.3, 0.7, 1.6, fastest_hz];
    let mut panel = flexible("panel", modal);
    if let BodyDefinitionKind::Flexible(f) = &mut panel.kind {
        f.damping_ratio = vec![0.005; 4];
    }
    let mut base = hinge("base", "revolute", &[Z], WORLD, "hub", [0.0; 3]);
    base.torque = Some(TimeFunction::Sine { amplitude: vec![20.0], frequency_hz: 0.1, phase: 0.4 });
    let mut root = hinge("root", "revolute", &[[0.0, 1.0, 0.2]], "hub", "panel", [0.5, 0.1, 0.0]);
    (root.position, root.stiffness, root.damping) = (vec![0.3], vec![40.0], vec![0.5]);
    let mut tip = hinge("tip", "fixed", &[], "panel", "mass", [0.0; 3]);
    tip.parent_node = Some("tip".into());
    let bodies = vec![rigid("hub", 50.0, [0.0; 3], [30.0; 3]), panel, rigid("mass", 2.0, [0.1, 0.0, 0.0], [0.1; 3])];
    Definition { gravity: Vector3::zeros(), bodies, hinges: vec![base, root, tip], loads: vec![], closures: vec![] }.build().unwrap()
}

#[test]
fn steps_and_time_per_step_do_not_grow_with_the_fastest_mode() {
    for tolerance in [1e-3, 1e-4] {
        let run_with = |hz: f64| {
            let (system, start) = panel(hz);
            let mut least = f64::INFINITY;
            let mut steps = 0;
            // the best of several is the one that other processes disturbed least
            for _ in 0..10 {
                let begin = Instant::now();
                let summary = run(&system, &start, rosenbrock_w(tolerance), 10.0, 1.0, |_| {});
                steps = summary.steps + summary.rejected;
                least = least.min(begin.elapsed().as_secs_f64() / steps as f64);
            }
            println!("{tolerance:e}, {hz} Hz: {steps} steps, {:.1} us per step", least * 1e6);
            (steps as f64, least)
        };
        let slow = run_with(3.0);
        for hz in [30.0, 3e3, 3e5] {
            let stiff = run_with(hz);
            assert!(stiff.0 <= 1.1 * slow.0, "{tolerance:e}, {hz} Hz: {} steps, {} at 3 Hz", stiff.0, slow.0);
            // a step that resolved the mode would cost 10 to 100,000 times as much; 2.5 leaves room for a busy machine
            assert!(stiff.1 <= 2.5 * slow.1, "{tolerance:e}, {hz} Hz: {:e} s per step, {:e} at 3 Hz", stiff.1, slow.1);
        }
    }
}

#[test]
fn both_methods_agree_at_tight_tolerances() {
    let (system, start) = panel(3.0);
    let end = |method| numbers(&run(&system, &start, method, 2.0, 1.0, |_| {}).end);
    let (implicit, explicit) = (end(rosenbrock_w(1e-8)), end(dormand_prince(1e-12)));
    println!("difference {:e}", difference(&implicit, &explicit));
    // global errors of a method of order 3 go as tolerance^(2/3..1)
    assert!(difference(&implicit, &explicit) < 1e-6, "{:e}", difference(&implicit, &explicit));
}

#[test]
fn auto_takes_the_implicit_method_once_the_fastest_mode_costs_the_explicit_one_steps() {
    let tolerance = Tolerance { relative: 1e-4, absolute: 1e-4 };
    for (hz, name) in [(2.0, "dormand_prince"), (30.0, "rosenbrock_w"), (3e5, "rosenbrock_w")] {
        let choice = choose(&panel(hz).0, tolerance, f64::INFINITY, 10.0);
        println!("{}", choice.reason);
        assert!(choice.method.name() == name && choice.reason.starts_with(name) && choice.reason.contains("mode 4 of \"panel\""));
    }
}
