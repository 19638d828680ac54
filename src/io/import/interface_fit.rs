//! Interfaces: which nodes carry them, and the rigid motion that fits the motion of these nodes best.
//!
//! The fit is the area-weighted least-squares rigid motion about the centroid (RBE3): with `A` the matrix of products of shape functions over the
//! faces between the nodes and `R` the rigid motions of the nodes, `(R' A R)^-1 R' A`. About the centroid its translation is the
//! weighted mean. Nodes of surface meshes are weighted by the area of whole cells or else the length of edges between them, nodes that have neither
//! between them all alike.

use super::cell::CellKind;
use super::element::Element;
use super::error::{ImportError, listed, refused};
use super::mesh::{FieldPlace, ForeignModel};
use super::options::Selection;
use super::surface::{Facet, edges, positions};
use nalgebra::{Matrix3, Matrix6, SMatrix, SymmetricEigen, Vector3, Vector6};
use std::collections::{BTreeMap, BTreeSet};

/// Smallest relative eigenvalue of `R' A R` at which a rotation can still be told from the motion of the nodes.
const RANK: f64 = 1e-9;

/// An interface before modes: nodes, weights, and the map from their motion to its own.
#[derive(Debug)]
pub(super) struct Fit {
    /// Nodes that carry weight, ascending.
    pub nodes: Vec<usize>,
    /// One per node, sum 1.
    pub weights: Vec<f64>,
    /// Weighted mean of the nodes.
    pub position: Vector3<f64>,
    /// Contribution of each node's displacement to (translation; rotation); none where the nodes do not determine a rotation.
    map: Option<Vec<SMatrix<f64, 6, 3>>>,
    /// What the weights are, for the report.
    pub weighting: &'static str,
    /// Nodes that were selected and carry no weight.
    pub idle: usize,
}

/// Nodes of a selection, ascending.
pub(super) fn select(model: &ForeignModel, name: &str, selection: &Selection) -> Result<Vec<usize>, ImportError> {
    let object = format!("interface \"{name}\"");
    let nodes: BTreeSet<usize> = match selection {
        Selection::Nodes(nodes) => {
            if let Some(wrong) = nodes.iter().find(|&&node| node >= model.points.len()) {
                let expected = format!("0 to {}", model.points.len() - 1);
                return Err(refused(&model.file, object, format!("node {wrong}"), expected, "count the nodes of the file from 0"));
            }
            nodes.iter().copied().collect()
        }
        Selection::Box { low, high } => {
            let size = model.points.iter().map(Vector3::amax).fold(0.0, f64::max);
            let margin = Vector3::repeat(1e-9 * size);
            let inside = |p: &Vector3<f64>| (p - low + margin).min() >= 0.0 && (high - p + margin).min() >= 0.0;
            (0..model.points.len()).filter(|&node| inside(&model.points[node])).collect()
        }
        Selection::Group(group) => group_nodes(model, &object, group)?,
    };
    if nodes.is_empty() {
        let (low, high) = bounds(model);
        let expected = format!("at least one of the mesh from {low:?} to {high:?}");
        return Err(refused(&model.file, object, "no node", expected, "name another group, or correct the box"));
    }
    Ok(nodes.into_iter().collect())
}

/// Nodes of a group of nodes or cells, or where a nodal field is not zero.
fn group_nodes(model: &ForeignModel, object: &str, group: &str) -> Result<BTreeSet<usize>, ImportError> {
    if let Some(nodes) = model.node_groups.get(group) {
        return Ok(nodes.iter().copied().collect());
    }
    if let Some(cells) = model.cell_groups.get(group) {
        let nodes = |&(block, cell): &(usize, usize)| {
            let width = model.blocks[block].kind.node_count();
            model.blocks[block].nodes[cell * width..(cell + 1) * width].iter().copied()
        };
        return Ok(cells.iter().flat_map(nodes).collect());
    }
    let marks = model.field(group).filter(|f| f.place == FieldPlace::Node && f.components.len() == 1);
    if let Some(field) = marks {
        let values = model.values(field, &field.steps[0])?;
        return Ok(values.iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(node, _)| node).collect());
    }
    let fields = model.fields.iter().filter(|f| f.place == FieldPlace::Node && f.components.len() == 1).map(|f| f.name.as_str());
    let names = model.node_groups.keys().chain(model.cell_groups.keys()).map(String::as_str).chain(fields);
    let expected = format!("one of {}", listed(names));
    Err(refused(&model.file, object, format!("no group \"{group}\""), expected, "name a group or nodal field of the file, or give a box"))
}

/// Least and greatest coordinates.
pub(super) fn bounds(model: &ForeignModel) -> ([f64; 3], [f64; 3]) {
    let start = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    let (low, high) = model.points.iter().fold(start, |(low, high), p| (low.inf(p), high.sup(p)));
    (low.into(), high.into())
}

/// Products of shape functions between nodes, by node of the selection.
type Products = BTreeMap<(usize, usize), f64>;

/// The facets whose nodes are all selected, by the first kind that has any.
fn weigh(model: &ForeignModel, selected: &BTreeSet<usize>, outer: &[Facet]) -> (Products, &'static str) {
    let within = |facets: &[Facet]| -> Products {
        let mut products = Products::new();
        let mut elements: Vec<(CellKind, Element)> = Vec::new();
        for facet in facets.iter().filter(|facet| facet.nodes.iter().all(|node| selected.contains(node))) {
            let known = elements.iter().position(|(kind, _)| *kind == facet.kind);
            let element = known.unwrap_or_else(|| {
                elements.push((facet.kind, Element::of(facet.kind)));
                elements.len() - 1
            });
            let matrix = elements[element].1.products(&positions(&model.points, &facet.nodes));
            for (i, &a) in facet.nodes.iter().enumerate() {
                facet.nodes.iter().enumerate().for_each(|(j, &b)| *products.entry((a, b)).or_default() += matrix[(i, j)]);
            }
        }
        products
    };
    let by_area = within(outer);
    if !by_area.is_empty() {
        return (by_area, "area");
    }
    let by_length = if model.dimension() == 2 { within(&edges(outer)) } else { Products::new() };
    if !by_length.is_empty() {
        return (by_length, "length");
    }
    let share = 1.0 / selected.len() as f64;
    (selected.iter().map(|&node| ((node, node), share)).collect(), "equal")
}

/// Rigid motions (translation, rotation) at a place relative to the centroid.
fn rigid(r: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let mut motions = SMatrix::<f64, 3, 6>::zeros();
    motions.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    motions.fixed_view_mut::<3, 3>(0, 3).copy_from(&-r.cross_matrix());
    motions
}

/// Fits an interface to selected nodes; `outer` are the outer facets of the mesh.
pub(super) fn fit(model: &ForeignModel, selected: &[usize], outer: &[Facet]) -> Fit {
    let set: BTreeSet<usize> = selected.iter().copied().collect();
    let (products, weighting) = weigh(model, &set, outer);
    let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
    for (&(a, _), value) in &products {
        *sums.entry(a).or_default() += value;
    }
    let total: f64 = sums.values().sum();
    let nodes: Vec<usize> = sums.keys().copied().collect();
    let weights: Vec<f64> = sums.values().map(|value| value / total).collect();
    let position: Vector3<f64> = nodes.iter().zip(&weights).map(|(&node, w)| *w * model.points[node]).sum();

    let place = |node: usize| model.points[node] - position;
    // rotations in units of the size of the interface, so that the eigenvalues compare
    let size = nodes.iter().map(|&node| place(node).norm()).fold(0.0, f64::max);
    let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
    let scaled = |node: usize| rigid(&(scale * place(node)));
    let mut normal = Matrix6::zeros();
    let mut columns: BTreeMap<usize, SMatrix<f64, 6, 3>> = BTreeMap::new();
    for (&(a, b), value) in &products {
        let left = scaled(a).transpose() * (*value / total);
        *columns.entry(b).or_insert_with(SMatrix::zeros) += left;
        normal += left * scaled(b);
    }
    let normal = 0.5 * (normal + normal.transpose());
    let eigenvalues = SymmetricEigen::new(normal).eigenvalues;
    let inverse = if eigenvalues.min() > RANK * eigenvalues.max() { normal.try_inverse() } else { None };
    let map = inverse.map(|inverse| {
        let unscale = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, scale, scale, scale));
        columns.values().map(|column| unscale * inverse * column).collect()
    });
    Fit { idle: selected.len() - nodes.len(), nodes, weights, position, map, weighting }
}

impl Fit {
    /// True if the displacements of the nodes determine the rotation.
    pub fn turns(&self) -> bool {
        self.map.is_some()
    }

    /// (ux uy uz rx ry rz) of the interface in one mode; `rotation` are nodal rotations, used where displacements do not tell.
    pub fn measure(&self, displacement: &[f64], rotation: Option<&[f64]>) -> [f64; 6] {
        let at = |values: &[f64], node: usize| Vector3::new(values[3 * node], values[3 * node + 1], values[3 * node + 2]);
        let mean = |values: &[f64]| -> Vector3<f64> { self.nodes.iter().zip(&self.weights).map(|(&node, w)| *w * at(values, node)).sum() };
        let six = match (&self.map, rotation) {
            (Some(map), _) => self.nodes.iter().zip(map).map(|(&node, f)| f * at(displacement, node)).sum::<Vector6<f64>>(),
            (None, Some(rotation)) => {
                let (u, r) = (mean(displacement), mean(rotation));
                Vector6::new(u.x, u.y, u.z, r.x, r.y, r.z)
            }
            // refused before, because a rotation would have to be made up
            (None, None) => Vector6::repeat(f64::NAN),
        };
        six.into()
    }
}
