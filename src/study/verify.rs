//! How right one run is: its differences from a tighter run of the same scene.

use super::error::{ChannelError, SILENT, compare};
use super::history::History;
use crate::integrate::simulate::Method;
use crate::integrate::step_control::Tolerance;
use crate::model::System;
use crate::output::RunReport;
use crate::output::evaluation::Named;
use crate::output::report::LoadPeak;
use serde::Serialize;

/// Divides tolerances.
const TIGHTER: f64 = 10.0;

/// The method with a tenth of its tolerances, or half its step.
#[must_use]
pub fn tighter(method: Method) -> Method {
    let tenth = |t: Tolerance| Tolerance { relative: t.relative / TIGHTER, absolute: t.absolute / TIGHTER };
    match method {
        Method::RungeKutta4 { step } => Method::RungeKutta4 { step: 0.5 * step },
        Method::DormandPrince { tolerance, largest_step } => Method::DormandPrince { tolerance: tenth(tolerance), largest_step },
        Method::RosenbrockW { tolerance, largest_step } => Method::RosenbrockW { tolerance: tenth(tolerance), largest_step },
    }
}

/// Differences of loads, relative to the tighter run; none where nothing but rounding happens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoadDifference {
    /// Of the peak moment.
    pub moment: Option<f64>,
    /// Of the peak force.
    pub force: Option<f64>,
    /// Of the moment over the output times, if it is an output or monitored.
    pub moment_history: Option<ChannelError>,
    /// Of the force over the output times, if it is an output or monitored; of a gear, of what it exerts.
    pub force_history: Option<ChannelError>,
}

/// Differences at one hinge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HingeDifference {
    /// Of its load.
    #[serde(flatten)]
    pub load: LoadDifference,
    /// Largest of its coordinates at the end (m or rad); a rotation counts by its angle. None without coordinates.
    pub position: Option<f64>,
}

/// What `run --verify` found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verification {
    /// Of the tighter run, if it has one.
    pub relative_tolerance: Option<f64>,
    /// Of the tighter run, if it is fixed (s).
    pub step: Option<f64>,
    /// Run time of the tighter run (s).
    pub wall_s: f64,
    /// Why the tighter run ended early; then there are no differences.
    pub failure: Option<String>,
    /// By hinge whose load is reported, and all that moved.
    pub hinges: Named<HingeDifference>,
    /// By closure.
    pub closures: Named<LoadDifference>,
}

/// A report with its verification, as one record.
#[derive(Debug, Serialize)]
pub struct VerifiedReport<'a> {
    /// The report.
    #[serde(flatten)]
    pub report: &'a RunReport,
    /// None if it was not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verify: Option<&'a Verification>,
}

impl Verification {
    /// The differences between a run and the tighter one.
    #[must_use]
    pub fn of(system: &System, method: Method, [run, tight]: [&RunReport; 2], [history, expected]: [&History; 2]) -> Self {
        let (relative_tolerance, step) = match method {
            Method::RungeKutta4 { step } => (None, Some(step)),
            Method::DormandPrince { tolerance, .. } | Method::RosenbrockW { tolerance, .. } => (Some(tolerance.relative), None),
        };
        let failure = tight.outcome.message.clone().or_else(|| (tight.outcome.status != "completed").then(|| "interrupted".to_owned()));
        let mut verification =
            Self { relative_tolerance, step, wall_s: tight.wall_s, failure, hinges: Named::default(), closures: Named::default() };
        if verification.failure.is_some() {
            return verification;
        }
        let errors = compare(expected, history).unwrap_or_default();
        let of_history = |group: &str, owner: &str, quantities: &[&str]| {
            let mut found = expected.channels.iter().zip(&errors);
            found.find(|(c, _)| c.group == group && c.owner == owner && quantities.contains(&c.quantity)).and_then(|(_, e)| *e)
        };
        let peaks = tight.peaks.hinges.iter().chain(tight.peaks.closures.iter()).map(|(_, p)| p);
        let (moment, force) = peaks.fold((0.0_f64, 0.0_f64), |(m, f), p| (m.max(p.moment), f.max(p.force)));
        let relative = |a: f64, b: f64, scale: f64| (b > SILENT * scale).then(|| (a - b).abs() / b);
        let load = |group: &str, owner: &str, a: &LoadPeak, b: &LoadPeak| LoadDifference {
            moment: relative(a.moment, b.moment, moment.max(force)),
            force: relative(a.force, b.force, force),
            moment_history: of_history(group, owner, &["load_moment"]),
            force_history: of_history(group, owner, &["load_force", "coordinate_force"]),
        };
        for (name, a) in run.peaks.hinges.iter() {
            let Some(b) = tight.peaks.hinges.get(name) else { continue };
            let position = position_difference(system, name, run, tight);
            verification.hinges.0.push((name.to_owned(), HingeDifference { load: load("hinges", name, a, b), position }));
        }
        for (name, a) in run.peaks.closures.iter() {
            let Some(b) = tight.peaks.closures.get(name) else { continue };
            verification.closures.0.push((name.to_owned(), load("closures", name, a, b)));
        }
        verification
    }
}

/// Largest difference of the coordinates of a hinge at the end (m or rad).
fn position_difference(system: &System, name: &str, run: &RunReport, tight: &RunReport) -> Option<f64> {
    let kind = &system.bodies[system.hinge_index(name)?].hinge.kind;
    let at = |report: &RunReport| Some(report.end.as_ref()?.hinges.get(name)?.position.clone());
    let (a, b) = (at(run)?, at(tight)?);
    // the quaternion comes last
    let plain = a.len() - if kind.has_quaternion() { 4 } else { 0 };
    let moved = a[..plain].iter().zip(&b[..plain]).map(|(a, b)| (a - b).abs()).reduce(f64::max);
    let chord = |sign: f64| a[plain..].iter().zip(&b[plain..]).map(|(a, b)| (a - sign * b).powi(2)).sum::<f64>().sqrt();
    // unit quaternions an angle apart are 2 sin(angle / 4) from each other, or from each other's opposite
    let turned = kind.has_quaternion().then(|| 4.0 * (0.5 * chord(1.0).min(chord(-1.0))).min(1.0).asin());
    match (moved, turned) {
        (Some(a), Some(b)) => Some(a.max(b)),
        (a, b) => a.or(b),
    }
}
