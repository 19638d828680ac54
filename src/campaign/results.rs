//! The results file of a campaign, schema `pliant-campaign` 1.0: parameters, outcome and extremes of every case, and the envelope.

use super::envelope::{CampaignReport, Envelope, LoadEnvelope, plain};
use super::error::CampaignError;
use super::merge::Whole;
use super::record::{CaseRecord, Header, LoadRecord, ModalFileEntry};
use crate::io::CampaignFile;
use crate::io::campaign_file::{Array, BLOCK_ROWS, CellKind, Cells, Column, TEXT_LIMIT};
use crate::io::results_file::{Preface, escape};
use crate::output::extremes::Sense;
use std::path::Path;

/// Name of the schema.
pub const FORMAT: &str = "pliant-campaign";
/// Version of the schema.
pub const VERSION: &str = "1.0";

/// Goes through the records that are there, in the order of the cases.
///
/// # Errors
/// If a record cannot be read.
pub fn envelope(whole: &mut Whole) -> Result<Envelope, CampaignError> {
    let mut envelope = Envelope::new(whole.header());
    for case in 0..whole.header().cases {
        if let Some(record) = whole.record(case)? {
            envelope.follow(&record);
        }
    }
    Ok(envelope)
}

/// Lengths of texts and kinds of values, which the arrays must know before the first row.
struct Sizes {
    message: usize,
    /// By parameter: none for numbers.
    text: Vec<Option<usize>>,
}

/// Writes the results of a whole campaign to `path`, and returns what was found.
///
/// # Errors
/// If a record is missing or cannot be read, or the file cannot be written.
pub fn write(path: &Path, whole: &mut Whole) -> Result<CampaignReport, CampaignError> {
    let header = whole.header().clone();
    let mut sizes = Sizes { message: 1, text: vec![None; header.parameters.len()] };
    let mut envelope = Envelope::new(&header);
    for case in 0..header.cases {
        let record = complete(whole, case)?;
        sizes.message = sizes.message.max(record.failure.as_ref().map_or(0, String::len));
        for (size, value) in sizes.text.iter_mut().zip(&record.values) {
            if !value.is_number() {
                *size = Some(size.unwrap_or(1).max(plain(value).len()));
            }
        }
        envelope.follow(&record);
    }
    let columns = columns(&header, &sizes);
    let mut file = CampaignFile::create(path, &preface(&header), header.cases, &columns)?;
    let mut start = 0;
    while start < header.cases {
        let end = header.cases.min(start + BLOCK_ROWS);
        let records = (start..end).map(|case| complete(whole, case)).collect::<Result<Vec<_>, _>>()?;
        file.write(start, end - start, &cells(&header, &sizes, &records))?;
        start = end;
    }
    let arrays: Vec<Array> = header.loads.iter().zip(&envelope.loads).flat_map(|(load, found)| arrays(load, found)).collect();
    file.finish(&arrays)?;
    Ok(CampaignReport::new(&header, envelope, path.display().to_string()))
}

fn complete(whole: &mut Whole, case: usize) -> Result<CaseRecord, CampaignError> {
    let missing = || CampaignError::Read {
        path: whole.paths().first().cloned().unwrap_or_default(),
        case: case + 1,
        message: "it is not there".to_owned(),
    };
    let missing = missing();
    whole.record(case)?.ok_or(missing)
}

fn preface(header: &Header) -> Preface {
    let modal_file = |entry: &ModalFileEntry| {
        (format!("scene/modal_files/{}", escape(&entry.body)), vec![("content_sha256", entry.content_sha256.clone())])
    };
    Preface {
        attributes: vec![
            ("format", FORMAT.into()),
            ("version", VERSION.into()),
            ("pliant_version", header.identity.get("the version of pliant").cloned().unwrap_or_default()),
            ("scene_name", header.scene_name.clone()),
            ("seed", header.seed.to_string()),
        ],
        bytes: vec![("scene/toml".into(), header.scene.clone().into_bytes()), ("plan".into(), header.plan.clone().into_bytes())],
        groups: header.modal_files.iter().map(modal_file).collect(),
        ..Preface::default()
    }
}

fn path_of(load: &LoadRecord, dataset: &str) -> String {
    format!("{}/{}/{dataset}", load.group, escape(&load.owner))
}

/// What components mean.
fn meaning(load: &LoadRecord) -> Vec<(&'static str, String)> {
    let mut attributes = vec![("components", load.components.join(", ")), ("unit", load.units.join(", ")), ("side", load.side.clone())];
    attributes.extend(load.frame.clone().map(|frame| ("frame", frame)));
    attributes.extend(load.point.clone().map(|point| ("point", point)));
    attributes
}

/// Arrays with one row per case; [`cells`] has the same order.
fn columns(header: &Header, sizes: &Sizes) -> Vec<Column> {
    let column = |path: &str, kind, attributes| Column { path: path.to_owned(), shape: Vec::new(), kind, attributes };
    let mut columns = vec![
        column("cases/case", CellKind::Integer, vec![("meaning", "number of the case, counted from 1".into())]),
        column("cases/completed", CellKind::Integer, vec![("meaning", "1 for a case that reached its end, else 0".into())]),
        column("cases/message", CellKind::Text(sizes.message.min(TEXT_LIMIT)), vec![("meaning", "why a case failed".into())]),
        column("cases/end_time", CellKind::Real, vec![("unit", "s".into()), ("meaning", "simulated time reached".into())]),
        column("cases/steps", CellKind::Integer, vec![("meaning", "accepted steps".into())]),
    ];
    for (parameter, size) in header.parameters.iter().zip(&sizes.text) {
        let mut attributes = vec![("keys", parameter.keys.clone())];
        if parameter.scale {
            attributes.push(("meaning", "factor on what the scene has".into()));
        }
        let kind = size.map_or(CellKind::Real, |length| CellKind::Text(length.min(TEXT_LIMIT)));
        columns.push(column(&format!("parameters/{}", escape(&parameter.name)), kind, attributes));
    }
    for load in &header.loads {
        let width = load.units.len();
        for sense in Sense::BOTH {
            let name = sense.name();
            let array = |dataset: String, shape: Vec<usize>, attributes| Column {
                path: path_of(load, &dataset),
                shape,
                kind: CellKind::Real,
                attributes,
            };
            columns.push(array(name.to_owned(), vec![width], meaning(load)));
            columns.push(array(format!("{name}_time"), vec![width], vec![("unit", "s".into())]));
            let at = format!("row i holds all components at the {name} of component i");
            columns.push(array(format!("load_at_{name}"), vec![width, width], [meaning(load), vec![("meaning", at)]].concat()));
        }
    }
    columns
}

/// The rows of some cases in all arrays; loads of a case that failed are NaN.
fn cells(header: &Header, sizes: &Sizes, records: &[CaseRecord]) -> Vec<Cells> {
    let integer =
        |of: &dyn Fn(&CaseRecord) -> u64| Cells::Integer(records.iter().map(|r| i64::try_from(of(r)).unwrap_or(i64::MAX)).collect());
    let mut cells = vec![
        integer(&|r| r.case as u64),
        integer(&|r| u64::from(r.failure.is_none())),
        Cells::Text(records.iter().map(|r| r.failure.clone().unwrap_or_default()).collect()),
        Cells::Real(records.iter().map(|r| r.end_time_s).collect()),
        integer(&|r| r.steps),
    ];
    for (index, size) in sizes.text.iter().enumerate() {
        cells.push(match size {
            None => Cells::Real(records.iter().map(|r| r.values[index].as_f64().unwrap_or(f64::NAN)).collect()),
            Some(_) => Cells::Text(records.iter().map(|r| plain(&r.values[index])).collect()),
        });
    }
    for (index, load) in header.loads.iter().enumerate() {
        let width = load.units.len();
        for sense in Sense::BOTH {
            let (mut values, mut times, mut all) = (Vec::new(), Vec::new(), Vec::new());
            for record in records {
                for component in 0..width {
                    match record.loads.get(index) {
                        Some(extremes) => {
                            let (time, load) = extremes.at(width, sense, component);
                            values.push(load[component]);
                            times.push(time);
                            all.extend_from_slice(load);
                        }
                        None => {
                            values.push(f64::NAN);
                            times.push(f64::NAN);
                            all.extend(std::iter::repeat_n(f64::NAN, width));
                        }
                    }
                }
            }
            cells.extend([Cells::Real(values), Cells::Real(times), Cells::Real(all)]);
        }
    }
    cells
}

/// The envelope of one load; none if no case is complete.
fn arrays(load: &LoadRecord, envelope: &LoadEnvelope) -> Vec<Array> {
    let width = load.units.len();
    if envelope.rows.len() != 2 * width {
        return Vec::new();
    }
    let mut arrays = Vec::new();
    for (sense, rows) in Sense::BOTH.into_iter().zip(envelope.rows.chunks(width)) {
        let name = sense.name();
        let mut add = |dataset: String, shape: Vec<usize>, cells, attributes| {
            arrays.push(Array { path: format!("envelope/{}", path_of(load, &dataset)), shape, cells, attributes });
        };
        add(name.to_owned(), vec![width], Cells::Real(rows.iter().map(|r| r.value).collect()), meaning(load));
        let cases = rows.iter().map(|r| i64::try_from(r.case).unwrap_or(i64::MAX)).collect();
        add(format!("{name}_case"), vec![width], Cells::Integer(cases), vec![("meaning", "number of the case, counted from 1".into())]);
        add(format!("{name}_time"), vec![width], Cells::Real(rows.iter().map(|r| r.time_s).collect()), vec![("unit", "s".into())]);
        let all = rows.iter().flat_map(|r| r.load.iter().copied()).collect();
        let at = format!("row i holds all components at the {name} of component i");
        add(format!("load_at_{name}"), vec![width, width], Cells::Real(all), [meaning(load), vec![("meaning", at)]].concat());
    }
    arrays
}
