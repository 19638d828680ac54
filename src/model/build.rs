//! From a definition by names to a [`System`] by indices: every check on what a system may be is here.

use super::error::{ModelError, Place};
use super::flexible_body::{Attachment, FlexibleBody};
use super::load::{Load, LoadPoint};
use super::modal_body::{Interface, ModalBody};
use super::state::State;
use super::time_function::TimeFunction;
use super::{Body, BodyKind, System};
use crate::spatial::SpatialInertia;
use crate::spatial::rotation::{self, Quaternion};
use nalgebra::{Matrix3, Vector3};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::Arc;

pub use super::definition::{
    BodyDefinition, BodyDefinitionKind, Definition, FlexibleDefinition, Frame, HingeDefinition, LoadDefinition, PointDefinition,
};

/// Name of the inertial frame as a parent.
pub const WORLD: &str = "world";

pub(super) const fn place(section: &'static str, index: usize, key: &'static str) -> Place {
    Place { section, index, key }
}

pub(super) fn list(names: impl Iterator<Item = String>) -> String {
    let names: Vec<_> = names.map(|n| format!("\"{n}\"")).collect();
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

impl Definition {
    /// Checks everything and builds the system and its initial state (time zero, prescribed hinges at their functions' values).
    ///
    /// # Errors
    /// [`ModelError`] with the item and key that is wrong.
    pub fn build(&self) -> Result<(System, State), ModelError> {
        if self.bodies.is_empty() {
            return Err(ModelError::Empty);
        }
        finite(self.gravity.as_slice(), place("system", 0, "gravity"), "scene")?;
        let numbers = self.bodies.iter().enumerate().map(|(i, b)| (b.name.as_str(), i)).collect();
        let builder = Builder { definition: self, numbers };
        builder.check_names()?;
        let hinge_of = builder.hinge_of_each_body()?;
        let order = builder.parent_first(&hinge_of)?;
        let rank: HashMap<usize, usize> = order.iter().enumerate().map(|(new, &old)| (old, new)).collect();

        let mut system = System {
            gravity: self.gravity,
            bodies: Vec::with_capacity(order.len()),
            loads: Vec::new(),
            closures: Vec::new(),
            aggregates: Vec::new(),
            roles: Vec::new(),
            prescribed: Vec::new(),
            position_count: 0,
            velocity_count: 0,
            modal_count: 0,
            definition_order: (0..self.bodies.len()).map(|old| rank[&old]).collect(),
        };
        let mut state = State { time: 0.0, position: vec![], velocity: vec![], modal_position: vec![], modal_velocity: vec![] };
        for &old in &order {
            builder.add_body(old, hinge_of[old], &rank, &mut system, &mut state)?;
        }
        for index in 0..self.loads.len() {
            let load = builder.load(index, &system)?;
            system.loads.push(load);
        }
        system.loads.sort_by_key(|l| l.body);
        let mut rows = 0;
        for index in 0..self.closures.len() {
            let closure = builder.closure(index, rows, &system)?;
            rows = closure.rows().end;
            system.closures.push(closure);
        }
        super::inertia_check::check(self, &system, &state)?;
        super::aggregate::choose_methods(&mut system);
        (system.aggregates, system.roles) = super::aggregate::aggregates(&system);
        state.apply_prescribed(&system);
        Ok((system, state))
    }
}

/// A definition with its names indexed.
pub(super) struct Builder<'a> {
    pub(super) definition: &'a Definition,
    numbers: HashMap<&'a str, usize>,
}

impl Builder<'_> {
    fn check_names(&self) -> Result<(), ModelError> {
        let bodies = self.definition.bodies.iter().enumerate().map(|(i, b)| (i, &b.name, "body"));
        let hinges = self.definition.hinges.iter().enumerate().map(|(i, h)| (i, &h.name, "hinge"));
        let closures = self.definition.closures.iter().enumerate().map(|(i, c)| (i, &c.name, "closure"));
        let mut seen = HashMap::new();
        for (index, name, section) in bodies.chain(hinges).chain(closures) {
            let reason = match name.as_str() {
                "" => Some("it is empty"),
                WORLD if section == "body" => Some("the name stands for the inertial frame"),
                _ => None,
            };
            if let Some(reason) = reason {
                return Err(ModelError::BadName { place: place(section, index, "name"), name: name.clone(), reason });
            }
            if seen.insert((section, name), index).is_some() {
                return Err(ModelError::DuplicateName { place: place(section, index, "name"), name: name.clone() });
            }
        }
        Ok(())
    }

    pub(super) fn body_number(&self, name: &str, place: Place, item: &str) -> Result<usize, ModelError> {
        self.numbers.get(name).copied().ok_or_else(|| ModelError::UnknownBody {
            place,
            item: item.to_owned(),
            found: name.to_owned(),
            known: list(self.definition.bodies.iter().map(|b| b.name.clone())),
        })
    }

    fn hinge_of_each_body(&self) -> Result<Vec<usize>, ModelError> {
        let mut hinge_of = vec![None; self.definition.bodies.len()];
        for (index, hinge) in self.definition.hinges.iter().enumerate() {
            let child = self.body_number(&hinge.child, place("hinge", index, "child"), &hinge.name)?;
            if let Some(first) = hinge_of[child].replace(index) {
                let first: &HingeDefinition = &self.definition.hinges[first];
                return Err(ModelError::TwoParents {
                    place: place("hinge", index, "child"),
                    body: hinge.child.clone(),
                    first: first.name.clone(),
                    second: hinge.name.clone(),
                });
            }
        }
        let named = |(index, hinge): (usize, Option<usize>)| {
            hinge.ok_or_else(|| ModelError::Unconnected {
                place: place("body", index, "name"),
                body: self.definition.bodies[index].name.clone(),
            })
        };
        hinge_of.into_iter().enumerate().map(named).collect()
    }

    /// Body indices in depth-first order, children in the order of their definition.
    fn parent_first(&self, hinge_of: &[usize]) -> Result<Vec<usize>, ModelError> {
        let mut parents = Vec::with_capacity(self.definition.bodies.len());
        for &h in hinge_of {
            let hinge = &self.definition.hinges[h];
            parents.push(if hinge.parent == WORLD {
                None
            } else {
                Some(self.body_number(&hinge.parent, place("hinge", h, "parent"), &hinge.name)?)
            });
        }
        let mut children = vec![Vec::new(); self.definition.bodies.len()];
        let mut open: Vec<usize> = Vec::new();
        for (body, parent) in parents.iter().enumerate() {
            match parent {
                Some(parent) => children[*parent].push(body),
                None => open.push(body),
            }
        }
        open.reverse();
        let mut order = Vec::with_capacity(self.definition.bodies.len());
        let mut reached = vec![false; self.definition.bodies.len()];
        while let Some(body) = open.pop() {
            order.push(body);
            reached[body] = true;
            open.extend(children[body].iter().rev());
        }
        if let Some(start) = reached.iter().position(|r| !r) {
            // every unreached body leads up to a ring: walk up as far as there are bodies, then once round
            let up = |b: usize| parents[b].unwrap_or(b);
            let on_ring = (0..self.definition.bodies.len()).fold(start, |b, _| up(b));
            let mut ring = vec![on_ring];
            while up(ring[ring.len() - 1]) != on_ring {
                ring.push(up(ring[ring.len() - 1]));
            }
            return Err(ModelError::Cycle {
                place: place("hinge", hinge_of[on_ring], "parent"),
                cycle: list(ring.iter().map(|&b| self.definition.bodies[b].name.clone())),
            });
        }
        Ok(order)
    }

    fn add_body(
        &self,
        old: usize,
        h: usize,
        rank: &HashMap<usize, usize>,
        system: &mut System,
        state: &mut State,
    ) -> Result<(), ModelError> {
        let (definition, hinge) = (&self.definition.bodies[old], &self.definition.hinges[h]);
        let parent = if hinge.parent == WORLD {
            None
        } else {
            Some(rank[&self.body_number(&hinge.parent, place("hinge", h, "parent"), &hinge.name)?])
        };
        let parent_side = self.parent_side(h, parent, system)?;
        let child_frame = self.frame(h, "child_frame", &hinge.child_frame)?;
        let (kind, frame_rotation, frame_position) = match &definition.kind {
            BodyDefinitionKind::Rigid { mass, center_of_mass, inertia } => {
                if let Some(node) = &hinge.child_node {
                    return Err(ModelError::InterfaceOfRigidBody {
                        place: place("hinge", h, "child_node"),
                        item: hinge.name.clone(),
                        found: node.clone(),
                        body: definition.name.clone(),
                    });
                }
                check_rigid(old, definition, *mass, inertia)?;
                finite(center_of_mass.as_slice(), place("body", old, "center_of_mass"), &definition.name)?;
                let (r, x) = child_frame;
                let c = r.tr_mul(&(center_of_mass - x));
                let about_o = r.transpose() * inertia * r + (Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose()) * *mass;
                (BodyKind::Rigid(SpatialInertia::rigid(*mass, &(c * *mass), &about_o)), r.transpose(), -r.tr_mul(&x))
            }
            BodyDefinitionKind::Flexible(flexible) => {
                let name = hinge.child_node.as_ref().unwrap_or(&flexible.modal.root_interface);
                let interface = interface(&flexible.modal, name, place("hinge", h, "child_node"), &hinge.name, &definition.name)?;
                let inboard = Attachment::on_interface(interface, child_frame.1, child_frame.0);
                (BodyKind::Flexible(Box::new(self.flexible(old, flexible, inboard)?)), Matrix3::identity(), Vector3::zeros())
            }
        };
        let built = self.hinge(h)?;
        let (positions, rates) = (built.kind.position_count(), built.kind.rate_count());
        state.position.extend(self.initial_position(h, &built)?);
        state.velocity.extend(self.list(h, "velocity", &hinge.velocity, rates, false)?);
        if let BodyDefinitionKind::Flexible(flexible) = &definition.kind {
            for (key, given, into) in [
                ("modal_position", &flexible.modal_position, &mut state.modal_position),
                ("modal_velocity", &flexible.modal_velocity, &mut state.modal_velocity),
            ] {
                let n = flexible.modal.mode_count();
                if !given.is_empty() && given.len() != n {
                    return Err(ModelError::WrongLength {
                        place: place("body", old, key),
                        item: definition.name.clone(),
                        found: given.len(),
                        expected: format!("{n}, one per retained mode"),
                    });
                }
                finite(given, place("body", old, key), &definition.name)?;
                into.extend(given);
                into.extend(std::iter::repeat_n(0.0, n - given.len()));
            }
        }
        if built.is_prescribed() {
            system.prescribed.push(system.bodies.len());
        }
        let body = Body {
            name: definition.name.clone(),
            kind,
            hinge: built,
            parent,
            parent_side,
            frame_rotation,
            frame_position,
            position: system.position_count,
            velocity: system.velocity_count,
            modal: system.modal_count,
        };
        system.position_count += positions;
        system.velocity_count += rates;
        system.modal_count += body.mode_count();
        system.bodies.push(body);
        Ok(())
    }

    fn parent_side(&self, h: usize, parent: Option<usize>, system: &System) -> Result<Attachment, ModelError> {
        let hinge = &self.definition.hinges[h];
        let (r, x) = self.frame(h, "parent_frame", &hinge.parent_frame)?;
        let body = parent.map(|p| &system.bodies[p]);
        let definition = body.and_then(|b| self.numbers.get(b.name.as_str())).map(|&i| &self.definition.bodies[i].kind);
        if let (Some(body), Some(BodyDefinitionKind::Flexible(flexible))) = (body, definition) {
            let at = place("hinge", h, "parent_node");
            let Some(node) = &hinge.parent_node else {
                return Err(ModelError::MissingInterface {
                    place: at,
                    item: hinge.name.clone(),
                    body: body.name.clone(),
                    known: list(flexible.modal.interfaces.iter().map(|i| i.name.clone())),
                });
            };
            let interface = interface(&flexible.modal, node, at, &hinge.name, &body.name)?;
            return Ok(Attachment::on_interface(interface, x, r));
        }
        if let Some(node) = &hinge.parent_node {
            return Err(ModelError::InterfaceOfRigidBody {
                place: place("hinge", h, "parent_node"),
                item: hinge.name.clone(),
                found: node.clone(),
                body: hinge.parent.clone(),
            });
        }
        Ok(body
            .map_or_else(|| Attachment::fixed(x, r), |b| Attachment::fixed(b.frame_position + b.frame_rotation * x, b.frame_rotation * r)))
    }

    fn frame(&self, h: usize, key: &'static str, frame: &Frame) -> Result<(Matrix3<f64>, Vector3<f64>), ModelError> {
        finite(frame.position.as_slice(), place("hinge", h, key), &self.definition.hinges[h].name)?;
        let q = unit(&frame.quaternion, place("hinge", h, key), &self.definition.hinges[h].name)?;
        Ok((rotation::matrix_of_quaternion(&q), frame.position))
    }

    fn flexible(&self, old: usize, flexible: &FlexibleDefinition, inboard: Attachment) -> Result<FlexibleBody, ModelError> {
        let n = flexible.modal.mode_count();
        if flexible.damping_ratio.len() != n {
            return Err(ModelError::WrongLength {
                place: place("body", old, "damping_ratio"),
                item: self.definition.bodies[old].name.clone(),
                found: flexible.damping_ratio.len(),
                expected: format!("1 or {n}, one per retained mode"),
            });
        }
        if let Some(&bad) = flexible.damping_ratio.iter().find(|z| !(**z >= 0.0 && z.is_finite())) {
            return Err(ModelError::BadNumber {
                place: place("body", old, "damping_ratio"),
                item: self.definition.bodies[old].name.clone(),
                found: bad,
                expected: "zero or positive",
            });
        }
        let omega: Vec<f64> = flexible.modal.frequency_hz.iter().map(|f| TAU * f).collect();
        Ok(FlexibleBody {
            integrals: Arc::clone(&flexible.integrals),
            stiffness: match &flexible.modal.stiffness {
                Some(k) => k.diagonal().iter().copied().collect(),
                None => omega.iter().map(|w| w * w).collect(),
            },
            full_stiffness: flexible.modal.stiffness.clone(),
            damping: omega.iter().zip(&flexible.damping_ratio).map(|(w, z)| 2.0 * z * w).collect(),
            order: flexible.order,
            inboard,
            mode_names: flexible.mode_names.clone(),
            unused_stiffening: match &flexible.modal.geometric_stiffness {
                Some(matrices) if !flexible.integrals.has_geometric_stiffness() => {
                    (0..n).map(|j| std::array::from_fn(|load| matrices[load][(j, j)])).collect()
                }
                _ => Vec::new(),
            },
        })
    }

    fn load(&self, index: usize, system: &System) -> Result<Load, ModelError> {
        let given = &self.definition.loads[index];
        let item = format!("{}", index + 1);
        let number = self.body_number(&given.body, place("load", index, "body"), &item)?;
        for (key, function) in [("force", &given.force), ("moment", &given.moment)] {
            let found = function.as_ref().map_or(3, TimeFunction::dimension);
            if found != 3 {
                return Err(ModelError::WrongLength { place: place("load", index, key), item, found, expected: "3 components".into() });
            }
            if let Some(function) = function {
                finite(&function.parameters(), place("load", index, key), &item)?;
            }
        }
        let body = system.definition_order[number];
        let point = match (&given.point, &self.definition.bodies[number].kind) {
            (PointDefinition::Interface(name), BodyDefinitionKind::Flexible(flexible)) => {
                let found = interface(&flexible.modal, name, place("load", index, "node"), &item, &given.body)?;
                LoadPoint::Interface(Attachment::on_interface(found, Vector3::zeros(), Matrix3::identity()))
            }
            (PointDefinition::Point(point), BodyDefinitionKind::Rigid { .. }) => {
                finite(point.as_slice(), place("load", index, "point"), &item)?;
                LoadPoint::Rigid(system.bodies[body].frame_position + system.bodies[body].frame_rotation * point)
            }
            (PointDefinition::Node { position, mode_shape, rotations }, BodyDefinitionKind::Flexible(_)) => {
                if given.moment.is_some() && !rotations {
                    let at = place("load", index, "moment");
                    return Err(ModelError::MomentOnNode { place: at, number: index + 1, body: given.body.clone() });
                }
                LoadPoint::Node { position: *position, mode_shape: mode_shape.clone() }
            }
            (PointDefinition::Interface(name), BodyDefinitionKind::Rigid { .. }) => {
                return Err(ModelError::InterfaceOfRigidBody {
                    place: place("load", index, "node"),
                    item,
                    found: name.clone(),
                    body: given.body.clone(),
                });
            }
            (PointDefinition::Node { .. }, BodyDefinitionKind::Rigid { .. }) => {
                return Err(ModelError::InterfaceOfRigidBody {
                    place: place("load", index, "mesh_node"),
                    item,
                    found: "mesh_node".into(),
                    body: given.body.clone(),
                });
            }
            (PointDefinition::Point(_), BodyDefinitionKind::Flexible(flexible)) => {
                return Err(ModelError::PointOfFlexibleBody {
                    place: place("load", index, "point"),
                    item,
                    body: given.body.clone(),
                    known: list(flexible.modal.interfaces.iter().map(|i| i.name.clone())),
                });
            }
        };
        Ok(Load { body, point, force: given.force.clone(), moment: given.moment.clone(), axes: given.axes })
    }
}

/// Refuses what no definition means: NaN and infinities.
pub(super) fn finite(values: &[f64], place: Place, item: &str) -> Result<(), ModelError> {
    match values.iter().find(|x| !x.is_finite()) {
        None => Ok(()),
        Some(&found) => Err(ModelError::BadNumber { place, item: item.to_owned(), found, expected: "finite" }),
    }
}

pub(super) fn interface<'a>(modal: &'a ModalBody, name: &str, place: Place, item: &str, body: &str) -> Result<&'a Interface, ModelError> {
    modal.interface(name).ok_or_else(|| ModelError::UnknownInterface {
        place,
        item: item.to_owned(),
        found: name.to_owned(),
        body: body.to_owned(),
        known: list(modal.interfaces.iter().map(|i| i.name.clone())),
    })
}

/// Lengths within this of one are taken for rounding of the printed digits and normalised.
const UNIT_TOLERANCE: f64 = 1e-6;

pub(super) fn unit(q: &Quaternion, place: Place, item: &str) -> Result<Quaternion, ModelError> {
    let found = rotation::norm(q);
    if (found - 1.0).abs() <= UNIT_TOLERANCE {
        Ok(rotation::normalized(q))
    } else {
        Err(ModelError::NotUnit { place, item: item.to_owned(), found })
    }
}

fn check_rigid(index: usize, body: &BodyDefinition, mass: f64, inertia: &Matrix3<f64>) -> Result<(), ModelError> {
    let item = body.name.clone();
    if !(mass >= 0.0 && mass.is_finite()) {
        return Err(ModelError::BadNumber { place: place("body", index, "mass"), item, found: mass, expected: "zero or positive" });
    }
    let scale = inertia.abs().max();
    let at = place("body", index, "inertia");
    let asymmetry = (inertia - inertia.transpose()).abs().max();
    let mut values: [f64; 3] = ((inertia + inertia.transpose()) * 0.5).symmetric_eigenvalues().into();
    values.sort_by(f64::total_cmp);
    // eigenvalues carry rounding of a few eps of the largest entry
    let slack = 1e-12 * scale;
    let reason = if !values.iter().all(|v| v.is_finite()) {
        "not finite"
    } else if asymmetry > slack {
        "the matrix is not symmetric"
    } else if values[0] < -slack {
        "a principal moment is negative"
    } else if values[2] > values[0] + values[1] + 1e-9 * scale {
        "the largest principal moment exceeds the sum of the other two"
    } else {
        return Ok(());
    };
    Err(ModelError::BadInertia { place: at, item, values, reason })
}
