//! One evaluation of the dynamics as a record: what `pliant eval --json` prints and the closing report ends with.
//!
//! Hinges and bodies come in the order in which the scene defines them. Numbers are printed so that they read back to the same f64.

use super::closure_load::{ClosureGauge, ClosureRecord};
use crate::dynamics::energy::balance;
use crate::dynamics::hinge_load::hinge_load;
use crate::dynamics::inverse::NewtonEuler;
use crate::dynamics::world::WorldFrame;
use crate::dynamics::{DynamicsError, Workspace, forward_dynamics};
use crate::model::{State, System};
use crate::spatial::shift::{angular, linear};
use nalgebra::Vector6;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Records by name, in a fixed order; serialised as a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Named<T>(pub Vec<(String, T)>);

impl<T> Default for Named<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Named<T> {
    /// The record of that name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&T> {
        self.0.iter().find(|(n, _)| n == name).map(|(_, record)| record)
    }

    /// Names and records in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &T)> {
        self.0.iter().map(|(name, record)| (name.as_str(), record))
    }
}

impl<T> FromIterator<(String, T)> for Named<T> {
    fn from_iter<I: IntoIterator<Item = (String, T)>>(records: I) -> Self {
        Self(records.into_iter().collect())
    }
}

impl<T: Serialize> Serialize for Named<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, record) in &self.0 {
            map.serialize_entry(name, record)?;
        }
        map.end()
    }
}

/// A load: at a hinge, by the parent on the child, moment about O, both in O axes.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct LoadRecord {
    /// N m.
    pub moment: [f64; 3],
    /// N.
    pub force: [f64; 3],
}

impl From<Vector6<f64>> for LoadRecord {
    fn from(load: Vector6<f64>) -> Self {
        Self { moment: angular(&load).into(), force: linear(&load).into() }
    }
}

/// One hinge: coordinates, rates, accelerations and load. Units follow the kind of the hinge.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct HingeEvaluation {
    /// Coordinates q.
    pub position: Vec<f64>,
    /// Rates v.
    pub velocity: Vec<f64>,
    /// Rates of v.
    pub acceleration: Vec<f64>,
    /// By the parent on the child.
    pub load: LoadRecord,
}

/// One flexible body, its retained modes in order.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct BodyEvaluation {
    /// Modal coordinates (m kg^(1/2)).
    pub modal_position: Vec<f64>,
    /// Their rates.
    pub modal_velocity: Vec<f64>,
    /// Their accelerations.
    pub modal_acceleration: Vec<f64>,
}

/// One closure: the spatial force on body b at b's point in the axes of frame a, and how far it is from closed.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct ClosureEvaluation {
    /// On body b.
    pub load: LoadRecord,
    /// Force on coordinate b of a gear (N m or N); none for joints between frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coordinate_force: Option<f64>,
    /// Largest violation (m or rad).
    pub residual: f64,
}

fn closures(system: &System, workspace: &Workspace) -> Named<ClosureEvaluation> {
    let record = |index: usize| {
        let ClosureRecord { load, residual } = ClosureGauge::new(system, index).read(system, workspace);
        let record = ClosureEvaluation { load: load.spatial().into(), coordinate_force: load.coordinate_force(), residual };
        (system.closures[index].name.clone(), record)
    };
    (0..system.closures.len()).map(record).collect()
}

/// Energies (J).
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct EnergyRecord {
    /// Of motion.
    pub kinetic: f64,
    /// Of modes and hinge springs.
    pub strain: f64,
    /// Of gravity.
    pub potential: f64,
}

/// What the independent Newton-Euler sweep says of the loads.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct AuditRecord {
    /// Largest disagreement of a hinge load, relative to the largest of its kind in the system.
    pub load_residual: f64,
}

/// One evaluation of a whole system.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Evaluation {
    /// By hinge.
    pub hinges: Named<HingeEvaluation>,
    /// By flexible body; rigid bodies have nothing to say here.
    pub bodies: Named<BodyEvaluation>,
    /// By closure.
    pub closures: Named<ClosureEvaluation>,
    /// J.
    pub energy: EnergyRecord,
    /// Of the hinge loads.
    pub audit: AuditRecord,
}

impl Evaluation {
    /// The record of the last evaluation in `workspace`, which must be that of `state`.
    #[must_use]
    pub fn at(system: &System, state: &State, workspace: &Workspace) -> Self {
        let mut frames = vec![WorldFrame::default(); system.bodies.len()];
        let (energy, _) = balance(system, state, workspace, &mut frames);
        let in_order = || system.definition_order.iter().map(|&k| (k, &system.bodies[k]));
        let hinge = |(k, body): (usize, &crate::model::Body)| {
            let record = HingeEvaluation {
                position: state.position[body.position_range()].to_vec(),
                velocity: state.velocity[body.velocity_range()].to_vec(),
                acceleration: workspace.acceleration.hinge[body.velocity_range()].to_vec(),
                load: hinge_load(workspace, k).into(),
            };
            (body.hinge.name.clone(), record)
        };
        let flexible = |(_, body): (usize, &crate::model::Body)| {
            body.flexible()?;
            let record = BodyEvaluation {
                modal_position: state.modal_position[body.modal_range()].to_vec(),
                modal_velocity: state.modal_velocity[body.modal_range()].to_vec(),
                modal_acceleration: workspace.acceleration.modal[body.modal_range()].to_vec(),
            };
            Some((body.name.clone(), record))
        };
        Self {
            hinges: in_order().map(hinge).collect(),
            bodies: in_order().filter_map(flexible).collect(),
            closures: closures(system, workspace),
            energy: EnergyRecord { kinetic: energy.kinetic, strain: energy.strain, potential: energy.potential },
            audit: AuditRecord { load_residual: NewtonEuler::new(system).audit(system, state, workspace).load },
        }
    }

    /// True if accelerations, loads and energies are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let of_hinge = |h: &HingeEvaluation| h.acceleration.iter().chain(&h.load.moment).chain(&h.load.force).all(|x| x.is_finite());
        let of_closure = |c: &ClosureEvaluation| {
            let load = c.load.moment.iter().chain(&c.load.force).chain(&c.coordinate_force);
            load.chain([&c.residual]).all(|x| x.is_finite())
        };
        let energy = [self.energy.kinetic, self.energy.strain, self.energy.potential];
        self.hinges.iter().all(|(_, h)| of_hinge(h))
            && self.bodies.iter().all(|(_, b)| b.modal_acceleration.iter().all(|x| x.is_finite()))
            && self.closures.iter().all(|(_, c)| of_closure(c))
            && energy.iter().all(|x| x.is_finite())
    }

    /// Evaluates the dynamics at `state`, whose prescribed hinges must stand at their functions' values, and records the result.
    ///
    /// # Errors
    /// [`DynamicsError`] if the evaluation has no answer, or not a finite one.
    pub fn of(system: &System, state: &State) -> Result<Self, DynamicsError> {
        let mut workspace = Workspace::new(system);
        forward_dynamics(system, state, &mut workspace)?;
        let evaluation = Self::at(system, state, &workspace);
        if evaluation.is_finite() { Ok(evaluation) } else { Err(DynamicsError::NotFinite { place: "a load or an energy".into() }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::build::{BodyDefinition, BodyDefinitionKind, Definition, HingeDefinition};
    use nalgebra::{Matrix3, Vector3};

    fn pendulum() -> Definition {
        let rigid = |name: &str, mass| BodyDefinition {
            name: name.into(),
            kind: BodyDefinitionKind::Rigid { mass, center_of_mass: Vector3::x(), inertia: Matrix3::identity() },
        };
        let hinge = |name: &str, parent: &str, child: &str| HingeDefinition {
            name: name.into(),
            kind: "revolute".into(),
            axes: vec![Vector3::y()],
            parent: parent.into(),
            child: child.into(),
            position: vec![0.1],
            ..HingeDefinition::default()
        };
        // the child comes first, so that the order of definition is not that of the recursion
        Definition {
            gravity: Vector3::new(0.0, 0.0, -9.81),
            bodies: vec![rigid("tip", 1.0 / 3.0), rigid("arm", 2.0)],
            hinges: vec![hinge("elbow", "arm", "tip"), hinge("shoulder", "world", "arm")],
            ..Definition::default()
        }
    }

    #[test]
    fn evaluation_reads_back_to_the_same_numbers_in_definition_order() -> Result<(), Box<dyn std::error::Error>> {
        let (system, state) = pendulum().build()?;
        let evaluation = Evaluation::of(&system, &state)?;
        let names: Vec<_> = evaluation.hinges.iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["elbow", "shoulder"]);
        assert!(evaluation.bodies.0.is_empty());
        assert!(evaluation.audit.load_residual < 1e-13, "{evaluation:?}");

        let text = serde_json::to_string(&evaluation)?;
        let read: serde_json::Value = serde_json::from_str(&text)?;
        let keys: Vec<_> = read.as_object().into_iter().flatten().map(|(key, _)| key.as_str()).collect();
        assert_eq!(keys.len(), 5);
        let shoulder = evaluation.hinges.get("shoulder").ok_or("no shoulder")?;
        assert_eq!(read["hinges"]["shoulder"]["load"]["force"][2].as_f64(), Some(shoulder.load.force[2]));
        assert_eq!(read["hinges"]["elbow"]["acceleration"][0].as_f64(), evaluation.hinges.get("elbow").map(|h| h.acceleration[0]));
        assert!(text.find("elbow") < text.find("shoulder"));
        Ok(())
    }
}
