//! Motion of a frame that an interface of a flexible body carries: finite rotation, exact rates.
//!
//! The interface frame moves by `Phi_t eta` and turns by `exp(Phi_r eta)`; relative to the body it turns with
//! `omega_rel = Jl(Phi_r eta) Phi_r eta_dot`. The paper's constant `Pi` (Eq. 21) is the limit of small `eta`.

use crate::model::Attachment;
use crate::spatial::rotation;
use crate::spatial::shift::{angular, linear, spatial};
use nalgebra::{Matrix3, Vector3, Vector6};

/// Pose of an attached frame at the present deformation, in body axes.
#[derive(Debug, Clone, Copy)]
pub struct FramePose {
    /// Axes of the attached frame.
    pub rotation: Matrix3<f64>,
    /// Origin of the attached frame (m).
    pub position: Vector3<f64>,
    /// Origin of the interface that carries it (m).
    interface: Vector3<f64>,
    /// Rotation vector of the interface.
    theta: Vector3<f64>,
}

impl Default for FramePose {
    fn default() -> Self {
        Self { rotation: Matrix3::identity(), position: Vector3::zeros(), interface: Vector3::zeros(), theta: Vector3::zeros() }
    }
}

fn sum(mode_shape: &[Vector6<f64>], weights: &[f64]) -> Vector6<f64> {
    mode_shape.iter().zip(weights).map(|(s, w)| s * *w).sum()
}

impl FramePose {
    /// Pose of `attachment` at the modal coordinates `eta` of its body.
    #[must_use]
    pub fn of(attachment: &Attachment, eta: &[f64]) -> Self {
        if !attachment.moves() {
            let position = attachment.position;
            return Self { rotation: attachment.rotation, position, interface: position, theta: Vector3::zeros() };
        }
        let displacement = sum(&attachment.mode_shape, eta);
        let theta = angular(&displacement);
        let interface = attachment.position + linear(&displacement);
        let axes = rotation::matrix_of_vector(&theta) * attachment.rotation;
        Self { rotation: axes * attachment.offset_rotation, position: interface + axes * attachment.offset, interface, theta }
    }

    /// Mode shape (rotation; translation) at the point `point` (body axes) that moves with the frame, one per mode.
    pub fn shape_at(&self, attachment: &Attachment, point: &Vector3<f64>, out: &mut [Vector6<f64>]) {
        let jacobian = rotation::left_jacobian(&self.theta);
        let lever = point - self.interface;
        for (o, shape) in out.iter_mut().zip(&attachment.mode_shape) {
            let turn = jacobian * angular(shape);
            *o = spatial(&turn, &(linear(shape) + turn.cross(&lever)));
        }
    }

    /// Acceleration of the frame at `point` that depends on rates alone, for a body that turns with `omega`; body axes.
    #[must_use]
    pub fn bias_at(&self, attachment: &Attachment, point: &Vector3<f64>, omega: &Vector3<f64>, eta_dot: &[f64]) -> Vector6<f64> {
        if !attachment.moves() {
            return spatial(&Vector3::zeros(), &omega.cross(&omega.cross(point)));
        }
        let rate = sum(&attachment.mode_shape, eta_dot);
        let (theta_dot, u_dot) = (angular(&rate), linear(&rate));
        let omega_rel = rotation::left_jacobian(&self.theta) * theta_dot;
        let spin = rotation::left_jacobian_rate(&self.theta, &theta_dot) + omega.cross(&omega_rel);
        let (lever, omega_frame) = (point - self.interface, omega + omega_rel);
        let acceleration = omega.cross(&omega.cross(&self.interface))
            + omega.cross(&u_dot) * 2.0
            + spin.cross(&lever)
            + omega_frame.cross(&omega_frame.cross(&lever));
        spatial(&spin, &acceleration)
    }
}
