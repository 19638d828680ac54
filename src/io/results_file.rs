//! Results files: time histories by name in HDF5, schema `pliant-results` 1.0. The layer above says what is in them.
//!
//! Every series is a dataset with one row per output time. Rows are appended in blocks; after each block the file is flushed, so that a
//! run that is killed leaves a readable file with all but the last blocks. Texts are of fixed length.
//!
//! A chunk is written once. One that grew would move in the file, and its old place be given to others before the index on disk says so: a
//! kill in between would take rows that were there already.

use super::error::ModalFileError;
use super::guard::GuardedFile;
use super::whole_chunks::whole_chunks;
use hdf5::types::{FixedUnicode, TypeDescriptor};
use hdf5::{Dataset, Extent, Group, Location, SimpleExtents};
use ndarray::ArrayView2;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Most rows per chunk, and so of the blocks that cost least: the Huffman trees of small chunks cost more than their content.
pub const BLOCK_ROWS: usize = 256;
/// Least rows per chunk, however wide a row is.
const LEAST_BLOCK_ROWS: usize = 64;
/// A block of more than [`LEAST_BLOCK_ROWS`] takes at most this (bytes).
const BLOCK_BYTES: usize = 4 << 20;
/// Shuffled doubles of a motion shrink to three quarters at any level; the first costs least.
const DEFLATE_LEVEL: u8 = 1;
/// Longest text attribute (bytes).
const TEXT_LIMIT: usize = 4096;

/// Why a results file is not, or no longer, written.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum ResultsError {
    /// The file cannot be made.
    #[error("results file \"{}\": cannot be created: {cause}; name a file in a folder that exists and may be written", file.display())]
    Create {
        /// Path.
        file: PathBuf,
        /// What the system says.
        cause: String,
    },
    /// A write failed.
    #[error(
        "results file \"{}\": writing stopped after {rows} output times: {cause}; look for a full disk; what was written before is kept",
        file.display()
    )]
    Write {
        /// Path.
        file: PathBuf,
        /// Rows that are in the file.
        rows: u64,
        /// What the system says.
        cause: String,
    },
    /// The file cannot be read.
    #[error("{cause}; name a file that pliant run --out has written for this scene")]
    Read {
        /// What is wrong.
        cause: String,
    },
}

impl ResultsError {
    /// Output times that are in the file.
    #[must_use]
    pub fn rows(&self) -> u64 {
        if let Self::Write { rows, .. } = self { *rows } else { 0 }
    }
}

/// One time history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SeriesSpec {
    /// Path of groups and dataset, each name escaped by [`escape`].
    pub path: String,
    /// Numbers per output time, at least one; none for one number per time without a second dimension.
    pub width: Option<usize>,
    /// Names and texts.
    pub attributes: Vec<(&'static str, String)>,
}

/// A small fixed group of texts and bytes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Preface {
    /// Attributes of the root.
    pub attributes: Vec<(&'static str, String)>,
    /// Datasets of bytes.
    pub bytes: Vec<(String, Vec<u8>)>,
    /// Groups with attributes.
    pub groups: Vec<(String, Vec<(&'static str, String)>)>,
    /// Matrices.
    pub matrices: Vec<(String, nalgebra::DMatrix<f64>)>,
}

/// A name as a single step of a path: `%`, `/` and the names `.` and `..` are percent-encoded.
#[must_use]
pub fn escape(name: &str) -> String {
    match name {
        "." | ".." => name.replace('.', "%2E"),
        other => other.replace('%', "%25").replace('/', "%2F").replace('\0', "%00"),
    }
}

/// A results file that is being written.
#[derive(Debug)]
pub struct ResultsFile {
    path: PathBuf,
    file: hdf5::File,
    series: Vec<(Dataset, Option<usize>)>,
    /// Numbers per output time of all series together.
    row: usize,
    block_rows: usize,
    /// One series of a block.
    columns: Vec<f64>,
    written: usize,
}

impl ResultsFile {
    /// Makes the file with empty series; a file of that name is replaced.
    ///
    /// # Errors
    /// If the file cannot be made.
    pub fn create(path: &Path, preface: &Preface, series: &[SeriesSpec]) -> Result<Self, ResultsError> {
        let fail = |cause: String| ResultsError::Create { file: path.to_owned(), cause };
        if std::fs::metadata(path).is_ok_and(|m| !m.is_file()) {
            return Err(fail("not a regular file".into()));
        }
        // the system's own words on a missing folder or a read-only file are clearer than those of libhdf5
        std::fs::OpenOptions::new().write(true).create(true).truncate(false).open(path).map_err(|e| fail(e.to_string()))?;
        hdf5::silence_errors(true);
        let row = series.iter().map(|s| s.width.unwrap_or(1)).sum::<usize>();
        let fitting = (BLOCK_BYTES / (size_of::<f64>() * row.max(1))).clamp(LEAST_BLOCK_ROWS, BLOCK_ROWS);
        // a power of two, so that readers of BLOCK_ROWS at a time meet whole chunks
        let block_rows = 1 << fitting.ilog2();
        let made = || -> hdf5::Result<(hdf5::File, Vec<_>)> {
            let file = whole_chunks().create(path)?;
            write_preface(&file, preface)?;
            let datasets = series.iter().map(|spec| Ok((create_series(&file, spec, block_rows)?, spec.width)));
            let datasets = datasets.collect::<hdf5::Result<Vec<_>>>()?;
            file.flush()?;
            Ok((file, datasets))
        };
        let (file, datasets) = made().map_err(|e| fail(e.to_string()))?;
        Ok(Self { path: path.to_owned(), file, series: datasets, row, block_rows, columns: Vec::new(), written: 0 })
    }

    /// The path as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Rows that are in the file.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.written as u64
    }

    /// Rows per chunk, at most [`BLOCK_ROWS`].
    #[must_use]
    pub fn block_rows(&self) -> usize {
        self.block_rows
    }

    /// Appends rows, one after the other, each with the numbers of all series in their order, and brings the file up to date. All but the
    /// last append fill chunks, [`Self::block_rows`] rows.
    ///
    /// # Errors
    /// If a write fails.
    pub fn append(&mut self, rows: &[f64]) -> Result<(), ResultsError> {
        self.write_rows(rows).map_err(|e| self.failed(&e))
    }

    fn failed(&self, error: &hdf5::Error) -> ResultsError {
        ResultsError::Write { file: self.path.clone(), rows: self.rows(), cause: error.to_string() }
    }

    fn write_rows(&mut self, block: &[f64]) -> hdf5::Result<()> {
        let rows = block.len().checked_div(self.row).unwrap_or(0);
        if rows == 0 {
            return Ok(());
        }
        let end = self.written + rows;
        let mut offset = 0;
        for (dataset, width) in &self.series {
            let count = width.unwrap_or(1);
            self.columns.clear();
            self.columns.extend(block.chunks_exact(self.row).flat_map(|row| &row[offset..offset + count]));
            match *width {
                None => {
                    dataset.resize(end)?;
                    dataset.write_slice(self.columns.as_slice(), self.written..end)?;
                }
                Some(width) => {
                    dataset.resize((end, width))?;
                    let values = ArrayView2::from_shape((rows, width), &self.columns).map_err(|e| hdf5::Error::from(e.to_string()))?;
                    dataset.write_slice(values, (self.written..end, ..))?;
                }
            }
            offset += count;
        }
        self.file.flush()?;
        self.written = end;
        Ok(())
    }

    /// Writes how the run ended and closes the file; returns the number of rows.
    ///
    /// # Errors
    /// If a write fails.
    pub fn finish(self, completed: bool, end_time: f64) -> Result<u64, ResultsError> {
        let ended = || -> hdf5::Result<()> {
            self.file.new_attr::<u8>().create("completed")?.write_scalar(&u8::from(completed))?;
            self.file.new_attr::<f64>().create("end_time")?.write_scalar(&end_time)?;
            self.file.flush()
        };
        ended().map_err(|e| self.failed(&e))?;
        Ok(self.rows())
    }
}

/// Reads series by path and width, each in C order, all of them finite and with one row per output time.
///
/// # Errors
/// If the file cannot be opened, or a series is not there, has another width or numbers that are not finite.
pub fn read_series(path: &Path, wanted: &[(String, Option<usize>)]) -> Result<Vec<Vec<f64>>, ResultsError> {
    let fail = |error: ModalFileError| ResultsError::Read {
        cause: match error {
            ModalFileError::Open { cause, .. } => format!("cannot be opened: {cause}"),
            ModalFileError::Missing { object, .. } => format!("{object} is not in it"),
            ModalFileError::WrongShape { object, found, expected, .. } => format!("{object} has the shape {found}, not {expected}"),
            other => other.to_string(),
        },
    };
    let file = GuardedFile::open_whole_chunks(path).map_err(fail)?;
    let mut rows = None;
    let mut read = |(name, width): &(String, Option<usize>)| {
        let mut shape = vec![rows];
        shape.extend(width.map(Some));
        let dataset = file.dataset(name)?.expect_shape(&shape, "one row per output time")?;
        rows = Some(dataset.shape[0]);
        dataset.read_f64()
    };
    wanted.iter().map(|w| read(w).map_err(fail)).collect()
}

pub(super) fn write_preface(file: &hdf5::File, preface: &Preface) -> hdf5::Result<()> {
    preface.attributes.iter().try_for_each(|(name, text)| write_text(file, name, text))?;
    for (path, bytes) in &preface.bytes {
        let (group, name) = parent(file, path)?;
        group.new_dataset_builder().with_data(bytes.as_slice()).obj_track_times(false).create(name)?;
    }
    for (path, attributes) in &preface.groups {
        let (above, name) = parent(file, path)?;
        let group = if above.link_exists(name) { above.group(name)? } else { new_group(&above, name)? };
        attributes.iter().try_for_each(|(name, text)| write_text(&group, name, text))?;
    }
    for (path, matrix) in &preface.matrices {
        let (group, name) = parent(file, path)?;
        // rows first in the file, columns first in memory
        let rows = matrix.transpose();
        group
            .new_dataset::<f64>()
            .shape((matrix.nrows(), matrix.ncols()))
            .obj_track_times(false)
            .create(name)?
            .write_raw(rows.as_slice())?;
    }
    Ok(())
}

/// A group without the time at which it was made: the same content shall make the same bytes.
fn new_group(above: &Group, name: &str) -> hdf5::Result<Group> {
    above.create_group_builder().obj_track_times(false).create(name)
}

/// The group that holds the last step of `path`, made if need be, and that step.
pub(super) fn parent<'p>(file: &hdf5::File, path: &'p str) -> hdf5::Result<(Group, &'p str)> {
    let (groups, name) = path.rsplit_once('/').unwrap_or(("", path));
    let mut group = file.as_group()?;
    for step in groups.split('/').filter(|step| !step.is_empty()) {
        group = if group.link_exists(step) { group.group(step)? } else { new_group(&group, step)? };
    }
    Ok((group, name))
}

fn create_series(file: &hdf5::File, spec: &SeriesSpec, rows: usize) -> hdf5::Result<Dataset> {
    let (group, name) = parent(file, &spec.path)?;
    let mut extents = vec![Extent::resizable(0)];
    extents.extend(spec.width.map(Extent::fixed));
    let chunk: Vec<usize> = std::iter::once(rows).chain(spec.width).collect();
    let builder = group.new_dataset::<f64>().shape(SimpleExtents::from_vec(extents));
    let dataset = builder.chunk(chunk).shuffle().deflate(DEFLATE_LEVEL).fletcher32().create(name)?;
    spec.attributes.iter().try_for_each(|(name, text)| write_text(&dataset, name, text))?;
    Ok(dataset)
}

/// A text attribute of fixed length, cut at 4 KiB.
pub(super) fn write_text(location: &Location, name: &str, text: &str) -> hdf5::Result<()> {
    let mut end = text.len().min(TEXT_LIMIT);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let text = text[..end].replace('\0', " ");
    let value: FixedUnicode<TEXT_LIMIT> = text.parse().map_err(|_| hdf5::Error::from("a text with a NUL"))?;
    let attribute = location.new_attr_builder().empty_as(TypeDescriptor::FixedUnicode(text.len().max(1))).create(name)?;
    attribute.as_writer().write_scalar(&value)
}
