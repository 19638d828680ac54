//! Hinge loads as by-products of the recursion.
//!
//! `f(k') = P+(k') alpha+(k') + z+(k')`: the spatial force of the parent on the child, moment about O, in O axes (Paper Eq. 18, 38).

use super::Workspace;
use crate::spatial::shift::{force_from, rotate};
use nalgebra::Vector6;

/// Load at the hinge of body `k` from the last evaluation: (moment N m about O; force N), by the parent on the child, O axes.
#[must_use]
pub fn hinge_load(workspace: &Workspace, k: usize) -> Vector6<f64> {
    if let Some(tree) = workspace.kernel() {
        return tree.hinge_load(k);
    }
    workspace.inertia.bodies[k].P_plus.times(&workspace.acceleration.alpha_plus[k]) + workspace.force.bodies[k].z_plus
}

/// The same load seen from the parent: by the child on the parent, moment about O+, in O+ axes.
#[must_use]
pub fn hinge_load_on_parent(workspace: &Workspace, k: usize) -> Vector6<f64> {
    let hinge = &workspace.pose.bodies[k].hinge;
    -force_from(&hinge.translation, &rotate(&hinge.rotation, &hinge_load(workspace, k)))
}
