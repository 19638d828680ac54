//! What is asked of an import: the keys of `[body.import]` and of `pliant import`, as plain data.

use crate::io::Coupling;
use crate::model::modal_body::Boundary;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Where the masses of the nodes come from.
#[derive(Debug, Clone, PartialEq)]
pub enum MassSource {
    /// A nodal field of one component (kg).
    Field(String),
    /// One number per node in the order of the file (kg).
    Values(Vec<f64>),
    /// One density of all volume cells (kg/m^3).
    Density(f64),
    /// Density of the volume cells of each group (kg/m^3).
    DensityByGroup(BTreeMap<String, f64>),
    /// Mass per area of all surface cells of a mesh without volume cells (kg/m^2).
    ArealDensity(f64),
}

/// Which nodes carry an interface. Positions are those of the file, before the root is moved to the origin.
#[derive(Debug, Clone, PartialEq)]
pub enum Selection {
    /// A group of nodes or cells; in XDMF also a nodal field of one component, whose entries other than zero are the group.
    Group(String),
    /// All nodes in a box with edges along the axes (m).
    Box {
        /// Least coordinates.
        low: Vector3<f64>,
        /// Greatest coordinates.
        high: Vector3<f64>,
    },
    /// 0-based nodes in the order of the file.
    Nodes(Vec<usize>),
}

/// An interface to make.
#[derive(Debug, Clone, PartialEq)]
pub struct InterfaceRequest {
    /// Its nodes.
    pub selection: Selection,
    /// How it is tied to them; mean motion unless the root is clamped.
    pub coupling: Option<Coupling>,
}

/// Everything that may be asked; what is `None` is taken from the file, or refused by name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ImportOptions {
    /// Title of the body; the file's name if none.
    pub title: Option<String>,
    /// Which mesh, where a file has several.
    pub mesh: Option<String>,
    /// Field with the mode shapes, or a pattern with one `*` for the mode's number.
    pub displacement: Option<String>,
    /// Field with nodal rotations, where they are not in the displacement field.
    pub rotation: Option<String>,
    /// Field with the stress of each mode.
    pub stress: Option<String>,
    /// Order of its components, each once of xx yy zz xy yz xz, where the file does not name them.
    pub stress_components: Option<Vec<String>>,
    /// Frequency of each retained mode (Hz); the times of the steps if none.
    pub frequency_hz: Option<Vec<f64>>,
    /// 1-based steps to retain; all if none.
    pub modes: Option<Vec<usize>>,
    /// Damping ratio, one for all or one per retained mode.
    pub damping_ratio: Option<Vec<f64>>,
    /// Masses of the nodes.
    pub mass: Option<MassSource>,
    /// How the modes were held; cantilever if no root node moves in any mode, else general.
    pub boundary: Option<Boundary>,
    /// Name of the inboard interface; "root" if none.
    pub root: Option<String>,
    /// Interfaces by name.
    pub interfaces: BTreeMap<String, InterfaceRequest>,
}
