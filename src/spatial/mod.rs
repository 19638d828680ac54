//! Rotations and 6-D vectors of one body, and the conventions that everything else follows.
//!
//! # Conventions
//!
//! - SI units and radians; f64 throughout.
//! - Spatial vectors are (angular, linear): velocity (omega, v), acceleration (omega_dot, a), force (moment N, force F).
//!   `v` and `a` are the velocity and acceleration of the material point at the frame's origin, seen from inertial space.
//! - Rotations are active: `R` of a frame maps components in its axes to components in its parent's axes.
//! - Quaternions are `[w, x, y, z]`, of unit length.
//! - The paper's `phi(k, j)` moves forces from j to k and, transposed, motions from k to j; with `l` from k to j it is
//!   `[[1, l~], [0, 1]]` (Paper section 2). It is never formed: [`shift`] applies it.
//! - A hinge joins frame O+ on the parent to frame O on the child; its map `H` is taken in O axes.
//! - **Hinge load**: what the parent exerts on the child across the hinge, moment about O, in O axes.

pub mod inertia;
pub mod lanes;
pub mod rotation;
pub mod shift;

pub use inertia::SpatialInertia;
