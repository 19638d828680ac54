//! `pliant study`: error against run time over many settings of one scene.

use super::args::StudyArguments;
use super::failure::{Failure, with_causes};
use super::report::{Align, Table};
use crate::scene::SceneError;
use crate::scene::error::Source;
use crate::study::grid::{RequestError, Variant};
use crate::study::reference::{Candidates, ReferenceSource};
use crate::study::report::PointReport;
use crate::study::{ChannelError, Grid, Request, StateError, StateFile, StudyError, StudyReport, Watch, plot, runner};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most output times times numbers of a history that is kept.
const MOST_NUMBERS: f64 = 5e7;

/// Most settings whose channels are shown one by one.
const MOST_FRONT: usize = 6;

/// Runs the study and reports.
pub fn run(arguments: &StudyArguments, output: &mut dyn Write) -> Result<(), Failure> {
    check(arguments)?;
    let path = &arguments.scene;
    let text = std::fs::read_to_string(path).map_err(|e| SceneError::unreadable(path, "scene", &e))?;
    let source = Source { path: path.clone(), text };
    let request = Request {
        integrators: arguments.integrators.clone(),
        tolerances: arguments.tolerances.clone(),
        steps: arguments.steps.clone(),
        modes: arguments.modes.clone(),
        residual_modes: arguments.residual_modes.clone(),
        geometric_stiffness: arguments.geometric_stiffness.clone(),
        orders: arguments.orders.clone(),
        closure_methods: arguments.closure_method.clone(),
        duration: arguments.duration,
    };
    let grid = Grid::new(&source, &request)?;
    check_size(&grid)?;
    check_targets(arguments, &grid)?;
    let reference = reference(arguments, &grid)?;
    let mut state = match &arguments.state {
        Some(path) => StateFile::open(path).map_err(|e| Failure::input(with_causes(&e)))?,
        None => StateFile::default(),
    };
    let mut notes = grid.notes.clone();
    if let ReferenceSource::Run(candidates) = &reference {
        notes.extend(candidates.notes.iter().cloned());
    }

    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    // without a handler Ctrl-C ends the process at once, which loses the run that is going on
    let _ = ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed));
    let mut progress = Progress(ProgressBar::new(0));
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len}  {msg}  eta {eta}") {
        progress.0.set_style(style);
    }
    let finished = runner::run(&grid, &reference, arguments.repeat, &mut state, &interrupted, &mut progress);
    progress.0.finish_and_clear();
    let kept = |done: usize, total: usize| {
        let how = match state.path() {
            Some(path) => format!("they are in {}, and the same command goes on from there", path.display()),
            None => "give --state FILE to keep them for another time".to_owned(),
        };
        Failure::Stopped(format!("interrupted with {done} of {total} runs finished; {how}"))
    };
    let finished = match finished {
        Err(StudyError::Interrupted) => {
            let message = "interrupted in the reference run; what the state file holds is kept, and there is nothing else yet";
            return Err(Failure::Stopped(message.into()));
        }
        other => other?,
    };
    if finished.resumed > 0 {
        notes.push(format!("{} of {} runs are from the state file", finished.resumed, finished.progress.1));
    }
    let report = StudyReport::new(&grid, &finished, arguments.repeat, arguments.error, notes);
    if arguments.json {
        let text = serde_json::to_string_pretty(&report).map_err(|e| Failure::Output(e.into()))?;
        writeln!(output, "{text}")?;
    } else {
        write_tables(&report, output)?;
    }
    output.flush()?;
    write_files(arguments, &report)?;
    if finished.interrupted {
        return Err(kept(finished.progress.0, finished.progress.1));
    }
    Ok(())
}

fn check(arguments: &StudyArguments) -> Result<(), Failure> {
    if let Some(duration) = arguments.duration.filter(|d| !(*d > 0.0 && d.is_finite())) {
        return Err(Failure::input(format!("--duration {duration} must be a positive number of seconds")));
    }
    if arguments.repeat == 0 {
        return Err(Failure::input("--repeat 0 runs nothing; give 1 or more"));
    }
    Ok(())
}

/// Refuses a study whose histories fill the memory.
fn check_size(grid: &Grid) -> Result<(), Failure> {
    let base = &grid.base;
    let numbers = base.rate_hz * base.duration.unwrap_or(0.0) * grid.width() as f64;
    if numbers <= MOST_NUMBERS {
        return Ok(());
    }
    Err(Failure::input(format!(
        "{}: what is compared at all output times is {numbers:e} numbers, more than {MOST_NUMBERS:e}; lower output.rate_hz, name fewer \
         output.hinges or give a shorter --duration",
        base.source.path.display()
    )))
}

/// Refuses to write over an input, or one output over the other.
fn check_targets(arguments: &StudyArguments, grid: &Grid) -> Result<(), Failure> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut taken: Vec<PathBuf> = vec![real(&grid.base.source.path)];
    taken.extend(arguments.reference.as_deref().map(real));
    #[cfg(feature = "hdf5")]
    taken.extend(grid.base.flexible.iter().flat_map(|(_, selection)| selection.file.inputs().iter().map(|input| real(input))));
    for (option, target) in [("--state", &arguments.state), ("--csv", &arguments.csv), ("--svg", &arguments.svg)] {
        let Some(target) = target else { continue };
        let path = real(target);
        if taken.contains(&path) {
            let message = format!("{option} {} is an input or another output of this study; write to another file", target.display());
            return Err(Failure::input(message));
        }
        taken.push(path);
    }
    // a target that cannot be written must not cost the runs
    for (option, target) in [("--csv", &arguments.csv), ("--svg", &arguments.svg)] {
        if let Some(path) = target {
            let opened = std::fs::OpenOptions::new().append(true).create(true).open(path);
            opened.map_err(|e| Failure::input(format!("{option} {}: {e}; name a file that may be written", path.display())))?;
        }
    }
    Ok(())
}

#[cfg(feature = "hdf5")]
fn reference(arguments: &StudyArguments, grid: &Grid) -> Result<ReferenceSource, Failure> {
    match &arguments.reference {
        Some(path) => Ok(crate::study::reference::read(path, grid)?),
        None => Ok(ReferenceSource::Run(Candidates::of(grid)?)),
    }
}

#[cfg(not(feature = "hdf5"))]
fn reference(arguments: &StudyArguments, grid: &Grid) -> Result<ReferenceSource, Failure> {
    match &arguments.reference {
        Some(_) => Err(Failure::input("--reference: this build reads no results files; build with the feature \"hdf5\"")),
        None => Ok(ReferenceSource::Run(Candidates::of(grid)?)),
    }
}

fn write_files(arguments: &StudyArguments, report: &StudyReport) -> Result<(), Failure> {
    let fail = |option: &str, path: &Path, e: &dyn std::fmt::Display| Failure::input(format!("{option} {}: {e}", path.display()));
    if let Some(path) = &arguments.csv {
        let mut file = std::fs::File::create(path).map_err(|e| fail("--csv", path, &e))?;
        report.write_csv(&mut file).map_err(|e| fail("--csv", path, &e))?;
    }
    if let Some(path) = &arguments.svg {
        let text = plot::svg(report).map_err(|e| fail("--svg", path, &e))?;
        std::fs::write(path, text).map_err(|e| fail("--svg", path, &e))?;
    }
    Ok(())
}

/// The study in tables.
fn write_tables(report: &StudyReport, output: &mut dyn Write) -> Result<(), Failure> {
    let reference = &report.reference;
    let trust = reference.own_error.map_or_else(String::new, |e| format!(", which a run at ten times its tolerance misses by {e:.0e}"));
    writeln!(output, "{}: {} s, compared at {} output times per second", report.scene, report.duration_s, report.rate_hz)?;
    writeln!(output, "reference: {}{trust}", reference.what)?;
    let right = Align::Right;
    let mut table = Table::new(&[
        ("", Align::Left),
        ("integrator", Align::Left),
        ("accuracy", right),
        ("modes", right),
        ("with", Align::Left),
        ("order", right),
        ("closures", Align::Left),
        ("run time (s)", right),
        ("from", right),
        ("to", right),
        ("steps", right),
        ("evaluations", right),
        ("peak error", right),
        ("rms error", right),
        ("worst channel", Align::Left),
    ]);
    let cheapest = report.cheapest.as_ref().map(|c| c.point);
    for (index, point) in report.points.iter().enumerate() {
        table.row(row(point, cheapest == Some(index)));
    }
    let stress = match report.stress_bodies.as_slice() {
        [] => String::new(),
        names => format!(" and of the largest stress of {}", names.join(", ")),
    };
    let scale = "relative to the largest reference value of each";
    writeln!(output, "\nerrors of hinge and closure loads{stress}, {scale}; * Pareto front, > cheapest:")?;
    table.write(output)?;
    write_channels(report, output)?;
    let budget = 100.0 * report.error_budget;
    if let Some(own) = report.reference.own_error.filter(|own| *own > report.error_budget) {
        writeln!(
            output,
            "\nnote: the reference at ten times its tolerance is {:.1e} off, more than {budget} %: errors below that may be the reference's own; give \
             tighter --tolerances, or a reference by --reference FILE.h5",
            own
        )?;
    }
    match &report.cheapest {
        Some(cheapest) => {
            let point = &report.points[cheapest.point];
            let (error, time) = (point.error.map_or(f64::NAN, |e| e.peak), point.run_time_s.map_or(f64::NAN, |t| t.median));
            writeln!(output, "\ncheapest within {budget} %: {:.2} % in {time:.3e} s; for the scene:\n", 100.0 * error)?;
            for line in &cheapest.lines {
                writeln!(output, "{line}")?;
            }
        }
        None => writeln!(output, "\nno setting that was run is within {budget} %; add tighter tolerances or more modes")?,
    }
    if !report.proposals.is_empty() {
        writeln!(output, "\nwhat could go within {budget} %:")?;
        report.proposals.iter().try_for_each(|line| writeln!(output, "  {line}"))?;
    }
    if !report.silent.is_empty() {
        writeln!(output, "\nnot counted, as nothing but rounding happens there: {}", report.silent.join(", "))?;
    }
    for note in &report.notes {
        writeln!(output, "note: {note}")?;
    }
    Ok(())
}

fn row(point: &PointReport, cheapest: bool) -> Vec<String> {
    let setting = &point.point;
    let optional = |x: Option<String>| x.unwrap_or_else(|| "-".to_owned());
    let accuracy = setting.tolerance.map(|t| format!("{t:e}")).or(setting.step.map(|h| format!("{h:.2e} s")));
    let time = |of: fn(crate::study::report::Timing) -> f64| optional(point.run_time_s.map(|t| format!("{:.3e}", of(t))));
    let worst: Option<(&str, &ChannelError)> = point.channels.iter().max_by(|a, b| a.1.peak.total_cmp(&b.1.peak));
    let mark = match (cheapest, point.pareto) {
        (true, _) => ">",
        (false, true) => "*",
        _ => "",
    };
    vec![
        mark.to_owned(),
        setting.integrator.clone(),
        optional(accuracy),
        optional(setting.variant.modes.map(|n| n.to_string())),
        added(&setting.variant),
        optional(setting.variant.inertia_order.map(|o| o.to_string())),
        optional(setting.variant.closure_method.clone()),
        time(|t| t.median),
        time(|t| t.min),
        time(|t| t.max),
        optional(point.steps.map(|s| s.to_string())),
        optional(point.evaluations.map(|n| n.to_string())),
        optional(point.error.map(|e| format!("{:.1e}", e.peak))),
        optional(point.error.map(|e| format!("{:.1e}", e.rms))),
        point.failure.as_ref().map_or_else(|| worst.map_or_else(String::new, |w| w.0.to_owned()), |f| format!("failed: {f}")),
    ]
}

/// Errors by channel along the Pareto front.
fn write_channels(report: &StudyReport, output: &mut dyn Write) -> io::Result<()> {
    let mut front: Vec<&PointReport> = report.points.iter().filter(|p| p.pareto).collect();
    let time = |p: &PointReport| p.run_time_s.map_or(f64::NAN, |t| t.median);
    front.sort_by(|a, b| time(a).total_cmp(&time(b)));
    let Some(first) = front.first() else { return Ok(()) };
    // evenly thinned, ends kept
    let shown = front.len().min(MOST_FRONT);
    let taken: Vec<&PointReport> = (0..shown).map(|i| front[i * (front.len() - 1) / (shown - 1).max(1)]).collect();
    let headings: Vec<String> = taken.iter().map(|p| format!("{:.3e} s", time(p))).collect();
    let mut columns = vec![("channel", Align::Left)];
    columns.extend(headings.iter().map(|h| (h.as_str(), Align::Right)));
    let mut table = Table::new(&columns);
    for (name, _) in first.channels.iter() {
        let cell = |p: &&PointReport| p.channels.get(name).map_or_else(String::new, |e| format!("{:.1e} / {:.1e}", e.peak, e.rms));
        table.row(std::iter::once(name.to_owned()).chain(taken.iter().map(cell)));
    }
    let thinned = if shown < front.len() { format!(", {shown} of its {} settings", front.len()) } else { String::new() };
    writeln!(
        output,
        "\npeak / rms error of each channel against run time, along the Pareto front{thinned} (all others by --csv or --json):"
    )?;
    table.write(output)
}

/// What a variant adds to the modes, or expressly does not.
fn added(variant: &Variant) -> String {
    let switches = [(variant.residual_modes, "residual modes"), (variant.geometric_stiffness, "geometric stiffness")];
    let said = switches.iter().filter_map(|(on, what)| on.map(|on| if on { (*what).to_owned() } else { format!("no {what}") }));
    let said: Vec<_> = said.collect();
    if said.is_empty() { "-".into() } else { said.join(", ") }
}

/// The bar counts runs.
struct Progress(ProgressBar);

impl Watch for Progress {
    fn begin(&mut self, what: &str, done: usize, total: usize) {
        self.0.set_length(total as u64);
        self.0.set_position(done as u64);
        self.0.set_message(what.to_owned());
    }
}

impl From<RequestError> for Failure {
    fn from(error: RequestError) -> Self {
        Self::input(with_causes(&error))
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        let message = with_causes(&error);
        match error {
            StudyError::Reference { .. } | StudyError::Interrupted | StudyError::State(StateError::Write { .. }) => Self::Stopped(message),
            _ => Self::input(message),
        }
    }
}
