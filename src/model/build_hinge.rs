//! Hinges of a definition: kind, axes, coordinates at the start, springs, torques and prescribed motion.

use super::build::{Builder, finite, place, unit};
use super::definition::HingeDefinition;
use super::error::ModelError;
use super::hinge::{Hinge, HingeKind, quaternion_in};
use super::time_function::TimeFunction;
use nalgebra::Vector3;

impl Builder<'_> {
    pub(super) fn hinge(&self, h: usize) -> Result<Hinge, ModelError> {
        let given = &self.definition.hinges[h];
        let kind = hinge_kind(h, given)?;
        let rates = kind.rate_count();
        for (key, function) in [("torque", &given.torque), ("motion", &given.motion)] {
            let Some(function) = function else { continue };
            if function.dimension() != rates {
                return Err(ModelError::WrongLength {
                    place: place("hinge", h, key),
                    item: given.name.clone(),
                    found: function.dimension(),
                    expected: format!("{rates}, one per rate of a {} hinge", kind.name()),
                });
            }
            finite(&function.parameters(), place("hinge", h, key), &given.name)?;
        }
        if given.motion.is_some() {
            if kind.has_quaternion() || rates == 0 {
                return Err(ModelError::MotionOfQuaternion {
                    place: place("hinge", h, "motion"),
                    item: given.name.clone(),
                    kind: kind.name(),
                });
            }
            for (key, used) in
                [("position", !given.position.is_empty()), ("velocity", !given.velocity.is_empty()), ("torque", given.torque.is_some())]
            {
                if used {
                    return Err(ModelError::Excluded {
                        place: place("hinge", h, key),
                        item: given.name.clone(),
                        other: "motion",
                        remedy: "a prescribed hinge follows its motion; leave the other out",
                    });
                }
            }
        }
        for (key, values) in [("stiffness", &given.stiffness), ("damping", &given.damping)] {
            if let Some(&bad) = values.iter().find(|x| !(**x >= 0.0)) {
                return Err(ModelError::BadNumber {
                    place: place("hinge", h, key),
                    item: given.name.clone(),
                    found: bad,
                    expected: "zero or positive",
                });
            }
        }
        Ok(Hinge {
            name: given.name.clone(),
            stiffness: self.list(h, "stiffness", &given.stiffness, rates, true)?,
            damping: self.list(h, "damping", &given.damping, rates, true)?,
            rest: self.list(h, "rest", &given.rest, rates, true)?,
            torque: given.torque.clone(),
            motion: given.motion.clone().map(TimeFunction::splined),
            held: given.held,
            kind,
        })
    }

    /// One value for all, one per rate, or none (empty if `sparse`, else zeros).
    pub(super) fn list(&self, h: usize, key: &'static str, given: &[f64], rates: usize, sparse: bool) -> Result<Vec<f64>, ModelError> {
        finite(given, place("hinge", h, key), &self.definition.hinges[h].name)?;
        match given.len() {
            0 if sparse => Ok(Vec::new()),
            0 => Ok(vec![0.0; rates]),
            1 if sparse => Ok(vec![given[0]; rates]),
            n if n == rates => Ok(given.to_vec()),
            found => Err(ModelError::WrongLength {
                place: place("hinge", h, key),
                item: self.definition.hinges[h].name.clone(),
                found,
                expected: format!("{rates}, one per rate of a {} hinge", self.definition.hinges[h].kind),
            }),
        }
    }

    pub(super) fn initial_position(&self, h: usize, hinge: &Hinge) -> Result<Vec<f64>, ModelError> {
        let given = &self.definition.hinges[h].position;
        if given.is_empty() {
            return Ok(hinge.kind.reference_position());
        }
        let at = place("hinge", h, "position");
        if given.len() != hinge.kind.position_count() {
            return Err(ModelError::WrongLength {
                place: at,
                item: hinge.name.clone(),
                found: given.len(),
                expected: format!("{} for a {} hinge", hinge.kind.position_count(), hinge.kind.name()),
            });
        }
        finite(given, at.clone(), &hinge.name)?;
        let mut position = given.clone();
        if hinge.kind.has_quaternion() {
            let start = position.len() - 4;
            let q = unit(&quaternion_in(&position[start..]), at, &hinge.name)?;
            position[start..].copy_from_slice(&q);
        }
        Ok(position)
    }
}

fn hinge_kind(h: usize, given: &HingeDefinition) -> Result<HingeKind, ModelError> {
    let bad = |key, found: String, expected: &str| ModelError::BadAxes {
        place: place("hinge", h, key),
        item: given.name.clone(),
        found,
        expected: expected.to_owned(),
    };
    let (count, form) = match given.kind.as_str() {
        "fixed" | "spherical" | "free" => (0, "this kind takes no axis"),
        "revolute" | "prismatic" | "screw" | "cylindrical" => (1, "give axis = [x, y, z]"),
        "universal" | "planar" => (2, "give axes = [[x, y, z], [x, y, z]]"),
        "gimbal" => (3, "give axes = [[x, y, z], [x, y, z], [x, y, z]]"),
        other => {
            let known = "known kinds: fixed, revolute, prismatic, screw, cylindrical, universal, gimbal, planar, spherical, free";
            return Err(bad("kind", format!("kind = \"{other}\" is not a hinge kind"), known));
        }
    };
    let key = if count > 1 { "axes" } else { "axis" };
    if given.axes.len() != count {
        return Err(bad(key, format!("a {} hinge has {} axes here, needs {count}", given.kind, given.axes.len()), form));
    }
    if let Some(zero) = given.axes.iter().find(|a| !(a.norm() > 0.0 && a.norm().is_finite())) {
        return Err(bad(key, format!("axis [{}, {}, {}] has no direction", zero.x, zero.y, zero.z), form));
    }
    if given.pitch.is_some() != (given.kind == "screw") {
        return Err(bad(
            "pitch",
            "pitch belongs to a screw hinge, and a screw needs one".into(),
            "give pitch = x in m/rad for kind = \"screw\" only",
        ));
    }
    finite(given.pitch.as_slice(), place("hinge", h, "pitch"), &given.name)?;
    let axes: Vec<_> = given.axes.iter().map(Vector3::normalize).collect();
    Ok(match given.kind.as_str() {
        "fixed" => HingeKind::Fixed,
        "spherical" => HingeKind::Spherical,
        "free" => HingeKind::Free,
        "revolute" => HingeKind::Revolute { axis: axes[0] },
        "prismatic" => HingeKind::Prismatic { axis: axes[0] },
        "screw" => HingeKind::Screw { axis: axes[0], pitch: given.pitch.unwrap_or(0.0) },
        "cylindrical" => HingeKind::Cylindrical { axis: axes[0] },
        "universal" => HingeKind::Universal { axes: [axes[0], axes[1]] },
        "gimbal" => HingeKind::Gimbal { axes: [axes[0], axes[1], axes[2]] },
        _ => {
            let across = axes[0].cross(&axes[1]);
            // parallel axes have no normal; rounding leaves a few eps
            if across.norm() < 1e-6 {
                return Err(bad("axes", "the two axes of the planar hinge are parallel".into(), "give two axes that span the plane"));
            }
            HingeKind::Planar { axes: [axes[0], axes[1]], normal: across.normalize() }
        }
    })
}
