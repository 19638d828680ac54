//! Why a run ended before its duration.

use crate::dynamics::DynamicsError;
use thiserror::Error;

/// Why a run ended before its duration.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum RunFailure {
    /// An evaluation without an answer.
    #[error("at t = {time} s: {source}")]
    Dynamics {
        /// s.
        time: f64,
        /// What went wrong.
        source: DynamicsError,
    },
    /// A gimbal or universal hinge whose axes became dependent.
    #[error(
        "at t = {time} s hinge \"{hinge}\", which carries \"{child}\", ran into gimbal lock: its axes are within {spread:.1e} of dependent; \
         use kind = \"spherical\", or order the axes so that the motion stays away from lock"
    )]
    GimbalLock {
        /// s.
        time: f64,
        /// Name of the hinge.
        hinge: String,
        /// Name of the body that it carries.
        child: String,
        /// Volume or area that the axes span.
        spread: f64,
    },
    /// Numbers that left the finite range.
    #[error("at t = {time} s the motion left finite numbers, fastest in {place}; {remedy}")]
    NotFinite {
        /// Time of the last finite state (s).
        time: f64,
        /// Mode or hinge that moved fastest.
        place: String,
        /// What to do.
        remedy: &'static str,
    },
    /// Loops that lose rank where the error control cannot pass.
    #[error(
        "at t = {time} s the loops pass a change point, where they lose rank{}; {}take fixed steps (rk4) or loosen relative_tolerance",
        source.as_ref().map_or_else(String::new, |s| format!(" ({s})")),
        if *cut { "hold the closures by constraint_embedding, " } else { "" }
    )]
    ChangePoint {
        /// s.
        time: f64,
        /// Whether cut loops are among them.
        cut: bool,
        /// What an evaluation there said, if it failed.
        source: Option<DynamicsError>,
    },
    /// A loop that came open.
    #[error("at t = {time} s closure \"{closure}\" came open by {residual:e} m or rad; take smaller steps or a smaller relative_tolerance")]
    Opened {
        /// s.
        time: f64,
        /// Name of the closure.
        closure: String,
        /// Largest violation left after the projection (m or rad).
        residual: f64,
    },
    /// A step that became too small to advance time.
    #[error(
        "at t = {time} s the step fell to {step:e} s, fastest motion in {place}; loosen relative_tolerance or look for a discontinuity there"
    )]
    StepUnderflow {
        /// s.
        time: f64,
        /// s.
        step: f64,
        /// Mode or hinge that moved fastest.
        place: String,
    },
}
