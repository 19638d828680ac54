//! `pliant run`: simulate a scene and report.

use super::args::{RunArguments, Viewer};
use super::built_in;
use super::failure::{Failure, with_causes};
use super::report::number;
use super::run_report;
use crate::dynamics::{Workspace, forward_dynamics};
use crate::integrate::simulate::Method;
use crate::integrate::stability::fastest_mode;
use crate::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use crate::model::aggregate::{LARGE_LOOP, MANY_LOOPS};
use crate::model::{ClosureMethod, System};
use crate::output::{OutputPlan, OutputSet, RunReport};
use crate::scene::{Overrides, Scene, assemble};
use crate::study::verify::{Verification, VerifiedReport, tighter};
use crate::study::{History, Recorder};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write;
use std::path::Path;
#[cfg(feature = "rerun")]
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Simulates the scene and prints the closing report.
pub fn run(arguments: &RunArguments, output: &mut dyn Write) -> Result<(), Failure> {
    let mut overrides = Overrides::from(&arguments.overrides);
    if let Some(duration) = arguments.duration.filter(|d| !(*d > 0.0 && d.is_finite())) {
        return Err(Failure::input(format!("--duration {duration} must be a positive number of seconds")));
    }
    overrides.duration = arguments.duration;
    // the folder must live as long as the modal files in it are read
    let (scene, _example) = match &arguments.scene {
        Some(path) => (assemble::load(path, &overrides)?, None),
        None => {
            let example = built_in::Unpacked::new()?;
            (assemble::load(&example.scene(), &overrides)?, Some(example))
        }
    };
    let Some(duration) = scene.duration else {
        let message = "the scene has no [simulation] duration; add one (s) or give --duration".to_owned();
        return Err(Failure::input(format!("{}: {message}", scene.source.path.display())));
    };
    let viewer = arguments.viewer.unwrap_or(if arguments.rrd.is_some() || arguments.scene.is_none() { Viewer::Save } else { Viewer::None });
    if arguments.rrd.is_some() && viewer != Viewer::Save {
        return Err(Failure::input("--rrd goes with --viewer save only; leave one of them out"));
    }
    let settings = Settings { duration, method: scene.method, rate_hz: scene.rate_hz };
    check_output_count(&scene, duration)?;
    check_targets(arguments, &scene)?;
    let not_unique = not_unique(&scene)?;

    let plan = plan(&scene, viewer != Viewer::None)?;
    let plan_of_loads = loads_only(&plan);
    let mut outputs = OutputSet::new(&scene.system, plan).map_err(|e| Failure::input(with_causes(&e)))?;
    // a viewer that cannot be reached must not cost the results of an earlier run
    open_viewer(arguments, viewer, &scene, &mut outputs)?;
    open_results(arguments, &mut outputs)?;
    let left_out = left_out(arguments, viewer, &scene);
    announce(&scene, &settings, &left_out);
    if let Some(warning) = not_unique {
        let _ = writeln!(std::io::stderr(), "{warning}");
    }

    let mut progress = Progress::new(&settings);
    let started = Instant::now();
    let mut recorder = arguments.verify.then(|| Recorder::new(&scene, &[], None));
    let mut observers: Vec<&mut dyn Observer> = vec![&mut outputs, &mut progress];
    observers.extend(recorder.as_mut().map(|r| r as &mut dyn Observer));
    let summary = simulate(&scene.system, &scene.state, &settings, &mut observers);
    let wall = started.elapsed();
    progress.bar.finish_and_clear();
    let report = outputs.finish(&summary, scene.method.name(), wall, left_out);
    let verification = match recorder {
        Some(recorder) if summary.outcome == Outcome::Completed => {
            Some(verify(&scene, &settings, plan_of_loads, &report, &recorder.finish(), &mut progress)?)
        }
        _ => None,
    };

    if arguments.json {
        let whole = VerifiedReport { report: &report, verify: verification.as_ref() };
        let text = serde_json::to_string_pretty(&whole).map_err(|e| Failure::Output(e.into()))?;
        writeln!(output, "{text}")?;
    } else {
        run_report::write(&scene.name, &report, output)?;
        if let Some(verification) = &verification {
            run_report::write_verification(verification, output)?;
        }
    }
    output.flush()?;
    #[cfg(feature = "rerun")]
    if viewer == Viewer::Web && summary.outcome == Outcome::Completed {
        wait_for_interrupt(&progress.interrupted, arguments.port);
    }
    match &summary.outcome {
        Outcome::Failed(failure) => return Err(Failure::Stopped(format!("the run stopped early: {failure}; what was computed is kept"))),
        Outcome::Stopped => {
            return Err(Failure::Stopped(format!("interrupted at t = {} s; what was computed is kept", number(summary.time))));
        }
        Outcome::Completed => {}
    }
    if let Some(failure) = verification.and_then(|v| v.failure) {
        return Err(Failure::Stopped(format!("the run is complete, but its verification stopped early: {failure}")));
    }
    let problems: Vec<_> =
        report.files.iter().filter_map(|f| f.problem.as_ref().map(|p| format!("{} {}: {p}", f.kind, f.target))).collect();
    if problems.is_empty() { Ok(()) } else { Err(Failure::Stopped(problems.join("\nerror: "))) }
}

/// The loads of a plan without what its other outputs cost.
fn loads_only(plan: &OutputPlan) -> OutputPlan {
    OutputPlan { hinges: plan.loaded_hinges(), closures: plan.loaded_closures(), ..OutputPlan::default() }
}

/// Runs the scene again, tighter, and compares.
fn verify(
    scene: &Scene,
    settings: &Settings,
    plan: OutputPlan,
    report: &RunReport,
    history: &History,
    progress: &mut Progress,
) -> Result<Verification, Failure> {
    let settings = Settings { method: tighter(settings.method), ..*settings };
    let mut outputs = OutputSet::new(&scene.system, plan).map_err(|e| Failure::input(with_causes(&e)))?;
    let mut recorder = Recorder::new(scene, &[], None);
    progress.bar = bar(&settings);
    progress.verifying = true;
    let started = Instant::now();
    let summary = simulate(&scene.system, &scene.state, &settings, &mut [&mut outputs, &mut recorder, progress]);
    let wall = started.elapsed();
    progress.bar.finish_and_clear();
    let tight = outputs.finish(&summary, settings.method.name(), wall, Vec::new());
    Ok(Verification::of(&scene.system, settings.method, [report, &tight], [history, &recorder.finish()]))
}

/// Most output times of a run; each is held against the limits, written and drawn.
const MOST_OUTPUTS: f64 = 1e7;

fn check_output_count(scene: &Scene, duration: f64) -> Result<(), Failure> {
    let count = scene.rate_hz * duration;
    if count <= MOST_OUTPUTS {
        return Ok(());
    }
    Err(Failure::input(format!(
        "{}: output.rate_hz = {:e} for {duration} s makes {count:e} output times, more than {MOST_OUTPUTS:e}; lower rate_hz",
        scene.source.path.display(),
        scene.rate_hz
    )))
}

/// Refuses to write over the scene, its modal files, or one output over the other.
fn check_targets(arguments: &RunArguments, scene: &Scene) -> Result<(), Failure> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let inputs = std::iter::once(real(&scene.source.path));
    #[cfg(feature = "hdf5")]
    let inputs = inputs.chain(scene.flexible.iter().flat_map(|(_, selection)| selection.file.inputs().iter().map(|input| real(input))));
    let inputs: Vec<_> = inputs.collect();
    for (option, target) in [("--out", &arguments.out), ("--rrd", &arguments.rrd)] {
        if let Some(target) = target.as_ref().filter(|t| inputs.contains(&real(t))) {
            return Err(Failure::input(format!("{option} {} is an input of this run; write to another file", target.display())));
        }
    }
    let other = |path: &Path, endings: &[&str]| path.extension().is_some_and(|e| endings.iter().any(|x| e.eq_ignore_ascii_case(x)));
    if let Some(out) = arguments.out.as_ref().filter(|out| other(out, &["csv", "parquet", "rrd", "toml", "json", "xdmf", "txt"])) {
        let message = format!("--out {} writes HDF5; name a file that ends in .h5, and make tables of it by pliant export", out.display());
        return Err(Failure::input(message));
    }
    if let Some(rrd) = arguments.rrd.as_ref().filter(|rrd| other(rrd, &["h5", "hdf5", "csv", "parquet", "toml", "json"])) {
        return Err(Failure::input(format!("--rrd {} writes a recording; name a file that ends in .rrd", rrd.display())));
    }
    match (&arguments.out, &arguments.rrd) {
        (Some(out), Some(rrd)) if real(out) == real(rrd) => {
            Err(Failure::input(format!("--out and --rrd both name {}; give each its own file", out.display())))
        }
        _ => Ok(()),
    }
}

/// Evaluates the start, where a scene that has no answer is at fault, and says which closure loads are not unique.
fn not_unique(scene: &Scene) -> Result<Option<String>, Failure> {
    let mut workspace = Workspace::new(&scene.system);
    forward_dynamics(&scene.system, &scene.state, &mut workspace)
        .map_err(|e| Failure::input(format!("{}: at the start: {}", scene.source.path.display(), with_causes(&e))))?;
    Ok(workspace.redundancy_warning(&scene.system))
}

#[cfg(feature = "hdf5")]
fn plan(scene: &Scene, picture: bool) -> Result<OutputPlan, Failure> {
    Ok(crate::output::scene_plan::plan(scene, picture)?)
}

#[cfg(not(feature = "hdf5"))]
fn plan(scene: &Scene, _picture: bool) -> Result<OutputPlan, Failure> {
    Ok(OutputPlan {
        scene_name: scene.name.clone(),
        scene_text: scene.source.text.clone(),
        hinges: scene.hinges.clone(),
        closures: scene.closures.clone(),
        monitors: scene.monitors.clone(),
        deformation_scale: scene.deformation_scale,
        audit: scene.audit,
        warnings: scene.warnings.clone(),
        ..OutputPlan::default()
    })
}

#[cfg(feature = "hdf5")]
fn open_results(arguments: &RunArguments, outputs: &mut OutputSet<'_>) -> Result<(), Failure> {
    match &arguments.out {
        Some(path) => outputs.write_results(path).map_err(|e| Failure::input(with_causes(&e))),
        None => Ok(()),
    }
}

#[cfg(not(feature = "hdf5"))]
fn open_results(arguments: &RunArguments, _outputs: &mut OutputSet<'_>) -> Result<(), Failure> {
    match &arguments.out {
        Some(_) => Err(Failure::input("--out: this build writes no results files; build with the feature \"hdf5\"")),
        None => Ok(()),
    }
}

/// Recording of a scene that names none.
#[cfg(feature = "rerun")]
fn default_recording(arguments: &RunArguments) -> PathBuf {
    let stem = |path: &PathBuf| path.file_stem().map(|s| s.to_string_lossy().into_owned());
    let named = arguments.scene.as_ref().and_then(|path| match stem(path) {
        // examples/NAME/scene.toml says more by its folder
        Some(name) if name == "scene" => path.parent().and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned()).or(Some(name)),
        other => other,
    });
    PathBuf::from(format!("{}.rrd", named.unwrap_or_else(|| "hub_two_panels".into())))
}

#[cfg(feature = "rerun")]
fn open_viewer(arguments: &RunArguments, viewer: Viewer, scene: &Scene, outputs: &mut OutputSet<'_>) -> Result<(), Failure> {
    use crate::output::ViewerTarget;
    let target = match viewer {
        Viewer::None => return Ok(()),
        Viewer::Save => ViewerTarget::Save(arguments.rrd.clone().unwrap_or_else(|| default_recording(arguments))),
        Viewer::Spawn => ViewerTarget::Spawn { executable: None },
        Viewer::Connect => ViewerTarget::Connect { url: arguments.url.clone() },
        Viewer::Web => ViewerTarget::Web { port: arguments.port, grpc_port: arguments.port.wrapping_add(1) },
    };
    outputs.open_viewer(&target, &scene.state).map_err(|e| Failure::input(with_causes(&e)))
}

#[cfg(not(feature = "rerun"))]
fn open_viewer(arguments: &RunArguments, viewer: Viewer, _scene: &Scene, _outputs: &mut OutputSet<'_>) -> Result<(), Failure> {
    // the example runs without a picture where there is none to be had
    match arguments.viewer.or(arguments.rrd.as_ref().map(|_| viewer)) {
        None | Some(Viewer::None) => Ok(()),
        Some(_) => Err(Failure::input("--viewer: this build has no viewer stream; build with the feature \"rerun\"")),
    }
}

fn left_out(arguments: &RunArguments, viewer: Viewer, scene: &Scene) -> Vec<String> {
    let mut left_out = scene.left_out.clone();
    if viewer == Viewer::None {
        left_out.push("viewer".into());
    }
    if arguments.out.is_none() {
        left_out.push("results file".into());
    }
    left_out
}

/// What is about to run, on standard error.
fn announce(scene: &Scene, settings: &Settings, left_out: &[String]) {
    let system = &scene.system;
    let how = match settings.method {
        Method::RungeKutta4 { step } => format!("fixed step {} s", number(step)),
        Method::DormandPrince { tolerance, .. } | Method::RosenbrockW { tolerance, .. } => {
            format!("relative tolerance {:e}", tolerance.relative)
        }
    };
    let mut lines = vec![format!(
        "{}: {} bodies, {} hinge rates, {} modes; {} s with {}, {how}",
        scene.name,
        system.bodies.len(),
        system.velocity_count,
        system.modal_count,
        number(settings.duration),
        settings.method.name(),
    )];
    if let Some(mode) = fastest_mode(system) {
        let stable = settings.method.stable_step(mode.frequency_hz, mode.damping_ratio);
        let limit = if stable.is_finite() { format!("stable step {} s", number(stable)) } else { "stable at any step".to_owned() };
        lines.push(format!("fastest retained mode: {} of \"{}\" at {} Hz; {limit}", mode.mode, mode.body, number(mode.frequency_hz)));
        if let Method::RungeKutta4 { step } = settings.method
            && step > stable
        {
            lines.push(format!("warning: the step of {} s is larger than that; the run will leave finite numbers", number(step)));
        }
    }
    if let Some(reason) = &scene.method_reason {
        lines.push(format!("integrator chosen: {reason}"));
    }
    lines.extend(closure_methods(system));
    lines.push(format!("left out: {}", left_out.join(", ")));
    let mut sink = std::io::stderr().lock();
    for line in lines {
        // nothing is lost if standard error is closed
        let _ = writeln!(sink, "{line}");
    }
}

/// How closures are held, and why where that was left to the program; nothing without closures.
fn closure_methods(system: &System) -> Option<String> {
    let embedded = system.closures.iter().filter(|c| c.method == ClosureMethod::ConstraintEmbedding).count();
    let (count, aggregates) = (system.closures.len(), system.aggregates.len());
    let how = match (count - embedded, embedded) {
        (0, 0) => return None,
        (_, 0) => format!("{count} by tree_augmented"),
        (0, _) => format!("{count} by constraint_embedding, in {aggregates} aggregate bodies"),
        (cut, _) => format!("{cut} by tree_augmented, {embedded} by constraint_embedding in {aggregates} aggregate bodies"),
    };
    let why = format!(" (auto: loops are embedded from {MANY_LOOPS} independent ones of up to {LARGE_LOOP} coordinates on)");
    Some(format!("closures: {how}{}", if system.closures.iter().any(|c| c.chosen) { &why } else { "" }))
}

/// Progress bar and Ctrl-C.
struct Progress {
    bar: ProgressBar,
    verifying: bool,
    interrupted: Arc<AtomicBool>,
}

/// Ticks of the bar per simulated second.
const TICKS: f64 = 1000.0;

impl Progress {
    fn new(settings: &Settings) -> Self {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        // without a handler Ctrl-C ends the process at once, which loses only what is not yet on disk
        let _ = ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed));
        Self { bar: bar(settings), verifying: false, interrupted }
    }

    /// What Ctrl-C asks of the loop.
    fn asked(&self) -> Flow {
        if self.interrupted.load(Ordering::Relaxed) { Flow::Stop } else { Flow::Continue }
    }
}

fn bar(settings: &Settings) -> ProgressBar {
    let bar = ProgressBar::new((settings.duration * TICKS) as u64);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent} %  {msg}  eta {eta}") {
        bar.set_style(style);
    }
    bar
}

impl Observer for Progress {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        self.bar.set_position((sample.state.time * TICKS) as u64);
        if sample.steps.is_multiple_of(64) {
            let what = if self.verifying { "verification: " } else { "" };
            self.bar.set_message(format!("{what}t = {} s, {} steps", number(sample.state.time), sample.steps));
        }
        self.asked()
    }

    fn step(&mut self, _step: &Sample<'_>) -> Flow {
        self.asked()
    }
}

/// Keeps the page served until Ctrl-C.
#[cfg(feature = "rerun")]
fn wait_for_interrupt(interrupted: &AtomicBool, port: u16) {
    let _ = writeln!(std::io::stderr(), "the page at http://127.0.0.1:{port} stays until Ctrl-C");
    while !interrupted.load(Ordering::Relaxed) {
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
}
