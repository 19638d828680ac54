//! Pose sweep: where every O stands on its parent, the hinge maps, and the mode shapes there.
//!
//! Reads: state positions (and the modal rates, which the same pass over the modal integrals takes along). Writes: [`PoseScratch`]. Source: Paper Eq. 26 (operators), DESIGN 2 (finite rotation).
//! Closures and aggregates follow at the end, from the poses of their bodies.
//! Cost: O(bodies + modes), plus O(modes^2) per flexible body for its inertia.

use crate::dynamics::aggregate::Embedding;
use crate::dynamics::closed_chain::constraint::ClosureAt;
use crate::dynamics::flexible_inertia::FlexibleInertia;
use crate::dynamics::frame_motion::FramePose;
use crate::model::hinge::HingePose;
use crate::model::{BodyKind, State, System};
use nalgebra::{Matrix3, Vector3, Vector6};

/// Pose of one body on its parent.
#[derive(Debug, Clone, Copy)]
pub struct BodyPose {
    /// Relative pose of O in O+ and the hinge map, O axes.
    pub hinge: HingePose,
    /// Frame O+ on the parent.
    pub outer: FramePose,
    /// O axes to axes of the parent's frame.
    pub rotation: Matrix3<f64>,
    /// O in the parent's frame (m).
    pub l: Vector3<f64>,
    /// Index in [`PoseScratch::flexible`], for flexible bodies.
    pub flexible: Option<usize>,
    /// First entry of this child's `shape` if modes of the parent move it.
    pub shape: Option<usize>,
}

/// Configuration of one flexible body.
#[derive(Debug, Clone)]
pub struct FlexiblePose {
    /// Frame O in frame B.
    pub inboard: FramePose,
    /// `Pi_B(O)`: mode shape at O referred to the origin of B; empty if no mode moves O.
    pub shape_inboard: Vec<Vector6<f64>>,
    /// `M_fl(eta)`.
    pub inertia: FlexibleInertia,
}

/// What the pose sweep writes.
#[derive(Debug, Clone)]
pub struct PoseScratch {
    /// One per body.
    pub bodies: Vec<BodyPose>,
    /// One per flexible body.
    pub flexible: Vec<FlexiblePose>,
    /// `Pi(O)` of every child that modes of its parent move: at O, carried by O+, in the parent's axes; one per mode of the parent.
    pub shape: Vec<Vector6<f64>>,
    /// One per closure.
    pub closures: Vec<ClosureAt>,
    /// One per aggregate.
    pub embeddings: Vec<Embedding>,
}

impl PoseScratch {
    /// Room for `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        let (mut bodies, mut flexible, mut shapes) = (Vec::new(), Vec::new(), 0);
        for body in &system.bodies {
            let mut pose = BodyPose {
                hinge: HingePose::default(),
                outer: FramePose::default(),
                rotation: Matrix3::identity(),
                l: Vector3::zeros(),
                flexible: None,
                shape: None,
            };
            if let Some(body) = body.flexible() {
                let n = body.mode_count();
                pose.flexible = Some(flexible.len());
                flexible.push(FlexiblePose {
                    inboard: FramePose::default(),
                    shape_inboard: vec![Vector6::zeros(); if body.inboard.moves() { n } else { 0 }],
                    inertia: FlexibleInertia::new(n),
                });
            }
            if body.parent_side.moves() {
                pose.shape = Some(shapes);
                shapes += body.parent_side.mode_shape.len();
            }
            bodies.push(pose);
        }
        Self {
            bodies,
            flexible,
            shape: vec![Vector6::zeros(); shapes],
            closures: system.closures.iter().map(ClosureAt::new).collect(),
            embeddings: system.aggregates.iter().map(Embedding::new).collect(),
        }
    }

    /// Mode shape of child `k` on its parent; empty if no mode moves it.
    #[must_use]
    pub fn shape_of(&self, system: &System, k: usize) -> &[Vector6<f64>] {
        self.bodies[k].shape.map_or(&[], |start| &self.shape[start..start + system.bodies[k].parent_side.mode_shape.len()])
    }
}

impl PoseScratch {
    /// Residuals of all blocked directions (m or rad).
    pub fn residuals(&self, system: &System, out: &mut [f64]) {
        for (closure, at) in system.closures.iter().zip(&self.closures) {
            out[closure.rows()].copy_from_slice(at.residual(closure));
        }
    }

    /// Largest violation of closure `index` (m or rad).
    #[must_use]
    pub fn closure_residual(&self, system: &System, index: usize) -> f64 {
        self.closures[index].residual(&system.closures[index]).iter().fold(0.0, |m, r| r.abs().max(m))
    }

    /// Keeps the independent coordinates of all aggregates as they are, or lets them be chosen again where they are ill.
    pub fn hold_coordinates(&mut self, held: bool) {
        self.embeddings.iter_mut().for_each(|e| e.held = held);
    }
}

/// Fills `out` from the positions in `state`.
pub fn pose_outward(system: &System, state: &State, out: &mut PoseScratch) {
    for (k, body) in system.bodies.iter().enumerate() {
        place(system, state, k, out);
        if let (BodyKind::Flexible(flexible), Some(index)) = (&body.kind, out.bodies[k].flexible) {
            let (eta, eta_dot) = (&state.modal_position[body.modal_range()], &state.modal_velocity[body.modal_range()]);
            out.flexible[index].inertia.evaluate(&flexible.integrals, flexible.order, eta, eta_dot);
        }
    }
    if !system.closures.is_empty() {
        let mut closures = std::mem::take(&mut out.closures);
        for (closure, at) in system.closures.iter().zip(&mut closures) {
            at.follow_pose(closure, system, state, out);
        }
        let mut embeddings = std::mem::take(&mut out.embeddings);
        for (aggregate, embedding) in system.aggregates.iter().zip(&mut embeddings) {
            embedding.follow_pose(system, out, &closures, aggregate);
        }
        (out.closures, out.embeddings) = (closures, embeddings);
    }
}

/// Pose of body `k` on its parent, and of its hinge on itself.
pub fn place(system: &System, state: &State, k: usize, out: &mut PoseScratch) {
    let PoseScratch { bodies, flexible, shape, .. } = out;
    let (body, pose) = (&system.bodies[k], &mut bodies[k]);
    body.hinge.kind.pose(&state.position[body.position_range()], &mut pose.hinge);

    // O+ on the parent, then O through the hinge
    let eta_parent = match body.parent {
        Some(parent) if body.parent_side.moves() => &state.modal_position[system.bodies[parent].modal_range()],
        _ => &[],
    };
    pose.outer = FramePose::of(&body.parent_side, eta_parent);
    pose.rotation = pose.outer.rotation * pose.hinge.rotation;
    pose.l = pose.outer.position + pose.outer.rotation * pose.hinge.translation;
    if let Some(start) = pose.shape {
        let shape = &mut shape[start..start + body.parent_side.mode_shape.len()];
        pose.outer.shape_at(&body.parent_side, &pose.l, shape);
    }

    if let (BodyKind::Flexible(body_flexible), Some(index)) = (&body.kind, pose.flexible) {
        let (eta, own) = (&state.modal_position[body.modal_range()], &mut flexible[index]);
        own.inboard = FramePose::of(&body_flexible.inboard, eta);
        // Pi_B(O) = phi*(O, k) Pi(O): the frame's shape at the origin of B
        own.inboard.shape_at(&body_flexible.inboard, &Vector3::zeros(), &mut own.shape_inboard);
    }
}
