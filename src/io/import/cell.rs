//! Cell types: nodes, edges, faces and reference coordinates, all in VTK order with positive orientation.
//!
//! A solid is positive if its base (0 1 2 ...) turns counter-clockwise seen from the rest of the cell, so that its faces below point
//! outward. Nodes beyond the corners sit on edges, then on faces, then in the centre.

/// A cell type that the importer knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellKind {
    /// 2 nodes.
    Line2,
    /// 3 nodes.
    Line3,
    /// 3 nodes.
    Triangle3,
    /// 6 nodes.
    Triangle6,
    /// 4 nodes.
    Quad4,
    /// 8 nodes.
    Quad8,
    /// 9 nodes.
    Quad9,
    /// 4 nodes.
    Tetra4,
    /// 10 nodes.
    Tetra10,
    /// 5 nodes.
    Pyramid5,
    /// 13 nodes.
    Pyramid13,
    /// 6 nodes.
    Wedge6,
    /// 15 nodes.
    Wedge15,
    /// 8 nodes.
    Hexa8,
    /// 20 nodes.
    Hexa20,
    /// 27 nodes.
    Hexa27,
}

/// One row of the table of kinds.
struct Row {
    kind: CellKind,
    nodes: usize,
    dimension: usize,
    vtk: i64,
    meshio: &'static str,
    med: &'static str,
    /// Number in the stream of a mixed XDMF topology.
    xdmf: i64,
}

const fn row(kind: CellKind, nodes: usize, dimension: usize, vtk: i64, meshio: &'static str, med: &'static str, xdmf: i64) -> Row {
    Row { kind, nodes, dimension, vtk, meshio, med, xdmf }
}

const ROWS: [Row; 16] = [
    row(CellKind::Line2, 2, 1, 3, "line", "SE2", 2),
    row(CellKind::Line3, 3, 1, 21, "line3", "SE3", 34),
    row(CellKind::Triangle3, 3, 2, 5, "triangle", "TR3", 4),
    row(CellKind::Triangle6, 6, 2, 22, "triangle6", "TR6", 36),
    row(CellKind::Quad4, 4, 2, 9, "quad", "QU4", 5),
    row(CellKind::Quad8, 8, 2, 23, "quad8", "QU8", 37),
    row(CellKind::Quad9, 9, 2, 28, "quad9", "QU9", 35),
    row(CellKind::Tetra4, 4, 3, 10, "tetra", "TE4", 6),
    row(CellKind::Tetra10, 10, 3, 24, "tetra10", "T10", 38),
    row(CellKind::Pyramid5, 5, 3, 14, "pyramid", "PY5", 7),
    row(CellKind::Pyramid13, 13, 3, 27, "pyramid13", "P13", 39),
    row(CellKind::Wedge6, 6, 3, 13, "wedge", "PE6", 8),
    row(CellKind::Wedge15, 15, 3, 26, "wedge15", "P15", 40),
    row(CellKind::Hexa8, 8, 3, 12, "hexahedron", "HE8", 9),
    row(CellKind::Hexa20, 20, 3, 25, "hexahedron20", "H20", 48),
    row(CellKind::Hexa27, 27, 3, 29, "hexahedron27", "H27", 50),
];

/// Shape of the corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Family {
    Line,
    Triangle,
    Quad,
    Tetra,
    Pyramid,
    Wedge,
    Hexa,
}

const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
const QUAD_EDGES: [[usize; 2]; 4] = [[0, 1], [1, 2], [2, 3], [3, 0]];
const TETRA_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const PYRAMID_EDGES: [[usize; 2]; 8] = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]];
const WEDGE_EDGES: [[usize; 2]; 9] = [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];
const HEXA_EDGES: [[usize; 2]; 12] = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
const TETRA_FACES: [&[usize]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]];
const PYRAMID_FACES: [&[usize]; 5] = [&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
const WEDGE_FACES: [&[usize]; 5] = [&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
const HEXA_FACES: [&[usize]; 6] = [&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[3, 7, 6, 2], &[0, 3, 2, 1], &[4, 5, 6, 7]];

/// First node of a triquadratic hexahedron that sits on a face.
const HEXA_FACE_NODES: usize = 20;

impl CellKind {
    fn row(self) -> &'static Row {
        // the table has a row for every kind; a test counts them
        ROWS.iter().find(|row| row.kind == self).unwrap_or(&ROWS[0])
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(self) -> usize {
        self.row().nodes
    }

    /// 1 for lines, 2 for surfaces, 3 for solids.
    #[must_use]
    pub fn dimension(self) -> usize {
        self.row().dimension
    }

    /// Number of the type in VTK.
    #[must_use]
    pub fn vtk_type(self) -> i64 {
        self.row().vtk
    }

    /// Name of the type in meshio and in modal files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().meshio
    }

    /// The kind of that name in MED.
    #[must_use]
    pub fn from_med(name: &str) -> Option<Self> {
        ROWS.iter().find(|row| row.med == name).map(|row| row.kind)
    }

    /// The kind of that number in a mixed XDMF topology.
    #[must_use]
    pub fn from_xdmf_number(number: i64) -> Option<Self> {
        ROWS.iter().find(|row| row.xdmf == number).map(|row| row.kind)
    }

    /// The kind of that XDMF topology, in the spellings that meshio and the XDMF library write.
    #[must_use]
    pub fn from_xdmf(name: &str) -> Option<Self> {
        let name = name.to_ascii_lowercase();
        let name = match name.as_str() {
            "polyline" => "line".to_owned(),
            "edge_3" => "line3".to_owned(),
            "quadrilateral" => "quad".to_owned(),
            "tetrahedron" => "tetra".to_owned(),
            other => other
                .replace("tri_", "triangle")
                .replace("triangle_", "triangle")
                .replace("quadrilateral_", "quad")
                .replace("quad_", "quad")
                .replace("tetrahedron_", "tetra")
                .replace("tet_", "tetra")
                .replace("pyramid_", "pyramid")
                .replace("wedge_", "wedge")
                .replace("hexahedron_", "hexahedron")
                .replace("hex_", "hexahedron"),
        };
        ROWS.iter().find(|row| row.meshio == name).map(|row| row.kind)
    }

    pub(super) fn family(self) -> Family {
        match self {
            Self::Line2 | Self::Line3 => Family::Line,
            Self::Triangle3 | Self::Triangle6 => Family::Triangle,
            Self::Quad4 | Self::Quad8 | Self::Quad9 => Family::Quad,
            Self::Tetra4 | Self::Tetra10 => Family::Tetra,
            Self::Pyramid5 | Self::Pyramid13 => Family::Pyramid,
            Self::Wedge6 | Self::Wedge15 => Family::Wedge,
            Self::Hexa8 | Self::Hexa20 | Self::Hexa27 => Family::Hexa,
        }
    }

    /// Number of corners.
    #[must_use]
    pub fn corner_count(self) -> usize {
        match self.family() {
            Family::Line => 2,
            Family::Triangle => 3,
            Family::Quad | Family::Tetra => 4,
            Family::Pyramid => 5,
            Family::Wedge => 6,
            Family::Hexa => 8,
        }
    }

    /// Corners of each edge, in the order of the nodes on edges.
    pub(super) fn edges(self) -> &'static [[usize; 2]] {
        match self.family() {
            Family::Line => &TRIANGLE_EDGES[..1],
            Family::Triangle => &TRIANGLE_EDGES,
            Family::Quad => &QUAD_EDGES,
            Family::Tetra => &TETRA_EDGES,
            Family::Pyramid => &PYRAMID_EDGES,
            Family::Wedge => &WEDGE_EDGES,
            Family::Hexa => &HEXA_EDGES,
        }
    }

    /// Corners of each face of a solid, counter-clockwise seen from outside; in the order of the nodes on faces of a hexahedron.
    pub(super) fn faces(self) -> &'static [&'static [usize]] {
        match self.family() {
            Family::Line | Family::Triangle | Family::Quad => &[],
            Family::Tetra => &TETRA_FACES,
            Family::Pyramid => &PYRAMID_FACES,
            Family::Wedge => &WEDGE_FACES,
            Family::Hexa => &HEXA_FACES,
        }
    }

    /// True if every edge has a node of its own.
    pub(super) fn is_quadratic(self) -> bool {
        self.node_count() > self.corner_count()
    }

    /// Local node on the edge between two corners.
    fn edge_node(self, a: usize, b: usize) -> Option<usize> {
        let edge = self.edges().iter().position(|&[p, q]| [p, q] == [a, b] || [q, p] == [a, b])?;
        self.is_quadratic().then_some(self.corner_count() + edge)
    }

    /// Local node in the middle of the face with these corners.
    fn face_node(self, corners: &[usize]) -> Option<usize> {
        let same = |face: &&[usize]| face.len() == corners.len() && face.iter().all(|corner| corners.contains(corner));
        (self == Self::Hexa27).then(|| self.faces().iter().position(same).map(|face| HEXA_FACE_NODES + face)).flatten()
    }

    /// A face of a solid as a cell of its own: kind and local nodes.
    pub(super) fn face_cell(self, face: usize) -> (Self, Vec<usize>) {
        let corners = self.faces()[face];
        let mut nodes = corners.to_vec();
        let next = |i: usize| corners[(i + 1) % corners.len()];
        nodes.extend((0..corners.len()).filter_map(|i| self.edge_node(corners[i], next(i))));
        nodes.extend(self.face_node(corners));
        let kind = match nodes.len() {
            3 => Self::Triangle3,
            6 => Self::Triangle6,
            8 => Self::Quad8,
            9 => Self::Quad9,
            _ => Self::Quad4,
        };
        (kind, nodes)
    }

    /// Where each node of the mirror image of a cell stands in the cell itself: local node `i` of the positive cell is node
    /// `permutation[i]` of the negative one.
    pub(super) fn mirror(self) -> Vec<usize> {
        let corners: &[usize] = match self.family() {
            Family::Line => &[0, 1],
            Family::Triangle => &[0, 2, 1],
            Family::Quad => &[0, 3, 2, 1],
            Family::Tetra => &[0, 2, 1, 3],
            Family::Pyramid => &[0, 3, 2, 1, 4],
            Family::Wedge => &[3, 4, 5, 0, 1, 2],
            Family::Hexa => &[4, 5, 6, 7, 0, 1, 2, 3],
        };
        let mut nodes = corners.to_vec();
        nodes.extend(self.edges().iter().filter_map(|&[a, b]| self.edge_node(corners[a], corners[b])));
        nodes.extend(self.faces().iter().filter_map(|face| self.face_node(&face.iter().map(|&c| corners[c]).collect::<Vec<_>>())));
        // a centre stays where it is
        nodes.extend(nodes.len()..self.node_count());
        nodes
    }

    /// Reference coordinates of the nodes: [-1, 1] along lines and edges of hexahedra, [0, 1] along those of triangles and tetrahedra.
    /// A pyramid has none; it is a hexahedron whose top is one point.
    pub(super) fn reference(self) -> Vec<[f64; 3]> {
        let corners: &[[f64; 3]] = match self.family() {
            Family::Line => &[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
            Family::Triangle => &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            Family::Quad => &[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]],
            Family::Tetra => &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Family::Wedge => &[[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]],
            Family::Pyramid | Family::Hexa => &[
                [-1.0, -1.0, -1.0],
                [1.0, -1.0, -1.0],
                [1.0, 1.0, -1.0],
                [-1.0, 1.0, -1.0],
                [-1.0, -1.0, 1.0],
                [1.0, -1.0, 1.0],
                [1.0, 1.0, 1.0],
                [-1.0, 1.0, 1.0],
            ],
        };
        let mean = |group: &[usize]| {
            let sum = group.iter().fold([0.0; 3], |s, &c| std::array::from_fn(|a| s[a] + corners[c][a]));
            sum.map(|x| x / group.len() as f64)
        };
        let mut nodes = corners.to_vec();
        if self.is_quadratic() {
            nodes.extend(self.edges().iter().map(|edge| mean(edge)));
        }
        if self == Self::Hexa27 {
            nodes.extend(self.faces().iter().map(|face| mean(face)));
        }
        if self == Self::Hexa27 || self == Self::Quad9 {
            nodes.push([0.0; 3]);
        }
        nodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_stands_once_in_the_table() {
        for row in &ROWS {
            assert_eq!(ROWS.iter().filter(|other| other.kind == row.kind).count(), 1);
            if row.kind.family() != Family::Pyramid {
                assert_eq!(row.kind.reference().len(), row.nodes, "{:?}", row.kind);
            }
        }
    }

    #[test]
    fn a_mirror_image_mirrored_is_the_cell_itself() {
        for row in &ROWS {
            let mirror = row.kind.mirror();
            assert_eq!(mirror.len(), row.nodes, "{:?}", row.kind);
            assert!((0..row.nodes).all(|i| mirror[mirror[i]] == i), "{:?} {mirror:?}", row.kind);
        }
    }

    #[test]
    fn xdmf_spellings_of_both_writers_are_known() {
        for (name, kind) in [
            ("Hexahedron_27", CellKind::Hexa27),
            ("Hex_20", CellKind::Hexa20),
            ("Tri_6", CellKind::Triangle6),
            ("Tetrahedron_10", CellKind::Tetra10),
            ("Quadrilateral", CellKind::Quad4),
            ("Quad_8", CellKind::Quad8),
            ("WEDGE", CellKind::Wedge6),
        ] {
            assert_eq!(CellKind::from_xdmf(name), Some(kind), "{name}");
        }
        assert_eq!(CellKind::from_xdmf("Hexahedron_64"), None);
    }
}
