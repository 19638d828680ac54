//! Names, units, frames, points and sides of everything that is put out. Results file, viewer and documentation read them here.

use super::plan::OutputPlan;
use crate::model::closure::HingeCoordinate;
use crate::model::{Body, Closure, ClosureJoint, ClosureKind, ClosureSide, HingeKind, System};
use crate::scene::closures::gear_unit;

/// What one channel is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// What it belongs to: "hinges", "closures", "bodies", "energy" or "audit"; empty for the time.
    pub group: &'static str,
    /// Name of the hinge, closure or body; empty if the group has only one.
    pub owner: String,
    /// Name of the quantity.
    pub quantity: &'static str,
    /// Numbers per output time; none for a plain number.
    pub width: Option<usize>,
    /// Unit, or one per component, separated by commas.
    pub unit: String,
    /// Axes in which components are given, if they have any.
    pub frame: Option<String>,
    /// Point about which moments are taken, or whose position is given.
    pub point: Option<String>,
    /// Who acts on whom.
    pub side: Option<String>,
    /// Names of the components, separated by commas, if they have any.
    pub components: Option<String>,
}

/// Unit of modal coordinates: they are scaled to unit modal mass.
pub const MODAL_UNIT: &str = "m kg^(1/2)";

impl Channel {
    fn new(group: &'static str, owner: &str, quantity: &'static str, width: Option<usize>, unit: impl Into<String>) -> Self {
        let (frame, point, side, components) = (None, None, None, None);
        Self { group, owner: owner.to_owned(), quantity, width, unit: unit.into(), frame, point, side, components }
    }

    fn components(mut self, names: impl Into<String>) -> Self {
        self.components = Some(names.into());
        self
    }
}

/// Units of hinge coordinates (order 0), rates (1) and accelerations (2).
#[must_use]
pub fn hinge_units(kind: &HingeKind, order: usize) -> String {
    const SUFFIX: [&str; 3] = ["", "/s", "/s^2"];
    let units: Vec<String> = match (kind, order) {
        (HingeKind::Spherical, 0) => ["1"; 4].map(str::to_owned).to_vec(),
        (HingeKind::Free, 0) => ["m", "m", "m", "1", "1", "1", "1"].map(str::to_owned).to_vec(),
        _ => {
            let bases = kind.rate_units().into_iter().map(|unit| unit.trim_end_matches("/s"));
            bases.map(|base| format!("{base}{}", SUFFIX[order.min(2)])).collect()
        }
    };
    match units.split_first() {
        Some((first, rest)) if rest.iter().all(|unit| unit == first) => first.clone(),
        _ => units.join(", "),
    }
}

/// "by PARENT on CHILD".
#[must_use]
pub fn load_side(system: &System, body: &Body) -> String {
    let parent = body.parent.map_or("world", |p| system.bodies[p].name.as_str());
    format!("by {parent} on {}", body.name)
}

/// Frame of the load at the hinge of `body`.
#[must_use]
pub fn load_frame(body: &Body) -> String {
    format!("O of hinge {} (child side)", body.hinge.name)
}

/// Point about which moments of closures are taken, and at which their forces act.
pub const CLOSURE_POINT: &str = "origin of frame b";

fn closure_body<'s>(system: &'s System, side: &ClosureSide) -> &'s str {
    side.body.map_or("world", |k| system.bodies[k].name.as_str())
}

/// "coordinate 1 of HINGE".
fn coordinate_name(system: &System, coordinate: &HingeCoordinate) -> String {
    let body = &system.bodies[coordinate.body];
    format!("coordinate {} of {}", coordinate.position - body.position + 1, body.hinge.name)
}

/// "by BODY A on BODY B"; of a gear "by coordinate 1 of HINGE A on coordinate 1 of HINGE B".
#[must_use]
pub fn closure_side(system: &System, closure: &Closure) -> String {
    match &closure.joint {
        ClosureJoint::Frames { a, b, .. } => format!("by {} on {}", closure_body(system, a), closure_body(system, b)),
        ClosureJoint::Gear { a, b, .. } => format!("by {} on {}", coordinate_name(system, a), coordinate_name(system, b)),
    }
}

/// Frame of the load of a closure; a gear has none.
#[must_use]
pub fn closure_frame(system: &System, closure: &Closure) -> Option<String> {
    let ClosureJoint::Frames { a, .. } = &closure.joint else { return None };
    Some(format!("frame a of closure {} (on {})", closure.name, closure_body(system, a)))
}

/// Unit of the residual of a closure, the largest of its kind's violations.
#[must_use]
pub fn residual_unit(system: &System, closure: &Closure) -> &'static str {
    match (&closure.joint, gear_unit(system, closure)) {
        (ClosureJoint::Frames { kind: ClosureKind::Spherical, .. }, _) | (ClosureJoint::Gear { .. }, Some("N")) => "m",
        (ClosureJoint::Frames { .. }, _) => "m or rad",
        (ClosureJoint::Gear { .. }, _) => "rad",
    }
}

/// Where the load acts and how the axes of its components stand, both in the world.
fn pose_channels(group: &'static str, owner: &str, point: &str, axes: &str, out: &mut Vec<Channel>) {
    let new = |quantity, width, unit| Channel { frame: Some("world".into()), ..Channel::new(group, owner, quantity, Some(width), unit) };
    out.push(Channel { point: Some(point.into()), ..new("load_point", 3, "m").components("x, y, z") });
    out.push(Channel { point: Some(axes.into()), ..new("load_quaternion", 4, "1").components("w, x, y, z") });
}

fn closure_channels(system: &System, closure: &Closure, out: &mut Vec<Channel>) {
    let new = |quantity, width, unit: &str| Channel::new("closures", &closure.name, quantity, width, unit);
    let side = Some(closure_side(system, closure));
    match gear_unit(system, closure) {
        Some(unit) => out.push(Channel { side, ..new("coordinate_force", None, unit) }),
        None => {
            for (quantity, unit) in [("load_moment", "N m"), ("load_force", "N")] {
                let (frame, point, side) = (closure_frame(system, closure), Some(CLOSURE_POINT.into()), side.clone());
                out.push(Channel { frame, point, side, ..new(quantity, Some(3), unit).components("x, y, z") });
            }
            pose_channels("closures", &closure.name, CLOSURE_POINT, "axes of frame a", out);
        }
    }
    out.push(new("residual", None, residual_unit(system, closure)));
}

fn hinge_channels(system: &System, body: &Body, out: &mut Vec<Channel>) {
    let (name, kind) = (&body.hinge.name, &body.hinge.kind);
    let new = |quantity, width, unit: String| Channel::new("hinges", name, quantity, Some(width), unit);
    out.push(new("position", kind.position_count(), hinge_units(kind, 0)));
    out.push(new("velocity", kind.rate_count(), hinge_units(kind, 1)));
    out.push(new("acceleration", kind.rate_count(), hinge_units(kind, 2)));
    for (quantity, unit) in [("load_moment", "N m"), ("load_force", "N")] {
        out.push(Channel {
            frame: Some(load_frame(body)),
            point: Some("O".into()),
            side: Some(load_side(system, body)),
            ..new(quantity, 3, unit.into()).components("x, y, z")
        });
    }
    pose_channels("hinges", name, "O", "axes of O", out);
}

fn body_channels(body: &Body, stress: bool, out: &mut Vec<Channel>) {
    let new = |quantity, width, unit: &str| Channel::new("bodies", &body.name, quantity, width, unit);
    let world = Some("world".to_owned());
    let point = Some("origin of the body frame B".to_owned());
    out.push(Channel { frame: world.clone(), point, ..new("position", Some(3), "m").components("x, y, z") });
    out.push(Channel { frame: world, ..new("quaternion", Some(4), "1").components("w, x, y, z") });
    if let Some(flexible) = body.flexible() {
        let modes = flexible.mode_names.join(", ");
        for (quantity, suffix) in [("modal_position", ""), ("modal_velocity", "/s"), ("modal_acceleration", "/s^2")] {
            out.push(new(quantity, Some(flexible.mode_count()), &format!("{MODAL_UNIT}{suffix}")).components(modes.as_str()));
        }
    }
    if stress {
        out.push(Channel { point: Some("node of the largest value".into()), ..new("von_mises_peak", None, "Pa") });
    }
}

/// Channels of the results file in their order. A fixed hinge has no coordinates, and no channels for them.
#[must_use]
pub fn result_channels(system: &System, plan: &OutputPlan) -> Vec<Channel> {
    let mut channels = vec![Channel::new("", "", "time", None, "s")];
    plan.hinges.iter().for_each(|&k| hinge_channels(system, &system.bodies[k], &mut channels));
    plan.closures.iter().for_each(|&i| closure_channels(system, &system.closures[i], &mut channels));
    for &k in &system.definition_order {
        let stress = plan.surfaces.iter().any(|s| s.body == k && s.stress);
        body_channels(&system.bodies[k], stress, &mut channels);
    }
    for quantity in ["kinetic", "strain", "potential", "work"] {
        channels.push(Channel::new("energy", "", quantity, None, "J"));
    }
    if plan.audit {
        channels.push(Channel::new("audit", "", "load_residual", None, "1"));
    }
    channels.retain(|channel| channel.width != Some(0));
    channels
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn units_follow_the_kind_of_the_hinge() {
        let revolute = HingeKind::Revolute { axis: Vector3::x() };
        assert_eq!([0, 1, 2].map(|order| hinge_units(&revolute, order)), ["rad", "rad/s", "rad/s^2"]);
        assert_eq!(hinge_units(&HingeKind::Cylindrical { axis: Vector3::x() }, 1), "rad/s, m/s");
        assert_eq!(hinge_units(&HingeKind::Spherical, 0), "1");
        assert_eq!(hinge_units(&HingeKind::Free, 0), "m, m, m, 1, 1, 1, 1");
        assert_eq!(hinge_units(&HingeKind::Fixed, 2), "");
    }
}
