//! Matrices with one column per mode, read four modes at a time.
//!
//! `R` rows of n numbers lie as blocks of `R x 4`: a pass reads memory from front to back. What fills the last block is zero.

use super::six::{Pair, Six};
use crate::spatial::lanes::Lanes;

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

/// Six sums over all modes as a spatial vector.
#[inline(always)]
fn gathered<L: Lanes>(s: L, a: [L::V; 6]) -> Pair<L::V> {
    [s.sums_of_four([a[0], a[1], a[2], a[2]]), s.sums_of_four([a[3], a[4], a[5], a[5]])]
}

/// `rows x` and `rows y`.
#[inline(always)]
pub fn two_products<L: Lanes>(s: L, rows: &[Block<6>], x: &[[f64; 4]], y: &[[f64; 4]]) -> [Pair<L::V>; 2] {
    let (mut with_x, mut with_y) = ([s.splat(0.0); 6], [s.splat(0.0); 6]);
    for ((block, x), y) in rows.iter().zip(x).zip(y) {
        let (x, y) = (s.load(*x), s.load(*y));
        for r in 0..6 {
            let row = s.load(block[r]);
            with_x[r] = s.mul_add(row, x, with_x[r]);
            with_y[r] = s.mul_add(row, y, with_y[r]);
        }
    }
    [gathered(s, with_x), gathered(s, with_y)]
}

/// `rows x`.
#[inline(always)]
pub fn product<L: Lanes>(s: L, rows: &[Block<6>], x: &[[f64; 4]]) -> Pair<L::V> {
    let mut sums = [s.splat(0.0); 6];
    for (block, x) in rows.iter().zip(x) {
        let x = s.load(*x);
        for r in 0..6 {
            sums[r] = s.mul_add(s.load(block[r]), x, sums[r]);
        }
    }
    gathered(s, sums)
}

/// `x <- x - rows' f`.
#[inline(always)]
pub fn take_transposed<L: Lanes>(s: L, rows: &[Block<6>], f: Pair<L::V>, x: &mut [[f64; 4]]) {
    let factors = [s.all_x(f[0]), s.all_y(f[0]), s.all_z(f[0]), s.all_x(f[1]), s.all_y(f[1]), s.all_z(f[1])];
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
pub fn gram<L: Lanes>(s: L, a: &[Block<6>], b: &[Block<6>], out: &mut Six) {
    for j in [0, 2, 4] {
        let (mut first, mut second) = ([s.splat(0.0); 6], [s.splat(0.0); 6]);
        for (a, b) in a.iter().zip(b) {
            let (x, y) = (s.load(b[j]), s.load(b[j + 1]));
            for r in 0..6 {
                let row = s.load(a[r]);
                first[r] = s.mul_add(row, x, first[r]);
                second[r] = s.mul_add(row, y, second[r]);
            }
        }
        out.put(s, j, gathered(s, first));
        out.put(s, j + 1, gathered(s, second));
    }
}
