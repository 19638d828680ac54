//! Audit of the hinge loads: an independent Newton-Euler sweep in inertial axes.
//!
//! Given the accelerations that the recursion found, every body's motion is followed outward in inertial axes from the definitions of
//! hinges and interfaces alone, its inertial force is summed inward, and the result is compared with the recursion's loads.
//! None of `phi`, `P`, `z` or the packed mode shapes of the sweeps enters; only the hinge kinds' maps and `M_fl`, `b_fl` are shared.

use super::hinge_load::hinge_load;
use super::sweep::force_inward::ForceScratch;
use super::sweep::pose_outward::PoseScratch;
use super::{Workspace, flexible_inertia};
use crate::model::{Attachment, Body, BodyKind, State, System};
use crate::spatial::rotation;
use crate::spatial::shift::{angular, linear, spatial};
use nalgebra::{Matrix3, Vector3, Vector6};

/// Motion of a frame in inertial axes; `acceleration` is less gravity.
#[derive(Debug, Clone, Copy)]
struct Motion {
    axes: Matrix3<f64>,
    position: Vector3<f64>,
    omega: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    acceleration: Vector3<f64>,
}

impl Motion {
    /// The frame at the point `r` away (inertial axes) that moves with this frame.
    fn carried(&self, r: &Vector3<f64>) -> Self {
        Self {
            position: self.position + r,
            velocity: self.velocity + self.omega.cross(r),
            acceleration: self.acceleration + self.spin.cross(r) + self.omega.cross(&self.omega.cross(r)),
            ..*self
        }
    }
}

/// Motion of an interface frame relative to its body, in body axes.
struct Relative {
    axes: Matrix3<f64>,
    position: Vector3<f64>,
    omega: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    acceleration: Vector3<f64>,
}

impl Relative {
    fn of(attachment: &Attachment, eta: &[f64], eta_dot: &[f64], eta_ddot: &[f64]) -> Self {
        let sum = |x: &[f64]| attachment.mode_shape.iter().zip(x).map(|(s, x)| s * *x).sum::<Vector6<f64>>();
        let (u, u_dot, u_ddot) = (sum(eta), sum(eta_dot), sum(eta_ddot));
        let (theta, theta_dot) = (angular(&u), angular(&u_dot));
        let jacobian = rotation::left_jacobian(&theta);
        Self {
            axes: rotation::matrix_of_vector(&theta) * attachment.rotation,
            position: attachment.position + linear(&u),
            omega: jacobian * theta_dot,
            velocity: linear(&u_dot),
            spin: jacobian * angular(&u_ddot) + rotation::left_jacobian_rate(&theta, &theta_dot),
            acceleration: linear(&u_ddot),
        }
    }
}

/// The frame `attachment` on a body that moves as `body`.
fn outward(body: &Motion, relative: &Relative, attachment: &Attachment) -> Motion {
    let r = body.axes * relative.position;
    let (omega, velocity) = (body.axes * relative.omega, body.axes * relative.velocity);
    let at = body.carried(&r);
    let interface = Motion {
        axes: body.axes * relative.axes,
        omega: body.omega + omega,
        velocity: at.velocity + velocity,
        spin: body.spin + body.axes * relative.spin + body.omega.cross(&omega),
        acceleration: at.acceleration + body.omega.cross(&velocity) * 2.0 + body.axes * relative.acceleration,
        ..at
    };
    let frame = interface.carried(&(interface.axes * attachment.offset));
    Motion { axes: frame.axes * attachment.offset_rotation, ..frame }
}

/// The body that carries the frame `attachment`, which moves as `frame`: the inverse of [`outward`].
fn inward(frame: &Motion, relative: &Relative, attachment: &Attachment) -> Motion {
    let interface_axes = frame.axes * attachment.offset_rotation.transpose();
    let interface = Motion { axes: interface_axes, ..*frame }.carried(&(-(interface_axes * attachment.offset)));
    let axes = interface.axes * relative.axes.transpose();
    let (omega_rel, velocity) = (axes * relative.omega, axes * relative.velocity);
    let omega = interface.omega - omega_rel;
    let body = Motion {
        axes,
        position: interface.position,
        omega,
        velocity: interface.velocity - velocity,
        spin: interface.spin - axes * relative.spin - omega.cross(&omega_rel),
        acceleration: interface.acceleration - omega.cross(&velocity) * 2.0 - axes * relative.acceleration,
    };
    body.carried(&(-(axes * relative.position)))
}

/// Largest disagreements, each relative to the largest entry of its kind in the system.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AuditResidual {
    /// Hinge moments and forces of the recursion against this sweep.
    pub load: f64,
    /// Equations of the free hinge rates and of the modes.
    pub equation: f64,
}

impl AuditResidual {
    /// The larger of the two.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.load.max(self.equation)
    }
}

/// Newton-Euler sweep with its own room.
#[derive(Debug, Clone)]
pub struct NewtonEuler {
    motion: Vec<Motion>,
    hinge: Vec<Motion>,
    /// Force that moves everything outboard of and including a body, about the inertial origin's axes at O (inertial axes).
    load: Vec<Vector6<f64>>,
    /// Rigid rows of `M alpha + b - external` at B in body axes.
    pub inertial: Vec<Vector6<f64>>,
    /// Largest moment and force among the terms of `inertial`, which may cancel in the sum.
    magnitude: Vec<[f64; 2]>,
    modal: Vec<f64>,
    b_modal: Vec<f64>,
    elastic: Vec<f64>,
}

impl NewtonEuler {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        let rest = Motion {
            axes: Matrix3::identity(),
            position: Vector3::zeros(),
            omega: Vector3::zeros(),
            velocity: Vector3::zeros(),
            spin: Vector3::zeros(),
            acceleration: Vector3::zeros(),
        };
        let count = system.bodies.len();
        Self {
            motion: vec![rest; count],
            hinge: vec![rest; count],
            load: vec![Vector6::zeros(); count],
            inertial: vec![Vector6::zeros(); count],
            magnitude: vec![[0.0; 2]; count],
            modal: vec![0.0; system.modal_count],
            b_modal: vec![0.0; system.modal_count],
            elastic: vec![0.0; system.modal_count],
        }
    }

    /// Follows all bodies with the given accelerations and sums their inertial forces inward.
    ///
    /// `pose` holds the inertias at the state's deformation and `force` the external loads, both of the state's last evaluation.
    pub fn sweep(
        &mut self,
        system: &System,
        state: &State,
        hinge_acceleration: &[f64],
        modal_acceleration: &[f64],
        pose: &PoseScratch,
        force: &ForceScratch,
    ) {
        let world = Motion { acceleration: -system.gravity, ..Self::rest() };
        for (k, body) in system.bodies.iter().enumerate() {
            let (parent, range) = match body.parent {
                None => (world, 0..0),
                Some(p) => (self.motion[p], system.bodies[p].modal_range()),
            };
            let relative = Relative::of(
                &body.parent_side,
                &state.modal_position[range.clone()],
                &state.modal_velocity[range.clone()],
                &modal_acceleration[range],
            );
            let outer = outward(&parent, &relative, &body.parent_side);
            self.hinge[k] = across(body, state, hinge_acceleration, &outer);
            self.motion[k] = match &body.kind {
                BodyKind::Rigid(_) => self.hinge[k],
                BodyKind::Flexible(flexible) => {
                    let range = body.modal_range();
                    let (eta, eta_dot) = (&state.modal_position[range.clone()], &state.modal_velocity[range.clone()]);
                    let relative = Relative::of(&flexible.inboard, eta, eta_dot, &modal_acceleration[range]);
                    inward(&self.hinge[k], &relative, &flexible.inboard)
                }
            };
            self.inertial_force(body, k, state, modal_acceleration, pose, force);
        }
        for k in (0..system.bodies.len()).rev() {
            let (motion, at) = (self.motion[k], self.hinge[k].position);
            let (moment, push) = (motion.axes * angular(&self.inertial[k]), motion.axes * linear(&self.inertial[k]));
            let own = spatial(&(moment + (motion.position - at).cross(&push)), &push);
            self.load[k] += own;
            if let Some(parent) = system.bodies[k].parent {
                let load = self.load[k];
                let arm = at - self.hinge[parent].position;
                self.load[parent] += spatial(&(angular(&load) + arm.cross(&linear(&load))), &linear(&load));
            }
        }
    }

    fn rest() -> Motion {
        let zero = Vector3::zeros();
        Motion { axes: Matrix3::identity(), position: zero, omega: zero, velocity: zero, spin: zero, acceleration: zero }
    }

    fn inertial_force(
        &mut self,
        body: &Body,
        k: usize,
        state: &State,
        modal_acceleration: &[f64],
        pose: &PoseScratch,
        force: &ForceScratch,
    ) {
        self.load[k] = Vector6::zeros();
        let motion = &self.motion[k];
        let turned = |x: &Vector3<f64>| motion.axes.tr_mul(x);
        let (omega, spin, acceleration) = (turned(&motion.omega), turned(&motion.spin), turned(&motion.acceleration));
        let alpha = spatial(&spin, &acceleration);
        let external = force.external.get(k).copied().unwrap_or_default();
        let range = body.modal_range();
        let mut magnitude = [0.0_f64; 2];
        let mut note = |f: &Vector6<f64>| {
            magnitude[0] = magnitude[0].max(angular(f).amax());
            magnitude[1] = magnitude[1].max(linear(f).amax());
        };
        note(&external);
        self.inertial[k] = match (&body.kind, pose.bodies[k].flexible) {
            (BodyKind::Flexible(flexible), Some(index)) => {
                let inertia: &flexible_inertia::FlexibleInertia = &pose.flexible[index].inertia;
                let (eta, eta_dot) = (&state.modal_position[range.clone()], &state.modal_velocity[range.clone()]);
                let b_modal = &mut self.b_modal[range.clone()];
                let b = inertia.velocity_terms(&flexible.integrals, flexible.order, &omega, eta_dot, b_modal);
                let mut f = inertia.rigid.times(&alpha);
                note(&f);
                note(&b);
                f += b;
                let elastic = &mut self.elastic[range.clone()];
                flexible.elastic_force(eta, eta_dot, elastic);
                for (j, m) in range.enumerate() {
                    let of_mode = inertia.row[j] * modal_acceleration[m];
                    note(&of_mode);
                    f += of_mode;
                    let outside = force.external_modal.get(m).copied().unwrap_or(0.0);
                    self.modal[m] = modal_acceleration[m] + inertia.row[j].dot(&alpha) + self.b_modal[m] + self.elastic[m] - outside;
                }
                f - external
            }
            (BodyKind::Rigid(inertia), _) => {
                let c = inertia.first_moment();
                let of_spin = spatial(&(inertia.rotational * spin), &spin.cross(&c));
                let of_acceleration = spatial(&c.cross(&acceleration), &(acceleration * inertia.translational[(0, 0)]));
                let of_rates = spatial(&omega.cross(&(inertia.rotational * omega)), &omega.cross(&omega.cross(&c)));
                [of_spin, of_acceleration, of_rates].iter().for_each(&mut note);
                of_spin + of_acceleration + of_rates - external
            }
            (BodyKind::Flexible(_), None) => Vector6::zeros(),
        };
        self.magnitude[k] = magnitude;
    }

    /// Load at the hinge of body `k` by the parent on the child, about O, in O axes.
    #[must_use]
    pub fn hinge_load(&self, k: usize) -> Vector6<f64> {
        let axes = self.hinge[k].axes;
        spatial(&axes.tr_mul(&angular(&self.load[k])), &axes.tr_mul(&linear(&self.load[k])))
    }

    /// Row of modal coordinate `m` at the last sweep: inertia, elastic and damping forces less external ones, without hinge loads.
    #[must_use]
    pub fn modal_row(&self, m: usize) -> f64 {
        self.modal[m]
    }

    /// Acceleration of the recursion's frame of body `k` at the last sweep, less gravity, in its axes.
    #[must_use]
    pub fn body_acceleration(&self, k: usize) -> Vector6<f64> {
        let motion = &self.motion[k];
        spatial(&motion.axes.tr_mul(&motion.spin), &motion.axes.tr_mul(&motion.acceleration))
    }

    /// Generalised force that each coordinate needs for the accelerations of the last sweep, less springs, dampers and elastic forces:
    /// `M u_dot + C` of hinge rates and of modes. Modal entries include the elastic forces.
    pub fn generalised_force(&self, system: &System, state: &State, pose: &PoseScratch, hinge: &mut [f64], modal: &mut [f64]) {
        modal.copy_from_slice(&self.modal);
        for (k, body) in system.bodies.iter().enumerate() {
            let load = self.hinge_load(k);
            for (i, m) in body.velocity_range().enumerate() {
                hinge[m] = pose.bodies[k].hinge.map[i].dot(&load);
            }
            if let Some(flexible) = body.flexible() {
                // the load at O works against the modes that move O
                self.work_on_modes(k, &flexible.inboard, &self.motion[k], state, body, -1.0, modal);
            }
            if let Some(parent) = body.parent {
                self.work_on_modes(k, &body.parent_side, &self.motion[parent], state, &system.bodies[parent], 1.0, modal);
            }
        }
    }

    /// Adds the work of hinge load `k` on the modes of `owner` that move `attachment`, times `sign`.
    #[expect(clippy::too_many_arguments, reason = "one interface needs its load, place, owner and sign")]
    fn work_on_modes(&self, k: usize, attachment: &Attachment, body: &Motion, state: &State, owner: &Body, sign: f64, modal: &mut [f64]) {
        let eta = &state.modal_position[owner.modal_range()];
        let displacement: Vector6<f64> = attachment.mode_shape.iter().zip(eta).map(|(s, e)| s * *e).sum();
        let interface = body.position + body.axes * (attachment.position + linear(&displacement));
        let arm = self.hinge[k].position - interface;
        let (moment, push) = (angular(&self.load[k]), linear(&self.load[k]));
        let moment = body.axes.tr_mul(&(moment + arm.cross(&push)));
        let push = body.axes.tr_mul(&push);
        let turned = rotation::left_jacobian(&angular(&displacement)).tr_mul(&moment);
        for (m, shape) in modal[owner.modal_range()].iter_mut().zip(&attachment.mode_shape) {
            *m += sign * (angular(shape).dot(&turned) + linear(shape).dot(&push));
        }
    }

    /// Size of the moment (N m) that turns body `k` alone: what is left of it at a free hinge is rounding, and must be measured against it.
    fn turning_moment(&self, system: &System, workspace: &Workspace, k: usize) -> f64 {
        let spin = angular(&workspace.acceleration.alpha[k]);
        match (&system.bodies[k].kind, workspace.pose.bodies[k].flexible) {
            (BodyKind::Flexible(_), Some(index)) => (workspace.pose.flexible[index].inertia.rigid.rotational * spin).amax(),
            (BodyKind::Rigid(inertia), _) => (inertia.rotational * spin).amax(),
            (BodyKind::Flexible(_), None) => 0.0,
        }
    }

    /// Compares the loads and equations of the last evaluation in `workspace` with an independent sweep.
    pub fn audit(&mut self, system: &System, state: &State, workspace: &Workspace) -> AuditResidual {
        let acceleration = &workspace.acceleration;
        self.sweep(system, state, &acceleration.hinge, &acceleration.modal, &workspace.pose, &workspace.force);
        let (mut difference, mut size) = ([0.0_f64; 2], [0.0_f64; 2]);
        for k in 0..system.bodies.len() {
            let (mine, theirs) = (self.hinge_load(k), hinge_load(workspace, k));
            for part in 0..2 {
                let rows = |x: &Vector6<f64>| x.fixed_rows::<3>(3 * part).amax();
                difference[part] = difference[part].max(rows(&(mine - theirs)));
                // a free body has no load to compare with: the forces that cancel in it set the scale
                size[part] = size[part].max(rows(&mine)).max(self.magnitude[k][part]);
            }
            size[0] = size[0].max(self.turning_moment(system, workspace, k));
        }
        let relative = |d: f64, s: f64| if s > 0.0 { d / s } else { d };
        let load = relative(difference[0], size[0]).max(relative(difference[1], size[1]));

        let mut hinge = vec![0.0; system.velocity_count];
        let mut modal = vec![0.0; system.modal_count];
        self.generalised_force(system, state, &workspace.pose, &mut hinge, &mut modal);
        let mut equation = 0.0_f64;
        for (k, body) in system.bodies.iter().enumerate() {
            if !body.hinge.is_prescribed() {
                let scale = size[0].max(size[1]);
                for m in body.velocity_range() {
                    equation = equation.max(relative((hinge[m] - workspace.force.applied[m]).abs(), scale));
                }
            }
            let range = body.modal_range();
            let scale = range
                .clone()
                .map(|m| acceleration.modal[m].abs().max(self.elastic[m].abs()).max(self.b_modal[m].abs()))
                .fold(0.0, f64::max);
            for m in range {
                equation = equation.max(relative(modal[m].abs(), scale.max(self.inertial[k].amax())));
            }
        }
        AuditResidual { load, equation }
    }
}

/// O from O+ across the hinge, in inertial axes.
fn across(body: &Body, state: &State, hinge_acceleration: &[f64], outer: &Motion) -> Motion {
    let (q, v) = (&state.position[body.position_range()], &state.velocity[body.velocity_range()]);
    let mut pose = crate::model::hinge::HingePose::default();
    body.hinge.kind.pose(q, &mut pose);
    let mut rate = Vector6::zeros();
    let mut change = if v.is_empty() { Vector6::zeros() } else { body.hinge.kind.map_rate(q, v, &pose) };
    for (i, m) in body.velocity_range().enumerate() {
        rate += pose.map[i] * v[i];
        change += pose.map[i] * hinge_acceleration[m];
    }
    let axes = outer.axes * pose.rotation;
    let (omega, velocity) = (axes * angular(&rate), axes * linear(&rate));
    let at = outer.carried(&(outer.axes * pose.translation));
    Motion {
        axes,
        position: at.position,
        omega: outer.omega + omega,
        velocity: at.velocity + velocity,
        spin: outer.spin + outer.omega.cross(&omega) + axes * angular(&change),
        acceleration: at.acceleration + outer.omega.cross(&velocity) * 2.0 + axes * linear(&change),
    }
}
