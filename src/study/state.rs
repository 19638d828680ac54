//! The state file of a study: one JSON object per finished run, appended as it finishes, so that an interrupted study goes on.
//!
//! A line counts for a run only if its key is that run's: a digest of all that decides the result. What else is in the file is left
//! alone, a last line that was cut short included.

use super::error::ChannelError;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// One finished run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Digest of all that decides the result.
    pub key: String,
    /// The setting, for readers of the file.
    pub what: String,
    /// Wall-clock time (s).
    pub wall_s: f64,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected_steps: u64,
    /// Evaluations of the dynamics, output included.
    pub evaluations: u64,
    /// By channel; none for silent ones, empty if the run failed.
    pub errors: Vec<Option<ChannelError>>,
    /// Why the run has no errors.
    pub failure: Option<String>,
}

/// Why a state file cannot be used.
#[derive(Debug, Error)]
pub enum StateError {
    /// It cannot be read or made.
    #[error("--state {}: cannot be opened: {source}; name a file in a folder that exists and may be written", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It holds something else.
    #[error("--state {}: no line of it is of a study; it is left as it is, name another file", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// It can no longer be written.
    #[error("--state {}: a finished run cannot be written: {source}; what was written before is kept", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Finished runs, on disk if there is a file.
#[derive(Debug, Default)]
pub struct StateFile {
    file: Option<(PathBuf, File)>,
    known: HashMap<String, Vec<RunRecord>>,
}

impl StateFile {
    /// Opens the file at `path`, made if need be, and reads what is in it.
    ///
    /// # Errors
    /// If it cannot be opened, or holds something else.
    pub fn open(path: &Path) -> Result<Self, StateError> {
        let fail = |source| StateError::Open { path: path.to_owned(), source };
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(path).map_err(fail)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(fail)?;
        let text = String::from_utf8_lossy(&bytes);
        let records: Vec<RunRecord> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        // a single line may be the half-written first one
        if records.is_empty() && text.lines().count() > 1 || (records.is_empty() && !text.is_empty() && !text.starts_with("{\"key\"")) {
            return Err(StateError::Foreign { path: path.to_owned() });
        }
        if !text.is_empty() && !text.ends_with('\n') {
            // the next line must not run into one that was cut short
            file.seek(SeekFrom::End(0)).and_then(|_| file.write_all(b"\n")).map_err(fail)?;
        }
        let mut state = Self { file: Some((path.to_owned(), file)), known: HashMap::new() };
        records.into_iter().for_each(|record| state.remember(record));
        Ok(state)
    }

    /// Path of the file, if there is one.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        self.file.as_ref().map(|(path, _)| path.as_path())
    }

    /// Finished runs of that key.
    #[must_use]
    pub fn runs(&self, key: &str) -> &[RunRecord] {
        self.known.get(key).map_or(&[], Vec::as_slice)
    }

    /// Keeps a finished run, on disk before this returns.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn keep(&mut self, record: RunRecord) -> Result<(), StateError> {
        if let Some((path, file)) = &mut self.file {
            let written = serde_json::to_string(&record).map_err(std::io::Error::from);
            let written = written.and_then(|line| file.write_all(format!("{line}\n").as_bytes())).and_then(|()| file.flush());
            written.map_err(|source| StateError::Write { path: path.clone(), source })?;
        }
        self.remember(record);
        Ok(())
    }

    fn remember(&mut self, record: RunRecord) {
        self.known.entry(record.key.clone()).or_default().push(record);
    }
}
