//! The stability suite: cases that break other solvers, each with a bound that has a reason, and what was measured (S01, ... of the
//! project's list of reference problems). `scripts/readme_tables.py stability` runs it, long cases included, and writes the table
//! of README.md.
#![allow(clippy::excessive_precision, reason = "reference values keep the digits of their sources")]

#[path = "../support/mod.rs"]
mod support;

mod flat_spin;
mod frequencies;
mod fuzz;
mod input;
mod long_chains;
mod long_runs;
mod loops;
mod mass_ratios;
mod modal_basis;
mod modal_files;
mod modes;
mod order_8;
mod row;
mod singular_links;
mod spin;
mod steps;
