//! Where bodies stand and move in inertial axes.

use super::sweep::pose_outward::PoseScratch;
use crate::model::{Body, System};
use nalgebra::{Matrix3, Vector3};

/// Pose of a frame in inertial axes.
#[derive(Debug, Clone, Copy)]
pub struct WorldFrame {
    /// Axes of the frame to inertial axes.
    pub rotation: Matrix3<f64>,
    /// Origin (m).
    pub position: Vector3<f64>,
}

impl Default for WorldFrame {
    fn default() -> Self {
        Self { rotation: Matrix3::identity(), position: Vector3::zeros() }
    }
}

impl WorldFrame {
    /// The body frame B of `body` (as scenes define it) from the recursion's frame.
    #[must_use]
    pub fn body_frame(&self, body: &Body) -> Self {
        Self { rotation: self.rotation * body.frame_rotation, position: self.position + self.rotation * body.frame_position }
    }
}

/// World poses of the recursion's frames, one per body.
pub fn world_frames(system: &System, pose: &PoseScratch, out: &mut [WorldFrame]) {
    for (k, body) in system.bodies.iter().enumerate() {
        let hinge = hinge_frame(body, pose, k, out);
        out[k] = match pose.bodies[k].flexible {
            None => hinge,
            Some(index) => {
                // B from O: the inverse of O in B
                let inboard = &pose.flexible[index].inboard;
                let rotation = hinge.rotation * inboard.rotation.transpose();
                WorldFrame { rotation, position: hinge.position - rotation * inboard.position }
            }
        };
    }
}

/// World pose of O of body `k`'s hinge, given the frames of the bodies before it.
#[must_use]
pub fn hinge_frame(body: &Body, pose: &PoseScratch, k: usize, frames: &[WorldFrame]) -> WorldFrame {
    let parent = body.parent.map_or_else(WorldFrame::default, |p| frames[p]);
    let own = &pose.bodies[k];
    WorldFrame { rotation: parent.rotation * own.rotation, position: parent.position + parent.rotation * own.l }
}
