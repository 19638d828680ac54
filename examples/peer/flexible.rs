//! A free rigid hub under a constant torque that carries a chain of hinged flexible panels: integrated from rest, timed, and shown at
//! its end.
//!
//! Solvers: `rk4`, `rk44`: rk4 in steps of h; `implicit`: rosenbrock_w in steps of h; `rosenbrock_w`, `dormand_prince`: the method with
//! error control at the relative tolerance h, absolute tolerance a thousandth of it; `auto`: as scenes choose it for 60 outputs per second.
//! A request that ends in `history` is answered with the forces at all hinges at those outputs as well.

use crate::panels::Panel;
use cpu_time::ThreadTime;
use nalgebra::{Matrix3, Vector3};
use pliant::dynamics::hinge_load::hinge_load_on_parent;
use pliant::dynamics::world::{WorldFrame, world_frames};
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::integrate::choice::choose;
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, HingeDefinition, LoadDefinition, PointDefinition, WORLD};
use pliant::model::load::LoadAxes;
use pliant::model::{InertiaOrder, System, TimeFunction};
use serde_json::json;
use std::error::Error;
use std::io::{BufRead, Write};
use std::path::Path;

const HUB_MASS: f64 = 200.0;
const HUB_INERTIA: f64 = 50.0;
/// From the hub's centre to the first hinge (m).
const HUB_HALF: f64 = 0.5;
/// On the hub, inertial axes (N m).
const TORQUE: [f64; 3] = [5.0, 20.0, 30.0];
/// Of every hinge: N m/rad and N m s/rad.
const SPRING: [f64; 2] = [200.0, 2.0];
/// Output times per second for which `auto` chooses.
const RATE: f64 = 60.0;
/// Tolerance that no step exceeds: error control off.
const LOOSE: f64 = 1e12;

/// Answers `<panels> <modes> <solver> <h> <T>` (the solver with `@0` or `@1` for inertia of that order instead of 2) until the input ends. A request that has no answer gets an object with `error`.
pub fn serve(folder: &Path) -> Result<(), Box<dyn Error>> {
    for line in std::io::stdin().lock().lines() {
        let answer = answer(folder, &line?).unwrap_or_else(|error| json!({ "error": error.to_string() }));
        println!("{answer}");
        std::io::stdout().flush()?;
    }
    Ok(())
}

/// The system of `count` panels.
fn hub_and_panels(panel: &Panel, count: usize, order: InertiaOrder) -> Definition {
    let hub = BodyDefinition {
        name: "hub".into(),
        kind: BodyDefinitionKind::Rigid {
            mass: HUB_MASS,
            center_of_mass: Vector3::zeros(),
            inertia: Matrix3::from_diagonal_element(HUB_INERTIA),
        },
    };
    let base = HingeDefinition {
        name: "base".into(),
        kind: "free".into(),
        parent: WORLD.into(),
        child: "hub".into(),
        ..HingeDefinition::default()
    };
    let torque = LoadDefinition {
        body: "hub".into(),
        point: PointDefinition::Point(Vector3::zeros()),
        force: None,
        moment: Some(TimeFunction::Constant(TORQUE.to_vec())),
        axes: LoadAxes::World,
    };
    let mut definition = Definition { bodies: vec![hub], hinges: vec![base], loads: vec![torque], ..Definition::default() };
    panel.append(&mut definition, count, order, "hub", Vector3::new(HUB_HALF, 0.0, 0.0), SPRING);
    definition
}

/// Force of every panel on what carries it, panel after panel (N), at every output time.
struct Forces(Vec<Vec<f64>>);

impl Observer for Forces {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        let force = |&k: &usize| hinge_load_on_parent(sample.workspace, k).fixed_rows::<3>(3).iter().copied().collect::<Vec<_>>();
        self.0.push(sample.system.definition_order[1..].iter().flat_map(force).collect());
        Flow::Continue
    }
}

fn method(solver: &str, system: &System, h: f64) -> Option<Method> {
    let tolerance = Tolerance { relative: h, absolute: 1e-3 * h };
    let largest_step = f64::INFINITY;
    Some(match solver {
        "rk4" | "rk44" => Method::RungeKutta4 { step: h },
        "implicit" => Method::RosenbrockW { tolerance: Tolerance { relative: LOOSE, absolute: LOOSE }, largest_step: h },
        "rosenbrock_w" => Method::RosenbrockW { tolerance, largest_step },
        "dormand_prince" => Method::DormandPrince { tolerance, largest_step },
        "auto" => choose(system, tolerance, largest_step, RATE).method,
        _ => return None,
    })
}

fn answer(folder: &Path, request: &str) -> Result<serde_json::Value, Box<dyn Error>> {
    let words: Vec<_> = request.split_whitespace().collect();
    let ([count, modes, solver, h, duration] | [count, modes, solver, h, duration, "history"]) = words[..] else {
        return Err(format!("request \"{request}\" is not <panels> <modes> <solver> <h> <T>, with \"history\" or without").into());
    };
    let (count, modes, h, duration): (usize, usize, f64, f64) = (count.parse()?, modes.parse()?, h.parse()?, duration.parse()?);
    let panel = Panel::of(folder, modes)?;
    let (solver, order) = match solver.split_once('@') {
        None => (solver, InertiaOrder::Second),
        Some((solver, "0")) => (solver, InertiaOrder::Zeroth),
        Some((solver, "1")) => (solver, InertiaOrder::First),
        Some((_, order)) => return Err(format!("inertia order \"{order}\" is not 0 or 1; without one it is 2").into()),
    };
    let (system, state) = hub_and_panels(&panel, count, order).build()?;
    let method = method(solver, &system, h).ok_or_else(|| format!("no solver \"{solver}\""))?;
    let settings = Settings { duration, method, rate_hz: RATE };
    let mut forces = Forces(Vec::new());
    let mut observers: Vec<&mut dyn Observer> = if words.len() > 5 { vec![&mut forces] } else { vec![] };
    let start = ThreadTime::now();
    let summary = simulate(&system, &state, &settings, &mut observers);
    let cpu = start.elapsed().as_secs_f64();
    if let Outcome::Failed(failure) = &summary.outcome {
        return Err(failure.to_string().into());
    }
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &summary.end, &mut workspace)?;
    let mut frames = vec![WorldFrame::default(); system.bodies.len()];
    world_frames(&system, &workspace.pose, &mut frames);
    let (hub, first, last) = (system.definition_order[0], system.definition_order[1], system.definition_order[count]);
    let tip_interface = panel.modal().interface(panel.tip).ok_or("the panel has no tip")?;
    let eta = &summary.end.modal_position[system.bodies[last].modal_range()];
    let moved: Vector3<f64> = tip_interface.mode_shape.iter().zip(eta).map(|(shape, eta)| shape.fixed_rows::<3>(3) * *eta).sum();
    let tip = frames[last].position + frames[last].rotation * (tip_interface.position + moved);
    // as joints of other programs report it: on the hub, in its axes
    let load = hinge_load_on_parent(&workspace, first);
    // what separates finite rotations of interfaces from linear ones, as other programs have them
    let turned = |panel_body: usize| {
        let eta = &summary.end.modal_position[system.bodies[panel_body].modal_range()];
        tip_interface.mode_shape.iter().zip(eta).map(|(shape, eta)| shape.fixed_rows::<3>(0) * *eta).sum::<Vector3<f64>>().norm()
    };
    let rotation = system.definition_order[1..].iter().map(|&k| turned(k)).fold(0.0, f64::max);
    Ok(json!({
        "rotation": rotation, "forces": forces.0,
        "m": count, "n": modes, "solver": solver, "method": method.name(), "h": h, "T": duration, "cpu": cpu, "newton": null,
        "steps": summary.steps, "rejected": summary.rejected, "evaluations": summary.evaluations,
        "tip": tip.as_slice(),
        // row by row
        "hub": frames[hub].rotation.transpose().as_slice(),
        "force": load.fixed_rows::<3>(3).iter().collect::<Vec<_>>(), "torque": load.fixed_rows::<3>(0).iter().collect::<Vec<_>>(),
    }))
}
