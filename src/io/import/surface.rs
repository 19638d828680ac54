//! Orientation of cells, outer faces of a mesh, and its triangles for pictures.

use super::cell::CellKind;
use super::error::{ImportError, refused};
use super::mesh::{CellBlock, ForeignModel};
use nalgebra::Vector3;
use std::collections::HashMap;

/// Positions of some nodes.
pub(super) fn positions(points: &[Vector3<f64>], nodes: &[usize]) -> Vec<Vector3<f64>> {
    nodes.iter().map(|&node| points[node]).collect()
}

/// Turns every solid of negative volume into its mirror image, which is the same solid with its nodes counted the other way round.
/// Returns how many were turned.
///
/// MED and VTK count the nodes of solids in opposite senses, and writers convert or not.
pub(super) fn orient(model: &mut ForeignModel) -> Result<usize, ImportError> {
    let mut turned = 0;
    let (points, file) = (&model.points, &model.file);
    for block in &mut model.blocks {
        let kind = block.kind;
        if kind == CellKind::Hexa27 {
            sort_face_nodes(block, points, file)?;
        }
        let mirror = kind.mirror();
        for (number, cell) in block.nodes.chunks_exact_mut(kind.node_count()).enumerate() {
            let (measure, size) = corner_measure(kind, cell, points);
            if !(measure.abs() > 1e-12 * size.powi(kind.dimension() as i32)) {
                let found = format!("a measure of {measure:.1e}");
                let object = format!("{} number {}", kind.name(), number + 1);
                return Err(refused(file, object, found, "a length, area or volume above zero", "repair the mesh, or leave the cell out"));
            }
            if measure < 0.0 {
                let old = cell.to_vec();
                cell.iter_mut().zip(&mirror).for_each(|(node, &from)| *node = old[from]);
                turned += 1;
            }
        }
    }
    Ok(turned)
}

/// Length, area or signed volume between the corners of a cell, and its size.
fn corner_measure(kind: CellKind, cell: &[usize], points: &[Vector3<f64>]) -> (f64, f64) {
    let at = |local: usize| points[cell[local]] - points[cell[0]];
    let corners = kind.corner_count();
    let size = (1..corners).map(|i| at(i).amax()).fold(0.0, f64::max);
    let measure = match kind.dimension() {
        1 => at(1).norm(),
        2 => (1..corners - 1).map(|i| at(i).cross(&at(i + 1))).sum::<Vector3<f64>>().norm() / 2.0,
        // divergence theorem over the fans of the faces
        _ => {
            let fan = |face: &&[usize]| (1..face.len() - 1).map(|i| at(face[0]).dot(&at(face[i]).cross(&at(face[i + 1])))).sum::<f64>();
            kind.faces().iter().map(fan).sum::<f64>() / 6.0
        }
    };
    (measure, size)
}

/// Puts the six nodes on the faces of triquadratic hexahedra into the order of VTK: codes count these faces differently, and the
/// node nearest to the middle of a face is the one that belongs to it.
fn sort_face_nodes(block: &mut CellBlock, points: &[Vector3<f64>], file: &std::path::Path) -> Result<(), ImportError> {
    const FACE_NODES: std::ops::Range<usize> = 20..26;
    let faces = CellKind::Hexa27.faces();
    for (number, cell) in block.nodes.chunks_exact_mut(27).enumerate() {
        let nearest = |corners: &&[usize]| {
            let middle: Vector3<f64> = corners.iter().map(|&c| points[cell[c]]).sum::<Vector3<f64>>() / corners.len() as f64;
            let distance = |&i: &usize| (points[cell[i]] - middle).norm_squared();
            FACE_NODES.min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|i| cell[i])
        };
        let sorted: Vec<usize> = faces.iter().filter_map(nearest).collect();
        let mut unique = sorted.clone();
        unique.sort_unstable();
        unique.dedup();
        if unique.len() != faces.len() {
            let object = format!("hexahedron27 number {}", number + 1);
            let (found, expected) = ("a node that is nearest to two faces", "one node in the middle of each face");
            return Err(refused(file, object, found, expected, "check the order of the nodes in the export"));
        }
        cell[FACE_NODES].copy_from_slice(&sorted);
    }
    Ok(())
}

/// A face or edge as a cell of its own.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Facet {
    pub kind: CellKind,
    pub nodes: Vec<usize>,
}

/// Faces that belong to one solid only, turned outward; of a mesh without solids the surface cells themselves.
pub(super) fn outer_facets(model: &ForeignModel) -> Vec<Facet> {
    let dimension = model.dimension();
    let blocks = model.blocks.iter().filter(|block| block.kind.dimension() == dimension);
    if dimension < 3 {
        let whole = |block: &CellBlock| block.cells().map(|cell| Facet { kind: block.kind, nodes: cell.to_vec() }).collect::<Vec<_>>();
        return blocks.flat_map(whole).collect();
    }
    let mut once: HashMap<[usize; 4], Option<(usize, usize, usize)>> = HashMap::new();
    let list: Vec<&CellBlock> = blocks.collect();
    for (b, block) in list.iter().enumerate() {
        for (c, cell) in block.cells().enumerate() {
            for (f, face) in block.kind.faces().iter().enumerate() {
                let mut corners = [usize::MAX; 4];
                corners.iter_mut().zip(face.iter()).for_each(|(corner, &local)| *corner = cell[local]);
                corners.sort_unstable();
                once.entry(corners).and_modify(|seen| *seen = None).or_insert(Some((b, c, f)));
            }
        }
    }
    let mut outer: Vec<(usize, usize, usize)> = once.into_values().flatten().collect();
    outer.sort_unstable();
    let facet = |(b, c, f): (usize, usize, usize)| {
        let block = list[b];
        let (kind, local) = block.kind.face_cell(f);
        let width = block.kind.node_count();
        Facet { kind, nodes: local.into_iter().map(|i| block.nodes[c * width + i]).collect() }
    };
    outer.into_iter().map(facet).collect()
}

/// Edges of surface cells.
pub(super) fn edges(facets: &[Facet]) -> Vec<Facet> {
    let mut seen: HashMap<[usize; 2], Facet> = HashMap::new();
    for facet in facets {
        for (number, &[a, b]) in facet.kind.edges().iter().enumerate() {
            let (a, b) = (facet.nodes[a], facet.nodes[b]);
            let middle = facet.kind.is_quadratic().then(|| facet.nodes[facet.kind.corner_count() + number]);
            let kind = if middle.is_some() { CellKind::Line3 } else { CellKind::Line2 };
            seen.entry([a.min(b), a.max(b)]).or_insert_with(|| Facet { kind, nodes: [a, b].into_iter().chain(middle).collect() });
        }
    }
    let mut edges: Vec<Facet> = seen.into_values().collect();
    edges.sort_by(|a, b| a.nodes.cmp(&b.nodes));
    edges
}

/// Corner triangles of facets.
pub(super) fn triangles(facets: &[Facet]) -> Vec<[usize; 3]> {
    let fan = |facet: &Facet| {
        let nodes = facet.nodes.clone();
        (1..facet.kind.corner_count() - 1).map(move |i| [nodes[0], nodes[i], nodes[i + 1]])
    };
    facets.iter().filter(|facet| facet.kind.dimension() == 2).flat_map(fan).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_on_faces_are_sorted_by_place_and_refused_where_that_is_ambiguous() {
        let mut points: Vec<Vector3<f64>> = CellKind::Hexa27.reference().into_iter().map(Vector3::from).collect();
        // the order of the MED library: lower, four sides, upper
        let mut nodes: Vec<usize> = (0..20).chain([24, 22, 21, 23, 20, 25, 26]).collect();
        let mut block = CellBlock { kind: CellKind::Hexa27, nodes: nodes.clone() };
        sort_face_nodes(&mut block, &points, std::path::Path::new("a.med")).unwrap();
        assert_eq!(block.nodes, (0..27).collect::<Vec<_>>());
        points[21] = points[20] + Vector3::new(0.0, 0.0, 1e-3);
        points[22] = points[20];
        nodes.swap(20, 21);
        let mut block = CellBlock { kind: CellKind::Hexa27, nodes };
        let text = sort_face_nodes(&mut block, &points, std::path::Path::new("a.med")).unwrap_err().to_string();
        let words = "a.med: hexahedron27 number 1: found a node that is nearest to two faces, expected one node in the middle of each face";
        assert!(text.starts_with(words), "{text}");
    }

    #[test]
    fn edges_of_quadratic_cells_keep_their_middle() {
        let facet = Facet { kind: CellKind::Triangle6, nodes: vec![4, 7, 9, 1, 2, 3] };
        let nodes: Vec<Vec<usize>> = edges(&[facet.clone(), facet]).into_iter().map(|edge| edge.nodes).collect();
        assert_eq!(nodes, [vec![4, 7, 1], vec![7, 9, 2], vec![9, 4, 3]]);
    }
}
