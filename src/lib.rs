//! pliant: flexible multibody dynamics with the load at every hinge.
pub mod model;
pub mod spatial;
