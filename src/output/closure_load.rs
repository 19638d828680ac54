//! What closures carry, as all outputs read it: the load of a joint between frames, or what a gear exerts on a coordinate.

use crate::dynamics::Workspace;
use crate::model::System;
use crate::scene::closures::gear_unit;
use crate::spatial::shift::{angular, linear};
use nalgebra::Vector6;

/// What one closure carries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClosureLoad {
    /// Of a joint between frames: (moment N m about b's point; force N) on b, in the axes of frame a.
    Joint(Vector6<f64>),
    /// Of a gear, on coordinate b, an angle (N m).
    GearMoment(f64),
    /// Of a gear, on coordinate b, a travel (N).
    GearForce(f64),
}

impl ClosureLoad {
    /// Moment and force; zero for a gear.
    #[must_use]
    pub fn spatial(&self) -> Vector6<f64> {
        if let Self::Joint(load) = self { *load } else { Vector6::zeros() }
    }

    /// Of a gear, on coordinate b (N m or N); none for joints between frames.
    #[must_use]
    pub fn coordinate_force(&self) -> Option<f64> {
        match *self {
            Self::Joint(_) => None,
            Self::GearMoment(x) | Self::GearForce(x) => Some(x),
        }
    }

    /// Magnitudes of the difference in moment (N m) and force (N) from another load of the same closure.
    #[must_use]
    pub fn difference(&self, other: &Self) -> [f64; 2] {
        match (self, other) {
            (Self::Joint(a), Self::Joint(b)) => Self::Joint(a - b).magnitudes(),
            (Self::GearMoment(a), Self::GearMoment(b)) => Self::GearMoment(a - b).magnitudes(),
            (Self::GearForce(a), Self::GearForce(b)) => Self::GearForce(a - b).magnitudes(),
            _ => [0.0; 2],
        }
    }

    /// Magnitudes of moment (N m) and force (N).
    #[must_use]
    pub fn magnitudes(&self) -> [f64; 2] {
        match self {
            Self::Joint(load) => [angular(load).norm(), linear(load).norm()],
            Self::GearMoment(x) => [x.abs(), 0.0],
            Self::GearForce(x) => [0.0, x.abs()],
        }
    }
}

/// One closure at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosureRecord {
    /// What it carries.
    pub load: ClosureLoad,
    /// Largest violation (m or rad).
    pub residual: f64,
}

/// Reads one closure off evaluations; made once, so that reading allocates nothing.
#[derive(Debug, Clone, Copy)]
pub struct ClosureGauge {
    closure: usize,
    gear_unit: Option<&'static str>,
}

impl ClosureGauge {
    /// A gauge for the closure of that index.
    #[must_use]
    pub fn new(system: &System, closure: usize) -> Self {
        Self { closure, gear_unit: gear_unit(system, &system.closures[closure]) }
    }

    /// Index of the closure.
    #[must_use]
    pub fn closure(&self) -> usize {
        self.closure
    }

    /// What the closure carried in the last evaluation in `workspace`; zero if it has no closures.
    #[must_use]
    pub fn load(&self, system: &System, workspace: &Workspace) -> ClosureLoad {
        let multiplier = || workspace.closed.as_ref().map_or(0.0, |c| c.lambda[system.closures[self.closure].first_row]);
        match self.gear_unit {
            None => ClosureLoad::Joint(workspace.closure_load(system, self.closure)),
            Some("N") => ClosureLoad::GearForce(multiplier()),
            Some(_) => ClosureLoad::GearMoment(multiplier()),
        }
    }

    /// Load and residual in the last evaluation in `workspace`.
    #[must_use]
    pub fn read(&self, system: &System, workspace: &Workspace) -> ClosureRecord {
        ClosureRecord { load: self.load(system, workspace), residual: workspace.pose.closure_residual(system, self.closure) }
    }

    /// A record of zeros.
    #[must_use]
    pub fn nothing(&self) -> ClosureRecord {
        let load = match self.gear_unit {
            None => ClosureLoad::Joint(Vector6::zeros()),
            Some("N") => ClosureLoad::GearForce(0.0),
            Some(_) => ClosureLoad::GearMoment(0.0),
        };
        ClosureRecord { load, residual: 0.0 }
    }
}
