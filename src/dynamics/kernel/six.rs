//! 6 x 6 algebra in registers, beside the modes.

use crate::spatial::lanes::{Lanes, quad};

/// A spatial vector: angular, linear.
pub type Pair<V> = [V; 2];

/// A 6 x 6 matrix by columns, whose angular and linear halves fill a register each; the fourth numbers mean nothing.
#[derive(Debug, Clone, Copy)]
pub struct Six(pub [[f64; 8]; 6]);

/// Places of the six numbers of a column.
const PLACE: [usize; 6] = [0, 1, 2, 4, 5, 6];

impl Six {
    pub const ZERO: Self = Self([[0.0; 8]; 6]);

    /// Element (i, j).
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.0[j][PLACE[i]]
    }

    #[inline(always)]
    pub fn set(&mut self, i: usize, j: usize, x: f64) {
        self.0[j][PLACE[i]] = x;
    }

    /// Column `j`.
    #[inline(always)]
    pub fn column<L: Lanes>(&self, s: L, j: usize) -> Pair<L::V> {
        let c = &self.0[j];
        [s.load(quad(c, 0)), s.load(quad(c, 4))]
    }

    #[inline(always)]
    pub fn put<L: Lanes>(&mut self, s: L, j: usize, [top, bottom]: Pair<L::V>) {
        let (t, b) = (s.store(top), s.store(bottom));
        self.0[j] = [t[0], t[1], t[2], t[3], b[0], b[1], b[2], b[3]];
    }

    /// `A b`.
    #[inline(always)]
    pub fn times<L: Lanes>(&self, s: L, b: &Self) -> Self {
        let mut out = Self::ZERO;
        for j in 0..6 {
            let x = &b.0[j];
            let column = self.combine(s, [x[0], x[1], x[2], x[4], x[5], x[6]]);
            out.put(s, j, column);
        }
        out
    }

    /// `out + A b'` into `out`.
    #[inline(always)]
    pub fn add_times_transposed<L: Lanes>(&self, s: L, b: &Self, out: &mut Self) {
        for j in 0..6 {
            let p = PLACE[j];
            let [top, bottom] = self.combine(s, [b.0[0][p], b.0[1][p], b.0[2][p], b.0[3][p], b.0[4][p], b.0[5][p]]);
            let [upper, lower] = out.column(s, j);
            out.put(s, j, [s.add(top, upper), s.add(bottom, lower)]);
        }
    }

    /// `A x` of numbers in memory.
    #[inline(always)]
    pub fn combine<L: Lanes>(&self, s: L, x: [f64; 6]) -> Pair<L::V> {
        let [mut top, mut bottom] = [s.splat(0.0); 2];
        for k in 0..6 {
            let ([a, b], factor) = (self.column(s, k), s.splat(x[k]));
            top = s.mul_add(a, factor, top);
            bottom = s.mul_add(b, factor, bottom);
        }
        [top, bottom]
    }

    /// `A x`.
    #[inline(always)]
    pub fn apply<L: Lanes>(&self, s: L, x: Pair<L::V>) -> Pair<L::V> {
        let (a, b) = (s.three(x[0]), s.three(x[1]));
        self.combine(s, [a[0], a[1], a[2], b[0], b[1], b[2]])
    }

    /// `A' x`.
    #[inline(always)]
    pub fn apply_transposed<L: Lanes>(&self, s: L, x: Pair<L::V>) -> Pair<L::V> {
        [
            s.sums([dot(s, self.column(s, 0), x), dot(s, self.column(s, 1), x), dot(s, self.column(s, 2), x)]),
            s.sums([dot(s, self.column(s, 3), x), dot(s, self.column(s, 4), x), dot(s, self.column(s, 5), x)]),
        ]
    }
}

/// Products to be summed.
#[inline(always)]
fn dot<L: Lanes>(s: L, a: Pair<L::V>, b: Pair<L::V>) -> L::V {
    s.mul_add(a[1], b[1], s.mul(a[0], b[0]))
}

/// `(1 + S G)^-1 S` of symmetric positive semidefinite `S` and `G`, which needs the inverse of neither, so that neither a singular nor a
/// very large inertia costs digits. Gauss elimination with row exchanges; none where the sum is singular, which semidefinite matrices exclude.
#[inline(always)]
pub fn inverse_sum<L: Lanes>(s: L, inertia: &Six, flexibility: &Six, out: &mut Six) -> Option<()> {
    // rows (1 + S G | S) of twelve numbers; S and G are symmetric, so that their columns are their rows
    let mut rows = [[0.0; 12]; 6];
    for i in 0..6 {
        let row = &inertia.0[i];
        let x = [row[0], row[1], row[2], row[4], row[5], row[6]];
        let [top, bottom] = flexibility.combine(s, x);
        let (a, b) = (s.three(top), s.three(bottom));
        rows[i] = [a[0], a[1], a[2], b[0], b[1], b[2], x[0], x[1], x[2], x[3], x[4], x[5]];
        rows[i][i] += 1.0;
    }
    for k in 0..6 {
        let mut pivot = k;
        for i in k + 1..6 {
            if rows[i][k].abs() > rows[pivot][k].abs() {
                pivot = i;
            }
        }
        if pivot != k {
            rows.swap(k, pivot);
        }
        let inverse = 1.0 / rows[k][k];
        if !inverse.is_finite() {
            return None;
        }
        let (upper, below) = rows.split_at_mut(k + 1);
        let row = scaled(s, &upper[k], inverse);
        keep(s, row, &mut upper[k]);
        for other in below {
            take(s, row, other[k], other);
        }
    }
    for k in (1..6).rev() {
        let (above, rest) = rows.split_at_mut(k);
        let row = thirds(s, &rest[0]);
        for other in above {
            take(s, row, other[k], other);
        }
    }
    for i in 0..6 {
        for j in 0..6 {
            out.set(i, j, 0.5 * (rows[i][6 + j] + rows[j][6 + i]));
        }
    }
    Some(())
}

#[inline(always)]
fn thirds<L: Lanes>(s: L, x: &[f64; 12]) -> [L::V; 3] {
    [s.load(quad(x, 0)), s.load(quad(x, 4)), s.load(quad(x, 8))]
}

#[inline(always)]
fn scaled<L: Lanes>(s: L, x: &[f64; 12], factor: f64) -> [L::V; 3] {
    let ([a, b, c], factor) = (thirds(s, x), s.splat(factor));
    [s.mul(a, factor), s.mul(b, factor), s.mul(c, factor)]
}

#[inline(always)]
fn keep<L: Lanes>(s: L, x: [L::V; 3], out: &mut [f64; 12]) {
    let (a, b, c) = (s.store(x[0]), s.store(x[1]), s.store(x[2]));
    *out = [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3], c[0], c[1], c[2], c[3]];
}

/// `other <- other - factor row`.
#[inline(always)]
fn take<L: Lanes>(s: L, row: [L::V; 3], factor: f64, other: &mut [f64; 12]) {
    let ([a, b, c], factor) = (thirds(s, other), s.splat(factor));
    keep(s, [s.mul_take(row[0], factor, a), s.mul_take(row[1], factor, b), s.mul_take(row[2], factor, c)], other);
}

/// The same of `size` blocks of 6 x 6 in each direction (row by row of blocks), by way of plain arrays: for bodies with several moved
/// children. `work` holds `(6 size)` rows of `2 (6 size)`.
pub fn inverse_sum_of_blocks(count: usize, inertia: &[Six], flexibility: &[Six], work: &mut [f64], out: &mut [Six]) -> Option<()> {
    let size = 6 * count;
    let width = 2 * size;
    for i in 0..size {
        let row = &mut work[i * width..(i + 1) * width];
        row.fill(0.0);
        let own = &inertia[i / 6];
        for k in 0..6 {
            let factor = own.at(i % 6, k);
            for j in 0..size {
                row[j] += factor * flexibility[(i / 6) * count + j / 6].at(k, j % 6);
            }
            row[size + 6 * (i / 6) + k] = factor;
        }
        row[i] += 1.0;
    }
    for k in 0..size {
        let pivot = (k..size).max_by(|&a, &b| work[a * width + k].abs().total_cmp(&work[b * width + k].abs()))?;
        for c in k..width {
            work.swap(k * width + c, pivot * width + c);
        }
        let inverse = 1.0 / work[k * width + k];
        if !inverse.is_finite() {
            return None;
        }
        work[k * width + k..(k + 1) * width].iter_mut().for_each(|x| *x *= inverse);
        for i in (0..size).filter(|&i| i != k) {
            let factor = work[i * width + k];
            for c in k..width {
                work[i * width + c] -= factor * work[k * width + c];
            }
        }
    }
    let at = |i: usize, j: usize| work[i * width + size + j];
    for (block, out) in out.iter_mut().enumerate().take(count * count) {
        let (a, b) = (6 * (block / count), 6 * (block % count));
        for i in 0..6 {
            for j in 0..6 {
                out.set(i, j, 0.5 * (at(a + i, b + j) + at(b + j, a + i)));
            }
        }
    }
    Some(())
}
