//! The results file of a campaign: arrays with one row per case in HDF5, and small arrays beside them. The layer above says what is in them.
//!
//! Rows are written in blocks and not kept, so memory holds one block. The file takes its name only when it is complete. Nothing in it
//! depends on the time or the machine: the same content makes the same bytes.

use super::results_file::{Preface, parent, write_preface, write_text};
use super::whole_chunks::whole_chunks;
use hdf5::types::{FixedUnicode, TypeDescriptor};
use hdf5::{Dataset, H5Type};
use ndarray::ArrayViewD;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Rows per block, which is also the chunk length.
pub const BLOCK_ROWS: usize = 256;
/// Longest text of a row (bytes); longer ones are cut.
pub const TEXT_LIMIT: usize = 1024;

/// Why the results file of a campaign is not written.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("results file {}: cannot be written: {cause}; name a file in a folder that exists and may be written, on a disk with room", file.display())]
pub struct CampaignFileError {
    /// The file.
    pub file: PathBuf,
    /// What the system says.
    pub cause: String,
}

/// Numbers or texts in C order.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Numbers.
    Real(Vec<f64>),
    /// Whole numbers.
    Integer(Vec<i64>),
    /// Texts, one per row.
    Text(Vec<String>),
}

/// What the rows of an array hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// Numbers.
    Real,
    /// Whole numbers.
    Integer,
    /// A text of at most that many bytes.
    Text(usize),
}

/// An array with one row per case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Path of groups and dataset, each name escaped.
    pub path: String,
    /// Shape of a row; empty for one value.
    pub shape: Vec<usize>,
    /// What it holds.
    pub kind: CellKind,
    /// Names and texts.
    pub attributes: Vec<(&'static str, String)>,
}

/// An array of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Path of groups and dataset, each name escaped.
    pub path: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// What is in it, numbers.
    pub cells: Cells,
    /// Names and texts.
    pub attributes: Vec<(&'static str, String)>,
}

/// A file that is being written.
#[derive(Debug)]
pub struct CampaignFile {
    path: PathBuf,
    partial: tempfile::TempPath,
    file: hdf5::File,
    columns: Vec<(Dataset, Vec<usize>)>,
}

impl CampaignFile {
    /// Makes the file beside `path`, with arrays of `rows` rows.
    ///
    /// # Errors
    /// If the file cannot be made.
    pub fn create(path: &Path, preface: &Preface, rows: usize, columns: &[Column]) -> Result<Self, CampaignFileError> {
        let fail = |cause: String| CampaignFileError { file: path.to_owned(), cause };
        if std::fs::metadata(path).is_ok_and(|m| !m.is_file()) {
            return Err(fail("not a regular file".into()));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // the system's own words on a missing folder are clearer than those of libhdf5
        let partial = tempfile::Builder::new().prefix(".campaign").suffix(".partial.h5").tempfile_in(folder);
        let partial = partial.map_err(|e| fail(e.to_string()))?.into_temp_path();
        hdf5::silence_errors(true);
        let make = || -> hdf5::Result<(hdf5::File, Vec<_>)> {
            let file = whole_chunks().with_fcpl(|p| p.obj_track_times(false)).create(&partial)?;
            write_preface(&file, preface)?;
            let made = columns.iter().map(|column| Ok((create_column(&file, column, rows)?, column.shape.clone())));
            let made = made.collect::<hdf5::Result<Vec<_>>>()?;
            Ok((file, made))
        };
        let (file, columns) = make().map_err(|e| fail(e.to_string()))?;
        Ok(Self { path: path.to_owned(), partial, file, columns })
    }

    /// Writes some rows of all columns, beginning at row `start`.
    ///
    /// # Errors
    /// If a write fails.
    pub fn write(&mut self, start: usize, rows: usize, cells: &[Cells]) -> Result<(), CampaignFileError> {
        let write = || -> hdf5::Result<()> {
            for ((dataset, shape), cells) in self.columns.iter().zip(cells) {
                let whole: Vec<usize> = std::iter::once(rows).chain(shape.iter().copied()).collect();
                let texts: Vec<FixedUnicode<TEXT_LIMIT>>;
                match cells {
                    Cells::Real(values) => write_rows(dataset, values, &whole, start)?,
                    Cells::Integer(values) => write_rows(dataset, values, &whole, start)?,
                    Cells::Text(values) => {
                        texts = values.iter().map(|text| fixed(text)).collect::<hdf5::Result<_>>()?;
                        write_rows(dataset, &texts, &whole, start)?;
                    }
                }
            }
            Ok(())
        };
        write().map_err(|e| CampaignFileError { file: self.path.clone(), cause: e.to_string() })
    }

    /// Writes the small arrays, closes the file and gives it its name.
    ///
    /// # Errors
    /// If a write fails.
    pub fn finish(self, arrays: &[Array]) -> Result<(), CampaignFileError> {
        let Self { path, partial, file, columns } = self;
        let fail = |cause: String| CampaignFileError { file: path.clone(), cause };
        let write = || -> hdf5::Result<()> {
            for array in arrays {
                let (group, name) = parent(&file, &array.path)?;
                let dataset = match &array.cells {
                    Cells::Real(values) => create_array(&group, name, values, &array.shape)?,
                    Cells::Integer(values) => create_array(&group, name, values, &array.shape)?,
                    Cells::Text(_) => return Err("a text outside the rows".into()),
                };
                array.attributes.iter().try_for_each(|(name, text)| write_text(&dataset, name, text))?;
            }
            file.flush()
        };
        write().map_err(|e| fail(e.to_string()))?;
        drop(columns);
        file.close().map_err(|e| fail(e.to_string()))?;
        // a temporary file may be read by its owner alone
        let permissions = std::fs::metadata(&path).map(|m| m.permissions());
        if let Err(e) = permissions.or_else(|_| readable()).and_then(|p| std::fs::set_permissions(&partial, p)) {
            return Err(fail(e.to_string()));
        }
        partial.persist(&path).map_err(|e| fail(e.error.to_string()))
    }
}

/// Permissions of a file that the process makes in the usual way.
fn readable() -> std::io::Result<std::fs::Permissions> {
    let folder = tempfile::tempdir()?;
    std::fs::File::create(folder.path().join("probe"))?.metadata().map(|m| m.permissions())
}

fn create_column(file: &hdf5::File, column: &Column, rows: usize) -> hdf5::Result<Dataset> {
    let (group, name) = parent(file, &column.path)?;
    let element = match column.kind {
        CellKind::Real => f64::type_descriptor(),
        CellKind::Integer => i64::type_descriptor(),
        CellKind::Text(length) => TypeDescriptor::FixedUnicode(length.clamp(1, TEXT_LIMIT)),
    };
    let shape: Vec<usize> = std::iter::once(rows).chain(column.shape.iter().copied()).collect();
    let chunk: Vec<usize> = std::iter::once(rows.clamp(1, BLOCK_ROWS)).chain(column.shape.iter().copied()).collect();
    let builder = group.new_dataset_builder().empty_as(element).shape(shape).obj_track_times(false);
    let dataset = builder.chunk(chunk).shuffle().deflate(4).fletcher32().create(name)?;
    column.attributes.iter().try_for_each(|(name, text)| write_text(&dataset, name, text))?;
    Ok(dataset)
}

fn create_array<T: H5Type>(group: &hdf5::Group, name: &str, values: &[T], shape: &[usize]) -> hdf5::Result<Dataset> {
    let dataset = group.new_dataset::<T>().shape(shape).obj_track_times(false).create(name)?;
    dataset.write_raw(values)?;
    Ok(dataset)
}

fn write_rows<T: H5Type>(dataset: &Dataset, values: &[T], shape: &[usize], start: usize) -> hdf5::Result<()> {
    let view = ArrayViewD::from_shape(shape, values).map_err(|e| hdf5::Error::from(e.to_string()))?;
    let mut selection = vec![hdf5::SliceOrIndex::from(start..start + shape[0])];
    selection.extend(shape[1..].iter().map(|_| hdf5::SliceOrIndex::from(..)));
    dataset.as_writer().write_slice(view, hdf5::Hyperslab::from(selection))
}

/// A text of fixed length, cut where it is too long; a NUL would end it.
fn fixed(text: &str) -> hdf5::Result<FixedUnicode<TEXT_LIMIT>> {
    let mut end = text.len().min(TEXT_LIMIT);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text[..end].replace('\0', " ").parse().map_err(|_| hdf5::Error::from("a text with a NUL"))
}
