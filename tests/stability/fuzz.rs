//! A hundred thousand systems with numbers that nobody means (S18): an answer of finite numbers, or an error of a type.

use crate::row::{Row, assert_rows};
use crate::support::scenes::{Z, dormand_prince, exact_beam, flexible, hinge, rigid, rk4};
use nalgebra::Vector3;
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use pliant::model::build::{BodyDefinitionKind, Definition, LoadDefinition, PointDefinition, WORLD};
use pliant::model::{LoadAxes, TimeFunction};
use pliant::output::Evaluation;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

const EXTREMES: [f64; 20] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    5e-324,
    1e-310,
    f64::MIN_POSITIVE,
    1e-200,
    1e-155,
    1e-16,
    -1.0,
    1e16,
    1e100,
    1e155,
    1e200,
    1e308,
    -1e308,
    f64::MAX,
    f64::MIN,
];

const KINDS: [(&str, usize, usize, usize); 8] = [
    ("revolute", 1, 1, 1),
    ("prismatic", 1, 1, 1),
    ("cylindrical", 1, 2, 2),
    ("universal", 2, 2, 2),
    ("gimbal", 3, 3, 3),
    ("planar", 2, 3, 3),
    ("spherical", 0, 4, 3),
    ("free", 0, 7, 6),
];

/// A chain of one to three bodies, some flexible, every number of which is an ordinary one.
fn ordinary(rng: &mut StdRng) -> Definition {
    let mut definition = Definition { gravity: Vector3::new(0.3, -9.81, 0.2), ..Definition::default() };
    let count = rng.random_range(1..4);
    for i in 0..count {
        let name = format!("b{i}");
        let (kind, axes, coordinates, rates) = KINDS[rng.random_range(0..KINDS.len())];
        let flexible_parent = i > 0 && matches!(definition.bodies[i - 1].kind, BodyDefinitionKind::Flexible(_));
        let parent = if i == 0 { WORLD.to_owned() } else { format!("b{}", i - 1) };
        let mut joint = hinge(&format!("h{i}"), kind, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], Z][..axes], &parent, &name, [0.4, 0.1, 0.0]);
        joint.parent_node = flexible_parent.then(|| "tip".into());
        joint.position = match kind {
            "spherical" => vec![1.0, 0.0, 0.0, 0.0],
            "free" => vec![0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0],
            _ => (0..coordinates).map(|_| rng.random_range(-1.0..1.0)).collect(),
        };
        joint.velocity = (0..rates).map(|_| rng.random_range(-1.0..1.0)).collect();
        (joint.stiffness, joint.damping, joint.rest) = (vec![3.0], vec![0.2], vec![0.1]);
        joint.torque = Some(TimeFunction::Sine { amplitude: vec![0.5; rates], frequency_hz: 0.3, phase: 0.2 });
        definition.hinges.push(joint);
        let load_at = if rng.random_bool(0.3) {
            definition.bodies.push(flexible(&name, exact_beam(2)));
            PointDefinition::Interface("tip".into())
        } else {
            definition.bodies.push(rigid(&name, 2.0, [0.2, 0.1, -0.1], [0.3, 0.4, 0.5]));
            PointDefinition::Point(Vector3::new(0.1, 0.2, 0.3))
        };
        let force = Some(TimeFunction::Constant(vec![1.0, 2.0, 3.0]));
        definition.loads.push(LoadDefinition { body: name, point: load_at, force, moment: None, axes: LoadAxes::World });
    }
    definition
}

/// Every number of a definition that a scene may give, by reference.
fn numbers(definition: &mut Definition) -> Vec<&mut f64> {
    let mut out: Vec<&mut f64> = definition.gravity.iter_mut().collect();
    for body in &mut definition.bodies {
        match &mut body.kind {
            BodyDefinitionKind::Rigid { mass, center_of_mass, inertia } => {
                out.push(mass);
                out.extend(center_of_mass.iter_mut());
                out.extend(inertia.iter_mut());
            }
            BodyDefinitionKind::Flexible(f) => {
                f.modal_position.resize(2, 0.01);
                f.modal_velocity.resize(2, 0.02);
                out.extend(f.modal_position.iter_mut().chain(&mut f.modal_velocity).chain(&mut f.damping_ratio));
            }
        }
    }
    for hinge in &mut definition.hinges {
        out.extend(hinge.axes.iter_mut().flat_map(|a| a.iter_mut()));
        out.extend(hinge.parent_frame.position.iter_mut().chain(&mut hinge.parent_frame.quaternion));
        out.extend(hinge.child_frame.position.iter_mut().chain(&mut hinge.child_frame.quaternion));
        out.extend(hinge.position.iter_mut().chain(&mut hinge.velocity));
        out.extend(hinge.stiffness.iter_mut().chain(&mut hinge.damping).chain(&mut hinge.rest));
        if let Some(TimeFunction::Sine { amplitude, frequency_hz, phase }) = &mut hinge.torque {
            out.extend(amplitude.iter_mut().chain([frequency_hz, phase]));
        }
    }
    for load in &mut definition.loads {
        if let PointDefinition::Point(point) = &mut load.point {
            out.extend(point.iter_mut());
        }
        if let Some(TimeFunction::Constant(values)) = &mut load.force {
            out.extend(values.iter_mut());
        }
    }
    out
}

/// One system with one to three numbers replaced.
fn broken(rng: &mut StdRng) -> Definition {
    let mut definition = ordinary(rng);
    for _ in 0..rng.random_range(1..4) {
        let value = EXTREMES[rng.random_range(0..EXTREMES.len())];
        let mut all = numbers(&mut definition);
        let index = rng.random_range(0..all.len());
        *all[index] = value;
    }
    // a whole inertia of one size passes the checks of shape
    if rng.random_bool(0.1) {
        let size = EXTREMES[rng.random_range(3..EXTREMES.len())].abs();
        for body in &mut definition.bodies {
            if let BodyDefinitionKind::Rigid { mass, inertia, .. } = &mut body.kind {
                (*mass, *inertia) = (size, nalgebra::Matrix3::from_diagonal_element(size));
            }
        }
    }
    definition
}

#[test]
fn evaluations_of_extreme_numbers_are_finite_or_refused() {
    let (mut refused, mut failed, mut answered, mut wrong) = (0, 0, 0, Vec::new());
    for seed in 0..100_000 {
        let rng = &mut StdRng::seed_from_u64(seed);
        let definition = broken(rng);
        let Ok((system, mut state)) = definition.build() else {
            refused += 1;
            continue;
        };
        if rng.random_bool(0.1) {
            state.time = EXTREMES[rng.random_range(3..EXTREMES.len())];
            state.apply_prescribed(&system);
        }
        match Evaluation::of(&system, &state) {
            Ok(evaluation) if evaluation.is_finite() => answered += 1,
            Ok(_) => wrong.push(seed),
            Err(_) => failed += 1,
        }
    }
    println!("{refused} refused, {failed} without an answer, {answered} answered; wrong: {wrong:?}");
    assert!(answered > 10_000 && failed > 1_000 && refused > 10_000);
    let found = format!("{}", wrong.len());
    assert_rows(&[Row::holds("S18", "100,000 systems with extreme numbers: not finite and not refused", "0", found, wrong.is_empty())]);
}

/// Stops a run after some steps.
struct Patience(u64);

impl Observer for Patience {
    fn observe(&mut self, _: &Sample<'_>) -> Flow {
        Flow::Continue
    }

    fn step(&mut self, sample: &Sample<'_>) -> Flow {
        if sample.steps > self.0 { Flow::Stop } else { Flow::Continue }
    }
}

#[test]
fn runs_of_extreme_numbers_end_in_finite_numbers_or_a_message() {
    let (mut completed, mut failed, mut wrong) = (0, 0, Vec::new());
    let tolerance = Tolerance { relative: 1e-4, absolute: 1e-4 };
    let methods = [rk4(1e-3), dormand_prince(1e-4), Method::RosenbrockW { tolerance, largest_step: f64::INFINITY }];
    for seed in 200_000..203_000 {
        let rng = &mut StdRng::seed_from_u64(seed);
        let Ok((system, state)) = broken(rng).build() else { continue };
        let settings = Settings { duration: 0.02, method: methods[seed as usize % 3], rate_hz: 100.0 };
        let begin = std::time::Instant::now();
        let mut patience = Patience(2_000);
        let summary = simulate(&system, &state, &settings, &mut [&mut patience]);
        let finite = summary.end.is_finite();
        match summary.outcome {
            // what is finite and slow is no fault: a spring of 1e16 has a period of 1e-8 s
            Outcome::Completed | Outcome::Stopped if finite => completed += 1,
            Outcome::Failed(failure) if finite && !failure.to_string().is_empty() => failed += 1,
            _ => wrong.push(seed),
        }
        if begin.elapsed().as_secs_f64() > 5.0 {
            println!("seed {seed} took {} s, {} steps", begin.elapsed().as_secs_f64(), summary.steps);
            wrong.push(seed);
        }
    }
    println!("{completed} completed, {failed} ended early; wrong: {wrong:?}");
    assert!(completed > 100 && failed > 50);
    let found = format!("{}", wrong.len());
    assert_rows(&[Row::holds(
        "S18",
        "3,000 runs with extreme numbers: not finite, without a message or longer than 5 s",
        "0",
        found,
        wrong.is_empty(),
    )]);
}
