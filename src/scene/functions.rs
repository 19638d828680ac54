//! Time functions of a scene: from their tables of keys to the model's functions.

use super::error::{SceneError, Source};
use super::locate::Step;
use super::spec::{FunctionSpec, Numbers, TableSpec};
use crate::model::TimeFunction;
use crate::model::time_function::Table;
use std::path::Path;

/// Builds the function at the keys `steps` of the scene.
///
/// # Errors
/// If no or more than one kind is given, a table does not hold, components disagree, or a CSV file cannot be read.
pub fn function(spec: &FunctionSpec, source: &Source, steps: &[Step]) -> Result<TimeFunction, SceneError> {
    let given = [spec.constant.is_some(), spec.table.is_some(), spec.sine.is_some(), spec.smooth_step.is_some(), spec.sum.is_some()];
    if given.iter().filter(|g| **g).count() != 1 {
        return Err(source.value(steps, "a time function has exactly one of constant, table, sine, smooth_step, sum"));
    }
    let at = |key: &'static str| [steps, &[Step::Key(key)]].concat();
    if let Some(constant) = &spec.constant {
        return Ok(TimeFunction::Constant(constant.list()));
    }
    if let Some(table) = &spec.table {
        let rows = match table {
            TableSpec::Rows(rows) => rows.iter().map(|(t, x)| (*t, x.list())).collect(),
            TableSpec::File(file) => csv_rows(file, source, &at("table"))?,
        };
        let of_file = if let TableSpec::File(file) = table { format!("{}: ", file.display()) } else { String::new() };
        return Table::new(&rows).map(TimeFunction::Table).map_err(|e| source.value(&at("table"), format!("{of_file}{e}")));
    }
    if let Some(sine) = &spec.sine {
        if !(sine.frequency_hz >= 0.0) {
            return Err(source.value(&at("sine"), format!("frequency_hz = {} must be zero or positive", sine.frequency_hz)));
        }
        return Ok(TimeFunction::Sine { amplitude: sine.amplitude.list(), frequency_hz: sine.frequency_hz, phase: sine.phase });
    }
    if let Some(step) = &spec.smooth_step {
        let (from, to) = widened(&step.from, &step.to);
        if from.len() != to.len() {
            return Err(source.value(&at("smooth_step"), format!("from has {} components, to has {}", from.len(), to.len())));
        }
        if step.end <= step.start {
            return Err(source.value(&at("smooth_step"), format!("end = {} s must come after start = {} s", step.end, step.start)));
        }
        return Ok(TimeFunction::SmoothStep { from, to, start: step.start, end: step.end });
    }
    let terms = spec.sum.iter().flatten().enumerate();
    let terms =
        terms.map(|(i, term)| function(term, source, &[&at("sum")[..], &[Step::Index(i)]].concat())).collect::<Result<Vec<_>, _>>()?;
    let dimension = terms.first().map_or(0, TimeFunction::dimension);
    if terms.is_empty() || terms.iter().any(|t| t.dimension() != dimension) {
        return Err(source.value(&at("sum"), "a sum needs at least one term, and all terms the same number of components"));
    }
    Ok(TimeFunction::Sum(terms))
}

/// A single number beside a vector stands for all its components.
fn widened(a: &Numbers, b: &Numbers) -> (Vec<f64>, Vec<f64>) {
    let (mut a_list, mut b_list) = (a.list(), b.list());
    if let (Numbers::One(x), Numbers::Many(_)) = (a, b) {
        a_list = vec![*x; b_list.len()];
    }
    if let (Numbers::Many(_), Numbers::One(x)) = (a, b) {
        b_list = vec![*x; a_list.len()];
    }
    (a_list, b_list)
}

/// Rows of a CSV file: time, then the components; lines that start with `#` and one heading line are passed over.
fn csv_rows(file: &Path, source: &Source, steps: &[Step]) -> Result<Vec<(f64, Vec<f64>)>, SceneError> {
    let path = source.path.parent().unwrap_or(Path::new("")).join(file);
    let fault = |message: String| source.value(steps, format!("{}: {message}", path.display()));
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .from_path(&path)
        .map_err(|e| fault(format!("cannot read the table: {e}")))?;
    let mut rows = Vec::new();
    for (number, record) in reader.records().enumerate() {
        let record = record.map_err(|e| fault(e.to_string()))?;
        let numbers: Result<Vec<f64>, _> = record.iter().map(str::parse).collect();
        match numbers {
            Ok(numbers) if numbers.len() >= 2 && numbers.iter().all(|x: &f64| x.is_finite()) => {
                rows.push((numbers[0], numbers[1..].to_vec()))
            }
            // a heading names the columns
            Err(_) if number == 0 => {}
            _ => {
                return Err(fault(format!(
                    "row {} is \"{}\"; expected time, value, ... as finite numbers",
                    number + 1,
                    record.iter().collect::<Vec<_>>().join(",")
                )));
            }
        }
    }
    Ok(rows)
}
