//! Runs everything in rounds: each round runs every point once, in a shuffled order, so that the noise of the machine meets all alike.

use super::error::{Gap, compare};
use super::grid::{Grid, Subject};
use super::history::{History, Recorder};
use super::reference::{Reference, ReferenceSource};
use super::state::{RunRecord, StateError, StateFile};
use super::stress::StressError;
use crate::integrate::{Outcome, Settings, Summary, simulate};
use crate::scene::{Accuracy, Scene, SceneError};
use sha2::{Digest, Sha256};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Why a study has no result.
#[derive(Debug, Error)]
pub enum StudyError {
    /// No way to run the reference completes.
    #[error("no reference run completes ({failures}); give one by --reference FILE.h5, or a shorter --duration")]
    Reference {
        /// One reason for each way.
        failures: String,
    },
    /// Nothing happens in the reference.
    #[error(
        "every load and stress that is compared is zero, so that no error is relative to anything; output other hinges, or give a longer --duration"
    )]
    Silent,
    /// A results file that cannot be the reference.
    #[error("--reference {path}: {message}")]
    File {
        /// The file.
        path: String,
        /// What is wrong.
        message: String,
    },
    /// Ctrl-C before there was anything to compare with.
    #[error("interrupted in the reference run")]
    Interrupted,
    /// A scene that cannot be assembled.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Stress that cannot be compared.
    #[error(transparent)]
    Stress(#[from] StressError),
    /// The state file.
    #[error(transparent)]
    State(#[from] StateError),
}

/// Someone who wants to know what is going on.
pub trait Watch {
    /// A run begins; `done` of `total` runs are behind it.
    fn begin(&mut self, what: &str, done: usize, total: usize);
}

/// One run that has ended.
#[derive(Debug)]
pub struct Ended {
    /// What it recorded.
    pub history: History,
    /// Wall-clock time.
    pub wall: Duration,
    /// What it did.
    pub summary: Summary,
    /// Why it ended early.
    pub failure: Option<String>,
}

impl Ended {
    /// As a line of the state file.
    #[must_use]
    pub fn record(&self, key: String, what: String, errors: Vec<Option<super::error::ChannelError>>) -> RunRecord {
        let Summary { steps, rejected, evaluations, .. } = self.summary;
        let (wall_s, failure) = (self.wall.as_secs_f64(), self.failure.clone());
        RunRecord { key, what, wall_s, steps, rejected_steps: rejected, evaluations, errors, failure }
    }
}

/// Runs a scene once and times it, the recording of loads at the output times included, the evaluation of stress not.
///
/// # Errors
/// [`StudyError::Interrupted`] if it was.
pub fn run_once(subject: &Subject, integrator: &str, accuracy: Accuracy, interrupted: &AtomicBool) -> Result<Ended, StudyError> {
    let Subject { scene, stress } = subject;
    let method = scene.method_at(integrator, accuracy).unwrap_or(scene.method);
    let settings = Settings { duration: scene.duration.unwrap_or(0.0), method, rate_hz: scene.rate_hz };
    let mut recorder = Recorder::new(scene, stress, Some(interrupted));
    let started = Instant::now();
    let summary = simulate(&scene.system, &scene.state, &settings, &mut [&mut recorder]);
    let wall = started.elapsed();
    let failure = match &summary.outcome {
        Outcome::Completed => None,
        Outcome::Stopped => return Err(StudyError::Interrupted),
        Outcome::Failed(failure) => Some(failure.to_string()),
    };
    Ok(Ended { history: recorder.finish(), wall, summary, failure })
}

/// What a study has found, finished or not.
#[derive(Debug)]
pub struct Finished {
    /// What the errors are relative to.
    pub reference: Reference,
    /// Runs of each point.
    pub runs: Vec<Vec<RunRecord>>,
    /// Runs that the state file had already.
    pub resumed: usize,
    /// Runs that are there and that there should be.
    pub progress: (usize, usize),
    /// True if Ctrl-C ended it.
    pub interrupted: bool,
}

/// Runs `grid` in `repeat` rounds; a point that failed is not repeated.
///
/// # Errors
/// If there is nothing to compare with, or a finished run cannot be kept.
pub fn run(
    grid: &Grid,
    source: &ReferenceSource,
    repeat: usize,
    state: &mut StateFile,
    interrupted: &AtomicBool,
    watch: &mut dyn Watch,
) -> Result<Finished, StudyError> {
    let channels: Vec<String> = grid.history().channels.iter().map(super::history::Channel::name).collect();
    let identity = format!("{}\n{}\n{channels:?}", scene_identity(&grid.base), source.identity());
    let key_of = |what: &str| {
        let digest = Sha256::digest(format!("{identity}\n{what}"));
        digest.iter().map(|b| format!("{b:02x}")).collect::<String>()
    };
    let keys: Vec<String> = grid.points.iter().map(|p| key_of(&p.identity())).collect();
    let reference_key = key_of("reference");
    let mut runs: Vec<Vec<RunRecord>> = keys.iter().map(|k| state.runs(k).iter().take(repeat).cloned().collect()).collect();
    let done = |runs: &[RunRecord], round: usize| runs.len() > round || runs.iter().any(|r| r.failure.is_some());
    let missing = |runs: &[RunRecord]| if done(runs, repeat - 1) { 0 } else { repeat - runs.len() };
    let resumed = runs.iter().map(Vec::len).sum();
    let total = |runs: &[Vec<RunRecord>]| runs.iter().map(|r| r.len() + missing(r)).sum::<usize>();
    let finished = |reference, runs: Vec<Vec<RunRecord>>, interrupted| {
        let progress = (runs.iter().map(Vec::len).sum(), total(&runs));
        Finished { reference, runs, resumed, progress, interrupted }
    };

    let known = source.known(&reference_key, state);
    if let (Some(reference), true) = (known, runs.iter().all(|r| missing(r) == 0)) {
        return Ok(finished(reference, runs, false));
    }
    watch.begin("reference", resumed, total(&runs));
    let (reference, expected) = source.obtain(&reference_key, state, interrupted)?;
    for round in 0..repeat {
        for index in shuffled(grid.points.len(), round as u64) {
            if done(&runs[index], round) {
                continue;
            }
            let point = &grid.points[index];
            watch.begin(&point.words(), runs.iter().map(Vec::len).sum(), total(&runs));
            let mut ended = match run_once(&grid.variants[point.scene].1, &point.integrator, point.accuracy(), interrupted) {
                Err(StudyError::Interrupted) => return Ok(finished(reference, runs, true)),
                other => other?,
            };
            let errors = errors_of(&expected, &mut ended);
            let record = ended.record(keys[index].clone(), point.words(), errors);
            state.keep(record.clone())?;
            runs[index].push(record);
            if interrupted.load(Ordering::Relaxed) {
                let left = runs.iter().any(|r| missing(r) > 0);
                return Ok(finished(reference, runs, left));
            }
        }
    }
    Ok(finished(reference, runs, false))
}

/// Errors of a run; one that cannot be compared is a failure.
fn errors_of(expected: &History, ended: &mut Ended) -> Vec<Option<super::error::ChannelError>> {
    if ended.failure.is_some() {
        return Vec::new();
    }
    compare(expected, &ended.history).unwrap_or_else(|gap: Gap| {
        ended.failure = Some(gap.to_string());
        Vec::new()
    })
}

/// All of a scene that decides what its runs compute: text, modal files, what tables in other files hold, duration, output times.
fn scene_identity(scene: &Scene) -> String {
    #[cfg(feature = "hdf5")]
    let modal: Vec<&str> = scene.flexible.iter().map(|(_, selection)| selection.content_sha256.as_str()).collect();
    #[cfg(not(feature = "hdf5"))]
    let modal: Vec<&str> = Vec::new();
    let hinges: Vec<_> = scene.system.bodies.iter().map(|b| format!("{:?}", b.hinge)).collect();
    let (version, text, loads) = (env!("CARGO_PKG_VERSION"), &scene.source.text, &scene.system.loads);
    format!("{version}\n{text}\n{modal:?}\n{loads:?}\n{hinges:?}\n{:?} {}", scene.duration, scene.rate_hz)
}

/// The numbers below `count` in an order that the seed decides.
fn shuffled(count: usize, seed: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    // splitmix64, Steele, Lea and Flood 2014
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    for i in (1..count).rev() {
        order.swap(i, (next() % (i as u64 + 1)) as usize);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_run_every_point_once_in_different_orders() {
        let (a, b) = (shuffled(20, 0), shuffled(20, 1));
        assert_ne!(a, b);
        assert_eq!(a, shuffled(20, 0));
        for mut order in [a, b] {
            order.sort_unstable();
            assert_eq!(order, (0..20).collect::<Vec<_>>());
        }
    }
}
