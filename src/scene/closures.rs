//! `[[closure]]` of a scene to a definition by names.

use super::error::{SceneError, Source};
use super::locate::Step;
use super::spec::{ClosureSpec, FrameSpec};
use crate::model::build::Frame;
use crate::model::build_closure::ClosureDefinition;
use crate::model::{Closure, ClosureJoint, System};
use nalgebra::Vector3;

/// Index of the closure of that name.
#[must_use]
pub fn closure_index(system: &System, name: &str) -> Option<usize> {
    system.closures.iter().position(|c| c.name == name)
}

/// Unit of what a gear exerts on its coordinate b, "N m" on an angle or "N" on a travel; none for a joint between frames.
#[must_use]
pub fn gear_unit(system: &System, closure: &Closure) -> Option<&'static str> {
    let ClosureJoint::Gear { b, .. } = &closure.joint else { return None };
    let body = &system.bodies[b.body];
    let rate_unit = body.hinge.kind.rate_units()[b.velocity - body.velocity];
    Some(if rate_unit == "m/s" { "N" } else { "N m" })
}

/// Closure `index` of the scene; `method` is the command line's.
///
/// # Errors
/// If keys of frames and of gears are mixed, or one is missing.
pub fn closure(index: usize, spec: &ClosureSpec, method: Option<&str>, source: &Source) -> Result<ClosureDefinition, SceneError> {
    let at = |key| [Step::Key("closure"), Step::Index(index), Step::Key(key)];
    let gear = spec.kind == "gear";
    let of_frames = [
        ("axis", spec.axis.is_some()),
        ("axes", spec.axes.is_some()),
        ("body_a", spec.body_a.is_some()),
        ("node_a", spec.node_a.is_some()),
        ("frame_a", spec.frame_a.is_some()),
        ("body_b", spec.body_b.is_some()),
        ("node_b", spec.node_b.is_some()),
        ("frame_b", spec.frame_b.is_some()),
    ];
    let of_gears = [
        ("hinge_a", spec.hinge_a.is_some()),
        ("coordinate_a", spec.coordinate_a.is_some()),
        ("hinge_b", spec.hinge_b.is_some()),
        ("coordinate_b", spec.coordinate_b.is_some()),
        ("ratio", spec.ratio.is_some()),
        ("offset", spec.offset.is_some()),
    ];
    let foreign = if gear { of_frames.as_slice() } else { of_gears.as_slice() };
    if let Some((key, _)) = foreign.iter().find(|(_, given)| *given) {
        let message = if gear {
            format!("closure \"{}\" is a gear between two hinges; {key} belongs to the other kinds", spec.name)
        } else {
            format!("closure \"{}\" joins two frames; {key} belongs to kind = \"gear\"", spec.name)
        };
        return Err(source.value(&at(key), message));
    }
    let axes = match (&spec.axis, &spec.axes) {
        (Some(_), Some(_)) => return Err(source.value(&at("axes"), "give axis (one) or axes (several), not both")),
        (Some(axis), None) => vec![Vector3::from(*axis)],
        (None, axes) => axes.iter().flatten().map(|a| Vector3::from(*a)).collect(),
    };
    let (keys, ends) =
        if gear { (["hinge_a", "hinge_b"], [&spec.hinge_a, &spec.hinge_b]) } else { (["body_a", "body_b"], [&spec.body_a, &spec.body_b]) };
    let end = |i: usize| {
        let whole = [Step::Key("closure"), Step::Index(index)];
        ends[i].clone().ok_or_else(|| source.value(&whole, format!("closure \"{}\" needs {} and {}", spec.name, keys[0], keys[1])))
    };
    let frame = |f: &Option<FrameSpec>| {
        f.as_ref().map_or_else(Frame::default, |f| Frame { position: Vector3::from(f.position), quaternion: f.quaternion })
    };
    Ok(ClosureDefinition {
        name: spec.name.clone(),
        kind: spec.kind.clone(),
        axes,
        a: end(0)?,
        node_a: spec.node_a.clone(),
        frame_a: frame(&spec.frame_a),
        b: end(1)?,
        node_b: spec.node_b.clone(),
        frame_b: frame(&spec.frame_b),
        coordinates: [spec.coordinate_a, spec.coordinate_b],
        ratio: spec.ratio,
        offset: spec.offset,
        method: method.map(str::to_owned).or_else(|| spec.method.clone()),
    })
}
