//! Closures: what closes a loop, in addition to the hinges of the tree.
//!
//! A closure joins a frame on body a to a frame on body b and blocks some directions of b's motion relative to a, or gears two hinge
//! coordinates to one another. Relative motion is taken at b's point in the axes of frame a:
//! `(R_a'(omega_b - omega_a), R_a'(v_b - v_a - omega_a x (p_b - p_a)))`. The multiplier of a blocked direction is the force on b along it.

use super::flexible_body::Attachment;
use nalgebra::Vector3;

/// Most directions that a closure can block.
pub const MAX_ROWS: usize = 6;

/// Which directions a joint between two frames blocks. Axes are of unit length, in the axes of frame a.
#[derive(Debug, Clone, PartialEq)]
pub enum ClosureKind {
    /// All six.
    Fixed,
    /// All but the rotation about the axis.
    Revolute { axis: Vector3<f64> },
    /// Translations, and the change of the angle between the first axis, fixed in a, and the second, fixed in b.
    Universal { axes: [Vector3<f64>; 2] },
    /// Translations.
    Spherical,
    /// All but rotation about and travel along the axis.
    Cylindrical { axis: Vector3<f64> },
    /// All but travel along the axis.
    Prismatic { axis: Vector3<f64> },
    /// Travel along the normal, and rotations across it.
    Planar { normal: Vector3<f64> },
}

impl ClosureKind {
    /// The name used in scenes.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Revolute { .. } => "revolute",
            Self::Universal { .. } => "universal",
            Self::Spherical => "spherical",
            Self::Cylindrical { .. } => "cylindrical",
            Self::Prismatic { .. } => "prismatic",
            Self::Planar { .. } => "planar",
        }
    }

    /// Number of blocked directions.
    #[must_use]
    pub fn row_count(&self) -> usize {
        match self {
            Self::Fixed => 6,
            Self::Revolute { .. } | Self::Prismatic { .. } => 5,
            Self::Universal { .. } | Self::Cylindrical { .. } => 4,
            Self::Spherical | Self::Planar { .. } => 3,
        }
    }
}

/// One of the two frames that a closure joins.
#[derive(Debug, Clone)]
pub struct ClosureSide {
    /// Index of the body, none for the world.
    pub body: Option<usize>,
    /// The frame, in the recursion's frame of the body.
    pub attachment: Attachment,
}

/// One coordinate of a hinge whose rate is that coordinate's derivative.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HingeCoordinate {
    /// Index of the body that the hinge carries.
    pub body: usize,
    /// Index in `State::position`.
    pub position: usize,
    /// Index in `State::velocity`.
    pub velocity: usize,
}

/// What is joined, and how.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "one per closure, built once")]
pub enum ClosureJoint {
    /// A joint between two frames.
    Frames {
        /// Blocked directions.
        kind: ClosureKind,
        /// Frame a, whose axes are those of the multiplier.
        a: ClosureSide,
        /// Frame b, at whose origin the multiplier acts.
        b: ClosureSide,
    },
    /// `theta_b = ratio * theta_a + offset` between two hinge coordinates; the multiplier is the force on coordinate b.
    Gear {
        /// theta_a.
        a: HingeCoordinate,
        /// theta_b.
        b: HingeCoordinate,
        /// Turns of b per turn of a (rad/rad, m/rad or rad/m).
        ratio: f64,
        /// theta_b at theta_a = 0.
        offset: f64,
    },
}

/// How a closure is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ClosureMethod {
    /// The loop is cut there, and multipliers close it (Paper section 4).
    #[default]
    TreeAugmented,
    /// The bodies of the loop become one aggregate body with independent coordinates (Paper section 5).
    ConstraintEmbedding,
}

impl ClosureMethod {
    /// Methods by the name that scenes use; the first is the default.
    pub const NAMES: [&'static str; 3] = ["auto", "tree_augmented", "constraint_embedding"];

    /// The method of that name; none for "auto" and for what is no method.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::TreeAugmented, Self::ConstraintEmbedding].into_iter().find(|m| m.name() == name)
    }

    /// True for "auto" and the methods' names.
    #[must_use]
    pub fn is_known(name: &str) -> bool {
        Self::NAMES.contains(&name)
    }

    /// The name used in scenes and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TreeAugmented => Self::NAMES[1],
            Self::ConstraintEmbedding => Self::NAMES[2],
        }
    }
}

/// One closure of a system.
#[derive(Debug, Clone)]
pub struct Closure {
    /// Unique among closures.
    pub name: String,
    /// What is joined.
    pub joint: ClosureJoint,
    /// How it is held.
    pub method: ClosureMethod,
    /// True if that was left to the program.
    pub chosen: bool,
    /// First multiplier of this closure among those of the system.
    pub first_row: usize,
}

impl Closure {
    /// Number of blocked directions.
    #[must_use]
    pub fn row_count(&self) -> usize {
        match &self.joint {
            ClosureJoint::Frames { kind, .. } => kind.row_count(),
            ClosureJoint::Gear { .. } => 1,
        }
    }

    /// Range of its multipliers among those of the system.
    #[must_use]
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.first_row..self.first_row + self.row_count()
    }
}
