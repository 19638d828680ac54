//! What a study compares: loads at hinges and closures at the output times.

use crate::dynamics::hinge_load::hinge_load;
use crate::integrate::{Flow, Observer, Sample};
use crate::model::System;
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
}

/// One load, with all its components.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// "hinges" or "closures".
    pub group: &'static str,
    /// Name of the hinge or closure.
    pub owner: String,
    /// Name of the quantity in results files.
    pub quantity: &'static str,
    /// Moment or force.
    pub kind: Kind,
    /// Numbers per output time: three in the axes of the load's frame, one for a gear.
    pub width: usize,
}

impl Channel {
    /// Name in tables: "drive moment", "closure strut force".
    #[must_use]
    pub fn name(&self) -> String {
        let group = if self.group == "closures" { "closure " } else { "" };
        let kind = if self.kind == Kind::Moment { "moment" } else { "force" };
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
    /// An empty history of the loads that a scene outputs.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let channels = channels(&scene.system, &scene.hinges, &scene.closures);
        Self { values: vec![Vec::new(); channels.len()], channels, times: Vec::new() }
    }
}

/// Hinges first, then closures; moment before force.
fn channels(system: &System, hinges: &[usize], closures: &[usize]) -> Vec<Channel> {
    let joint = |group, owner: &str| {
        [("load_moment", Kind::Moment), ("load_force", Kind::Force)].map(|(quantity, kind)| Channel {
            group,
            owner: owner.to_owned(),
            quantity,
            kind,
            width: 3,
        })
    };
    let mut channels: Vec<_> = hinges.iter().flat_map(|&k| joint("hinges", &system.bodies[k].hinge.name)).collect();
    for &index in closures {
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
    channels
}

/// Records a history while a run goes on, and ends the run when it is told to.
#[derive(Debug)]
pub struct Recorder<'a> {
    hinges: Vec<usize>,
    gauges: Vec<ClosureGauge>,
    interrupted: Option<&'a AtomicBool>,
    /// What was recorded so far.
    pub history: History,
}

impl<'a> Recorder<'a> {
    /// A recorder of the loads that `scene` outputs; the run ends once `interrupted` is true.
    #[must_use]
    pub fn new(scene: &Scene, interrupted: Option<&'a AtomicBool>) -> Self {
        let gauges = scene.closures.iter().map(|&i| ClosureGauge::new(&scene.system, i)).collect();
        Self { hinges: scene.hinges.clone(), gauges, interrupted, history: History::of(scene) }
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
        if self.interrupted.is_some_and(|flag| flag.load(Ordering::Relaxed)) { Flow::Stop } else { Flow::Continue }
    }
}
