//! Functions of time that a scene may give: torques, prescribed motions, external loads.

use thiserror::Error;

/// A vector-valued function of time with two derivatives almost everywhere.
#[derive(Debug, Clone, PartialEq)]
pub enum TimeFunction {
    /// The same value at all times.
    Constant(Vec<f64>),
    /// Values at given times; the end values hold outside. See [`Table`].
    Table(Table),
    /// `amplitude * sin(2 pi frequency_hz t + phase)`.
    Sine {
        /// One per component.
        amplitude: Vec<f64>,
        /// Hz.
        frequency_hz: f64,
        /// rad.
        phase: f64,
    },
    /// `from` until `start`, `to` from `end` on, between them the quintic with zero rate and acceleration at both ends.
    SmoothStep {
        /// Value before the step.
        from: Vec<f64>,
        /// Value after the step.
        to: Vec<f64>,
        /// s.
        start: f64,
        /// s.
        end: f64,
    },
    /// The sum of several functions of one dimension.
    Sum(Vec<TimeFunction>),
}

/// Values at ascending times: straight lines between them, or the cubic spline through them that rests at both ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    times: Vec<f64>,
    /// Row-major, one row per time.
    values: Vec<f64>,
    /// Second derivatives of the spline, like `values`; empty for straight lines.
    curvatures: Vec<f64>,
    dimension: usize,
}

/// What makes a table unusable.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum TableError {
    /// No rows.
    #[error("the table has no rows; give at least one [time, value]")]
    Empty,
    /// Rows of different width.
    #[error("row {row} holds {found} values, row 1 holds {expected}")]
    Ragged {
        /// 1-based.
        row: usize,
        /// Values in that row.
        found: usize,
        /// Values in the first row.
        expected: usize,
    },
    /// Times that do not ascend.
    #[error("the times must ascend: row {row} has t = {time} s after {previous} s")]
    NotAscending {
        /// 1-based.
        row: usize,
        /// s.
        time: f64,
        /// s.
        previous: f64,
    },
}

impl Table {
    /// A table of rows (time in s, values), joined by straight lines.
    ///
    /// # Errors
    /// If there are no rows, rows differ in width, or times do not ascend.
    pub fn new(rows: &[(f64, Vec<f64>)]) -> Result<Self, TableError> {
        let dimension = rows.first().ok_or(TableError::Empty)?.1.len();
        for (i, (time, value)) in rows.iter().enumerate() {
            if value.len() != dimension {
                return Err(TableError::Ragged { row: i + 1, found: value.len(), expected: dimension });
            }
            if i > 0 && *time <= rows[i - 1].0 {
                return Err(TableError::NotAscending { row: i + 1, time: *time, previous: rows[i - 1].0 });
            }
        }
        let times = rows.iter().map(|r| r.0).collect();
        let values = rows.iter().flat_map(|r| r.1.iter().copied()).collect();
        Ok(Self { times, values, curvatures: Vec::new(), dimension })
    }

    /// The same table with the cubic spline through its values that rests at both ends, for motions that need two derivatives.
    ///
    /// The end values hold outside the table, so that any other end slope would be a jump in rate, which no hinge can follow.
    #[must_use]
    pub fn splined(mut self) -> Self {
        let (n, d) = (self.times.len(), self.dimension);
        self.curvatures = vec![0.0; n * d];
        if n < 2 {
            return self;
        }
        // tridiagonal system for the curvatures, by elimination down and substitution up (diagonally dominant)
        let step = |i: usize| self.times[i + 1] - self.times[i];
        for c in 0..d {
            let slope = |i: usize| (self.values[(i + 1) * d + c] - self.values[i * d + c]) / step(i);
            let mut pivot = vec![0.0; n];
            let mut right = vec![0.0; n];
            for i in 0..n {
                let (below, before) = if i > 0 { (step(i - 1), slope(i - 1)) } else { (0.0, 0.0) };
                let (above, after) = if i + 1 < n { (step(i), slope(i)) } else { (0.0, 0.0) };
                let carried = if i > 0 { below / pivot[i - 1] } else { 0.0 };
                pivot[i] = 2.0 * (below + above) - carried * below;
                right[i] = 6.0 * (after - before) - if i > 0 { carried * right[i - 1] } else { 0.0 };
            }
            for i in (0..n).rev() {
                let above = if i + 1 < n { step(i) * self.curvatures[(i + 1) * d + c] } else { 0.0 };
                self.curvatures[i * d + c] = (right[i] - above) / pivot[i];
            }
        }
        self
    }

    /// Straight lines are seen at their ends.
    fn resolution(&self, t: f64) -> f64 {
        let above = self.times.partition_point(|&x| x < t);
        if self.curvatures.is_empty() || above == 0 || above == self.times.len() {
            return f64::INFINITY;
        }
        (self.times[above] - self.times[above - 1]) / SPLINE_PARTS
    }

    fn sample(&self, t: f64, component: usize) -> [f64; 3] {
        let (n, d) = (self.times.len(), self.dimension);
        let at = |i: usize| self.values[i * d + component];
        if t <= self.times[0] {
            return [at(0), 0.0, 0.0];
        }
        if t > self.times[n - 1] {
            return [at(n - 1), 0.0, 0.0];
        }
        let i = self.times.partition_point(|&x| x < t) - 1;
        let h = self.times[i + 1] - self.times[i];
        let (b, slope) = ((t - self.times[i]) / h, (at(i + 1) - at(i)) / h);
        let a = 1.0 - b;
        if self.curvatures.is_empty() {
            return [a * at(i) + b * at(i + 1), slope, 0.0];
        }
        let (p, q) = (self.curvatures[i * d + component], self.curvatures[(i + 1) * d + component]);
        [
            a * at(i) + b * at(i + 1) + ((a * a - 1.0) * a * p + (b * b - 1.0) * b * q) * h * h / 6.0,
            slope + ((3.0 * b * b - 1.0) * q - (3.0 * a * a - 1.0) * p) * h / 6.0,
            a * p + b * q,
        ]
    }
}

/// Steps per period of a sine: no peak lies further from the end of a step than half of one, where 1 - cos(pi / 40) = 0.3 % are missing.
const SINE_PARTS: f64 = 40.0;

/// Steps per smooth step: of equal ones two end within 1e-3 of the peaks of the acceleration, at (1 -+ 1 / sqrt(3)) / 2 of it, and no steps
/// miss these by more than 0.3 %.
const SMOOTH_STEP_PARTS: f64 = 38.0;

/// Steps per span of a spline, whose acceleration is a straight line: enough for the work that it does.
const SPLINE_PARTS: f64 = 4.0;

impl TimeFunction {
    /// Number of components.
    #[must_use]
    pub fn dimension(&self) -> usize {
        match self {
            Self::Constant(x) => x.len(),
            Self::Table(table) => table.dimension,
            Self::Sine { amplitude, .. } => amplitude.len(),
            Self::SmoothStep { from, .. } => from.len(),
            Self::Sum(terms) => terms.first().map_or(0, Self::dimension),
        }
    }

    /// Value, rate and acceleration of one component at time `t` (s), those from before where they jump. A component past the dimension is
    /// zero.
    #[must_use]
    pub fn sample(&self, t: f64, component: usize) -> [f64; 3] {
        match self {
            Self::Constant(x) => [x[component], 0.0, 0.0],
            Self::Table(table) => table.sample(t, component),
            Self::Sine { amplitude, frequency_hz, phase } => {
                let omega = std::f64::consts::TAU * frequency_hz;
                let (s, c) = (omega * t + phase).sin_cos();
                let a = amplitude[component];
                [a * s, a * omega * c, -a * omega * omega * s]
            }
            Self::SmoothStep { from, to, start, end } => {
                let (length, change) = (end - start, to[component] - from[component]);
                let s = ((t - start) / length).clamp(0.0, 1.0);
                [
                    from[component] + change * s * s * s * (10.0 + s * (6.0 * s - 15.0)),
                    change / length * 30.0 * s * s * (1.0 - s) * (1.0 - s),
                    change / (length * length) * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
                ]
            }
            Self::Sum(terms) => terms.iter().map(|f| f.sample(t, component)).fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]),
        }
    }

    /// Every number the function was given, for checks.
    #[must_use]
    pub fn parameters(&self) -> Vec<f64> {
        match self {
            Self::Constant(x) => x.clone(),
            Self::Table(table) => [&*table.times, &*table.values].concat(),
            Self::Sine { amplitude, frequency_hz, phase } => [&**amplitude, &[*frequency_hz, *phase]].concat(),
            Self::SmoothStep { from, to, start, end } => [&**from, to, &[*start, *end]].concat(),
            Self::Sum(terms) => terms.iter().flat_map(Self::parameters).collect(),
        }
    }

    /// Value of one component at time `t` (s).
    #[must_use]
    pub fn value(&self, t: f64, component: usize) -> f64 {
        self.sample(t, component)[0]
    }

    /// Times (s) at which some derivative jumps; an integrator step should end there.
    pub fn breaks(&self, into: &mut Vec<f64>) {
        match self {
            Self::Constant(_) | Self::Sine { .. } => {}
            Self::Table(table) => into.extend(&table.times),
            Self::SmoothStep { start, end, .. } => into.extend([*start, *end]),
            Self::Sum(terms) => terms.iter().for_each(|f| f.breaks(into)),
        }
    }

    /// Longest step (s) around time `t` that sees the function's course, between two of its breaks.
    #[must_use]
    pub fn resolution(&self, t: f64) -> f64 {
        match self {
            Self::Sine { amplitude, frequency_hz, .. } if amplitude.iter().any(|a| *a != 0.0) => 1.0 / (SINE_PARTS * frequency_hz.abs()),
            Self::SmoothStep { from, to, start, end } if from != to && t > *start && t < *end => (end - start) / SMOOTH_STEP_PARTS,
            Self::Constant(_) | Self::Sine { .. } | Self::SmoothStep { .. } => f64::INFINITY,
            Self::Table(table) => table.resolution(t),
            Self::Sum(terms) => terms.iter().map(|f| f.resolution(t)).fold(f64::INFINITY, f64::min),
        }
    }

    /// The same function with every table replaced by its cubic spline, so that it has two derivatives.
    #[must_use]
    pub fn splined(self) -> Self {
        match self {
            Self::Table(table) => Self::Table(table.splined()),
            Self::Sum(terms) => Self::Sum(terms.into_iter().map(Self::splined).collect()),
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_the_slopes_of_the_values() {
        let rows: Vec<_> = [0.0, 0.4, 1.1, 1.5, 2.0].iter().map(|&t: &f64| (t, vec![t.sin(), t * t])).collect();
        let functions = [
            TimeFunction::Sine { amplitude: vec![2.0, 0.5], frequency_hz: 0.7, phase: 0.3 },
            TimeFunction::SmoothStep { from: vec![0.0, 1.0], to: vec![2.0, -1.0], start: 0.1, end: 1.9 },
            TimeFunction::Table(Table::new(&rows).unwrap().splined()),
        ];
        let sum = TimeFunction::Sum(functions.to_vec());
        let h = 1e-4;
        for f in functions.iter().chain([&sum]) {
            for component in 0..2 {
                for t in [0.2, 0.75, 1.3, 1.7] {
                    let [_, rate, acceleration] = f.sample(t, component);
                    let (plus, minus) = (f.sample(t + h, component), f.sample(t - h, component));
                    // central differences: h^2 / 6 times a third derivative below 300
                    assert!((rate - (plus[0] - minus[0]) / (2.0 * h)).abs() < 50.0 * h * h, "{f:?}");
                    assert!((acceleration - (plus[1] - minus[1]) / (2.0 * h)).abs() < 500.0 * h * h, "{f:?}");
                }
            }
        }
    }

    #[test]
    fn a_spline_passes_through_its_table_and_rests_at_both_ends() {
        // a cubic that rests at both ends is its own spline, whatever the knots
        let cubic = |t: f64| 3.0 * t * t - 2.0 * t * t * t;
        let rows: Vec<_> = [0.0, 0.2, 0.7, 1.0].iter().map(|&t| (t, vec![cubic(t)])).collect();
        let f = TimeFunction::Table(Table::new(&rows).unwrap().splined());
        for t in [0.0, 0.1, 0.2, 0.55, 0.9, 1.0] {
            assert!((f.value(t, 0) - cubic(t)).abs() < 1e-14);
        }
        assert!(f.sample(1e-9, 0)[1].abs() < 1e-8 && f.sample(1.0 - 1e-9, 0)[1].abs() < 1e-8);
        assert_eq!(f.sample(9.0, 0), [1.0, 0.0, 0.0]);
        let two = TimeFunction::Table(Table::new(&[(0.0, vec![0.0]), (1.0, vec![1.0])]).unwrap().splined());
        assert!((two.value(0.3, 0) - cubic(0.3)).abs() < 1e-15);
    }

    #[test]
    fn tables_with_times_that_do_not_ascend_are_refused() {
        let error = Table::new(&[(0.0, vec![1.0]), (0.0, vec![2.0])]).unwrap_err();
        assert_eq!(error.to_string(), "the times must ascend: row 2 has t = 0 s after 0 s");
    }
}
