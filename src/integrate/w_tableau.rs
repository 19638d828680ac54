//! Coefficients of Rosenbrock W-methods.
//!
//! With `A` any matrix near df/dy, `k_i = f(t + alpha_i h, y + h sum_{j<i} alpha_ij k_j) + h A sum_{j<=i} gamma_ij k_j` and
//! `y1 = y + h sum b_i k_i`. A W-method keeps its order whatever `A` is, so that a term for df/dt may be left out as well.

/// A method whose `gamma_ii` are all `gamma`.
#[derive(Debug, Clone, Copy)]
pub struct WTableau {
    /// Name in scenes and reports.
    pub name: &'static str,
    /// Diagonal of the implicit part.
    pub gamma: f64,
    /// Rows of alpha below the diagonal; row i has i entries.
    pub alpha: [&'static [f64]; STAGES],
    /// Rows of gamma below the diagonal; row i has i entries.
    pub gamma_rows: [&'static [f64]; STAGES],
    /// Weights of the solution that is kept.
    pub b: [f64; STAGES],
    /// Weights of the embedded solution.
    pub embedded: [f64; STAGES],
    /// Order of the solution that is kept, one above that of the embedded one.
    pub order: u8,
}

/// Stages of every method here.
pub const STAGES: usize = 4;

/// ROS34PW2 (Rang and Angermann, BIT 45, 2005): order 3 with any `A`, embedded order 2, L-stable and stiffly accurate.
pub const ROS34PW2: WTableau = WTableau {
    name: "rosenbrock_w",
    gamma: 4.358_665_215_084_59e-1,
    alpha: [&[], &[8.717_330_430_169_18e-1], &[8.445_706_001_536_942e-1, -1.129_906_423_648_418_5e-1], &[0.0, 0.0, 1.0]],
    gamma_rows: [
        &[],
        &[-8.717_330_430_169_18e-1],
        &[-9.033_805_701_304_408e-1, 5.418_067_238_809_532_6e-2],
        &[2.421_238_070_609_534_6e-1, -1.223_250_583_904_514_7, 5.452_602_553_351_021e-1],
    ],
    b: [2.421_238_070_609_534_6e-1, -1.223_250_583_904_514_7, 1.545_260_255_335_102, 4.358_665_215_084_59e-1],
    embedded: [3.781_090_314_581_937e-1, -9.604_229_221_242_318e-2, 0.5, 2.179_332_607_542_295e-1],
    order: 3,
};

impl WTableau {
    /// Fraction of the step at which stage `i` is evaluated.
    #[must_use]
    pub fn node(&self, i: usize) -> f64 {
        self.alpha[i].iter().sum()
    }

    /// `R(z)` of the test equation with the exact Jacobian, at `z = re + i im`.
    #[must_use]
    pub fn stability_function(&self, re: f64, im: f64) -> [f64; 2] {
        let times = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
        let z = [re, im];
        let denominator = [1.0 - self.gamma * re, -self.gamma * im];
        let size = denominator[0] * denominator[0] + denominator[1] * denominator[1];
        let inverse = [denominator[0] / size, -denominator[1] / size];
        // stage by stage: k_i (1 - z gamma) = z (1 + sum_j (alpha_ij + gamma_ij) k_j)
        let mut k = [[0.0; 2]; STAGES];
        let mut end = [1.0, 0.0];
        for i in 0..STAGES {
            let mut sum = [1.0, 0.0];
            for ((a, g), k) in self.alpha[i].iter().zip(self.gamma_rows[i]).zip(&k) {
                sum = [sum[0] + (a + g) * k[0], sum[1] + (a + g) * k[1]];
            }
            k[i] = times(times(z, sum), inverse);
            end = [end[0] + self.b[i] * k[i][0], end[1] + self.b[i] * k[i][1]];
        }
        end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Matrices alpha and gamma with its diagonal, and the ones.
    fn matrices(t: &WTableau) -> ([[f64; STAGES]; STAGES], [[f64; STAGES]; STAGES]) {
        let at = |rows: &[&[f64]; STAGES], i: usize, j: usize| rows[i].get(j).copied().unwrap_or(0.0);
        let gamma = |i, j| if i == j { t.gamma } else { at(&t.gamma_rows, i, j) };
        (
            std::array::from_fn(|i| std::array::from_fn(|j| at(&t.alpha, i, j))),
            std::array::from_fn(|i| std::array::from_fn(|j| gamma(i, j))),
        )
    }

    fn times(m: &[[f64; STAGES]; STAGES], x: &[f64; STAGES]) -> [f64; STAGES] {
        std::array::from_fn(|i| m[i].iter().zip(x).map(|(m, x)| m * x).sum())
    }

    #[test]
    fn weights_meet_the_order_conditions_of_w_methods() {
        let t = ROS34PW2;
        let (alpha, gamma) = matrices(&t);
        let one = [1.0; STAGES];
        let (a, g) = (times(&alpha, &one), times(&gamma, &one));
        let sum = |b: &[f64; STAGES], x: [f64; STAGES]| b.iter().zip(x).map(|(b, x)| b * x).sum::<f64>();
        let squares = std::array::from_fn(|i| a[i] * a[i]);
        // Hairer and Wanner, Solving Ordinary Differential Equations II, IV.7: one tree for f, f' and A at every node
        let third = [
            (squares, 1.0 / 3.0),
            (times(&alpha, &a), 1.0 / 6.0),
            (times(&alpha, &g), 0.0),
            (times(&gamma, &a), 0.0),
            (times(&gamma, &g), 0.0),
        ];
        // printed to 16 digits; sums of four terms of order one
        for (x, value) in [(one, 1.0), (a, 0.5), (g, 0.0)].into_iter().chain(third) {
            assert!((sum(&t.b, x) - value).abs() < 4e-15, "{x:?}: {:e}", sum(&t.b, x) - value);
        }
        for (x, value) in [(one, 1.0), (a, 0.5), (g, 0.0)] {
            assert!((sum(&t.embedded, x) - value).abs() < 4e-15, "embedded {x:?}: {:e}", sum(&t.embedded, x) - value);
        }
        assert!((sum(&t.embedded, squares) - 1.0 / 3.0).abs() > 0.01, "the embedded solution has an error to show");
    }

    #[test]
    fn last_stage_is_the_step_and_the_method_is_l_stable() {
        let t = ROS34PW2;
        let (alpha, gamma) = matrices(&t);
        for j in 0..STAGES {
            assert!((alpha[STAGES - 1][j] + gamma[STAGES - 1][j] - t.b[j]).abs() < 1e-15);
        }
        let size = |re, im| {
            let [a, b] = t.stability_function(re, im);
            f64::hypot(a, b)
        };
        // the imaginary axis bounds the left half plane, where R has no pole
        let largest = (-400..800).map(|i| size(0.0, 10.0_f64.powf(f64::from(i) * 0.01))).fold(0.0, f64::max);
        assert!(largest <= 1.0 + 4.0 * f64::EPSILON, "{largest}");
        assert!(size(-1e12, 0.0) < 1e-11 && size(0.0, 1e12) < 1e-11);
        // agrees with exp to the order: the remainder is of the fourth power
        let off = |z: f64| size(-z, 0.0) - (-z).exp();
        assert!(((off(0.02) / off(0.01)).log2() - 4.0).abs() < 0.1, "{}", (off(0.02) / off(0.01)).log2());
    }
}
