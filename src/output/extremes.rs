//! Largest and smallest value of every component of every load, with the other components at that instant.
//!
//! Looked at are the instants that peaks of a run come from: every output time and the end of every accepted step.

use super::closure_load::ClosureGauge;
use crate::dynamics::hinge_load::hinge_load;
use crate::integrate::{Flow, Observer, Sample};
use crate::model::System;
use crate::scene::Scene;

/// Most components of a load.
const MOST: usize = 6;

/// One load that is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadPlace {
    /// At the inboard hinge of a body, by its index: moment (N m) about O and force (N), in O axes, by the parent on the child.
    Hinge(usize),
    /// Of a closure, by its index, with its number of components: moment and force on b in the axes of frame a, or what a gear exerts.
    Closure(usize, usize),
}

impl LoadPlace {
    /// The loads that a scene outputs, hinges first.
    #[must_use]
    pub fn of(scene: &Scene) -> Vec<Self> {
        let hinges = scene.hinges.iter().map(|&body| Self::Hinge(body));
        let width = |i: usize| ClosureGauge::new(&scene.system, i).nothing().load.coordinate_force().map_or(MOST, |_| 1);
        hinges.chain(scene.closures.iter().map(|&i| Self::Closure(i, width(i)))).collect()
    }

    /// Number of components.
    #[must_use]
    pub fn width(self) -> usize {
        match self {
            Self::Hinge(_) => MOST,
            Self::Closure(_, width) => width,
        }
    }
}

/// The extremes of one load of w components: for each sense (largest, then smallest) and component, the time (s) and the w components.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub struct Extremes(Vec<f64>);

/// Largest or smallest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// Largest.
    Max,
    /// Smallest.
    Min,
}

impl Sense {
    /// Both, in the order of storage.
    pub const BOTH: [Self; 2] = [Self::Max, Self::Min];

    /// True if `a` goes beyond `b`.
    #[must_use]
    pub fn exceeds(self, a: f64, b: f64) -> bool {
        match self {
            Self::Max => a > b,
            Self::Min => a < b,
        }
    }

    /// "max" or "min".
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Max => "max",
            Self::Min => "min",
        }
    }
}

impl Extremes {
    /// Those of a single instant.
    fn of(load: &[f64], time: f64) -> Self {
        let instant = std::iter::once(time).chain(load.iter().copied());
        Self((0..2 * load.len()).flat_map(|_| instant.clone()).collect())
    }

    /// True if there are numbers for `width` components and all of them are finite.
    #[must_use]
    pub fn is_whole(&self, width: usize) -> bool {
        self.0.len() == 2 * width * (1 + width) && self.0.iter().all(|x| x.is_finite())
    }

    fn start(&self, width: usize, sense: Sense, component: usize) -> usize {
        debug_assert_eq!(self.0.len(), 2 * width * (1 + width));
        (sense as usize * width + component) * (1 + width)
    }

    /// Time (s) and all components where one of them is largest or smallest.
    #[must_use]
    pub fn at(&self, width: usize, sense: Sense, component: usize) -> (f64, &[f64]) {
        let start = self.start(width, sense, component);
        (self.0[start], &self.0[start + 1..=start + width])
    }

    /// Takes in one instant.
    fn raise(&mut self, load: &[f64], time: f64) {
        let width = load.len();
        for sense in Sense::BOTH {
            for (component, &value) in load.iter().enumerate() {
                let start = self.start(width, sense, component);
                if sense.exceeds(value, self.0[start + 1 + component]) {
                    self.0[start] = time;
                    self.0[start + 1..=start + width].copy_from_slice(load);
                }
            }
        }
    }
}

/// Follows a run.
#[derive(Debug)]
pub struct ExtremesTracker {
    places: Vec<LoadPlace>,
    /// Gauge of each closure among the places.
    gauges: Vec<Option<ClosureGauge>>,
    /// By place; none before the first instant.
    extremes: Vec<Option<Extremes>>,
}

impl ExtremesTracker {
    /// A tracker of these loads.
    #[must_use]
    pub fn new(system: &System, places: Vec<LoadPlace>) -> Self {
        let gauge = |place: &LoadPlace| match *place {
            LoadPlace::Hinge(_) => None,
            LoadPlace::Closure(index, _) => Some(ClosureGauge::new(system, index)),
        };
        Self { gauges: places.iter().map(gauge).collect(), extremes: vec![None; places.len()], places }
    }

    /// The extremes by place; none if there was no instant.
    #[must_use]
    pub fn finish(self) -> Option<Vec<Extremes>> {
        self.extremes.into_iter().collect()
    }

    fn follow(&mut self, sample: &Sample<'_>) {
        let time = sample.state.time;
        for ((place, gauge), extremes) in self.places.iter().zip(&self.gauges).zip(&mut self.extremes) {
            let mut load = [0.0; MOST];
            match (*place, gauge) {
                (LoadPlace::Hinge(body), _) => load.copy_from_slice(hinge_load(sample.workspace, body).as_slice()),
                (LoadPlace::Closure(..), None) => {}
                (LoadPlace::Closure(..), Some(gauge)) => {
                    let carried = gauge.load(sample.system, sample.workspace);
                    match carried.coordinate_force() {
                        Some(force) => load[0] = force,
                        None => load.copy_from_slice(carried.spatial().as_slice()),
                    }
                }
            }
            let load = &load[..place.width()];
            match extremes {
                Some(extremes) => extremes.raise(load, time),
                None => *extremes = Some(Extremes::of(load, time)),
            }
        }
    }
}

impl Observer for ExtremesTracker {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        self.follow(sample);
        Flow::Continue
    }

    fn step(&mut self, step: &Sample<'_>) -> Flow {
        self.follow(step);
        Flow::Continue
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_component_keeps_its_extremes_and_what_acted_beside_them() {
        let mut extremes = Extremes::of(&[1.0, 5.0], 0.0);
        extremes.raise(&[3.0, 4.0], 1.0);
        extremes.raise(&[-2.0, 4.5], 2.0);
        extremes.raise(&[3.0, 9.0], 3.0);
        let at = |sense, component| extremes.at(2, sense, component);
        // the first instant of equals counts
        assert_eq!(at(Sense::Max, 0), (1.0, &[3.0, 4.0][..]));
        assert_eq!(at(Sense::Max, 1), (3.0, &[3.0, 9.0][..]));
        assert_eq!(at(Sense::Min, 0), (2.0, &[-2.0, 4.5][..]));
        assert_eq!(at(Sense::Min, 1), (1.0, &[3.0, 4.0][..]));
        assert!(extremes.is_whole(2) && !extremes.is_whole(1));
        extremes.raise(&[f64::INFINITY, 0.0], 4.0);
        assert!(!extremes.is_whole(2));
    }
}
