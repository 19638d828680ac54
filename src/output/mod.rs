//! What leaves a run: peaks and limits, the results file, the viewer stream and the record of the closing report.
//!
//! [`OutputPlan`] says what is wanted, [`OutputSet`] is the observer that evaluates each output time once ([`frame`]) and hands it to
//! the tracker and the writers. Names and units are those of [`channels`]. Nothing here prints.

pub mod background;
pub mod channels;
pub mod closure_load;
pub mod evaluation;
#[cfg(feature = "hdf5")]
pub mod export;
pub mod extremes;
pub mod frame;
pub mod load_pose;
pub mod picture;
pub mod plan;
pub mod report;
#[cfg(feature = "rerun")]
pub mod rerun;
#[cfg(feature = "hdf5")]
pub mod results;
pub mod scales;
#[cfg(feature = "hdf5")]
pub mod scene_plan;
pub mod set;
pub mod stiffening;
pub mod surface;
pub mod tracker;
pub mod truncation;
pub mod viewer;
pub mod viewer_program;

pub use evaluation::Evaluation;
pub use plan::{BodyBox, BodySurface, ModalFileRecord, Monitor, OutputPlan, PlanError};
pub use report::RunReport;
pub use set::OutputSet;
pub use viewer::{ViewerError, ViewerStream, ViewerTarget};
