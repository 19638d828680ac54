//! pliant: flexible multibody dynamics with the load at every hinge.
pub mod cli;
pub mod dynamics;
pub mod integrate;
#[cfg(feature = "hdf5")]
pub mod io;
pub mod model;
pub mod output;
pub mod spatial;
