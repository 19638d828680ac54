//! Peaks, limits and error figures, followed over the output times; loads of hinges and closures over the ends of the steps as well.

use super::closure_load::{ClosureGauge, ClosureRecord};
use super::evaluation::Named;
use super::frame::OutputFrame;
use super::plan::OutputPlan;
use super::report::{BodyPeak, ErrorFigures, Exceedance, LoadPeak, Peaks};
use super::scales::plain;
use super::stiffening::StiffeningGauge;
use crate::dynamics::energy::Momentum;
use crate::dynamics::hinge_load::hinge_load;
use crate::integrate::{LocalError, Sample};
use crate::model::{ClosureJoint, HingeKind, System};
use crate::spatial::shift::{angular, linear};
use nalgebra::Vector6;

/// Something an output time made known.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A limit is exceeded from now on.
    Exceeded(Exceedance),
    /// A value is back within its limit.
    Recovered(Exceedance),
}

impl Event {
    /// The event as one line.
    #[must_use]
    pub fn text(&self) -> String {
        let (Self::Exceeded(e) | Self::Recovered(e)) = self;
        let Exceedance { name, quantity, unit, .. } = e;
        let quantity = quantity.replace('_', " ");
        let (peak, limit) = (plain(e.peak), plain(e.limit));
        match self {
            Self::Exceeded(_) => format!("{name}: {quantity} {peak} {unit} above its limit of {limit} {unit}"),
            Self::Recovered(_) => format!("{name}: {quantity} within its limit of {limit} {unit} again, peak {peak} {unit}"),
        }
    }
}

/// What a watched value is, and the stay above its limit that is open, if one is.
#[derive(Debug, Clone)]
struct Watch {
    source: Source,
    kind: &'static str,
    name: String,
    quantity: &'static str,
    unit: &'static str,
    limit: f64,
    open: Option<usize>,
}

/// Index into the frame's loads, closures or stresses.
#[derive(Debug, Clone, Copy)]
enum Source {
    Hinge(usize, Part),
    Closure(usize, Part),
    Stress(usize),
}

/// Part of a load, by its place among the magnitudes.
#[derive(Debug, Clone, Copy)]
enum Part {
    Moment = 0,
    Force = 1,
}

impl Source {
    /// The value where only loads are known.
    fn of_load(self, hinges: &[Vector6<f64>], closures: &[ClosureRecord]) -> Option<f64> {
        match self {
            Self::Hinge(i, part) => Some(magnitudes(&hinges[i])[part as usize]),
            Self::Closure(i, part) => Some(closures[i].load.magnitudes()[part as usize]),
            Self::Stress(_) => None,
        }
    }

    fn value(self, frame: &OutputFrame) -> Option<f64> {
        match self {
            Self::Stress(i) => Some(frame.stress[i].value),
            load => load.of_load(&frame.loads, &frame.closures),
        }
    }
}

/// Magnitudes of the moment and force of a hinge load.
fn magnitudes(load: &Vector6<f64>) -> [f64; 2] {
    [angular(load).norm(), linear(load).norm()]
}

/// Raises peaks to the magnitudes of moment and force at `time`.
fn raise_peaks(peaks: &mut [(String, LoadPeak)], loads: impl Iterator<Item = [f64; 2]>, time: f64) {
    for ((_, peak), [moment, force]) in peaks.iter_mut().zip(loads) {
        if moment > peak.moment {
            (peak.moment, peak.moment_time_s) = (moment, time);
        }
        if force > peak.force {
            (peak.force, peak.force_time_s) = (force, time);
        }
        peak.time_s = if peak.moment > 0.0 { peak.moment_time_s } else { peak.force_time_s };
    }
}

/// Follows a run over its output times, loads over its steps as well.
#[derive(Debug, Clone)]
pub struct Tracker {
    hinges: Vec<(String, LoadPeak)>,
    /// Bodies that the hinges carry, in the same order, and their loads at the last step.
    loaded: Vec<usize>,
    loads: Vec<Vector6<f64>>,
    closures: Vec<(String, LoadPeak)>,
    /// Largest moment and force that the local error of one step stands for, hinges first, then closures; empty before the first.
    local: Vec<[f64; 2]>,
    /// The closures, in the same order, and what they carried at the last step.
    gauges: Vec<ClosureGauge>,
    records: Vec<ClosureRecord>,
    bodies: Vec<(usize, String, BodyPeak)>,
    watches: Vec<Watch>,
    exceedances: Vec<Exceedance>,
    /// Events of the last output time and of the steps since the one before.
    pub events: Vec<Event>,
    since: Vec<Event>,
    start: Option<Start>,
    isolated: bool,
    total_mass: f64,
    energy_error: f64,
    largest_kinetic: f64,
    largest_change: f64,
    /// Largest strain and potential energy.
    largest_stored: f64,
    linear_drift: f64,
    angular_drift: f64,
    span: f64,
    audit: Option<f64>,
    closure: Option<f64>,
    stiffening: StiffeningGauge,
}

#[derive(Debug, Clone, Copy)]
struct Start {
    energy: f64,
    stored: f64,
    momentum: Momentum,
}

impl Tracker {
    /// A tracker of what `plan` asks of `system`.
    #[must_use]
    pub fn new(system: &System, plan: &OutputPlan) -> Self {
        let loaded = plan.loaded_hinges();
        let hinges = loaded.iter().map(|&k| (system.bodies[k].hinge.name.clone(), LoadPeak::default())).collect();
        let gauges: Vec<_> = plan.loaded_closures().into_iter().map(|i| ClosureGauge::new(system, i)).collect();
        let closures = gauges.iter().map(|g| (system.closures[g.closure()].name.clone(), LoadPeak::default())).collect();
        let stressed = plan.surfaces.iter().enumerate().filter(|(_, s)| s.stress);
        let bodies = stressed.map(|(i, s)| (i, system.bodies[s.body].name.clone(), BodyPeak::default())).collect();
        let mut watches = Vec::new();
        let mut watch = |source, kind, name: &str, quantity, unit, limit: Option<f64>| {
            if let Some(limit) = limit {
                watches.push(Watch { source, kind, name: name.to_owned(), quantity, unit, limit, open: None });
            }
        };
        for (i, &body) in loaded.iter().enumerate() {
            let (name, (moment, force)) = (&system.bodies[body].hinge.name, plan.hinge_limits(body));
            watch(Source::Hinge(i, Part::Moment), "hinge", name, "moment", "N m", moment);
            watch(Source::Hinge(i, Part::Force), "hinge", name, "force", "N", force);
        }
        for (i, gauge) in gauges.iter().enumerate() {
            let (name, (moment, force)) = (&system.closures[gauge.closure()].name, plan.closure_limits(gauge.closure()));
            watch(Source::Closure(i, Part::Moment), "closure", name, "moment", "N m", moment);
            watch(Source::Closure(i, Part::Force), "closure", name, "force", "N", force);
        }
        for (i, surface) in plan.surfaces.iter().enumerate().filter(|(_, s)| s.stress) {
            watch(Source::Stress(i), "body", &system.bodies[surface.body].name, "von_mises", "Pa", plan.stress_limit(surface.body));
        }
        Self {
            hinges,
            loads: vec![Vector6::zeros(); loaded.len()],
            loaded,
            closures,
            local: Vec::new(),
            records: gauges.iter().map(ClosureGauge::nothing).collect(),
            gauges,
            bodies,
            watches,
            exceedances: Vec::new(),
            events: Vec::new(),
            since: Vec::new(),
            start: None,
            isolated: is_isolated(system),
            total_mass: system.bodies.iter().map(crate::model::Body::mass).sum(),
            energy_error: 0.0,
            largest_kinetic: 0.0,
            largest_change: 0.0,
            largest_stored: 0.0,
            linear_drift: 0.0,
            angular_drift: 0.0,
            span: 0.0,
            audit: None,
            closure: None,
            stiffening: StiffeningGauge::new(system),
        }
    }

    /// Takes in one output time.
    pub fn follow(&mut self, plan: &OutputPlan, sample: &Sample<'_>, frame: &OutputFrame) {
        let time = sample.state.time;
        raise_peaks(&mut self.hinges, frame.loads.iter().map(magnitudes), time);
        raise_peaks(&mut self.closures, frame.closures.iter().map(|r| r.load.magnitudes()), time);
        for (index, _, peak) in &mut self.bodies {
            let found = frame.stress[*index];
            if found.value > peak.von_mises {
                let position = plan.surfaces[*index].surface.points.get(found.node).copied().unwrap_or_default();
                *peak = BodyPeak { von_mises: found.value, time_s: time, node: found.node, position };
            }
        }
        self.stiffening.follow(sample);
        self.watch_limits(time, |source| source.value(frame));
        self.events.clear();
        self.events.append(&mut self.since);
        self.follow_balances(sample, frame);
        if let Some(audit) = frame.audit {
            self.audit = Some(self.audit.unwrap_or(0.0).max(audit.load));
        }
        if let Some(closure) = frame.closure {
            self.closure = Some(self.closure.unwrap_or(0.0).max(closure));
        }
    }

    /// Takes in the end of a step: loads peak between output times too.
    pub fn follow_step(&mut self, step: &Sample<'_>) {
        let time = step.state.time;
        // work that comes and goes between output times is motion too
        self.largest_change = self.largest_change.max(step.work.abs());
        self.stiffening.follow(step);
        for (load, &k) in self.loads.iter_mut().zip(&self.loaded) {
            *load = hinge_load(step.workspace, k);
        }
        for (record, gauge) in self.records.iter_mut().zip(&self.gauges) {
            *record = gauge.read(step.system, step.workspace);
        }
        raise_peaks(&mut self.hinges, self.loads.iter().map(magnitudes), time);
        raise_peaks(&mut self.closures, self.records.iter().map(|r| r.load.magnitudes()), time);
        let (loads, records) = (std::mem::take(&mut self.loads), std::mem::take(&mut self.records));
        self.watch_limits(time, |source| source.of_load(&loads, &records));
        (self.loads, self.records) = (loads, records);
    }

    /// Takes in the local error of a step.
    pub fn follow_local_error(&mut self, error: &LocalError<'_>) {
        let Self { loaded, gauges, local, .. } = self;
        local.resize(loaded.len() + gauges.len(), [0.0; 2]);
        let hinges = loaded.iter().map(|&k| magnitudes(&(hinge_load(error.other, k) - hinge_load(error.workspace, k))));
        let load = |g: &ClosureGauge, w| g.load(error.system, w);
        let closures = gauges.iter().map(|g| load(g, error.other).difference(&load(g, error.workspace)));
        for (largest, change) in local.iter_mut().zip(hinges.chain(closures)) {
            (0..2).for_each(|i| largest[i] = largest[i].max(change[i]));
        }
    }

    /// The largest of these relative to the peak of its load; peaks that are rounding beside the largest do not count.
    fn local_load(&self) -> Option<f64> {
        let peaks: Vec<_> = self.hinges.iter().chain(&self.closures).map(|(_, p)| [p.moment, p.force]).collect();
        let largest = [0, 1].map(|i| peaks.iter().map(|p| p[i]).fold(0.0, f64::max));
        // a moment is rounding beside forces on arms of 1 m too
        let largest = [largest[0].max(largest[1]), largest[1]];
        let counts = |peak: f64, i: usize| peak > 1e-9 * largest[i];
        let share = |(change, peak): (&[f64; 2], &[f64; 2])| {
            (0..2).filter(|&i| counts(peak[i], i)).map(|i| change[i] / peak[i]).fold(0.0, f64::max)
        };
        self.local.iter().zip(&peaks).map(share).reduce(f64::max)
    }

    /// Holds the quantities that `value` knows against their limits.
    fn watch_limits(&mut self, time: f64, value: impl Fn(&Source) -> Option<f64>) {
        for watch in &mut self.watches {
            let Some(value) = value(&watch.source) else { continue };
            match watch.open {
                None if value > watch.limit => {
                    let Watch { kind, quantity, unit, limit, .. } = *watch;
                    let stay =
                        Exceedance { kind, name: watch.name.clone(), quantity, unit, limit, peak: value, start_s: time, end_s: None };
                    self.since.push(Event::Exceeded(stay.clone()));
                    watch.open = Some(self.exceedances.len());
                    self.exceedances.push(stay);
                }
                Some(open) if value > watch.limit => self.exceedances[open].peak = self.exceedances[open].peak.max(value),
                Some(open) => {
                    self.exceedances[open].end_s = Some(time);
                    self.since.push(Event::Recovered(self.exceedances[open].clone()));
                    watch.open = None;
                }
                None => {}
            }
        }
    }

    fn follow_balances(&mut self, sample: &Sample<'_>, frame: &OutputFrame) {
        let (energy, momentum) = (frame.energy, frame.momentum);
        let stored = energy.strain + energy.potential;
        let start = *self.start.get_or_insert(Start { energy: energy.total() - sample.work, stored, momentum });
        self.energy_error = self.energy_error.max((energy.total() - start.energy - sample.work).abs());
        self.largest_kinetic = self.largest_kinetic.max(energy.kinetic);
        self.largest_stored = self.largest_stored.max(energy.strain.abs()).max(energy.potential.abs());
        self.largest_change = self.largest_change.max((stored - start.stored).abs()).max(sample.work.abs());
        self.linear_drift = self.linear_drift.max((momentum.linear - start.momentum.linear).norm());
        self.angular_drift = self.angular_drift.max((momentum.angular - start.momentum.angular).norm());
        let reach = frame.frames.iter().map(|f| f.position.norm()).fold(0.0, f64::max);
        self.span = self.span.max(reach);
    }

    /// Peaks so far, in the order in which the scene defines hinges, closures and bodies.
    #[must_use]
    pub fn peaks(&self, system: &System) -> Peaks {
        let in_order = || system.definition_order.iter().map(|&k| &system.bodies[k]);
        let hinges = in_order().filter_map(|b| self.hinges.iter().find(|(name, _)| *name == b.hinge.name)).cloned();
        let closures = system.closures.iter().filter_map(|c| self.closures.iter().find(|(name, _)| *name == c.name)).cloned();
        let bodies = in_order().filter_map(|b| self.bodies.iter().find(|(_, name, _)| *name == b.name));
        let bodies = bodies.map(|(_, name, peak)| (name.clone(), *peak)).collect::<Named<_>>();
        Peaks { hinges: hinges.collect(), closures: closures.collect(), bodies }
    }

    /// Where the motion asks for geometric stiffness that is not used.
    #[must_use]
    pub fn warnings(&self, system: &System) -> Vec<String> {
        self.stiffening.warnings(system)
    }

    /// Stays above limits so far.
    #[must_use]
    pub fn exceedances(&self) -> &[Exceedance] {
        &self.exceedances
    }

    /// Error figures so far; `local` is that of the step control.
    #[must_use]
    pub fn errors(&self, local: Option<f64>) -> ErrorFigures {
        // slow loading stores energy without moving much: measure against what moved or came and went, whichever is more; of a structure at
        // rest under load only rounding does, which its changes show to half of the digits at best
        let scale = self.largest_kinetic.max(self.largest_change).max(f64::EPSILON.sqrt() * self.largest_stored);
        ErrorFigures {
            energy: ratio(self.energy_error, scale),
            momentum: self.isolated.then(|| self.momentum_error()),
            audit: self.audit,
            closure: self.closure,
            local,
            local_load: self.local_load(),
        }
    }

    /// Drift relative to `sqrt(2 m T)`, the momentum that the largest kinetic energy allows, and for the angular part times the reach.
    fn momentum_error(&self) -> f64 {
        let allowed = (2.0 * self.total_mass * self.largest_kinetic).sqrt();
        let start = self.start.map_or(0.0, |s| s.momentum.angular.norm());
        ratio(self.linear_drift, allowed).max(ratio(self.angular_drift, start.max(allowed * self.span)))
    }
}

fn ratio(error: f64, scale: f64) -> f64 {
    if scale > 0.0 { error / scale } else { error }
}

/// True if nothing outside acts on the system: it floats freely, without gravity and without external loads.
fn is_isolated(system: &System) -> bool {
    let floats = system.bodies.iter().filter(|b| b.parent.is_none()).all(|b| {
        let hinge = &b.hinge;
        matches!(hinge.kind, HingeKind::Free)
            && hinge.stiffness.is_empty()
            && hinge.damping.is_empty()
            && hinge.torque.is_none()
            && hinge.motion.is_none()
    });
    let anchored =
        system.closures.iter().any(|c| matches!(&c.joint, ClosureJoint::Frames { a, b, .. } if a.body.is_none() || b.body.is_none()));
    floats && !anchored && system.gravity.norm() == 0.0 && system.loads.is_empty()
}
