//! pliant: flexible multibody dynamics with the load at every hinge.
pub mod dynamics;
pub mod integrate;
pub mod model;
pub mod spatial;
