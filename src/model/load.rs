//! External forces and moments on points, interfaces and mesh nodes.

use super::flexible_body::Attachment;
use super::time_function::TimeFunction;
use nalgebra::{Vector3, Vector6};

/// Axes in which a load is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadAxes {
    /// Inertial axes.
    World,
    /// Axes of the loaded body's frame B.
    Body,
}

/// Where a load acts.
#[derive(Debug, Clone)]
pub enum LoadPoint {
    /// A point fixed to a rigid body, in the recursion's frame of that body (m).
    Rigid(Vector3<f64>),
    /// An interface of a flexible body.
    Interface(Attachment),
    /// A mesh node of a flexible body: undeformed position (m) and mode shape (rotation; translation), one per mode.
    Node {
        /// Undeformed position in body axes (m).
        position: Vector3<f64>,
        /// (rotation; translation) per mode.
        mode_shape: Vec<Vector6<f64>>,
    },
}

/// A force and moment that follow functions of time.
#[derive(Debug, Clone)]
pub struct Load {
    /// Index of the loaded body.
    pub body: usize,
    /// Where it acts.
    pub point: LoadPoint,
    /// Force (N), three components.
    pub force: Option<TimeFunction>,
    /// Moment (N m), three components.
    pub moment: Option<TimeFunction>,
    /// Axes of both.
    pub axes: LoadAxes,
}

impl Load {
    /// Force and moment at time `t` (s) in the load's axes: (moment; force).
    #[must_use]
    pub fn value(&self, t: f64) -> Vector6<f64> {
        let part = |f: &Option<TimeFunction>, i: usize| f.as_ref().map_or(0.0, |f| f.value(t, i));
        Vector6::from_fn(|i, _| if i < 3 { part(&self.moment, i) } else { part(&self.force, i - 3) })
    }
}
