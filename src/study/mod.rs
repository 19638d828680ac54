//! Error against run time: one scene run over integrators, tolerances or steps, mode counts, inertia orders and closure methods.
//!
//! [`grid`] says what is run, [`history`] records what is compared, [`stress`] knows the stress of bodies, [`mod@reference`] what it is compared with, [`error`] how far off it
//! is. [`runner`] runs everything in rounds and keeps finished runs in a [`state`] file; [`report`] draws up what was found, with the
//! [`pareto`] front and the cheapest setting for a budget, and [`plot`] draws it. [`verify`] compares one run
//! with a tighter one. Nothing here prints.

pub mod error;
pub mod grid;
pub mod history;
pub mod pareto;
pub mod plot;
pub mod reference;
pub mod report;
pub mod runner;
pub mod state;
pub mod stress;
pub mod verify;

pub use error::{ChannelError, Gap};
pub use grid::{Grid, Point, Request, Subject};
pub use history::{History, Recorder};
pub use reference::Reference;
pub use report::StudyReport;
pub use runner::{StudyError, Watch};
pub use state::{StateError, StateFile};
