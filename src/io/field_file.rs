//! The arrays behind an exported XDMF file: one plain dataset per field and time, since its readers cannot slice.
//!
//! An array is written as soon as it is known and not kept, so memory holds one field of one time.

use hdf5::types::H5Type;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Rows per chunk.
const CHUNK_ROWS: usize = 1 << 14;
/// Smaller arrays stay contiguous (bytes): a chunk index would be larger than what it saves.
const COMPRESS_ABOVE: usize = 4096;

/// Why an array file is not, or no longer, written.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("{}: cannot be written: {cause}; name a folder that exists and may be written, on a disk with room", file.display())]
pub struct FieldFileError {
    /// The file.
    pub file: PathBuf,
    /// What the system says.
    pub cause: String,
}

/// An HDF5 file of named arrays.
#[derive(Debug)]
pub struct FieldFile {
    path: PathBuf,
    file: hdf5::File,
    bytes: u64,
}

impl FieldFile {
    /// Makes the file; one of that name is replaced.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn create(path: &Path) -> Result<Self, FieldFileError> {
        let fail = |cause: String| FieldFileError { file: path.to_owned(), cause };
        // the system's own words are clearer than those of libhdf5
        std::fs::OpenOptions::new().write(true).create(true).truncate(false).open(path).map_err(|e| fail(e.to_string()))?;
        hdf5::silence_errors(true);
        let file = hdf5::File::create(path).map_err(|e| fail(e.to_string()))?;
        Ok(Self { path: path.to_owned(), file, bytes: 0 })
    }

    /// The path as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of all arrays before compression.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Writes rows of `W` numbers to `group/name`, as shape (rows, W).
    ///
    /// # Errors
    /// If the write fails.
    pub fn write_rows<T: H5Type + Copy, const W: usize>(&mut self, group: &str, name: &str, rows: &[[T; W]]) -> Result<(), FieldFileError> {
        self.write(group, name, rows.as_flattened(), &[rows.len(), W])
    }

    /// Writes plain numbers to `group/name`.
    ///
    /// # Errors
    /// If the write fails.
    pub fn write_scalars<T: H5Type + Copy>(&mut self, group: &str, name: &str, values: &[T]) -> Result<(), FieldFileError> {
        self.write(group, name, values, &[values.len()])
    }

    fn write<T: H5Type + Copy>(&mut self, group: &str, name: &str, values: &[T], shape: &[usize]) -> Result<(), FieldFileError> {
        let made = || -> hdf5::Result<()> {
            let mut parent = self.file.as_group()?;
            for step in group.split('/') {
                parent = if parent.link_exists(step) { parent.group(step)? } else { parent.create_group(step)? };
            }
            let builder = parent.new_dataset::<T>().shape(shape);
            let dataset = if size_of_val(values) > COMPRESS_ABOVE {
                let chunk: Vec<usize> = std::iter::once(shape[0].min(CHUNK_ROWS)).chain(shape.iter().skip(1).copied()).collect();
                builder.chunk(chunk).shuffle().deflate(1).create(name)?
            } else {
                builder.create(name)?
            };
            dataset.write_raw(values)
        };
        made().map_err(|e| FieldFileError { file: self.path.clone(), cause: e.to_string() })?;
        self.bytes += size_of_val(values) as u64;
        Ok(())
    }

    /// Closes the file.
    ///
    /// # Errors
    /// If what was written does not reach the disk.
    pub fn finish(self) -> Result<u64, FieldFileError> {
        self.file.flush().map_err(|e| FieldFileError { file: self.path.clone(), cause: e.to_string() })?;
        Ok(self.bytes)
    }
}
