//! What can be wrong with a file to import, or with what was asked of it.

use crate::io::ModalFileError;
use std::path::{Path, PathBuf};

/// A file of another code that cannot become a modal file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file is not there or cannot be read.
    #[error(
        "{}: cannot be opened: {cause}; expected an XDMF 3 file (.xdmf, .xmf) or a MED file (.med); check the path, and export the file again if it was cut short",
        file.display()
    )]
    Open {
        /// The file.
        file: PathBuf,
        /// What the system or libhdf5 said.
        cause: String,
    },
    /// Something in the file, or something asked of it, that cannot be used.
    #[error("{}: {object}: found {found}, expected {expected}; {remedy}", file.display())]
    Refused {
        /// The file.
        file: PathBuf,
        /// Dataset, XML element, group, field or cell.
        object: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
        /// What to do.
        remedy: String,
    },
    /// Something that neither the file nor the request gives, and that is not made up.
    #[error("{}: {key} is needed: found {found}; {remedy}", file.display())]
    Needed {
        /// The file.
        file: PathBuf,
        /// Key of the request.
        key: String,
        /// What the file has instead.
        found: String,
        /// What to give.
        remedy: String,
    },
    /// Data in HDF5 that cannot be read.
    #[error(transparent)]
    Hdf5(ModalFileError),
    /// The modal file cannot be written.
    #[error("{}: cannot be written: {cause}; name another file, in a folder that exists and may be written", file.display())]
    Output {
        /// The modal file.
        file: PathBuf,
        /// What the system or libhdf5 said.
        cause: String,
    },
    /// What was made breaks a rule of modal files.
    #[error("{}: the body made of it breaks a rule of modal files: {cause}", file.display())]
    Rule {
        /// The imported file.
        file: PathBuf,
        /// Object, rule, figure, limit and remedy.
        cause: String,
    },
}

impl From<ModalFileError> for ImportError {
    fn from(error: ModalFileError) -> Self {
        match error {
            ModalFileError::Open { file, cause } => Self::Open { file, cause },
            // the words on mode_count and node_count are for modal files
            ModalFileError::WrongShape { file, object, found, expected } => {
                let remedy = "export the file again".to_owned();
                Self::Refused { file, object, found: format!("shape {found}"), expected, remedy }
            }
            ModalFileError::Missing { file, object, expected } => {
                let remedy = "export the file again from a current tool".to_owned();
                Self::Refused { file, object, found: "nothing".to_owned(), expected, remedy }
            }
            other => Self::Hdf5(other),
        }
    }
}

/// A refusal in its four parts: object, what was found, what was expected, what to do.
pub(super) fn refused(
    file: &Path,
    object: impl Into<String>,
    found: impl Into<String>,
    expected: impl Into<String>,
    remedy: impl Into<String>,
) -> ImportError {
    ImportError::Refused {
        file: file.to_owned(),
        object: object.into(),
        found: found.into(),
        expected: expected.into(),
        remedy: remedy.into(),
    }
}

/// Names in a message: quoted, at most twelve of them.
pub(super) fn listed<'n>(names: impl IntoIterator<Item = &'n str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    let shown: Vec<String> = names.iter().take(12).map(|name| format!("\"{}\"", printable(name))).collect();
    match (shown.is_empty(), names.len().saturating_sub(shown.len())) {
        (true, _) => "none".to_owned(),
        (false, 0) => shown.join(", "),
        (false, more) => format!("{} and {more} more", shown.join(", ")),
    }
}

/// A text of the file as it may reach a terminal: no control characters, at most 80 characters.
pub(super) fn printable(text: &str) -> String {
    let mut shown: String = text.chars().take(80).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(80).is_some() {
        shown.push_str("...");
    }
    shown
}
