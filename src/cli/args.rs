//! Arguments as clap parses them; no validation beyond syntax.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Flexible multibody dynamics with the six-component load at every hinge.
#[derive(Debug, Parser)]
#[command(name = "pliant", version, help_expected = true, propagate_version = true)]
#[command(after_help = "Exit codes: 0 done, 2 the input is at fault (the message names it), 3 the run stopped early.")]
pub struct Arguments {
    /// What to do; without it this help is printed
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Check scenes and modal files; a modal file gets its health report, one row per rule
    Check(CheckArguments),
    /// Show the modes of a modal file: frequencies, effective masses, participation, interfaces, rules
    Modes(ModesArguments),
}

/// Arguments of `pliant check`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct CheckArguments {
    /// Files to check: modal files (.h5) and scenes (.toml)
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `pliant modes`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct ModesArguments {
    /// The modal file (.h5)
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}
