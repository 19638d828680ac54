//! What all points are compared with: the finest run, or a results file.

use super::error::{compare, worst};
use super::grid::{Grid, MOST_STEPS, Subject, Variant, least_steps};
use super::history::History;
use super::runner::{Ended, StudyError, run_once};
use super::state::{RunRecord, StateFile};
use super::stress::StressGauges;
use crate::model::ClosureMethod;
use crate::scene::Accuracy;
use serde::Serialize;
use std::sync::atomic::AtomicBool;

/// How much tighter than the tightest point the reference is.
const TIGHTER: f64 = 100.0;
/// Tightest tolerance of a reference; below it, rounding decides.
const TIGHTEST: f64 = 1e-13;
/// Tolerance of the reference where no point has a tolerance.
const WITHOUT_TOLERANCES: f64 = 1e-12;
/// How much looser than the reference the run is that shows how far the reference itself can be trusted.
const LOOSER: f64 = 10.0;

/// How a results file comes to hold what it lacks.
#[cfg(feature = "hdf5")]
const WRITE_IT: &str =
    "write it by pliant run --out from this scene, with what is missing among its output.hinges, output.closures or output.stress";

/// What the errors are relative to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reference {
    /// The setting, or the file.
    pub what: String,
    /// Largest peak error of a run at ten times its tolerance: errors of points near it say nothing. None for a file.
    pub own_error: Option<f64>,
    /// Wall-clock time of the reference run (s).
    pub wall_s: Option<f64>,
}

/// Where the reference comes from.
#[derive(Debug)]
pub enum ReferenceSource {
    /// A run of the scene with all modes.
    Run(Candidates),
    /// A results file, read already, and the digest of its bytes.
    File {
        /// Path as given.
        path: String,
        /// SHA-256.
        digest: String,
        /// Its histories at the study's output times.
        history: Box<History>,
    },
}

/// Ways to run the reference; the first that completes is taken.
#[derive(Debug)]
pub struct Candidates {
    subjects: Vec<(String, Subject)>,
    tolerance: f64,
    /// What could not be as it should, in words.
    pub notes: Vec<String>,
}

/// A quotient as it is meant to be read: 1e-7, not 1.0000000000000001e-7.
fn twelve_digits(x: f64) -> f64 {
    format!("{x:.11e}").parse().unwrap_or(x)
}

impl Candidates {
    /// The ways for `grid`: all modes, exact inertia, a tolerance a hundred times tighter than that of any point.
    ///
    /// # Errors
    /// If the scene with all modes cannot be assembled, and no other can stand for it.
    pub fn of(grid: &Grid) -> Result<Self, StudyError> {
        let (base, mut notes) = (&grid.base, Vec::new());
        let tightest = grid.points.iter().filter_map(|p| p.tolerance).reduce(f64::min);
        let tolerance = tightest.map_or(WITHOUT_TOLERANCES, |t| twelve_digits(t / TIGHTER).max(TIGHTEST));
        let flexible = base.system.bodies.iter().any(|b| b.flexible().is_some());
        // as much as any point has
        let stiffens = grid.variants.iter().any(|(v, _)| v.geometric_stiffness == Some(true));
        let full = Variant {
            modes: flexible.then_some(usize::MAX),
            inertia_order: flexible.then_some(2),
            geometric_stiffness: stiffens.then_some(true),
            ..Variant::default()
        };
        let words = if flexible { ", all modes" } else { "" };
        let mut gauges = StressGauges::default();
        let assemble = |variant: &Variant| variant.assemble(&base.source, base.duration);
        let mut subject = |scene| Ok::<_, StudyError>(Subject { stress: gauges.of(&scene)?, scene });
        let mut subjects = Vec::new();
        match assemble(&full) {
            Ok(scene) => subjects.push((words.to_owned(), subject(scene)?)),
            Err(error) => {
                // a list in the scene, of damping ratios say, that holds for the scene's own modes only
                let most = grid.variants.iter().max_by_key(|(_, s)| s.scene.system.modal_count).map(|(v, _)| v.modes);
                let variant = Variant { modes: most.flatten(), ..full.clone() };
                subjects.push((", the most modes of any point".into(), subject(assemble(&variant)?)?));
                notes.push(format!("the reference retains no more modes than the points do, as all modes cannot be assembled: {error}"));
            }
        }
        let embedding = ClosureMethod::NAMES.iter().find(|n| n.starts_with("constraint")).copied();
        if let (false, Some(method)) = (base.system.closures.is_empty(), embedding) {
            let variant = Variant { closure_method: Some(method.to_owned()), ..full };
            if let Ok(scene) = assemble(&variant) {
                subjects.push((format!("{words}, {method}"), subject(scene)?));
            }
        }
        Ok(Self { subjects, tolerance, notes })
    }

    /// What decides the reference's numbers.
    fn identity(&self) -> String {
        let subjects: Vec<_> = self.subjects.iter().map(|(words, s)| format!("{words} {}", s.scene.system.modal_count)).collect();
        format!("run at {:e}: {}", self.tolerance, subjects.join("; "))
    }

    /// The first way that completes: what it was, its history, and how long it took.
    fn run(&self, interrupted: &AtomicBool) -> Result<(String, &Subject, &'static str, Ended), StudyError> {
        let mut failures = Vec::new();
        for (words, subject) in &self.subjects {
            let scene = &subject.scene;
            for integrator in ["dormand_prince", "rosenbrock_w"] {
                let accuracy = Accuracy::Tolerance(self.tolerance);
                let steps = least_steps(scene, integrator, accuracy, scene.duration.unwrap_or(0.0));
                if steps > MOST_STEPS {
                    failures.push(format!("{integrator}{words}: stability would ask for {steps:.1e} steps"));
                    continue;
                }
                let ended = run_once(subject, integrator, accuracy, interrupted)?;
                match &ended.failure {
                    None => return Ok((format!("{integrator} at {:e}{words}", self.tolerance), subject, integrator, ended)),
                    Some(failure) => failures.push(format!("{integrator}{words}: {failure}")),
                }
            }
        }
        Err(StudyError::Reference { failures: failures.join("; ") })
    }
}

impl ReferenceSource {
    /// What decides the reference's numbers, for the keys of the state file.
    #[must_use]
    pub fn identity(&self) -> String {
        match self {
            Self::Run(candidates) => candidates.identity(),
            Self::File { digest, .. } => format!("file {digest}"),
        }
    }

    /// What the state file knows of the reference already, if it suffices without its history.
    #[must_use]
    pub fn known(&self, key: &str, state: &StateFile) -> Option<Reference> {
        match self {
            Self::Run(_) => state.runs(key).first().map(reference_of),
            Self::File { path, .. } => Some(Reference { what: path.clone(), own_error: None, wall_s: None }),
        }
    }

    /// The reference and its history; a run that the state file does not know yet is kept there.
    ///
    /// # Errors
    /// If no way to run it completes, it is interrupted, or nothing happens in it.
    pub fn obtain(&self, key: &str, state: &mut StateFile, interrupted: &AtomicBool) -> Result<(Reference, History), StudyError> {
        let (reference, history) = match self {
            Self::File { path, history, .. } => (Reference { what: path.clone(), own_error: None, wall_s: None }, History::clone(history)),
            Self::Run(candidates) => {
                let (what, subject, integrator, ended) = candidates.run(interrupted)?;
                if let Some(record) = state.runs(key).first() {
                    (reference_of(record), ended.history)
                } else {
                    let looser = run_once(subject, integrator, Accuracy::Tolerance(LOOSER * candidates.tolerance), interrupted)?;
                    let errors = compare(&ended.history, &looser.history).unwrap_or_default();
                    let record = ended.record(key.to_owned(), what, errors);
                    let reference = reference_of(&record);
                    state.keep(record)?;
                    (reference, ended.history)
                }
            }
        };
        if super::error::scales(&history).iter().all(Option::is_none) {
            return Err(StudyError::Silent);
        }
        Ok((reference, history))
    }
}

fn reference_of(record: &RunRecord) -> Reference {
    Reference { what: record.what.clone(), own_error: worst(&record.errors).map(|e| e.peak), wall_s: Some(record.wall_s) }
}

/// The histories of a results file at the output times of the study `grid`.
///
/// # Errors
/// If the file cannot be read, or lacks a channel or an output time.
#[cfg(feature = "hdf5")]
pub fn read(path: &std::path::Path, grid: &Grid) -> Result<ReferenceSource, StudyError> {
    use super::error::same_time;
    use crate::io::results_file::{ResultsError, escape, read_series};
    use sha2::{Digest, Sha256};
    let fail = |message: String| StudyError::File { path: path.display().to_string(), message };
    let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
    let digest: String = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
    let (scene, mut history) = (&grid.base, grid.history());
    let mut wanted = vec![("time".to_owned(), None)];
    let path_of = |c: &super::history::Channel| format!("{}/{}/{}", c.group, escape(&c.owner), c.quantity);
    wanted.extend(history.channels.iter().map(|c| (path_of(c), (c.width > 1).then_some(c.width))));
    let mut series = read_series(path, &wanted).map_err(|e| match e {
        ResultsError::Read { cause } if cause.ends_with("is not in it") => fail(format!("{cause}; {WRITE_IT}")),
        other => fail(other.to_string()),
    })?;
    let stored = series.remove(0);
    let times = output_times(scene);
    let span = times.last().copied().unwrap_or(0.0);
    let mut rows = Vec::with_capacity(times.len());
    for &time in &times {
        let near = stored.partition_point(|t| *t < time && !same_time(*t, time, span));
        match stored.get(near) {
            Some(&t) if same_time(t, time, span) => rows.push(near),
            _ => {
                let message = format!(
                    "has no output time at {time} s, where the study has one; write it by pliant run --out with the scene's duration and with \
                     rate_hz = {} or a multiple",
                    scene.rate_hz
                );
                return Err(fail(message));
            }
        }
    }
    for ((values, channel), stored) in history.values.iter_mut().zip(&history.channels).zip(&series) {
        for &row in &rows {
            values.extend_from_slice(&stored[row * channel.width..(row + 1) * channel.width]);
        }
    }
    history.times = times;
    Ok(ReferenceSource::File { path: path.display().to_string(), digest, history: Box::new(history) })
}

/// Output times as the time loop takes them.
#[cfg(feature = "hdf5")]
fn output_times(scene: &crate::scene::Scene) -> Vec<f64> {
    let (start, rate) = (scene.state.time, scene.rate_hz);
    let end = start + scene.duration.unwrap_or(0.0);
    let multiples = (0_u64..).map(|k| start + k as f64 / rate).take_while(|t| *t < end - 1e-9 / rate);
    multiples.chain([end]).collect()
}
