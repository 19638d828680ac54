//! What leaves a finished run for other programs: motion, stress and loads as XDMF ([`motion`]), histories as a table ([`history`]),
//! and the modes of a modal file as XDMF ([`modes`]).
//!
//! Everything is streamed: memory holds one block of output times and one field of one time, whatever the length of the run.

pub mod error;
pub mod history;
pub mod modal_source;
pub mod modes;
pub mod motion;
#[cfg(feature = "parquet")]
mod parquet;
mod xdmf;

pub use error::ExportError;
pub use history::{TableFormat, write_table};
pub use modal_source::ModalSource;
pub use modes::{write_modes, write_series};
pub use motion::{Motion, write_motion};

use std::path::{Path, PathBuf};

/// Output times read at a time, as many as the file keeps in a block.
const BLOCK_ROWS: usize = crate::io::results_file::BLOCK_ROWS;

/// What an export has written.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Exported {
    /// Files in the order of writing.
    pub files: Vec<PathBuf>,
    /// Output times in them.
    pub times: usize,
    /// What could not be given, in words.
    pub left_out: Vec<String>,
}

/// Refuses to write over an input.
///
/// # Errors
/// If `target` is one of `inputs`, by whichever name.
pub fn check_target(target: &Path, inputs: &[PathBuf]) -> Result<(), ExportError> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let own = real(target);
    if inputs.iter().any(|input| real(input) == own) {
        return Err(ExportError::OverInput { file: target.to_owned() });
    }
    Ok(())
}
