//! A modal file, schema `flexible-body-modes` 1.x: header, modal integrals, interfaces.
//!
//! Shapes below use N nodes and n modes. Nothing per node is kept; `modal_mesh` reads that on demand.

use super::array::{ElementType, GuardedDataset};
use super::digest::read_content;
use super::error::ModalFileError;
use super::guard::GuardedFile;
use super::header::{Header, read_header};
use super::modal_check::examine;
use crate::model::modal_body::{Interface, ModalBody};
use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};
use std::path::{Path, PathBuf};

/// The 12 unit inertial loads in the order of [`ModalBody::geometric_stiffness`].
pub const GEOMETRIC_LOADS: [&str; 12] =
    ["acc_x", "acc_y", "acc_z", "alpha_x", "alpha_y", "alpha_z", "omega_xx", "omega_yy", "omega_zz", "omega_xy", "omega_yz", "omega_xz"];
/// Largest departure of `inertia/modal_mass` from the identity: that of the orthonormality rule.
pub(super) const MODAL_MASS_LIMIT: f64 = 1e-6;

/// What kind of shape a mode is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ModeKind {
    /// Natural mode.
    Normal,
    /// Orthonormalised Craig-Bampton mode.
    CraigBampton,
    /// Attachment or residual mode.
    Attachment,
}

impl ModeKind {
    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::CraigBampton => "craig-bampton",
            Self::Attachment => "attachment",
        }
    }
}

/// How an interface is tied to its nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coupling {
    /// Nodes held.
    Fixed,
    /// Weighted mean motion.
    Rbe3,
    /// Rigidly tied.
    Rbe2,
}

impl Coupling {
    /// Name in files and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Rbe3 => "rbe3",
            Self::Rbe2 => "rbe2",
        }
    }
}

/// The nodes behind an interface.
#[derive(Debug, Clone)]
pub struct InterfaceSupport {
    /// Name of the interface.
    pub name: String,
    /// How it is tied to its nodes.
    pub coupling: Coupling,
    /// Nodes, 0-based, at least one.
    pub nodes: Vec<usize>,
    /// Weight of each node.
    pub weights: Vec<f64>,
}

/// An open modal file whose header is understood.
#[derive(Debug)]
pub struct ModalFile {
    pub(super) file: GuardedFile,
    header: Header,
    inputs: Vec<PathBuf>,
    /// Takes the file away with this value, where it was made for it alone; after `file`, so that it is closed first.
    _scratch: Option<tempfile::TempPath>,
}

impl ModalFile {
    /// Opens a file and reads its header; data is read, and held against the rules, only on demand.
    ///
    /// # Errors
    /// If the file is no HDF5 file, holds links or types outside the schema, or its attributes are missing or unknown.
    pub fn open(path: &Path) -> Result<Self, ModalFileError> {
        let file = GuardedFile::open(path)?;
        let header = read_header(&file)?;
        Ok(Self { file, header, inputs: vec![path.to_owned()], _scratch: None })
    }

    /// The same file, known as `shown`; what is at `scratch`, where it was made for this value alone, goes away with it.
    pub(super) fn made_from(mut self, shown: &Path, inputs: Vec<PathBuf>, scratch: tempfile::TempPath) -> Self {
        self.file.show_as(shown);
        Self { inputs, _scratch: Some(scratch), ..self }
    }

    /// Every file behind this one: itself, or those it was imported from.
    #[must_use]
    pub fn inputs(&self) -> &[PathBuf] {
        &self.inputs
    }

    /// Opens a file, reads all of it and holds it against every rule of the schema.
    ///
    /// # Errors
    /// The first thing that is wrong, with how many more there are.
    pub fn load(path: &Path) -> Result<Self, ModalFileError> {
        examine(path).into_accepted().map(|(file, _)| file)
    }

    /// As [`Self::load`], and returns the modal integrals that were read on the way.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_body(path: &Path) -> Result<(Self, ModalBody), ModalFileError> {
        examine(path).into_accepted()
    }

    /// The path as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// The attributes.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Digest of the data as it is now, to be compared with [`Header::content_sha256`]; reads every dataset.
    ///
    /// # Errors
    /// If a dataset has a type, size or storage outside the schema, or is damaged.
    pub fn content_sha256(&self) -> Result<String, ModalFileError> {
        Ok(read_content(&self.file)?.sha256)
    }

    /// Reads the modal integrals, interfaces and stiffness matrices; types, shapes and finiteness are checked, the other rules are not.
    ///
    /// # Errors
    /// If a dataset is missing, of another type or shape, damaged or not finite, or `inertia/modal_mass` is not the identity.
    pub fn read_body(&self) -> Result<ModalBody, ModalFileError> {
        let n = self.header.mode_count;
        let modes = "(modes)";
        let scalar = self.sized("body/mass", &[], "a scalar")?.read_f64()?;
        let center = self.sized("body/center_of_mass", &[3], "x y z")?.read_f64()?;
        let inertia = self.sized("body/inertia", &[3, 3], "about the origin")?.read_f64()?;
        let momentum = self.sized("inertia/momentum", &[n, 3], "(modes, 3)")?.read_f64()?;
        let first_moment = self.sized("inertia/first_moment", &[n, 3, 3], "(modes, 3, 3)")?.read_f64()?;
        let second_moment = self.sized("inertia/second_moment", &[n, n, 3, 3], "(modes, modes, 3, 3)")?.read_f64()?;
        self.read_modal_mass_departure()?;
        Ok(ModalBody {
            mass: scalar.first().copied().unwrap_or(f64::NAN),
            center_of_mass: Vector3::from_column_slice(&center),
            inertia: Matrix3::from_row_slice(&inertia),
            boundary: self.header.boundary,
            root_interface: self.header.root_interface.clone(),
            frequency_hz: self.sized("modes/frequency", &[n], modes)?.read_f64()?,
            damping_ratio: self.sized("modes/damping_ratio", &[n], modes)?.read_f64()?,
            stiffness: self.matrices("modes/stiffness", None)?.and_then(|mut m| m.pop()),
            momentum: vectors(&momentum),
            first_moment: first_moment.chunks_exact(9).map(Matrix3::from_row_slice).collect(),
            second_moment: second_moment.chunks_exact(9).map(Matrix3::from_row_slice).collect(),
            angular_momentum: self.optional("inertia/angular_momentum", &[n, 3], "(modes, 3)")?.map(|values| vectors(&values)),
            geometric_stiffness: self.read_geometric_stiffness()?,
            interfaces: self.interface_names().iter().map(|name| self.read_interface(name)).collect::<Result<_, _>>()?,
        })
    }

    /// Kind of each mode, length n.
    ///
    /// # Errors
    /// If the dataset is missing, of another type or shape, or holds an unknown kind.
    pub fn read_mode_kinds(&self) -> Result<Vec<ModeKind>, ModalFileError> {
        let kinds = self.sized("modes/kind", &[self.header.mode_count], "(modes)")?.read::<u8>()?;
        let known = |kind: u8| match kind {
            0 => Ok(ModeKind::Normal),
            1 => Ok(ModeKind::CraigBampton),
            2 => Ok(ModeKind::Attachment),
            other => Err(self.wrong_value(
                "modes/kind",
                &other.to_string(),
                "0 normal, 1 Craig-Bampton or 2 attachment",
                "write the kinds again",
            )),
        };
        kinds.into_iter().map(known).collect()
    }

    /// Nodes and weights of every interface, in the order of [`ModalBody::interfaces`].
    ///
    /// # Errors
    /// If a dataset is missing, of another type or shape, or an index is out of range.
    pub fn read_interface_supports(&self) -> Result<Vec<InterfaceSupport>, ModalFileError> {
        self.interface_names().iter().map(|name| self.read_support(name)).collect()
    }

    /// Stiffening by unit forces and moments (fx fy fz mx my mz) at another interface with the root held, 6 of n x n, where the file has it.
    ///
    /// # Errors
    /// If the dataset is of another type or shape, or damaged.
    pub fn read_interface_geometric_stiffness(&self, interface: &str) -> Result<Option<Vec<DMatrix<f64>>>, ModalFileError> {
        self.matrices(&format!("geometric/{interface}"), Some(6))
    }

    /// Undeformed nodes (m), length N.
    ///
    /// # Errors
    /// If the dataset is missing, of another type or shape, damaged or not finite.
    pub fn read_points(&self) -> Result<Vec<Vector3<f64>>, ModalFileError> {
        Ok(vectors(&self.sized("mesh/points", &[self.header.node_count, 3], "(nodes, 3)")?.read_f64()?))
    }

    /// Names of the interfaces, sorted.
    #[must_use]
    pub fn interface_names(&self) -> Vec<String> {
        self.file.children("interfaces").into_iter().map(ToOwned::to_owned).collect()
    }

    /// A dataset of exactly this shape.
    pub(super) fn sized(&self, path: &str, shape: &[usize], meaning: &str) -> Result<GuardedDataset<'_>, ModalFileError> {
        let shape: Vec<Option<usize>> = shape.iter().map(|&extent| Some(extent)).collect();
        self.file.dataset(path)?.expect_shape(&shape, meaning)
    }

    /// Values of a dataset that need not be there.
    pub(super) fn optional(&self, path: &str, shape: &[usize], meaning: &str) -> Result<Option<Vec<f64>>, ModalFileError> {
        if self.file.has(path) { Ok(Some(self.sized(path, shape, meaning)?.read_f64()?)) } else { Ok(None) }
    }

    /// A refusal of a value.
    pub(super) fn wrong_value(&self, object: &str, found: &str, expected: &str, remedy: &'static str) -> ModalFileError {
        let (file, object) = (self.file.path().to_owned(), object.to_owned());
        ModalFileError::WrongValue { file, object, found: found.to_owned(), expected: expected.to_owned(), remedy }
    }

    /// One n x n matrix, or `count` of them, where the file has the dataset.
    fn matrices(&self, path: &str, count: Option<usize>) -> Result<Option<Vec<DMatrix<f64>>>, ModalFileError> {
        let n = self.header.mode_count;
        let shape: Vec<usize> = count.into_iter().chain([n, n]).collect();
        let values = self.optional(path, &shape, "(modes, modes) per matrix")?;
        Ok(values.map(|v| v.chunks_exact(n * n).map(|m| DMatrix::from_row_slice(n, n, m)).collect()))
    }

    /// The 12 unit inertial loads, put into the order of [`GEOMETRIC_LOADS`] by name.
    fn read_geometric_stiffness(&self) -> Result<Option<Vec<DMatrix<f64>>>, ModalFileError> {
        const PATH: &str = "geometric/stiffness";
        for name in self.file.children("geometric").into_iter().filter(|&name| name != "stiffness") {
            if !self.file.has(&format!("interfaces/{name}")) {
                let expected = "stiffness, or the name of an interface";
                return Err(self.wrong_value(&format!("geometric/{name}"), name, expected, "rename the dataset or leave it out"));
            }
            self.read_interface_geometric_stiffness(name)?;
        }
        let Some(matrices) = self.matrices(PATH, Some(12))? else { return Ok(None) };
        let text = self.file.text(PATH, "loads")?;
        let names: Vec<&str> = text.split([' ', ',']).filter(|name| !name.is_empty()).collect();
        let order: Option<Vec<usize>> = GEOMETRIC_LOADS.iter().map(|load| names.iter().position(|name| name == load)).collect();
        match order {
            Some(order) if names.len() == GEOMETRIC_LOADS.len() => Ok(Some(order.into_iter().map(|i| matrices[i].clone()).collect())),
            _ => Err(self.wrong_value(
                "geometric/stiffness@loads",
                &format!("\"{text}\""),
                &format!("each of \"{}\" once, in any order", GEOMETRIC_LOADS.join(" ")),
                "name the load of each matrix",
            )),
        }
    }

    /// Largest departure of `inertia/modal_mass` from the identity, where the file has it; the equations take the modal mass as one.
    pub(super) fn read_modal_mass_departure(&self) -> Result<Option<f64>, ModalFileError> {
        let n = self.header.mode_count;
        let values = self.optional("inertia/modal_mass", &[n, n], "(modes, modes)")?;
        let departure = values.map(|values| (DMatrix::from_row_slice(n, n, &values) - DMatrix::identity(n, n)).amax());
        match departure.filter(|departure| *departure > MODAL_MASS_LIMIT) {
            None => Ok(departure),
            Some(departure) => Err(self.wrong_value(
                "inertia/modal_mass",
                &format!("a departure of {departure:.3e} from the identity"),
                &format!("at most {MODAL_MASS_LIMIT:e}"),
                "orthonormalise the modes with the whole mass matrix, rotary inertia included",
            )),
        }
    }

    fn read_interface(&self, name: &str) -> Result<Interface, ModalFileError> {
        let at = |dataset: &str| format!("interfaces/{name}/{dataset}");
        let position = self.sized(&at("position"), &[3], "x y z")?.read_f64()?;
        let orientation = self.optional(&at("orientation"), &[3, 3], "axes in columns")?;
        let shape = self.sized(&at("displacement"), &[self.header.mode_count, 6], "(modes, ux uy uz rx ry rz)")?.read_f64()?;
        Ok(Interface {
            name: name.to_owned(),
            position: Vector3::from_column_slice(&position),
            orientation: orientation.map_or_else(Matrix3::identity, |values| Matrix3::from_row_slice(&values)),
            // the file has translation first, spatial vectors rotation first
            mode_shape: shape.chunks_exact(6).map(|u| Vector6::new(u[3], u[4], u[5], u[0], u[1], u[2])).collect(),
        })
    }

    fn read_support(&self, name: &str) -> Result<InterfaceSupport, ModalFileError> {
        let at = |dataset: &str| format!("interfaces/{name}/{dataset}");
        let word = self.file.text(&format!("interfaces/{name}"), "coupling")?;
        let coupling = [Coupling::Fixed, Coupling::Rbe3, Coupling::Rbe2].into_iter().find(|c| c.name() == word).ok_or_else(|| {
            let object = format!("interfaces/{name}@coupling");
            self.wrong_value(&object, &format!("\"{word}\""), "fixed, rbe3 or rbe2", "state how the interface is tied to its nodes")
        })?;
        let nodes =
            self.file.dataset(&at("nodes"))?.expect_shape(&[None], "(nodes of the interface)")?.read_indices(self.header.node_count)?;
        if nodes.is_empty() {
            return Err(self.wrong_value(&at("nodes"), "no node", "at least one node", "name the nodes that carry the interface"));
        }
        let weights = self.sized(&at("weights"), &[nodes.len()], "one weight per node")?.read_f64()?;
        Ok(InterfaceSupport { name: name.to_owned(), coupling, nodes, weights })
    }

    /// Displacement of every node in one mode, x y z in turn, length 3 N; and whether it is stored in single precision.
    pub(super) fn read_displacement(&self, mode: usize) -> Result<(Vec<f64>, bool), ModalFileError> {
        let dataset = self.displacement_dataset("displacement", mode)?;
        Ok((dataset.read_real()?, dataset.element == ElementType::F4))
    }

    /// `modes/{quantity}/{mode}` with N rows of 3.
    pub(super) fn displacement_dataset(&self, quantity: &str, mode: usize) -> Result<GuardedDataset<'_>, ModalFileError> {
        self.sized(&format!("modes/{quantity}/{mode:04}"), &[self.header.node_count, 3], "(nodes, 3)")
    }

    /// True if the file has nodal rotations.
    #[must_use]
    pub fn has_rotation(&self) -> bool {
        self.file.has("modes/rotation")
    }
}

/// Rows of three.
pub(super) fn vectors(values: &[f64]) -> Vec<Vector3<f64>> {
    values.chunks_exact(3).map(Vector3::from_column_slice).collect()
}
