//! What can be wrong with a modal file, in words that name the file, the object, what was found, what was expected and the remedy.

use super::health::Rule;
use std::path::PathBuf;

/// A modal file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModalFileError {
    /// The file is not there, or libhdf5 cannot make sense of its head.
    #[error(
        "{}: cannot be opened: {cause}; expected a whole HDF5 file in schema flexible-body-modes 1.x; check the path, and write or copy the file again if it was cut short",
        file.display()
    )]
    Open {
        /// The file.
        file: PathBuf,
        /// What the system or libhdf5 said.
        cause: String,
    },
    /// An object that the schema requires is absent.
    #[error("{}: {object}: found nothing, expected {expected}; write the file again with it, or export it from a current tool", file.display())]
    Missing {
        /// The file.
        file: PathBuf,
        /// Path of the object.
        object: String,
        /// What should be there.
        expected: String,
    },
    /// An object of another kind or element type than the schema's.
    #[error("{}: {object}: found {found}, expected {expected}; {remedy}", file.display())]
    WrongType {
        /// The file.
        file: PathBuf,
        /// Path of the object.
        object: String,
        /// Type found.
        found: String,
        /// Type expected.
        expected: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A dataset of another shape than the counts of the file imply.
    #[error(
        "{}: {object}: found shape {found}, expected {expected}; write the dataset again in this shape, or correct mode_count and node_count",
        file.display()
    )]
    WrongShape {
        /// The file.
        file: PathBuf,
        /// Path of the dataset.
        object: String,
        /// Shape found.
        found: String,
        /// Shape expected, with what the numbers are.
        expected: String,
    },
    /// A value that the schema does not know.
    #[error("{}: {object}: found {found}, expected {expected}; {remedy}", file.display())]
    WrongValue {
        /// The file.
        file: PathBuf,
        /// Path of the object or attribute.
        object: String,
        /// Value found.
        found: String,
        /// Values expected.
        expected: String,
        /// What to do.
        remedy: &'static str,
    },
    /// More data than the reader accepts, or than the file can hold.
    #[error(
        "{}: {object}: found a declared size of {found}, expected at most {limit} bytes; the file is damaged, or must be split into fewer modes or nodes",
        file.display()
    )]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Path of the object.
        object: String,
        /// Size found.
        found: String,
        /// Largest size accepted (bytes).
        limit: u64,
    },
    /// Data that does not lie in the file itself.
    #[error("{}: {object}: found {found}, expected data stored in the file itself; copy the data into the file (hard links are fine)", file.display())]
    Elsewhere {
        /// The file.
        file: PathBuf,
        /// Path of the object.
        object: String,
        /// How the data is referred to.
        found: &'static str,
    },
    /// A compression filter outside the schema.
    #[error(
        "{}: {object}: found the filters {found}, expected at most shuffle, gzip and fletcher32, each once and in this order; repack the file (h5repack -f SHUF -f GZIP=4)",
        file.display()
    )]
    Filter {
        /// The file.
        file: PathBuf,
        /// Path of the dataset.
        object: String,
        /// The filter pipeline found.
        found: String,
    },
    /// Part of a dataset was never written, so reading would invent zeros.
    #[error("{}: {object}: found {found} of data, expected {expected}; the writer stopped early or the file is damaged: write it again", file.display())]
    Incomplete {
        /// The file.
        file: PathBuf,
        /// Path of the dataset.
        object: String,
        /// Storage found.
        found: String,
        /// Storage expected.
        expected: String,
    },
    /// libhdf5 cannot read an object that is declared properly.
    #[error("{}: {object}: found unreadable data ({cause}), expected whole data whose checksums agree; the file is damaged: copy or write it again", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Path of the object.
        object: String,
        /// What libhdf5 said.
        cause: String,
    },
    /// A number that is not finite, or above 1e100.
    #[error("{}: {object}: found {value} at flat index {index}, expected finite numbers of magnitude up to 1e100; repair the tool that wrote the file", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// Path of the dataset.
        object: String,
        /// Position in C order.
        index: usize,
        /// The value.
        value: f64,
    },
    /// An index that points at nothing.
    #[error(
        "{}: {object}: found index {found} at flat position {position}, expected 0 to {last}; indices count from 0, and surface and interface nodes come first",
        file.display()
    )]
    IndexOutOfRange {
        /// The file.
        file: PathBuf,
        /// Path of the dataset.
        object: String,
        /// Position in C order.
        position: usize,
        /// The index.
        found: i64,
        /// Largest index allowed.
        last: i64,
    },
    /// A rule of the schema does not hold.
    #[error("{}: {object}: {}: found {found}, expected {expected}; {}{}", file.display(), rule.name(), rule.remedy(), others_text(*others))]
    RuleBroken {
        /// The file.
        file: PathBuf,
        /// Path of the object.
        object: String,
        /// The rule.
        rule: Rule,
        /// Figure found.
        found: String,
        /// Limit.
        expected: String,
        /// How many further rules are broken.
        others: usize,
    },
}

/// Says how much more is wrong.
fn others_text(others: usize) -> String {
    match others {
        0 => String::new(),
        1 => " (one more rule is broken: see `pliant check`)".to_owned(),
        n => format!(" ({n} more rules are broken: see `pliant check`)"),
    }
}

impl ModalFileError {
    /// The rule of the health report under which this error appears.
    #[must_use]
    pub fn rule(&self) -> Rule {
        match self {
            Self::Open { .. } => Rule::Format,
            Self::NotFinite { .. } => Rule::Finite,
            Self::IndexOutOfRange { .. } => Rule::Indices,
            Self::Unreadable { .. } => Rule::Checksums,
            Self::RuleBroken { rule, .. } => *rule,
            Self::WrongValue { object, .. } if object.ends_with("@format") || object.ends_with("@version") => Rule::Format,
            Self::WrongValue { object, .. } if object == "inertia/modal_mass" => Rule::Orthonormality,
            _ => Rule::Structure,
        }
    }
}
