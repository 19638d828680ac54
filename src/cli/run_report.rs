//! The closing report of a run for the terminal.

use super::failure::Failure;
use super::report::{Align, Table, number};
use crate::output::RunReport;
use crate::output::evaluation::Named;
use crate::output::report::{LoadPeak, TimeRecord, TruncationFigures, share};
use crate::study::verify::{LoadDifference, Verification};
use std::io::Write;

/// Writes the report.
pub fn write(scene: &str, report: &RunReport, output: &mut dyn Write) -> Result<(), Failure> {
    writeln!(
        output,
        "{scene}: {} s simulated in {:.2} s ({} x real time), {}: {} steps, {} rejected, {} evaluations",
        number(report.simulated_s),
        report.wall_s,
        number(report.simulated_s / report.wall_s.max(1e-9)),
        report.integrator,
        report.steps,
        report.rejected_steps,
        report.evaluations
    )?;
    let right = Align::Right;
    writeln!(output, "\npeak hinge loads over all steps, by the parent on the child, moment about O:")?;
    load_peaks("hinge", &report.peaks.hinges, report.truncation.as_ref().map(|t| &t.hinges)).write(output)?;
    if !report.peaks.closures.0.is_empty() {
        writeln!(output, "\npeak closure loads over all steps, on b, moment about b's point; of a gear what acts on coordinate b:")?;
        load_peaks("closure", &report.peaks.closures, report.truncation.as_ref().map(|t| &t.closures)).write(output)?;
    }
    if !report.peaks.bodies.0.is_empty() {
        let mut columns = vec![
            ("body", Align::Left),
            ("peak von Mises (Pa)", right),
            ("at (s)", right),
            ("node", right),
            ("place x, y, z (m)", Align::Left),
        ];
        columns.extend(report.truncation.as_ref().map(|_| (LEFT_OUT, right)));
        let mut bodies = Table::new(&columns);
        for (name, peak) in report.peaks.bodies.iter() {
            let place = peak.position.map(number).join(", ");
            let mut row = vec![name.to_owned(), number(peak.von_mises), number(peak.time_s), peak.node.to_string(), place];
            row.extend(report.truncation.as_ref().map(|t| percent(t.bodies.get(name).and_then(|c| share(c.von_mises, peak.von_mises)))));
            bodies.row(row);
        }
        writeln!(output, "\npeak stress over the output times:")?;
        bodies.write(output)?;
    }
    if !report.exceedances.is_empty() {
        let mut table = Table::new(&[
            ("limit exceeded", Align::Left),
            ("limit", right),
            ("peak", right),
            ("unit", Align::Left),
            ("from (s)", right),
            ("to (s)", right),
        ]);
        for e in &report.exceedances {
            let end = e.end_s.map_or_else(|| "end".to_owned(), number);
            table.row([
                format!("{} of {} \"{}\"", e.quantity, e.kind, e.name),
                number(e.limit),
                number(e.peak),
                e.unit.to_owned(),
                number(e.start_s),
                end,
            ]);
        }
        writeln!(output, "\nlimits:")?;
        table.write(output)?;
    }
    let optional = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.1e}"));
    writeln!(
        output,
        "\nerrors: energy balance {:.1e}, momentum {}, load audit {}, closure {}, step control {} (of a load {})",
        report.errors.energy,
        optional(report.errors.momentum),
        optional(report.errors.audit),
        optional(report.errors.closure),
        optional(report.errors.local),
        optional(report.errors.local_load)
    )?;
    if let Some(time) = &report.time {
        writeln!(output, "{}", time_line(time))?;
    }
    for warning in &report.warnings {
        writeln!(output, "warning: {warning}")?;
    }
    writeln!(output, "left out: {}", report.left_out.join(", "))?;
    for file in &report.files {
        writeln!(output, "wrote {} {}: {} output times", file.kind, file.target, file.frames)?;
    }
    Ok(())
}

/// Where the time went, as one line.
fn time_line(time: &TimeRecord) -> String {
    let TimeRecord { per_evaluation_s, evaluations_s, outputs_s, integrator_s, sweeps } = time;
    let whole = evaluations_s + outputs_s + integrator_s;
    let percent = |part: f64, whole: f64| format!("{:.0} %", 100.0 * part / whole.max(1e-12));
    let parts = [
        (sweeps.poses, "poses"),
        (sweeps.velocities, "velocities"),
        (sweeps.inertias, "inertias"),
        (sweeps.forces, "forces"),
        (sweeps.accelerations, "accelerations"),
        (sweeps.closures, "closures"),
    ];
    let parts: Vec<_> = parts.iter().filter(|(x, _)| *x > 0.0).map(|(x, what)| format!("{what} {}", percent(*x, 1.0))).collect();
    format!(
        "time: evaluations {} at {} us each ({}), outputs {}, integrator {}",
        percent(*evaluations_s, whole),
        number(1e6 * per_evaluation_s),
        parts.join(", "),
        percent(*outputs_s, whole),
        percent(*integrator_s, whole)
    )
}

/// Writes the differences from the tighter run.
pub fn write_verification(verification: &Verification, output: &mut dyn Write) -> Result<(), Failure> {
    let how = match (verification.relative_tolerance, verification.step) {
        (Some(tolerance), _) => format!("a relative tolerance of {tolerance:.3e}").replace(".000e", "e"),
        (None, step) => format!("steps of {} s", number(step.unwrap_or(f64::NAN))),
    };
    if let Some(failure) = &verification.failure {
        return Ok(writeln!(output, "\nnot verified: the run with {how} stopped early: {failure}")?);
    }
    writeln!(output, "\nverified with {how} in {:.2} s; differences of loads, relative, and of final positions:", verification.wall_s)?;
    let right = Align::Right;
    let mut table = Table::new(&[
        ("hinge or closure", Align::Left),
        ("peak moment", right),
        ("moment over time", right),
        ("peak force", right),
        ("force over time", right),
        ("position (m or rad)", right),
    ]);
    let optional = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.1e}"));
    let mut row = |name: &str, d: &LoadDifference, position: Option<f64>| {
        let [moment, force] = [d.moment_history, d.force_history].map(|e| e.map(|e| e.peak));
        table.row(std::iter::once(name.to_owned()).chain([d.moment, moment, d.force, force, position].map(optional)));
    };
    verification.hinges.iter().for_each(|(name, d)| row(name, &d.load, d.position));
    verification.closures.iter().for_each(|(name, d)| row(name, d, None));
    Ok(table.write(output)?)
}

/// Peaks of moments and forces; `of` is what carries them.
fn load_peaks(of: &str, peaks: &Named<LoadPeak>, left_out: Option<&Named<TruncationFigures>>) -> Table {
    let right = Align::Right;
    let estimate = left_out.map(|_| (LEFT_OUT, right));
    let mut columns = vec![(of, Align::Left), ("peak moment (N m)", right), ("at (s)", right)];
    columns.extend(estimate);
    columns.extend([("peak force (N)", right), ("at (s)", right)]);
    columns.extend(estimate);
    let mut table = Table::new(&columns);
    for (name, peak) in peaks.iter() {
        let change = left_out.map(|changes| changes.get(name).copied().unwrap_or_default());
        let mut row = vec![name.to_owned(), number(peak.moment), number(peak.moment_time_s)];
        row.extend(change.map(|c| percent(share(c.moment, peak.moment))));
        row.extend([number(peak.force), number(peak.force_time_s)]);
        row.extend(change.map(|c| percent(share(c.force, peak.force))));
        table.row(row);
    }
    table
}

/// Heading of what the modes left out would change, relative to the peak beside it.
const LEFT_OUT: &str = "left-out modes";

/// A share of a peak in percent.
fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), |s| format!("{:.2} %", 100.0 * s))
}
