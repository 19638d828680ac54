//! Scene files: from TOML to a system, its initial state and the settings of a run.

pub mod assemble;
pub mod closures;
pub mod error;
#[cfg(feature = "hdf5")]
mod flexible;
mod functions;
pub mod import_spec;
pub mod key_path;
pub mod locate;
#[cfg(feature = "hdf5")]
pub mod modal_files;
mod outputs;
mod remarks;
pub mod settings;
pub mod spec;

pub use assemble::{Overrides, Scene};
pub use error::SceneError;
pub use import_spec::ImportSpec;
pub use key_path::{KeyFault, KeyPath};
pub use outputs::Monitor;
pub use settings::Accuracy;
