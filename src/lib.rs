//! pliant: flexible multibody dynamics with the load at every hinge.
pub mod dynamics;
pub mod model;
pub mod spatial;
