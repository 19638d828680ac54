//! `pliant eval`: one evaluation of a scene.

use super::args::{EvalArguments, SceneArguments};
use super::failure::Failure;
use super::report::{Align, Table, number};
use crate::dynamics::closed_chain::assembly;
use crate::output::Evaluation;
use crate::scene::{Overrides, assemble};
use std::io::Write;

impl From<&SceneArguments> for Overrides {
    fn from(arguments: &SceneArguments) -> Self {
        Self {
            integrator: arguments.integrator.clone(),
            modes: arguments.modes,
            residual_modes: arguments.residual_modes.then_some(true),
            rigid: arguments.rigid.clone(),
            closure_method: arguments.closure_method.clone(),
            ..Self::default()
        }
    }
}

/// Evaluates the scene and prints the result.
pub fn run(arguments: &EvalArguments, output: &mut dyn Write) -> Result<(), Failure> {
    if !arguments.time.is_finite() {
        return Err(Failure::input(format!("--time {} must be a finite number of seconds", arguments.time)));
    }
    let scene = assemble::load(&arguments.scene, &Overrides::from(&arguments.overrides))?;
    let mut state = scene.state.clone();
    state.time = arguments.time;
    state.apply_prescribed(&scene.system);
    assembly::assemble(&scene.system, &mut state).map_err(|e| Failure::input(e.to_string()))?;
    let evaluation = Evaluation::of(&scene.system, &state)?;
    for warning in &scene.warnings {
        // standard output is for the evaluation alone
        let _ = writeln!(std::io::stderr(), "warning: {warning}");
    }
    if arguments.json {
        let text = serde_json::to_string_pretty(&evaluation).map_err(|e| Failure::Output(e.into()))?;
        writeln!(output, "{text}")?;
        return Ok(());
    }
    writeln!(output, "{} at t = {} s", scene.name, number(arguments.time))?;
    write_tables(&evaluation, output)
}

/// Loads and accelerations in tables.
fn write_tables(evaluation: &Evaluation, output: &mut dyn Write) -> Result<(), Failure> {
    let right = Align::Right;
    let mut loads = Table::new(&[
        ("hinge", Align::Left),
        ("moment x", right),
        ("y", right),
        ("z (N m)", right),
        ("force x", right),
        ("y", right),
        ("z (N)", right),
        ("acceleration", Align::Left),
    ]);
    for (name, hinge) in evaluation.hinges.iter() {
        let numbers = hinge.load.moment.iter().chain(&hinge.load.force).map(|x| number(*x));
        let acceleration = hinge.acceleration.iter().map(|x| number(*x)).collect::<Vec<_>>().join(" ");
        loads.row(std::iter::once(name.to_owned()).chain(numbers).chain([acceleration]));
    }
    writeln!(output, "hinge loads, by the parent on the child, moment about O, in O axes:")?;
    loads.write(output)?;
    for (name, body) in evaluation.bodies.iter() {
        let list = |x: &[f64]| x.iter().map(|x| number(*x)).collect::<Vec<_>>().join(" ");
        writeln!(output, "modal accelerations of {name}: {}", list(&body.modal_acceleration))?;
    }
    for (name, closure) in evaluation.closures.iter() {
        let list = |x: &[f64; 3]| x.map(number).join(" ");
        let load = match closure.coordinate_force {
            Some(force) => format!("{} on coordinate b", number(force)),
            None => {
                format!("moment {} N m, force {} N on b at b's point, in a's axes", list(&closure.load.moment), list(&closure.load.force))
            }
        };
        writeln!(output, "closure {name}: {load}; open by {:.1e}", closure.residual)?;
    }
    let energy = &evaluation.energy;
    writeln!(
        output,
        "energy (J): kinetic {}, strain {}, potential {}; load audit {:.1e}",
        number(energy.kinetic),
        number(energy.strain),
        number(energy.potential),
        evaluation.audit.load_residual
    )?;
    Ok(())
}
