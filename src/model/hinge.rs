//! Hinge kinds: coordinates, relative pose, hinge map and its rate.
//!
//! A hinge joins O+ on the parent to O on the child. Coordinates q and rates v per kind are those of the table in the README;
//! the map `H` has one spatial vector per rate, in O axes at O, so that the relative velocity across the hinge is `sum_i v_i H_i`.

use super::time_function::TimeFunction;
use crate::spatial::rotation::{self, Quaternion, about_axis};
use crate::spatial::shift::spatial;
use nalgebra::{Matrix3, Vector3, Vector6};

/// Most rates a hinge can have.
pub const MAX_RATES: usize = 6;

/// Spread of the axes (see [`HingeKind::axis_spread`]) below which a hinge is in gimbal lock: with half of the digits gone.
pub const LOCKED: f64 = 1e-6;

/// Kind of a hinge with its geometry. Axes are of unit length, in O+ axes.
#[derive(Debug, Clone, PartialEq)]
pub enum HingeKind {
    /// No motion.
    Fixed,
    /// Angle about an axis.
    Revolute { axis: Vector3<f64> },
    /// Travel along an axis.
    Prismatic { axis: Vector3<f64> },
    /// Angle about an axis with travel `pitch` (m/rad) along it.
    Screw { axis: Vector3<f64>, pitch: f64 },
    /// Angle about and travel along one axis.
    Cylindrical { axis: Vector3<f64> },
    /// Angles about two axes in sequence, the second turned by the first.
    Universal { axes: [Vector3<f64>; 2] },
    /// Angles about three axes in sequence, each turned by those before it.
    Gimbal { axes: [Vector3<f64>; 3] },
    /// Travel along two axes, then the angle about their normal.
    Planar { axes: [Vector3<f64>; 2], normal: Vector3<f64> },
    /// Quaternion; rates are the angular velocity of O with respect to O+ in O axes.
    Spherical,
    /// Position of O in O+ and quaternion; rates are angular and linear velocity of O with respect to O+, both in O axes.
    Free,
}

/// Relative pose of O in O+ and the hinge map there.
#[derive(Debug, Clone, Copy)]
pub struct HingePose {
    /// O axes to O+ axes.
    pub rotation: Matrix3<f64>,
    /// Position of O in O+ axes (m).
    pub translation: Vector3<f64>,
    /// Hinge map, one spatial vector per rate; entries past the rate count are unused.
    pub map: [Vector6<f64>; MAX_RATES],
}

impl Default for HingePose {
    fn default() -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros(), map: [Vector6::zeros(); MAX_RATES] }
    }
}

fn turn(axis: &Vector3<f64>) -> Vector6<f64> {
    spatial(axis, &Vector3::zeros())
}

fn travel(axis: &Vector3<f64>) -> Vector6<f64> {
    spatial(&Vector3::zeros(), axis)
}

/// The quaternion in four consecutive coordinates.
#[must_use]
pub fn quaternion_in(q: &[f64]) -> Quaternion {
    [q[0], q[1], q[2], q[3]]
}

impl HingeKind {
    /// The name used in scenes.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Revolute { .. } => "revolute",
            Self::Prismatic { .. } => "prismatic",
            Self::Screw { .. } => "screw",
            Self::Cylindrical { .. } => "cylindrical",
            Self::Universal { .. } => "universal",
            Self::Gimbal { .. } => "gimbal",
            Self::Planar { .. } => "planar",
            Self::Spherical => "spherical",
            Self::Free => "free",
        }
    }

    /// Number of coordinates q.
    #[must_use]
    pub fn position_count(&self) -> usize {
        match self {
            Self::Spherical => 4,
            Self::Free => 7,
            other => other.rate_count(),
        }
    }

    /// Number of rates v.
    #[must_use]
    pub fn rate_count(&self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Screw { .. } => 1,
            Self::Cylindrical { .. } | Self::Universal { .. } => 2,
            Self::Gimbal { .. } | Self::Planar { .. } | Self::Spherical => 3,
            Self::Free => 6,
        }
    }

    /// True if the coordinates hold a quaternion.
    #[must_use]
    pub fn has_quaternion(&self) -> bool {
        matches!(self, Self::Spherical | Self::Free)
    }

    /// Coordinates of the reference position.
    #[must_use]
    pub fn reference_position(&self) -> Vec<f64> {
        match self {
            Self::Spherical => rotation::IDENTITY.to_vec(),
            Self::Free => [[0.0; 3].as_slice(), &rotation::IDENTITY].concat(),
            other => vec![0.0; other.rate_count()],
        }
    }

    /// Units of the coordinates' rates, for tables and channels.
    #[must_use]
    pub fn rate_units(&self) -> Vec<&'static str> {
        match self {
            Self::Fixed => vec![],
            Self::Revolute { .. } | Self::Screw { .. } => vec!["rad/s"],
            Self::Prismatic { .. } => vec!["m/s"],
            Self::Cylindrical { .. } => vec!["rad/s", "m/s"],
            Self::Universal { .. } => vec!["rad/s"; 2],
            Self::Gimbal { .. } | Self::Spherical => vec!["rad/s"; 3],
            Self::Planar { .. } => vec!["m/s", "m/s", "rad/s"],
            Self::Free => vec!["rad/s", "rad/s", "rad/s", "m/s", "m/s", "m/s"],
        }
    }

    /// Relative pose and hinge map at the coordinates `q`.
    pub fn pose(&self, q: &[f64], out: &mut HingePose) {
        let HingePose { rotation: r, translation: p, map } = out;
        match self {
            Self::Fixed => {}
            Self::Revolute { axis } => {
                *r = about_axis(axis, q[0]);
                map[0] = turn(axis);
            }
            Self::Prismatic { axis } => {
                *p = axis * q[0];
                map[0] = travel(axis);
            }
            Self::Screw { axis, pitch } => {
                *r = about_axis(axis, q[0]);
                *p = axis * (pitch * q[0]);
                map[0] = spatial(axis, &(axis * *pitch));
            }
            Self::Cylindrical { axis } => {
                *r = about_axis(axis, q[0]);
                *p = axis * q[1];
                map[0] = turn(axis);
                map[1] = travel(axis);
            }
            Self::Universal { axes } => {
                let second = about_axis(&axes[1], q[1]);
                *r = about_axis(&axes[0], q[0]) * second;
                map[0] = turn(&second.tr_mul(&axes[0]));
                map[1] = turn(&axes[1]);
            }
            Self::Gimbal { axes } => {
                let (second, third) = (about_axis(&axes[1], q[1]), about_axis(&axes[2], q[2]));
                *r = about_axis(&axes[0], q[0]) * second * third;
                map[0] = turn(&third.tr_mul(&second.tr_mul(&axes[0])));
                map[1] = turn(&third.tr_mul(&axes[1]));
                map[2] = turn(&axes[2]);
            }
            Self::Planar { axes, normal } => {
                *r = about_axis(normal, q[2]);
                *p = axes[0] * q[0] + axes[1] * q[1];
                map[0] = travel(&r.tr_mul(&axes[0]));
                map[1] = travel(&r.tr_mul(&axes[1]));
                map[2] = turn(normal);
            }
            Self::Spherical => {
                *r = rotation::matrix_of_quaternion(&quaternion_in(q));
                for i in 0..3 {
                    map[i] = turn(&Vector3::ith(i, 1.0));
                }
            }
            Self::Free => {
                *r = rotation::matrix_of_quaternion(&quaternion_in(&q[3..7]));
                *p = Vector3::new(q[0], q[1], q[2]);
                for i in 0..3 {
                    map[i] = turn(&Vector3::ith(i, 1.0));
                    map[i + 3] = travel(&Vector3::ith(i, 1.0));
                }
            }
        }
    }

    /// Volume that the axes of a gimbal hinge span, or area of a universal one: zero in gimbal lock. One for the other kinds.
    #[must_use]
    pub fn axis_spread(&self, map: &[Vector6<f64>; MAX_RATES]) -> f64 {
        let axis = |i: usize| Vector3::new(map[i][0], map[i][1], map[i][2]);
        match self {
            Self::Universal { .. } => axis(0).cross(&axis(1)).norm(),
            Self::Gimbal { .. } => axis(0).dot(&axis(1).cross(&axis(2))).abs(),
            _ => 1.0,
        }
    }

    /// What the relative acceleration holds beside `sum_i v_dot_i H_i` while O+ does not move: angular part the rate of the relative
    /// angular velocity seen in O axes, linear part the acceleration of O in O+ turned into O axes.
    #[must_use]
    pub fn map_rate(&self, q: &[f64], v: &[f64], pose: &HingePose) -> Vector6<f64> {
        let axis_of = |i: usize| Vector3::new(pose.map[i][0], pose.map[i][1], pose.map[i][2]);
        match self {
            Self::Universal { axes } => turn(&(axes[1].cross(&axis_of(0)) * (-v[0] * v[1]))),
            Self::Gimbal { axes } => {
                // rate of (R2 R3)' a1: R3' of the rate of R2' a1, and the turn of the third axis
                let third = about_axis(&axes[2], q[2]);
                let first_before_third = third * axis_of(0);
                let first = third.tr_mul(&axes[1].cross(&first_before_third)) * v[1] + axes[2].cross(&axis_of(0)) * v[2];
                let second = axes[2].cross(&axis_of(1)) * v[2];
                turn(&-(first * v[0] + second * v[1]))
            }
            Self::Free => {
                let (w, u) = (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]));
                travel(&w.cross(&u))
            }
            // the map of the others is constant where O+ sees it
            _ => Vector6::zeros(),
        }
    }

    /// Coordinates that lie the increment `delta` (one per rate; rotation vector for quaternions) from `q`.
    pub fn advance(&self, q: &[f64], delta: &[f64], out: &mut [f64]) {
        let turned = |q: &[f64], d: &[f64]| {
            let step = rotation::quaternion_of_vector(&Vector3::new(d[0], d[1], d[2]));
            rotation::normalized(&rotation::product(&quaternion_in(q), &step))
        };
        match self {
            Self::Spherical => out.copy_from_slice(&turned(q, delta)),
            Self::Free => {
                for i in 0..3 {
                    out[i] = q[i] + delta[i + 3];
                }
                out[3..7].copy_from_slice(&turned(&q[3..7], delta));
            }
            _ => out.iter_mut().zip(q.iter().zip(delta)).for_each(|(o, (q, d))| *o = q + d),
        }
    }

    /// Coordinates that a unit of time with the constant small rates `step` leads to from `q`: what Newton steps on coordinates ask for.
    /// Unlike the increments of [`Self::advance`], the travel of a free hinge is in O axes, as its rates are.
    pub fn displace(&self, q: &[f64], step: &[f64], out: &mut [f64]) {
        if !matches!(self, Self::Free) {
            self.advance(q, step, out);
            return;
        }
        let r = rotation::matrix_of_quaternion(&quaternion_in(&q[3..7]));
        let travel = r * Vector3::new(step[3], step[4], step[5]);
        self.advance(q, &[step[0], step[1], step[2], travel.x, travel.y, travel.z], out);
    }

    /// Rate of the increment `delta` of [`Self::advance`] when the hinge stands at `q` (already advanced) and moves with `v`.
    pub fn increment_rate(&self, q: &[f64], delta: &[f64], v: &[f64], out: &mut [f64]) {
        if !self.has_quaternion() {
            out.copy_from_slice(v);
            return;
        }
        let theta = Vector3::new(delta[0], delta[1], delta[2]);
        let rate = rotation::rotation_vector_rate(&theta, &Vector3::new(v[0], v[1], v[2]));
        out[..3].copy_from_slice(rate.as_slice());
        if matches!(self, Self::Free) {
            let r = rotation::matrix_of_quaternion(&quaternion_in(&q[3..7]));
            out[3..6].copy_from_slice((r * Vector3::new(v[3], v[4], v[5])).as_slice());
        }
    }

    /// Coordinates as displacements from the reference position, one per rate: rotation vector for quaternions, then position for
    /// a free hinge. Springs act on these.
    pub fn displacement(&self, q: &[f64], out: &mut [f64]) {
        match self {
            Self::Spherical => out.copy_from_slice(rotation::vector_of_quaternion(&quaternion_in(q)).as_slice()),
            Self::Free => {
                out[..3].copy_from_slice(rotation::vector_of_quaternion(&quaternion_in(&q[3..7])).as_slice());
                out[3..6].copy_from_slice(&q[..3]);
            }
            _ => out.copy_from_slice(q),
        }
    }

    /// Turns forces on the displacements of [`Self::displacement`] into forces on the rates, in place.
    pub fn force_on_rates(&self, q: &[f64], displacement: &[f64], force: &mut [f64]) {
        if !self.has_quaternion() {
            return;
        }
        let theta = Vector3::new(displacement[0], displacement[1], displacement[2]);
        let torque = rotation::rotation_vector_torque(&theta, &Vector3::new(force[0], force[1], force[2]));
        force[..3].copy_from_slice(torque.as_slice());
        if matches!(self, Self::Free) {
            let r = rotation::matrix_of_quaternion(&quaternion_in(&q[3..7]));
            let linear = r.tr_mul(&Vector3::new(force[3], force[4], force[5]));
            force[3..6].copy_from_slice(linear.as_slice());
        }
    }
}

/// A hinge: its kind and what acts on its coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Hinge {
    /// Name, unique among hinges.
    pub name: String,
    /// Kind and geometry.
    pub kind: HingeKind,
    /// Spring per rate (N m/rad or N/m), empty where there is none.
    pub stiffness: Vec<f64>,
    /// Damper per rate (N m s/rad or N s/m), empty where there is none.
    pub damping: Vec<f64>,
    /// Displacement at which each spring is at rest, empty if zero.
    pub rest: Vec<f64>,
    /// Force on the rates, from parent to child.
    pub torque: Option<TimeFunction>,
    /// Prescribed coordinates.
    pub motion: Option<TimeFunction>,
    /// Initial coordinates and rates stay as given when closures are assembled.
    pub held: bool,
}

impl Hinge {
    /// True if the scene prescribes the motion.
    #[must_use]
    pub fn is_prescribed(&self) -> bool {
        self.motion.is_some()
    }

    /// Force of spring, damper and motor on each rate at time `t` (s), written to `out` (one per rate).
    pub fn applied_force(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        if !self.stiffness.is_empty() {
            out.copy_from_slice(&self.spring_force(q)[..out.len()]);
        }
        for (o, (c, v)) in out.iter_mut().zip(self.damping.iter().zip(v)) {
            *o -= c * v;
        }
        if let Some(torque) = &self.torque {
            for (i, o) in out.iter_mut().enumerate() {
                *o += torque.value(t, i);
            }
        }
    }

    /// Force of the springs on each rate; zero without springs and past the rate count.
    #[must_use]
    pub fn spring_force(&self, q: &[f64]) -> [f64; MAX_RATES] {
        let (mut force, mut displacement) = ([0.0; MAX_RATES], [0.0; MAX_RATES]);
        let displacement = &mut displacement[..self.kind.rate_count()];
        self.kind.displacement(q, displacement);
        for (i, k) in self.stiffness.iter().enumerate() {
            force[i] = -k * (displacement[i] - self.rest.get(i).copied().unwrap_or(0.0));
        }
        self.kind.force_on_rates(q, displacement, &mut force[..displacement.len()]);
        force
    }

    /// Energy (J) in the springs at `q`.
    #[must_use]
    pub fn spring_energy(&self, q: &[f64]) -> f64 {
        let mut displacement = [0.0; MAX_RATES];
        let displacement = &mut displacement[..self.kind.rate_count()];
        self.kind.displacement(q, displacement);
        let stretch = |i: usize| displacement[i] - self.rest.get(i).copied().unwrap_or(0.0);
        self.stiffness.iter().enumerate().map(|(i, k)| 0.5 * k * stretch(i) * stretch(i)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::shift::{angular, linear};

    fn kinds() -> Vec<HingeKind> {
        let unit = |x: f64, y: f64, z: f64| Vector3::new(x, y, z).normalize();
        let (a, b, c) = (unit(0.2, 0.9, -0.3), unit(-0.7, 0.1, 0.6), unit(0.5, 0.5, 0.8));
        let across = a.cross(&b).normalize();
        vec![
            HingeKind::Revolute { axis: a },
            HingeKind::Prismatic { axis: a },
            HingeKind::Screw { axis: a, pitch: 0.3 },
            HingeKind::Cylindrical { axis: a },
            HingeKind::Universal { axes: [a, b] },
            HingeKind::Gimbal { axes: [a, b, c] },
            HingeKind::Planar { axes: [a, across], normal: a.cross(&across) },
            HingeKind::Spherical,
            HingeKind::Free,
        ]
    }

    /// Pose after moving with increment `delta` from a general position.
    fn pose_at(kind: &HingeKind, base: &[f64], delta: &[f64]) -> (Vec<f64>, HingePose) {
        let mut q = base.to_vec();
        kind.advance(base, delta, &mut q);
        let mut pose = HingePose::default();
        kind.pose(&q, &mut pose);
        (q, pose)
    }

    fn general_position(kind: &HingeKind) -> Vec<f64> {
        let mut q = kind.reference_position();
        let delta: Vec<f64> = (0..kind.rate_count()).map(|i| 0.4 - 0.23 * i as f64).collect();
        let base = q.clone();
        kind.advance(&base, &delta, &mut q);
        q
    }

    fn relative_velocity(pose: &HingePose, v: &[f64]) -> Vector6<f64> {
        v.iter().enumerate().map(|(i, v)| pose.map[i] * *v).sum()
    }

    #[test]
    fn hinge_map_is_the_rate_of_the_relative_pose_of_every_kind() {
        for kind in kinds() {
            let v: Vec<f64> = (0..kind.rate_count()).map(|i| 0.8 - 0.5 * i as f64).collect();
            let base = general_position(&kind);
            let zero = vec![0.0; v.len()];
            let (q, pose) = pose_at(&kind, &base, &zero);
            let mut rate = zero.clone();
            kind.increment_rate(&q, &zero, &v, &mut rate);
            let h = 1e-5;
            let along = |s: f64| pose_at(&kind, &base, &rate.iter().map(|r| r * s).collect::<Vec<_>>()).1;
            let (plus, minus) = (along(h), along(-h));
            let spin = pose.rotation.transpose() * (plus.rotation - minus.rotation) / (2.0 * h);
            let v_o = pose.rotation.transpose() * (plus.translation - minus.translation) / (2.0 * h);
            let relative = relative_velocity(&pose, &v);
            assert!((spin - rotation::skew(&angular(&relative))).abs().max() < 1e-9, "{}", kind.name());
            assert!((v_o - linear(&relative)).norm() < 1e-9, "{}", kind.name());
        }
    }

    #[test]
    fn map_rate_is_the_rate_of_the_relative_velocity_of_every_kind() {
        for kind in kinds() {
            let v: Vec<f64> = (0..kind.rate_count()).map(|i| 0.8 - 0.5 * i as f64).collect();
            let base = general_position(&kind);
            let zero = vec![0.0; v.len()];
            let (q, pose) = pose_at(&kind, &base, &zero);
            let mut rate = zero.clone();
            kind.increment_rate(&q, &zero, &v, &mut rate);
            let h = 1e-5;
            // velocity in O+ axes for the linear part, in O axes for the angular part
            let at = |s: f64| {
                let pose = pose_at(&kind, &base, &rate.iter().map(|r| r * s).collect::<Vec<_>>()).1;
                let x = relative_velocity(&pose, &v);
                (angular(&x), pose.rotation * linear(&x))
            };
            let (plus, minus) = (at(h), at(-h));
            let expected = kind.map_rate(&q, &v, &pose);
            assert!(((plus.0 - minus.0) / (2.0 * h) - angular(&expected)).norm() < 1e-9, "{}", kind.name());
            let linear_rate = pose.rotation.transpose() * (plus.1 - minus.1) / (2.0 * h);
            assert!((linear_rate - linear(&expected)).norm() < 1e-9, "{}", kind.name());
        }
    }

    #[test]
    fn spring_force_is_the_slope_of_the_spring_energy_of_every_kind() {
        for kind in kinds() {
            let count = kind.rate_count();
            let hinge = Hinge {
                name: "h".into(),
                stiffness: (0..count).map(|i| 3.0 + i as f64).collect(),
                damping: vec![],
                rest: (0..count).map(|i| 0.1 * i as f64).collect(),
                torque: None,
                motion: None,
                held: false,
                kind,
            };
            let base = general_position(&hinge.kind);
            let v: Vec<f64> = (0..count).map(|i| 0.8 - 0.5 * i as f64).collect();
            let mut force = vec![0.0; count];
            hinge.applied_force(0.0, &base, &v, &mut force);
            let zero = vec![0.0; count];
            let mut rate = zero.clone();
            hinge.kind.increment_rate(&base, &zero, &v, &mut rate);
            let h = 1e-5;
            let energy = |s: f64| hinge.spring_energy(&pose_at(&hinge.kind, &base, &rate.iter().map(|r| r * s).collect::<Vec<_>>()).0);
            let power: f64 = force.iter().zip(&v).map(|(f, v)| f * v).sum();
            assert!((power + (energy(h) - energy(-h)) / (2.0 * h)).abs() < 1e-8, "{}", hinge.kind.name());
        }
    }
}
