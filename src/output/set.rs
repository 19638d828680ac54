//! All outputs of a run behind one observer: each output time is evaluated once and handed to whoever wants it.
//!
//! A writer that fails is closed and its message kept; the run and the other writers go on.

use super::evaluation::Evaluation;
use super::frame::FrameEvaluator;
use super::picture::Snapshot;
use super::plan::{OutputPlan, PlanError};
use super::report::{OutcomeRecord, Peaks, RunReport, TimeRecord, Truncation, Written};
#[cfg(feature = "hdf5")]
use super::results::ResultsWriter;
use super::scales::plain;
use super::tracker::Tracker;
use super::truncation::TruncationGauge;
use super::viewer::ViewerStream;
use crate::dynamics::profile::profile;
use crate::integrate::{Flow, LocalError, Observer, Outcome, Sample, Summary};
#[cfg(feature = "hdf5")]
use crate::io::ResultsError;
use crate::model::System;
use std::time::{Duration, Instant};

/// The outputs of one run.
#[derive(Debug)]
pub struct OutputSet<'s> {
    system: &'s System,
    plan: OutputPlan,
    evaluator: FrameEvaluator,
    tracker: Tracker,
    truncation: Option<TruncationGauge>,
    #[cfg(feature = "hdf5")]
    results: Option<ResultsWriter>,
    viewer: Option<ViewerStream>,
    written: Vec<Written>,
    /// Time that the outputs took.
    spent: Duration,
}

impl<'s> OutputSet<'s> {
    /// Outputs of `plan`, with nothing to write to yet.
    ///
    /// # Errors
    /// If the plan does not fit the system.
    pub fn new(system: &'s System, plan: OutputPlan) -> Result<Self, PlanError> {
        plan.check(system)?;
        Ok(Self {
            system,
            evaluator: FrameEvaluator::new(system, &plan),
            tracker: Tracker::new(system, &plan),
            truncation: TruncationGauge::new(system, &plan),
            plan,
            #[cfg(feature = "hdf5")]
            results: None,
            viewer: None,
            written: Vec::new(),
            spent: Duration::ZERO,
        })
    }

    /// Adds a results file.
    ///
    /// # Errors
    /// If the file cannot be made.
    #[cfg(feature = "hdf5")]
    pub fn write_results(&mut self, path: &std::path::Path) -> Result<(), ResultsError> {
        self.results = Some(ResultsWriter::create(path, self.system, &self.plan)?);
        Ok(())
    }

    /// Opens a viewer stream that shows the system framed as it is at `start`.
    ///
    /// # Errors
    /// If no viewer can be reached or the file cannot be made.
    #[cfg(feature = "rerun")]
    pub fn open_viewer(&mut self, target: &super::ViewerTarget, start: &crate::model::State) -> Result<(), super::ViewerError> {
        self.add_viewer(super::rerun::open(target, &self.plan, self.system, start)?);
        Ok(())
    }

    /// Adds a viewer stream that was opened for this plan.
    pub fn add_viewer(&mut self, stream: ViewerStream) {
        self.viewer = Some(stream);
    }

    /// Path or address of the viewer stream.
    #[must_use]
    pub fn viewer_target(&self) -> Option<&str> {
        self.viewer.as_ref().map(ViewerStream::target)
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &OutputPlan {
        &self.plan
    }

    /// Peaks, limits and error figures so far.
    #[must_use]
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// Messages of writers that failed so far.
    pub fn problems(&self) -> impl Iterator<Item = &str> {
        self.written.iter().filter_map(|w| w.problem.as_deref())
    }

    /// Closes all writers and draws up the closing report. `left_out` names what the run did not evaluate.
    #[must_use]
    pub fn finish(mut self, summary: &Summary, integrator: &str, wall: Duration, left_out: Vec<String>) -> RunReport {
        #[cfg(feature = "hdf5")]
        self.finish_results(summary);
        self.finish_viewer(summary);
        let one = summary.end.is_finite().then(|| profile(self.system, &summary.end, PROFILE).ok()).flatten();
        let end = summary.end.is_finite().then(|| Evaluation::of(self.system, &summary.end).ok()).flatten();
        let truncation = self.truncation.as_ref().map(|gauge| gauge.report(self.system));
        let peaks = self.tracker.peaks(self.system);
        let mut warnings = std::mem::take(&mut self.plan.warnings);
        warnings.extend(self.tracker.warnings(self.system));
        warnings.extend(truncation.as_ref().and_then(|t| truncation_warning(t, &peaks)));
        RunReport {
            simulated_s: summary.time,
            wall_s: wall.as_secs_f64(),
            integrator: integrator.to_owned(),
            steps: summary.steps,
            rejected_steps: summary.rejected,
            evaluations: summary.evaluations,
            time: one.map(|one| TimeRecord::new(wall, self.spent, (summary.evaluations, summary.evaluation_s), &one)),
            errors: self.tracker.errors(summary.local_error),
            truncation,
            peaks,
            end,
            left_out,
            warnings,
            exceedances: self.tracker.exceedances().to_vec(),
            files: self.written,
            outcome: OutcomeRecord::from(&summary.outcome),
        }
    }

    #[cfg(feature = "hdf5")]
    fn finish_results(&mut self, summary: &Summary) {
        if let Some(results) = self.results.take() {
            self.written.push(close_results(results, summary.outcome == Outcome::Completed, summary.time));
        }
    }

    fn finish_viewer(&mut self, summary: &Summary) {
        if let Some(mut viewer) = self.viewer.take() {
            if let Outcome::Failed(failure) = &summary.outcome {
                viewer.note(summary.time, &failure.to_string());
            }
            let target = viewer.target().to_owned();
            match viewer.finish() {
                Ok(done) => self.written.push(Written { kind: "viewer", target, frames: done.frames, problem: None }),
                Err(e) => self.written.push(Written { kind: "viewer", target, frames: e.frames(), problem: Some(e.to_string()) }),
            }
        }
    }
}

/// Waits until the file is whole, or says why it is not.
#[cfg(feature = "hdf5")]
fn close_results(results: ResultsWriter, completed: bool, end_time: f64) -> Written {
    let target = results.path().display().to_string();
    let (frames, problem) = match results.finish(completed, end_time) {
        Ok(rows) => (rows, None),
        Err(error) => (error.rows(), Some(error.to_string())),
    };
    Written { kind: "results", target, frames, problem }
}

/// Time spent at the end of a run on measuring an evaluation.
const PROFILE: Duration = Duration::from_millis(3);

/// Share of a peak from which what left-out modes change is worth a warning.
const NOTABLE_TRUNCATION: f64 = 0.01;

fn truncation_warning(truncation: &Truncation, peaks: &Peaks) -> Option<String> {
    let (share, what) = truncation.worst(peaks).filter(|(share, _)| *share > NOTABLE_TRUNCATION)?;
    Some(format!(
        "the modes left out may change {what} by {} % of its peak; set residual_modes = true or retain more modes",
        plain(100.0 * share)
    ))
}

impl Observer for OutputSet<'_> {
    fn step(&mut self, step: &Sample<'_>) -> Flow {
        let started = Instant::now();
        self.tracker.follow_step(step);
        if let Some(gauge) = &mut self.truncation {
            gauge.follow(step);
        }
        if let Some(viewer) = &mut self.viewer {
            viewer.pass_on();
        }
        self.spent += started.elapsed();
        Flow::Continue
    }

    fn wants_local_errors(&self) -> bool {
        true
    }

    fn local_error(&mut self, error: &LocalError<'_>) {
        self.tracker.follow_local_error(error);
    }

    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        let started = Instant::now();
        self.evaluator.evaluate(&self.plan, sample);
        let frame = &self.evaluator.frame;
        self.tracker.follow(&self.plan, sample, frame);
        if let Some(gauge) = &mut self.truncation {
            gauge.observe(&self.plan, sample, frame);
        }
        #[cfg(feature = "hdf5")]
        if let Some(results) = &mut self.results
            && !results.write(&self.plan, sample, frame)
            && let Some(results) = self.results.take()
        {
            self.written.push(close_results(results, false, sample.state.time));
        }
        if let Some(viewer) = &mut self.viewer {
            let snapshot = Snapshot::of(viewer.hinges(), viewer.closures(), sample, frame, &self.tracker.events);
            viewer.send(snapshot);
        }
        self.spent += started.elapsed();
        Flow::Continue
    }
}
