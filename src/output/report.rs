//! The closing report of a run as a record: what `pliant run --json` prints.

use super::evaluation::{Evaluation, Named};
use crate::dynamics::profile::EvaluationTime;
use crate::integrate::Outcome;
use serde::Serialize;
use std::time::Duration;

/// Error figures; none where a figure does not apply.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ErrorFigures {
    /// Largest |E(t) - E(0) - work| at output times, relative to the largest kinetic energy, stored energy change or work.
    pub energy: f64,
    /// Drift of linear and angular momentum of a system that nothing outside acts on, relative to the momentum its kinetic energy allows.
    pub momentum: Option<f64>,
    /// Largest residual of the independent Newton-Euler sweep, relative to the largest load of its kind.
    pub audit: Option<f64>,
    /// Largest violation of a closure (m or rad).
    pub closure: Option<f64>,
    /// Largest accepted local error estimate of the step control.
    pub local: Option<f64>,
    /// Largest change of a load by the local error of one step (of every eighth), relative to the peak of that load.
    pub local_load: Option<f64>,
}

/// Where the wall-clock time of a run went.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TimeRecord {
    /// One evaluation of the dynamics (s), the average of every sixteenth.
    pub per_evaluation_s: f64,
    /// All evaluations at that price (s).
    pub evaluations_s: f64,
    /// Outputs: loads, stress, audit, estimates, files, viewer (s).
    pub outputs_s: f64,
    /// What is left: the integrator's own work (s).
    pub integrator_s: f64,
    /// Shares of an evaluation, measured at the end of the run.
    pub sweeps: SweepShares,
}

/// Shares of one evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SweepShares {
    /// Poses, and inertias of the deformed bodies.
    pub poses: f64,
    /// Velocities.
    pub velocities: f64,
    /// Articulated inertias.
    pub inertias: f64,
    /// Forces.
    pub forces: f64,
    /// Accelerations.
    pub accelerations: f64,
    /// Closures.
    pub closures: f64,
}

impl TimeRecord {
    /// How `wall` divides, with `evaluations` at their price and `outputs` measured; `one` is an evaluation taken apart.
    #[must_use]
    pub fn new(wall: Duration, outputs: Duration, (evaluations, per_evaluation_s): (u64, f64), one: &EvaluationTime) -> Self {
        let outputs_s = outputs.as_secs_f64();
        let left = (wall.as_secs_f64() - outputs_s).max(0.0);
        let evaluations_s = (per_evaluation_s * evaluations as f64).min(left);
        let share = |x: f64| if one.total() > 0.0 { x / one.total() } else { 0.0 };
        let sweeps = SweepShares {
            poses: share(one.poses),
            velocities: share(one.velocities),
            inertias: share(one.inertias),
            forces: share(one.forces),
            accelerations: share(one.accelerations),
            closures: share(one.closures),
        };
        Self { per_evaluation_s, evaluations_s, outputs_s, integrator_s: left - evaluations_s, sweeps }
    }
}

/// Largest load magnitudes at one hinge or closure over all steps and output times. What a gear exerts on an angle counts as a moment.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct LoadPeak {
    /// N m.
    pub moment: f64,
    /// N.
    pub force: f64,
    /// Time of the moment's peak, or of the force's where there never is a moment (s).
    pub time_s: f64,
    /// s.
    pub moment_time_s: f64,
    /// s.
    pub force_time_s: f64,
}

/// Largest stress of one body over the output times.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct BodyPeak {
    /// Pa.
    pub von_mises: f64,
    /// s.
    pub time_s: f64,
    /// Node of the modal file.
    pub node: usize,
    /// Undeformed place of the node in body axes (m).
    pub position: [f64; 3],
}

/// How much the modes left out change the load of one hinge or closure at most, an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TruncationFigures {
    /// N m.
    pub moment: f64,
    /// N.
    pub force: f64,
}

/// How much the modes left out change the largest stress of one body at most, an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct StressTruncation {
    /// Pa.
    pub von_mises: f64,
}

/// What the modes left out would change: estimates over the output times, to be held against the peaks.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Truncation {
    /// By hinge.
    pub hinges: Named<TruncationFigures>,
    /// By closure.
    pub closures: Named<TruncationFigures>,
    /// By body that leaves modes out and whose stress is evaluated.
    pub bodies: Named<StressTruncation>,
}

impl Truncation {
    /// The worst change of a load or a stress relative to its peak, and what it is of. Loads that are rounding do not count.
    #[must_use]
    pub fn worst(&self, peaks: &Peaks) -> Option<(f64, String)> {
        let mut found = Vec::new();
        for (kind, changes, peaks) in [("hinge", &self.hinges, &peaks.hinges), ("closure", &self.closures, &peaks.closures)] {
            for (name, change) in changes.iter() {
                let Some(peak) = peaks.get(name) else { continue };
                for (quantity, change, of) in [("moment", change.moment, peak.moment), ("force", change.force, peak.force)] {
                    found.extend(share(change, of).map(|s| (s, format!("the {quantity} at {kind} \"{name}\""))));
                }
            }
        }
        for (name, change) in self.bodies.iter() {
            let share = peaks.bodies.get(name).and_then(|peak| share(change.von_mises, peak.von_mises));
            found.extend(share.map(|s| (s, format!("the stress of \"{name}\""))));
        }
        found.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// `change` relative to `peak`; none beside a peak that is rounding.
#[must_use]
pub fn share(change: f64, peak: f64) -> Option<f64> {
    (peak > 1e-9).then(|| change / peak)
}

/// Peaks: of loads over all steps and output times, of stress over the output times.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Peaks {
    /// By hinge.
    pub hinges: Named<LoadPeak>,
    /// By closure.
    pub closures: Named<LoadPeak>,
    /// By body.
    pub bodies: Named<BodyPeak>,
}

/// A stay above a limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Exceedance {
    /// "hinge", "closure" or "body".
    pub kind: &'static str,
    /// Name of the hinge, closure or body.
    pub name: String,
    /// "moment", "force" or "von_mises".
    pub quantity: &'static str,
    /// Unit of limit and peak.
    pub unit: &'static str,
    /// The limit.
    pub limit: f64,
    /// Largest value of this stay.
    pub peak: f64,
    /// First time above the limit: an output time, for loads also the end of a step (s).
    pub start_s: f64,
    /// First such time back at or below it; none if the run ended above (s).
    pub end_s: Option<f64>,
}

/// A file or stream that the run wrote.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Written {
    /// "results" or "viewer".
    pub kind: &'static str,
    /// Path or address.
    pub target: String,
    /// Output times that reached it.
    pub frames: u64,
    /// What went wrong, if something did; what was written before is kept.
    pub problem: Option<String>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OutcomeRecord {
    /// "completed", "stopped" or "failed".
    pub status: &'static str,
    /// Why it failed.
    pub message: Option<String>,
}

impl From<&Outcome> for OutcomeRecord {
    fn from(outcome: &Outcome) -> Self {
        match outcome {
            Outcome::Completed => Self { status: "completed", message: None },
            Outcome::Stopped => Self { status: "stopped", message: None },
            Outcome::Failed(failure) => Self { status: "failed", message: Some(failure.to_string()) },
        }
    }
}

/// The closing report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Simulated time (s).
    pub simulated_s: f64,
    /// Wall-clock time (s).
    pub wall_s: f64,
    /// Name of the method.
    pub integrator: String,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected_steps: u64,
    /// Evaluations of the dynamics, output included.
    pub evaluations: u64,
    /// Where the time went; none if the end state has no evaluation.
    pub time: Option<TimeRecord>,
    /// Error figures.
    pub errors: ErrorFigures,
    /// Peaks.
    pub peaks: Peaks,
    /// What the modes left out would change, an estimate; none where none are left out.
    pub truncation: Option<Truncation>,
    /// Evaluation at the end; none if the end state has no evaluation.
    #[serde(rename = "final")]
    pub end: Option<Evaluation>,
    /// What the run did not evaluate.
    pub left_out: Vec<String>,
    /// What makes the model doubtful, in words.
    pub warnings: Vec<String>,
    /// Stays above limits, in the order of their start.
    pub exceedances: Vec<Exceedance>,
    /// Files and streams.
    pub files: Vec<Written>,
    /// How the run ended.
    pub outcome: OutcomeRecord,
}
