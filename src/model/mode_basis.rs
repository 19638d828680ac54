//! Which combinations of a modal file's modes a body retains: whole modes, and residual modes that carry what the others leave out.
//!
//! A body that retains only its lowest modes is too stiff under static loads: the left-out modes would have followed them at once.
//! Residual modes are the answer of the left-out modes to the loads that can act on the body: the six inertial loads of a moving
//! frame, and the six forces and moments at every place where something is attached. They are orthonormal to the retained modes and
//! among each other, each with its own frequency, so that the recursion meets plain modes: `M_ff = I` stays, energy is conserved, and
//! a body with residual modes answers any static load as with all modes of its file.
//! (MacNeal 1971, Rubin 1975: residual flexibility; the mass of the residual modes is kept, as in residual vectors of structural codes.)

use super::modal_body::{Interface, ModalBody};
use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, Vector3, Vector6};
use std::f64::consts::TAU;
use std::ops::{AddAssign, Mul};

/// Smallest share of the largest singular value of the (unit) static answers that counts as a direction of its own.
const INDEPENDENT: f64 = 1e-6;
/// Smallest share of the body's mass, or of its inertia, that left-out modes must carry for an inertial load to excite them.
const CARRIED: f64 = 1e-12;

/// Retained modes of a body as combinations of the N modes of its modal file.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeBasis {
    /// 0-based numbers of the modes that are retained whole.
    pub whole: Vec<usize>,
    /// Residual modes over all modes of the file, N x r; zero in the rows of `whole`.
    pub residual: DMatrix<f64>,
}

/// The modal stiffness cannot answer a static load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the modal stiffness is not positive definite, so that static loads have no answer")]
pub struct NoStaticAnswer;

impl ModeBasis {
    /// Whole modes only, of a file with `available` modes.
    #[must_use]
    pub fn whole(modes: Vec<usize>, available: usize) -> Self {
        Self { whole: modes, residual: DMatrix::zeros(available, 0) }
    }

    /// The modes `whole` with residual modes for inertial loads and for unit loads that work on the modes of `body` as `loads` say
    /// (columns of N).
    ///
    /// # Errors
    /// [`NoStaticAnswer`] if the modal stiffness is not positive definite.
    pub fn with_residual(body: &ModalBody, whole: Vec<usize>, loads: &[DVector<f64>]) -> Result<Self, NoStaticAnswer> {
        let n = body.mode_count();
        let left: Vec<usize> = (0..n).filter(|j| !whole.contains(j)).collect();
        let stiffness = stiffness_of(body);
        let factor = Cholesky::new(stiffness.clone()).ok_or(NoStaticAnswer)?;
        let mut answers = Vec::new();
        for load in inertial_loads(body, &left).iter().chain(loads) {
            let answer = factor.solve(load).select_rows(&left);
            let size = answer.norm();
            if size > 0.0 {
                answers.push(answer / size);
            }
        }
        let span = if answers.is_empty() || left.is_empty() {
            DMatrix::zeros(left.len(), 0)
        } else {
            let svd = DMatrix::from_columns(&answers).svd(true, false);
            let largest = svd.singular_values.max();
            let independent: Vec<_> = (0..svd.singular_values.len()).filter(|&i| svd.singular_values[i] > INDEPENDENT * largest).collect();
            svd.u.map_or_else(|| DMatrix::zeros(left.len(), 0), |u| u.select_columns(&independent))
        };
        let residual = embed(&diagonalised(&span, &stiffness, &left), &left, n);
        Ok(Self { whole, residual })
    }

    /// Number of retained modes, whole and residual.
    #[must_use]
    pub fn mode_count(&self) -> usize {
        self.whole.len() + self.residual.ncols()
    }

    /// Number of modes of the file.
    #[must_use]
    pub fn available(&self) -> usize {
        self.residual.nrows()
    }

    /// True if residual modes are among them.
    #[must_use]
    pub fn has_residual(&self) -> bool {
        self.residual.ncols() > 0
    }

    /// True if they span all modes of the file.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.mode_count() == self.available()
    }

    /// Names of the retained modes: "mode 3" counts from 1 in the file, "residual mode 1" among the residual ones.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let whole = self.whole.iter().map(|j| format!("mode {}", j + 1));
        whole.chain((0..self.residual.ncols()).map(|i| format!("residual mode {}", i + 1))).collect()
    }

    /// The combinations as a matrix, N x n.
    #[must_use]
    pub fn matrix(&self) -> DMatrix<f64> {
        let count = self.whole.len();
        DMatrix::from_fn(self.available(), self.mode_count(), |i, j| match j.checked_sub(count) {
            Some(r) => self.residual[(i, r)],
            None => f64::from(u8::from(self.whole[j] == i)),
        })
    }

    /// Something linear in the modes, given for each mode of the file, for each retained mode.
    #[must_use]
    pub fn combine<T: Clone + Mul<f64, Output = T> + AddAssign>(&self, of_mode: &[T], zero: T) -> Vec<T> {
        let mut combined: Vec<T> = self.whole.iter().map(|&j| of_mode[j].clone()).collect();
        for column in self.residual.column_iter() {
            let mut sum = zero.clone();
            for (x, factor) in of_mode.iter().zip(column.iter()).filter(|(_, f)| **f != 0.0) {
                sum += x.clone() * *factor;
            }
            combined.push(sum);
        }
        combined
    }

    /// Orthonormal modes of the rest, which the basis leaves out, that diagonalise the stiffness among each other: N x (N - n).
    #[must_use]
    pub fn left_out(&self, body: &ModalBody) -> DMatrix<f64> {
        let n = self.available();
        let left: Vec<usize> = (0..n).filter(|j| !self.whole.contains(j)).collect();
        let residual = self.residual.select_rows(&left);
        let rest = if residual.ncols() == 0 {
            DMatrix::identity(left.len(), left.len())
        } else {
            // the projector onto what the residual modes leave has eigenvalues 0 and 1
            let projector = DMatrix::identity(left.len(), left.len()) - &residual * residual.transpose();
            let eigen = projector.symmetric_eigen();
            let ones: Vec<_> = (0..left.len()).filter(|&i| eigen.eigenvalues[i] > 0.5).collect();
            eigen.eigenvectors.select_columns(&ones)
        };
        embed(&diagonalised(&rest, &stiffness_of(body), &left), &left, n)
    }
}

/// The modal stiffness of all modes.
fn stiffness_of(body: &ModalBody) -> DMatrix<f64> {
    let squares = body.frequency_hz.iter().map(|f| (TAU * f).powi(2));
    body.stiffness.clone().unwrap_or_else(|| DMatrix::from_diagonal(&DVector::from_iterator(body.mode_count(), squares)))
}

/// What unit accelerations and angular accelerations of the body frame do to the modes, where the modes `left` carry any of it.
fn inertial_loads(body: &ModalBody, left: &[usize]) -> Vec<DVector<f64>> {
    let n = body.mode_count();
    let momentum = |j: usize, a: usize| body.momentum[j][a];
    let angular = angular_momentum(body);
    let carried = |load: &DVector<f64>, whole: f64| left.iter().map(|&j| load[j] * load[j]).sum::<f64>() > CARRIED * whole;
    let linear = (0..3).map(|a| (DVector::from_fn(n, |j, _| momentum(j, a)), body.mass));
    let turning = (0..3).map(|a| (DVector::from_fn(n, |j, _| angular[j][a]), body.inertia[(a, a)]));
    linear.chain(turning).filter(|(load, whole)| carried(load, *whole)).map(|(load, _)| load).collect()
}

/// Angular momentum of each mode about the origin.
fn angular_momentum(body: &ModalBody) -> Vec<Vector3<f64>> {
    let of_first_moment = |q: &Matrix3<f64>| Vector3::new(q[(1, 2)] - q[(2, 1)], q[(2, 0)] - q[(0, 2)], q[(0, 1)] - q[(1, 0)]);
    body.angular_momentum.clone().unwrap_or_else(|| body.first_moment.iter().map(of_first_moment).collect())
}

/// Unit forces and moments at an interface, as they work on the modes: six columns of N, without those that do nothing.
#[must_use]
pub fn interface_loads(interface: &Interface) -> Vec<DVector<f64>> {
    shape_loads(&interface.mode_shape)
}

/// Unit moments and forces at a place that moves with the shapes `of_mode` (rotation; translation).
#[must_use]
pub fn shape_loads(of_mode: &[Vector6<f64>]) -> Vec<DVector<f64>> {
    let load = |a: usize| DVector::from_iterator(of_mode.len(), of_mode.iter().map(|s| s[a]));
    (0..6).map(load).filter(|l| l.amax() > 0.0).collect()
}

/// The same span with the stiffness diagonal in it, softest first.
fn diagonalised(span: &DMatrix<f64>, stiffness: &DMatrix<f64>, left: &[usize]) -> DMatrix<f64> {
    if span.ncols() == 0 {
        return span.clone();
    }
    let among = stiffness.select_rows(left).select_columns(left);
    let projected = span.transpose() * among * span;
    let eigen = (0.5 * (&projected + projected.transpose())).symmetric_eigen();
    let mut order: Vec<usize> = (0..span.ncols()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    span * eigen.eigenvectors.select_columns(&order)
}

/// Rows of the modes `left` in a matrix with a row for every mode.
fn embed(rows: &DMatrix<f64>, left: &[usize], n: usize) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(n, rows.ncols());
    for (i, &j) in left.iter().enumerate() {
        all.row_mut(j).copy_from(&rows.row(i));
    }
    all
}

impl ModalBody {
    /// The same body with the combinations `basis` of its modes.
    ///
    /// # Panics
    /// If the basis is not one of this body's modes.
    #[must_use]
    pub fn with_basis(&self, basis: &ModeBasis) -> Self {
        if !basis.has_residual() {
            return self.with_modes(&basis.whole);
        }
        let (n, matrix) = (self.mode_count(), basis.matrix());
        let m = basis.mode_count();
        let both = |k: &DMatrix<f64>| matrix.transpose() * k * &matrix;
        let stiffness = both(&stiffness_of(self));
        let whole = basis.whole.len();
        let frequency_hz: Vec<f64> =
            (0..m).map(|i| if i < whole { self.frequency_hz[basis.whole[i]] } else { stiffness[(i, i)].max(0.0).sqrt() / TAU }).collect();
        let damping_ratio = (0..m).map(|i| {
            if i < whole {
                return self.damping_ratio[basis.whole[i]];
            }
            // 2 zeta omega is quadratic in the shape, as the stiffness is
            (0..n).map(|j| matrix[(j, i)].powi(2) * self.damping_ratio[j] * self.frequency_hz[j]).sum::<f64>() / frequency_hz[i]
        });
        let mut second_moment = vec![Matrix3::zeros(); m * m];
        for a in 0..3 {
            for b in 0..3 {
                let plane = DMatrix::from_fn(n, n, |j, k| self.second_moment[j * n + k][(a, b)]);
                let combined = both(&plane);
                for (i, target) in second_moment.iter_mut().enumerate() {
                    target[(a, b)] = combined[(i / m, i % m)];
                }
            }
        }
        Self {
            damping_ratio: damping_ratio.collect(),
            frequency_hz,
            // whole modes and residual ones stay uncoupled where the file's modes are
            stiffness: self.stiffness.as_ref().map(|_| stiffness),
            momentum: basis.combine(&self.momentum, Vector3::zeros()),
            first_moment: basis.combine(&self.first_moment, Matrix3::zeros()),
            second_moment,
            angular_momentum: self.angular_momentum.as_ref().map(|l| basis.combine(l, Vector3::zeros())),
            geometric_stiffness: self.geometric_stiffness.as_ref().map(|g| g.iter().map(both).collect()),
            interfaces: self
                .interfaces
                .iter()
                .map(|i| Interface { mode_shape: basis.combine(&i.mode_shape, Vector6::zeros()), ..i.clone() })
                .collect(),
            ..self.clone()
        }
    }
}
