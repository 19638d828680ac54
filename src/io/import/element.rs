//! Shape functions of every cell type and integrals over cells.
//!
//! Shape functions are the inverse Vandermonde matrix of the reference nodes over the monomials of the element: complete polynomials
//! on triangles and tetrahedra, tensor products on quadrilaterals and hexahedra, the serendipity spaces for 8, 15 and 20 nodes (Zienkiewicz and
//! Taylor, The Finite Element Method, ch. 8). A pyramid is the hexahedron whose four upper corners are one node. Integration is by
//! four Gauss points per direction, exact for polynomials of degree 7, with Duffy's map on triangles and tetrahedra.

use super::cell::{CellKind, Family};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Gauss points and weights on [-1, 1].
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// Shape functions at one integration point.
#[derive(Debug)]
struct Sample {
    value: Vec<f64>,
    slope: Vec<[f64; 3]>,
    weight: f64,
}

/// A cell type ready to integrate.
#[derive(Debug)]
pub(super) struct Element {
    kind: CellKind,
    samples: Vec<Sample>,
}

/// Integrals over one cell.
#[derive(Debug)]
pub(super) struct CellIntegrals {
    /// Length, area or volume; a volume is negative for a cell of negative orientation.
    pub measure: f64,
    /// Least ratio of the measure at a point to the mean; zero or less if the cell is folded.
    pub worst: f64,
    /// Integral of each shape function.
    pub weights: Vec<f64>,
    /// Integral of r r^T.
    pub second: Matrix3<f64>,
}

impl Element {
    /// Shape functions of a kind at its integration points.
    pub fn of(kind: CellKind) -> Self {
        let solid = match kind {
            CellKind::Pyramid5 => CellKind::Hexa8,
            CellKind::Pyramid13 => CellKind::Hexa20,
            other => other,
        };
        let powers = monomials(solid);
        let nodes = solid.reference();
        let vandermonde = DMatrix::from_fn(nodes.len(), powers.len(), |i, j| monomial(nodes[i], powers[j], None));
        // the nodes of every kind determine its polynomials, which the unit tests hold
        let inverse = vandermonde.try_inverse().unwrap_or_else(|| DMatrix::zeros(powers.len(), nodes.len()));
        let evaluate = |(point, weight): ([f64; 3], f64)| {
            let sum = |node: usize, along: Option<usize>| -> f64 {
                powers.iter().enumerate().map(|(j, &p)| inverse[(j, node)] * monomial(point, p, along)).sum()
            };
            let mut sample = Sample { value: vec![0.0; kind.node_count()], slope: vec![[0.0; 3]; kind.node_count()], weight };
            for node in 0..nodes.len() {
                let target = if solid == kind { node } else { collapsed(node) };
                sample.value[target] += sum(node, None);
                (0..3).for_each(|a| sample.slope[target][a] += sum(node, Some(a)));
            }
            sample
        };
        Self { kind, samples: integration_points(kind).into_iter().map(evaluate).collect() }
    }

    /// Integrals over the cell with these nodes.
    pub fn integrate(&self, points: &[Vector3<f64>]) -> CellIntegrals {
        let mut integrals =
            CellIntegrals { measure: 0.0, worst: f64::INFINITY, weights: vec![0.0; points.len()], second: Matrix3::zeros() };
        let mut reference = 0.0;
        let mut least = f64::INFINITY;
        for sample in &self.samples {
            let (position, density) = self.map(sample, points);
            let measure = density * sample.weight;
            reference += sample.weight;
            least = least.min(density);
            integrals.measure += measure;
            integrals.weights.iter_mut().zip(&sample.value).for_each(|(w, n)| *w += n * measure);
            integrals.second += measure * position * position.transpose();
        }
        integrals.worst = least * reference / integrals.measure.abs().max(f64::MIN_POSITIVE);
        integrals
    }

    /// Integrals of the products of two shape functions, nodes x nodes.
    pub fn products(&self, points: &[Vector3<f64>]) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(points.len(), points.len());
        for sample in &self.samples {
            let measure = self.map(sample, points).1 * sample.weight;
            for (i, a) in sample.value.iter().enumerate() {
                sample.value.iter().enumerate().for_each(|(j, b)| matrix[(i, j)] += a * b * measure);
            }
        }
        matrix
    }

    /// Position and measure per reference measure at an integration point.
    fn map(&self, sample: &Sample, points: &[Vector3<f64>]) -> (Vector3<f64>, f64) {
        let position = sample.value.iter().zip(points).map(|(n, p)| *n * p).sum();
        let along = |a: usize| -> Vector3<f64> { sample.slope.iter().zip(points).map(|(slope, p)| slope[a] * p).sum() };
        let density = match self.kind.dimension() {
            1 => along(0).norm(),
            2 => along(0).cross(&along(1)).norm(),
            _ => along(0).cross(&along(1)).dot(&along(2)),
        };
        (position, density)
    }
}

/// Node of a pyramid at which a node of the hexahedron lies.
fn collapsed(node: usize) -> usize {
    match node {
        0..4 => node,
        8..12 => node - 3,
        16..20 => node - 7,
        _ => 4,
    }
}

/// Exponents of the monomials of a kind.
fn monomials(kind: CellKind) -> Vec<[u8; 3]> {
    let all = (0..3_u8).flat_map(|i| (0..3_u8).flat_map(move |j| (0..3_u8).map(move |k| [i, j, k])));
    let twos = |p: &[u8; 3]| p.iter().filter(|&&e| e == 2).count();
    let keep = |p: &[u8; 3]| -> bool {
        let [i, j, k] = *p;
        match kind {
            CellKind::Line2 => i < 2 && j + k == 0,
            CellKind::Line3 => j + k == 0,
            CellKind::Triangle3 => i + j < 2 && k == 0,
            CellKind::Triangle6 => i + j < 3 && k == 0,
            CellKind::Quad4 => i < 2 && j < 2 && k == 0,
            CellKind::Quad8 => k == 0 && twos(p) < 2,
            CellKind::Quad9 => k == 0,
            CellKind::Tetra4 => i + j + k < 2,
            CellKind::Tetra10 => i + j + k < 3,
            CellKind::Wedge6 => i + j < 2 && k < 2,
            CellKind::Wedge15 => i + j < 2 || (i + j < 3 && k < 2),
            CellKind::Pyramid5 | CellKind::Hexa8 => twos(p) == 0,
            CellKind::Pyramid13 | CellKind::Hexa20 => twos(p) < 2,
            CellKind::Hexa27 => true,
        }
    };
    all.filter(keep).collect()
}

/// A monomial, or its derivative along one axis.
fn monomial(at: [f64; 3], powers: [u8; 3], along: Option<usize>) -> f64 {
    let factor = |a: usize| {
        let (x, p) = (at[a], i32::from(powers[a]));
        match (along == Some(a), p) {
            (false, _) => x.powi(p),
            (true, 0) => 0.0,
            (true, _) => f64::from(p) * x.powi(p - 1),
        }
    };
    factor(0) * factor(1) * factor(2)
}

/// Points and weights on the reference cell.
fn integration_points(kind: CellKind) -> Vec<([f64; 3], f64)> {
    // on [0, 1]
    let unit = || GAUSS.iter().map(|&(x, w)| (0.5 + 0.5 * x, 0.5 * w));
    let triangle = || unit().flat_map(move |(u, wu)| unit().map(move |(v, wv)| ([u, v * (1.0 - u)], wu * wv * (1.0 - u))));
    let square = || GAUSS.iter().flat_map(|&(x, wx)| GAUSS.iter().map(move |&(y, wy)| ([x, y], wx * wy)));
    match kind.family() {
        Family::Line => GAUSS.iter().map(|&(x, w)| ([x, 0.0, 0.0], w)).collect(),
        Family::Triangle => triangle().map(|([x, y], w)| ([x, y, 0.0], w)).collect(),
        Family::Quad => square().map(|([x, y], w)| ([x, y, 0.0], w)).collect(),
        Family::Wedge => triangle().flat_map(|([x, y], w)| GAUSS.iter().map(move |&(z, wz)| ([x, y, z], w * wz))).collect(),
        Family::Pyramid | Family::Hexa => square().flat_map(|([x, y], w)| GAUSS.iter().map(move |&(z, wz)| ([x, y, z], w * wz))).collect(),
        Family::Tetra => triangle()
            .flat_map(|([x, y], w)| {
                // the third coordinate runs to what the first two leave; their weight already holds the first factor
                let room = 1.0 - x - y;
                unit().map(move |(z, wz)| ([x, y, room * z], w * wz * room))
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [(CellKind, f64); 16] = [
        (CellKind::Line2, 2.0),
        (CellKind::Line3, 2.0),
        (CellKind::Triangle3, 0.5),
        (CellKind::Triangle6, 0.5),
        (CellKind::Quad4, 4.0),
        (CellKind::Quad8, 4.0),
        (CellKind::Quad9, 4.0),
        (CellKind::Tetra4, 1.0 / 6.0),
        (CellKind::Tetra10, 1.0 / 6.0),
        (CellKind::Pyramid5, 8.0 / 3.0),
        (CellKind::Pyramid13, 8.0 / 3.0),
        (CellKind::Wedge6, 1.0),
        (CellKind::Wedge15, 1.0),
        (CellKind::Hexa8, 8.0),
        (CellKind::Hexa20, 8.0),
        (CellKind::Hexa27, 8.0),
    ];

    /// Nodes of the reference cell; a pyramid of base [-1, 1]^2 and height 2.
    fn nodes(kind: CellKind) -> Vec<Vector3<f64>> {
        if kind.family() != Family::Pyramid {
            return kind.reference().into_iter().map(Vector3::from).collect();
        }
        let mut points = CellKind::Hexa8.reference()[..4].to_vec();
        points.push([0.0, 0.0, 1.0]);
        if kind == CellKind::Pyramid13 {
            let mids: Vec<[f64; 3]> =
                kind.edges().iter().map(|&[a, b]| std::array::from_fn(|i| 0.5 * (points[a][i] + points[b][i]))).collect();
            points.extend(mids);
        }
        points.into_iter().map(Vector3::from).collect()
    }

    #[test]
    fn every_kind_has_the_measure_of_its_reference_cell() {
        for (kind, measure) in KINDS {
            let integrals = Element::of(kind).integrate(&nodes(kind));
            assert!((integrals.measure - measure).abs() < 1e-12, "{kind:?} {integrals:?}");
            assert!((integrals.weights.iter().sum::<f64>() - measure).abs() < 1e-12, "{kind:?}");
            assert!(integrals.worst > 0.0, "{kind:?} {}", integrals.worst);
        }
    }

    #[test]
    fn a_mirrored_cell_has_the_opposite_volume() {
        for (kind, measure) in KINDS.into_iter().filter(|(kind, _)| kind.dimension() == 3) {
            let cell = nodes(kind);
            let mirrored: Vec<_> = kind.mirror().into_iter().map(|i| cell[i]).collect();
            let integrals = Element::of(kind).integrate(&mirrored);
            assert!((integrals.measure + measure).abs() < 1e-12, "{kind:?} {integrals:?}");
        }
    }

    #[test]
    fn row_sums_of_straight_quadratic_cells_give_the_exact_second_moment() {
        let skew = Matrix3::new(1.0, 0.3, 0.1, 0.0, 0.8, -0.2, 0.1, 0.0, 1.2);
        for kind in [
            CellKind::Triangle6,
            CellKind::Quad8,
            CellKind::Quad9,
            CellKind::Tetra10,
            CellKind::Wedge15,
            CellKind::Hexa20,
            CellKind::Hexa27,
        ] {
            let cell: Vec<_> = nodes(kind).iter().map(|p| skew * p + Vector3::new(1.0, 2.0, 3.0)).collect();
            let integrals = Element::of(kind).integrate(&cell);
            let lumped: Matrix3<f64> = integrals.weights.iter().zip(&cell).map(|(w, r)| *w * r * r.transpose()).sum();
            assert!((lumped - integrals.second).amax() < 1e-11, "{kind:?} {lumped} {}", integrals.second);
        }
    }

    #[test]
    fn faces_of_a_cell_close_around_it() {
        for (kind, volume) in KINDS.into_iter().filter(|(kind, _)| kind.dimension() == 3) {
            let cell = nodes(kind);
            // divergence theorem on flat faces: the volume is a third of the sum of r . n dA
            let sum: f64 = kind
                .faces()
                .iter()
                .map(|face| {
                    let fan = (1..face.len() - 1).map(|i| [face[0], face[i], face[i + 1]]);
                    fan.map(|[a, b, c]| cell[a].dot(&cell[b].cross(&cell[c])) / 6.0).sum::<f64>()
                })
                .sum();
            assert!((sum - volume).abs() < 1e-12, "{kind:?} {sum}");
            for face in 0..kind.faces().len() {
                let (face_kind, local) = kind.face_cell(face);
                assert_eq!((face_kind.node_count(), face_kind.dimension()), (local.len(), 2), "{kind:?}");
            }
        }
    }
}
