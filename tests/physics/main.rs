//! Physics of the library: identities against independent routes, conservation laws, published numbers.
#![allow(clippy::excessive_precision, reason = "reference values keep the digits of their sources")]

#[path = "../support/mod.rs"]
mod support;

mod closed_chain;
mod conservation;
mod convergence;
mod first_principles;
mod identities;
mod implicit_matrix;
mod kernel;
mod loop_cost;
mod loop_runs;
mod modal_cost;
mod nodal_sums;
mod published;
mod published_flexible;
mod published_loops;
mod reference_solver;
mod rotating;
mod scaling;
mod stiff;
