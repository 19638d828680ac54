//! Runs cases on all cores and keeps each as it ends.
//!
//! Threads take the next case from a counter. A case is a function of the scene and of its values alone, so that its numbers are the same
//! on any thread, in any order and in any shard. Modal files are read and reduced once and shared.

use super::error::CampaignError;
use super::identity::identity;
use super::plan::Plan;
use super::record::{CaseRecord, Header, LoadRecord, ModalFileEntry, ParameterRecord, Shard, VERSION};
use super::records::Records;
use crate::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use crate::output::channels::{CLOSURE_POINT, closure_frame, closure_side, load_frame, load_side};
use crate::output::extremes::{Extremes, ExtremesTracker, LoadPlace};
use crate::scene::closures::gear_unit;
use crate::scene::error::Source;
use crate::scene::modal_files::ModalFiles;
use crate::scene::{Overrides, Scene, SceneError, assemble};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use toml::{Table, Value};

/// Someone who wants to know what is going on.
pub trait Watch {
    /// A case has ended; `done` of `total` are behind it.
    fn ended(&mut self, record: &CaseRecord, done: usize, total: usize);
}

/// A scene, a plan, and what all cases share.
#[derive(Debug)]
pub struct Campaign {
    source: Source,
    document: Table,
    overrides: Overrides,
    plan: Plan,
    /// What every case must have in the same place.
    loads: Vec<LoadRecord>,
    header: Header,
    inputs: Vec<std::path::PathBuf>,
    remarks: Vec<String>,
    files: Mutex<ModalFiles>,
}

/// Why a case has no loads.
type Fault = String;

impl Campaign {
    /// The campaign of `plan` over the scene at `path`, which must hold without any parameter as well.
    ///
    /// # Errors
    /// If the scene or the plan cannot be, or a key of the plan is none of the scene.
    pub fn new(path: &Path, overrides: Overrides, plan: Plan) -> Result<Self, CampaignError> {
        let text = std::fs::read_to_string(path).map_err(|e| SceneError::unreadable(path, "scene", &e))?;
        let source = Source { path: path.to_owned(), text };
        let base = assemble::assemble(source.clone(), &overrides)?;
        let unfit = |message: &str| CampaignError::Unfit { path: path.to_owned(), message: message.to_owned() };
        if base.duration.is_none() {
            return Err(unfit("the scene has no [simulation] duration; add one (s) or give --duration"));
        }
        if base.hinges.is_empty() && base.closures.is_empty() {
            return Err(unfit("a campaign follows loads, and output.hinges and output.closures name none; name some or drop the keys"));
        }
        let document: Table = source.text.parse().map_err(|_| unfit("the text is not TOML"))?;
        plan.check(&document)?;
        let loads = loads_of(&base);
        let modal_files = base.flexible.iter().map(|(body, selection)| ModalFileEntry {
            body: base.system.bodies[*body].name.clone(),
            content_sha256: selection.content_sha256.clone(),
        });
        let parameters = plan.parameters.iter().map(|p| ParameterRecord { name: p.name.clone(), keys: p.stream(), scale: p.scale });
        let header = Header {
            pliant_campaign: VERSION.into(),
            identity: identity(&base, &document, &plan, &format!("{overrides:?}")),
            shard: Shard::WHOLE,
            cases: plan.cases(),
            scene_name: base.name.clone(),
            scene: source.text.clone(),
            plan: plan.source.text.clone(),
            seed: plan.seed,
            modal_files: modal_files.collect(),
            parameters: parameters.collect(),
            loads: loads.clone(),
        };
        let remarks = remarks(&base);
        let mut inputs = vec![path.to_owned()];
        inputs.extend(plan.inputs.iter().cloned());
        inputs.extend(base.flexible.iter().flat_map(|(_, selection)| selection.file.inputs().iter().cloned()));
        Ok(Self { source, document, overrides, plan, loads, header, inputs, remarks, files: Mutex::new(base.modal_files()) })
    }

    /// The heading of the records of a shard.
    #[must_use]
    pub fn header(&self, shard: Shard) -> Header {
        Header { shard, ..self.header.clone() }
    }

    /// Files that are read, which no output may overwrite.
    #[must_use]
    pub fn inputs(&self) -> &[std::path::PathBuf] {
        &self.inputs
    }

    /// What a user should know before it runs: of the scene as it stands, and what a campaign leaves out of it.
    #[must_use]
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// The scene's text with the values of a case, counted from 0.
    ///
    /// # Errors
    /// If a value cannot be put into the scene.
    pub fn document(&self, case: usize) -> Result<Table, String> {
        self.plan.apply(&self.document, &self.plan.values(case)).map_err(|e| e.to_string())
    }

    /// The loads of the case counted from 0; none if it was interrupted.
    pub fn run_case(&self, case: usize, interrupted: &AtomicBool) -> Option<CaseRecord> {
        let started = Instant::now();
        let values = self.plan.values(case);
        let mut record = CaseRecord {
            case: case + 1,
            values: values.iter().map(as_json).collect(),
            failure: None,
            end_time_s: 0.0,
            steps: 0,
            wall_s: 0.0,
            loads: Vec::new(),
        };
        // a fault of the program in one case must not cost the others
        let ran = catch_unwind(AssertUnwindSafe(|| self.simulate(&values, &mut record, interrupted)));
        match ran.unwrap_or_else(|_| Err("the program failed within this case; please report the scene and the values".into())) {
            Ok(None) => return None,
            Ok(Some(loads)) => record.loads = loads,
            Err(fault) => record.failure = Some(self.without_folder(&fault)),
        }
        record.wall_s = started.elapsed().as_secs_f64();
        Some(record)
    }

    fn simulate(&self, values: &[Value], record: &mut CaseRecord, interrupted: &AtomicBool) -> Result<Option<Vec<Extremes>>, Fault> {
        let scene = self.assemble(values)?;
        if loads_of(&scene) != self.loads {
            return Err("the values change which loads there are; all cases of a campaign must have the same hinges and closures".into());
        }
        let duration = scene.duration.ok_or("the scene has no duration")?;
        let settings = Settings { duration, method: scene.method, rate_hz: scene.rate_hz };
        let places = LoadPlace::of(&scene);
        let widths: Vec<usize> = places.iter().map(|p| p.width()).collect();
        let mut tracker = ExtremesTracker::new(&scene.system, places);
        let summary = simulate(&scene.system, &scene.state, &settings, &mut [&mut tracker, &mut Stop(interrupted)]);
        (record.end_time_s, record.steps) = (summary.time, summary.steps);
        match summary.outcome {
            Outcome::Completed => {}
            Outcome::Stopped => return Ok(None),
            Outcome::Failed(failure) => return Err(failure.to_string()),
        }
        let loads = tracker.finish().filter(|loads| loads.iter().zip(&widths).all(|(e, &width)| e.is_whole(width)));
        loads.map(Some).ok_or_else(|| "a load left finite numbers".into())
    }

    /// A message without the folder of the scene: results shall not depend on where they were computed.
    fn without_folder(&self, message: &str) -> String {
        match self.source.path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => message.replace(&folder.join("").display().to_string(), ""),
            _ => message.to_owned(),
        }
    }

    fn assemble(&self, values: &[Value]) -> Result<Scene, Fault> {
        let document = self.plan.apply(&self.document, values).map_err(|e| e.to_string())?;
        let known = lock(&self.files).clone();
        let scene = assemble::assemble_document(self.source.clone(), document, &self.overrides, known).map_err(|e| with_causes(&e))?;
        lock(&self.files).absorb(scene.modal_files());
        Ok(scene)
    }

    /// Runs the cases of a shard that `records` lacks, on `threads` threads, until all are there or `interrupted` is true.
    ///
    /// # Errors
    /// If a finished case cannot be kept.
    pub fn run(&self, records: &mut Records, threads: usize, interrupted: &AtomicBool, watch: &mut dyn Watch) -> Result<(), CampaignError> {
        let missing = records.missing();
        let total = records.header.shard.cases(records.header.cases).count();
        let next = AtomicUsize::new(0);
        // a disk that is full, say
        let stop = AtomicBool::new(false);
        let (sender, receiver) = crossbeam_channel::bounded::<CaseRecord>(2 * threads);
        std::thread::scope(|scope| {
            for _ in 0..threads.min(missing.len()) {
                let sender = sender.clone();
                let (missing, next, stop) = (&missing, &next, &stop);
                scope.spawn(move || {
                    while let Some(&case) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if stop.load(Ordering::Relaxed) || interrupted.load(Ordering::Relaxed) {
                            return;
                        }
                        let Some(record) = self.run_case(case, interrupted) else { return };
                        if sender.send(record).is_err() {
                            return;
                        }
                    }
                });
            }
            drop(sender);
            let mut result = Ok(());
            for record in &receiver {
                // after a failure the rest is taken in, so that no thread waits for ever
                if result.is_ok() {
                    result = records.keep(&record);
                    stop.store(result.is_err(), Ordering::Relaxed);
                    watch.ended(&record, records.len(), total);
                }
            }
            result
        })
    }
}

fn lock(files: &Mutex<ModalFiles>) -> MutexGuard<'_, ModalFiles> {
    // what is in it holds whatever happened to another thread
    files.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends a run when it is told to.
struct Stop<'a>(&'a AtomicBool);

impl Stop<'_> {
    fn asked(&self) -> Flow {
        if self.0.load(Ordering::Relaxed) { Flow::Stop } else { Flow::Continue }
    }
}

impl Observer for Stop<'_> {
    fn observe(&mut self, _sample: &Sample<'_>) -> Flow {
        self.asked()
    }

    fn step(&mut self, _step: &Sample<'_>) -> Flow {
        self.asked()
    }
}

fn with_causes(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

fn as_json(value: &Value) -> serde_json::Value {
    serde_json::to_value(value).unwrap_or_default()
}

/// What is to be said of the scene as it stands, and of what a campaign leaves out of it.
fn remarks(scene: &Scene) -> Vec<String> {
    let mut remarks = scene.warnings.clone();
    let partial = scene.flexible.iter().filter(|(_, selection)| !selection.basis.is_complete());
    let partial: Vec<_> = partial.map(|(body, _)| format!("\"{}\"", scene.system.bodies[*body].name)).collect();
    if !partial.is_empty() {
        let bodies = partial.join(", ");
        remarks
            .push(format!("modes of {bodies} are left out; a campaign does not estimate what they change, pliant run on the scene does"));
    }
    if !scene.monitors.is_empty() {
        remarks.push("the limits of [[monitor]] are not watched; hold the envelope against them".into());
    }
    remarks
}

/// The loads of a scene in words.
fn loads_of(scene: &Scene) -> Vec<LoadRecord> {
    let system = &scene.system;
    let six = || ["moment_x", "moment_y", "moment_z", "force_x", "force_y", "force_z"].map(str::to_owned).to_vec();
    let units = || ["N m", "N m", "N m", "N", "N", "N"].map(str::to_owned).to_vec();
    let hinge = |&body: &usize| {
        let body = &system.bodies[body];
        LoadRecord {
            group: "hinges".into(),
            owner: body.hinge.name.clone(),
            components: six(),
            units: units(),
            frame: Some(load_frame(body)),
            point: Some("O".into()),
            side: load_side(system, body),
        }
    };
    let closure = |&index: &usize| {
        let closure = &system.closures[index];
        let (components, units, point) = match gear_unit(system, closure) {
            Some(unit) => (vec!["coordinate_force".to_owned()], vec![unit.to_owned()], None),
            None => (six(), units(), Some(CLOSURE_POINT.into())),
        };
        let (frame, side) = (closure_frame(system, closure), closure_side(system, closure));
        LoadRecord { group: "closures".into(), owner: closure.name.clone(), components, units, frame, point, side }
    };
    scene.hinges.iter().map(hinge).chain(scene.closures.iter().map(closure)).collect()
}
