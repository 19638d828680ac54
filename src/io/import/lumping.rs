//! Nodal masses, and the sums over nodes that stand for the inertia integrals of a modal file.
//!
//! Density to masses: each node takes the integral of its shape function times the density (row sums of the consistent mass matrix). The
//! mass and its first moment are exact on any isoparametric cell, because both are linear in the shape functions; the inertia is exact on
//! straight quadratic cells. For linear and curved cells the masses are then matched to the second moments of the geometry (`moments`), and what
//! the nodes cannot hold of it becomes rotary inertia, so that mass, centre of mass and inertia of the body are those of its
//! geometry. Source: Zienkiewicz and Taylor, The Finite Element Method, on lumped mass matrices.

use super::element::Element;
use super::error::{ImportError, listed, refused};
use super::mesh::{FieldPlace, ForeignModel};
use super::moments::match_second_moment;
use super::options::MassSource;
use super::surface::positions;
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::collections::BTreeMap;

/// Rotary inertia below this share of the whole is the round-off of straight quadratic cells.
const ROUND_OFF: f64 = 1e-12;

/// Masses of the nodes.
#[derive(Debug)]
pub(super) struct NodalMass {
    /// kg, one per node.
    pub mass: Vec<f64>,
    /// Rotary inertia of all nodes together (kg m^2): what their masses leave over of the inertia of the geometry, of either sign.
    pub rotary: Option<Matrix3<f64>>,
    /// Attribute `kind` of `mesh/node_mass`.
    pub kind: &'static str,
    /// Where they come from, for the report.
    pub origin: String,
}

/// Masses as asked for.
pub(super) fn nodal_mass(model: &ForeignModel, source: Option<&MassSource>) -> Result<NodalMass, ImportError> {
    let nodes = model.points.len();
    let solver = |mass: Vec<f64>, origin: String| {
        let kind = if mass.iter().any(|m| *m < 0.0) { "row_sum_signed" } else { "solver" };
        NodalMass { mass, rotary: None, kind, origin }
    };
    let result = match source {
        None => {
            return Err(ImportError::Needed {
                file: model.file.clone(),
                key: "density, areal_density or node_mass".to_owned(),
                found: format!("the fields {}", model.field_names()),
                remedy: "give the density (kg/m^3), the mass per area (kg/m^2), a nodal field of masses or a list of them (kg)".to_owned(),
            });
        }
        Some(MassSource::Field(name)) => {
            let field = model.field(name).filter(|f| f.place == FieldPlace::Node && f.components.len() == 1 && f.steps.len() == 1);
            let Some(field) = field else {
                let expected = "a nodal field of one component and one step";
                let found = format!("the fields {}", model.field_names());
                return Err(refused(
                    &model.file,
                    format!("node_mass = \"{name}\""),
                    found,
                    expected,
                    "name such a field, or give a density",
                ));
            };
            solver(model.values(field, &field.steps[0])?, format!("from the field \"{name}\""))
        }
        Some(MassSource::Values(values)) if values.len() == nodes => solver(values.clone(), "as given".to_owned()),
        Some(MassSource::Values(values)) => {
            let (found, expected) = (format!("{} numbers", values.len()), format!("{nodes}: one per node in the order of the file"));
            return Err(refused(&model.file, "node_mass", found, expected, "give one mass per node"));
        }
        Some(MassSource::ArealDensity(density)) if model.dimension() == 2 => {
            lump(model, &|_, _| *density, &format!("from {density} kg/m^2 by row sums"))?
        }
        Some(MassSource::ArealDensity(_)) => {
            let expected = "a mesh of surface cells";
            return Err(refused(&model.file, "areal_density", "a mesh with volume cells", expected, "give density (kg/m^3) instead"));
        }
        Some(MassSource::Density(_) | MassSource::DensityByGroup(_)) if model.dimension() < 3 => {
            let remedy = "give areal_density (kg/m^2): thickness times density, skins and equipment included";
            return Err(refused(&model.file, "density", "a mesh without volume cells", "volume cells", remedy));
        }
        Some(MassSource::Density(density)) => lump(model, &|_, _| *density, &format!("from {density} kg/m^3 by row sums"))?,
        Some(MassSource::DensityByGroup(groups)) => {
            let density = densities(model, groups)?;
            lump(model, &|block, cell| density[block][cell], &format!("from the densities of {} groups by row sums", groups.len()))?
        }
    };
    let total: f64 = result.mass.iter().sum();
    if total > 0.0 && total <= 1e100 {
        return Ok(result);
    }
    Err(refused(&model.file, "the sum of the nodal masses", format!("{total} kg"), "more than zero", "check the sign and unit of the mass"))
}

/// Density of every cell, each volume cell in exactly one group.
fn densities(model: &ForeignModel, groups: &BTreeMap<String, f64>) -> Result<Vec<Vec<f64>>, ImportError> {
    let mut density: Vec<Vec<f64>> = model.blocks.iter().map(|block| vec![f64::NAN; block.cells().len()]).collect();
    for (name, &value) in groups {
        let Some(cells) = model.cell_groups.get(name) else {
            let found = format!("no group of cells \"{name}\"");
            let expected = format!("one of {}", listed(model.cell_groups.keys().map(String::as_str)));
            return Err(refused(&model.file, "density", found, expected, "name groups of volume cells"));
        };
        for &(block, cell) in cells {
            if !density[block][cell].is_nan() {
                let found = format!("cell {} of {} in \"{name}\" and another group", cell + 1, model.blocks[block].kind.name());
                return Err(refused(&model.file, "density", found, "each cell in one group", "leave one of the groups out"));
            }
            density[block][cell] = value;
        }
    }
    let open: usize = model
        .blocks
        .iter()
        .zip(&density)
        .filter(|(b, _)| b.kind.dimension() == 3)
        .map(|(_, d)| d.iter().filter(|v| v.is_nan()).count())
        .sum();
    if open == 0 {
        return Ok(density);
    }
    Err(ImportError::Needed {
        file: model.file.clone(),
        key: "density".to_owned(),
        found: format!("{open} volume cells in none of the groups {}", listed(groups.keys().map(String::as_str))),
        remedy: format!("give a density for every group of {}", listed(model.cell_groups.keys().map(String::as_str))),
    })
}

/// Row sums, matched to the second moment of the geometry, and the rotary inertia that completes them.
fn lump(model: &ForeignModel, density: &dyn Fn(usize, usize) -> f64, origin: &str) -> Result<NodalMass, ImportError> {
    let mut mass = vec![0.0; model.points.len()];
    let (mut left_over, mut second, mut whole) = (0.0, Matrix3::zeros(), 0.0);
    let dimension = model.dimension();
    for (b, block) in model.blocks.iter().enumerate().filter(|(_, block)| block.kind.dimension() == dimension) {
        let element = Element::of(block.kind);
        for (c, cell) in block.cells().enumerate() {
            let points = positions(&model.points, cell);
            let density = density(b, c);
            // about the cell itself, so that what it leaves over is not lost in its distance
            let center = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
            let local: Vec<Vector3<f64>> = points.iter().map(|p| p - center).collect();
            let integrals = element.integrate(&local);
            if !(integrals.worst > 0.0) {
                let object = format!("{} number {}", block.kind.name(), c + 1);
                let (found, expected) = ("a Jacobian that changes its sign", "a cell that is not folded");
                return Err(refused(&model.file, object, found, expected, "repair the mesh, or give node_mass"));
            }
            let lumped: Matrix3<f64> = integrals.weights.iter().zip(&local).map(|(w, r)| *w * r * r.transpose()).sum();
            let missing = density * (integrals.second - lumped);
            second += missing;
            left_over += missing.norm();
            whole += density * integrals.second.norm();
            cell.iter().zip(&integrals.weights).for_each(|(&node, w)| mass[node] += density * w);
        }
    }
    let mut origin = origin.to_owned();
    let mut rotary = None;
    if left_over > ROUND_OFF * whole {
        let lumped = |mass: &[f64]| -> Matrix3<f64> { mass.iter().zip(&model.points).map(|(m, r)| *m * r * r.transpose()).sum() };
        let target = lumped(&mass) + second;
        let change = match_second_moment(&model.points, &mut mass, &target);
        if change > 0.0 {
            origin = format!("{origin}, changed by at most {:.1} % for the exact inertia", 100.0 * change);
        }
        let missing = target - lumped(&mass);
        if missing.norm() > ROUND_OFF * target.norm() {
            origin = format!("{origin}, with rotary inertia that completes it");
            rotary = Some(missing.trace() * Matrix3::identity() - missing);
        }
    }
    let kind = if mass.iter().any(|m| *m < 0.0) { "row_sum_signed" } else { "row_sum" };
    Ok(NodalMass { mass, rotary, kind, origin })
}

/// Sums over nodes: what a modal file calls integrals. About the origin, body axes.
#[derive(Debug)]
pub(super) struct Tensors {
    pub mass: f64,
    pub center_of_mass: Vector3<f64>,
    pub inertia: Matrix3<f64>,
    pub momentum: Vec<Vector3<f64>>,
    pub first_moment: Vec<Matrix3<f64>>,
    /// `j * n + k`.
    pub second_moment: Vec<Matrix3<f64>>,
}

impl Tensors {
    /// Of nodes with masses and mode shapes (x y z of every node in turn).
    pub fn of(points: &[Vector3<f64>], nodal: &NodalMass, shapes: &[Vec<f64>]) -> Self {
        let n = shapes.len();
        let weighted = || nodal.mass.iter().zip(points);
        let mass: f64 = nodal.mass.iter().sum();
        let first: Vector3<f64> = weighted().map(|(m, r)| *m * r).sum();
        let mut inertia: Matrix3<f64> = weighted().map(|(m, r)| *m * (r.norm_squared() * Matrix3::identity() - r * r.transpose())).sum();
        inertia += nodal.rotary.unwrap_or_else(Matrix3::zeros);
        inertia = 0.5 * (inertia + inertia.transpose());
        let vector = |shape: &[f64], node: usize| Vector3::new(shape[3 * node], shape[3 * node + 1], shape[3 * node + 2]);
        let each = |shape: &Vec<f64>| {
            let sum = weighted().enumerate().map(|(i, (m, r))| (*m * vector(shape, i), r));
            sum.fold((Vector3::zeros(), Matrix3::zeros()), |(p, q), (u, r)| (p + u, q + r * u.transpose()))
        };
        let (momentum, first_moment) = shapes.iter().map(each).unzip();
        let second = |j: usize, k: usize| -> Matrix3<f64> {
            nodal.mass.iter().enumerate().map(|(i, m)| *m * vector(&shapes[j], i) * vector(&shapes[k], i).transpose()).sum()
        };
        let mut second_moment = vec![Matrix3::zeros(); n * n];
        for j in 0..n {
            for k in 0..=j {
                let value = second(j, k);
                let value = if j == k { 0.5 * (value + value.transpose()) } else { value };
                second_moment[j * n + k] = value;
                second_moment[k * n + j] = value.transpose();
            }
        }
        Self { mass, center_of_mass: first / mass, inertia, momentum, first_moment, second_moment }
    }
}

impl Tensors {
    /// True if the modes turn no more inertia than the body has, about any axis.
    pub fn modes_fit_the_inertia(&self) -> bool {
        let turning = |q: &Matrix3<f64>| Vector3::new(q[(1, 2)] - q[(2, 1)], q[(2, 0)] - q[(0, 2)], q[(0, 1)] - q[(1, 0)]);
        let effective: Vector3<f64> = self.first_moment.iter().map(turning).map(|l| l.component_mul(&l)).sum();
        (0..3).all(|a| effective[a] <= self.inertia[(a, a)] * (1.0 + 1e-10))
    }
}

/// Modal mass matrix of mode shapes.
pub(super) fn modal_mass(mass: &[f64], shapes: &[Vec<f64>]) -> DMatrix<f64> {
    let n = shapes.len();
    let mut matrix = DMatrix::zeros(n, n);
    for j in 0..n {
        for k in 0..=j {
            let pairs = shapes[j].chunks_exact(3).zip(shapes[k].chunks_exact(3));
            let value: f64 = mass.iter().zip(pairs).map(|(m, (u, v))| m * (u[0] * v[0] + u[1] * v[1] + u[2] * v[2])).sum();
            matrix[(j, k)] = value;
            matrix[(k, j)] = value;
        }
    }
    matrix
}
