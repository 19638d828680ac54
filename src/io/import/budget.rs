//! How much a file may make the importer hold: a bound in proportion to the bytes that were handed over.

use super::error::{ImportError, refused};
use std::cell::Cell;
use std::path::Path;

/// What a small file may unpack to (bytes).
const BASE: u64 = 16 << 20;
/// Bytes per byte of the files; mode shapes of plates, half of whose components are nearly zero, pack about 20 to 1.
const RATIO: u64 = 64;

/// Bytes that may be read at once, and bytes that are kept.
#[derive(Debug)]
pub(super) struct Budget {
    limit: Cell<u64>,
    kept: Cell<u64>,
}

impl Budget {
    /// For a file of that length.
    pub fn new(file_bytes: u64) -> Self {
        Self { limit: Cell::new(BASE.saturating_add(file_bytes.saturating_mul(RATIO))), kept: Cell::new(0) }
    }

    /// More room for a further file.
    pub fn extend(&self, file_bytes: u64) {
        self.limit.set(self.limit.get().saturating_add(file_bytes.saturating_mul(RATIO)));
    }

    /// Refuses an array that is too large for the files it comes from.
    pub fn check(&self, file: &Path, object: &str, numbers: usize) -> Result<(), ImportError> {
        self.judge(file, object, (numbers as u64).saturating_mul(8))
    }

    /// As [`Self::check`] for what stays in memory, together with all that was kept before: objects of a file may all be links to one array.
    pub fn keep(&self, file: &Path, object: &str, numbers: usize) -> Result<(), ImportError> {
        self.kept.set(self.kept.get().saturating_add((numbers as u64).saturating_mul(8)));
        self.judge(file, object, self.kept.get())
    }

    fn judge(&self, file: &Path, object: &str, bytes: u64) -> Result<(), ImportError> {
        let limit = self.limit.get();
        if bytes <= limit {
            return Ok(());
        }
        let remedy = "the file is damaged, or packed beyond what mode shapes need: write it again";
        Err(refused(file, object, format!("{bytes} bytes"), format!("at most {limit} bytes from files of this size"), remedy))
    }
}
