//! Accelerations and hinge loads from the motion of mass points alone.
//!
//! A flexible body of lumped nodes on a free hinge carries, on its interface "tip" (which turns by a finite rotation), a rigid body of
//! mass points on a revolute hinge. Node positions are written as one function of all coordinates; everything else is
//! differences of that function: Kane's method sums `dX/ds_k . m (X'' - g)` over the points. No inertia, map or bias of the library enters.

use crate::support::assert_close;
use crate::support::lumped::{LumpedBody, lumped_body, vector};
use crate::support::scenes::{flexible, hinge};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, Frame, LoadDefinition, PointDefinition, WORLD};
use pliant::model::modal_body::{Boundary, Interface};
use pliant::model::{LoadAxes, State, System, TimeFunction};
use pliant::spatial::rotation::{about_axis, matrix_of_quaternion, matrix_of_vector, quaternion_of_vector};
use pliant::spatial::shift::{angular, linear};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

/// Central differences of order 8.
const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
const SECOND: [f64; 4] = [8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];
const SECOND_CENTER: f64 = -205.0 / 72.0;

/// Step (s, or the coordinates' units) along motions of uniform rates below 2 rad/s: truncation h^8 / 3150 times a tenth derivative of
/// 2^10 is 1e-14, rounding eps / h^2 is 6e-13, and solving for accelerations multiplies both by a condition of up to 1e2.
const STEP: f64 = 0.02;
const ALLOWED: f64 = 1e-10;
/// Step along motions with the accelerations found. Those reach a = 1e3 / s^2 in the modes, so that the tenth derivative grows to a^5 =
/// 1e15 per metre and truncation to h^8 / 3150 * 1e15 = 2e-8 of loads that are themselves a hundred times larger than a metre's; eps / h^2
/// is 1e-11.
const SHORT: f64 = 0.004;
const ALLOWED_SHORT: f64 = 1e-9;

struct Case {
    body: LumpedBody,
    /// Interface that carries the free hinge.
    root: &'static str,
    child: Frame,
    tip_frame: Frame,
    axis: Vector3<f64>,
    /// Masses and points of the rigid body in its own axes.
    tip_points: Vec<(f64, Vector3<f64>)>,
    definition: Definition,
    system: System,
    state: State,
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

fn case(seed: u64, boundary: Boundary, root: &'static str) -> Case {
    let rng = &mut StdRng::seed_from_u64(seed);
    let body = lumped_body(rng, boundary, 4);
    let frame = |rng: &mut StdRng| Frame { position: vector(rng, 0.4), quaternion: quaternion_of_vector(&vector(rng, 1.5)) };
    let (child, tip_frame, axis) = (frame(rng), frame(rng), vector(rng, 1.0).normalize());
    let tip_points: Vec<_> = (0..5).map(|_| (rng.random_range(0.3..1.5), vector(rng, 0.6))).collect();
    let mass: f64 = tip_points.iter().map(|p| p.0).sum();
    let center = tip_points.iter().map(|(m, r)| r * *m).sum::<Vector3<f64>>() / mass;
    let about = |r: Vector3<f64>| Matrix3::from_diagonal_element(r.norm_squared()) - r * r.transpose();
    let inertia = tip_points.iter().map(|(m, r)| about(r - center) * *m).sum();

    let mut panel = flexible("panel", body.modal.clone());
    let list = |rng: &mut StdRng, size: f64| (0..4).map(|_| rng.random_range(-size..size)).collect::<Vec<f64>>();
    if let BodyDefinitionKind::Flexible(f) = &mut panel.kind {
        (f.modal_position, f.modal_velocity) = (list(rng, 0.3), list(rng, 1.0));
        f.damping_ratio = vec![0.03; 4];
    }
    let tip = BodyDefinition { name: "tip body".into(), kind: BodyDefinitionKind::Rigid { mass, center_of_mass: center, inertia } };
    let mut free = hinge("base", "free", &[], WORLD, "panel", [0.0; 3]);
    (free.child_node, free.child_frame) = (Some(root.into()), child);
    free.position = [vector(rng, 0.5).as_slice(), &quaternion_of_vector(&vector(rng, 1.5))].concat();
    free.velocity = vec![0.7, -0.4, 0.9, 0.3, -0.8, 0.5];
    let mut turn = hinge("drive", "revolute", &[axis.into()], "panel", "tip body", [0.0; 3]);
    (turn.parent_node, turn.parent_frame) = (Some("tip".into()), tip_frame);
    (turn.position, turn.velocity) = (vec![0.6], vec![-1.3]);
    let (force, moment) = (vector(rng, 6.0), vector(rng, 3.0));
    let load = LoadDefinition {
        body: "panel".into(),
        point: PointDefinition::Interface("mid".into()),
        force: Some(TimeFunction::Constant(force.as_slice().to_vec())),
        moment: Some(TimeFunction::Constant(moment.as_slice().to_vec())),
        axes: LoadAxes::World,
    };
    let gravity = vector(rng, 9.0);
    let definition = Definition { gravity, bodies: vec![panel, tip], hinges: vec![free, turn], loads: vec![load], closures: vec![] };
    let (system, state) = definition.build().unwrap();
    Case { body, root, child, tip_frame, axis, tip_points, definition, system, state, force, moment }
}

/// Positions of all points (nodes, then those of the tip body), and the frames that loads are taken at.
struct Positions {
    points: Vec<Vector3<f64>>,
    mid: (Matrix3<f64>, Vector3<f64>),
    tip_hinge: (Matrix3<f64>, Vector3<f64>),
}

impl Case {
    /// Coordinates are increments from the state: rotation vector and position of the free hinge's O, modes, tip angle.
    fn positions(&self, s: &[f64]) -> Positions {
        let q = &self.state.position;
        let eta: Vec<f64> = self.state.modal_position.iter().zip(&s[6..10]).map(|(e, d)| e + d).collect();
        let displaced = |i: &Interface| i.mode_shape.iter().zip(&eta).map(|(s, e)| s * *e).sum::<Vector6<f64>>();
        let frame_of = |name: &str, offset: &Frame| {
            let interface = self.body.modal.interface(name).unwrap();
            let u = displaced(interface);
            let axes = matrix_of_vector(&angular(&u)) * interface.orientation;
            (axes * matrix_of_quaternion(&offset.quaternion), interface.position + linear(&u) + axes * offset.position)
        };
        let world_o = matrix_of_quaternion(&[q[3], q[4], q[5], q[6]]) * matrix_of_vector(&Vector3::new(s[0], s[1], s[2]));
        let at_o = Vector3::new(q[0] + s[3], q[1] + s[4], q[2] + s[5]);
        let (o_axes, o_at) = frame_of(self.root, &self.child);
        let axes = world_o * o_axes.transpose();
        let place = |x: Vector3<f64>| at_o + axes * (x - o_at);

        let shaped = |i: usize| self.body.points[i] + self.body.shapes.iter().zip(&eta).map(|(phi, e)| phi[i] * *e).sum::<Vector3<f64>>();
        let mut points: Vec<_> = (0..self.body.points.len()).map(|i| place(shaped(i))).collect();
        let (outer, outer_at) = frame_of("tip", &self.tip_frame);
        let tip_axes = axes * outer * about_axis(&self.axis, q[7] + s[10]);
        points.extend(self.tip_points.iter().map(|(_, r)| place(outer_at) + tip_axes * r));
        let mid = frame_of("mid", &Frame::default());
        Positions { points, mid: (axes * mid.0, place(mid.1)), tip_hinge: (tip_axes, place(outer_at)) }
    }

    fn masses(&self) -> Vec<f64> {
        self.body.masses.iter().copied().chain(self.tip_points.iter().map(|p| p.0)).collect()
    }

    /// Increments at the time t from the state if it moves on with the accelerations u (omega, v of O, angle; modes).
    fn along(&self, u: &Accelerations, t: f64) -> Vec<f64> {
        let v = &self.state.velocity;
        let q = &self.state.position;
        let r = matrix_of_quaternion(&[q[3], q[4], q[5], q[6]]);
        let (omega, speed) = (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]));
        let (omega_dot, speed_dot) = (Vector3::from_column_slice(&u.hinge[..3]), Vector3::from_column_slice(&u.hinge[3..6]));
        // the rotation vector of a frame at zero has the rate omega and the acceleration omega_dot
        let turned = omega * t + omega_dot * (0.5 * t * t);
        let moved = r * (speed * t + (speed_dot + omega.cross(&speed)) * (0.5 * t * t));
        let modes = self.state.modal_velocity.iter().zip(&u.modal).map(|(v, a)| v * t + 0.5 * a * t * t);
        let angle = v[6] * t + 0.5 * u.hinge[6] * t * t;
        turned.iter().chain(moved.iter()).copied().chain(modes).chain([angle]).collect()
    }

    /// Accelerations of all points for the accelerations u of the coordinates.
    fn point_accelerations(&self, u: &Accelerations, step: f64) -> Vec<Vector3<f64>> {
        let mut sum: Vec<_> = self.positions(&[0.0; 11]).points.iter().map(|x| x * SECOND_CENTER).collect();
        for (i, weight) in SECOND.iter().enumerate() {
            let t = step * (i + 1) as f64;
            let (ahead, behind) = (self.positions(&self.along(u, t)).points, self.positions(&self.along(u, -t)).points);
            sum.iter_mut().zip(ahead.iter().zip(&behind)).for_each(|(s, (a, b))| *s += (a + b) * *weight);
        }
        sum.iter().map(|s| s / (step * step)).collect()
    }

    /// Partial velocities of all points and of "mid" (velocity, angular velocity) along coordinate k.
    fn partial(&self, k: usize) -> (Vec<Vector3<f64>>, Vector3<f64>, Vector3<f64>) {
        let here = self.positions(&[0.0; 11]);
        let mut points = vec![Vector3::zeros(); here.points.len()];
        let (mut velocity, mut rotation) = (Vector3::zeros(), Matrix3::zeros());
        for (i, weight) in FIRST.iter().enumerate() {
            let at = |d: f64| {
                let mut s = [0.0; 11];
                s[k] = d;
                self.positions(&s)
            };
            let d = STEP * (i + 1) as f64;
            let (ahead, behind) = (at(d), at(-d));
            let weight = weight / STEP;
            points.iter_mut().zip(ahead.points.iter().zip(&behind.points)).for_each(|(p, (a, b))| *p += (a - b) * weight);
            velocity += (ahead.mid.1 - behind.mid.1) * weight;
            rotation += (ahead.mid.0 - behind.mid.0) * weight;
        }
        let spin = rotation * here.mid.0.transpose();
        (points, velocity, Vector3::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]))
    }

    /// Accelerations of the eleven coordinates by Kane's method: the equations at zero acceleration, and M from partial velocities.
    fn kane(&self) -> Vec<f64> {
        let zero = Accelerations { hinge: vec![0.0; 7], modal: vec![0.0; 4] };
        let (masses, gravity) = (self.masses(), self.definition.gravity);
        let acceleration = self.point_accelerations(&zero, STEP);
        let partials: Vec<_> = (0..11).map(|k| self.partial(k)).collect();
        let mass = DMatrix::from_fn(11, 11, |i, j| {
            masses.iter().zip(partials[i].0.iter().zip(&partials[j].0)).map(|(m, (a, b))| m * a.dot(b)).sum::<f64>()
        });
        let force = DVector::from_fn(11, |k, _| {
            let (points, velocity, spin) = &partials[k];
            let inertial: f64 = masses.iter().zip(points.iter().zip(&acceleration)).map(|(m, (p, a))| m * p.dot(&(a - gravity))).sum();
            let elastic = if (6..10).contains(&k) {
                let omega = std::f64::consts::TAU * self.body.modal.frequency_hz[k - 6];
                omega * omega * self.state.modal_position[k - 6] + 2.0 * 0.03 * omega * self.state.modal_velocity[k - 6]
            } else {
                0.0
            };
            velocity.dot(&self.force) + spin.dot(&self.moment) - inertial - elastic
        });
        let solved = mass.cholesky().unwrap().solve(&force);
        // partials of the position are along inertial axes: turn them into O axes. At zero accelerations of the rates the position's own
        // second derivative holds omega x v, which `along` has in both
        let q = &self.state.position;
        let r = matrix_of_quaternion(&[q[3], q[4], q[5], q[6]]);
        let linear = r.tr_mul(&Vector3::new(solved[3], solved[4], solved[5]));
        [&solved.as_slice()[..3], linear.as_slice(), &solved.as_slice()[10..], &solved.as_slice()[6..10]].concat()
    }
}

struct Accelerations {
    hinge: Vec<f64>,
    modal: Vec<f64>,
}

fn cases() -> impl Iterator<Item = (String, Case)> {
    let kinds = [(Boundary::Cantilever, "root"), (Boundary::General, "root"), (Boundary::FreeFree, "root"), (Boundary::Cantilever, "mid")];
    (0..8).map(move |seed| {
        let (boundary, root) = kinds[seed as usize % kinds.len()];
        (format!("seed {seed}, {} held at {root}", boundary.name()), case(seed, boundary, root))
    })
}

fn solved(case: &Case) -> (Workspace, Accelerations) {
    let mut workspace = Workspace::new(&case.system);
    forward_dynamics(&case.system, &case.state, &mut workspace).unwrap();
    let found = Accelerations { hinge: workspace.acceleration.hinge.clone(), modal: workspace.acceleration.modal.clone() };
    (workspace, found)
}

#[test]
fn accelerations_agree_with_kanes_method_on_the_points() {
    for (name, case) in cases() {
        let (_, found) = solved(&case);
        let (found, expected) = ([found.hinge, found.modal].concat(), case.kane());
        println!("{name}: {:e}", crate::support::scenes::difference(&found, &expected));
        assert_close(&found, &expected, ALLOWED, &name);
    }
}

#[test]
fn momentum_of_all_points_changes_by_the_external_force_and_moment_alone() {
    for (name, case) in cases() {
        let (_, found) = solved(&case);
        let acceleration = case.point_accelerations(&found, SHORT);
        let here = case.positions(&[0.0; 11]);
        let (mut force, mut moment, mut scale) = (-case.force, -case.moment - here.mid.1.cross(&case.force), 0.0);
        for ((m, a), x) in case.masses().iter().zip(&acceleration).zip(&here.points) {
            let push = (a - case.definition.gravity) * *m;
            force += push;
            moment += x.cross(&push);
            scale += push.norm() * (1.0 + x.norm());
        }
        println!("{name}: force {:e}, moment {:e}", force.norm() / scale, moment.norm() / scale);
        assert!(force.norm() <= ALLOWED_SHORT * scale && moment.norm() <= ALLOWED_SHORT * scale, "{name}: {force} {moment} of {scale}");
    }
}

#[test]
fn hinge_load_is_the_momentum_balance_of_the_points_outboard() {
    for (name, case) in cases() {
        let (workspace, found) = solved(&case);
        let acceleration = case.point_accelerations(&found, SHORT);
        let here = case.positions(&[0.0; 11]);
        let first = case.body.points.len();
        let (axes, at) = here.tip_hinge;
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for (i, (m, _)) in case.tip_points.iter().enumerate() {
            let push = (acceleration[first + i] - case.definition.gravity) * *m;
            force += push;
            moment += (here.points[first + i] - at).cross(&push);
        }
        let load = hinge_load(&workspace, 1);
        println!("{name}: force {:e}", (linear(&load) - axes.tr_mul(&force)).norm() / force.norm());
        assert_close(linear(&load).as_slice(), axes.tr_mul(&force).as_slice(), ALLOWED_SHORT, &format!("{name}: force"));
        assert_close(angular(&load).as_slice(), axes.tr_mul(&moment).as_slice(), ALLOWED_SHORT, &format!("{name}: moment"));
    }
}
