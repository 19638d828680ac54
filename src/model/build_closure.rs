//! Closures from names to indices, with every check on what a closure may be.

use super::build::{BodyDefinitionKind, Builder, Frame, WORLD, finite, interface, list, place, unit};
use super::closure::{Closure, ClosureJoint, ClosureKind, ClosureMethod, ClosureSide, HingeCoordinate};
use super::error::ModelError;
use super::flexible_body::Attachment;
use super::{HingeKind, System};
use crate::spatial::rotation;
use nalgebra::Vector3;

/// A closure by names: two frames and a kind, or two hinges and a ratio.
#[derive(Debug, Clone, Default)]
pub struct ClosureDefinition {
    /// Unique among closures.
    pub name: String,
    /// Kind as scenes spell it; "gear" couples two hinge coordinates.
    pub kind: String,
    /// One axis or several, as the kind asks, in the axes of frame a.
    pub axes: Vec<Vector3<f64>>,
    /// Body name or "world"; for a gear the name of the driving hinge.
    pub a: String,
    /// Interface of a flexible body a.
    pub node_a: Option<String>,
    /// Frame on a, or its offset from the interface.
    pub frame_a: Frame,
    /// Body name or "world"; for a gear the name of the driven hinge.
    pub b: String,
    /// Interface of a flexible body b.
    pub node_b: Option<String>,
    /// Frame on b, or its offset from the interface.
    pub frame_b: Frame,
    /// 1-based coordinates of the two hinges of a gear; the first if none.
    pub coordinates: [Option<usize>; 2],
    /// `theta_b = ratio * theta_a + offset` of a gear.
    pub ratio: Option<f64>,
    /// theta_b at theta_a = 0; zero if none.
    pub offset: Option<f64>,
    /// Method as scenes spell it; "auto" if none.
    pub method: Option<String>,
}

impl Builder<'_> {
    /// Closure `index` of the definition, on the bodies of `system`; its multipliers start at `first_row`.
    pub(super) fn closure(&self, index: usize, first_row: usize, system: &System) -> Result<Closure, ModelError> {
        let given = &self.definition.closures[index];
        let method = given.method.as_deref().unwrap_or(ClosureMethod::NAMES[0]);
        if !ClosureMethod::is_known(method) {
            return Err(ModelError::BadAxes {
                place: place("closure", index, "method"),
                item: given.name.clone(),
                found: format!("method = \"{method}\" is not a method"),
                expected: format!("known methods: {}", ClosureMethod::NAMES.join(", ")),
            });
        }
        let (chosen, method) = match ClosureMethod::from_name(method) {
            Some(method) => (false, method),
            // what is left to the program is decided once all closures are known
            None => (true, ClosureMethod::default()),
        };
        let joint = if given.kind == "gear" {
            self.gear(index, system)?
        } else {
            let kind = closure_kind(index, given)?;
            let a = self.closure_side(index, ["body_a", "node_a", "frame_a"], &given.a, &given.node_a, &given.frame_a, system)?;
            let b = self.closure_side(index, ["body_b", "node_b", "frame_b"], &given.b, &given.node_b, &given.frame_b, system)?;
            if a.body == b.body && (a.body.is_none() || !(a.attachment.moves() || b.attachment.moves())) {
                return Err(ModelError::ClosureOnOneBody {
                    place: place("closure", index, "body_b"),
                    item: given.name.clone(),
                    body: given.b.clone(),
                });
            }
            ClosureJoint::Frames { kind, a, b }
        };
        Ok(Closure { name: given.name.clone(), joint, method, chosen, first_row })
    }

    fn closure_side(
        &self,
        index: usize,
        keys: [&'static str; 3],
        body: &str,
        node: &Option<String>,
        frame: &Frame,
        system: &System,
    ) -> Result<ClosureSide, ModelError> {
        let item = &self.definition.closures[index].name;
        finite(frame.position.as_slice(), place("closure", index, keys[2]), item)?;
        let r = rotation::matrix_of_quaternion(&unit(&frame.quaternion, place("closure", index, keys[2]), item)?);
        let x = frame.position;
        let number = if body == WORLD { None } else { Some(self.body_number(body, place("closure", index, keys[0]), item)?) };
        let flexible = number.and_then(|n| match &self.definition.bodies[n].kind {
            BodyDefinitionKind::Flexible(flexible) => Some(flexible),
            BodyDefinitionKind::Rigid { .. } => None,
        });
        let at = place("closure", index, keys[1]);
        let number = number.map(|n| system.definition_order[n]);
        let attachment = match (flexible, node) {
            (Some(flexible), Some(node)) => Attachment::on_interface(interface(&flexible.modal, node, at, item, body)?, x, r),
            (Some(flexible), None) => {
                let known = list(flexible.modal.interfaces.iter().map(|i| i.name.clone()));
                return Err(ModelError::MissingInterface { place: at, item: item.clone(), body: body.to_owned(), known });
            }
            (None, Some(node)) => {
                return Err(ModelError::InterfaceOfRigidBody { place: at, item: item.clone(), found: node.clone(), body: body.to_owned() });
            }
            (None, None) => match number.map(|n| &system.bodies[n]) {
                None => Attachment::fixed(x, r),
                Some(b) => Attachment::fixed(b.frame_position + b.frame_rotation * x, b.frame_rotation * r),
            },
        };
        Ok(ClosureSide { body: number, attachment })
    }

    fn gear(&self, index: usize, system: &System) -> Result<ClosureJoint, ModelError> {
        let given = &self.definition.closures[index];
        let bad = |key, found: String, expected: &str| ModelError::BadAxes {
            place: place("closure", index, key),
            item: given.name.clone(),
            found,
            expected: expected.to_owned(),
        };
        finite(given.ratio.as_slice(), place("closure", index, "ratio"), &given.name)?;
        finite(given.offset.as_slice(), place("closure", index, "offset"), &given.name)?;
        let Some(ratio) = given.ratio.filter(|r| *r != 0.0) else {
            return Err(bad(
                "ratio",
                "a gear needs a ratio other than zero".into(),
                "give ratio = x with theta_b = ratio * theta_a + offset",
            ));
        };
        let coordinate = |keys: [&'static str; 2], name: &str, number: Option<usize>| {
            let Some(body) = system.hinge_index(name) else {
                let known = list(system.bodies.iter().map(|b| b.hinge.name.clone()));
                return Err(bad(keys[0], format!("{} = \"{name}\" is not a hinge", keys[0]), &format!("known: {known}")));
            };
            let kind: &HingeKind = &system.bodies[body].hinge.kind;
            let (number, count) = (number.unwrap_or(1), kind.rate_count());
            if kind.has_quaternion() || number == 0 || number > count {
                let found = format!("coordinate {number} of the {} hinge \"{name}\" is no angle or travel of its own", kind.name());
                return Err(bad(keys[1], found, "give a hinge with angles or travels and the 1-based number of one"));
            }
            let b = &system.bodies[body];
            Ok(HingeCoordinate { body, position: b.position + number - 1, velocity: b.velocity + number - 1 })
        };
        let a = coordinate(["hinge_a", "coordinate_a"], &given.a, given.coordinates[0])?;
        let b = coordinate(["hinge_b", "coordinate_b"], &given.b, given.coordinates[1])?;
        if a == b {
            return Err(bad("hinge_b", "a gear joins two different coordinates".into(), "name another hinge or coordinate"));
        }
        Ok(ClosureJoint::Gear { a, b, ratio, offset: given.offset.unwrap_or(0.0) })
    }
}

fn closure_kind(index: usize, given: &ClosureDefinition) -> Result<ClosureKind, ModelError> {
    let bad = |key, found: String, expected: &str| ModelError::BadAxes {
        place: place("closure", index, key),
        item: given.name.clone(),
        found,
        expected: expected.to_owned(),
    };
    let (count, form) = match given.kind.as_str() {
        "fixed" | "spherical" => (0, "this kind takes no axis"),
        "revolute" | "cylindrical" | "prismatic" | "planar" => (1, "give axis = [x, y, z] in frame a; for planar the normal"),
        "universal" => (2, "give axes = [[x, y, z], [x, y, z]] in frame a"),
        other => {
            let known = "known kinds: fixed, revolute, universal, spherical, cylindrical, prismatic, planar, gear";
            return Err(bad("kind", format!("kind = \"{other}\" is not a closure kind"), known));
        }
    };
    let key = if count > 1 { "axes" } else { "axis" };
    if given.axes.len() != count {
        return Err(bad(key, format!("a {} closure has {} axes here, needs {count}", given.kind, given.axes.len()), form));
    }
    if let Some(zero) = given.axes.iter().find(|a| !(a.norm() > 0.0 && a.norm().is_finite())) {
        return Err(bad(key, format!("axis [{}, {}, {}] has no direction", zero.x, zero.y, zero.z), form));
    }
    let axes: Vec<_> = given.axes.iter().map(Vector3::normalize).collect();
    Ok(match given.kind.as_str() {
        "fixed" => ClosureKind::Fixed,
        "spherical" => ClosureKind::Spherical,
        "revolute" => ClosureKind::Revolute { axis: axes[0] },
        "cylindrical" => ClosureKind::Cylindrical { axis: axes[0] },
        "prismatic" => ClosureKind::Prismatic { axis: axes[0] },
        "planar" => ClosureKind::Planar { normal: axes[0] },
        _ => {
            // parallel axes block nothing; rounding leaves a few eps
            if axes[0].cross(&axes[1]).norm() < 1e-6 {
                return Err(bad("axes", "the two axes of the universal joint are parallel".into(), "give two axes across one another"));
            }
            ClosureKind::Universal { axes: [axes[0], axes[1]] }
        }
    })
}
