//! The built-in example: its files, compiled in, and how they are laid out for a command.

use crate::scene::SceneError;
use std::path::{Path, PathBuf};

/// The files, laid out as in the repository; the scene first.
const FILES: [(&str, &[u8]); 2] = [
    ("examples/02_hub_two_panels/scene.toml", include_bytes!("../../examples/02_hub_two_panels/scene.toml")),
    ("modes/panel_cantilever.h5", include_bytes!("../../modes/panel_cantilever.h5")),
];

/// The example in a folder of its own, which lives as long as this value.
pub struct Unpacked {
    folder: tempfile::TempDir,
}

impl Unpacked {
    /// Writes the files.
    pub fn new() -> Result<Self, SceneError> {
        let wrap = |path: &Path, error: std::io::Error| SceneError::unreadable(path, "scene", &error);
        let folder = tempfile::tempdir().map_err(|e| wrap(&std::env::temp_dir(), e))?;
        for (name, bytes) in FILES {
            let path = folder.path().join(name);
            if let Some(parent) = path.parent() {
                std::fs::create_dir_all(parent).map_err(|e| wrap(parent, e))?;
            }
            std::fs::write(&path, bytes).map_err(|e| wrap(&path, e))?;
        }
        Ok(Self { folder })
    }

    /// The scene.
    pub fn scene(&self) -> PathBuf {
        self.folder.path().join(FILES[0].0)
    }

    /// The modal file.
    #[cfg(feature = "hdf5")]
    pub fn modal_file(&self) -> PathBuf {
        self.folder.path().join(FILES[1].0)
    }
}
