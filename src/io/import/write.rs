//! The arrays of a modal file from an imported body: nodes of the surface and of interfaces first, cells of one kind.

use super::cell::{CellKind, Family};
use super::lumping::{NodalMass, Tensors};
use super::mesh::{CellBlock, FieldPlace, ForeignModel};
use super::surface::{Facet, triangles};
use crate::io::Coupling;
use crate::io::modal_writer::{Contents, Values};
use crate::model::modal_body::Boundary;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;

/// An interface with its motion in every mode.
#[derive(Debug)]
pub(super) struct PlacedInterface {
    pub name: String,
    pub coupling: Coupling,
    pub position: Vector3<f64>,
    pub nodes: Vec<usize>,
    pub weights: Vec<f64>,
    /// ux uy uz rx ry rz per mode.
    pub displacement: Vec<[f64; 6]>,
}

/// Everything but mesh and cells.
#[derive(Debug)]
pub(super) struct BodyParts {
    pub title: String,
    pub generator: String,
    pub boundary: Boundary,
    pub root: String,
    pub frequency_hz: Vec<f64>,
    pub damping_ratio: Vec<f64>,
    pub departure: f64,
    pub nodal: NodalMass,
    pub tensors: Tensors,
    pub interfaces: Vec<PlacedInterface>,
    pub displacement: Vec<Vec<f64>>,
    pub rotation: Option<Vec<Vec<f64>>>,
    pub stress: Option<(FieldPlace, Vec<Vec<f64>>)>,
}

/// Everything that goes into the file.
pub(super) fn contents(model: &ForeignModel, outer: &[Facet], parts: BodyParts) -> Contents {
    let mut contents = Contents::default();
    let (nodes, modes) = (model.points.len(), parts.frequency_hz.len());
    let triangles = triangles(outer);
    let order = surface_first(nodes, &triangles, &parts.interfaces);
    let mut number = vec![0; nodes];
    order.nodes.iter().enumerate().for_each(|(new, &old)| number[old] = new);

    for (name, value) in [
        ("format", "flexible-body-modes"),
        ("version", "1.0"),
        ("units", "m kg s rad Pa Hz"),
        ("title", &parts.title),
        ("generator", &parts.generator),
        ("boundary", parts.boundary.name()),
        ("root_interface", &parts.root),
    ] {
        contents.text("", name, value);
    }
    contents.count("", "mode_count", modes);
    contents.count("", "node_count", nodes);

    let points: Vec<f64> = order.nodes.iter().flat_map(|&node| <[f64; 3]>::from(model.points[node])).collect();
    contents.array("mesh/points", &[nodes, 3], Values::F8(points));
    contents.count("mesh/points", "surface_nodes", order.surface);
    let (kind, cells) = cells(model);
    contents.array("mesh/cells", &[cells.len() / kind.node_count(), kind.node_count()], indices(cells.iter().map(|&node| number[node])));
    contents.text("mesh/cells", "cell_type", kind.name());
    contents.count("mesh/cells", "vtk_type", kind.vtk_type() as usize);
    contents.array("mesh/surface_triangles", &[triangles.len(), 3], indices(triangles.iter().flatten().map(|&node| number[node])));
    contents.array("mesh/node_mass", &[nodes], Values::F8(order.nodes.iter().map(|&node| parts.nodal.mass[node]).collect()));
    contents.text("mesh/node_mass", "kind", parts.nodal.kind);
    contents.text("mesh/node_mass", "origin", parts.nodal.origin);
    if let Some(rotary) = &parts.nodal.rotary {
        let total: f64 = parts.nodal.mass.iter().map(|m| m.abs()).sum();
        let six = |m: Matrix3<f64>| [m[(0, 0)], m[(1, 1)], m[(2, 2)], m[(0, 1)], m[(1, 2)], m[(0, 2)]];
        contents.array(
            "mesh/node_inertia",
            &[nodes, 6],
            Values::F8(order.nodes.iter().flat_map(|&node| six(rotary * (parts.nodal.mass[node].abs() / total))).collect()),
        );
    }

    let tensors = parts.tensors;
    contents.array("body/mass", &[], Values::F8(vec![tensors.mass]));
    contents.array("body/center_of_mass", &[3], Values::F8(tensors.center_of_mass.iter().copied().collect()));
    contents.array("body/inertia", &[3, 3], Values::F8(rows(&[tensors.inertia])));
    contents.array("inertia/momentum", &[modes, 3], Values::F8(tensors.momentum.iter().flat_map(|p| <[f64; 3]>::from(*p)).collect()));
    contents.array("inertia/first_moment", &[modes, 3, 3], Values::F8(rows(&tensors.first_moment)));
    contents.array("inertia/second_moment", &[modes, modes, 3, 3], Values::F8(rows(&tensors.second_moment)));
    contents.text("inertia", "source", "lumped");
    contents.text("inertia", "departure", format!("{:e}", parts.departure));

    contents.array("modes/frequency", &[modes], Values::F8(parts.frequency_hz));
    contents.array("modes/damping_ratio", &[modes], Values::F8(parts.damping_ratio));
    let kind = u8::from(parts.boundary == Boundary::CraigBampton);
    contents.array("modes/kind", &[modes], Values::U1(vec![kind; modes]));
    let reordered = |values: &[f64], width: usize| -> Vec<f64> {
        order.nodes.iter().flat_map(|&node| values[width * node..width * (node + 1)].iter().copied()).collect()
    };
    for (name, shapes) in [("displacement", Some(&parts.displacement)), ("rotation", parts.rotation.as_ref())] {
        for (j, shape) in shapes.into_iter().flatten().enumerate() {
            contents.array(format!("modes/{name}/{j:04}"), &[nodes, 3], Values::F8(reordered(shape, 3)));
        }
    }
    if let Some((place, states)) = &parts.stress {
        for (j, state) in states.iter().enumerate() {
            let values = if *place == FieldPlace::Node { reordered(state, 6) } else { of_kept_cells(model, state) };
            let values: Vec<f32> = values.into_iter().map(|v| v as f32).collect();
            contents.array(format!("modes/stress/{j:04}"), &[values.len() / 6, 6], Values::F4(values));
        }
        contents.text("modes/stress", "location", if *place == FieldPlace::Node { "node" } else { "cell" });
    }
    for interface in parts.interfaces {
        let at = |name: &str| format!("interfaces/{}/{name}", interface.name);
        let count = interface.nodes.len();
        contents.array(at("position"), &[3], Values::F8(interface.position.iter().copied().collect()));
        contents.array(at("nodes"), &[count], indices(interface.nodes.iter().map(|&node| number[node])));
        contents.array(at("weights"), &[count], Values::F8(interface.weights));
        contents.array(at("displacement"), &[modes, 6], Values::F8(interface.displacement.concat()));
        let held = parts.boundary.holds_root() && interface.name == parts.root;
        let coupling = if held { Coupling::Fixed } else { interface.coupling };
        contents.text(format!("interfaces/{}", interface.name), "coupling", coupling.name());
    }
    contents
}

fn indices(values: impl Iterator<Item = usize>) -> Values {
    Values::I8(values.map(|v| v as i64).collect())
}

fn rows(matrices: &[Matrix3<f64>]) -> Vec<f64> {
    matrices.iter().flat_map(|m| m.transpose().iter().copied().collect::<Vec<_>>()).collect()
}

/// Old number of each new node, and how many come first because the surface or an interface needs them.
struct Order {
    nodes: Vec<usize>,
    surface: usize,
}

fn surface_first(nodes: usize, triangles: &[[usize; 3]], interfaces: &[PlacedInterface]) -> Order {
    let leading: BTreeSet<usize> = triangles.iter().flatten().chain(interfaces.iter().flat_map(|i| &i.nodes)).copied().collect();
    let surface = leading.len();
    let rest = (0..nodes).filter(|node| !leading.contains(node));
    Order { nodes: leading.iter().copied().chain(rest).collect(), surface }
}

/// Blocks of the dimension that carries mass.
fn kept(model: &ForeignModel) -> impl Iterator<Item = &CellBlock> {
    let dimension = model.dimension();
    model.blocks.iter().filter(move |block| block.kind.dimension() == dimension)
}

/// Cells of one kind: their own, or, of several kinds, hexahedra and quadrilaterals some of whose corners coincide.
fn cells(model: &ForeignModel) -> (CellKind, Vec<usize>) {
    let mut blocks = kept(model).peekable();
    let first = blocks.peek().map_or(CellKind::Hexa8, |block| block.kind);
    if kept(model).all(|block| block.kind == first) {
        return (first, blocks.flat_map(|block| block.nodes.iter().copied()).collect());
    }
    let collapsed = |block: &CellBlock| -> Vec<usize> {
        let pattern: &[usize] = match block.kind.family() {
            Family::Tetra => &[0, 1, 2, 2, 3, 3, 3, 3],
            Family::Pyramid => &[0, 1, 2, 3, 4, 4, 4, 4],
            Family::Wedge => &[0, 1, 2, 2, 3, 4, 5, 5],
            Family::Hexa => &[0, 1, 2, 3, 4, 5, 6, 7],
            Family::Triangle => &[0, 1, 2, 2],
            Family::Quad | Family::Line => &[0, 1, 2, 3],
        };
        block.cells().flat_map(|cell| pattern.iter().map(|&local| cell[local])).collect()
    };
    let kind = if model.dimension() == 3 { CellKind::Hexa8 } else { CellKind::Quad4 };
    (kind, blocks.flat_map(collapsed).collect())
}

/// Rows of the cells that are kept.
fn of_kept_cells(model: &ForeignModel, values: &[f64]) -> Vec<f64> {
    let dimension = model.dimension();
    let mut row = 0;
    let mut kept = Vec::new();
    for block in &model.blocks {
        let end = row + block.cells().len();
        if block.kind.dimension() == dimension {
            kept.extend_from_slice(&values[6 * row..6 * end]);
        }
        row = end;
    }
    kept
}
