//! What can be wrong with a scene, with file, line, column and key.

use super::locate::{Location, Step, locate};
use crate::model::ModelError;
use crate::model::error::Place;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a scene cannot be used.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("{}: cannot read the {what}: {cause}; name a {what} file (.toml) that exists", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What it should be: "scene", say.
        what: &'static str,
        /// What the system says, or that it is no text.
        cause: String,
    },
    /// The text is not TOML, or a key or type does not belong there; the message shows line and column.
    #[error("{}: {message}", path.display())]
    Syntax {
        /// The scene.
        path: PathBuf,
        /// The parser's message.
        message: String,
    },
    /// A value that cannot be.
    #[error("{}:{}:{}: {}: {message}", path.display(), at.line, at.column, at.key)]
    Value {
        /// The scene.
        path: PathBuf,
        /// Where.
        at: Location,
        /// What was found and what to write instead.
        message: String,
    },
    /// A modal file that cannot be used.
    #[cfg(feature = "hdf5")]
    #[error("{}:{}:{}: {}", path.display(), at.line, at.column, at.key)]
    ModalFile {
        /// The scene.
        path: PathBuf,
        /// Where.
        at: Location,
        /// What is wrong with it.
        source: crate::io::ModalFileError,
    },
    /// A file of another code that cannot be imported.
    #[cfg(feature = "hdf5")]
    #[error("{}:{}:{}: {}", path.display(), at.line, at.column, at.key)]
    Import {
        /// The scene.
        path: PathBuf,
        /// Where.
        at: Location,
        /// What is wrong with it.
        source: crate::io::import::ImportError,
    },
    /// An override on the command line that names nothing.
    #[error("{option}: {message}")]
    Override {
        /// The option.
        option: &'static str,
        /// What is wrong and what is possible.
        message: String,
    },
}

impl SceneError {
    /// A file that cannot be read as `what`.
    #[must_use]
    pub fn unreadable(path: &Path, what: &'static str, error: &std::io::Error) -> Self {
        let cause = if error.kind() == std::io::ErrorKind::InvalidData { "it is not a text".to_owned() } else { error.to_string() };
        Self::Read { path: path.to_owned(), what, cause }
    }
}

/// Text of a scene with its path: makes errors that point into it.
#[derive(Debug, Clone)]
pub struct Source {
    /// The scene.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
}

impl Source {
    /// Where a path of keys leads.
    #[must_use]
    pub fn at(&self, steps: &[Step]) -> Location {
        locate(&self.text, steps)
    }

    /// An error about the value at a path of keys.
    #[must_use]
    pub fn value(&self, steps: &[Step], message: impl Into<String>) -> SceneError {
        SceneError::Value { path: self.path.clone(), at: self.at(steps), message: message.into() }
    }

    /// An error of the model, pointed at the item it concerns.
    #[must_use]
    pub fn model(&self, error: &ModelError) -> SceneError {
        let steps = error.place().map_or_else(|| vec![Step::Key("body")], steps_of);
        self.value(&steps, error.to_string())
    }
}

/// Path of keys of a place in the model's definition.
fn steps_of(place: &Place) -> Vec<Step> {
    vec![Step::Key(place.section), Step::Index(place.index), Step::Key(place.key)]
}
