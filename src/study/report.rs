//! What a study found, as a record: table, JSON, CSV and plot are made from it.

use super::error::{ChannelError, worst};
use super::grid::{Grid, Point};
use super::pareto::{Figures, cheapest, cheapest_where, front};
use super::reference::Reference;
use super::runner::Finished;
use crate::output::evaluation::Named;
use crate::scene::{Accuracy, Scene};
use serde::Serialize;

/// Run time of a point over its rounds (s).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Timing {
    /// Median, the cost of the point.
    pub median: f64,
    /// Fastest round.
    pub min: f64,
    /// Slowest round.
    pub max: f64,
    /// Rounds.
    pub runs: usize,
}

impl Timing {
    fn of(mut walls: Vec<f64>) -> Option<Self> {
        walls.sort_by(f64::total_cmp);
        let (min, max, runs) = (*walls.first()?, *walls.last()?, walls.len());
        Some(Self { median: 0.5 * (walls[(runs - 1) / 2] + walls[runs / 2]), min, max, runs })
    }
}

/// One point and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointReport {
    /// The setting.
    #[serde(flatten)]
    pub point: Point,
    /// Modes of all bodies together.
    pub retained_modes: usize,
    /// None for a gap.
    pub run_time_s: Option<Timing>,
    /// Accepted steps.
    pub steps: Option<u64>,
    /// Rejected steps.
    pub rejected_steps: Option<u64>,
    /// Evaluations of the dynamics, output included.
    pub evaluations: Option<u64>,
    /// Largest of all channels; none for a gap.
    pub error: Option<ChannelError>,
    /// By channel that is not silent.
    pub channels: Named<ChannelError>,
    /// Why there is a gap.
    pub failure: Option<String>,
    /// True on the Pareto front of run time and peak error.
    pub pareto: bool,
    /// True on the Pareto front of evaluations and peak error, which no machine decides.
    pub pareto_evaluations: bool,
    /// True if the peak error of every channel is within the budget.
    pub meets: bool,
}

/// The cheapest setting within the budget.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cheapest {
    /// Its index among the points.
    pub point: usize,
    /// Lines for the scene.
    pub lines: Vec<String>,
}

/// The whole study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyReport {
    /// Name of the scene.
    pub scene: String,
    /// s.
    pub duration_s: f64,
    /// Output times per second; errors are taken at these.
    pub rate_hz: f64,
    /// Rounds asked for.
    pub repeat: usize,
    /// Largest peak error allowed.
    pub error_budget: f64,
    /// False if it was interrupted.
    pub complete: bool,
    /// What errors are relative to.
    pub reference: Reference,
    /// Bodies whose largest von Mises stress is compared beside the loads.
    pub stress_bodies: Vec<String>,
    /// Channels in which nothing happens, which have no errors.
    pub silent: Vec<String>,
    /// Everything that was run, curve by curve from coarse to fine.
    pub points: Vec<PointReport>,
    /// None if no point meets the budget.
    pub cheapest: Option<Cheapest>,
    /// What else could go within the budget.
    pub proposals: Vec<String>,
    /// What was left out or could not be as asked.
    pub notes: Vec<String>,
}

impl StudyReport {
    /// Draws up the report.
    #[must_use]
    pub fn new(grid: &Grid, finished: &Finished, repeat: usize, error_budget: f64, notes: Vec<String>) -> Self {
        let base = &grid.base;
        let names: Vec<String> = grid.history().channels.iter().map(super::history::Channel::name).collect();
        let mut points: Vec<PointReport> = grid
            .points
            .iter()
            .zip(&finished.runs)
            .map(|(point, runs)| {
                let failure = runs.iter().find_map(|r| r.failure.clone());
                let first = runs.first().filter(|_| failure.is_none());
                let errors = first.map_or(&[][..], |r| &r.errors);
                let named = names.iter().zip(errors).filter_map(|(name, e)| e.map(|e| (name.clone(), e)));
                let error = worst(errors);
                PointReport {
                    retained_modes: grid.variants[point.scene].1.scene.system.modal_count,
                    point: point.clone(),
                    run_time_s: first.and_then(|_| Timing::of(runs.iter().map(|r| r.wall_s).collect())),
                    steps: first.map(|r| r.steps),
                    rejected_steps: first.map(|r| r.rejected_steps),
                    evaluations: first.map(|r| r.evaluations),
                    channels: named.collect(),
                    failure: failure.or_else(|| runs.is_empty().then(|| "not run: interrupted".to_owned())),
                    meets: error.is_some_and(|e| e.peak <= error_budget),
                    error,
                    pareto: false,
                    pareto_evaluations: false,
                }
            })
            .collect();
        let figures: Vec<Figures> = points.iter().map(|p| Some((p.run_time_s?.median, p.error?.peak))).collect();
        // nothing is known of errors below that of the reference
        let floor = finished.reference.own_error.unwrap_or(0.0);
        let known: Vec<Figures> = figures.iter().map(|f| f.map(|(cost, error)| (cost, error.max(floor)))).collect();
        front(&known).into_iter().for_each(|i| points[i].pareto = true);
        let counted = |(p, f): (&PointReport, &Figures)| f.and_then(|(_, error)| Some((p.evaluations? as f64, error)));
        let counted: Vec<Figures> = points.iter().zip(&known).map(counted).collect();
        front(&counted).into_iter().for_each(|i| points[i].pareto_evaluations = true);
        let found = cheapest(&figures, error_budget);
        let lines = found.map(|point| Cheapest { point, lines: scene_lines(base, &grid.points[point]) });
        let some_errors = finished.runs.iter().flatten().find(|r| r.failure.is_none()).map_or(&[][..], |r| &r.errors);
        Self {
            scene: base.name.clone(),
            duration_s: base.duration.unwrap_or(0.0),
            rate_hz: base.rate_hz,
            repeat,
            error_budget,
            complete: !finished.interrupted,
            reference: finished.reference.clone(),
            stress_bodies: grid.stress().iter().map(|g| base.system.bodies[g.body].name.clone()).collect(),
            silent: names.iter().zip(some_errors).filter(|(_, e)| e.is_none()).map(|(n, _)| n.clone()).collect(),
            proposals: proposals(&points, &figures, error_budget),
            points,
            cheapest: lines,
            notes,
        }
    }

    /// One row per point and channel; a gap has one row without a channel.
    ///
    /// # Errors
    /// If the rows cannot be written.
    pub fn write_csv(&self, sink: &mut dyn std::io::Write) -> Result<(), csv::Error> {
        let mut writer = csv::Writer::from_writer(sink);
        writer.write_record([
            "integrator",
            "tolerance",
            "step",
            "modes",
            "residual_modes",
            "geometric_stiffness",
            "inertia_order",
            "closure_method",
            "retained_modes",
            "run_time_median_s",
            "run_time_min_s",
            "run_time_max_s",
            "runs",
            "steps",
            "evaluations",
            "channel",
            "peak_error",
            "rms_error",
            "pareto",
            "pareto_evaluations",
            "failure",
        ])?;
        for p in &self.points {
            let text = |x: Option<&dyn std::fmt::Display>| x.map_or_else(String::new, ToString::to_string);
            fn some<T: std::fmt::Display>(x: Option<&T>) -> Option<&dyn std::fmt::Display> {
                x.map(|x| x as &dyn std::fmt::Display)
            }
            let time = p.run_time_s.as_ref();
            let setting = [
                p.point.integrator.clone(),
                text(some(p.point.tolerance.as_ref())),
                text(some(p.point.step.as_ref())),
                text(some(p.point.variant.modes.as_ref())),
                text(some(p.point.variant.residual_modes.as_ref())),
                text(some(p.point.variant.geometric_stiffness.as_ref())),
                text(some(p.point.variant.inertia_order.as_ref())),
                text(some(p.point.variant.closure_method.as_ref())),
                p.retained_modes.to_string(),
                text(some(time.map(|t| &t.median))),
                text(some(time.map(|t| &t.min))),
                text(some(time.map(|t| &t.max))),
                text(some(time.map(|t| &t.runs))),
                text(some(p.steps.as_ref())),
                text(some(p.evaluations.as_ref())),
            ];
            let mut row = |channel: &str, peak: String, rms: String| {
                let fronts = [p.pareto, p.pareto_evaluations].map(|on| on.to_string());
                let end = [&[channel.to_owned(), peak, rms], &fronts[..], &[p.failure.clone().unwrap_or_default()]].concat();
                writer.write_record(setting.iter().chain(&end))
            };
            if p.failure.is_some() {
                row("", String::new(), String::new())?;
            }
            for (name, error) in p.channels.iter() {
                row(name, error.peak.to_string(), error.rms.to_string())?;
            }
        }
        Ok(writer.flush()?)
    }
}

/// The lines that make a scene run as `point` does.
fn scene_lines(scene: &Scene, point: &Point) -> Vec<String> {
    let mut lines = vec!["# in [simulation]".to_owned(), format!("integrator = \"{}\"", point.integrator)];
    match point.accuracy() {
        Accuracy::Tolerance(relative) => {
            let absolute = scene.control.at(relative).tolerance.absolute;
            lines.push(format!("relative_tolerance = {}", short(relative)));
            lines.push(format!("absolute_tolerance = {}", short(absolute)));
        }
        Accuracy::Step(step) => lines.push(format!("step = {step:e}")),
    }
    let variant = &point.variant;
    let of_bodies = [
        variant.modes.map(|n| format!("modes = {{ count = {n} }}")),
        variant.residual_modes.map(|on| format!("residual_modes = {on}")),
        variant.geometric_stiffness.map(|on| format!("geometric_stiffness = {on}")),
        variant.inertia_order.map(|o| format!("inertia_order = {o}")),
    ];
    if of_bodies.iter().any(Option::is_some) {
        lines.push("# in each flexible [[body]]".into());
        lines.extend(of_bodies.into_iter().flatten());
    }
    if let Some(method) = &variant.closure_method {
        lines.push("# in each [[closure]]".into());
        lines.push(format!("method = \"{method}\""));
    }
    lines
}

/// A tolerance without the last digits of a product.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.12e}").parse().unwrap_or(value);
    format!("{rounded:e}")
}

/// What else could go: the fewest modes and the lowest inertia order that some point within the budget has.
fn proposals(points: &[PointReport], figures: &[Figures], budget: f64) -> Vec<String> {
    let mut proposals = Vec::new();
    let mut of = |what: &str, named: &dyn Fn(usize) -> String, value: &dyn Fn(&PointReport) -> Option<usize>| {
        let mut values: Vec<usize> = points.iter().filter_map(value).collect();
        values.sort_unstable();
        values.dedup();
        let (Some(&most), true) = (values.last(), values.len() > 1) else { return };
        let best = |wanted: usize| cheapest_where(figures, budget, |i| value(&points[i]) == Some(wanted));
        let words = |i: usize| {
            let (cost, error) = figures[i].unwrap_or_default();
            format!("{:.2e} s, error {:.2} % with {}", cost, 100.0 * error, points[i].point.words())
        };
        let Some((least, index)) = values.iter().find_map(|&v| Some((v, best(v)?))) else {
            let all = values.iter().map(|&v| named(v)).collect::<Vec<_>>().join(", ");
            proposals.push(format!("{what}: none of {all} meets {} % at any accuracy that was run", 100.0 * budget));
            return;
        };
        if least == most {
            proposals.push(format!("{what}: less than {} does not meet {} % at any accuracy that was run", named(most), 100.0 * budget));
            return;
        }
        let against = best(most).map_or_else(|| "does not meet it".to_owned(), |i| format!("costs {}", words(i)));
        proposals.push(format!("{what}: {} is enough ({}); {} {against}", named(least), words(index), named(most)));
    };
    let number = |n: usize| n.to_string();
    let switch = |on: usize| if on == 0 { "off".to_owned() } else { "on".to_owned() };
    of("modes per body", &number, &|p| p.point.variant.modes);
    of("geometric stiffness", &switch, &|p| p.point.variant.geometric_stiffness.map(usize::from));
    of("inertia order", &number, &|p| p.point.variant.inertia_order.map(usize::from));
    proposals
}
