//! Closed chains: against a dense solve, the audit, published linkages, and any choice of the cut. Loops that lose rank are in the
//! stability suite.

use crate::support::assert_close;
use crate::support::linkages::{COUPLER, CRANK, ROCKER, closure, four_bar, rod, row_of_four_bars};
use crate::support::loops::{METHODS, add_gears, held_by, random_loops};
use crate::support::scenes::{G, Z, dormand_prince, hinge, rigid, rk4, run};
use crate::support::trees::Recipe;
use nalgebra::{DVector, Matrix3, Vector3, Vector6};
use pliant::dynamics::closed_chain::{assembly, drift};
use pliant::dynamics::energy::balance;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::inverse::NewtonEuler;
use pliant::dynamics::world::{WorldFrame, hinge_frame, world_frames};
use pliant::dynamics::{DynamicsError, Workspace, dense, forward_dynamics};
use pliant::integrate::{Outcome, Settings, simulate};
use pliant::model::build::{Definition, WORLD};
use pliant::model::build_closure::ClosureDefinition;
use pliant::model::modal_body::Boundary;
use pliant::model::{ClosureJoint, State, System, TimeFunction};

pub fn evaluated(system: &System, state: &State) -> Workspace {
    let mut workspace = Workspace::new(system);
    forward_dynamics(system, state, &mut workspace).unwrap();
    workspace
}

fn accelerations(workspace: &Workspace) -> Vec<f64> {
    workspace.acceleration.hinge.iter().chain(&workspace.acceleration.modal).copied().collect()
}

/// All methods, and every mix of them, against one dense solve: accelerations, multipliers, and the audit of all hinge loads.
#[test]
fn every_method_agrees_with_the_dense_kkt_solve_and_passes_the_audit() {
    let all = Recipe { bodies: 9, ..Recipe::default() };
    let recipes = [
        Recipe { flexible: 0.0, ..all },
        Recipe { flexible: 1.0, boundary: Some(Boundary::Cantilever), ..all },
        Recipe { flexible: 1.0, boundary: Some(Boundary::FreeFree), ..all },
        Recipe { prescribed: 0.3, ..all },
        Recipe { base: Some("free"), gravity: false, ..all },
    ];
    let (mut close, mut compared, mut refused, mut worst) = (0, 0, [0, 0, 0], [[0.0_f64; 4]; 3]);
    for (r, recipe) in recipes.iter().enumerate() {
        for seed in 0..28 {
            let mut definition = random_loops(1000 + 100 * r as u64 + seed, recipe, 1 + seed as usize % 3);
            add_gears(&mut definition, 1000 + seed, seed as usize % 4 / 2);
            // cut, embedded, and the first one embedded beside cut ones
            let mut mixed = held_by(METHODS[0], definition.clone());
            mixed.closures[0].method = Some(METHODS[1].into());
            let methods = [held_by(METHODS[0], definition.clone()), held_by(METHODS[1], definition), mixed];
            let mut reference: Option<Vec<Vector6<f64>>> = None;
            for (method, definition) in methods.iter().enumerate() {
                let name = format!("recipe {r} seed {seed} method {method}");
                let (system, mut state) = definition.build().unwrap();
                state.apply_prescribed(&system);
                assert!(drift::measure(&system, &state, &mut Workspace::new(&system)).position < 1e-13, "{name}");
                // every second with rates that the loops allow, where there are any
                if seed % 2 == 1 && assembly::assemble(&system, &mut state).is_err() {
                    refused[method] += 1;
                    continue;
                }
                let mut workspace = Workspace::new(&system);
                match forward_dynamics(&system, &state, &mut workspace) {
                    Ok(()) => {}
                    Err(DynamicsError::ContradictoryClosures { rank, rows, .. }) => {
                        // random rates that a loop of too few hinges cannot have
                        assert!(rank < rows, "{name}");
                        refused[method] += 1;
                        continue;
                    }
                    Err(other) => panic!("{name}: {other}"),
                }
                let chain = workspace.closed.as_ref().unwrap();
                let report = chain.rank_report(&system, &workspace.pose);
                let equations = dense::equations(&system, &state);
                let condition = equations.condition() / report.smallest.min(1.0).powi(2);
                if condition > 1e9 {
                    continue;
                }
                let (expected, lambda) = equations.closed_accelerations().unwrap();
                // 1e-10, or what the condition of the dense solve leaves
                let allowed = (2.0 * f64::EPSILON * condition).max(1e-10);
                let off = |found: &[f64], expected: &[f64]| {
                    let size = expected.iter().fold(1e-6_f64, |m, x| m.max(x.abs()));
                    found.iter().zip(expected).fold(0.0_f64, |m, (f, e)| m.max((f - e).abs())) / size
                };
                let residual = NewtonEuler::new(&system).audit(&system, &state, &workspace);
                // where cut and embedded closures share a redundancy, each half takes its own least norm
                let shared = method == 2 && !report.redundant.is_empty();
                // what is solved is closed; the bias holds the prescribed accelerations already
                let free = DVector::from_vec(accelerations(&workspace)) - &equations.prescribed;
                let open = &equations.closure_map * free + &equations.closure_bias;
                let bias = equations.closure_bias.amax().max(1.0);
                assert!(open.amax() <= 1e-6 * bias + 1e3 * allowed * bias, "{name}: open by {:e} of {bias:e}", open.amax());
                close += usize::from(condition < 1e-10 / f64::EPSILON);
                let errors = [
                    off(&accelerations(&workspace), expected.as_slice()),
                    if shared { 0.0 } else { off(&chain.lambda, lambda.as_slice()) },
                    residual.load,
                    residual.equation,
                ];
                for (w, e) in worst[method].iter_mut().zip(errors) {
                    *w = w.max(e);
                }
                assert!(errors[0].max(errors[1]).max(errors[2]) <= allowed, "{name}: {errors:?}, allowed {allowed:e}, {report:?}");
                assert!(errors[3] <= 10.0 * allowed, "{name}: {errors:?}, allowed {allowed:e}");
                let loads: Vec<_> = (0..system.bodies.len()).map(|k| hinge_load(&workspace, k)).collect();
                if let Some(reference) = reference.as_ref().filter(|_| !shared) {
                    let size = reference.iter().fold(1e-9_f64, |m, l| m.max(l.amax()));
                    let off = reference.iter().zip(&loads).fold(0.0_f64, |m, (a, b)| m.max((a - b).amax())) / size;
                    assert!(off <= allowed, "{name}: loads off by {off:e}, allowed {allowed:e}");
                }
                reference.get_or_insert(loads);
                compared += 1;
            }
        }
    }
    println!(
        "{compared} systems compared, {close} of them to 1e-10, {refused:?} refused; largest errors: acceleration, multipliers, audit {worst:?}"
    );
    assert!(compared >= 240 && close >= 180, "{compared} compared, {close} to 1e-10, {refused:?} refused");
}

/// Angular accelerations of crank, coupler and rocker, and the force through every joint in inertial axes, on the body further along the
/// loop from A to D (on the ground at D).
fn four_bar_result(cut: char, method: &str) -> ([f64; 3], [Vector3<f64>; 4]) {
    let (system, state) = four_bar(cut, method);
    let workspace = evaluated(&system, &state);
    let alpha = ["crank", "coupler", "rocker"].map(|name| workspace.acceleration.alpha[system.body_index(name).unwrap()][2]);
    let mut frames = vec![WorldFrame::default(); system.bodies.len()];
    world_frames(&system, &workspace.pose, &mut frames);
    let order = ["", "crank", "coupler", "rocker", ""];
    let forces = ["A", "B", "C", "D"].map(|joint| {
        let place = "ABCD".find(joint).unwrap();
        let (on, force): (&str, Vector3<f64>) = match system.hinge_index(joint) {
            Some(k) => {
                let body = &system.bodies[k];
                let frame = hinge_frame(body, &workspace.pose, k, &frames);
                (&body.name, frame.rotation * hinge_load(&workspace, k).fixed_rows::<3>(3))
            }
            None => {
                let ClosureJoint::Frames { a, b, .. } = &system.closures[0].joint else { panic!("a joint between frames") };
                let turn = a.body.map_or_else(Matrix3::identity, |k| frames[k].rotation * a.attachment.rotation);
                let load = workspace.closure_load(&system, 0);
                (&system.bodies[b.body.unwrap()].name, turn * load.fixed_rows::<3>(3))
            }
        };
        if on == order[place + 1] { force } else { -force }
    });
    (alpha, forces)
}

/// C09: published accelerations of one instant, whatever joint is cut.
#[test]
fn published_four_bar_has_its_accelerations_and_joint_forces_wherever_it_is_cut() {
    let expected = [-9.856_158_991_543_052, 2.990_203_058_289_293, 0.062_798_651_029_610_68];
    let reference = four_bar_result('D', METHODS[0]).1;
    for (cut, method) in ['D', 'C', 'B'].into_iter().flat_map(|cut| METHODS.map(|method| (cut, method))) {
        let (alpha, forces) = four_bar_result(cut, method);
        println!("cut {cut}, {method}: {alpha:?}");
        assert_close(&alpha, &expected, 1e-12, &format!("angular accelerations, cut at {cut}"));
        for (joint, (force, same)) in "ABCD".chars().zip(forces.iter().zip(&reference)) {
            assert!((force - same).norm() <= 1e-10 * same.norm(), "force at {joint}, cut at {cut}: {force} against {same}");
        }
    }
}

/// C06.
#[test]
fn published_gear_pair_shares_the_torque() {
    let wheel = |name: &str, j: f64| rigid(name, 1.0, [0.0; 3], [j; 3]);
    let mut drive = hinge("drive", "revolute", &[Z], WORLD, "motor", [0.0; 3]);
    drive.torque = Some(TimeFunction::Constant(vec![10.0]));
    let driven = hinge("driven", "revolute", &[Z], WORLD, "wheel", [1.0, 0.0, 0.0]);
    let gear = ClosureDefinition {
        name: "gear".into(),
        kind: "gear".into(),
        a: "drive".into(),
        b: "driven".into(),
        ratio: Some(-3.0),
        ..ClosureDefinition::default()
    };
    let bodies = vec![wheel("motor", 2.0), wheel("wheel", 0.5)];
    let definition = Definition { bodies, hinges: vec![drive, driven], closures: vec![gear], ..Definition::default() };
    for method in METHODS {
        let (system, state) = held_by(method, definition.clone()).build().unwrap();
        let workspace = evaluated(&system, &state);
        let lambda = workspace.closed.as_ref().unwrap().lambda[0];
        let found = [workspace.acceleration.hinge[0], lambda];
        assert_close(&found, &[1.538_461_538_461_538_5, -2.307_692_307_692_307_6], 1e-14, method);
    }
}

#[test]
fn closure_out_of_reach_is_refused_by_name_and_residual() {
    let hinges = vec![hinge("left", "revolute", &[Z], WORLD, "bar", [0.0; 3])];
    let closures = vec![closure("far", "spherical", &[], WORLD, [5.0, 0.0, 0.0], "bar", [2.0, 0.0, 0.0])];
    let (system, mut state) = Definition { bodies: vec![rod("bar", 2.0)], hinges, closures, ..Definition::default() }.build().unwrap();
    state.position[0] = 0.4;
    let error = assembly::assemble(&system, &mut state).unwrap_err();
    assert!((error.residual - 3.0).abs() < 1e-4, "{error}");
    let text = error.to_string();
    assert!(text.contains("\"far\"") && text.contains("left = ["), "{text}");
}

/// Two motors that turn the same rigid frame at different rates: no load satisfies both.
#[test]
fn closure_against_a_prescribed_hinge_is_refused_by_name() {
    for method in METHODS {
        let wave = TimeFunction::Sine { amplitude: vec![0.2], frequency_hz: 0.5, phase: 1.0 };
        let mut drive = hinge("drive", "revolute", &[Z], WORLD, "bar", [0.0; 3]);
        drive.motion = Some(wave);
        let mut far = closure("stop", "spherical", &[], WORLD, [0.0; 3], "bar", [2.0, 0.0, 0.0]);
        far.frame_a.position = Vector3::new(2.0, 0.0, 0.0);
        let definition = Definition { bodies: vec![rod("bar", 2.0)], hinges: vec![drive], closures: vec![far], ..Definition::default() };
        let (system, mut state) = held_by(method, definition).build().unwrap();
        let error = forward_dynamics(&system, &state, &mut Workspace::new(&system)).unwrap_err();
        assert!(error.to_string().contains("\"stop\""), "{error}");
        let error = assembly::assemble(&system, &mut state).unwrap_err();
        assert!(error.to_string().contains("\"stop\""), "{error}");
    }
}

/// Drift is taken back without taking energy: it falls with the step as the method's order says, and closures stay closed.
#[test]
fn four_bar_keeps_its_energy_and_stays_closed_over_many_turns() {
    for method in METHODS {
        let (system, start) = four_bar('D', method);
        let mut frames = vec![WorldFrame::default(); system.bodies.len()];
        let mut errors = Vec::new();
        for step in [4e-3, 2e-3, 1e-3] {
            let (mut energies, mut worst) = (Vec::new(), [0.0_f64; 2]);
            run(&system, &start, rk4(step), 40.0, 10.0, |s| {
                let (energy, _) = balance(s.system, s.state, s.workspace, &mut frames);
                energies.push(energy.total());
                let drift = drift::measure(s.system, s.state, &mut Workspace::new(s.system));
                worst = [worst[0].max(drift.position), worst[1].max(drift.rate)];
            });
            let off = energies.iter().map(|e| (e - energies[0]).abs()).fold(0.0, f64::max);
            println!("four-bar, step {step}: energy off by {off:e} J, residuals {worst:?}");
            assert!(worst[0] < 1e-12 && worst[1] < 1e-10, "{worst:?}");
            errors.push(off);
        }
        assert!(errors[0] / errors[2] > 200.0, "{errors:?}");
    }
}

/// A flexible body in the loop, closed on its interface: energy to the integrator's order, closed to rounding.
#[test]
fn loop_that_closes_on_a_flexible_interface_conserves_energy() {
    for method in METHODS {
        let recipe = Recipe {
            bodies: 6,
            flexible: 0.5,
            boundary: Some(Boundary::Cantilever),
            base: Some("free"),
            gravity: false,
            loads: false,
            dampers: false,
            ..Recipe::default()
        };
        let mut runs = 0;
        for seed in 0..40 {
            let (system, mut start) = held_by(method, random_loops(700 + seed, &recipe, 1)).build().unwrap();
            let closes_on_modes =
                matches!(&system.closures[0].joint, ClosureJoint::Frames { a, b, .. } if a.attachment.moves() || b.attachment.moves());
            if !closes_on_modes || assembly::assemble(&system, &mut start).is_err() {
                continue;
            }
            let mut frames = vec![WorldFrame::default(); system.bodies.len()];
            let (mut energies, mut residual, mut kinetic) = (Vec::new(), 0.0_f64, 0.0_f64);
            run(&system, &start, dormand_prince(1e-9), 0.2, 50.0, |s| {
                let (energy, _) = balance(s.system, s.state, s.workspace, &mut frames);
                energies.push(energy.total() - s.work);
                kinetic = kinetic.max(energy.kinetic);
                residual = residual.max(s.workspace.pose.closure_residual(s.system, 0));
            });
            let off = energies.iter().map(|e| (e - energies[0]).abs()).fold(0.0, f64::max) / kinetic;
            println!("seed {seed}, {}: energy off by {off:e}, residual {residual:e}", system.bodies.len());
            assert!(off < 1e-6 && residual < 1e-10, "seed {seed}: {off:e}, {residual:e}");
            runs += 1;
            if runs == 5 {
                break;
            }
        }
        assert_eq!(runs, 5);
    }
}

/// C01 with error control: through the change points, or a message that names them and what to do.
#[test]
fn two_four_bars_pass_their_change_points_with_error_control_or_say_why_not() {
    let mut passed = [0, 0];
    for (m, method) in METHODS.into_iter().enumerate() {
        for tolerance in [1e-6, 1e-8, 1e-10, 1e-11] {
            let (system, start) = row_of_four_bars(2, method);
            let settings = Settings { duration: 10.0, method: dormand_prince(tolerance), rate_hz: 1.0 };
            let summary = simulate(&system, &start, &settings, &mut []);
            let q = summary.end.position[system.bodies[system.hinge_index("foot0").unwrap()].position];
            let error = (q.cos() - 0.328_458_111_540_815_4).abs();
            println!(
                "{method} {tolerance:e}: {:?}, off by {error:e}, {} steps, {} rejected",
                summary.outcome, summary.steps, summary.rejected
            );
            match summary.outcome {
                // the error per step adds up over some hundred steps, and rounding near the change points leaves 1e-8
                Outcome::Completed => {
                    assert!(error < 1e3 * tolerance + 5e-8, "{method} {tolerance:e}: {error:e}");
                    passed[m] += 1;
                }
                Outcome::Failed(failure) => assert!(failure.to_string().contains("change point"), "{failure}"),
                Outcome::Stopped => panic!("nobody asked"),
            }
        }
    }
    assert!(passed[0] >= 2 && passed[1] == 4, "{passed:?}");
}

/// A lock on a hinge with an initial rate: assembly stops it to rounding, and rounding is no contradiction.
#[test]
fn locked_hinge_that_was_given_a_rate_rests_without_load() {
    for (kind, method) in ["revolute", "screw"].into_iter().flat_map(|kind| METHODS.map(|method| (kind, method))) {
        let mut only = hinge("only", kind, &[[0.3, 0.5, -0.8]], WORLD, "body", [0.2, -0.4, 0.7]);
        only.parent_frame.quaternion = [0.8, 0.6, 0.0, 0.0];
        (only.velocity, only.pitch) = (vec![1.3], (kind == "screw").then_some(0.4));
        let mut lock = closure("lock", "fixed", &[], WORLD, [0.2, -0.4, 0.7], "body", [0.0; 3]);
        lock.frame_a.quaternion = [0.8, 0.6, 0.0, 0.0];
        let bodies = vec![rigid("body", 2.0, [0.3, 0.1, -0.2], [0.4, 0.5, 0.6])];
        let definition = Definition { bodies, hinges: vec![only], closures: vec![lock], ..Definition::default() };
        let (system, mut state) = held_by(method, definition).build().unwrap();
        assembly::assemble(&system, &mut state).unwrap();
        let workspace = evaluated(&system, &state);
        let left = workspace.acceleration.hinge[0].abs().max(hinge_load(&workspace, 0).amax());
        assert!(left < 1e-9, "{kind}, {method}: {left:e}");
    }
}

/// A gear between two prescribed hinges has no rank to lose: it is no change point, and what it contradicts is said as that.
#[test]
fn gear_between_prescribed_hinges_holds_or_is_refused_by_name() {
    for (amplitude, method) in [0.4, 0.3].into_iter().flat_map(|a| METHODS.map(|method| (a, method))) {
        let wave = |amplitude: f64| Some(TimeFunction::Sine { amplitude: vec![amplitude], frequency_hz: 1.0, phase: 0.0 });
        let [mut first, mut second] =
            ["first", "second"].map(|name| hinge(name, "revolute", &[Z], WORLD, &format!("{name} wheel"), [0.0; 3]));
        (first.motion, second.motion) = (wave(0.2), wave(amplitude));
        let gear = ClosureDefinition {
            name: "gear".into(),
            kind: "gear".into(),
            a: "first".into(),
            b: "second".into(),
            ratio: Some(2.0),
            ..ClosureDefinition::default()
        };
        let bodies = ["first wheel", "second wheel"].map(|name| rigid(name, 1.0, [0.0; 3], [1.0; 3])).to_vec();
        let definition = Definition { bodies, hinges: vec![first, second], closures: vec![gear], ..Definition::default() };
        let (system, state) = held_by(method, definition).build().unwrap();
        let settings = Settings { duration: 0.3, method: dormand_prince(1e-8), rate_hz: 10.0 };
        let summary = simulate(&system, &state, &settings, &mut []);
        if amplitude == 0.4 {
            assert_eq!(summary.outcome, Outcome::Completed, "{method}");
            assert_eq!(evaluated(&system, &state).distance_to_rank_loss(), f64::INFINITY);
        } else {
            let Outcome::Failed(failure) = &summary.outcome else { panic!("{method}: {:?}", summary.outcome) };
            let text = failure.to_string();
            assert!(text.contains("\"gear\"") && !text.contains("change point"), "{method}: {text}");
        }
    }
}

/// A coupler without mass: the cut tree has no inertia there and says what has; the embedded loop moves as the loop with a light coupler.
#[test]
fn massless_link_inside_a_loop_needs_embedding() {
    let with_coupler = |mass: f64, method: &str| {
        let light = |name: &str| rigid(name, mass, [0.5, 0.0, 0.0], [mass / 12.0; 3]);
        let mut crank = hinge("A", "revolute", &[Z], WORLD, "crank", [0.0; 3]);
        crank.position = vec![std::f64::consts::FRAC_PI_3];
        let mut coupler = hinge("B", "revolute", &[Z], "crank", "coupler", [CRANK, 0.0, 0.0]);
        coupler.position = vec![-0.7];
        let mut rocker = hinge("D", "revolute", &[Z], WORLD, "rocker", [2.0, 0.0, 0.0]);
        rocker.position = vec![1.8];
        let closures = vec![closure("C", "revolute", &[Z], "coupler", [COUPLER, 0.0, 0.0], "rocker", [ROCKER, 0.0, 0.0])];
        let bodies = vec![rod("crank", CRANK), light("coupler"), rod("rocker", ROCKER)];
        let gravity = Vector3::new(0.0, -G, 0.0);
        let definition = Definition { gravity, bodies, hinges: vec![crank, coupler, rocker], closures, ..Definition::default() };
        let (system, mut state) = held_by(method, definition).build().unwrap();
        assembly::assemble(&system, &mut state).unwrap();
        let mut workspace = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut workspace).map(|()| workspace.acceleration.hinge[0])
    };
    let error = with_coupler(0.0, METHODS[0]).unwrap_err().to_string();
    assert!(error.contains("\"B\"") && error.contains("constraint_embedding"), "{error}");
    let (massless, light) = (with_coupler(0.0, METHODS[1]).unwrap(), with_coupler(1e-9, METHODS[0]).unwrap());
    // a coupler of 1e-9 kg beside rods of 0.5 and 1.5 kg
    assert!((massless / light - 1.0).abs() < 1e-7, "{massless} {light}");
}
