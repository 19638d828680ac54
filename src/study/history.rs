//! What a study compares: loads at hinges and closures, and the stress of bodies, at the output times.

use super::stress::StressGauge;
use crate::dynamics::hinge_load::hinge_load;
use crate::integrate::{Flow, Observer, Sample};
use crate::output::OutputPlan;
use crate::output::closure_load::ClosureGauge;
use crate::scene::Scene;
use crate::scene::closures::gear_unit;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// N m.
    Moment,
    /// N.
    Force,
    /// Pa.
    Stress,
}

/// One load, with all its components, or one stress.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// "hinges", "closures" or "bodies".
    pub group: &'static str,
    /// Name of the hinge, closure or body.
    pub owner: String,
    /// Name of the quantity in results files.
    pub quantity: &'static str,
    /// Moment, force or stress.
    pub kind: Kind,
    /// Numbers per output time: three in the axes of the load's frame, one for a gear or a stress.
    pub width: usize,
}

impl Channel {
    /// Name in tables: "drive moment", "closure strut force", "panel stress".
    #[must_use]
    pub fn name(&self) -> String {
        let group = if self.group == "closures" { "closure " } else { "" };
        let kind = match self.kind {
            Kind::Moment => "moment",
            Kind::Force => "force",
            Kind::Stress => "stress",
        };
        format!("{group}{} {kind}", self.owner)
    }
}

/// Time histories of channels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct History {
    /// What is recorded.
    pub channels: Vec<Channel>,
    /// Output times (s).
    pub times: Vec<f64>,
    /// Of each channel, its numbers at one output time after the other.
    pub values: Vec<Vec<f64>>,
}

impl History {
    /// An empty history of the loads that a scene outputs or monitors, and of the stress of the bodies of `stress`.
    #[must_use]
    pub fn of(scene: &Scene, stress: &[StressGauge]) -> Self {
        let channels = channels(scene, stress);
        Self { values: vec![Vec::new(); channels.len()], channels, times: Vec::new() }
    }
}

/// Hinges and closures whose load a scene outputs, then those that it only monitors.
fn loaded(scene: &Scene) -> (Vec<usize>, Vec<usize>) {
    let (hinges, closures, monitors) = (scene.hinges.clone(), scene.closures.clone(), scene.monitors.clone());
    let plan = OutputPlan { hinges, closures, monitors, ..OutputPlan::default() };
    (plan.loaded_hinges(), plan.loaded_closures())
}

/// Hinges first, then closures, then bodies; moment before force.
fn channels(scene: &Scene, stress: &[StressGauge]) -> Vec<Channel> {
    let (system, (hinges, closures)) = (&scene.system, loaded(scene));
    let joint = |group, owner: &str| {
        [("load_moment", Kind::Moment), ("load_force", Kind::Force)].map(|(quantity, kind)| Channel {
            group,
            owner: owner.to_owned(),
            quantity,
            kind,
            width: 3,
        })
    };
    let mut channels: Vec<_> = hinges.into_iter().flat_map(|k| joint("hinges", &system.bodies[k].hinge.name)).collect();
    for index in closures {
        let closure = &system.closures[index];
        match gear_unit(system, closure) {
            None => channels.extend(joint("closures", &closure.name)),
            Some(unit) => channels.push(Channel {
                group: "closures",
                owner: closure.name.clone(),
                quantity: "coordinate_force",
                kind: if unit == "N" { Kind::Force } else { Kind::Moment },
                width: 1,
            }),
        }
    }
    channels.extend(stress.iter().map(|gauge| Channel {
        group: "bodies",
        owner: system.bodies[gauge.body].name.clone(),
        quantity: "von_mises_peak",
        kind: Kind::Stress,
        width: 1,
    }));
    channels
}

/// Records a history while a run goes on, and ends the run when it is told to.
#[derive(Debug)]
pub struct Recorder<'a> {
    hinges: Vec<usize>,
    gauges: Vec<ClosureGauge>,
    stress: &'a [StressGauge],
    /// Modal coordinates of each of these bodies at one output time after the other.
    modal: Vec<Vec<f64>>,
    interrupted: Option<&'a AtomicBool>,
    history: History,
}

impl<'a> Recorder<'a> {
    /// A recorder of the loads that `scene` outputs or monitors, and of the stress that `stress` gauges; the run ends once `interrupted`
    /// is true.
    #[must_use]
    pub fn new(scene: &Scene, stress: &'a [StressGauge], interrupted: Option<&'a AtomicBool>) -> Self {
        let (hinges, closures) = loaded(scene);
        let gauges = closures.into_iter().map(|i| ClosureGauge::new(&scene.system, i)).collect();
        Self { hinges, gauges, stress, modal: vec![Vec::new(); stress.len()], interrupted, history: History::of(scene, stress) }
    }

    /// What was recorded. Stress is evaluated now.
    #[must_use]
    pub fn finish(self) -> History {
        let Self { stress, modal, mut history, .. } = self;
        let (times, first) = (history.times.len(), history.channels.len() - stress.len());
        for ((gauge, modal), values) in stress.iter().zip(&modal).zip(&mut history.values[first..]) {
            let count = modal.len() / times.max(1);
            // a body that retains no mode has no stress
            values.extend((0..times).map(|i| gauge.read(&modal[i * count..(i + 1) * count])));
        }
        history
    }
}

impl Observer for Recorder<'_> {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        let History { times, values, .. } = &mut self.history;
        times.push(sample.state.time);
        let mut channel = values.iter_mut();
        let mut add = |numbers: &[f64]| {
            if let Some(values) = channel.next() {
                values.extend_from_slice(numbers);
            }
        };
        for &body in &self.hinges {
            let load = hinge_load(sample.workspace, body);
            add(&load.as_slice()[..3]);
            add(&load.as_slice()[3..]);
        }
        for gauge in &self.gauges {
            let load = gauge.load(sample.system, sample.workspace);
            match load.coordinate_force() {
                Some(force) => add(&[force]),
                None => {
                    let load = load.spatial();
                    add(&load.as_slice()[..3]);
                    add(&load.as_slice()[3..]);
                }
            }
        }
        for (gauge, modal) in self.stress.iter().zip(&mut self.modal) {
            modal.extend_from_slice(&sample.state.modal_position[sample.system.bodies[gauge.body].modal_range()]);
        }
        if self.interrupted.is_some_and(|flag| flag.load(Ordering::Relaxed)) { Flow::Stop } else { Flow::Continue }
    }
}
