//! One closure at the present state: residual, rate and acceleration of its blocked directions, and the forces of its multipliers.
//!
//! Motion of b relative to a is taken at b's point p in the axes of frame a. With d = p - p_a and w the velocity of p seen from a,
//! its rate is `(R_a'(alpha_b - alpha_a - omega_a x omega_b), R_a'(A_b - A_a(p) - 2 omega_a x w))`, `A_a(p)` the acceleration of
//! the point of frame a that coincides with p. Every blocked direction is a row of these six.

use crate::dynamics::frame_motion::FramePose;
use crate::dynamics::sweep::pose_outward::PoseScratch;
use crate::dynamics::world::WorldFrame;
use crate::model::aggregate::common_ancestor;
use crate::model::closure::MAX_ROWS;
use crate::model::{Closure, ClosureJoint, ClosureKind, ClosureSide, State, System};
use crate::spatial::rotation;
use crate::spatial::shift::{angular, force_from, linear, motion_to, rotate, rotate_back, spatial};
use nalgebra::{Matrix3, Vector3, Vector6};

/// One side of a closure.
#[derive(Debug, Clone)]
struct Side {
    frame: FramePose,
    /// b's point p, in the recursion's frame of this side's body (m).
    point: Vector3<f64>,
    /// Axes of the recursion's frame to those of frame a.
    to_a: Matrix3<f64>,
    /// Mode shape at p, carried by this side's frame.
    shape: Vec<Vector6<f64>>,
}

impl Side {
    fn new(side: &ClosureSide) -> Self {
        let shape = vec![Vector6::zeros(); side.attachment.mode_shape.len()];
        Self { frame: FramePose::default(), point: Vector3::zeros(), to_a: Matrix3::identity(), shape }
    }

    /// Motion of the point at p for the motion of the body and of its modes, in a's axes; modes left out rest.
    fn motion(&self, body: &Vector6<f64>, modal: &[f64]) -> Vector6<f64> {
        let moved = motion_to(&self.point, body) + self.shape.iter().zip(modal).map(|(s, e)| s * *e).sum::<Vector6<f64>>();
        rotate(&self.to_a, &moved)
    }
}

/// A motion of the whole system: velocities, or accelerations.
pub struct Motion<'a, F: Fn(usize) -> Vector6<f64>> {
    /// Of the recursion's frame of a body.
    pub body: F,
    /// Of the world.
    pub world: Vector6<f64>,
    /// Of the hinge rates.
    pub hinge: &'a [f64],
    /// Of the modal coordinates; none where they rest.
    pub modal: Option<&'a [f64]>,
}

/// Something that closures load.
pub trait ForceSink {
    /// A force on the rigid rows of a body, in its recursion's frame.
    fn on_body(&mut self, body: usize, wrench: &Vector6<f64>);
    /// The force (body axes) on the modes of a body at a point with that mode shape.
    fn on_modes(&mut self, body: usize, shape: &[Vector6<f64>], force: &Vector6<f64>);
    /// A force on the hinge rate `velocity` (among all rates) of a body.
    fn on_rate(&mut self, body: usize, velocity: usize, force: f64);
}

/// Forces on all bodies of a system.
#[derive(Debug)]
pub struct SystemForces<'a> {
    /// The system.
    pub system: &'a System,
    /// On the rigid rows of each body, in the recursion's frame.
    pub external: &'a mut [Vector6<f64>],
    /// On the modes.
    pub modal: &'a mut [f64],
    /// On the hinge rates.
    pub applied: &'a mut [f64],
}

impl ForceSink for SystemForces<'_> {
    fn on_body(&mut self, body: usize, wrench: &Vector6<f64>) {
        self.external[body] += wrench;
    }

    fn on_modes(&mut self, body: usize, shape: &[Vector6<f64>], force: &Vector6<f64>) {
        let modes = self.system.bodies[body].modal_range();
        self.modal[modes].iter_mut().zip(shape).for_each(|(m, s)| *m += s.dot(force));
    }

    fn on_rate(&mut self, _body: usize, velocity: usize, force: f64) {
        self.applied[velocity] += force;
    }
}

/// One closure at the present state.
#[derive(Debug, Clone)]
pub struct ClosureAt {
    sides: Option<[Side; 2]>,
    /// Axes of frame b in those of frame a.
    rotation: Matrix3<f64>,
    /// Origin of frame b in frame a (m).
    translation: Vector3<f64>,
    /// Blocked directions, in a's axes at p.
    rows: [Vector6<f64>; MAX_ROWS],
    residual: [f64; MAX_ROWS],
}

/// Pose of the recursion's frame of `body` in that of its ancestor `top` (the world if none).
fn pose_in(system: &System, pose: &PoseScratch, body: Option<usize>, top: Option<usize>) -> WorldFrame {
    let mut at = WorldFrame::default();
    let mut open = body;
    while let Some(k) = open.filter(|_| open != top) {
        let own = &pose.bodies[k];
        if let Some(index) = own.flexible {
            // B from O: the inverse of O in B
            let inboard = &pose.flexible[index].inboard;
            let turn = inboard.rotation.transpose();
            at = WorldFrame { rotation: turn * at.rotation, position: turn * (at.position - inboard.position) };
        }
        at = WorldFrame { rotation: own.rotation * at.rotation, position: own.l + own.rotation * at.position };
        open = system.bodies[k].parent;
    }
    at
}

/// Two unit vectors that make a right-handed triad with `axis`.
fn across(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    [first, axis.cross(&first)]
}

fn turn(axis: &Vector3<f64>) -> Vector6<f64> {
    spatial(axis, &Vector3::zeros())
}

fn travel(axis: &Vector3<f64>) -> Vector6<f64> {
    spatial(&Vector3::zeros(), axis)
}

impl ClosureAt {
    /// Room for `closure`.
    #[must_use]
    pub fn new(closure: &Closure) -> Self {
        let sides = match &closure.joint {
            ClosureJoint::Frames { a, b, .. } => Some([Side::new(a), Side::new(b)]),
            ClosureJoint::Gear { .. } => None,
        };
        Self {
            sides,
            rotation: Matrix3::identity(),
            translation: Vector3::zeros(),
            rows: [Vector6::zeros(); MAX_ROWS],
            residual: [0.0; MAX_ROWS],
        }
    }

    /// How far each blocked direction is from closed (m or rad).
    #[must_use]
    pub fn residual(&self, closure: &Closure) -> &[f64] {
        &self.residual[..closure.row_count()]
    }

    /// Takes in the poses of an evaluation.
    pub fn follow_pose(&mut self, closure: &Closure, system: &System, state: &State, pose: &PoseScratch) {
        match &closure.joint {
            ClosureJoint::Gear { a, b, ratio, offset } => {
                self.residual[0] = state.position[b.position] - ratio * state.position[a.position] - offset;
            }
            ClosureJoint::Frames { kind, a, b } => {
                let Some(sides) = &mut self.sides else { return };
                let top = common_ancestor(&system.bodies, a.body, b.body);
                let mut frames = [WorldFrame::default(); 2];
                for ((side, at), frame) in [a, b].into_iter().zip(sides.iter_mut()).zip(&mut frames) {
                    let eta = side.body.map_or(&[][..], |k| &state.modal_position[system.bodies[k].modal_range()]);
                    at.frame = FramePose::of(&side.attachment, eta);
                    *frame = pose_in(system, pose, side.body, top);
                }
                // frames in the common ancestor, so that nothing cancels far from the origin
                let axes = frames[0].rotation * sides[0].frame.rotation;
                let point = frames[1].position + frames[1].rotation * sides[1].frame.position;
                let origin = frames[0].position + frames[0].rotation * sides[0].frame.position;
                for ((side, at), frame) in [a, b].into_iter().zip(sides.iter_mut()).zip(&frames) {
                    at.to_a = axes.transpose() * frame.rotation;
                    at.point = frame.rotation.tr_mul(&(point - frame.position));
                    at.frame.shape_at(&side.attachment, &at.point, &mut at.shape);
                }
                self.translation = axes.tr_mul(&(point - origin));
                self.rotation = sides[1].to_a * sides[1].frame.rotation;
                self.block(kind);
            }
        }
    }

    /// Blocked directions and their residuals.
    fn block(&mut self, kind: &ClosureKind) {
        let (d, r) = (self.translation, self.rotation);
        let unit = [Vector3::x(), Vector3::y(), Vector3::z()];
        let mut count = 0;
        let mut add = |row: Vector6<f64>, residual: f64| {
            self.rows[count] = row;
            self.residual[count] = residual;
            count += 1;
        };
        // turning of the axis off itself, with the angle as its size
        let tilt = |axis: &Vector3<f64>| {
            let e = axis.cross(&(r * axis));
            let angle = e.norm().atan2(axis.dot(&(r * axis)));
            if e.norm() > 0.0 { e * (angle / e.norm()) } else { across(axis)[0] * angle }
        };
        match kind {
            ClosureKind::Fixed => {
                let theta = rotation::vector_of_quaternion(&rotation::quaternion_of_matrix(&r));
                unit.iter().for_each(|n| add(turn(n), n.dot(&theta)));
                unit.iter().for_each(|n| add(travel(n), n.dot(&d)));
            }
            ClosureKind::Spherical => unit.iter().for_each(|n| add(travel(n), n.dot(&d))),
            ClosureKind::Revolute { axis } => {
                let off = tilt(axis);
                across(axis).iter().for_each(|n| add(turn(n), n.dot(&off)));
                unit.iter().for_each(|n| add(travel(n), n.dot(&d)));
            }
            ClosureKind::Cylindrical { axis } => {
                let off = tilt(axis);
                across(axis).iter().for_each(|n| add(turn(n), n.dot(&off)));
                across(axis).iter().for_each(|n| add(travel(n), n.dot(&d)));
            }
            ClosureKind::Prismatic { axis } => {
                let theta = rotation::vector_of_quaternion(&rotation::quaternion_of_matrix(&r));
                unit.iter().for_each(|n| add(turn(n), n.dot(&theta)));
                across(axis).iter().for_each(|n| add(travel(n), n.dot(&d)));
            }
            ClosureKind::Planar { normal } => {
                let off = tilt(normal);
                across(normal).iter().for_each(|n| add(turn(n), n.dot(&off)));
                add(travel(normal), normal.dot(&d));
            }
            ClosureKind::Universal { axes: [first, second] } => {
                let carried = r * second;
                let size = first.cross(second).norm();
                add(turn(&(carried.cross(first) / size)), (first.dot(&carried) - first.dot(second)) / size);
                unit.iter().for_each(|n| add(travel(n), n.dot(&d)));
            }
        }
    }

    /// What the rates alone make of the rows' accelerations, written to `out` (one number per row).
    pub fn bias(&self, closure: &Closure, system: &System, state: &State, velocity: impl Fn(usize) -> Vector6<f64>, out: &mut [f64]) {
        let (ClosureJoint::Frames { kind, a, b }, Some(sides)) = (&closure.joint, &self.sides) else {
            out.fill(0.0);
            return;
        };
        let [(turn_a, at_a, bias_a), (turn_b, at_b, bias_b)] = [(a, &sides[0]), (b, &sides[1])].map(|(side, at)| {
            let Some(k) = side.body else { return (Vector3::zeros(), Vector6::zeros(), Vector6::zeros()) };
            let (v, eta_dot) = (velocity(k), &state.modal_velocity[system.bodies[k].modal_range()]);
            let motion = at.motion(&v, eta_dot);
            let bias = rotate(&at.to_a, &at.frame.bias_at(&side.attachment, &at.point, &angular(&v), eta_dot));
            (angular(&motion), motion, bias)
        });
        let seen = linear(&at_b) - linear(&at_a);
        let coriolis = spatial(&turn_a.cross(&turn_b), &(turn_a.cross(&seen) * 2.0));
        let bias = bias_b - bias_a - coriolis;
        for (b, row) in out.iter_mut().zip(&self.rows) {
            *b = row.dot(&bias);
        }
        if let ClosureKind::Universal { axes: [first, second] } = kind {
            // the row itself turns with b
            let (relative, carried) = (turn_b - turn_a, self.rotation * second);
            out[0] += relative.cross(&carried).cross(first).dot(&relative) / first.cross(second).norm();
        }
    }

    /// `G x`: motion along the blocked directions of this closure, written to `out` (one number per row).
    pub fn along<F: Fn(usize) -> Vector6<f64>>(&self, closure: &Closure, system: &System, motion: &Motion<'_, F>, out: &mut [f64]) {
        match (&closure.joint, &self.sides) {
            (ClosureJoint::Gear { a, b, ratio, .. }, _) => out[0] = motion.hinge[b.velocity] - ratio * motion.hinge[a.velocity],
            (ClosureJoint::Frames { a, b, .. }, Some(sides)) => {
                let [from, to] = [(a, &sides[0]), (b, &sides[1])].map(|(side, at)| match side.body {
                    None => rotate(&at.to_a, &motion.world),
                    Some(k) => at.motion(&(motion.body)(k), motion.modal.map_or(&[][..], |m| &m[system.bodies[k].modal_range()])),
                });
                let relative = to - from;
                for (o, row) in out.iter_mut().zip(&self.rows) {
                    *o = row.dot(&relative);
                }
            }
            (ClosureJoint::Frames { .. }, None) => {}
        }
    }

    /// Mode shapes at b's point on both sides.
    pub fn shapes(&self) -> impl Iterator<Item = &Vector6<f64>> {
        self.sides.iter().flatten().flat_map(|side| &side.shape)
    }

    /// True if blocked direction `row` is a rotation.
    #[must_use]
    pub fn blocks_turning(&self, row: usize) -> bool {
        angular(&self.rows[row]).norm_squared() > 0.0
    }

    /// Adds `G' lambda`: the forces of the multipliers on bodies, modes and hinge rates.
    pub fn push(&self, closure: &Closure, lambda: &[f64], sink: &mut impl ForceSink) {
        match (&closure.joint, &self.sides) {
            (ClosureJoint::Gear { a, b, ratio, .. }, _) => {
                sink.on_rate(b.body, b.velocity, lambda[0]);
                sink.on_rate(a.body, a.velocity, -ratio * lambda[0]);
            }
            (ClosureJoint::Frames { a, b, .. }, Some(sides)) => {
                let force = self.load(closure, lambda);
                for (side, at, sign) in [(a, &sides[0], -1.0), (b, &sides[1], 1.0)] {
                    let Some(k) = side.body else { continue };
                    let f = rotate_back(&at.to_a, &force) * sign;
                    sink.on_body(k, &force_from(&at.point, &f));
                    sink.on_modes(k, &at.shape, &f);
                }
            }
            (ClosureJoint::Frames { .. }, None) => {}
        }
    }

    /// Spatial force on b at b's point, in a's axes; zero for a gear, whose multiplier is a force on a hinge coordinate.
    #[must_use]
    pub fn load(&self, closure: &Closure, lambda: &[f64]) -> Vector6<f64> {
        match closure.joint {
            ClosureJoint::Gear { .. } => Vector6::zeros(),
            ClosureJoint::Frames { .. } => self.rows.iter().zip(lambda).take(closure.row_count()).map(|(r, l)| r * *l).sum(),
        }
    }
}
