//! Random flexible bodies made of point masses, whose modal integrals are plain sums.

use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};
use pliant::model::modal_body::{Boundary, Interface, ModalBody};
use rand::Rng;
use rand::rngs::StdRng;

/// A modal body with the nodes that it was summed from.
pub struct LumpedBody {
    pub masses: Vec<f64>,
    pub points: Vec<Vector3<f64>>,
    /// `shapes[mode][node]`
    pub shapes: Vec<Vec<Vector3<f64>>>,
    pub modal: ModalBody,
}

pub fn vector(rng: &mut StdRng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-size..size))
}

/// Body of `modes` modes; interfaces "root" (at the origin), "mid" and "tip" with random rotations.
pub fn lumped_body(rng: &mut StdRng, boundary: Boundary, modes: usize) -> LumpedBody {
    let masses = (0..modes + 8).map(|_| rng.random_range(0.2..1.5)).collect();
    lumped_body_of(rng, boundary, modes, masses)
}

/// The same of nodes of given masses, the root's first; at most as many modes as the nodes have directions left.
pub fn lumped_body_of(rng: &mut StdRng, boundary: Boundary, modes: usize, masses: Vec<f64>) -> LumpedBody {
    let count = masses.len();
    let mut points: Vec<_> = (0..count).map(|_| vector(rng, 1.0)).collect();
    points[0] = Vector3::zeros();

    // orthonormal columns in the mass metric, starting from rigid motions for mean-axis modes
    let mut basis: Vec<Vec<Vector3<f64>>> = Vec::new();
    if boundary == Boundary::FreeFree {
        for i in 0..6 {
            let axis = Vector3::ith(i % 3, 1.0);
            basis.push(points.iter().map(|r| if i < 3 { axis } else { axis.cross(r) }).collect());
        }
    }
    let rigid = basis.len();
    for _ in 0..modes {
        let mut shape: Vec<_> = (0..count).map(|_| vector(rng, 1.0)).collect();
        if boundary.holds_root() {
            shape[0] = Vector3::zeros();
        }
        basis.push(shape);
    }
    let inner =
        |a: &[Vector3<f64>], b: &[Vector3<f64>]| -> f64 { masses.iter().zip(a.iter().zip(b)).map(|(m, (a, b))| m * a.dot(b)).sum() };
    for i in 0..basis.len() {
        // twice is enough
        for _ in 0..2 {
            for j in 0..i {
                let share = inner(&basis[i], &basis[j]);
                let other = basis[j].clone();
                basis[i].iter_mut().zip(&other).for_each(|(x, o)| *x -= o * share);
            }
            let size = inner(&basis[i], &basis[i]).sqrt();
            basis[i].iter_mut().for_each(|x| *x /= size);
        }
    }
    let shapes = basis.split_off(rigid);

    let sum3 = |f: &dyn Fn(usize) -> Vector3<f64>| (0..count).map(|i| f(i) * masses[i]).sum::<Vector3<f64>>();
    let sum33 = |f: &dyn Fn(usize) -> Matrix3<f64>| (0..count).map(|i| f(i) * masses[i]).sum::<Matrix3<f64>>();
    let mass: f64 = masses.iter().sum();
    let outer = |a: &Vector3<f64>, b: &Vector3<f64>| a * b.transpose();
    let inertia = sum33(&|i| Matrix3::from_diagonal_element(points[i].norm_squared()) - outer(&points[i], &points[i]));
    let interface = |rng: &mut StdRng, name: &str, node: usize| Interface {
        name: name.into(),
        position: points[node],
        orientation: Matrix3::identity(),
        mode_shape: shapes
            .iter()
            .map(|s| {
                let turn = if boundary.holds_root() && node == 0 { Vector3::zeros() } else { vector(rng, 0.7) };
                Vector6::new(turn.x, turn.y, turn.z, s[node].x, s[node].y, s[node].z)
            })
            .collect(),
    };
    let interfaces = vec![interface(rng, "root", 0), interface(rng, "mid", 3), interface(rng, "tip", 5)];
    let mut frequency_hz: Vec<f64> = (0..modes).map(|_| rng.random_range(0.5..5.0)).collect();
    frequency_hz.sort_by(f64::total_cmp);
    let modal = ModalBody {
        mass,
        center_of_mass: sum3(&|i| points[i]) / mass,
        inertia,
        boundary,
        root_interface: "root".into(),
        frequency_hz,
        damping_ratio: vec![0.0; modes],
        stiffness: None,
        momentum: shapes.iter().map(|s| sum3(&|i| s[i])).collect(),
        first_moment: shapes.iter().map(|s| sum33(&|i| outer(&points[i], &s[i]))).collect(),
        second_moment: shapes
            .iter()
            .flat_map(|a| shapes.iter().map(move |b| (a, b)))
            .map(|(a, b)| sum33(&|i| outer(&a[i], &b[i])))
            .collect(),
        angular_momentum: None,
        geometric_stiffness: None,
        interfaces,
    };
    LumpedBody { masses, points, shapes, modal }
}

/// Second-order displacements of the nodes: `field[node][j + modes * k]`, symmetric in the modes, at most `size`; none at the root.
pub type SecondOrder = Vec<Vec<Vector3<f64>>>;

/// Random second-order displacements of a body's nodes, and its modal data with the geometric stiffness that they make.
pub fn with_second_order(rng: &mut StdRng, body: &LumpedBody, size: f64) -> (SecondOrder, ModalBody) {
    let n = body.shapes.len();
    let field: SecondOrder = (0..body.points.len())
        .map(|node| {
            let mut at = vec![Vector3::zeros(); n * n];
            for j in 0..n {
                for k in 0..=j {
                    let value = if node == 0 { Vector3::zeros() } else { vector(rng, size) };
                    (at[j + n * k], at[k + n * j]) = (value, value);
                }
            }
            at
        })
        .collect();
    // the 12 unit accelerations of the frame: linear, angular, and w x (w x r) for each product of two components of w
    let axis = |i: usize| Vector3::ith(i, 1.0);
    let product = |i: usize, j: usize, r: &Vector3<f64>| {
        if i == j { axis(i) * r[i] - r } else { axis(i) * r[j] + axis(j) * r[i] }
    };
    let acceleration = |load: usize, r: &Vector3<f64>| match load {
        0..3 => axis(load),
        3..6 => axis(load - 3).cross(r),
        6..9 => product(load - 6, load - 6, r),
        9 => product(0, 1, r),
        10 => product(1, 2, r),
        _ => product(0, 2, r),
    };
    let matrices = (0..12).map(|load| {
        let nodes = || body.masses.iter().zip(&body.points).zip(&field);
        let sum = |i: usize| nodes().map(|((m, r), at)| m * acceleration(load, r).dot(&at[i])).sum::<f64>();
        DMatrix::from_fn(n, n, |j, k| sum(j + n * k))
    });
    let modal = ModalBody { geometric_stiffness: Some(matrices.collect()), ..body.modal.clone() };
    (field, modal)
}

/// A positive definite matrix that an inertia may be (triangle inequality holds).
pub fn inertia(rng: &mut StdRng, size: f64) -> Matrix3<f64> {
    let points: Vec<_> = (0..4).map(|_| vector(rng, size)).collect();
    points.iter().map(|p| Matrix3::from_diagonal_element(p.norm_squared() + 0.01 * size * size) - p * p.transpose()).sum()
}

/// Full symmetric positive definite stiffness.
pub fn stiffness(rng: &mut StdRng, n: usize) -> DMatrix<f64> {
    let a = DMatrix::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
    &a * a.transpose() * 20.0 + DMatrix::from_diagonal_element(n, n, 5.0)
}
