//! Matrices with one column per mode, read four modes at a time, and the 6 x 6 algebra beside them.
//!
//! `R` rows of n numbers lie as blocks of `R x 4`: a pass reads memory from front to back. What fills the last block is zero.

use crate::spatial::lanes::Lanes;
use nalgebra::{Matrix6, Vector6};

/// Four modes of each of `R` rows.
pub type Block<const R: usize> = [[f64; 4]; R];

/// Blocks for `modes` modes.
pub fn block_count(modes: usize) -> usize {
    modes.div_ceil(4)
}

/// `R` rows from their entries at (row, mode).
pub fn blocks_of<const R: usize>(modes: usize, entry: impl Fn(usize, usize) -> f64) -> Vec<Block<R>> {
    let block = |b: usize| std::array::from_fn(|row| std::array::from_fn(|i| if 4 * b + i < modes { entry(row, 4 * b + i) } else { 0.0 }));
    (0..block_count(modes)).map(block).collect()
}

/// One number per mode in blocks.
pub fn fill(from: &[f64], to: &mut [[f64; 4]]) {
    let mut whole = from.chunks_exact(4);
    for (to, from) in to.iter_mut().zip(&mut whole) {
        to.copy_from_slice(from);
    }
    if let Some(last) = to.last_mut().filter(|_| !whole.remainder().is_empty()) {
        *last = [0.0; 4];
        last[..whole.remainder().len()].copy_from_slice(whole.remainder());
    }
}

/// One number per mode from blocks.
pub fn spill(from: &[[f64; 4]], to: &mut [f64]) {
    for (to, from) in to.chunks_mut(4).zip(from) {
        to.copy_from_slice(&from[..to.len()]);
    }
}

/// Sum of all four numbers.
#[inline(always)]
pub fn sum_of<L: Lanes>(s: L, a: L::V) -> f64 {
    let [a, b, c, d] = s.store(a);
    (a + b) + (c + d)
}

/// `rows x` and `rows y`.
#[inline(always)]
pub fn two_products<L: Lanes>(s: L, rows: &[Block<6>], x: &[[f64; 4]], y: &[[f64; 4]]) -> [Vector6<f64>; 2] {
    let (mut with_x, mut with_y) = ([s.splat(0.0); 6], [s.splat(0.0); 6]);
    for ((block, x), y) in rows.iter().zip(x).zip(y) {
        let (x, y) = (s.load(*x), s.load(*y));
        for r in 0..6 {
            let row = s.load(block[r]);
            with_x[r] = s.mul_add(row, x, with_x[r]);
            with_y[r] = s.mul_add(row, y, with_y[r]);
        }
    }
    let mut out = [Vector6::zeros(); 2];
    for r in 0..6 {
        out[0][r] = sum_of(s, with_x[r]);
        out[1][r] = sum_of(s, with_y[r]);
    }
    out
}

/// `rows x`.
#[inline(always)]
pub fn product<L: Lanes>(s: L, rows: &[Block<6>], x: &[[f64; 4]]) -> Vector6<f64> {
    let mut sums = [s.splat(0.0); 6];
    for (block, x) in rows.iter().zip(x) {
        let x = s.load(*x);
        for r in 0..6 {
            sums[r] = s.mul_add(s.load(block[r]), x, sums[r]);
        }
    }
    let mut out = Vector6::zeros();
    for r in 0..6 {
        out[r] = sum_of(s, sums[r]);
    }
    out
}

/// `x <- x - rows' f`.
#[inline(always)]
pub fn take_transposed<L: Lanes>(s: L, rows: &[Block<6>], f: &Vector6<f64>, x: &mut [[f64; 4]]) {
    let mut factors = [s.splat(0.0); 6];
    for r in 0..6 {
        factors[r] = s.splat(f[r]);
    }
    for (block, x) in rows.iter().zip(x) {
        let mut left = s.load(*x);
        for r in 0..6 {
            left = s.mul_take(s.load(block[r]), factors[r], left);
        }
        *x = s.store(left);
    }
}

/// `a b'` of two sets of rows.
#[inline(always)]
pub fn gram<L: Lanes>(s: L, a: &[Block<6>], b: &[Block<6>]) -> Matrix6<f64> {
    let mut out = Matrix6::zeros();
    for i in [0, 2, 4] {
        let (mut first, mut second) = ([s.splat(0.0); 6], [s.splat(0.0); 6]);
        for (a, b) in a.iter().zip(b) {
            let (x, y) = (s.load(a[i]), s.load(a[i + 1]));
            for r in 0..6 {
                let row = s.load(b[r]);
                first[r] = s.mul_add(row, x, first[r]);
                second[r] = s.mul_add(row, y, second[r]);
            }
        }
        for r in 0..6 {
            out[(i, r)] = sum_of(s, first[r]);
            out[(i + 1, r)] = sum_of(s, second[r]);
        }
    }
    out
}

/// `a b`.
#[inline(always)]
pub fn times<L: Lanes>(s: L, a: &Matrix6<f64>, b: &Matrix6<f64>) -> Matrix6<f64> {
    let a = columns(s, a);
    let mut out = Matrix6::zeros();
    for j in 0..6 {
        let (mut top, mut bottom) = (s.splat(0.0), s.splat(0.0));
        for k in 0..6 {
            let factor = s.splat(b[(k, j)]);
            top = s.mul_add(a[k][0], factor, top);
            bottom = s.mul_add(a[k][1], factor, bottom);
        }
        put(s, top, bottom, &mut out, j);
    }
    out
}

/// `a b'`.
#[inline(always)]
pub fn times_transposed<L: Lanes>(s: L, a: &Matrix6<f64>, b: &Matrix6<f64>) -> Matrix6<f64> {
    let a = columns(s, a);
    let mut out = Matrix6::zeros();
    for j in 0..6 {
        let (mut top, mut bottom) = (s.splat(0.0), s.splat(0.0));
        for k in 0..6 {
            let factor = s.splat(b[(j, k)]);
            top = s.mul_add(a[k][0], factor, top);
            bottom = s.mul_add(a[k][1], factor, bottom);
        }
        put(s, top, bottom, &mut out, j);
    }
    out
}

#[inline(always)]
fn columns<L: Lanes>(s: L, a: &Matrix6<f64>) -> [[L::V; 2]; 6] {
    let mut out = [[s.splat(0.0); 2]; 6];
    for k in 0..6 {
        out[k] = [s.of_three([a[(0, k)], a[(1, k)], a[(2, k)]]), s.of_three([a[(3, k)], a[(4, k)], a[(5, k)]])];
    }
    out
}

#[inline(always)]
fn put<L: Lanes>(s: L, top: L::V, bottom: L::V, out: &mut Matrix6<f64>, j: usize) {
    let (top, bottom) = (s.three(top), s.three(bottom));
    for i in 0..3 {
        out[(i, j)] = top[i];
        out[(i + 3, j)] = bottom[i];
    }
}

/// `(1 + S G)^-1 S` of symmetric positive semidefinite `S` and `G`, which needs the inverse of neither: `size` x `size`, row by row.
///
/// Gauss elimination with row exchanges in `work` (`size` rows of `2 size`). Fails where the sum is singular, which semidefinite matrices
/// exclude.
#[inline(always)]
pub fn inverse_sum(size: usize, inertia: &[f64], flexibility: &[f64], work: &mut [f64], out: &mut [f64]) -> bool {
    let width = 2 * size;
    for i in 0..size {
        let row = &mut work[i * width..(i + 1) * width];
        row[..size].fill(0.0);
        for k in 0..size {
            let factor = inertia[i * size + k];
            for (x, g) in row[..size].iter_mut().zip(&flexibility[k * size..(k + 1) * size]) {
                *x += factor * g;
            }
        }
        row[i] += 1.0;
        row[size..].copy_from_slice(&inertia[i * size..(i + 1) * size]);
    }
    for k in 0..size {
        let mut pivot = k;
        for i in k + 1..size {
            if work[i * width + k].abs() > work[pivot * width + k].abs() {
                pivot = i;
            }
        }
        if pivot != k {
            for c in k..width {
                work.swap(k * width + c, pivot * width + c);
            }
        }
        let inverse = 1.0 / work[k * width + k];
        if !inverse.is_finite() {
            return false;
        }
        let (done, rest) = work.split_at_mut((k + 1) * width);
        let row = &mut done[k * width..];
        row[k..].iter_mut().for_each(|x| *x *= inverse);
        for below in rest.chunks_exact_mut(width) {
            let factor = below[k];
            for (x, p) in below[k..].iter_mut().zip(&row[k..]) {
                *x -= factor * p;
            }
        }
    }
    for k in (0..size).rev() {
        let (above, rest) = work.split_at_mut(k * width);
        let row = &rest[size..width];
        for other in above.chunks_exact_mut(width) {
            let factor = other[k];
            for (x, p) in other[size..].iter_mut().zip(row) {
                *x -= factor * p;
            }
        }
    }
    for i in 0..size {
        for j in 0..size {
            out[i * size + j] = 0.5 * (work[i * width + size + j] + work[j * width + size + i]);
        }
    }
    true
}
