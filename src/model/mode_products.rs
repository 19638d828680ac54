//! The n^2 modal integrals of a body, packed so that one pass over half of them serves all that an evaluation asks.
//!
//! `P_ab,jk = int rho phi_ja phi_kb` is the sum of a part that is symmetric in the modes j, k and one that is antisymmetric. The symmetric
//! part has six planes (nine with geometric stiffness, whose displacements are not symmetric in a, b); the antisymmetric one has three,
//! `int rho (phi_k x phi_j)_c`. Of each, tiles of 4 x 4 modes on and above the diagonal are kept: a pass over them is bound by what the
//! caches deliver, and reads half. Source: DESIGN 3.1 (integrals), 3.3 (cost).

use crate::spatial::lanes::Lanes;

/// Four columns (modes k) of four rows (modes j).
type Tile = [[f64; 4]; 4];

/// Antisymmetric planes.
const CROSS: usize = 3;

/// The axes (a, b) of the antisymmetric plane c.
const AXES: [(usize, usize); CROSS] = [(1, 2), (2, 0), (0, 1)];

/// Packed integrals of one body.
#[derive(Debug, Clone)]
pub struct ModeProducts {
    blocks: usize,
    /// Plane of the symmetric part of each tensor component `3 a + b`.
    plane_of: [usize; 9],
    symmetric: usize,
    /// By block of modes k, then plane, then block of modes j.
    tiles: Vec<Tile>,
}

/// Products with the modal coordinates and rates, four modes at a time.
#[derive(Debug, Clone)]
pub struct ProductSums {
    eta: Vec<[f64; 4]>,
    rate: Vec<[f64; 4]>,
    /// The symmetric planes, then the antisymmetric ones, times eta; then the antisymmetric ones times the rates.
    sums: Vec<[f64; 4]>,
}

impl ModeProducts {
    /// Packs nine planes of n x n, column k contiguous: `P_ab,jk` at `((3 a + b) n + k) n + j`, and the three antisymmetric ones,
    /// `P_ba - P_ab` without geometric stiffness, in the same way; `stiffened` if the nine hold that of geometric stiffness.
    #[must_use]
    pub fn new(n: usize, planes: &[f64], cross: &[f64], stiffened: bool) -> Self {
        let square = n * n;
        let half_sum = |p: usize, j: usize, k: usize| 0.5 * (planes[p * square + k * n + j] + planes[p * square + j * n + k]);
        // without geometric stiffness the symmetric parts of ab and ba are the same integrals: two sums of the same nodes
        let symmetric_part = |p: usize, j: usize, k: usize| {
            let other = 3 * (p % 3) + p / 3;
            if stiffened { half_sum(p, j, k) } else { 0.5 * (half_sum(p, j, k) + half_sum(other, j, k)) }
        };
        let (mut plane_of, mut kept) = ([0; 9], Vec::new());
        for p in 0..9 {
            let (a, b) = (p / 3, p % 3);
            plane_of[p] = if !stiffened && b < a {
                plane_of[3 * b + a]
            } else {
                kept.push(p);
                kept.len() - 1
            };
        }
        let blocks = n.div_ceil(4);
        let mut tiles = Vec::with_capacity((kept.len() + CROSS) * blocks * (blocks + 1) / 2);
        let tile = |entry: &dyn Fn(usize, usize) -> f64, row: usize, column: usize| -> Tile {
            let at = |j: usize, k: usize| if j < n && k < n { entry(j, k) } else { 0.0 };
            std::array::from_fn(|k| std::array::from_fn(|j| at(4 * row + j, 4 * column + k)))
        };
        for column in 0..blocks {
            for &p in &kept {
                tiles.extend((0..=column).map(|row| tile(&|j, k| symmetric_part(p, j, k), row, column)));
            }
            for c in 0..CROSS {
                let part = |j: usize, k: usize| 0.5 * (cross[c * square + k * n + j] - cross[c * square + j * n + k]);
                tiles.extend((0..=column).map(|row| tile(&part, row, column)));
            }
        }
        Self { blocks, plane_of, symmetric: kept.len(), tiles }
    }

    /// `P_ab,jj` of tensor component `3 a + b`.
    #[must_use]
    pub fn diagonal(&self, component: usize, j: usize) -> f64 {
        let block = j / 4;
        let planes = self.symmetric + CROSS;
        // the tiles of all blocks of columns before this one, those of the planes before this one, those above the diagonal
        let first = planes * block * (block + 1) / 2 + self.plane_of[component] * (block + 1) + block;
        self.tiles[first][j % 4][j % 4]
    }

    /// One pass over all tiles.
    #[inline(always)]
    fn multiply<L: Lanes>(&self, s: L, eta: &[[f64; 4]], rate: &[[f64; 4]], sums: &mut [[f64; 4]]) {
        let (blocks, symmetric) = (self.blocks, self.symmetric);
        let mut tiles = self.tiles.as_slice();
        let (with_eta, with_rate) = sums.split_at_mut((symmetric + CROSS) * blocks);
        for column in 0..blocks {
            for plane in with_eta.chunks_exact_mut(blocks).take(symmetric) {
                let (now, rest) = tiles.split_at(column + 1);
                tiles = rest;
                multiply_tiles(s, now, eta, 1.0, plane);
            }
            for c in 0..CROSS {
                let (now, rest) = tiles.split_at(column + 1);
                tiles = rest;
                multiply_tiles(s, now, eta, -1.0, &mut with_eta[(symmetric + c) * blocks..(symmetric + c + 1) * blocks]);
                multiply_tiles(s, now, rate, -1.0, &mut with_rate[c * blocks..(c + 1) * blocks]);
            }
        }
    }

    /// `out += sum_k P_ab,jk eta_k` for all nine components, n numbers each.
    #[inline(always)]
    pub fn add_shapes(&self, sums: &ProductSums, n: usize, out: &mut [f64]) {
        if n == 0 {
            return;
        }
        for (component, out) in out.chunks_exact_mut(n).enumerate().take(9) {
            let (a, b) = (component / 3, component % 3);
            let symmetric = sums.plane(self.blocks, self.plane_of[component]);
            add_scaled(1.0, symmetric, out);
            if a != b {
                // P_ba - P_ab of the plane's own (a, b) is what it holds
                let c = 3 - a - b;
                let sign = if AXES[c] == (b, a) { 0.5 } else { -0.5 };
                let cross = sums.plane(self.blocks, self.symmetric + c);
                add_scaled(sign, cross, out);
            }
        }
    }

    /// `out_j += factors_c sum_k int rho (phi_k x phi_j)_c rate_k`.
    #[inline(always)]
    pub fn add_coriolis(&self, sums: &ProductSums, factors: [f64; CROSS], out: &mut [f64]) {
        for (c, factor) in factors.into_iter().enumerate() {
            let cross = sums.plane(self.blocks, self.symmetric + CROSS + c);
            add_scaled(factor, cross, out);
        }
    }
}

impl ProductSums {
    /// Room for the products of `n` modes.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let blocks = n.div_ceil(4);
        let zero = vec![[0.0; 4]; blocks];
        Self { eta: zero.clone(), rate: zero, sums: vec![[0.0; 4]; (9 + 2 * CROSS) * blocks] }
    }

    /// Multiplies everything: one pass over `products`.
    #[inline(always)]
    pub fn multiply<L: Lanes>(&mut self, lanes: L, products: &ModeProducts, eta: &[f64], rate: &[f64]) {
        for (to, from) in [(&mut self.eta, eta), (&mut self.rate, rate)] {
            to.iter_mut().zip(from.chunks(4)).for_each(|(to, from)| to[..from.len()].copy_from_slice(from));
        }
        products.multiply(lanes, &self.eta, &self.rate, &mut self.sums);
    }

    /// What the pass left of one plane, four modes at a time.
    fn plane(&self, blocks: usize, plane: usize) -> &[[f64; 4]] {
        &self.sums[plane * blocks..(plane + 1) * blocks]
    }
}

/// `out += factor x`, one number per mode.
#[inline(always)]
fn add_scaled(factor: f64, x: &[[f64; 4]], out: &mut [f64]) {
    let (whole, rest) = out.as_chunks_mut::<4>();
    for (out, x) in whole.iter_mut().zip(x) {
        for i in 0..4 {
            out[i] += factor * x[i];
        }
    }
    if let Some(x) = x.last() {
        rest.iter_mut().zip(x).for_each(|(o, x)| *o += factor * x);
    }
}

/// One block of columns of a plane times `x`: the tiles themselves, and, with `sign`, their transposes below the diagonal.
#[inline(always)]
fn multiply_tiles<L: Lanes>(s: L, tiles: &[Tile], x: &[[f64; 4]], sign: f64, out: &mut [[f64; 4]]) {
    let Some((diagonal, above)) = tiles.split_last() else { return };
    let column = above.len();
    let own = x[column];
    let factors = [s.splat(own[0]), s.splat(own[1]), s.splat(own[2]), s.splat(own[3])];
    let mut transposed = [s.splat(0.0); 4];
    for ((tile, x), out) in above.iter().zip(x).zip(out.iter_mut()) {
        let (x, mut sum) = (s.load(*x), s.load(*out));
        for k in 0..4 {
            let numbers = s.load(tile[k]);
            sum = s.mul_add(numbers, factors[k], sum);
            transposed[k] = s.mul_add(numbers, x, transposed[k]);
        }
        *out = s.store(sum);
    }
    let mut sum = s.mul(s.sums_of_four(transposed), s.splat(sign));
    for k in 0..4 {
        sum = s.mul_add(s.load(diagonal[k]), factors[k], sum);
    }
    out[column] = s.store(sum);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::lanes::{Kernel, Processor};

    struct Multiply<'a> {
        sums: &'a mut ProductSums,
        products: &'a ModeProducts,
        eta: &'a [f64],
        rate: &'a [f64],
    }

    impl Kernel for Multiply<'_> {
        type Output = ();

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) {
            self.sums.multiply(lanes, self.products, self.eta, self.rate);
        }
    }

    #[test]
    fn packed_products_are_those_of_the_whole_planes() {
        for n in [0, 1, 3, 4, 5, 8, 13] {
            for skewed in [false, true] {
                let wave = |i: usize, seed: f64| (0.37 * i as f64 + seed).sin();
                // phi_ja phi_kb summed over nodes, and with geometric stiffness something symmetric in j, k on every plane
                let shape = |node: usize, j: usize, a: usize| wave(node * 31 + j * 7 + a * 3, 0.2);
                let mut planes = vec![0.0; 9 * n * n];
                for p in 0..9 {
                    for k in 0..n {
                        for j in 0..n {
                            planes[(p * n + k) * n + j] = (0..5).map(|i| shape(i, j, p / 3) * shape(i, k, p % 3)).sum();
                        }
                    }
                }
                let mut cross = vec![0.0; 3 * n * n];
                for (c, (a, b)) in AXES.into_iter().enumerate() {
                    for i in 0..n * n {
                        cross[c * n * n + i] = planes[(3 * b + a) * n * n + i] - planes[(3 * a + b) * n * n + i];
                    }
                }
                if skewed {
                    for p in 0..9 {
                        for k in 0..n {
                            for j in 0..n {
                                planes[(p * n + k) * n + j] += wave(p * 100 + (j + k), 1.0) + wave(j * k, 0.4);
                            }
                        }
                    }
                }
                let eta: Vec<f64> = (0..n).map(|j| wave(j, 2.0)).collect();
                let rate: Vec<f64> = (0..n).map(|j| wave(j, 3.0)).collect();
                let products = ModeProducts::new(n, &planes, &cross, skewed);
                assert_eq!(products.symmetric, if skewed { 9 } else { 6 });
                for processor in [Processor::plain(), Processor::detect()] {
                    let mut sums = ProductSums::new(n);
                    processor.run(Multiply { sums: &mut sums, products: &products, eta: &eta, rate: &rate });
                    let (mut shapes, mut coriolis) = (vec![0.0; 9 * n], vec![0.0; n]);
                    products.add_shapes(&sums, n, &mut shapes);
                    products.add_coriolis(&sums, [0.3, -0.7, 1.1], &mut coriolis);
                    // sums of 2 n + 9 products below ten
                    let allowed = 10.0 * (2 * n + 9) as f64 * f64::EPSILON;
                    for j in 0..n {
                        for p in 0..9 {
                            let wanted: f64 = (0..n).map(|k| planes[(p * n + k) * n + j] * eta[k]).sum();
                            assert!((shapes[p * n + j] - wanted).abs() < allowed, "{n} modes, plane {p}, mode {j}");
                            assert!((products.diagonal(p, j) - planes[(p * n + j) * n + j]).abs() < allowed);
                        }
                        let wanted: f64 =
                            (0..3).map(|c| [0.3, -0.7, 1.1][c] * (0..n).map(|k| cross[(c * n + k) * n + j] * rate[k]).sum::<f64>()).sum();
                        assert!((coriolis[j] - wanted).abs() < 3.0 * allowed, "{n} modes, mode {j}");
                    }
                }
            }
        }
    }
}
