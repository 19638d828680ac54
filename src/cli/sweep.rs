//! `pliant sweep` and `pliant merge`: campaigns over many values of a scene's keys, and their shards.

use super::args::{MergeArguments, SweepArguments};
use super::failure::{Failure, with_causes};
use super::report::{Align, Table, number};
use crate::campaign::envelope::{LoadEnvelope, plain};
use crate::campaign::merge::Whole;
use crate::campaign::{Campaign, CampaignError, CampaignReport, CaseRecord, Plan, Records, Shard, Watch, results};
use crate::output::evaluation::Named;
use crate::scene::Overrides;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Runs the campaign, or a shard of it, and reports.
pub fn run(arguments: &SweepArguments, output: &mut dyn Write) -> Result<(), Failure> {
    if let Some(duration) = arguments.duration.filter(|d| !(*d > 0.0 && d.is_finite())) {
        return Err(Failure::input(format!("--duration {duration} must be a positive number of seconds")));
    }
    if arguments.threads == Some(0) {
        return Err(Failure::input("--threads 0 runs nothing; give 1 or more"));
    }
    let plan = Plan::load(&arguments.plan)?;
    let overrides = Overrides { duration: arguments.duration, ..Overrides::from(&arguments.overrides) };
    let campaign = Campaign::new(&arguments.scene, overrides, plan)?;
    let shard = arguments.shard.map_or(Shard::WHOLE, |(index, count)| Shard { index, count });
    let header = campaign.header(shard);
    if let Some(case) = arguments.show_case {
        return show_case(&campaign, case, header.cases, &given_options(arguments), output);
    }
    let out = arguments.out.clone().unwrap_or_default();
    let state = arguments.state.clone().unwrap_or_else(|| state_beside(&out, arguments.shard));
    let results_file = arguments.shard.is_none().then_some(&out);
    check_targets(campaign.inputs(), &[("--out", results_file), ("--state", Some(&state)), ("--csv", arguments.csv.as_ref())])?;

    let mut records = Records::open(&state, header)?;
    let resumed = records.len();
    let total = shard.cases(records.header.cases).count();
    let threads = arguments.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    announce(&records, resumed, total, threads);
    for remark in campaign.remarks() {
        let _ = writeln!(std::io::stderr(), "warning: {remark}");
    }
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    // without a handler Ctrl-C ends the process at once, which loses only the cases that are going on
    let _ = ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed));
    let mut progress = Progress::new(resumed, total);
    let started = Instant::now();
    let ran = campaign.run(&mut records, threads, &interrupted, &mut progress);
    let wall = started.elapsed();
    progress.bar.finish_and_clear();
    ran?;
    if !records.missing().is_empty() {
        let (done, state) = (records.len(), state.display());
        let message =
            format!("interrupted with {done} of {total} cases finished; they are in {state}, and the same command goes on from there");
        return Err(Failure::Stopped(message));
    }

    let mut whole = Whole::from(records);
    let mut report = match results_file {
        Some(out) => {
            results::write(out, &mut whole).map_err(|e| Failure::Stopped(format!("{e}; the finished cases are in {}", state.display())))?
        }
        None => CampaignReport::new(&whole.header().clone(), results::envelope(&mut whole)?, state.display().to_string()),
    };
    (report.resumed, report.threads, report.wall_s) = (resumed, Some(threads), Some(wall.as_secs_f64()));
    drop(whole);
    if results_file.is_some() && arguments.state.is_none() {
        // everything in it is in the results
        let _ = std::fs::remove_file(&state);
    }
    print(&report, arguments.json, arguments.csv.as_deref(), output)?;
    if let (Some((_, count)), false) = (arguments.shard, arguments.json) {
        let all = state_beside(&out, Some((0, count))).display().to_string().replace(".0-of-", ".*-of-");
        writeln!(output, "\nwhen all shards are done: pliant merge {all} --out {}", out.display())?;
    }
    ended(&report)
}

/// Puts shards together.
pub fn merge(arguments: &MergeArguments, output: &mut dyn Write) -> Result<(), Failure> {
    let mut whole = Whole::open(&arguments.shards)?;
    check_targets(&whole.paths(), &[("--out", Some(&arguments.out)), ("--csv", arguments.csv.as_ref())])?;
    let report = results::write(&arguments.out, &mut whole)?;
    print(&report, arguments.json, arguments.csv.as_deref(), output)?;
    ended(&report)
}

/// FILE.state.jsonl or FILE.2-of-3.state.jsonl for FILE.h5.
fn state_beside(out: &Path, shard: Option<(usize, usize)>) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let share = shard.map_or_else(String::new, |(index, count)| format!(".{index}-of-{count}"));
    out.with_file_name(format!("{stem}{share}.state.jsonl"))
}

/// Refuses to write over an input, or one output over the other, and to compute what cannot be written.
fn check_targets(inputs: &[PathBuf], targets: &[(&str, Option<&PathBuf>)]) -> Result<(), Failure> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut taken: Vec<PathBuf> = inputs.iter().map(|input| real(input)).collect();
    for (option, target) in targets.iter().filter_map(|(option, target)| Some((option, (*target)?))) {
        let path = real(target);
        if taken.contains(&path) {
            let message = format!("{option} {} is an input or another output of this command; write to another file", target.display());
            return Err(Failure::input(message));
        }
        taken.push(path);
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
        if folder.is_some_and(|folder| !folder.is_dir()) || target.is_dir() {
            return Err(Failure::input(format!("{option} {}: name a file in a folder that exists", target.display())));
        }
    }
    Ok(())
}

/// Options that change the scene, as they were given: the printed scene does not have them.
fn given_options(arguments: &SweepArguments) -> String {
    let scene = &arguments.overrides;
    let mut options = Vec::new();
    options.extend(arguments.duration.map(|d| format!("--duration {d}")));
    options.extend(scene.integrator.as_ref().map(|i| format!("--integrator {i}")));
    options.extend(scene.modes.map(|n| format!("--modes {n}")));
    options.extend(scene.residual_modes.then(|| "--residual-modes".to_owned()));
    options.extend(scene.rigid.iter().map(|body| format!("--rigid \"{body}\"")));
    options.extend(scene.closure_method.as_ref().map(|m| format!("--closure-method {m}")));
    options.join(" ")
}

fn show_case(campaign: &Campaign, case: usize, cases: usize, options: &str, output: &mut dyn Write) -> Result<(), Failure> {
    let Some(index) = case.checked_sub(1).filter(|index| *index < cases) else {
        return Err(Failure::input(format!("--show-case {case}: the campaign has cases 1 to {cases}")));
    };
    let document = campaign.document(index).map_err(|e| Failure::input(format!("case {case}: {e}")))?;
    let text = toml::to_string(&document).map_err(|e| Failure::input(format!("case {case}: {e}")))?;
    let with = if options.is_empty() { String::new() } else { format!(", to be run with {options}") };
    Ok(write!(output, "# case {case}{with}\n{text}")?)
}

/// What is about to run, on standard error.
fn announce(records: &Records, resumed: usize, total: usize, threads: usize) {
    let header = &records.header;
    let share = if header.shard == Shard::WHOLE {
        String::new()
    } else {
        format!(", shard {}/{}: {total} of them", header.shard.index, header.shard.count)
    };
    let mut sink = std::io::stderr().lock();
    // nothing is lost if standard error is closed
    let _ = writeln!(
        sink,
        "{}: {} of {}{share}; {}; finished cases are kept in {}",
        header.scene_name,
        counted(header.cases, "case"),
        counted(header.parameters.len(), "parameter"),
        counted(threads, "thread"),
        records.path().display()
    );
    if resumed > 0 {
        let _ = writeln!(sink, "{} there already", if resumed == 1 { "1 case is".into() } else { format!("{resumed} cases are") });
    }
}

fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

fn print(report: &CampaignReport, json: bool, csv: Option<&Path>, output: &mut dyn Write) -> Result<(), Failure> {
    if json {
        let text = serde_json::to_string_pretty(report).map_err(|e| Failure::Output(e.into()))?;
        writeln!(output, "{text}")?;
    } else {
        write_tables(report, output)?;
    }
    output.flush()?;
    if let Some(path) = csv {
        let fail = |e: &dyn std::fmt::Display| Failure::Stopped(format!("--csv {}: {e}; the results file is complete", path.display()));
        let mut file = std::fs::File::create(path).map_err(|e| fail(&e))?;
        report.write_csv(&mut file).map_err(|e| fail(&e))?;
    }
    Ok(())
}

/// The exit of a campaign in which cases failed.
fn ended(report: &CampaignReport) -> Result<(), Failure> {
    if report.failed == 0 {
        return Ok(());
    }
    let all = report.completed + report.failed;
    let file = &report.file;
    Err(Failure::Stopped(format!(
        "{} of {} failed and count for nothing in the envelope; {file} says why for each",
        report.failed,
        counted(all, "case")
    )))
}

fn write_tables(report: &CampaignReport, output: &mut dyn Write) -> Result<(), Failure> {
    let all = report.completed + report.failed;
    write!(output, "{}: {} of {}", report.scene, counted(all, "case"), counted(report.parameters.len(), "parameter"))?;
    if all < report.cases {
        write!(output, " (shard {}/{} of {} cases)", report.shard.index, report.shard.count, report.cases)?;
    }
    write!(output, ", {} complete, {} failed", report.completed, report.failed)?;
    if let (Some(wall), Some(threads)) = (report.wall_s, report.threads) {
        let ran = all - report.resumed;
        write!(
            output,
            "; {ran} run in {} s on {} ({} a second)",
            number(wall),
            counted(threads, "thread"),
            number(ran as f64 / wall.max(1e-9))
        )?;
    }
    writeln!(output, "\nwritten: {}", report.file)?;
    let headings = [
        (
            "hinge",
            &report.hinges,
            "hinge loads over all cases and steps, by the parent on the child, moment (N m) about O, force (N), in O axes",
        ),
        (
            "closure",
            &report.closures,
            "closure loads over all cases and steps, on b, moment (N m) about b's point, force (N), in the axes of frame a; of a gear what acts on coordinate b",
        ),
    ];
    for (what, envelopes, title) in headings {
        if envelopes.iter().any(|(_, envelope)| !envelope.rows.is_empty()) {
            writeln!(output, "\nenvelope of {title}; each row is one instant; zeros are left out:")?;
            table(what, envelopes).write(output)?;
        }
    }
    if !report.failures.is_empty() {
        writeln!(output, "\nfailed cases{}:", if report.failed > report.failures.len() { ", the first" } else { "" })?;
        for failure in &report.failures {
            let values = report.parameters.iter().zip(&failure.parameters).map(|(name, value)| format!("{name} = {}", plain(value)));
            writeln!(output, "  case {} ({}): {}", failure.case, values.collect::<Vec<_>>().join(", "), failure.message)?;
        }
    }
    Ok(())
}

/// What is rounding beside the largest component of a load; a moment stands beside forces on arms of 1 m.
fn rounding(envelope: &LoadEnvelope) -> f64 {
    1e-9 * envelope.rows.iter().map(|row| row.value.abs()).fold(0.0, f64::max)
}

/// One line per row of the envelopes but those of components in which nothing happens.
fn table(what: &str, envelopes: &Named<LoadEnvelope>) -> Table {
    let right = Align::Right;
    let mut table = Table::new(&[
        (what, Align::Left),
        ("extreme", Align::Left),
        ("moment x", right),
        ("y", right),
        ("z", right),
        ("force x", right),
        ("y", right),
        ("z", right),
        ("case", right),
        ("at (s)", right),
    ]);
    for (name, envelope) in envelopes.iter() {
        let noise = rounding(envelope);
        for (index, row) in envelope.rows.iter().enumerate().filter(|(_, row)| row.value.abs() > noise) {
            let unit = &envelope.units[index % envelope.units.len()];
            let mut cells = vec![name.to_owned(), format!("{} {}", row.extreme, row.component.replace('_', " "))];
            if row.load.len() > 1 {
                cells.extend(row.load.iter().map(|x| number(*x)));
            } else {
                // what a gear exerts stands under its unit
                let place = if unit == "N" { 3 } else { 0 };
                cells.extend((0..6).map(|i| if i == place { number(row.value) } else { String::new() }));
            }
            cells.extend([row.case.to_string(), number(row.time_s)]);
            table.row(cells);
        }
    }
    table
}

/// The bar counts cases.
struct Progress {
    bar: ProgressBar,
    failed: usize,
}

impl Progress {
    fn new(resumed: usize, total: usize) -> Self {
        let bar = ProgressBar::new(total as u64).with_position(resumed as u64);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} cases  {msg}  eta {eta}") {
            bar.set_style(style);
        }
        bar.reset_eta();
        Self { bar, failed: 0 }
    }
}

impl Watch for Progress {
    fn ended(&mut self, record: &CaseRecord, done: usize, _total: usize) {
        self.bar.set_position(done as u64);
        if record.failure.is_some() {
            self.failed += 1;
            self.bar.set_message(format!("{} failed", self.failed));
        }
    }
}

impl From<CampaignError> for Failure {
    fn from(error: CampaignError) -> Self {
        match error {
            CampaignError::Shards(faults) => Self::Input(faults),
            CampaignError::Write { .. } | CampaignError::Read { .. } => Self::Stopped(with_causes(&error)),
            CampaignError::Open { .. } => Self::input(error.to_string()),
            _ => Self::input(with_causes(&error)),
        }
    }
}
