//! Where loads act and along which axes their components are given, in inertial axes.

use crate::dynamics::frame_motion::FramePose;
use crate::dynamics::world::{WorldFrame, hinge_frame};
use crate::integrate::Sample;
use crate::model::{ClosureJoint, ClosureSide};

/// O of the hinge that carries body `k`: the point of its load, and the axes of the components.
#[must_use]
pub fn hinge_pose(sample: &Sample<'_>, k: usize, frames: &[WorldFrame]) -> WorldFrame {
    hinge_frame(&sample.system.bodies[k], &sample.workspace.pose, k, frames)
}

/// The origin of frame b with the axes of frame a: the point and the axes of the load of a closure. A gear has none.
#[must_use]
pub fn closure_pose(sample: &Sample<'_>, index: usize, frames: &[WorldFrame]) -> Option<WorldFrame> {
    let ClosureJoint::Frames { a, b, .. } = &sample.system.closures[index].joint else { return None };
    let [a, b] = [a, b].map(|side| side_frame(sample, side, frames));
    Some(WorldFrame { rotation: a.rotation, position: b.position })
}

/// Pose of one frame of a closure.
fn side_frame(sample: &Sample<'_>, side: &ClosureSide, frames: &[WorldFrame]) -> WorldFrame {
    let (body, eta) = match side.body {
        None => (WorldFrame::default(), &[][..]),
        Some(k) => (frames[k], &sample.state.modal_position[sample.system.bodies[k].modal_range()]),
    };
    let own = FramePose::of(&side.attachment, eta);
    WorldFrame { rotation: body.rotation * own.rotation, position: body.position + body.rotation * own.position }
}
