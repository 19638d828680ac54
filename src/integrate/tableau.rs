//! Coefficients of the explicit Runge-Kutta methods.

/// An explicit method: nodes c, matrix a (rows below the diagonal), weights b, and the difference to the embedded weights.
#[derive(Debug, Clone, Copy)]
pub struct Tableau {
    /// Name in scenes and reports.
    pub name: &'static str,
    /// Nodes.
    pub c: &'static [f64],
    /// Rows of a; row i has i entries.
    pub a: &'static [&'static [f64]],
    /// Weights of the solution that is kept.
    pub b: &'static [f64],
    /// Weights of the error estimate, empty for a fixed-step method. May have one entry more than `b`: the rate at the step's end.
    pub error: &'static [f64],
    /// Weights of the dense output's quintic term, as long as `error`; empty for the cubic Hermite interpolant.
    pub dense: &'static [f64],
    /// Order of the solution.
    pub order: u8,
}

/// The classical method of order 4 (Kutta 1901).
pub const RK4: Tableau = Tableau {
    name: "rk4",
    c: &[0.0, 0.5, 0.5, 1.0],
    a: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    b: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    error: &[],
    dense: &[],
    order: 4,
};

/// Dormand and Prince's pair of orders 5 and 4 (J. Comput. Appl. Math. 6, 1980) with the dense output of order 4 given by Hairer,
/// Norsett and Wanner (Solving Ordinary Differential Equations I, II.6).
pub const DORMAND_PRINCE: Tableau = Tableau {
    name: "dormand_prince",
    c: &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0],
    a: &[
        &[],
        &[0.2],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19_372.0 / 6_561.0, -25_360.0 / 2_187.0, 64_448.0 / 6_561.0, -212.0 / 729.0],
        &[9_017.0 / 3_168.0, -355.0 / 33.0, 46_732.0 / 5_247.0, 49.0 / 176.0, -5_103.0 / 18_656.0],
    ],
    b: &[35.0 / 384.0, 0.0, 500.0 / 1_113.0, 125.0 / 192.0, -2_187.0 / 6_784.0, 11.0 / 84.0],
    error: &[71.0 / 57_600.0, 0.0, -71.0 / 16_695.0, 71.0 / 1_920.0, -17_253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0],
    dense: &[
        -12_715_105_075.0 / 11_282_082_432.0,
        0.0,
        87_487_479_700.0 / 32_700_410_799.0,
        -10_690_763_975.0 / 1_880_347_072.0,
        701_980_252_875.0 / 199_316_789_632.0,
        -1_453_857_185.0 / 822_651_844.0,
        69_997_945.0 / 29_380_423.0,
    ],
    order: 5,
};

impl Tableau {
    /// Coefficients of the stability polynomial R(z), from the constant term up.
    #[must_use]
    pub fn stability_polynomial(&self) -> Vec<f64> {
        let stages = self.b.len();
        let mut power = vec![1.0; stages];
        let mut coefficients = vec![1.0];
        for _ in 0..stages {
            coefficients.push(self.b.iter().zip(&power).map(|(b, p)| b * p).sum());
            power = self.a.iter().map(|row| row.iter().zip(&power).map(|(a, p)| a * p).sum()).collect();
        }
        coefficients
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_meet_the_order_conditions_of_quadrature_and_nodes_their_rows() {
        for t in [RK4, DORMAND_PRINCE] {
            for (c, row) in t.c.iter().zip(t.a) {
                assert!((row.iter().sum::<f64>() - c).abs() < 8.0 * f64::EPSILON * 12.0, "{}", t.name);
            }
            for k in 0..i32::from(t.order) {
                let sum: f64 = t.b.iter().zip(t.c).map(|(b, c)| b * c.powi(k)).sum();
                assert!((sum - 1.0 / f64::from(k + 1)).abs() < 1e-15, "{} {k}", t.name);
            }
            assert!(t.error.iter().sum::<f64>().abs() < 1e-16 && t.dense.iter().sum::<f64>().abs() < 1e-14);
        }
    }
}
