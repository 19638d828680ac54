//! Solves with the loop inertia `Lambda = G M^-1 G'`, whose rank may be smaller than its size.
//!
//! Rows are scaled by what their diagonal would be without cancellation, so that a direction in which the loop cannot move shows as
//! rounding. Of the solutions that a rank-deficient system leaves, the multipliers of least Euclidean norm (N and N m) are taken.

use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::{Mat, Par, Spec};

/// Loop inertia, factored.
#[derive(Debug)]
pub struct Schur {
    /// `Lambda`, filled by the caller.
    pub matrix: Mat<f64>,
    /// Uncancelled diagonal of `Lambda`, filled by the caller.
    pub bound: Vec<f64>,
    scale: Vec<f64>,
    scaled: Mat<f64>,
    vectors: Mat<f64>,
    values: Vec<f64>,
    /// Null vectors in the multipliers' own units, orthonormal.
    null: Mat<f64>,
    null_count: usize,
    projected: Vec<f64>,
    memory: Memory,
}

/// Scratch of the decomposition.
struct Memory(MemBuffer);

impl std::fmt::Debug for Memory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Memory")
    }
}

impl Clone for Schur {
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.size());
        copy.matrix.copy_from(&self.matrix);
        copy.bound.copy_from_slice(&self.bound);
        copy.scale.copy_from_slice(&self.scale);
        copy.vectors.copy_from(&self.vectors);
        copy.values.copy_from_slice(&self.values);
        copy.null.copy_from(&self.null);
        copy.null_count = self.null_count;
        copy
    }
}

/// The decomposition did not converge, which finite numbers exclude.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotFactored;

/// Eigenvalues below this multiple of the largest belong to redundant directions: rounding leaves some 1e-14.
pub const REDUNDANT: f64 = 1e-12;

impl Schur {
    /// Room for n multipliers.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let scratch = self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Spec::default());
        Self {
            matrix: Mat::zeros(n, n),
            bound: vec![0.0; n],
            scale: vec![0.0; n],
            scaled: Mat::zeros(n, n),
            vectors: Mat::zeros(n, n),
            values: vec![0.0; n],
            null: Mat::zeros(n, n),
            null_count: 0,
            projected: vec![0.0; n],
            memory: Memory(MemBuffer::new(scratch)),
        }
    }

    /// Number of multipliers.
    #[must_use]
    pub fn size(&self) -> usize {
        self.values.len()
    }

    /// Factors the matrix and finds its rank: directions below `threshold` of the largest are left out of every solve.
    ///
    /// # Errors
    /// If the matrix holds what is not a number.
    pub fn factor(&mut self, threshold: f64) -> Result<(), NotFactored> {
        let n = self.size();
        for (s, b) in self.scale.iter_mut().zip(&self.bound) {
            *s = if *b > 0.0 { 1.0 / b.sqrt() } else { 0.0 };
        }
        for j in 0..n {
            for i in 0..n {
                let value = 0.5 * (self.matrix[(i, j)] + self.matrix[(j, i)]) * self.scale[i] * self.scale[j];
                if !value.is_finite() {
                    return Err(NotFactored);
                }
                self.scaled[(i, j)] = value;
            }
        }
        let stack = MemStack::new(&mut self.memory.0);
        let values = DiagMut::from_slice_mut(&mut self.values);
        self_adjoint_evd(self.scaled.as_ref(), values, Some(self.vectors.as_mut()), Par::Seq, stack, Spec::default())
            .map_err(|_| NotFactored)?;
        // ascending
        // loops that cannot move at all leave rounding as the largest
        let limit = threshold * self.values.last().copied().unwrap_or(0.0).max(1e-6);
        self.null_count = self.values.iter().filter(|v| **v <= limit).count();
        self.orthonormalise();
        Ok(())
    }

    /// Null vectors `scale * u` by Gram-Schmidt, twice; directions without any response stand for themselves.
    fn orthonormalise(&mut self) {
        let n = self.size();
        for c in 0..self.null_count {
            for i in 0..n {
                // where nothing responds any multiplier would do
                self.null[(i, c)] = self.vectors[(i, c)] * if self.scale[i] > 0.0 { self.scale[i] } else { 1.0 };
            }
            for _ in 0..2 {
                for p in 0..c {
                    let overlap: f64 = (0..n).map(|i| self.null[(i, p)] * self.null[(i, c)]).sum();
                    for i in 0..n {
                        let part = overlap * self.null[(i, p)];
                        self.null[(i, c)] -= part;
                    }
                }
                let norm = (0..n).map(|i| self.null[(i, c)] * self.null[(i, c)]).sum::<f64>().sqrt();
                for i in 0..n {
                    self.null[(i, c)] /= norm.max(f64::MIN_POSITIVE);
                }
            }
        }
    }

    /// True if some motion answers the multiplier `row`.
    #[must_use]
    pub fn responds(&self, row: usize) -> bool {
        self.bound[row] > 0.0
    }

    /// Largest factor by which a row is scaled.
    #[must_use]
    pub fn largest_scale(&self) -> f64 {
        self.scale.iter().copied().fold(0.0, f64::max)
    }

    /// Number of independent blocked directions.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.size() - self.null_count
    }

    /// Square root of the smallest scaled eigenvalue kept, over that of the largest: how near the next loss of rank is. Infinite where
    /// nothing is kept: there is no rank to lose.
    #[must_use]
    pub fn distance_to_rank_loss(&self) -> f64 {
        match (self.values.get(self.null_count), self.values.last()) {
            (Some(small), Some(large)) if *large > 0.0 => (small / large).sqrt(),
            _ => f64::INFINITY,
        }
    }

    /// Share of multiplier `row` in the redundant directions, from zero (determined) to one.
    #[must_use]
    pub fn redundancy(&self, row: usize) -> f64 {
        (0..self.null_count).map(|c| self.null[(row, c)] * self.null[(row, c)]).sum::<f64>().sqrt()
    }

    /// `out <- Lambda^+ right`, of least norm; returns how much of `right`, scaled, lies where no multiplier reaches, and its size.
    pub fn solve(&mut self, right: &[f64], out: &mut [f64]) -> (f64, f64) {
        let n = self.size();
        let (mut missed, mut size) = (0.0, 0.0);
        out.fill(0.0);
        for c in 0..n {
            let along: f64 = (0..n).map(|i| self.vectors[(i, c)] * self.scale[i] * right[i]).sum();
            size += along * along;
            if c < self.null_count {
                missed += along * along;
                continue;
            }
            let weight = along / self.values[c];
            for (i, o) in out.iter_mut().enumerate() {
                *o += self.vectors[(i, c)] * weight;
            }
        }
        for (o, s) in out.iter_mut().zip(&self.scale) {
            *o *= s;
        }
        for c in 0..self.null_count {
            self.projected[c] = (0..n).map(|i| self.null[(i, c)] * out[i]).sum();
        }
        for c in 0..self.null_count {
            for (i, o) in out.iter_mut().enumerate() {
                *o -= self.null[(i, c)] * self.projected[c];
            }
        }
        (missed.sqrt(), size.sqrt())
    }
}
