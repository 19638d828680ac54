//! `pliant check`: every file is checked before the command fails.

use super::args::CheckArguments;
use super::failure::{Failure, with_causes};
use crate::output::Evaluation;
use crate::scene::{Overrides, assemble};
use std::io::Write;
use std::path::Path;

/// Checks all files; fails if one of them is at fault.
pub fn run(arguments: &CheckArguments, output: &mut dyn Write) -> Result<(), Failure> {
    let mut faults = Vec::new();
    let mut objects = Vec::new();
    for file in &arguments.files {
        let (object, messages) = if arguments.json { check_file(file, &mut std::io::sink())? } else { check_file(file, output)? };
        faults.extend(messages);
        objects.push(object);
    }
    if arguments.json {
        writeln!(output, "{}", serde_json::json!({ "accepted": faults.is_empty(), "files": objects }))?;
    }
    if faults.is_empty() { Ok(()) } else { Err(Failure::Input(faults)) }
}

/// One file by its extension: its report as an object (and as text on the sink), and what is wrong with it.
fn check_file(file: &Path, output: &mut dyn Write) -> Result<(serde_json::Value, Vec<String>), Failure> {
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("h5" | "hdf5") => check_modal_file(file, output),
        Some("toml") => check_scene(file, output),
        _ => {
            let message =
                format!("{}: neither a scene (.toml) nor a modal file (.h5) by its name; rename it or name another file", file.display());
            Ok((serde_json::json!({ "file": file.to_string_lossy(), "accepted": false, "messages": [message] }), vec![message]))
        }
    }
}

/// A scene: everything `run` checks before its first step, one evaluation included.
fn check_scene(file: &Path, output: &mut dyn Write) -> Result<(serde_json::Value, Vec<String>), Failure> {
    let checked = assemble::load(file, &Overrides::default()).map_err(|e| with_causes(&e)).and_then(|scene| {
        let evaluation = Evaluation::of(&scene.system, &scene.state).map_err(|e| format!("{}: {}", file.display(), with_causes(&e)))?;
        Ok((scene, evaluation))
    });
    match checked {
        Ok((scene, evaluation)) => {
            let system = &scene.system;
            let counts = (system.bodies.len(), system.velocity_count, system.modal_count, system.loads.len());
            writeln!(output, "{}: accepted", file.display())?;
            writeln!(
                output,
                "  \"{}\": {} bodies, {} hinge rates, {} modes, {} loads; load audit at the start {:.1e}",
                scene.name, counts.0, counts.1, counts.2, counts.3, evaluation.audit.load_residual
            )?;
            for warning in &scene.warnings {
                writeln!(output, "  warning: {warning}")?;
            }
            let object = serde_json::json!({
                "file": file.to_string_lossy(),
                "accepted": true,
                "warnings": scene.warnings,
                "bodies": counts.0,
                "hinge_rates": counts.1,
                "modes": counts.2,
                "loads": counts.3,
                "messages": [],
            });
            Ok((object, Vec::new()))
        }
        Err(message) => {
            writeln!(output, "{}: refused", file.display())?;
            Ok((serde_json::json!({ "file": file.to_string_lossy(), "accepted": false, "messages": [message] }), vec![message]))
        }
    }
}

#[cfg(not(feature = "hdf5"))]
fn check_modal_file(file: &Path, _: &mut dyn Write) -> Result<(serde_json::Value, Vec<String>), Failure> {
    let message = format!("{}: this build cannot read modal files; build with the feature \"hdf5\"", file.display());
    Ok((serde_json::json!({ "file": file.to_string_lossy(), "accepted": false, "messages": [message] }), vec![message]))
}

#[cfg(feature = "hdf5")]
fn check_modal_file(file: &Path, output: &mut dyn Write) -> Result<(serde_json::Value, Vec<String>), Failure> {
    use crate::io::Verdict;
    let examination = crate::io::examine(file);
    let messages = examination.messages();
    let verdict = if messages.is_empty() { "accepted" } else { "refused" };
    writeln!(output, "{}: {verdict}", file.display())?;
    health::table(&examination.report).write(output)?;
    let unreached = examination.report.with_verdict(Verdict::NotReached).count();
    if unreached > 0 {
        writeln!(output, "  {unreached} further rules were not reached")?;
    }
    writeln!(output)?;
    let object = serde_json::json!({
        "file": file.to_string_lossy(),
        "accepted": messages.is_empty(),
        "rules": health::objects(&examination.report),
        "messages": messages,
    });
    Ok((object, messages))
}

/// The health report in the two forms of the terminal.
#[cfg(feature = "hdf5")]
pub mod health {
    use crate::cli::report::{Align, Table};
    use crate::io::{Bound, HealthReport, RuleResult, Verdict};

    /// One row per rule that was evaluated: figure, limit, verdict, object, what the rule protects.
    pub fn table(report: &HealthReport) -> Table {
        let (left, right) = (Align::Left, Align::Right);
        let mut table =
            Table::new(&[("rule", left), ("figure", right), ("limit", left), ("verdict", left), ("protects", left), ("remark", left)]);
        for row in report.rows.iter().filter(|row| row.verdict != Verdict::NotReached) {
            table.row([
                row.rule.name().to_owned(),
                row.figure.map_or("-".to_owned(), figure),
                row.bound.map_or(String::new(), |bound| format!("{} {}", bound.relation(), limit(bound.limit()))),
                row.verdict.word().to_owned(),
                row.rule.protects().to_owned(),
                remark(row),
            ]);
        }
        table
    }

    /// Three digits of a figure.
    fn figure(value: f64) -> String {
        if value == 0.0 { "0".to_owned() } else { format!("{value:.2e}") }
    }

    /// A limit in the form of the schema.
    fn limit(value: f64) -> String {
        let margin = value - 1.0;
        if value == 0.0 {
            "0".to_owned()
        } else if margin > 0.0 && margin < 1e-3 {
            format!("1 + {margin:.0e}")
        } else {
            format!("{value:.0e}")
        }
    }

    /// Where the figure is from, and what it cannot say; the message of a broken rule goes to standard error in full.
    fn remark(row: &RuleResult) -> String {
        match (&row.note, row.object.as_str()) {
            (Some(_), "") if row.verdict == Verdict::Fail => "see the message".to_owned(),
            (Some(note), "") => note.clone(),
            (Some(note), object) => format!("{object}: {note}"),
            (None, object) => object.to_owned(),
        }
    }

    /// The same as JSON objects.
    pub fn objects(report: &HealthReport) -> Vec<serde_json::Value> {
        let object = |row: &RuleResult| {
            serde_json::json!({
                "rule": row.rule.name(),
                "protects": row.rule.protects(),
                "object": row.object,
                "figure": row.figure,
                "relation": row.bound.map(Bound::relation),
                "limit": row.bound.map(Bound::limit),
                "verdict": row.verdict.word(),
                "note": row.note,
            })
        };
        report.rows.iter().map(object).collect()
    }
}
