//! Sums over nodes: the same integrals as the tensors of the file, taken from nodal masses and mode shapes.
//!
//! Mode shapes are read one at a time; only a tile of at most 256 MiB of them stays in memory, so that a mesh of any size is
//! checked within a fixed bound. Cost: O(N n^2) for the modal mass, O(N n) for the rest.

use super::error::ModalFileError;
use super::modal_file::{InterfaceSupport, ModalFile, vectors};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Mode shapes kept at a time (bytes).
const TILE_BYTES: usize = 256 << 20;

/// What the nodes say. Vectors and tensors are in body axes about the origin.
#[derive(Debug)]
pub(super) struct LumpedSums {
    /// Undeformed nodes, length N.
    pub points: Vec<Vector3<f64>>,
    /// sum m (kg).
    pub mass: f64,
    /// sum m r (kg m).
    pub first_moment: Vector3<f64>,
    /// Inertia about the origin, with nodal rotary inertia (kg m^2).
    pub inertia: Matrix3<f64>,
    /// sum m phi_j, length n.
    pub momentum: Vec<Vector3<f64>>,
    /// sum m r phi_j^T, length n.
    pub modal_moment: Vec<Matrix3<f64>>,
    /// Phi^T M Phi, n x n, with nodal rotary inertia.
    pub modal_mass: DMatrix<f64>,
    /// Largest displacement component of any node and mode.
    pub largest_displacement: f64,
    /// Largest rotation component of any node and mode, zero without rotations.
    pub largest_rotation: f64,
    /// Largest displacement or rotation component at the root nodes.
    pub root_motion: f64,
    /// Weighted mean translation of each interface in each mode.
    pub interface_translation: Vec<Vec<Vector3<f64>>>,
    /// True if any mode shape is stored in single precision.
    pub single_precision: bool,
}

/// Nodal masses and, where given, nodal inertias.
struct NodalInertia {
    mass: Vec<f64>,
    rotary: Option<Vec<Matrix3<f64>>>,
}

impl NodalInertia {
    /// Inner product of two mode shapes, each (displacement; rotation where there is rotary inertia).
    fn inner(&self, a: &[f64], b: &[f64]) -> f64 {
        let split = 3 * self.mass.len();
        let translation = self.mass.iter().zip(a.chunks_exact(3).zip(b.chunks_exact(3)));
        let sum: f64 = translation.map(|(m, (u, v))| m * (u[0] * v[0] + u[1] * v[1] + u[2] * v[2])).sum();
        let Some(rotary) = self.rotary.as_ref().filter(|_| a.len() > split && b.len() > split) else { return sum };
        let turn = rotary.iter().zip(a[split..].chunks_exact(3).zip(b[split..].chunks_exact(3)));
        sum + turn.map(|(i, (u, v))| Vector3::from_column_slice(u).dot(&(i * Vector3::from_column_slice(v)))).sum::<f64>()
    }
}

impl LumpedSums {
    /// Reads nodes, masses and every mode shape.
    ///
    /// # Errors
    /// If a dataset is missing, of another type or shape, damaged or not finite.
    pub fn read(file: &ModalFile, supports: &[InterfaceSupport]) -> Result<Self, ModalFileError> {
        let header = file.header();
        let (n, nodes) = (header.mode_count, header.node_count);
        let points = file.read_points()?;
        let mass = file.sized("mesh/node_mass", &[nodes], "(nodes)")?.read_f64()?;
        let rotary = file.optional("mesh/node_inertia", &[nodes, 6], "(nodes, xx yy zz xy yz xz)")?;
        let rotary = rotary.map(|values| values.chunks_exact(6).map(symmetric).collect::<Vec<_>>());

        let mut inertia = Matrix3::zeros();
        for (m, r) in mass.iter().zip(&points) {
            inertia += *m * (r.norm_squared() * Matrix3::identity() - r * r.transpose());
        }
        inertia += rotary.iter().flatten().sum::<Matrix3<f64>>();
        let mut sums = Self {
            mass: mass.iter().sum(),
            first_moment: mass.iter().zip(&points).map(|(m, r)| *m * r).sum(),
            inertia,
            points,
            momentum: vec![Vector3::zeros(); n],
            modal_moment: vec![Matrix3::zeros(); n],
            modal_mass: DMatrix::zeros(n, n),
            largest_displacement: 0.0,
            largest_rotation: 0.0,
            root_motion: 0.0,
            interface_translation: vec![vec![Vector3::zeros(); n]; supports.len()],
            single_precision: false,
        };
        let inertias = NodalInertia { mass, rotary };
        let row_bytes = if file.has_rotation() { 48 } else { 24 };
        let tile = (TILE_BYTES / (row_bytes * nodes)).clamp(1, n);
        let mut start = 0;
        while start < n {
            let end = (start + tile).min(n);
            let mut kept: Vec<Vec<f64>> = Vec::with_capacity(end - start);
            for mode in start..n {
                // a later tile meets its own modes again; only the first pass over a mode takes its sums
                let shape = sums.read_shape(file, mode)?;
                if start == 0 {
                    sums.add_mode(mode, &shape, &inertias.mass, header.root_interface.as_str(), supports);
                }
                for (offset, other) in kept.iter().enumerate() {
                    let value = inertias.inner(other, &shape);
                    sums.modal_mass[(start + offset, mode)] = value;
                    sums.modal_mass[(mode, start + offset)] = value;
                }
                if mode < end {
                    sums.modal_mass[(mode, mode)] = inertias.inner(&shape, &shape);
                    kept.push(shape);
                }
            }
            start = end;
        }
        Ok(sums)
    }

    /// Displacement and, where given, rotation of every node in one mode.
    fn read_shape(&mut self, file: &ModalFile, mode: usize) -> Result<Vec<f64>, ModalFileError> {
        let (mut shape, single) = file.read_displacement(mode)?;
        self.single_precision |= single;
        if file.has_rotation() {
            shape.extend(file.displacement_dataset("rotation", mode)?.read_real()?);
        }
        Ok(shape)
    }

    fn add_mode(&mut self, mode: usize, shape: &[f64], mass: &[f64], root: &str, supports: &[InterfaceSupport]) {
        let (displacement, rotation) = shape.split_at(3 * mass.len());
        let displacement = vectors(displacement);
        for ((m, r), u) in mass.iter().zip(&self.points).zip(&displacement) {
            self.momentum[mode] += *m * u;
            self.modal_moment[mode] += *m * r * u.transpose();
            self.largest_displacement = self.largest_displacement.max(u.amax());
        }
        let rotation = vectors(rotation);
        self.largest_rotation = rotation.iter().map(Vector3::amax).fold(self.largest_rotation, f64::max);
        for (support, translation) in supports.iter().zip(&mut self.interface_translation) {
            translation[mode] = support.nodes.iter().zip(&support.weights).map(|(&node, w)| *w * displacement[node]).sum();
            if support.name == root {
                let motion = |values: &[Vector3<f64>]| {
                    support.nodes.iter().filter_map(|&node| values.get(node)).map(Vector3::amax).fold(0.0, f64::max)
                };
                self.root_motion = self.root_motion.max(motion(&displacement)).max(motion(&rotation));
            }
        }
    }
}

/// xx yy zz xy yz xz as a matrix.
fn symmetric(v: &[f64]) -> Matrix3<f64> {
    Matrix3::new(v[0], v[3], v[5], v[3], v[1], v[4], v[5], v[4], v[2])
}
