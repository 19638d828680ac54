//! What every reader turns its file into: nodes, cells, groups, and fields whose numbers are read on demand.

use super::budget::Budget;
use super::cell::CellKind;
use super::error::{ImportError, listed, refused};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Most nodes and most cells of a mesh.
pub(super) const COUNT_LIMIT: usize = 50_000_000;

/// Cells of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct CellBlock {
    /// Their kind.
    pub kind: CellKind,
    /// Nodes of every cell in turn, 0-based, VTK order.
    pub nodes: Vec<usize>,
}

impl CellBlock {
    /// Nodes of each cell.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        self.nodes.chunks_exact(self.kind.node_count())
    }
}

/// Where the numbers of a field sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldPlace {
    /// One row per node.
    Node,
    /// One row per cell, blocks in the order of the mesh.
    Cell,
}

/// One state of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldStep {
    /// Number by which steps are sorted.
    pub number: i64,
    /// Time, if the file gives one.
    pub time: Option<f64>,
    /// What the reader needs to find the numbers again.
    pub(super) key: usize,
}

/// A field, numbers not included.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Name in the file.
    pub name: String,
    /// Nodes or cells.
    pub place: FieldPlace,
    /// Names of the components; empty texts where the file gives none.
    pub components: Vec<String>,
    /// Steps by number.
    pub steps: Vec<FieldStep>,
}

/// Reads the numbers of a field.
pub(super) trait FieldSource: std::fmt::Debug {
    /// Rows of components, one row per node or cell.
    fn values(&self, field: &Field, step: &FieldStep) -> Result<Vec<f64>, ImportError>;

    /// The bound on what the file may make the importer hold.
    fn budget(&self) -> &Budget;

    /// Files that were read so far.
    fn files(&self) -> Vec<PathBuf>;
}

/// A file of another code, understood but for the numbers of its fields.
#[derive(Debug)]
pub struct ForeignModel {
    /// The file.
    pub file: PathBuf,
    /// "XDMF" or "MED".
    pub format: &'static str,
    /// Nodes (m), N of them, all finite.
    pub points: Vec<Vector3<f64>>,
    /// Cells by kind; every index is below N.
    pub blocks: Vec<CellBlock>,
    /// Groups of nodes.
    pub node_groups: BTreeMap<String, Vec<usize>>,
    /// Groups of cells as (block, cell).
    pub cell_groups: BTreeMap<String, Vec<(usize, usize)>>,
    /// Fields.
    pub fields: Vec<Field>,
    pub(super) source: Box<dyn FieldSource>,
}

impl ForeignModel {
    /// The field of that name on nodes or cells.
    #[must_use]
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.name == name)
    }

    /// Numbers of one step.
    ///
    /// # Errors
    /// If they cannot be read, are not finite, or are not one row per node or cell.
    pub fn values(&self, field: &Field, step: &FieldStep) -> Result<Vec<f64>, ImportError> {
        let values = self.source.values(field, step)?;
        let rows = match field.place {
            FieldPlace::Node => self.points.len(),
            FieldPlace::Cell => self.cell_count(),
        };
        let object = || format!("field \"{}\", step {}", super::error::printable(&field.name), step.number);
        let expected = rows * field.components.len();
        if values.len() != expected {
            let place = if field.place == FieldPlace::Node { "nodes" } else { "cells" };
            let expected = format!("{expected}: {rows} {place} of {} components", field.components.len());
            return Err(refused(&self.file, object(), format!("{} numbers", values.len()), expected, "export the field on the whole mesh"));
        }
        match values.iter().position(|v| !(v.abs() <= 1e100)) {
            None => Ok(values),
            Some(at) => {
                let found = format!("{:e} at flat index {at}", values[at]);
                Err(refused(&self.file, object(), found, "finite numbers of magnitude up to 1e100", "repair the export of this field"))
            }
        }
    }

    /// Number of all cells.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.blocks.iter().map(|block| block.cells().len()).sum()
    }

    /// Names of the fields, for messages.
    pub(super) fn field_names(&self) -> String {
        listed(self.fields.iter().map(|field| field.name.as_str()))
    }

    /// The largest dimension of any cell.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.blocks.iter().filter(|b| !b.nodes.is_empty()).map(|block| block.kind.dimension()).max().unwrap_or(0)
    }
}
