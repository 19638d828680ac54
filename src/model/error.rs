//! What can be wrong with a definition, with the item and key it concerns.

use super::time_function::TableError;
use thiserror::Error;

/// Part of a definition that an error points at: its list, its place in the list (0-based) and the key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// "body", "hinge", "load" or "closure"; "system" for what belongs to none.
    pub section: &'static str,
    /// Index in that list.
    pub index: usize,
    /// Key within the item, as scenes spell it.
    pub key: &'static str,
}

/// Why a system cannot be built. Messages name the item, what was found, what was expected and what to do.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ModelError {
    /// No bodies.
    #[error("the system has no bodies; add at least one [[body]] and the [[hinge]] that carries it")]
    Empty,
    /// Two items of one name.
    #[error("two {} share the name \"{name}\"; names must be unique", if place.section == "body" { "bodies".into() } else { place.section.to_owned() + "s" })]
    DuplicateName {
        /// Where.
        place: Place,
        /// The name.
        name: String,
    },
    /// A body, or the world, that does not exist.
    #[error("{} \"{item}\": {} = \"{found}\" is not a body; known: {known}", place.section, place.key)]
    UnknownBody {
        /// Where.
        place: Place,
        /// Name of the item.
        item: String,
        /// The name given.
        found: String,
        /// Names that exist.
        known: String,
    },
    /// A name that is empty or stands for something else.
    #[error("a {} named \"{name}\": {reason}; give it another name", place.section)]
    BadName {
        /// Where.
        place: Place,
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A point given on a flexible body.
    #[error(
        "load {item}: point belongs to rigid bodies, and \"{body}\" is flexible, with displacements at interfaces and mesh nodes only; give node, one of \
         {known}, or mesh_node"
    )]
    PointOfFlexibleBody {
        /// Where.
        place: Place,
        /// Number of the load.
        item: String,
        /// The body.
        body: String,
        /// Its interfaces.
        known: String,
    },
    /// An interface that the body does not have.
    #[error("{} \"{item}\": {} = \"{found}\" is not an interface of body \"{body}\"; it has {known}", place.section, place.key)]
    UnknownInterface {
        /// Where.
        place: Place,
        /// Name of the item.
        item: String,
        /// The name given.
        found: String,
        /// The body.
        body: String,
        /// Its interfaces.
        known: String,
    },
    /// An interface asked for on a rigid body or the world.
    #[error("{} \"{item}\": {} = \"{found}\", but \"{body}\" is not flexible and has no interfaces; give {} instead", place.section, place.key, if place.section == "load" { "point = [x, y, z]" } else { "a frame" })]
    InterfaceOfRigidBody {
        /// Where.
        place: Place,
        /// Name of the item.
        item: String,
        /// The name given.
        found: String,
        /// The body.
        body: String,
    },
    /// No interface named on a flexible body.
    #[error("{} \"{item}\": body \"{body}\" is flexible; name one of its interfaces with {} (it has {known})", place.section, place.key)]
    MissingInterface {
        /// Where.
        place: Place,
        /// Name of the hinge.
        item: String,
        /// The body.
        body: String,
        /// Its interfaces.
        known: String,
    },
    /// A hinge at the end of a branch that moves nothing.
    #[error(
        "hinge \"{hinge}\" between \"{parent}\" and \"{child}\": nothing outboard has inertia along its rate {rate}; \
         give \"{child}\" mass or inertia there, or fix or prescribe the hinge"
    )]
    NoInertia {
        /// Where.
        place: Place,
        /// Name of the hinge.
        hinge: String,
        /// Name of the parent body, or "world".
        parent: String,
        /// Name of the child body.
        child: String,
        /// 1-based number of the rate.
        rate: usize,
    },
    /// A body that no hinge carries.
    #[error("body \"{body}\" is not the child of any hinge; join it to its parent or to \"world\" with a [[hinge]]")]
    Unconnected {
        /// Where.
        place: Place,
        /// The body.
        body: String,
    },
    /// A body that two hinges carry.
    #[error(
        "body \"{body}\" is the child of hinge \"{first}\" and of hinge \"{second}\"; a body has one inboard hinge, close a loop with a [[closure]]"
    )]
    TwoParents {
        /// Where.
        place: Place,
        /// The body.
        body: String,
        /// Hinge.
        first: String,
        /// Hinge.
        second: String,
    },
    /// Hinges that form a ring.
    #[error("the hinges form a cycle that does not reach \"world\": {cycle}; close a loop with a [[closure]]")]
    Cycle {
        /// Where.
        place: Place,
        /// Names of the bodies in the cycle.
        cycle: String,
    },
    /// A list of the wrong length.
    #[error("{} \"{item}\": {} has {found} value(s), expected {expected}", place.section, place.key)]
    WrongLength {
        /// Where.
        place: Place,
        /// Name of the item.
        item: String,
        /// Length given.
        found: usize,
        /// What is expected and why.
        expected: String,
    },
    /// A number that cannot be.
    #[error("{} \"{item}\": {} = {found} must be {expected}", place.section, place.key)]
    BadNumber {
        /// Where.
        place: Place,
        /// Name of the item.
        item: String,
        /// The value.
        found: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// A quaternion far from unit length.
    #[error("{} \"{item}\": {} is a quaternion of length {found}; expected [w, x, y, z] of length 1", place.section, place.key)]
    NotUnit {
        /// Where.
        place: Place,
        /// Name of the item.
        item: String,
        /// Its length.
        found: f64,
    },
    /// Axes, or another key, that do not fit the kind.
    #[error("{} \"{item}\": {found}; {expected}", place.section)]
    BadAxes {
        /// Where.
        place: Place,
        /// Name of the hinge.
        item: String,
        /// What is wrong.
        found: String,
        /// What a hinge of this kind needs.
        expected: String,
    },
    /// An inertia that no body can have.
    #[error("body \"{item}\": inertia has principal values {values:?} kg m^2, which no body has: {reason}")]
    BadInertia {
        /// Where.
        place: Place,
        /// The body.
        item: String,
        /// Principal moments, ascending.
        values: [f64; 3],
        /// Which rule is broken.
        reason: &'static str,
    },
    /// A motion on a hinge that cannot be prescribed by a function of time per coordinate.
    #[error("hinge \"{item}\": motion is not possible for a {kind} hinge; use a gimbal (angles) or a fixed hinge instead")]
    MotionOfQuaternion {
        /// Where.
        place: Place,
        /// The hinge.
        item: String,
        /// Its kind.
        kind: &'static str,
    },
    /// Keys that exclude one another.
    #[error("hinge \"{item}\": {} and {other} exclude one another; {remedy}", place.key)]
    Excluded {
        /// Where.
        place: Place,
        /// The hinge.
        item: String,
        /// The other key.
        other: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// A moment on a place that carries none.
    #[error("load {number} on body \"{body}\": a mesh node of a solid carries no moment; use an interface (node = ...)")]
    MomentOnNode {
        /// Where.
        place: Place,
        /// 1-based number of the load.
        number: usize,
        /// The body.
        body: String,
    },
    /// A closure between two frames that cannot move relative to one another.
    #[error("closure \"{item}\": both frames are fixed to \"{body}\"; join two different bodies")]
    ClosureOnOneBody {
        /// Where.
        place: Place,
        /// The closure.
        item: String,
        /// The body, or "world".
        body: String,
    },
    /// A table that cannot be used.
    #[error("{} \"{item}\": {}: {source}", place.section, place.key)]
    Table {
        /// Where.
        place: Place,
        /// Name of the item.
        item: String,
        /// What is wrong.
        source: TableError,
    },
}

impl ModelError {
    /// The item and key concerned, if it is one.
    #[must_use]
    pub fn place(&self) -> Option<&Place> {
        match self {
            Self::Empty => None,
            Self::DuplicateName { place, .. }
            | Self::UnknownBody { place, .. }
            | Self::BadName { place, .. }
            | Self::PointOfFlexibleBody { place, .. }
            | Self::UnknownInterface { place, .. }
            | Self::InterfaceOfRigidBody { place, .. }
            | Self::MissingInterface { place, .. }
            | Self::Unconnected { place, .. }
            | Self::TwoParents { place, .. }
            | Self::Cycle { place, .. }
            | Self::WrongLength { place, .. }
            | Self::BadNumber { place, .. }
            | Self::NotUnit { place, .. }
            | Self::BadAxes { place, .. }
            | Self::BadInertia { place, .. }
            | Self::MotionOfQuaternion { place, .. }
            | Self::Excluded { place, .. }
            | Self::MomentOnNode { place, .. }
            | Self::ClosureOnOneBody { place, .. }
            | Self::NoInertia { place, .. }
            | Self::Table { place, .. } => Some(place),
        }
    }
}
