//! The modal block `D_fl` of one flexible body, factored at a cost linear in its modes.
//!
//! Seen from its inboard hinge, a body's modal inertia is `D = D_own + sum over children c of Y_c' S_c Y_c`: the identity, terms of
//! rank 12 where modes move the root (`D_own = 1 - M_fr Pi_B - Pi_B' M_rf + Pi_B' M_rr Pi_B`), and rank 6 per child, with
//! `Y_c = Pi(O_c) - phi* Pi_B` and `S_c = P+_c`. Each low-rank term is one Woodbury update:
//! `D_c^-1 = D_b^-1 - F N F'`, `F = D_b^-1 Y'`, `N = (1 + S Y F)^-1 S`, which needs no inverse of the singular S.
//! Source: Paper Eq. 32 in its first line; the update is DESIGN 3.3.
#![expect(non_snake_case, reason = "symbols follow the table in dynamics/mod.rs")]

use crate::spatial::SpatialInertia;
use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

type Matrix12 = SMatrix<f64, 12, 12>;
type Vector12 = SVector<f64, 12>;

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
    /// Rows (M_fr, Pi_B) of the rank-12 term; empty if no mode moves the root.
    root: Vec<Vector12>,
    root_inverse: Matrix12,
    updates: Vec<Update>,
    used: usize,
}

/// The modal block has no inverse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SingularBlock;

fn outer_sum(a: &[Vector6<f64>], b: &[Vector6<f64>]) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for (a, b) in a.iter().zip(b) {
        sum.ger(1.0, a, b, 1.0);
    }
    sum
}

impl ModalBlock {
    /// Room for n modes and `children` updates; `moving_root` if modes move the inboard hinge.
    #[must_use]
    pub fn new(n: usize, children: usize, moving_root: bool) -> Self {
        Self {
            root: vec![Vector12::zeros(); if moving_root { n } else { 0 }],
            root_inverse: Matrix12::zeros(),
            updates: vec![Update { Y: vec![Vector6::zeros(); n], F: vec![Vector6::zeros(); n], N: Matrix6::zeros() }; children],
            used: 0,
        }
    }

    /// Starts from the body alone: rows of M_fr, `M_rr`, and `Pi_B` (empty if no mode moves the root).
    ///
    /// # Errors
    /// If the modes held at the root have no invertible mass.
    pub fn begin(&mut self, row: &[Vector6<f64>], rigid: &SpatialInertia, shape_inboard: &[Vector6<f64>]) -> Result<(), SingularBlock> {
        self.used = 0;
        if shape_inboard.is_empty() {
            return Ok(());
        }
        // D_own = 1 + U C U', U = [M_fr, Pi_B'], C = [[0, -1], [-1, M_rr]]; C^-1 = [[-M_rr, -1], [-1, 0]]
        let mut K = Matrix12::zeros();
        K.fixed_view_mut::<6, 6>(0, 0).copy_from(&-rigid.matrix());
        for i in 0..6 {
            K[(i, i + 6)] = -1.0;
            K[(i + 6, i)] = -1.0;
        }
        for (u, (m, s)) in self.root.iter_mut().zip(row.iter().zip(shape_inboard)) {
            u.fixed_rows_mut::<6>(0).copy_from(m);
            u.fixed_rows_mut::<6>(6).copy_from(s);
            K.ger(1.0, u, u, 1.0);
        }
        self.root_inverse = K.try_inverse().ok_or(SingularBlock)?;
        Ok(())
    }

    /// Adds a child: `fill` writes `Y`, one row per mode, and `S` is the inertia that the body feels there.
    ///
    /// # Errors
    /// If the sum has no inverse, which positive semidefinite inertias exclude.
    pub fn add_child(&mut self, fill: impl FnOnce(&mut [Vector6<f64>]), S: &SpatialInertia) -> Result<(), SingularBlock> {
        let index = self.used;
        let (done, open) = self.updates.split_at_mut(index);
        let update = open.first_mut().ok_or(SingularBlock)?;
        fill(&mut update.Y);
        update.F.copy_from_slice(&update.Y);
        solve_rows(&self.root, &self.root_inverse, done, &mut update.F);
        let S = S.matrix();
        let inner = Matrix6::identity() + S * outer_sum(&update.Y, &update.F);
        let N = inner.lu().solve(&S).ok_or(SingularBlock)?;
        update.N = (N + N.transpose()) * 0.5;
        self.used = index + 1;
        Ok(())
    }

    /// `x <- D^-1 x` for n x 6, one row per mode.
    pub fn solve_rows(&self, x: &mut [Vector6<f64>]) {
        solve_rows(&self.root, &self.root_inverse, &self.updates[..self.used], x);
    }

    /// `x <- D^-1 x` for one number per mode.
    pub fn solve(&self, x: &mut [f64]) {
        if !self.root.is_empty() {
            let t = self.root_inverse * self.root.iter().zip(x.iter()).map(|(u, x)| u * *x).sum::<Vector12>();
            self.root.iter().zip(x.iter_mut()).for_each(|(u, x)| *x -= u.dot(&t));
        }
        for update in &self.updates[..self.used] {
            let t = update.N * update.Y.iter().zip(x.iter()).map(|(y, x)| y * *x).sum::<Vector6<f64>>();
            update.F.iter().zip(x.iter_mut()).for_each(|(f, x)| *x -= f.dot(&t));
        }
    }
}

fn solve_rows(root: &[Vector12], root_inverse: &Matrix12, updates: &[Update], x: &mut [Vector6<f64>]) {
    if !root.is_empty() {
        let mut t = SMatrix::<f64, 12, 6>::zeros();
        for (u, x) in root.iter().zip(x.iter()) {
            t.ger(1.0, u, x, 1.0);
        }
        let t = root_inverse * t;
        for (u, x) in root.iter().zip(x.iter_mut()) {
            *x -= t.tr_mul(u);
        }
    }
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
        let (row, shape, y) = (rows(0.1), rows(1.2), [rows(2.3), rows(3.4)]);
        let rigid = SpatialInertia::rigid(9.0, &Vector3::new(0.5, -0.2, 0.1), &Matrix3::from_diagonal(&Vector3::new(4.0, 5.0, 6.0)));
        // the second child's inertia is singular, as every P+ is
        let mut inertias = [rigid; 2];
        inertias[1].subtract_outer(&inertias[1].times(&Vector6::ith(1, 1.0)), inertias[1].rotational[(1, 1)]);
        let matrix = |rows: &[Vector6<f64>]| DMatrix::from_fn(n, 6, |i, a| rows[i][a]);
        let (m, p) = (matrix(&row), matrix(&shape));
        let wide = |s: &SpatialInertia| DMatrix::from_fn(6, 6, |i, j| s.matrix()[(i, j)]);
        let mut dense = DMatrix::identity(n, n) - &m * p.transpose() - &p * m.transpose() + &p * wide(&rigid) * p.transpose();
        for (y, s) in y.iter().zip(&inertias) {
            dense += matrix(y) * wide(s) * matrix(y).transpose();
        }

        let mut block = ModalBlock::new(n, 2, true);
        block.begin(&row, &rigid, &shape).unwrap();
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
