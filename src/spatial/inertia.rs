//! Symmetric 6 x 6 inertias (rigid, articulated) kept as three 3 x 3 blocks.

use super::rotation::skew;
use super::shift::{angular, linear, spatial};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// Symmetric inertia `[[rotational, coupling], [coupling', translational]]`, mapping (omega_dot, a) to (moment, force).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpatialInertia {
    /// Moment per angular acceleration (kg m^2), symmetric.
    pub rotational: Matrix3<f64>,
    /// Moment per linear acceleration (kg m).
    pub coupling: Matrix3<f64>,
    /// Force per linear acceleration (kg), symmetric.
    pub translational: Matrix3<f64>,
}

impl SpatialInertia {
    /// Of a rigid body: mass (kg), first moment `m c` (kg m) and rotational inertia (kg m^2), both about the frame's origin.
    #[must_use]
    pub fn rigid(mass: f64, first_moment: &Vector3<f64>, inertia: &Matrix3<f64>) -> Self {
        Self { rotational: *inertia, coupling: skew(first_moment), translational: Matrix3::from_diagonal_element(mass) }
    }

    /// First moment `m c` (kg m) of a rigid body's inertia.
    #[inline]
    #[must_use]
    pub fn first_moment(&self) -> Vector3<f64> {
        Vector3::new(self.coupling[(2, 1)], self.coupling[(0, 2)], self.coupling[(1, 0)])
    }

    /// `P x`.
    #[inline]
    #[must_use]
    pub fn times(&self, x: &Vector6<f64>) -> Vector6<f64> {
        let (w, v) = (angular(x), linear(x));
        spatial(&(self.rotational * w + self.coupling * v), &(self.coupling.tr_mul(&w) + self.translational * v))
    }

    /// The same inertia in the axes that `r` turns into: `R P R'`.
    #[inline]
    #[must_use]
    pub fn rotated(&self, r: &Matrix3<f64>) -> Self {
        let t = r.transpose();
        Self { rotational: r * self.rotational * t, coupling: r * self.coupling * t, translational: r * self.translational * t }
    }

    /// The same inertia referred to the origin that lies at `-l` from here: `phi P phi*` with `l` from there to here.
    #[inline]
    #[must_use]
    pub fn moved_by(&self, l: &Vector3<f64>) -> Self {
        let s = skew(l);
        let coupling = self.coupling + s * self.translational;
        let half = s * self.coupling.transpose();
        // l~ C' + C'' l~' with C'' the new coupling; the product l~ m l~' comes in through C''
        let rotational = self.rotational + half - coupling * s;
        Self { rotational: (rotational + rotational.transpose()) * 0.5, coupling, translational: self.translational }
    }

    /// `P - u u' / d`.
    #[inline]
    pub fn subtract_outer(&mut self, u: &Vector6<f64>, d: f64) {
        let (w, v) = (angular(u), linear(u));
        let (wd, vd) = (w / d, v / d);
        self.rotational -= w * wd.transpose();
        self.coupling -= w * vd.transpose();
        self.translational -= v * vd.transpose();
    }

    /// Sum of two inertias at the same point.
    #[inline]
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            rotational: self.rotational + other.rotational,
            coupling: self.coupling + other.coupling,
            translational: self.translational + other.translational,
        }
    }

    /// As one 6 x 6 matrix.
    #[must_use]
    pub fn matrix(&self) -> Matrix6<f64> {
        let mut m = Matrix6::zeros();
        m.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.rotational);
        m.fixed_view_mut::<3, 3>(0, 3).copy_from(&self.coupling);
        m.fixed_view_mut::<3, 3>(3, 0).copy_from(&self.coupling.transpose());
        m.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.translational);
        m
    }

    /// From a 6 x 6 matrix, symmetrised.
    #[must_use]
    pub fn from_matrix(m: &Matrix6<f64>) -> Self {
        let m = (m + m.transpose()) * 0.5;
        Self {
            rotational: m.fixed_view::<3, 3>(0, 0).into_owned(),
            coupling: m.fixed_view::<3, 3>(0, 3).into_owned(),
            translational: m.fixed_view::<3, 3>(3, 3).into_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::{rotation, shift};

    #[test]
    fn moving_and_turning_an_inertia_keeps_its_kinetic_energy() {
        let inertia = Matrix3::new(2.0, 0.1, -0.2, 0.1, 1.5, 0.3, -0.2, 0.3, 1.1);
        let p = SpatialInertia::rigid(3.0, &Vector3::new(0.2, -0.4, 0.1), &inertia);
        let (l, r) = (Vector3::new(0.5, 0.1, -0.7), rotation::matrix_of_vector(&Vector3::new(0.3, -0.8, 0.5)));
        // velocity at the far origin, in outer axes; the inertia sits at l in those axes
        let x = Vector6::new(0.4, -0.1, 0.9, 1.0, 0.3, -0.6);
        let here = shift::rotate_back(&r, &shift::motion_to(&l, &x));
        let energy = here.dot(&p.times(&here));
        let far = p.rotated(&r).moved_by(&l);
        assert!((x.dot(&far.times(&x)) - energy).abs() < 64.0 * f64::EPSILON * energy);
        assert!((far.matrix() * x - far.times(&x)).norm() < 64.0 * f64::EPSILON * energy);
    }
}
