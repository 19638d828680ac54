//! Least-norm solutions of dense systems of any rank, by singular values: for set-up and slow twins, not for the recursion.

use faer::Mat;
use nalgebra::{DMatrix, DVector};

/// The x of least norm with `matrix x = right` as nearly as can be. Singular values below `cutoff` of the largest are left out, and all
/// are damped by `damping` of the largest. None if the decomposition fails.
#[must_use]
pub fn least_norm(matrix: &DMatrix<f64>, right: &DVector<f64>, cutoff: f64, damping: f64) -> Option<DVector<f64>> {
    let (rows, columns) = matrix.shape();
    if rows == 0 || columns == 0 || !matrix.iter().chain(right).all(|x| x.is_finite()) {
        return None;
    }
    let svd = Mat::from_fn(rows, columns, |i, j| matrix[(i, j)]).thin_svd().ok()?;
    let (u, v, values) = (svd.U(), svd.V(), svd.S().column_vector());
    let largest = values[0];
    let mut x = DVector::zeros(columns);
    for c in 0..rows.min(columns) {
        let s = values[c];
        if s > cutoff * largest {
            let along: f64 = (0..rows).map(|i| u[(i, c)] * right[i]).sum();
            let weight = along * s / (s * s + damping * damping * largest * largest);
            for i in 0..columns {
                x[i] += v[(i, c)] * weight;
            }
        }
    }
    Some(x)
}
