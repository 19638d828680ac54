//! Nodal masses brought to the second moments of the geometry.
//!
//! Row sums of linear cells put too much mass at their corners: mass and centre of mass are exact, the inertia is not. The masses
//! are changed by `m_i (1 + q_i . a)`, q the six products of coordinates less their part in (1, x, y, z), so that mass and first moment stay
//! as they are; the six factors follow from the six second moments. It is the least change in the norm of the masses. A product that the nodes do not
//! resolve, such as the square of the thickness across one layer of linear cells, is left as it is.

use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen, Vector3};

/// Relative eigenvalue below which the nodes do not resolve a product of coordinates.
const RESOLVED: f64 = 1e-8;
/// Least factor by which a mass may change.
const LEAST_FACTOR: f64 = 0.1;

/// Changes the masses; `target` is the second moment about the origin. Returns the largest relative change of a mass, zero if none was made.
pub(super) fn match_second_moment(points: &[Vector3<f64>], mass: &mut [f64], target: &Matrix3<f64>) -> f64 {
    let total: f64 = mass.iter().map(|m| m.abs()).sum();
    let center: Vector3<f64> = mass.iter().zip(points).map(|(m, r)| m.abs() * r).sum::<Vector3<f64>>() / total;
    let size = points.iter().map(|r| (r - center).amax()).fold(0.0, f64::max);
    if !(size > 0.0) {
        return 0.0;
    }
    let place = |i: usize| (points[i] - center) / size;
    let products = |r: &Vector3<f64>| [r.x * r.x, r.y * r.y, r.z * r.z, r.x * r.y, r.y * r.z, r.x * r.z];
    let linear = |r: &Vector3<f64>| DVector::from_row_slice(&[1.0, r.x, r.y, r.z]);
    let weight = |i: usize| mass[i].abs() / total;

    // products less what 1, x, y, z already span
    let (mut gram, mut mixed) = (DMatrix::zeros(4, 4), DMatrix::zeros(4, 6));
    for i in 0..points.len() {
        let (p, q) = (linear(&place(i)), DVector::from_row_slice(&products(&place(i))));
        gram += weight(i) * &p * p.transpose();
        mixed += weight(i) * &p * q.transpose();
    }
    let spanned = inverse(&gram) * mixed;
    let rest = |i: usize| DVector::from_row_slice(&products(&place(i))) - spanned.transpose() * linear(&place(i));
    let mut normal = DMatrix::zeros(6, 6);
    for i in 0..points.len() {
        let q = rest(i);
        normal += weight(i) * &q * q.transpose();
    }

    // the difference is the same about every point, because mass and first moment agree
    let lumped: Matrix3<f64> = mass.iter().zip(points).map(|(m, r)| *m * r * r.transpose()).sum();
    let missing = (target - lumped) / (total * size * size);
    let wanted = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)].map(|at| missing[at]);
    let factors = inverse(&normal) * DVector::from_row_slice(&wanted);
    let change: Vec<f64> = (0..points.len()).map(|i| rest(i).dot(&factors)).collect();
    if change.iter().any(|c| !(1.0 + c > LEAST_FACTOR)) {
        return 0.0;
    }
    mass.iter_mut().zip(&change).for_each(|(m, c)| *m += m.abs() * c);
    change.iter().fold(0.0, |a, c| a.max(c.abs()))
}

/// Inverse of a symmetric matrix on what the nodes resolve.
fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = SymmetricEigen::new(matrix.clone());
    let limit = RESOLVED * eigen.eigenvalues.max();
    let inverted = eigen.eigenvalues.map(|value| if value > limit { 1.0 / value } else { 0.0 });
    &eigen.eigenvectors * DMatrix::from_diagonal(&inverted) * eigen.eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes of a bar of 2 m along x with `cells` linear cells of 0.2 x 0.1 m, and their row sums; the bar has 3 kg.
    fn bar(cells: usize) -> (Vec<Vector3<f64>>, Vec<f64>, Matrix3<f64>) {
        let mut points = Vec::new();
        let mut mass = Vec::new();
        for i in 0..=cells {
            let share = if i == 0 || i == cells { 0.5 } else { 1.0 };
            for (y, z) in [(-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)] {
                points.push(Vector3::new(5.0 + 2.0 * i as f64 / cells as f64, y, z));
                mass.push(3.0 * share / (4 * cells) as f64);
            }
        }
        let exact = Matrix3::from_diagonal(&Vector3::new(3.0 * (36.0 + 4.0 / 12.0), 3.0 * 0.04 / 12.0, 3.0 * 0.01 / 12.0));
        (points, mass, exact)
    }

    #[test]
    fn mass_and_first_moment_stay_and_the_resolved_second_moment_becomes_exact() {
        let (points, mut mass, exact) = bar(4);
        let before = mass.clone();
        let change = match_second_moment(&points, &mut mass, &exact);
        assert!(change > 0.01 && change < 0.2, "{change}");
        let sum = |m: &[f64]| m.iter().sum::<f64>();
        let first = |m: &[f64]| m.iter().zip(&points).map(|(m, r)| *m * r).sum::<Vector3<f64>>();
        assert!((sum(&mass) - sum(&before)).abs() < 1e-13 && (first(&mass) - first(&before)).amax() < 1e-12);
        let second: Matrix3<f64> = mass.iter().zip(&points).map(|(m, r)| *m * r * r.transpose()).sum();
        assert!((second - exact)[(0, 0)].abs() < 1e-11, "{second}");
        // one layer of corners does not resolve the square of the width
        assert!((second - exact)[(1, 1)] > 0.01);
    }

    #[test]
    fn masses_that_would_have_to_vanish_stay_as_they_are() {
        let (points, mut mass, exact) = bar(2);
        let before = mass.clone();
        assert_eq!(match_second_moment(&points, &mut mass, &(0.5 * exact)), 0.0);
        assert_eq!(mass, before);
    }
}
