//! Which modal file belongs to which body of a finished run: by the digest that the run has kept, wherever the file is now.

use super::error::ExportError;
use crate::io::results_reader::UsedModalFile;
use crate::io::{ModalFile, ResultsReader};
use std::path::{Path, PathBuf};

/// Places to look for modal files besides where the run found them.
#[derive(Debug, Clone, Default)]
pub struct ModalSource {
    /// Files by content, not by name.
    pub files: Vec<PathBuf>,
}

impl ModalSource {
    /// Opens the modal file of a body.
    ///
    /// # Errors
    /// If no file has its digest, or one of [`Self::files`] is no modal file.
    pub fn open(&self, results: &ResultsReader, used: &UsedModalFile) -> Result<ModalFile, ExportError> {
        for path in &self.files {
            let file = ModalFile::open(path)?;
            if file.header().content_sha256 == used.content_sha256 {
                return Ok(file);
            }
        }
        let recorded = Path::new(&used.path);
        let found = match ModalFile::open(recorded) {
            Ok(file) if file.header().content_sha256 == used.content_sha256 => return Ok(file),
            Ok(_) => format!("{} with another content", recorded.display()),
            Err(_) => format!("no modal file at {}, where the run read it", recorded.display()),
        };
        let digest = used.content_sha256.chars().take(12).collect();
        Err(ExportError::ModalFileGone { file: results.path().to_owned(), body: unescape(&used.body), found, digest })
    }
}

/// The name behind a step of a path, see [`crate::io::results_file::escape`].
#[must_use]
pub fn unescape(step: &str) -> String {
    step.replace("%2E", ".").replace("%2F", "/").replace("%00", "\0").replace("%25", "%")
}

#[cfg(test)]
mod tests {
    use super::unescape;
    use crate::io::results_file::escape;

    #[test]
    fn names_survive_being_steps_of_a_path() {
        for name in ["left/drive", "100%", "%2F", "..", "plain"] {
            assert_eq!(unescape(&escape(name)), name);
        }
    }
}
