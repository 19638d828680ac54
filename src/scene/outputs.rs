//! What a run of a scene gives: the loads and stresses it evaluates, and the limits it watches.

use super::assemble::Assembly;
use super::closures::{closure_index, gear_unit};
use super::error::{SceneError, Source};
use super::locate::Step;
use super::spec::{MonitorSpec, SceneSpec};
use crate::model::System;

/// Limits to watch: of loads at every step and output time, of stress at every output time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Monitor {
    /// Magnitudes of the load at the inboard hinge of a body.
    Hinge {
        /// Index of the body that the hinge carries.
        body: usize,
        /// N m.
        moment_limit: Option<f64>,
        /// N.
        force_limit: Option<f64>,
    },
    /// Magnitudes of the load of a closure; what a gear exerts on an angle counts as a moment, on a travel as a force.
    Closure {
        /// Index of the closure.
        closure: usize,
        /// N m.
        moment_limit: Option<f64>,
        /// N.
        force_limit: Option<f64>,
    },
    /// Von Mises stress of a flexible body.
    Body {
        /// Index of the body.
        body: usize,
        /// Pa.
        stress_limit: Option<f64>,
    },
}

/// What a scene asks for, by index.
pub(super) struct Outputs {
    /// Bodies whose hinge loads are output.
    pub(super) hinges: Vec<usize>,
    /// Closures whose loads are output.
    pub(super) closures: Vec<usize>,
    /// Bodies whose stress is evaluated if they retain a mode.
    pub(super) stress: Vec<usize>,
    pub(super) monitors: Vec<Monitor>,
}

impl Assembly<'_> {
    /// The outputs of `spec`; notes the stress that is left out.
    pub(super) fn outputs(&mut self, spec: &SceneSpec, system: &System) -> Result<Outputs, SceneError> {
        let hinges = match &spec.output.hinges {
            None => system.definition_order.clone(),
            Some(names) => names_to_indices(names, "hinges", "hinge", |n| system.hinge_index(n), &|| hinge_names(system), self.source)?,
        };
        let closures = match &spec.output.closures {
            None => (0..system.closures.len()).collect(),
            Some(names) => {
                names_to_indices(names, "closures", "closure", |n| closure_index(system, n), &|| closure_names(system), self.source)?
            }
        };
        let monitors = spec.monitor.iter().enumerate().map(|(i, m)| monitor(i, m, system, self.source));
        let monitors = monitors.collect::<Result<Vec<_>, _>>()?;
        let stress = self.stress(spec, system, &monitors)?;
        Ok(Outputs { hinges, closures, stress, monitors })
    }

    /// Stress that is asked for by name has to be there, unless the body was told to retain no mode; else all bodies that have it.
    fn stress(&mut self, spec: &SceneSpec, system: &System, monitors: &[Monitor]) -> Result<Vec<usize>, SceneError> {
        let named = match &spec.output.stress {
            None => None,
            Some(names) => Some(names_to_indices(
                names,
                "stress",
                "flexible body",
                |n| flexible_index(system, n),
                &|| flexible_names(system),
                self.source,
            )?),
        };
        let mut asked: Vec<(usize, Vec<Step>)> = Vec::new();
        for (i, monitor) in monitors.iter().enumerate() {
            if let Monitor::Body { body, .. } = *monitor {
                asked.push((body, vec![Step::Key("monitor"), Step::Index(i), Step::Key("body")]));
            }
        }
        for (i, &body) in named.iter().flatten().enumerate() {
            asked.push((body, vec![Step::Key("output"), Step::Key("stress"), Step::Index(i)]));
        }
        for (body, steps) in &asked {
            let name = &system.bodies[*body].name;
            if system.bodies[*body].mode_count() == 0 {
                self.note_left_out(format!("stress of \"{name}\", which retains no mode"));
            } else if !self.has_stress(*body, system)? {
                let message = format!("the modal file of \"{name}\" has no stress modes; write it with modes/stress or drop the name here");
                return Err(self.source.value(steps, message));
            }
        }
        if let Some(named) = named {
            return Ok(named);
        }
        let mut stress = Vec::new();
        for &body in system.definition_order.iter().filter(|&&body| system.bodies[body].mode_count() > 0) {
            if self.has_stress(body, system)? {
                stress.push(body);
            } else {
                self.note_left_out(format!("stress of \"{}\", whose modal file has no stress modes", system.bodies[body].name));
            }
        }
        Ok(stress)
    }

    fn note_left_out(&mut self, line: String) {
        if !self.left_out.contains(&line) {
            self.left_out.push(line);
        }
    }

    /// True if the modal file of `body` has stress modes.
    #[cfg(feature = "hdf5")]
    fn has_stress(&self, body: usize, system: &System) -> Result<bool, SceneError> {
        let Some((place, selection)) = self.chosen.iter().find(|(place, _)| system.definition_order[*place] == body) else {
            return Ok(false);
        };
        selection.file.stress_location().map(|location| location.is_some()).map_err(|source| {
            let at = self.source.at(&[Step::Key("body"), Step::Index(*place), Step::Key("modal_file")]);
            SceneError::ModalFile { path: self.source.path.clone(), at, source }
        })
    }

    /// There are no modal files.
    #[cfg(not(feature = "hdf5"))]
    fn has_stress(&self, _body: usize, _system: &System) -> Result<bool, SceneError> {
        Ok(false)
    }
}

/// What to say of a name that none of `known` is.
fn unknown(name: &str, what: &str, known: Vec<String>) -> String {
    let known: Vec<_> = known.iter().map(|n| format!("\"{n}\"")).collect();
    let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
    format!("\"{name}\" is not a {what} of the scene; there are: {known}")
}

fn hinge_names(system: &System) -> Vec<String> {
    system.definition_order.iter().map(|&k| system.bodies[k].hinge.name.clone()).collect()
}

fn closure_names(system: &System) -> Vec<String> {
    system.closures.iter().map(|c| c.name.clone()).collect()
}

fn flexible_names(system: &System) -> Vec<String> {
    let bodies = system.definition_order.iter().map(|&k| &system.bodies[k]);
    bodies.filter(|b| b.flexible().is_some()).map(|b| b.name.clone()).collect()
}

fn flexible_index(system: &System, name: &str) -> Option<usize> {
    system.body_index(name).filter(|&k| system.bodies[k].flexible().is_some())
}

fn names_to_indices(
    names: &[String],
    key: &'static str,
    what: &str,
    find: impl Fn(&str) -> Option<usize>,
    known: &dyn Fn() -> Vec<String>,
    source: &Source,
) -> Result<Vec<usize>, SceneError> {
    let steps = |i| [Step::Key("output"), Step::Key(key), Step::Index(i)];
    let index = |(i, name): (usize, &String)| {
        if names[..i].contains(name) {
            return Err(source.value(&steps(i), format!("\"{name}\" is named twice; name it once")));
        }
        find(name).ok_or_else(|| source.value(&steps(i), unknown(name, what, known())))
    };
    names.iter().enumerate().map(index).collect()
}

fn monitor(index: usize, spec: &MonitorSpec, system: &System, source: &Source) -> Result<Monitor, SceneError> {
    let at = |key| [Step::Key("monitor"), Step::Index(index), Step::Key(key)];
    for (key, limit) in [("moment_limit", spec.moment_limit), ("force_limit", spec.force_limit), ("stress_limit", spec.stress_limit)] {
        if let Some(limit) = limit.filter(|l| !(*l > 0.0)) {
            return Err(source.value(&at(key), format!("{limit} must be positive; it is a limit on a magnitude")));
        }
    }
    let MonitorSpec { moment_limit, force_limit, stress_limit, .. } = *spec;
    match (&spec.hinge, &spec.closure, &spec.body) {
        (Some(name), None, None) if stress_limit.is_none() => {
            let body = system.hinge_index(name).ok_or_else(|| source.value(&at("hinge"), unknown(name, "hinge", hinge_names(system))))?;
            Ok(Monitor::Hinge { body, moment_limit, force_limit })
        }
        (None, Some(name), None) if stress_limit.is_none() => {
            let closure = closure_index(system, name);
            let closure = closure.ok_or_else(|| source.value(&at("closure"), unknown(name, "closure", closure_names(system))))?;
            let refused = |key, unit, instead| {
                let message =
                    format!("closure \"{name}\" is a gear, and what it exerts on coordinate b is in {unit}; give {instead} instead");
                Err(source.value(&at(key), message))
            };
            match gear_unit(system, &system.closures[closure]) {
                Some(unit @ "N m") if force_limit.is_some() => refused("force_limit", unit, "moment_limit"),
                Some(unit @ "N") if moment_limit.is_some() => refused("moment_limit", unit, "force_limit"),
                _ => Ok(Monitor::Closure { closure, moment_limit, force_limit }),
            }
        }
        (None, None, Some(name)) if moment_limit.is_none() && force_limit.is_none() => {
            let body = flexible_index(system, name);
            let body = body.ok_or_else(|| source.value(&at("body"), unknown(name, "flexible body", flexible_names(system))))?;
            Ok(Monitor::Body { body, stress_limit })
        }
        _ => Err(source.value(
            &[Step::Key("monitor"), Step::Index(index)],
            "a monitor watches one of hinge = NAME or closure = NAME with moment_limit, force_limit, or body = NAME with stress_limit",
        )),
    }
}

/// `loaded` are the numbers of hinges and closures whose loads are output.
pub(super) fn describe_left_out(spec: &SceneSpec, system: &System, loaded: [usize; 2], left_out: &mut Vec<String>) {
    if system.modal_count == 0 {
        left_out.push("modes (no flexible body)".into());
    }
    if spec.gravity == [0.0; 3] {
        left_out.push("gravity".into());
    }
    if system.loads.is_empty() {
        left_out.push("external loads".into());
    }
    let all = [(system.bodies.len(), "hinges"), (system.closures.len(), "closures")];
    for ((count, what), loaded) in all.into_iter().zip(loaded) {
        if loaded < count {
            left_out.push(format!("loads at {} of {count} {what}", count - loaded));
        }
    }
    if !spec.output.audit {
        left_out.push("load audit".into());
    }
    if system.closures.is_empty() {
        left_out.push("closures".into());
    }
}
