//! The modal block `D` of one flexible body, factored at a cost linear in its modes.
//!
//! With its frame B held, a body's modal inertia is `D = 1 + sum over children c of Y_c' S_c Y_c`, `Y_c = Pi(O_c)` and `S_c = P+_c`: each
//! child adds a term of rank 6. Each is one Woodbury update, `D_c^-1 = D_b^-1 - F N F'`, `F = D_b^-1 Y'`, `N = (1 + S Y F)^-1 S`,
//! which needs no inverse of the singular S. A linearly implicit integrator has another diagonal, `D = Lambda + sum Y' S Y`; its inverse
//! is where the updates then start. Source: Paper Eq. 32 in its first line; the update is DESIGN 3.3, the diagonal 3.6.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use crate::spatial::SpatialInertia;
use nalgebra::{Matrix6, Vector6};

/// One child's rank-6 update.
#[derive(Debug, Clone)]
struct Update {
    Y: Vec<Vector6<f64>>,
    F: Vec<Vector6<f64>>,
    N: Matrix6<f64>,
}

/// Factored modal block of one body.
#[derive(Debug, Clone)]
pub struct ModalBlock {
    updates: Vec<Update>,
    used: usize,
    /// `Lambda^-1`, empty for 1.
    inverse_diagonal: Vec<f64>,
}

/// An inertia that should be positive definite has no inverse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SingularBlock {
    /// True if it is semidefinite: some direction is empty.
    pub empty: bool,
}

/// `sum_j a_j b_j'` over the modes: `A' B` of two n x 6 matrices.
#[must_use]
pub fn outer_sum(a: &[Vector6<f64>], b: &[Vector6<f64>]) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for (a, b) in a.iter().zip(b) {
        sum.ger(1.0, a, b, 1.0);
    }
    sum
}

impl ModalBlock {
    /// Room for n modes and `children` updates.
    #[must_use]
    pub fn new(n: usize, children: usize) -> Self {
        Self {
            updates: vec![Update { Y: vec![Vector6::zeros(); n], F: vec![Vector6::zeros(); n], N: Matrix6::zeros() }; children],
            used: 0,
            inverse_diagonal: Vec::new(),
        }
    }

    /// Starts from the body alone, whose modes are orthonormal; `diagonal` stands in for their unit mass where there is one.
    pub fn begin(&mut self, diagonal: Option<&[f64]>) {
        self.used = 0;
        self.inverse_diagonal.clear();
        self.inverse_diagonal.extend(diagonal.unwrap_or_default().iter().map(|d| 1.0 / d));
    }

    /// Adds a child: `fill` writes `Y`, one row per mode, and `S` is the inertia that the body feels there.
    ///
    /// # Errors
    /// If the sum has no inverse, which positive semidefinite inertias exclude.
    pub fn add_child(&mut self, fill: impl FnOnce(&mut [Vector6<f64>]), S: &SpatialInertia) -> Result<(), SingularBlock> {
        let index = self.used;
        let (done, open) = self.updates.split_at_mut(index);
        let update = open.first_mut().ok_or(SingularBlock { empty: false })?;
        fill(&mut update.Y);
        update.F.copy_from_slice(&update.Y);
        solve_rows(&self.inverse_diagonal, done, &mut update.F);
        let S = S.matrix();
        let inner = Matrix6::identity() + S * outer_sum(&update.Y, &update.F);
        let N = inner.lu().solve(&S).ok_or(SingularBlock { empty: false })?;
        update.N = (N + N.transpose()) * 0.5;
        self.used = index + 1;
        Ok(())
    }

    /// `x <- D^-1 x` for n x 6, one row per mode.
    pub fn solve_rows(&self, x: &mut [Vector6<f64>]) {
        solve_rows(&self.inverse_diagonal, &self.updates[..self.used], x);
    }

    /// `x <- D^-1 x` for one number per mode.
    pub fn solve(&self, x: &mut [f64]) {
        self.inverse_diagonal.iter().zip(x.iter_mut()).for_each(|(d, x)| *x *= d);
        for update in &self.updates[..self.used] {
            let t = update.N * update.Y.iter().zip(x.iter()).map(|(y, x)| y * *x).sum::<Vector6<f64>>();
            update.F.iter().zip(x.iter_mut()).for_each(|(f, x)| *x -= f.dot(&t));
        }
    }
}

fn solve_rows(inverse_diagonal: &[f64], updates: &[Update], x: &mut [Vector6<f64>]) {
    inverse_diagonal.iter().zip(x.iter_mut()).for_each(|(d, x)| *x *= *d);
    for update in updates {
        // F' of the right-hand side is Y' of what the earlier updates have left in x
        let t = update.N * outer_sum(&update.Y, x);
        for (f, x) in update.F.iter().zip(x.iter_mut()) {
            *x -= t.tr_mul(f);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, Matrix3, Vector3};

    #[test]
    fn updates_solve_with_the_same_matrix_as_its_dense_sum() {
        let n = 7;
        let wave = |i: usize, j: usize, s: f64| ((i * 7 + j * 3) as f64 * 0.37 + s).sin();
        let rows = |s: f64| -> Vec<_> { (0..n).map(|i| Vector6::from_fn(|a, _| 0.3 * wave(i, a, s))).collect() };
        let y = [rows(2.3), rows(3.4)];
        let rigid = SpatialInertia::rigid(9.0, &Vector3::new(0.5, -0.2, 0.1), &Matrix3::from_diagonal(&Vector3::new(4.0, 5.0, 6.0)));
        // the second child's inertia is singular, as every P+ is
        let mut inertias = [rigid; 2];
        inertias[1].subtract_outer(&inertias[1].times(&Vector6::ith(1, 1.0)), inertias[1].rotational[(1, 1)]);
        let matrix = |rows: &[Vector6<f64>]| DMatrix::from_fn(n, 6, |i, a| rows[i][a]);
        let wide = |s: &SpatialInertia| DMatrix::from_fn(6, 6, |i, j| s.matrix()[(i, j)]);
        let mut block = ModalBlock::new(n, 2);
        // the plain block last: nothing of the other diagonal may stay behind
        let stiff: Vec<f64> = (0..n).map(|i| 1.0 + 3.0 * i as f64).collect();
        for diagonal in [Some(stiff.as_slice()), None] {
            let mut dense = DMatrix::from_fn(n, n, |i, j| if i == j { diagonal.map_or(1.0, |d| d[i]) } else { 0.0 });
            for (y, s) in y.iter().zip(&inertias) {
                dense += matrix(y) * wide(s) * matrix(y).transpose();
            }
            block.begin(diagonal);
            for (y, s) in y.iter().zip(&inertias) {
                block.add_child(|out| out.copy_from_slice(y), s).unwrap();
            }
            let right = rows(5.0);
            let expected = dense.clone().lu().solve(&matrix(&right)).unwrap();
            let mut found = right.clone();
            block.solve_rows(&mut found);
            // condition of D and of the inner matrices is below 1e3 for these numbers
            assert!((matrix(&found) - &expected).abs().max() < 1e4 * f64::EPSILON * expected.abs().max());
            let mut first: Vec<f64> = right.iter().map(|r| r[0]).collect();
            block.solve(&mut first);
            assert!(first.iter().zip(found.iter()).all(|(a, b)| (a - b[0]).abs() < 1e4 * f64::EPSILON * expected.abs().max()));
        }
    }
}
