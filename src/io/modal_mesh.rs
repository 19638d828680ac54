//! Per-node data of a modal file, read on demand: the surface for pictures, stress modes, and single nodes for point loads.
//!
//! Surface-corner and interface nodes come first in a modal file, so the surface costs S rows of each dataset, not N.

use super::array::ElementType;
use super::error::ModalFileError;
use super::modal_file::{ModalFile, vectors};
use crate::model::ModeBasis;
use crate::model::surface::{StressModes, StressPlace, Surface};
use crate::spatial::shift::spatial;
use nalgebra::{Vector3, Vector6};

impl ModalFile {
    /// The surface with the modes `basis`.
    ///
    /// # Errors
    /// As [`Self::read_surface`].
    pub fn read_surface_in(&self, basis: &ModeBasis) -> Result<Surface, ModalFileError> {
        if !basis.has_residual() {
            return self.read_surface(&basis.whole);
        }
        let mut surface = self.read_surface(&(0..basis.available()).collect::<Vec<_>>())?;
        surface.displacement = combined(&surface.displacement, basis);
        if let Some(stress) = &mut surface.stress {
            stress.values = combined(&stress.values, basis);
        }
        Ok(surface)
    }

    /// The surface with the modes `modes` (0-based, in that order).
    ///
    /// # Errors
    /// If a dataset is missing, of another type or shape, damaged or not finite, a mode is out of range, or a triangle belongs to no cell.
    pub fn read_surface(&self, modes: &[usize]) -> Result<Surface, ModalFileError> {
        modes.iter().try_for_each(|&mode| self.check_mode(mode))?;
        let (nodes, surface) = (self.header().node_count, self.header().surface_nodes);
        let points = self.sized("mesh/points", &[nodes, 3], "(nodes, 3)")?.read_real_rows(0..surface)?;
        let triangles = self.read_surface_triangles()?;
        let displacement = modes.iter().map(|&mode| {
            let values = self.displacement_dataset("displacement", mode)?.read_real_rows(0..surface)?;
            Ok(values.chunks_exact(3).map(|u| [u[0] as f32, u[1] as f32, u[2] as f32]).collect())
        });
        let displacement = displacement.collect::<Result<_, ModalFileError>>()?;
        let stress = match self.stress_location()? {
            Some(location) => Some(self.read_stress(location, modes, &triangles)?),
            None => None,
        };
        Ok(Surface { points: points.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect(), triangles, displacement, stress })
    }

    /// Displacement (m per unit modal coordinate, body axes) of one node in every mode, length n.
    ///
    /// # Errors
    /// If the node is out of range, or a dataset is missing, of another type or shape, damaged or not finite.
    pub fn node_displacement(&self, node: usize) -> Result<Vec<Vector3<f64>>, ModalFileError> {
        self.read_node("displacement", node)
    }

    /// Rotation (rad per unit modal coordinate, body axes) of one node in every mode, length n, where the file has nodal rotations.
    ///
    /// # Errors
    /// As [`Self::node_displacement`].
    pub fn node_rotation(&self, node: usize) -> Result<Option<Vec<Vector3<f64>>>, ModalFileError> {
        if self.has_rotation() { self.read_node("rotation", node).map(Some) } else { Ok(None) }
    }

    /// Shape (rotation; translation) of one node in every mode, length n; without rotation where the file has no nodal rotations.
    ///
    /// # Errors
    /// As [`Self::node_displacement`].
    pub fn node_shape(&self, node: usize) -> Result<Vec<Vector6<f64>>, ModalFileError> {
        let rotation = self.node_rotation(node)?;
        let displacement = self.node_displacement(node)?;
        let turn = |mode: usize| rotation.as_ref().map_or_else(Vector3::zeros, |r| r[mode]);
        Ok(displacement.iter().enumerate().map(|(mode, u)| spatial(&turn(mode), u)).collect())
    }

    /// Undeformed position (m, body axes) of one node.
    ///
    /// # Errors
    /// As [`Self::node_displacement`].
    pub fn node_position(&self, node: usize) -> Result<Vector3<f64>, ModalFileError> {
        self.check_node(node)?;
        let row = self.sized("mesh/points", &[self.header().node_count, 3], "(nodes, 3)")?.read_real_rows(node..node + 1)?;
        Ok(Vector3::from_column_slice(&row))
    }

    /// Where the stress modes of the file sit, if it has any.
    ///
    /// # Errors
    /// If the attribute is missing or unknown.
    pub fn stress_location(&self) -> Result<Option<StressPlace>, ModalFileError> {
        const GROUP: &str = "modes/stress";
        if !self.file.has(GROUP) {
            return Ok(None);
        }
        match self.file.text(GROUP, "location")?.as_str() {
            "node" => Ok(Some(StressPlace::Node)),
            "cell" => Ok(Some(StressPlace::Triangle)),
            other => Err(self.wrong_value("modes/stress@location", &format!("\"{other}\""), "node or cell", "state where the stress sits")),
        }
    }

    /// Number of cells E and nodes per cell.
    pub(super) fn cell_shape(&self) -> Result<(usize, usize), ModalFileError> {
        let cells = self.file.dataset("mesh/cells")?.expect_shape(&[None, None], "(cells, nodes per cell)")?;
        Ok((cells.shape[0], cells.shape[1]))
    }

    /// Outward triangles, every index below S.
    pub(super) fn read_surface_triangles(&self) -> Result<Vec<[u32; 3]>, ModalFileError> {
        let surface = self.header().surface_nodes;
        let dataset = self.file.dataset("mesh/surface_triangles")?.expect_shape(&[None, Some(3)], "(triangles, 3)")?;
        if u32::try_from(surface).is_err() {
            return Err(self.wrong_value("mesh/points@surface_nodes", &surface.to_string(), "below 2^32", "coarsen the surface"));
        }
        let indices = dataset.read_indices(surface)?;
        Ok(indices.chunks_exact(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect())
    }

    /// Nodes of every cell in turn, every index below N, and the number per cell.
    pub(super) fn read_cells(&self) -> Result<(Vec<usize>, usize), ModalFileError> {
        let dataset = self.file.dataset("mesh/cells")?.expect_shape(&[None, None], "(cells, nodes per cell)")?;
        let per_cell = dataset.shape[1];
        Ok((dataset.read_indices(self.header().node_count)?, per_cell))
    }

    fn read_stress(&self, location: StressPlace, modes: &[usize], triangles: &[[u32; 3]]) -> Result<StressModes, ModalFileError> {
        let owners = match location {
            StressPlace::Node => None,
            StressPlace::Triangle => Some(self.owning_cells(triangles)?),
        };
        let rows = self.stress_rows(location)?;
        let mut values = Vec::with_capacity(modes.len());
        for &mode in modes {
            let dataset = self.stress_dataset(mode, rows)?;
            values.push(match &owners {
                None => sixes(&dataset.read_real_rows(0..self.header().surface_nodes)?),
                Some(owners) => {
                    let cells = sixes(&dataset.read_real()?);
                    owners.iter().map(|&cell| cells[cell]).collect()
                }
            });
        }
        Ok(StressModes { place: location, values })
    }

    /// Rows of a stress dataset: N, or E for stress per cell.
    pub(super) fn stress_rows(&self, location: StressPlace) -> Result<usize, ModalFileError> {
        match location {
            StressPlace::Node => Ok(self.header().node_count),
            StressPlace::Triangle => Ok(self.cell_shape()?.0),
        }
    }

    /// One stress mode, in single precision.
    pub(super) fn stress_dataset(&self, mode: usize, rows: usize) -> Result<super::array::GuardedDataset<'_>, ModalFileError> {
        let path = format!("modes/stress/{mode:04}");
        let dataset = self.sized(&path, &[rows, 6], "(nodes or cells, xx yy zz xy yz xz)")?;
        if matches!(dataset.element, ElementType::F4 | ElementType::F8) {
            Ok(dataset)
        } else {
            Err(self.file.wrong_type(&path, dataset.element.name(), "f4"))
        }
    }

    /// The cell behind each triangle: the one cell that holds its three nodes.
    fn owning_cells(&self, triangles: &[[u32; 3]]) -> Result<Vec<usize>, ModalFileError> {
        let surface = self.header().surface_nodes;
        let (cells, per_cell) = self.read_cells()?;
        let mut around = vec![Vec::<u32>::new(); surface];
        for (cell, nodes) in cells.chunks_exact(per_cell.max(1)).enumerate() {
            nodes.iter().filter(|&&node| node < surface).for_each(|&node| around[node].push(cell as u32));
        }
        let owner = |(index, [a, b, c]): (usize, &[u32; 3])| {
            let [a, b, c] = [*a, *b, *c].map(|node| &around[node as usize]);
            let cell = a.iter().find(|cell| b.contains(cell) && c.contains(cell));
            cell.map(|&cell| cell as usize).ok_or_else(|| {
                let found = format!("triangle {index} on no cell");
                self.wrong_value(
                    "mesh/surface_triangles",
                    &found,
                    "three nodes of one cell",
                    "take the triangles from the faces of mesh/cells",
                )
            })
        };
        triangles.iter().enumerate().map(owner).collect()
    }

    fn read_node(&self, quantity: &str, node: usize) -> Result<Vec<Vector3<f64>>, ModalFileError> {
        self.check_node(node)?;
        let mut rows = Vec::with_capacity(3 * self.header().mode_count);
        for mode in 0..self.header().mode_count {
            rows.extend(self.displacement_dataset(quantity, mode)?.read_real_rows(node..node + 1)?);
        }
        Ok(vectors(&rows))
    }

    fn check_node(&self, node: usize) -> Result<(), ModalFileError> {
        let nodes = self.header().node_count;
        if node < nodes {
            return Ok(());
        }
        Err(self.wrong_value(
            "mesh/points",
            &format!("no node {node}"),
            &format!("a node from 0 to {}", nodes - 1),
            "name a node of this mesh",
        ))
    }

    fn check_mode(&self, mode: usize) -> Result<(), ModalFileError> {
        let modes = self.header().mode_count;
        if mode < modes {
            return Ok(());
        }
        let found = format!("no mode {} (counted from 1)", mode + 1);
        Err(self.wrong_value("modes/frequency", &found, &format!("a mode from 1 to {modes}"), "name a mode of this file"))
    }
}

/// Rows of six in single precision.
fn sixes(values: &[f64]) -> Vec<[f32; 6]> {
    values.chunks_exact(6).map(|s| [s[0], s[1], s[2], s[3], s[4], s[5]].map(|v| v as f32)).collect()
}

/// Values per node in single precision, given for each mode of the file, for each mode of `basis`; summed in double precision.
fn combined<const N: usize>(of_mode: &[Vec<[f32; N]>], basis: &ModeBasis) -> Vec<Vec<[f32; N]>> {
    let mut all: Vec<_> = basis.whole.iter().map(|&j| of_mode[j].clone()).collect();
    for column in basis.residual.column_iter() {
        let mut sum = vec![[0.0_f64; N]; of_mode.first().map_or(0, Vec::len)];
        for (values, factor) in of_mode.iter().zip(column.iter()).filter(|(_, f)| **f != 0.0) {
            for (sum, value) in sum.iter_mut().zip(values) {
                (0..N).for_each(|i| sum[i] += factor * f64::from(value[i]));
            }
        }
        all.push(sum.into_iter().map(|s| s.map(|x| x as f32)).collect());
    }
    all
}
