//! Modal files of a scene: each read and checked once, each choice of modes packed once.

use super::error::{SceneError, Source};
use super::locate::Step;
use crate::io::import::{ImportOptions, import};
use crate::io::{ModalFile, ModalFileError};
use crate::model::ModeBasis;
use crate::model::flexible_body::ModalIntegrals;
use crate::model::modal_body::ModalBody;
use crate::model::mode_basis::{NoStaticAnswer, interface_loads, shape_loads};
use nalgebra::{Vector3, Vector6};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One choice of modes of one file.
#[derive(Debug, Clone)]
pub struct Selection {
    /// The file, for surfaces and nodes.
    pub file: Arc<ModalFile>,
    /// Modal integrals of all modes of the file.
    pub all: Arc<ModalBody>,
    /// The retained modes.
    pub basis: Arc<ModeBasis>,
    /// The file's content digest.
    pub content_sha256: String,
}

/// Modal data of one choice of modes, plain and packed.
type Packed = (Arc<ModalBody>, Arc<ModalIntegrals>);

/// A file, its integrals and its digest.
type Opened = (Arc<ModalFile>, Arc<ModalBody>, String);

/// Place (m) of a mesh node and its shape in each mode of its file.
type Node = (Vector3<f64>, Arc<Vec<Vector6<f64>>>);

/// Files and selections read so far. A clone shares what was read.
#[derive(Debug, Clone, Default)]
pub struct ModalFiles {
    files: HashMap<PathBuf, Opened>,
    bases: HashMap<(PathBuf, Choice), Arc<ModeBasis>>,
    packed: HashMap<(PathBuf, Choice, bool), Packed>,
    /// By content of the file and number of the node.
    nodes: HashMap<(String, usize), Node>,
}

/// Most files, selections and nodes that are taken over from other scenes.
const MOST_FILES: usize = 32;
const MOST_SELECTIONS: usize = 128;
const MOST_NODES: usize = 4096;

/// A choice of modes of one file.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Choice {
    /// 0-based numbers of the modes retained whole.
    pub whole: Vec<usize>,
    /// Where loads act that residual modes shall carry beside inertial loads; no residual modes if none.
    pub residual: Option<Places>,
}

/// Interfaces and mesh nodes of a body where something is attached, sorted.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Places {
    /// Names of interfaces.
    pub interfaces: Vec<String>,
    /// Numbers of mesh nodes.
    pub nodes: Vec<usize>,
}

/// Why a choice of modes has no basis.
#[derive(Debug, thiserror::Error)]
pub enum BasisError {
    /// A node that cannot be read.
    #[error(transparent)]
    File(#[from] ModalFileError),
    /// No residual modes.
    #[error("true, but {0}; correct modes/stiffness or modes/frequency in the modal file, or leave the key out")]
    Residual(#[from] NoStaticAnswer),
}

impl ModalFiles {
    /// The file at `path`, checked.
    pub fn open(&mut self, path: &Path, source: &Source, steps: &[Step]) -> Result<Opened, SceneError> {
        if let Some(found) = self.files.get(path) {
            return Ok(found.clone());
        }
        let wrap = |error: ModalFileError| SceneError::ModalFile { path: source.path.clone(), at: source.at(steps), source: error };
        let (file, body) = ModalFile::load_body(path).map_err(wrap)?;
        let digest = file.header().content_sha256.clone();
        let entry = (Arc::new(file), Arc::new(body), digest);
        self.files.insert(path.to_owned(), entry.clone());
        Ok(entry)
    }

    /// A file of another code, imported once for each set of options; with what identifies it.
    pub fn import(
        &mut self,
        path: &Path,
        options: &ImportOptions,
        source: &Source,
        steps: &[Step],
    ) -> Result<(PathBuf, Opened), SceneError> {
        let key = PathBuf::from(format!("{} {options:?}", path.display()));
        if let Some(found) = self.files.get(&key) {
            return Ok((key, found.clone()));
        }
        let wrap = |source_error| SceneError::Import { path: source.path.clone(), at: source.at(steps), source: source_error };
        let (file, body) = import(path, options).map_err(wrap)?;
        let digest = file.header().content_sha256.clone();
        let entry = (Arc::new(file), Arc::new(body), digest);
        self.files.insert(key.clone(), entry.clone());
        Ok((key, entry))
    }

    /// The combinations of modes that `choice` asks for.
    ///
    /// # Errors
    /// If a node has no shape, or static loads no answer.
    pub fn basis(&mut self, path: &Path, file: &ModalFile, body: &ModalBody, choice: &Choice) -> Result<Arc<ModeBasis>, BasisError> {
        let key = (path.to_owned(), choice.clone());
        if let Some(found) = self.bases.get(&key) {
            return Ok(Arc::clone(found));
        }
        let basis = match &choice.residual {
            None => ModeBasis::whole(choice.whole.clone(), body.mode_count()),
            Some(places) => {
                let interfaces = places.interfaces.iter().filter_map(|name| body.interface(name));
                let mut loads: Vec<_> = interfaces.flat_map(interface_loads).collect();
                for &node in &places.nodes {
                    loads.extend(shape_loads(&file.node_shape(node)?));
                }
                ModeBasis::with_residual(body, choice.whole.clone(), &loads)?
            }
        };
        let basis = Arc::new(basis);
        self.bases.insert(key, Arc::clone(&basis));
        Ok(basis)
    }

    /// Place and shapes of a mesh node of the selected file.
    ///
    /// # Errors
    /// If the node cannot be read.
    pub fn node(&mut self, selection: &Selection, node: usize) -> Result<Node, ModalFileError> {
        let key = (selection.content_sha256.clone(), node);
        if let Some(found) = self.nodes.get(&key) {
            return Ok(found.clone());
        }
        let read = (selection.file.node_position(node)?, Arc::new(selection.file.node_shape(node)?));
        self.nodes.insert(key, read.clone());
        Ok(read)
    }

    /// Takes over what `other` has read beside, up to a bound: values that differ from scene to scene must not fill the memory.
    pub fn absorb(&mut self, other: Self) {
        fn take<K: Eq + std::hash::Hash, V>(into: &mut HashMap<K, V>, from: HashMap<K, V>, most: usize) {
            for (key, value) in from {
                if into.len() >= most {
                    break;
                }
                into.entry(key).or_insert(value);
            }
        }
        take(&mut self.files, other.files, MOST_FILES);
        take(&mut self.bases, other.bases, MOST_SELECTIONS);
        take(&mut self.packed, other.packed, MOST_SELECTIONS);
        take(&mut self.nodes, other.nodes, MOST_NODES);
    }

    /// The body with the modes `basis` of `choice`, packed with or without its geometric stiffness.
    pub fn pack(&mut self, path: &Path, body: &ModalBody, choice: &Choice, basis: &ModeBasis, geometric: bool) -> Packed {
        let entry = self.packed.entry((path.to_owned(), choice.clone(), geometric)).or_insert_with(|| {
            let selected = body.with_basis(basis);
            let pack = if geometric { ModalIntegrals::with_geometric_stiffness } else { ModalIntegrals::of };
            let integrals = pack(&selected);
            (Arc::new(selected), Arc::new(integrals))
        });
        entry.clone()
    }
}
