//! Rotation matrices, quaternions, rotation vectors and the maps between their rates.
//!
//! The series of the exponential map's coefficients are summed for angles below one radian, where the closed forms cancel.

use nalgebra::{Matrix3, Vector3};

/// Quaternion `[w, x, y, z]`.
pub type Quaternion = [f64; 4];

/// The quaternion of no rotation.
pub const IDENTITY: Quaternion = [1.0, 0.0, 0.0, 0.0];

/// Cross-product matrix: `skew(a) * b = a x b`.
#[must_use]
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Rotation matrix of a unit quaternion.
#[must_use]
pub fn matrix_of_quaternion(q: &Quaternion) -> Matrix3<f64> {
    let [w, x, y, z] = *q;
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Unit quaternion of a rotation matrix, with w >= 0 (Shepperd's choice of the largest component).
#[must_use]
pub fn quaternion_of_matrix(r: &Matrix3<f64>) -> Quaternion {
    let trace = r.trace();
    let candidates = [trace, r[(0, 0)], r[(1, 1)], r[(2, 2)]];
    let mut best = 0;
    for i in 1..4 {
        if candidates[i] > candidates[best] {
            best = i;
        }
    }
    let s = if best == 0 { 1.0 + trace } else { 1.0 + 2.0 * candidates[best] - trace };
    let q = match best {
        0 => [s, r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]],
        1 => [r[(2, 1)] - r[(1, 2)], s, r[(0, 1)] + r[(1, 0)], r[(0, 2)] + r[(2, 0)]],
        2 => [r[(0, 2)] - r[(2, 0)], r[(0, 1)] + r[(1, 0)], s, r[(1, 2)] + r[(2, 1)]],
        _ => [r[(1, 0)] - r[(0, 1)], r[(0, 2)] + r[(2, 0)], r[(1, 2)] + r[(2, 1)], s],
    };
    let q = normalized(&q);
    if q[0] < 0.0 { q.map(|c| -c) } else { q }
}

/// `q / |q|`.
#[must_use]
pub fn normalized(q: &Quaternion) -> Quaternion {
    let n = norm(q);
    q.map(|c| c / n)
}

/// Euclidean length of a quaternion.
#[must_use]
pub fn norm(q: &Quaternion) -> f64 {
    q.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// Quaternion product: the rotation `b` followed by `a`.
#[must_use]
pub fn product(a: &Quaternion, b: &Quaternion) -> Quaternion {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// Quaternion of a rotation vector (axis times angle).
#[must_use]
pub fn quaternion_of_vector(theta: &Vector3<f64>) -> Quaternion {
    let half = 0.5 * theta.norm();
    // sin(x)/x without dividing by zero; two terms hold to rounding below 1e-4
    let sinc = if half < 1e-4 { 1.0 - half * half / 6.0 } else { half.sin() / half };
    let v = theta * (0.5 * sinc);
    [half.cos(), v.x, v.y, v.z]
}

/// Rotation vector (axis times angle, angle in [0, pi]) of a unit quaternion.
#[must_use]
pub fn vector_of_quaternion(q: &Quaternion) -> Vector3<f64> {
    let q = if q[0] < 0.0 { q.map(|c| -c) } else { *q };
    let v = Vector3::new(q[1], q[2], q[3]);
    let sine = v.norm();
    let half = sine.atan2(q[0]);
    if sine < 1e-8 { v * (2.0 / q[0]) } else { v * (2.0 * half / sine) }
}

/// Rotation about a unit axis by an angle.
#[must_use]
pub fn about_axis(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    let (x, y, z) = (axis.x, axis.y, axis.z);
    Matrix3::new(
        c + t * x * x,
        t * x * y - s * z,
        t * x * z + s * y,
        t * x * y + s * z,
        c + t * y * y,
        t * y * z - s * x,
        t * x * z - s * y,
        t * y * z + s * x,
        c + t * z * z,
    )
}

/// Coefficients of the exponential map at a rotation vector.
///
/// With t = |theta|: `a = (1 - cos t)/t^2`, `b = (t - sin t)/t^3`, and their slopes `a_slope = (da/dt)/t`, `b_slope = (db/dt)/t`.
struct Coefficients {
    a: f64,
    b: f64,
    a_slope: f64,
    b_slope: f64,
}

impl Coefficients {
    fn at(theta: &Vector3<f64>) -> Self {
        let t2 = theta.norm_squared();
        if t2 < 1.0 {
            let (a, a_slope) = series(t2, &OF_COSINE);
            let (b, b_slope) = series(t2, &OF_SINE);
            return Self { a, b, a_slope, b_slope };
        }
        let t = t2.sqrt();
        let (s, c) = t.sin_cos();
        Self {
            a: (1.0 - c) / t2,
            b: (t - s) / (t2 * t),
            a_slope: (t * s - 2.0 * (1.0 - c)) / (t2 * t2),
            b_slope: (t * (1.0 - c) - 3.0 * (t - s)) / (t2 * t2 * t),
        }
    }
}

/// Terms of the series: the next one is below 1e-20 for t2 < 1.
const TERMS: usize = 10;

/// `(-1)^k / (2k + m)!` for k = 0, 1, ...
const fn alternating(m: usize) -> [f64; TERMS] {
    let mut coefficients = [0.0; TERMS];
    let (mut k, mut coefficient) = (0, if m == 2 { 1.0 / 2.0 } else { 1.0 / 6.0 });
    while k < TERMS {
        coefficients[k] = coefficient;
        let next = (2 * k + m) as f64;
        coefficient /= -(next + 1.0) * (next + 2.0);
        k += 1;
    }
    coefficients
}

const OF_COSINE: [f64; TERMS] = alternating(2);
const OF_SINE: [f64; TERMS] = alternating(3);

/// Sum over k of `coefficients_k t2^k`, and its derivative with respect to `t2 / 2`.
fn series(t2: f64, coefficients: &[f64; TERMS]) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for coefficient in coefficients.iter().rev() {
        slope = slope * t2 + value;
        value = value * t2 + coefficient;
    }
    (value, 2.0 * slope)
}

/// Rotation matrix of a rotation vector (Rodrigues).
#[must_use]
pub fn matrix_of_vector(theta: &Vector3<f64>) -> Matrix3<f64> {
    matrix_of_quaternion(&quaternion_of_vector(theta))
}

/// A frame that turns with the rotation vector `theta`: its axes, its left Jacobian, and [`left_jacobian_rate`] at the rate `theta_dot`.
#[inline]
#[must_use]
pub fn turning_frame(theta: &Vector3<f64>, theta_dot: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>, Vector3<f64>) {
    let c = Coefficients::at(theta);
    let (along, cross) = (theta.dot(theta_dot), theta.cross(theta_dot));
    let rate = cross * (c.a_slope * along) + theta.cross(&cross) * (c.b_slope * along) + theta_dot.cross(&cross) * c.b;
    let (t, t2) = (skew(theta), theta.norm_squared());
    let square = theta * theta.transpose() - Matrix3::from_diagonal_element(t2);
    // sin t / t = 1 - b t^2 and (1 - cos t) / t^2 = a
    let axes = Matrix3::identity() + t * (1.0 - c.b * t2) + square * c.a;
    (axes, Matrix3::identity() + t * c.a + square * c.b, rate)
}

/// Left Jacobian of SO(3): `omega = Jl(theta) theta_dot` in the axes that do not turn.
#[must_use]
pub fn left_jacobian(theta: &Vector3<f64>) -> Matrix3<f64> {
    let c = Coefficients::at(theta);
    let t = skew(theta);
    Matrix3::identity() + t * c.a + t * t * c.b
}

/// `(d/dt Jl(theta)) theta_dot`: what `omega_dot` holds beside `Jl(theta) theta_ddot`.
#[must_use]
pub fn left_jacobian_rate(theta: &Vector3<f64>, theta_dot: &Vector3<f64>) -> Vector3<f64> {
    let c = Coefficients::at(theta);
    let along = theta.dot(theta_dot);
    let cross = theta.cross(theta_dot);
    cross * (c.a_slope * along) + theta.cross(&cross) * (c.b_slope * along) + theta_dot.cross(&cross) * c.b
}

/// `Jr(theta)^-1 omega`: rate of the rotation vector whose frame turns with `omega`, given in the turning axes.
///
/// Singular at |theta| = 2 pi; integrators restart the vector at zero in every step.
#[must_use]
pub fn rotation_vector_rate(theta: &Vector3<f64>, omega: &Vector3<f64>) -> Vector3<f64> {
    let cross = theta.cross(omega);
    omega + cross * 0.5 + theta.cross(&cross) * inverse_coefficient(theta.norm_squared())
}

/// `Jr(theta)^-T torque`: the torque on omega that does the work of `torque` on the rotation vector.
#[must_use]
pub fn rotation_vector_torque(theta: &Vector3<f64>, torque: &Vector3<f64>) -> Vector3<f64> {
    let cross = theta.cross(torque);
    torque - cross * 0.5 + theta.cross(&cross) * inverse_coefficient(theta.norm_squared())
}

/// `(1 - (t/2) cot(t/2)) / t^2`.
fn inverse_coefficient(t2: f64) -> f64 {
    if t2 < 0.1 {
        // Bernoulli series; the next term is below 2e-16 of the first
        return 1.0 / 12.0
            + t2 * (1.0 / 720.0
                + t2 * (1.0 / 30_240.0 + t2 * (1.0 / 1_209_600.0 + t2 * (1.0 / 47_900_160.0 + t2 * 5.284_190_138_687_493e-10))));
    }
    let half = 0.5 * t2.sqrt();
    (1.0 - half / half.tan()) / t2
}

#[cfg(test)]
mod tests {
    use super::*;

    const EPS: f64 = f64::EPSILON;

    fn angles() -> Vec<Vector3<f64>> {
        let axis = Vector3::new(0.36, -0.48, 0.8);
        [0.0, 1e-9, 1e-3, 0.1, 0.3, 0.9999, 1.0001, 2.0, 3.0].iter().map(|&t| axis * t).collect()
    }

    #[test]
    fn quaternion_matrix_and_vector_describe_the_same_rotation() {
        for theta in angles() {
            let q = quaternion_of_vector(&theta);
            let r = matrix_of_quaternion(&q);
            let about = about_axis(&Vector3::new(0.36, -0.48, 0.8), theta.norm());
            assert!((r - about).abs().max() < 8.0 * EPS);
            assert!((vector_of_quaternion(&q) - theta).norm() < 8.0 * EPS * (1.0 + theta.norm()));
            assert!((matrix_of_quaternion(&quaternion_of_matrix(&r)) - r).abs().max() < 16.0 * EPS);
        }
    }

    #[test]
    fn left_jacobian_gives_the_angular_velocity_of_the_exponential() {
        let theta_dot = Vector3::new(0.3, 0.7, -0.2);
        for theta in angles() {
            let h = 1e-5;
            let (plus, minus) = (matrix_of_vector(&(theta + theta_dot * h)), matrix_of_vector(&(theta - theta_dot * h)));
            let spin = (plus - minus) / (2.0 * h) * matrix_of_vector(&theta).transpose();
            let omega = left_jacobian(&theta) * theta_dot;
            // central difference: h^2 / 6 times the third derivative, and eps / h
            assert!((spin - skew(&omega)).abs().max() < h * h + EPS / h, "{theta}");
        }
    }

    #[test]
    fn left_jacobian_rate_is_the_slope_of_the_left_jacobian() {
        let theta_dot = Vector3::new(0.3, 0.7, -0.2);
        for theta in angles() {
            let h = 1e-5;
            let (plus, minus) = (left_jacobian(&(theta + theta_dot * h)), left_jacobian(&(theta - theta_dot * h)));
            let slope = (plus - minus) / (2.0 * h) * theta_dot;
            assert!((slope - left_jacobian_rate(&theta, &theta_dot)).norm() < h * h + EPS / h, "{theta}");
        }
    }

    #[test]
    fn turning_frame_is_its_three_parts() {
        let theta_dot = Vector3::new(0.3, 0.7, -0.2);
        for theta in angles() {
            let (axes, jacobian, rate) = turning_frame(&theta, &theta_dot);
            // sums of a few products of numbers below ten
            let allowed = 100.0 * EPS * (1.0 + theta.norm_squared());
            assert!((axes - matrix_of_vector(&theta)).norm() < allowed, "{theta}");
            assert!((jacobian - left_jacobian(&theta)).norm() < allowed, "{theta}");
            assert!((rate - left_jacobian_rate(&theta, &theta_dot)).norm() < allowed, "{theta}");
        }
    }

    #[test]
    fn rotation_vector_rate_inverts_the_right_jacobian() {
        let omega = Vector3::new(0.3, 0.7, -0.2);
        for theta in angles() {
            let rate = rotation_vector_rate(&theta, &omega);
            // Jr(theta) = Jl(-theta)
            assert!((left_jacobian(&-theta) * rate - omega).norm() < 32.0 * EPS, "{theta}");
            let torque = Vector3::new(-0.4, 0.1, 0.9);
            let work = rotation_vector_torque(&theta, &torque).dot(&omega);
            assert!((work - torque.dot(&rate)).abs() < 32.0 * EPS);
        }
    }
}
