//! pliant: flexible multibody dynamics with the load at every hinge.
pub mod cli;
#[cfg(feature = "hdf5")]
pub mod io;
pub mod model;
