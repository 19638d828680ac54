//! What can keep an export from being written.

use crate::io::ResultsError;
use crate::io::error::ModalFileError;
use crate::io::field_file::FieldFileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why an export was not, or not completely, written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The results file cannot be read.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A modal file cannot be read.
    #[error(transparent)]
    Modal(#[from] ModalFileError),
    /// The arrays cannot be written.
    #[error(transparent)]
    Fields(#[from] FieldFileError),
    /// A file cannot be written.
    #[error("{}: cannot be written: {cause}; name a folder that exists and may be written, on a disk with room", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// What the system says.
        cause: String,
    },
    /// A target that is also an input.
    #[error("{}: is an input of this export; write to another place (--out)", file.display())]
    OverInput {
        /// The file.
        file: PathBuf,
    },
    /// A run without output times.
    #[error("{}: time: found no output times, expected at least one; let the run go on for longer", file.display())]
    NoTimes {
        /// The results file.
        file: PathBuf,
    },
    /// A body that the run does not have.
    #[error("{}: body \"{body}\": found no such flexible body, expected one of: {known}; correct --body", file.display())]
    NoBody {
        /// The results file.
        file: PathBuf,
        /// Name asked for.
        body: String,
        /// Names that there are.
        known: String,
    },
    /// Nothing to draw.
    #[error("{}: found neither flexible bodies nor loads, expected at least one of them; export the histories with --format csv", file.display())]
    NothingToDraw {
        /// The results file.
        file: PathBuf,
    },
    /// A modal file that is not where the run found it.
    #[error(
        "{}: body \"{body}\": found {found}, expected the modal file whose content_sha256 begins with {digest}; give it with --modal-file FILE",
        file.display()
    )]
    ModalFileGone {
        /// The results file.
        file: PathBuf,
        /// The body.
        body: String,
        /// What stands where the run found it.
        found: String,
        /// First digits of the digest.
        digest: String,
    },
    /// A results file of before loads had poses.
    #[error("{}: {object}: found nothing, expected where the load acts; run the scene again with this version of pliant", file.display())]
    NoPose {
        /// The results file.
        file: PathBuf,
        /// Path of the series.
        object: String,
    },
    /// A series whose text does not say what it must.
    #[error("{}: {object}: found {found}, expected {expected}; name a file that pliant run --out has written", file.display())]
    WrongText {
        /// The results file.
        file: PathBuf,
        /// Path of the attribute.
        object: String,
        /// Text found.
        found: String,
        /// What it must be.
        expected: &'static str,
    },
    /// A cell type that XDMF does not know.
    #[error("{}: mesh/cells@cell_type: found \"{found}\", expected one of: {known}; write the mesh with one of these", file.display())]
    CellType {
        /// The modal file.
        file: PathBuf,
        /// Type found.
        found: String,
        /// Types known.
        known: String,
    },
    /// A name that cannot stand in a reference to an array.
    #[error("{}: found the character '{found}' in the name, expected none: XDMF readers split references to arrays at it; rename the file", file.display())]
    Name {
        /// The file.
        file: PathBuf,
        /// The character.
        found: char,
    },
}
