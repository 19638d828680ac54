//! Modal files of a scene: each read and checked once, each choice of modes packed once.

use super::error::{SceneError, Source};
use super::locate::Step;
use crate::io::{ModalFile, ModalFileError};
use crate::model::flexible_body::ModalIntegrals;
use crate::model::modal_body::ModalBody;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

/// One choice of modes of one file.
#[derive(Debug, Clone)]
pub struct Selection {
    /// The file, for surfaces and nodes.
    pub file: Rc<ModalFile>,
    /// 0-based numbers of the retained modes.
    pub modes: Vec<usize>,
    /// The file's content digest.
    pub content_sha256: String,
}

/// Modal data of one choice of modes, plain and packed.
type Packed = (Arc<ModalBody>, Arc<ModalIntegrals>);

/// Files and selections read so far.
#[derive(Debug, Default)]
pub struct ModalFiles {
    files: HashMap<PathBuf, (Rc<ModalFile>, Rc<ModalBody>, String)>,
    packed: HashMap<(PathBuf, Vec<usize>, bool), Packed>,
}

impl ModalFiles {
    /// The file at `path`, checked.
    pub fn open(&mut self, path: &Path, source: &Source, steps: &[Step]) -> Result<(Rc<ModalFile>, Rc<ModalBody>, String), SceneError> {
        if let Some(found) = self.files.get(path) {
            return Ok(found.clone());
        }
        let wrap = |error: ModalFileError| SceneError::ModalFile { path: source.path.clone(), at: source.at(steps), source: error };
        let (file, body) = ModalFile::load_body(path).map_err(wrap)?;
        let digest = file.header().content_sha256.clone();
        let entry = (Rc::new(file), Rc::new(body), digest);
        self.files.insert(path.to_owned(), entry.clone());
        Ok(entry)
    }

    /// The body with the modes `modes` (0-based), packed with or without its geometric stiffness.
    pub fn pack(&mut self, path: &Path, body: &ModalBody, modes: &[usize], geometric: bool) -> Packed {
        let entry = self.packed.entry((path.to_owned(), modes.to_vec(), geometric)).or_insert_with(|| {
            let selected = body.with_modes(modes);
            let pack = if geometric { ModalIntegrals::with_geometric_stiffness } else { ModalIntegrals::of };
            let integrals = pack(&selected);
            (Arc::new(selected), Arc::new(integrals))
        });
        entry.clone()
    }
}
