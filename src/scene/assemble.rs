//! A scene file to a [`Scene`]: the system, its initial state, and what a run of it shall do.

use super::error::{SceneError, Source};
use super::functions::function;
use super::locate::{Step, first_not_finite};
#[cfg(feature = "hdf5")]
use super::modal_files::ModalFiles;
use super::outputs::{Monitor, Outputs, describe_left_out};
use super::remarks::remarks;
use super::settings;
use super::spec::{BodySpec, FunctionSpec, HingeSpec, LoadSpec, Numbers, SceneSpec};
use crate::dynamics::closed_chain::assembly;
use crate::integrate::simulate::Method;
use crate::model::build::{BodyDefinition, BodyDefinitionKind, Definition, Frame, HingeDefinition, LoadDefinition, PointDefinition};
#[cfg(feature = "hdf5")]
use crate::model::left_out::{LeftOut, LeftOutModes};
use crate::model::{ClosureMethod, LoadAxes, State, System, TimeFunction};
use nalgebra::{Matrix3, Vector3};
use std::path::Path;

/// What the command line changes in a scene.
#[derive(Debug, Clone, Default)]
pub struct Overrides {
    /// Integrator by name.
    pub integrator: Option<String>,
    /// Retain the lowest N modes of every flexible body.
    pub modes: Option<usize>,
    /// Add residual modes to every flexible body that leaves modes out, or to none.
    pub residual_modes: Option<bool>,
    /// Use the geometric stiffness of every flexible body whose modal file has it, or of none.
    pub geometric_stiffness: Option<bool>,
    /// Flexible bodies to make rigid.
    pub rigid: Vec<String>,
    /// Simulated time (s).
    pub duration: Option<f64>,
    /// Method for all closures.
    pub closure_method: Option<String>,
    /// Order of the inertia in the modal coordinates, for every flexible body.
    pub inertia_order: Option<u8>,
}

/// A scene ready to run.
#[derive(Debug)]
pub struct Scene {
    /// Title, or the file's name.
    pub name: String,
    /// Text and path.
    pub source: Source,
    /// The system.
    pub system: System,
    /// State at time zero.
    pub state: State,
    /// Integration method.
    pub method: Method,
    /// Why this method, where the scene leaves the choice to pliant.
    pub method_reason: Option<String>,
    /// Tolerances and bound on the step, whether the method uses them or not.
    pub control: settings::Control,
    /// Simulated time (s), if the scene gives one.
    pub duration: Option<f64>,
    /// Output times per second.
    pub rate_hz: f64,
    /// Bodies whose hinge loads are output.
    pub hinges: Vec<usize>,
    /// Closures whose loads are output.
    pub closures: Vec<usize>,
    /// Bodies whose stress is evaluated if they retain a mode; monitors name others.
    pub stress: Vec<usize>,
    /// True if the scene names these; else they are all that have stress modes.
    pub stress_named: bool,
    /// Whether output times are audited.
    pub audit: bool,
    /// Whether the effect of modes that are left out is estimated.
    pub truncation: bool,
    /// Limits.
    pub monitors: Vec<Monitor>,
    /// Factor on deformations in the picture.
    pub deformation_scale: f64,
    /// Box of each rigid body that has one (m), by body index.
    pub boxes: Vec<Option<[f64; 3]>>,
    /// Modal file and modes of each flexible body, by body index.
    #[cfg(feature = "hdf5")]
    pub flexible: Vec<(usize, super::modal_files::Selection)>,
    /// What the scene does not need or was told to leave out.
    pub left_out: Vec<String>,
    /// What a user should know before it runs.
    pub warnings: Vec<String>,
    /// The scene's keys as they were assembled.
    #[cfg(feature = "hdf5")]
    spec: SceneSpec,
    /// What the command line changed.
    #[cfg(feature = "hdf5")]
    overrides: Overrides,
    /// Modal files read so far.
    #[cfg(feature = "hdf5")]
    files: super::modal_files::ModalFiles,
}

impl Scene {
    /// The modal files that were read, for scenes that use the same.
    #[cfg(feature = "hdf5")]
    #[must_use]
    pub fn modal_files(&self) -> ModalFiles {
        self.files.clone()
    }

    /// The integrator of that name at another accuracy than the scene's; none for a name that is not known.
    #[must_use]
    pub fn method_at(&self, integrator: &str, accuracy: settings::Accuracy) -> Option<Method> {
        let (control, step) = match accuracy {
            settings::Accuracy::Tolerance(relative) => (self.control.at(relative), None),
            settings::Accuracy::Step(step) => (self.control, Some(step)),
        };
        settings::named(integrator, &control, step, &self.system, self.rate_hz).map(|(method, _)| method)
    }

    /// True if a monitor watches the stress of `body`.
    #[must_use]
    pub fn monitors_stress(&self, body: usize) -> bool {
        self.monitors.iter().any(|m| matches!(m, Monitor::Body { body: b, .. } if *b == body))
    }

    /// Bodies whose stress the scene asks for by name, in a monitor or in `output.stress`, in the order in which it defines them.
    #[must_use]
    pub fn asked_stress(&self) -> Vec<usize> {
        let asked = |body: &usize| self.monitors_stress(*body) || (self.stress_named && self.stress.contains(body));
        self.system.definition_order.iter().copied().filter(asked).collect()
    }

    /// The modes that the scene leaves out, beside the system with all of them, its inertia that of the undeformed bodies; none if none are, or if the scene cannot be assembled
    /// with all modes.
    #[cfg(feature = "hdf5")]
    #[must_use]
    pub fn left_out_modes(&self) -> Option<LeftOutModes> {
        if self.flexible.iter().all(|(_, selection)| selection.basis.is_complete()) {
            return None;
        }
        let all = Overrides {
            modes: Some(usize::MAX),
            residual_modes: Some(false),
            // an estimate to first order needs no inertia that follows the deformation, and no n^2 terms
            inertia_order: Some(0),
            geometric_stiffness: Some(false),
            closure_method: Some(ClosureMethod::TreeAugmented.name().to_owned()),
            ..self.overrides.clone()
        };
        let scene = assemble_spec(self.source.clone(), self.spec.clone(), &all, self.files.clone()).ok()?;
        let left_out = self.flexible.iter().filter_map(|(body, selection)| {
            let flexible = scene.system.bodies[*body].flexible()?;
            // a body that is made rigid stays so
            let fits = flexible.mode_count() == selection.basis.available() && !selection.basis.is_complete();
            fits.then(|| LeftOut::new(*body, &selection.all, &selection.basis, flexible))
        });
        let bodies: Vec<_> = left_out.collect();
        (!bodies.is_empty()).then_some(LeftOutModes { bodies, system: scene.system })
    }
}

/// Reads and assembles the scene at `path`.
///
/// # Errors
/// [`SceneError`] with file, line, column, key, what was found and what to write instead.
pub fn load(path: &Path, overrides: &Overrides) -> Result<Scene, SceneError> {
    let text = std::fs::read_to_string(path).map_err(|e| SceneError::unreadable(path, "scene", &e))?;
    assemble(Source { path: path.to_owned(), text }, overrides)
}

/// Assembles a scene from its text; paths are relative to `source.path`.
///
/// # Errors
/// As [`load`].
pub fn assemble(source: Source, overrides: &Overrides) -> Result<Scene, SceneError> {
    let spec: SceneSpec = toml::from_str(&source.text).map_err(|e| syntax(&source, &e))?;
    if let Some(at) = first_not_finite(&source.text) {
        let message = "the number is not finite; write a finite number".to_owned();
        return Err(SceneError::Value { path: source.path, at, message });
    }
    assemble_spec(source, spec, overrides, Files::default())
}

/// Assembles the scene of `source` with values put into its keys: `document` is its text, parsed and changed. Errors point into the text
/// as it was. `files` are modal files that were read before.
///
/// # Errors
/// As [`load`].
#[cfg(feature = "hdf5")]
pub fn assemble_document(source: Source, document: toml::Table, overrides: &Overrides, files: ModalFiles) -> Result<Scene, SceneError> {
    let spec: SceneSpec = document.try_into().map_err(|e| syntax(&source, &e))?;
    assemble_spec(source, spec, overrides, files)
}

fn syntax(source: &Source, error: &toml::de::Error) -> SceneError {
    let mut message = error.to_string().trim_end().to_owned();
    let plan_keys = ["parameter", "samples", "seed"];
    if toml::from_str::<toml::Table>(&source.text).is_ok_and(|table| plan_keys.iter().any(|key| table.contains_key(*key))) {
        message +=
            &format!("\nthis looks like the plan of a campaign; run it with its scene: pliant sweep SCENE.toml {}", source.path.display());
    }
    SceneError::Syntax { path: source.path.clone(), message }
}

#[cfg(feature = "hdf5")]
type Files = ModalFiles;
/// No modal files without the feature.
#[cfg(not(feature = "hdf5"))]
#[derive(Default)]
struct Files {}

/// As [`assemble`], with the modal files `files` already read.
fn assemble_spec(source: Source, spec: SceneSpec, overrides: &Overrides, files: Files) -> Result<Scene, SceneError> {
    #[cfg(not(feature = "hdf5"))]
    let Files {} = files;
    check_overrides(&spec, overrides)?;
    let mut assembly = Assembly {
        source: &source,
        overrides,
        left_out: Vec::new(),
        #[cfg(feature = "hdf5")]
        files,
        #[cfg(feature = "hdf5")]
        chosen: Vec::new(),
    };
    let definition = assembly.definition(&spec)?;
    let (system, mut state) = definition.build().map_err(|e| source.model(&e))?;
    let given = state.clone();
    let assembled = assembly::assemble(&system, &mut state)
        .map_err(|e| source.value(&[Step::Key("closure"), Step::Index(e.closure), Step::Key("name")], e.to_string()))?;

    if !(spec.output.rate_hz > 0.0) {
        return Err(source.value(&[Step::Key("output"), Step::Key("rate_hz")], format!("{} must be positive", spec.output.rate_hz)));
    }
    let scale = spec.viewer.deformation_scale;
    if !(scale > 0.0) {
        return Err(source.value(&[Step::Key("viewer"), Step::Key("deformation_scale")], format!("{scale} must be positive")));
    }
    let duration = overrides.duration.or(spec.simulation.duration);
    if let Some(duration) = duration.filter(|d| !(*d > 0.0 && d.is_finite())) {
        return Err(source.value(&[Step::Key("simulation"), Step::Key("duration")], format!("{duration} s must be positive")));
    }
    let control = settings::control(&spec.simulation, &source)?;
    let (method, method_reason) =
        settings::method(&spec.simulation, &control, overrides.integrator.as_deref(), &system, spec.output.rate_hz, &source)?;
    let Outputs { hinges, closures, stress, monitors } = assembly.outputs(&spec, &system)?;
    let warnings = remarks(&system, &given, &state, &assembled, &monitors);
    let mut boxes = vec![None; system.bodies.len()];
    for (body, &k) in spec.body.iter().zip(&system.definition_order) {
        boxes[k] = body.box_size;
    }
    let mut left_out = std::mem::take(&mut assembly.left_out);
    describe_left_out(&spec, &system, [hinges.len(), closures.len()], &mut left_out);
    #[cfg(feature = "hdf5")]
    if !spec.output.truncation && assembly.chosen.iter().any(|(_, selection)| !selection.basis.is_complete()) {
        left_out.push("estimate of what left-out modes change".into());
    }
    let name =
        spec.name.clone().unwrap_or_else(|| source.path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned()));
    #[cfg(feature = "hdf5")]
    let flexible = assembly.chosen.into_iter().map(|(definition, selection)| (system.definition_order[definition], selection)).collect();
    Ok(Scene {
        name,
        system,
        state,
        method,
        method_reason,
        control,
        duration,
        rate_hz: spec.output.rate_hz,
        hinges,
        closures,
        stress,
        stress_named: spec.output.stress.is_some(),
        audit: spec.output.audit,
        truncation: spec.output.truncation,
        monitors,
        deformation_scale: spec.viewer.deformation_scale,
        boxes,
        #[cfg(feature = "hdf5")]
        flexible,
        left_out,
        warnings,
        #[cfg(feature = "hdf5")]
        spec,
        #[cfg(feature = "hdf5")]
        overrides: overrides.clone(),
        #[cfg(feature = "hdf5")]
        files: assembly.files,
        source,
    })
}

/// A scene on its way to a definition.
pub(super) struct Assembly<'a> {
    pub(super) source: &'a Source,
    pub(super) overrides: &'a Overrides,
    pub(super) left_out: Vec<String>,
    /// Files read so far.
    #[cfg(feature = "hdf5")]
    pub(super) files: super::modal_files::ModalFiles,
    /// Modal file and modes of each flexible body, by its place in the scene.
    #[cfg(feature = "hdf5")]
    pub(super) chosen: Vec<(usize, super::modal_files::Selection)>,
}

fn check_overrides(spec: &SceneSpec, overrides: &Overrides) -> Result<(), SceneError> {
    let flexible: Vec<_> = spec.body.iter().filter(|b| b.is_flexible()).map(|b| b.name.as_str()).collect();
    if let Some(method) = overrides.closure_method.as_deref().filter(|m| !ClosureMethod::is_known(m)) {
        let message = format!("\"{method}\" is not a closure method; known: {}", ClosureMethod::NAMES.join(", "));
        return Err(SceneError::Override { option: "--closure-method", message });
    }
    if let Some(order) = overrides.inertia_order.filter(|o| *o > 2) {
        return Err(SceneError::Override { option: "--orders", message: format!("{order} must be 0, 1 or 2") });
    }
    match overrides.rigid.iter().find(|name| !flexible.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => Err(SceneError::Override {
            option: "--rigid",
            message: format!(
                "\"{name}\" is not a flexible body of the scene; flexible bodies: {}",
                if flexible.is_empty() { "none".into() } else { flexible.join(", ") }
            ),
        }),
    }
}

impl Assembly<'_> {
    fn definition(&mut self, spec: &SceneSpec) -> Result<Definition, SceneError> {
        let mut definition = Definition { gravity: Vector3::from(spec.gravity), ..Definition::default() };
        for (index, body) in spec.body.iter().enumerate() {
            let kind = self.body(index, body, spec)?;
            definition.bodies.push(BodyDefinition { name: body.name.clone(), kind });
        }
        for (index, hinge) in spec.hinge.iter().enumerate() {
            definition.hinges.push(self.hinge(index, hinge)?);
        }
        for (index, load) in spec.load.iter().enumerate() {
            definition.loads.push(self.load(index, load, spec, &definition)?);
        }
        for (index, closure) in spec.closure.iter().enumerate() {
            definition.closures.push(super::closures::closure(index, closure, self.overrides.closure_method.as_deref(), self.source)?);
        }
        Ok(definition)
    }

    fn body(&mut self, index: usize, body: &BodySpec, spec: &SceneSpec) -> Result<BodyDefinitionKind, SceneError> {
        let at = |key| [Step::Key("body"), Step::Index(index), Step::Key(key)];
        let rigid_keys =
            [("mass", body.mass.is_some()), ("center_of_mass", body.center_of_mass.is_some()), ("inertia", body.inertia.is_some())];
        let flexible_keys = [
            ("modes", body.modes.is_some()),
            ("residual_modes", body.residual_modes.is_some()),
            ("damping_ratio", body.damping_ratio.is_some()),
            ("inertia_order", body.inertia_order.is_some()),
            ("geometric_stiffness", body.geometric_stiffness.is_some()),
            ("modal_position", !body.modal_position.is_empty()),
            ("modal_velocity", !body.modal_velocity.is_empty()),
        ];
        let (foreign, needed) = if body.is_flexible() { (rigid_keys.as_slice(), "mass") } else { (flexible_keys.as_slice(), "modal_file") };
        if let Some((key, _)) = foreign.iter().find(|(_, given)| *given) {
            let message = if needed == "mass" {
                format!(
                    "body \"{}\" has {}, which gives its mass properties; remove {key}",
                    body.name,
                    if body.import.is_some() { "an import" } else { "a modal_file" }
                )
            } else {
                format!("body \"{}\" has no modal_file; {key} belongs to flexible bodies", body.name)
            };
            return Err(self.source.value(&at(key), message));
        }
        if let Some(size) = body.box_size.filter(|s| !s.iter().all(|x| *x > 0.0)) {
            return Err(self.source.value(&at("box"), format!("{size:?} must be three positive lengths")));
        }
        if body.modal_file.is_some() && body.import.is_some() {
            return Err(self.source.value(&at("import"), format!("body \"{}\" has a modal_file too; give one of both", body.name)));
        }
        match body.is_flexible() {
            true => self.flexible(index, body, spec),
            false => {
                let Some(mass) = body.mass else {
                    let message = format!("body \"{}\" needs mass and inertia (rigid), or modal_file or import (flexible)", body.name);
                    return Err(self.source.value(&[Step::Key("body"), Step::Index(index)], message));
                };
                let rows = body.inertia.unwrap_or_default();
                Ok(BodyDefinitionKind::Rigid {
                    mass,
                    center_of_mass: Vector3::from(body.center_of_mass.unwrap_or_default()),
                    inertia: Matrix3::from_fn(|i, j| rows[i][j]),
                })
            }
        }
    }

    #[cfg(not(feature = "hdf5"))]
    fn flexible(&mut self, index: usize, body: &BodySpec, _spec: &SceneSpec) -> Result<BodyDefinitionKind, SceneError> {
        let key = if body.import.is_some() { "import" } else { "modal_file" };
        Err(self.source.value(
            &[Step::Key("body"), Step::Index(index), Step::Key(key)],
            "this build reads no modal files; build with the feature \"hdf5\"",
        ))
    }

    fn hinge(&self, index: usize, hinge: &HingeSpec) -> Result<HingeDefinition, SceneError> {
        let at = |key| [Step::Key("hinge"), Step::Index(index), Step::Key(key)];
        let axes = match (&hinge.axis, &hinge.axes) {
            (Some(_), Some(_)) => return Err(self.source.value(&at("axes"), "give axis (one) or axes (several), not both")),
            (Some(axis), None) => vec![Vector3::from(*axis)],
            (None, axes) => axes.iter().flatten().map(|a| Vector3::from(*a)).collect(),
        };
        let numbers = |n: &Option<Numbers>| n.as_ref().map(Numbers::list).unwrap_or_default();
        let of = |spec: &Option<FunctionSpec>, key| spec.as_ref().map(|f| function(f, self.source, &at(key))).transpose();
        Ok(HingeDefinition {
            name: hinge.name.clone(),
            kind: hinge.kind.clone(),
            axes,
            pitch: hinge.pitch,
            parent: hinge.parent.clone(),
            parent_node: hinge.parent_node.clone(),
            parent_frame: Frame { position: Vector3::from(hinge.parent_frame.position), quaternion: hinge.parent_frame.quaternion },
            child: hinge.child.clone(),
            child_node: hinge.child_node.clone(),
            child_frame: Frame { position: Vector3::from(hinge.child_frame.position), quaternion: hinge.child_frame.quaternion },
            position: hinge.position.clone(),
            velocity: hinge.velocity.clone(),
            stiffness: numbers(&hinge.stiffness),
            damping: numbers(&hinge.damping),
            rest: numbers(&hinge.rest),
            torque: of(&hinge.torque, "torque")?,
            motion: of(&hinge.motion, "motion")?,
            held: hinge.held,
        })
    }

    fn load(&mut self, index: usize, load: &LoadSpec, spec: &SceneSpec, definition: &Definition) -> Result<LoadDefinition, SceneError> {
        let at = |key| [Step::Key("load"), Step::Index(index), Step::Key(key)];
        let whole = [Step::Key("load"), Step::Index(index)];
        let of = |spec: &Option<FunctionSpec>, key| -> Result<Option<TimeFunction>, SceneError> {
            spec.as_ref().map(|f| function(f, self.source, &at(key))).transpose()
        };
        let axes = match load.axes.as_str() {
            "world" => LoadAxes::World,
            "body" => LoadAxes::Body,
            other => return Err(self.source.value(&at("axes"), format!("\"{other}\" must be \"world\" or \"body\""))),
        };
        if load.force.is_none() && load.moment.is_none() {
            return Err(self.source.value(&whole, "a load needs force, moment or both"));
        }
        let number = definition.bodies.iter().position(|b| b.name == load.body);
        let flexible = number.is_some_and(|n| matches!(definition.bodies[n].kind, BodyDefinitionKind::Flexible(_)));
        let point = match (&load.node, load.mesh_node, load.point) {
            (Some(node), None, None) => PointDefinition::Interface(node.clone()),
            (None, Some(node), None) => self.mesh_node(index, node, number)?,
            (None, None, Some(point)) => PointDefinition::Point(Vector3::from(point)),
            (None, None, None) if !flexible => {
                PointDefinition::Point(Vector3::from(number.and_then(|n| spec.body[n].center_of_mass).unwrap_or_default()))
            }
            _ => {
                return Err(self
                    .source
                    .value(&whole, "say where the load acts by one of node, mesh_node (flexible bodies) or point (rigid bodies)"));
            }
        };
        Ok(LoadDefinition { body: load.body.clone(), point, force: of(&load.force, "force")?, moment: of(&load.moment, "moment")?, axes })
    }

    #[cfg(not(feature = "hdf5"))]
    fn mesh_node(&mut self, index: usize, _node: usize, _number: Option<usize>) -> Result<PointDefinition, SceneError> {
        Err(self.source.value(&[Step::Key("load"), Step::Index(index), Step::Key("mesh_node")], "mesh nodes belong to flexible bodies"))
    }
}
