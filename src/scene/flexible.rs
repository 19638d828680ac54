//! Flexible bodies of a scene: modal file, retained modes, damping, and mesh nodes that carry loads.

use super::assemble::Assembly;
use super::error::SceneError;
use super::locate::Step;
use super::modal_files::{BasisError, Choice, Places, Selection};
use super::spec::{BodySpec, ModesRule, ModesSpec, Numbers, SceneSpec};
use crate::model::InertiaOrder;
use crate::model::build::{BodyDefinitionKind, FlexibleDefinition, PointDefinition};
use nalgebra::Vector6;
use std::path::Path;

impl Assembly<'_> {
    pub(super) fn flexible(&mut self, index: usize, body: &BodySpec, spec: &SceneSpec) -> Result<BodyDefinitionKind, SceneError> {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        // what identifies the file for this scene: its path, and for an import what was asked of it
        let (path, (handle, full, content_sha256)) = match &body.import {
            None => {
                let steps = [Step::Key("body"), Step::Index(index), Step::Key("modal_file")];
                let path = folder.join(body.modal_file.as_deref().unwrap_or(Path::new("")));
                let opened = self.files.open(&path, self.source, &steps)?;
                (path, opened)
            }
            Some(import) => {
                let steps = |key| [Step::Key("body"), Step::Index(index), Step::Key("import"), Step::Key(key)];
                let Some(file) = &import.file else {
                    return Err(self.source.value(&steps("file"), "name the XDMF or MED file to import"));
                };
                let options = import.options().map_err(|(key, message)| self.source.value(&steps(key), message))?;
                self.files.import(&folder.join(file), &options, self.source, &steps("file"))?
            }
        };
        let whole = retained(self, index, body, &full.frequency_hz)?;
        let residual = self.residual(body, &whole, full.mode_count()).then(|| places(body, &full.root_interface, spec));
        let choice = Choice { whole, residual };
        let basis = self.files.basis(&path, &handle, &full, &choice).map_err(|error| {
            let steps = [Step::Key("body"), Step::Index(index), Step::Key("residual_modes")];
            match error {
                BasisError::File(source) => SceneError::ModalFile { path: self.source.path.clone(), at: self.source.at(&steps), source },
                BasisError::Residual(_) => self.source.value(&steps, error.to_string()),
            }
        })?;
        let count = basis.mode_count();
        if !basis.is_complete() {
            let carried = if basis.has_residual() { format!(" ({} residual modes added)", basis.residual.ncols()) } else { String::new() };
            let (left, all) = (full.mode_count() - basis.whole.len(), full.mode_count());
            self.left_out.push(format!("{left} of {all} modes of \"{}\"{carried}", body.name));
        }
        let order = inertia_order(self, index, body)?;
        let geometric = self.geometric_stiffness(index, body, full.geometric_stiffness.is_some(), order)?;
        let (modal, integrals) = self.files.pack(&path, &full, &choice, &basis, geometric);
        // a list gives the ratios of the scene's own choice of modes; others keep those of the file
        let of_file = |from: usize| modal.damping_ratio.iter().copied().skip(from);
        let damping_ratio = match &body.damping_ratio {
            None => modal.damping_ratio.clone(),
            Some(Numbers::One(z)) => vec![*z; count],
            // a list for the scene's own choice of modes still fits when an override retains fewer
            Some(Numbers::Many(list)) if self.overrides.modes.is_some() || count == 0 => {
                let given = list.len().min(basis.whole.len());
                list.iter().copied().take(given).chain(of_file(given)).collect()
            }
            Some(Numbers::Many(list)) if list.len() == basis.whole.len() => list.iter().copied().chain(of_file(list.len())).collect(),
            Some(Numbers::Many(list)) => list.clone(),
        };
        let start = |given: &[f64]| {
            let mut start = given.to_vec();
            // modes that an override adds start at rest, and so do residual modes
            if !start.is_empty() && (self.is_overridden(body) || start.len() == basis.whole.len()) {
                start.resize(count, 0.0);
            }
            start
        };
        let definition = FlexibleDefinition {
            damping_ratio,
            order,
            modal_position: start(&body.modal_position),
            modal_velocity: start(&body.modal_velocity),
            mode_names: basis.names(),
            modal,
            integrals,
        };
        self.chosen.push((index, Selection { file: handle, all: full, basis, content_sha256 }));
        Ok(BodyDefinitionKind::Flexible(definition))
    }

    /// Whether the body uses geometric stiffness; `held` tells that the file has it.
    fn geometric_stiffness(&mut self, index: usize, body: &BodySpec, held: bool, order: InertiaOrder) -> Result<bool, SceneError> {
        let steps = [Step::Key("body"), Step::Index(index), Step::Key("geometric_stiffness")];
        let wanted = self.overrides.geometric_stiffness.map_or(body.geometric_stiffness.unwrap_or(false), |on| on && held);
        if wanted && !held {
            let message =
                "true, but the modal file has no geometric stiffness; write the file with geometric/stiffness or leave the key out";
            return Err(self.source.value(&steps, message));
        }
        if wanted && order < InertiaOrder::First && self.overrides.inertia_order.is_some() {
            // the override says what it leaves out
            self.left_out.push(format!("geometric stiffness of \"{}\"", body.name));
            return Ok(false);
        }
        if wanted && order < InertiaOrder::First {
            return Err(self.source.value(&steps, "true needs inertia_order = 1 or 2; order 0 evaluates the undeformed body"));
        }
        if held && !wanted {
            self.left_out.push(format!("geometric stiffness of \"{}\"", body.name));
        }
        Ok(wanted)
    }

    /// Whether residual modes stand in for the modes that `whole` leaves out.
    fn residual(&self, body: &BodySpec, whole: &[usize], available: usize) -> bool {
        let wanted = self.overrides.residual_modes.or(body.residual_modes).unwrap_or(false);
        wanted && whole.len() < available && !self.overrides.rigid.contains(&body.name)
    }

    fn is_overridden(&self, body: &BodySpec) -> bool {
        self.overrides.modes.is_some() || self.overrides.rigid.contains(&body.name)
    }

    pub(super) fn mesh_node(&mut self, index: usize, node: usize, number: Option<usize>) -> Result<PointDefinition, SceneError> {
        let steps = [Step::Key("load"), Step::Index(index), Step::Key("mesh_node")];
        let Some((_, selection)) = self.chosen.iter().find(|(n, _)| Some(*n) == number) else {
            return Err(self.source.value(&steps, "mesh nodes belong to flexible bodies; name a point instead"));
        };
        let wrap = |source| SceneError::ModalFile { path: self.source.path.clone(), at: self.source.at(&steps), source };
        let (position, shape) = self.files.node(selection, node).map_err(wrap)?;
        let mode_shape = selection.basis.combine(&shape, Vector6::zeros());
        Ok(PointDefinition::Node { position, mode_shape, rotations: selection.file.has_rotation() })
    }
}

/// Where the scene attaches something to `body`, or loads it.
fn places(body: &BodySpec, root_interface: &str, spec: &SceneSpec) -> Places {
    let on = |name: &str, node: &Option<String>| if name == body.name { node.clone() } else { None };
    let inboard = spec.hinge.iter().filter(|h| h.child == body.name);
    let inboard = inboard.map(|h| h.child_node.clone().unwrap_or_else(|| root_interface.to_owned()));
    let outboard = spec.hinge.iter().filter_map(|h| on(&h.parent, &h.parent_node));
    let a = spec.closure.iter().filter_map(|c| on(c.body_a.as_deref()?, &c.node_a));
    let b = spec.closure.iter().filter_map(|c| on(c.body_b.as_deref()?, &c.node_b));
    let loads = spec.load.iter().filter_map(|l| on(&l.body, &l.node));
    let mut interfaces: Vec<_> = inboard.chain(outboard).chain(a).chain(b).chain(loads).collect();
    let mut nodes: Vec<_> = spec.load.iter().filter(|l| l.body == body.name).filter_map(|l| l.mesh_node).collect();
    interfaces.sort();
    interfaces.dedup();
    nodes.sort_unstable();
    nodes.dedup();
    Places { interfaces, nodes }
}

/// 0-based numbers of the modes that the scene and the command line retain.
fn retained(assembly: &Assembly<'_>, index: usize, body: &BodySpec, frequency_hz: &[f64]) -> Result<Vec<usize>, SceneError> {
    let steps = [Step::Key("body"), Step::Index(index), Step::Key("modes")];
    let fault = |message: String| Err(assembly.source.value(&steps, message));
    let available = frequency_hz.len();
    if assembly.overrides.rigid.contains(&body.name) {
        return Ok(Vec::new());
    }
    if let Some(count) = assembly.overrides.modes {
        return Ok((0..count.min(available)).collect());
    }
    match &body.modes {
        None => Ok((0..available).collect()),
        Some(ModesSpec::List(list)) => {
            let mut seen = vec![false; available];
            for &mode in list {
                if mode == 0 || mode > available {
                    return fault(format!("mode {mode} does not exist; the modal file has modes 1 to {available}"));
                }
                if std::mem::replace(&mut seen[mode - 1], true) {
                    return fault(format!("mode {mode} is listed twice"));
                }
            }
            Ok(list.iter().map(|m| m - 1).collect())
        }
        Some(ModesSpec::Rule(ModesRule { count: Some(count), max_frequency_hz: None })) if *count <= available => Ok((0..*count).collect()),
        Some(ModesSpec::Rule(ModesRule { count: Some(count), max_frequency_hz: None })) => {
            fault(format!("count = {count}, but the modal file has only {available} modes"))
        }
        Some(ModesSpec::Rule(ModesRule { count: None, max_frequency_hz: Some(limit) })) if *limit > 0.0 => {
            Ok((0..available).filter(|&j| frequency_hz[j] <= *limit).collect())
        }
        Some(ModesSpec::Rule(_)) => fault("give { count = N } or { max_frequency_hz = F } with F positive".into()),
    }
}

fn inertia_order(assembly: &Assembly<'_>, index: usize, body: &BodySpec) -> Result<InertiaOrder, SceneError> {
    let source = assembly.source;
    match assembly.overrides.inertia_order.or(body.inertia_order) {
        Some(0) => Ok(InertiaOrder::Zeroth),
        Some(1) => Ok(InertiaOrder::First),
        Some(2) | None => Ok(InertiaOrder::Second),
        Some(other) => {
            Err(source.value(&[Step::Key("body"), Step::Index(index), Step::Key("inertia_order")], format!("{other} must be 0, 1 or 2")))
        }
    }
}
