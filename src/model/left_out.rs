//! The modes that a system leaves out, beside the same system with all modes of its modal files.

use super::modal_body::ModalBody;
use super::mode_basis::ModeBasis;
use super::{FlexibleBody, System};
use nalgebra::DMatrix;

/// What one body leaves out of the N modes of its file; it retains n.
#[derive(Debug, Clone)]
pub struct LeftOut {
    /// Index of the body.
    pub body: usize,
    /// Retained modes over those of the file, N x n.
    pub retained: DMatrix<f64>,
    /// Orthonormal modes of the rest, uncoupled among each other, N x (N - n).
    pub rest: DMatrix<f64>,
    /// Natural circular frequency of each mode of the rest (rad/s).
    pub omega: Vec<f64>,
    /// Damping ratio of each.
    pub damping_ratio: Vec<f64>,
}

impl LeftOut {
    /// What `basis` leaves out of the modes of `modal`; `flexible` is the body with all of them.
    #[must_use]
    pub fn new(body: usize, modal: &ModalBody, basis: &ModeBasis, flexible: &FlexibleBody) -> Self {
        let rest = basis.left_out(modal);
        let stiffness = match &flexible.full_stiffness {
            Some(full) => full.clone(),
            None => DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(&flexible.stiffness)),
        };
        let along = |column: nalgebra::DVectorView<'_, f64>| (column.transpose() * &stiffness * column)[(0, 0)].max(0.0).sqrt();
        let omega: Vec<f64> = rest.column_iter().map(along).collect();
        let damping = |column: nalgebra::DVectorView<'_, f64>| column.iter().zip(&flexible.damping).map(|(x, c)| x * x * c).sum::<f64>();
        let ratio =
            |(column, omega): (nalgebra::DVectorView<'_, f64>, &f64)| if *omega > 0.0 { 0.5 * damping(column) / omega } else { 0.0 };
        let damping_ratio = rest.column_iter().zip(&omega).map(ratio).collect();
        Self { body, retained: basis.matrix(), rest, omega, damping_ratio }
    }
}

/// The modes that a system leaves out.
#[derive(Debug, Clone)]
pub struct LeftOutModes {
    /// The same bodies and hinges with all modes of their files, closures cut.
    pub system: System,
    /// The bodies that leave modes out.
    pub bodies: Vec<LeftOut>,
}
