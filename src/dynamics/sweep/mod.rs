//! The sweeps of one evaluation, one file each, named by what they compute and the way they go.

pub mod acceleration_outward;
pub mod force_inward;
pub mod graded;
pub mod inertia_inward;
pub mod pose_outward;
pub mod response;
pub mod velocity_outward;
