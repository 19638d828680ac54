//! Histories of a run as one table: a row per output time, a column per number.
//!
//! A column is named by the path of its series, its component and its unit: `hinges/drive/load_moment/x (N m)`.

use super::error::ExportError;
use super::modal_source::unescape;
use super::{BLOCK_ROWS, Exported, check_target};
use crate::io::ResultsReader;
use crate::io::results_reader::{Column, Series};
use std::ops::Range;
use std::path::Path;

/// What kind of table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated text, numbers that read back to the same f64.
    Csv,
    /// Apache Parquet: one f64 column per number, uncompressed.
    Parquet,
}

/// Writes all series of `results` to `target`, every `every`-th output time from the first on.
///
/// # Errors
/// If the results file cannot be read, the target is the results file itself, or cannot be written.
pub fn write_table(results: &ResultsReader, format: TableFormat, target: &Path, every: usize) -> Result<Exported, ExportError> {
    check_target(target, &[results.path().to_owned()])?;
    let every = every.max(1);
    let table = Table::of(results)?;
    match format {
        TableFormat::Csv => write_csv(&table, target, every)?,
        #[cfg(feature = "parquet")]
        TableFormat::Parquet => super::parquet::write(&table, target, every)?,
        #[cfg(not(feature = "parquet"))]
        TableFormat::Parquet => {
            let cause = "this build has no Parquet writer; build with the feature \"parquet\" or write --format csv".to_owned();
            return Err(ExportError::Write { file: target.to_owned(), cause });
        }
    }
    Ok(Exported { files: vec![target.to_owned()], times: results.rows.div_ceil(every), left_out: Vec::new() })
}

/// One series with the names of its columns.
pub(super) struct Block<'r> {
    pub names: Vec<String>,
    column: Column<'r>,
}

impl Block<'_> {
    /// Rows in C order: as many numbers per row as there are names.
    pub fn read(&self, rows: Range<usize>) -> Result<Vec<f64>, ExportError> {
        Ok(self.column.read(rows)?)
    }
}

/// All series of a file.
pub(super) struct Table<'r> {
    pub blocks: Vec<Block<'r>>,
    pub rows: usize,
    /// Name of the scene.
    #[cfg(feature = "parquet")]
    pub scene: &'r str,
}

impl<'r> Table<'r> {
    fn of(results: &'r ResultsReader) -> Result<Self, ExportError> {
        let block = |series: &Series| Ok(Block { names: names(series), column: results.column(&series.path, series.width)? });
        let blocks = results.series.iter().map(block).collect::<Result<_, ExportError>>()?;
        Ok(Self {
            blocks,
            rows: results.rows,
            #[cfg(feature = "parquet")]
            scene: &results.scene_name,
        })
    }
}

/// Names of the columns of a series.
fn names(series: &Series) -> Vec<String> {
    let path = unescape(&series.path);
    let listed = |name: &str| series.text(name).map(|text| text.split(", ").collect::<Vec<_>>()).unwrap_or_default();
    let (components, units) = (listed("components"), listed("unit"));
    let name = |i: usize, width: usize| {
        let unit = if units.len() == width { units.get(i) } else { units.first() };
        let unit = unit.filter(|unit| !unit.is_empty()).map_or(String::new(), |unit| format!(" ({unit})"));
        match (series.width, components.get(i)) {
            (None, _) => format!("{path}{unit}"),
            (Some(_), Some(component)) if components.len() == width => format!("{path}/{component}{unit}"),
            (Some(_), _) => format!("{path}/{}{unit}", i + 1),
        }
    };
    let width = series.width.unwrap_or(1);
    (0..width).map(|i| name(i, width)).collect()
}

fn write_csv(table: &Table<'_>, target: &Path, every: usize) -> Result<(), ExportError> {
    let fail = |cause: String| ExportError::Write { file: target.to_owned(), cause };
    let mut writer = csv::Writer::from_path(target).map_err(|e| fail(e.to_string()))?;
    writer.write_record(table.blocks.iter().flat_map(|b| &b.names)).map_err(|e| fail(e.to_string()))?;
    for start in (0..table.rows).step_by(BLOCK_ROWS) {
        let rows = start..table.rows.min(start + BLOCK_ROWS);
        let blocks = table.blocks.iter().map(|b| Ok((b.names.len(), b.read(rows.clone())?)));
        let blocks = blocks.collect::<Result<Vec<_>, ExportError>>()?;
        for (i, _) in rows.enumerate().filter(|(_, row)| row.is_multiple_of(every)) {
            let numbers = blocks.iter().flat_map(|(width, values)| &values[i * width..(i + 1) * width]);
            // the debug format is the shortest that reads back to the same number, with an exponent where that is shorter
            writer.write_record(numbers.map(|x| format!("{x:?}"))).map_err(|e| fail(e.to_string()))?;
        }
    }
    writer.flush().map_err(|e| fail(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(path: &str, width: Option<usize>, texts: &[(&'static str, &str)]) -> Series {
        Series { path: path.into(), width, texts: texts.iter().map(|(name, text)| (*name, (*text).to_owned())).collect() }
    }

    #[test]
    fn columns_are_named_by_path_component_and_unit() {
        let moment = series("hinges/left%2Fdrive/load_moment", Some(3), &[("unit", "N m"), ("components", "x, y, z")]);
        assert_eq!(names(&moment)[1], "hinges/left/drive/load_moment/y (N m)");
        let mixed = series("hinges/slide/position", Some(2), &[("unit", "rad, m")]);
        assert_eq!(names(&mixed), ["hinges/slide/position/1 (rad)", "hinges/slide/position/2 (m)"]);
        assert_eq!(names(&series("time", None, &[("unit", "s")])), ["time (s)"]);
    }
}
