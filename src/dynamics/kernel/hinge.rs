//! Hinges of several rates, prescribed ones, and external loads: in plain algebra, inertial axes.

use super::flexible::FlexibleLink;
use super::layout::{Layout, Passage, Shape};
use super::record::Motion;
use super::{Doubtful, carrier};
use crate::dynamics::added_inertia::HingeBlock;
use crate::dynamics::sweep::inertia_inward::{BodyInertia, SINGULAR, eliminate_hinge, solve_hinge};
use crate::model::hinge::{HingePose, MAX_RATES};
use crate::model::{HingeKind, LoadAxes, LoadPoint, State, System};
use crate::spatial::SpatialInertia;
use crate::spatial::shift::{angular, force_from, linear, spatial};
use nalgebra::{Matrix3, Vector3, Vector6};

/// One such hinge: what the passes hand on, in inertial axes at O.
#[derive(Debug, Clone)]
pub struct GeneralHinge {
    body: usize,
    /// Free, and not prescribed: it transmits what acts on its rates and nothing else.
    pub is_free: bool,
    pose: HingePose,
    /// O of the parent to O (m).
    pub l: Vector3<f64>,
    /// Velocity across the hinge.
    relative: Vector6<f64>,
    /// Hinge map.
    map: [Vector6<f64>; MAX_RATES],
    /// Bias acceleration, with `H* theta_ddot` of a prescribed hinge.
    bias: Vector6<f64>,
    /// O axes to inertial axes.
    rotation: Matrix3<f64>,
    /// Accelerations of a prescribed hinge.
    prescribed: [f64; MAX_RATES],
    applied: [f64; MAX_RATES],
    nu: [f64; MAX_RATES],
    inertia: BodyInertia,
    /// True if nothing but the forces on its rates passes the hinge in a response.
    releases: bool,
}

impl GeneralHinge {
    /// Of body `body`.
    pub fn new(system: &System, body: usize) -> Self {
        let hinge = &system.bodies[body].hinge;
        Self {
            body,
            is_free: matches!(hinge.kind, HingeKind::Free) && !hinge.is_prescribed(),
            pose: HingePose::default(),
            l: Vector3::zeros(),
            relative: Vector6::zeros(),
            map: [Vector6::zeros(); MAX_RATES],
            bias: Vector6::zeros(),
            rotation: Matrix3::identity(),
            prescribed: [0.0; MAX_RATES],
            applied: [0.0; MAX_RATES],
            nu: [0.0; MAX_RATES],
            inertia: BodyInertia::default(),
            releases: false,
        }
    }

    /// First pass: pose, map and bias; returns the motion of the body.
    pub fn follow(&mut self, system: &System, state: &State, shape: &Shape, parent: Option<&Motion>) -> Motion {
        let body = &system.bodies[self.body];
        let parent = parent.unwrap_or(&Motion::REST);
        let (turn, omega) = (parent.rotation(), parent.angular_velocity());
        let (q, v) = (&state.position[body.position_range()], &state.velocity[body.velocity_range()]);
        body.hinge.kind.pose(q, &mut self.pose);
        let outer = turn * Matrix3::from_column_slice(&shape.fixed);
        self.rotation = outer * self.pose.rotation;
        self.l = turn * Vector3::from(shape.offset) + outer * self.pose.translation;
        let rotation = self.rotation;
        let turned = |x: &Vector6<f64>| spatial(&(rotation * angular(x)), &(rotation * linear(x)));
        self.relative = Vector6::zeros();
        for (i, v) in v.iter().enumerate() {
            self.map[i] = turned(&self.pose.map[i]);
            self.relative += self.map[i] * *v;
        }
        let (spin, slide) = (angular(&self.relative), linear(&self.relative));
        self.bias = spatial(&omega.cross(&spin), &(omega.cross(&omega.cross(&self.l)) + omega.cross(&slide) * 2.0));
        if !v.is_empty() {
            self.bias += turned(&body.hinge.kind.map_rate(q, v, &self.pose));
        }
        if let Some(motion) = &body.hinge.motion {
            for i in 0..v.len() {
                let [_, _, acceleration] = motion.sample(state.time, i);
                self.prescribed[i] = acceleration;
                self.bias += self.map[i] * acceleration;
            }
        }
        let omega = omega + spin;
        Motion::new(&rotation, &omega)
    }

    /// Second pass: `P+` and `z+` from `P` and `z`.
    pub fn filter(
        &mut self,
        system: &System,
        state: &State,
        inertia: &SpatialInertia,
        force: &Vector6<f64>,
    ) -> Result<(SpatialInertia, Vector6<f64>), Doubtful> {
        let body = &system.bodies[self.body];
        let m = self.find_applied(system, state);
        self.inertia.P_hinge = *inertia;
        eliminate_hinge(body, &self.map, None, &mut self.inertia, |_| f64::INFINITY).map_err(|_| Doubtful)?;
        let left = self.inertia.P_plus;
        if body.hinge.is_prescribed() {
            return Ok((left, force + left.times(&self.bias)));
        }
        let z = self.pass_force(m, force);
        Ok((left, z + left.times(&self.bias)))
    }

    /// `z + G epsilon`, and `nu`, of the `m` forces in `applied`.
    fn pass_force(&mut self, m: usize, force: &Vector6<f64>) -> Vector6<f64> {
        let mut z = *force;
        for i in 0..m {
            let epsilon = self.applied[i] - self.map[i].dot(force);
            self.nu[i] = epsilon;
            z += self.inertia.G[i] * epsilon;
        }
        solve_hinge(&self.inertia.D, &mut self.nu[..m]);
        z
    }

    /// Forces on the rates at `state`; returns the number of rates.
    fn find_applied(&mut self, system: &System, state: &State) -> usize {
        let body = &system.bodies[self.body];
        let m = body.hinge.kind.rate_count();
        let (q, v) = (&state.position[body.position_range()], &state.velocity[body.velocity_range()]);
        body.hinge.applied_force(state.time, q, v, &mut self.applied[..m]);
        m
    }

    /// The same through a free hinge: `P+` is zero, returned is `z+`. Its map H is a rotation of both halves, so that `G = H` and
    /// `nu = H* P^-1 (H applied - z)`.
    pub fn release(
        &mut self,
        system: &System,
        state: &State,
        inertia: &SpatialInertia,
        force: &Vector6<f64>,
    ) -> Result<Vector6<f64>, Doubtful> {
        self.find_applied(system, state);
        let felt = Vector6::from(self.applied);
        let felt = spatial(&(self.rotation * angular(&felt)), &(self.rotation * linear(&felt)));
        let free = solve_positive(inertia, felt - force).ok_or(Doubtful)?;
        for i in 0..MAX_RATES {
            self.inertia.G[i] = self.map[i];
            self.nu[i] = self.map[i].dot(&free);
        }
        Ok(felt)
    }

    /// `P+` from `P` with `added` on the hinge's own inertia: for responses, after the first pass.
    pub fn factor(&mut self, system: &System, inertia: &SpatialInertia, added: Option<&HingeBlock>) -> Result<SpatialInertia, Doubtful> {
        let body = &system.bodies[self.body];
        self.releases = matches!(body.hinge.kind, HingeKind::Free) && !body.hinge.is_prescribed() && added.is_none();
        self.inertia.P_hinge = *inertia;
        eliminate_hinge(body, &self.map, added, &mut self.inertia, |_| f64::INFINITY).map_err(|_| Doubtful)?;
        Ok(self.inertia.P_plus)
    }

    /// A response inward: `z+` from `z` under the forces `applied` on the rates.
    pub fn respond(&mut self, system: &System, applied: &[f64], force: &Vector6<f64>) -> Vector6<f64> {
        if system.bodies[self.body].hinge.is_prescribed() {
            return *force;
        }
        self.applied[..applied.len()].copy_from_slice(applied);
        let z = self.pass_force(applied.len(), force);
        if !self.releases {
            return z;
        }
        let felt = Vector6::from(self.applied);
        spatial(&(self.rotation * angular(&felt)), &(self.rotation * linear(&felt)))
    }

    /// A response outward: as [`Self::accelerate`], but prescribed hinges do not move. The others have no bias, since they were posed at rest.
    pub fn follow_response(&self, system: &System, outer: &Vector6<f64>, hinge: &mut [f64]) -> Vector6<f64> {
        if system.bodies[self.body].hinge.is_prescribed() { *outer } else { self.accelerate(system, outer, hinge) }
    }

    /// Third pass: the body's acceleration from that of O+ at O; writes the accelerations of the rates.
    pub fn accelerate(&self, system: &System, outer: &Vector6<f64>, hinge: &mut [f64]) -> Vector6<f64> {
        let mut alpha = outer + self.bias;
        if system.bodies[self.body].hinge.is_prescribed() {
            hinge.copy_from_slice(&self.prescribed[..hinge.len()]);
            return alpha;
        }
        let biased = alpha;
        for (i, out) in hinge.iter_mut().enumerate() {
            *out = self.nu[i] - self.inertia.G[i].dot(&biased);
            alpha += self.map[i] * *out;
        }
        alpha
    }

    /// Power (W) of motor and damper, or of the drive of a prescribed hinge.
    pub fn power(&self, system: &System, state: &State, load: impl Fn(usize) -> Vector6<f64>) -> f64 {
        let body = &system.bodies[self.body];
        let (q, v) = (&state.position[body.position_range()], &state.velocity[body.velocity_range()]);
        let along = if body.hinge.is_prescribed() {
            // the drive does what the load along the hinge does, less what the hinge's spring stores
            let load = load(self.body);
            v.iter().enumerate().map(|(i, v)| self.pose.map[i].dot(&load) * v).sum::<f64>()
        } else {
            self.applied.iter().zip(v).map(|(f, v)| f * v).sum()
        };
        if body.hinge.stiffness.is_empty() {
            return along;
        }
        along - body.hinge.spring_force(q).iter().zip(v).map(|(f, v)| f * v).sum::<f64>()
    }
}

/// `P^-1 x` by `P = L D L'`; none if a pivot is rounding of the size of its half.
fn solve_positive(inertia: &SpatialInertia, mut x: Vector6<f64>) -> Option<Vector6<f64>> {
    let mut p = inertia.matrix();
    let sizes = [inertia.rotational.trace(), inertia.translational.trace()];
    for k in 0..MAX_RATES {
        let pivot = p[(k, k)];
        if !(pivot > SINGULAR * sizes[k / 3] && pivot >= f64::MIN_POSITIVE) {
            return None;
        }
        for i in k + 1..MAX_RATES {
            let factor = p[(i, k)] / pivot;
            for j in k + 1..=i {
                p[(i, j)] -= factor * p[(j, k)];
            }
            x[i] -= factor * x[k];
        }
    }
    for k in (0..MAX_RATES).rev() {
        // column k of L is that of p over its pivot
        for i in k + 1..MAX_RATES {
            x[k] -= p[(i, k)] * x[i];
        }
        x[k] /= p[(k, k)];
    }
    Some(x)
}

/// Velocities of O in inertial axes (m/s) of as many bodies as there is room for, and those of the frames of flexible ones.
pub fn velocities(
    state: &State,
    layout: &Layout,
    motion: &[Motion],
    general: &[GeneralHinge],
    flexible: &mut [FlexibleLink],
    out: &mut [Vector3<f64>],
) {
    for (k, link) in layout.links.iter().enumerate().take(out.len()) {
        let parent = carrier(link, layout, motion, flexible).unwrap_or(&Motion::REST);
        let omega = parent.angular_velocity();
        let base = match layout.tips.get(link.tip as usize) {
            None => out.get(link.parent as usize).copied().unwrap_or_default(),
            Some(&(body, tip)) => flexible[body as usize].tips[tip as usize].velocity,
        };
        let (l, slide) = if link.passage == Passage::General {
            let own = &general[link.general as usize];
            (own.l, linear(&own.relative))
        } else {
            let shape = &layout.shapes[link.shape as usize];
            let offset = parent.rotation() * Vector3::from(shape.offset);
            match link.passage {
                Passage::Slide => {
                    let travel = motion[k].rotation().column(2) * shape.travel_rate;
                    (offset + travel * state.position[link.q as usize], travel * state.velocity[link.v as usize])
                }
                _ => (offset, Vector3::zeros()),
            }
        };
        out[k] = base + omega.cross(&l) + slide;
        if let Some(own) = flexible.get_mut(link.flexible as usize) {
            own.follow_velocity(&out[k]);
        }
    }
}

/// Force of the external loads on body `k` at O in inertial axes.
pub fn external_force(system: &System, state: &State, k: usize, motion: &Motion, turn: &Matrix3<f64>) -> Vector6<f64> {
    let rotation = motion.rotation() * turn.transpose();
    let mut total = Vector6::zeros();
    for load in system.loads_of(k) {
        let value = load.value(state.time);
        let axes = match load.axes {
            LoadAxes::World => Matrix3::identity(),
            LoadAxes::Body => rotation * system.bodies[k].frame_rotation,
        };
        let LoadPoint::Rigid(point) = &load.point else { continue };
        total += force_from(&(rotation * point), &spatial(&(axes * angular(&value)), &(axes * linear(&value))));
    }
    total
}
