//! Time: explicit and linearly implicit Runge-Kutta methods on the manifold of hinge rotations, step control, and the loop that drives
//! them.
//!
//! Every method integrates the same local problem ([`chart::Chart`]): within a step, hinge rotations are rotation vectors from the
//! step's start, so that quaternions stay of unit length and each method keeps its order. [`runge_kutta`] holds the explicit methods,
//! [`rosenbrock_w`] the linearly implicit one that stiff modes do not slow; [`choice`] decides between them.

pub mod change_point;
pub mod chart;
pub mod choice;
pub mod failure;
pub mod observer;
pub mod rosenbrock_w;
pub mod runge_kutta;
pub mod simulate;
pub mod stability;
pub mod step_control;
pub mod tableau;
pub mod w_tableau;

pub use failure::RunFailure;
pub use observer::{Flow, LocalError, Observer, Sample};
pub use rosenbrock_w::RosenbrockW;
pub use runge_kutta::RungeKutta;
pub use simulate::{Outcome, Settings, Summary, simulate};

use crate::dynamics::DynamicsError;
use crate::model::State;
use chart::Chart;

/// A one-step method with dense output.
pub trait Stepper {
    /// Name in reports.
    fn name(&self) -> &'static str;

    /// Takes the state to where a step may begin: evaluates there and drops what an earlier step left.
    ///
    /// # Errors
    /// If the evaluation has no answer.
    fn restart(&mut self, chart: &mut Chart<'_>) -> Result<(), DynamicsError>;

    /// Tries a step of `h` (s) from the chart's base; returns the error estimate relative to the tolerances, none for fixed steps.
    ///
    /// # Errors
    /// If an evaluation within the step has no answer.
    fn attempt(&mut self, chart: &mut Chart<'_>, h: f64) -> Result<Option<f64>, DynamicsError>;

    /// State at the fraction `theta` of the attempted step.
    fn interpolate(&self, chart: &Chart<'_>, theta: f64, out: &mut State);

    /// Work (J) at the fraction `theta` of the attempted step.
    fn interpolate_work(&self, theta: f64) -> f64;

    /// State at the end of the attempted step by the method's other solution, of lower order; false for fixed steps, which have none.
    fn embedded(&mut self, chart: &Chart<'_>, out: &mut State) -> bool;

    /// Makes the end of the attempted step the chart's base.
    fn accept(&mut self, chart: &mut Chart<'_>);

    /// Order that step control may count on, none for fixed steps.
    fn controlled_order(&self) -> Option<u8>;
}
