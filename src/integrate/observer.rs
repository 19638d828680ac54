//! What the time loop knows of the outside: observers that see samples.

use crate::dynamics::Workspace;
use crate::model::{State, System};

/// One output time: the state, and the evaluation there.
#[derive(Debug)]
pub struct Sample<'a> {
    /// The system.
    pub system: &'a System,
    /// State at the output time.
    pub state: &'a State,
    /// Evaluation at that state: accelerations, and hinge loads through [`crate::dynamics::hinge_load`].
    pub workspace: &'a Workspace,
    /// Work (J) of drives, dampers and loads since the start.
    pub work: f64,
    /// Steps taken so far.
    pub steps: u64,
}

/// The end of a step by the method's two solutions, whose difference is the local error.
#[derive(Debug)]
pub struct LocalError<'a> {
    /// The system.
    pub system: &'a System,
    /// Evaluation at the step's end.
    pub workspace: &'a Workspace,
    /// Evaluation at the end of the solution of lower order.
    pub other: &'a Workspace,
}

/// What an observer asks of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// End the run here; what was computed is kept.
    Stop,
}

/// Something that looks at every output time.
pub trait Observer {
    /// Called at every output time, in order.
    fn observe(&mut self, sample: &Sample<'_>) -> Flow;

    /// Whether [`Self::local_error`] is to be called; it costs an evaluation each time.
    fn wants_local_errors(&self) -> bool {
        false
    }

    /// Called at some of the accepted steps, before [`Self::step`].
    fn local_error(&mut self, _error: &LocalError<'_>) {}

    /// Called at the end of every accepted step, after the output times within it; the evaluation there costs nothing extra.
    fn step(&mut self, _step: &Sample<'_>) -> Flow {
        Flow::Continue
    }
}
