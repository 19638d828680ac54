//! Why a campaign cannot run, go on or be merged.

use crate::io::CampaignFileError;
use crate::scene::SceneError;
use std::path::PathBuf;
use thiserror::Error;

/// What is wrong.
#[derive(Debug, Error)]
pub enum CampaignError {
    /// The scene, or the plan.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A scene that a campaign can do nothing with.
    #[error("{}: {message}", path.display())]
    Unfit {
        /// The scene.
        path: PathBuf,
        /// Why, and what to write.
        message: String,
    },
    /// A records file cannot be opened or made.
    #[error("state file {}: cannot be opened: {source}; name a file in a folder that exists and may be written", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Another process is at it.
    #[error("state file {}: another pliant sweep is writing it; wait for it, or write to another file", path.display())]
    Busy {
        /// The file.
        path: PathBuf,
    },
    /// It holds something else.
    #[error("state file {}: not the state of a campaign; it is left as it is, name another file", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// It is of another campaign.
    #[error(
        "state file {}: of another campaign: {} not the same; delete the file to start anew, or write to another",
        path.display(),
        listed(differences)
    )]
    Differs {
        /// The file.
        path: PathBuf,
        /// What differs.
        differences: Vec<String>,
    },
    /// It can no longer be written.
    #[error("state file {}: a finished case cannot be written: {source}; what was written before is kept", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A record cannot be read again.
    #[error("state file {}: the record of case {case} cannot be read: {message}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The case, counted from 1.
        case: usize,
        /// What is wrong.
        message: String,
    },
    /// Shards that make no whole.
    #[error("{}", .0.join("; "))]
    Shards(Vec<String>),
    /// The results file.
    #[error(transparent)]
    Results(#[from] CampaignFileError),
}

/// "the scene is", "the scene and the plan are".
fn listed(names: &[String]) -> String {
    match names {
        [one] if one.starts_with("the options") => format!("{one} are"),
        [one] => format!("{one} is"),
        [first @ .., last] => format!("{} and {last} are", first.join(", ")),
        [] => "something is".into(),
    }
}
