//! Arguments as clap parses them; no validation beyond syntax.

use clap::{Args, Parser, Subcommand, ValueEnum};
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
    /// Simulate a scene: motion, load at every hinge, stress; without SCENE the built-in hub with two panels
    Run(RunArguments),
    /// Evaluate a scene once, at its initial state: accelerations, hinge loads, energies
    Eval(EvalArguments),
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

/// What a command changes in a scene, so that one scene serves a comparison.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct SceneArguments {
    /// Integrate with this method instead of the scene's: auto, dormand_prince, rosenbrock_w or rk4
    #[arg(long, value_name = "NAME")]
    pub integrator: Option<String>,
    /// Hold all closures by this method instead of the scene's: auto, tree_augmented or constraint_embedding
    #[arg(long, value_name = "NAME")]
    pub closure_method: Option<String>,
    /// Retain the lowest N modes of every flexible body
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Make this flexible body rigid (may be given several times)
    #[arg(long, value_name = "BODY")]
    pub rigid: Vec<String>,
}

/// Arguments of `pliant eval`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct EvalArguments {
    /// The scene (.toml)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// Time at which loads and prescribed motions are taken (s)
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_negative_numbers = true)]
    pub time: f64,
    /// Changes to the scene
    #[command(flatten)]
    pub overrides: SceneArguments,
    /// Print one JSON object instead of tables; every number reads back to the same f64
    #[arg(long)]
    pub json: bool,
}

/// Where the picture goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Viewer {
    /// No picture
    None,
    /// A recording on disk, see --rrd
    Save,
    /// A viewer that pliant starts (`rerun` on PATH or in .venv/bin)
    Spawn,
    /// A viewer that is already listening, see --url
    Connect,
    /// A page that pliant serves to a browser, see --port
    Web,
}

/// Arguments of `pliant run`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct RunArguments {
    /// The scene (.toml); the built-in example if left out
    #[arg(value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Show the motion [default: save if --rrd is given or for the built-in example, else none]
    #[arg(long, value_name = "HOW", value_enum)]
    pub viewer: Option<Viewer>,
    /// Recording to write with --viewer save [default: the scene's name with .rrd, here]
    #[arg(long, value_name = "FILE")]
    pub rrd: Option<PathBuf>,
    /// Address of the viewer with --viewer connect
    #[arg(long, value_name = "URL", default_value = "rerun+http://127.0.0.1:9876/proxy")]
    pub url: String,
    /// Port of the page with --viewer web; the data uses the port after it
    #[arg(long, value_name = "PORT", default_value_t = 9090)]
    pub port: u16,
    /// Results file to write (HDF5)
    #[arg(long, value_name = "FILE.h5")]
    pub out: Option<PathBuf>,
    /// Simulated time (s) instead of the scene's
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Changes to the scene
    #[command(flatten)]
    pub overrides: SceneArguments,
    /// Print the closing report as one JSON object
    #[arg(long)]
    pub json: bool,
}
