//! Moving motions and forces between points and axes: the paper's `phi`, applied without being formed.

use nalgebra::{Matrix3, Vector3, Vector6};

/// Angular part of a spatial vector.
#[inline]
#[must_use]
pub fn angular(x: &Vector6<f64>) -> Vector3<f64> {
    Vector3::new(x[0], x[1], x[2])
}

/// Linear part of a spatial vector.
#[inline]
#[must_use]
pub fn linear(x: &Vector6<f64>) -> Vector3<f64> {
    Vector3::new(x[3], x[4], x[5])
}

/// A spatial vector from its parts.
#[inline]
#[must_use]
pub fn spatial(angular: &Vector3<f64>, linear: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z)
}

/// Motion at the point `l` away, of the same rigid frame: `phi* x`.
#[inline]
#[must_use]
pub fn motion_to(l: &Vector3<f64>, x: &Vector6<f64>) -> Vector6<f64> {
    let w = angular(x);
    spatial(&w, &(linear(x) + w.cross(l)))
}

/// Force at the origin that is equivalent to the force `f` at the point `l`: `phi f`.
#[inline]
#[must_use]
pub fn force_from(l: &Vector3<f64>, f: &Vector6<f64>) -> Vector6<f64> {
    let force = linear(f);
    spatial(&(angular(f) + l.cross(&force)), &force)
}

/// `R x` on both parts.
#[inline]
#[must_use]
pub fn rotate(r: &Matrix3<f64>, x: &Vector6<f64>) -> Vector6<f64> {
    spatial(&(r * angular(x)), &(r * linear(x)))
}

/// `R' x` on both parts.
#[inline]
#[must_use]
pub fn rotate_back(r: &Matrix3<f64>, x: &Vector6<f64>) -> Vector6<f64> {
    spatial(&r.tr_mul(&angular(x)), &r.tr_mul(&linear(x)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_is_the_same_at_both_ends_of_a_shift() {
        let l = Vector3::new(0.3, -1.2, 0.7);
        let x = Vector6::new(0.1, 0.2, -0.3, 1.0, -2.0, 0.5);
        let f = Vector6::new(3.0, -1.0, 2.0, 0.4, 0.6, -0.9);
        let at_point = f.dot(&motion_to(&l, &x));
        assert!((force_from(&l, &f).dot(&x) - at_point).abs() < 16.0 * f64::EPSILON);
    }
}
