//! A system by names, as scenes and tests write it down: nothing here is checked yet.

use super::build_closure::ClosureDefinition;
use super::flexible_body::{InertiaOrder, ModalIntegrals};
use super::load::LoadAxes;
use super::modal_body::ModalBody;
use super::time_function::TimeFunction;
use crate::spatial::rotation::{self, Quaternion};
use nalgebra::{Matrix3, Vector3, Vector6};
use std::sync::Arc;

/// A frame by position (m) and quaternion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// m.
    pub position: Vector3<f64>,
    /// `[w, x, y, z]`.
    pub quaternion: Quaternion,
}

impl Default for Frame {
    fn default() -> Self {
        Self { position: Vector3::zeros(), quaternion: rotation::IDENTITY }
    }
}

/// What a body is made of.
#[derive(Debug, Clone)]
pub enum BodyDefinitionKind {
    /// Rigid: mass (kg), centre of mass (m) and inertia about it (kg m^2), in body axes.
    Rigid { mass: f64, center_of_mass: Vector3<f64>, inertia: Matrix3<f64> },
    /// Flexible.
    Flexible(FlexibleDefinition),
}

/// A flexible body: modal data with the retained modes only.
#[derive(Debug, Clone)]
pub struct FlexibleDefinition {
    /// Data of the retained modes.
    pub modal: Arc<ModalBody>,
    /// The same, packed, with its geometric stiffness or without; share it between bodies of one file and one choice of modes.
    pub integrals: Arc<ModalIntegrals>,
    /// Names of the retained modes, as "mode 3".
    pub mode_names: Vec<String>,
    /// Damping ratio per retained mode.
    pub damping_ratio: Vec<f64>,
    /// Inertia order.
    pub order: InertiaOrder,
    /// Initial modal coordinates; empty for zero.
    pub modal_position: Vec<f64>,
    /// Initial modal rates; empty for zero.
    pub modal_velocity: Vec<f64>,
}

/// A body by name.
#[derive(Debug, Clone)]
pub struct BodyDefinition {
    /// Unique.
    pub name: String,
    /// Rigid or flexible.
    pub kind: BodyDefinitionKind,
}

/// A hinge by names. Lists left empty mean zero, or the reference position.
#[derive(Debug, Clone, Default)]
pub struct HingeDefinition {
    /// Unique.
    pub name: String,
    /// Kind as scenes spell it.
    pub kind: String,
    /// One axis or several, as the kind asks.
    pub axes: Vec<Vector3<f64>>,
    /// m/rad, for a screw.
    pub pitch: Option<f64>,
    /// Body name or "world".
    pub parent: String,
    /// Interface of a flexible parent.
    pub parent_node: Option<String>,
    /// O+ on the parent, or its offset from the interface.
    pub parent_frame: Frame,
    /// Body name.
    pub child: String,
    /// Interface of a flexible child; its root interface if none.
    pub child_node: Option<String>,
    /// O on the child, or its offset from the interface.
    pub child_frame: Frame,
    /// Initial coordinates.
    pub position: Vec<f64>,
    /// Initial rates.
    pub velocity: Vec<f64>,
    /// Springs: none, one for all, or one per rate.
    pub stiffness: Vec<f64>,
    /// Dampers, likewise.
    pub damping: Vec<f64>,
    /// Rest displacements, likewise.
    pub rest: Vec<f64>,
    /// Force on the rates.
    pub torque: Option<TimeFunction>,
    /// Prescribed coordinates.
    pub motion: Option<TimeFunction>,
    /// Keep the initial coordinates and rates as given when closures are assembled.
    pub held: bool,
}

/// Where a load acts.
#[derive(Debug, Clone)]
pub enum PointDefinition {
    /// Interface of a flexible body.
    Interface(String),
    /// Point of a rigid body, body axes (m).
    Point(Vector3<f64>),
    /// Mesh node of a flexible body with its mode shape per retained mode; `rotations` tells whether the file has them.
    Node { position: Vector3<f64>, mode_shape: Vec<Vector6<f64>>, rotations: bool },
}

/// An external load.
#[derive(Debug, Clone)]
pub struct LoadDefinition {
    /// Body name.
    pub body: String,
    /// Where it acts.
    pub point: PointDefinition,
    /// N.
    pub force: Option<TimeFunction>,
    /// N m.
    pub moment: Option<TimeFunction>,
    /// Axes of both.
    pub axes: LoadAxes,
}

/// A whole system by names.
#[derive(Debug, Clone, Default)]
pub struct Definition {
    /// m/s^2, inertial axes.
    pub gravity: Vector3<f64>,
    /// In any order.
    pub bodies: Vec<BodyDefinition>,
    /// In any order.
    pub hinges: Vec<HingeDefinition>,
    /// In any order.
    pub loads: Vec<LoadDefinition>,
    /// In any order.
    pub closures: Vec<ClosureDefinition>,
}
