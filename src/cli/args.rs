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
    /// Run a scene over integrators, tolerances or steps, mode counts, inertia orders: error of every load and monitored stress against run time
    Study(StudyArguments),
    /// Run a scene for many values of its keys, on all cores: envelope of every load with concurrent components, case and time
    Sweep(SweepArguments),
    /// Put the shards of a campaign together into one results file
    Merge(MergeArguments),
    /// Check scenes and modal files; a modal file gets its health report, one row per rule
    Check(CheckArguments),
    /// Show the modes of a modal file: frequencies, effective masses, participation, interfaces, rules
    Modes(ModesArguments),
    /// Export a results file: motion, stress and loads for ParaView (XDMF), or histories as a table (CSV, Parquet)
    Export(ExportArguments),
    /// Turn mode shapes of another code (XDMF or MED file) into a modal file
    Import(ImportArguments),
}

/// Arguments of `pliant import`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
#[command(
    after_help = "What is missing is asked for by name; nothing is made up. Give the rest by --keys: the keys of [body.import] in a scene."
)]
pub struct ImportArguments {
    /// The file to import (.xdmf, .xmf, .med, .rmed)
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// The modal file to write
    #[arg(long, value_name = "BODY.h5")]
    pub out: PathBuf,
    /// File with the keys of [body.import] (TOML); the options below go before it
    #[arg(long, value_name = "KEYS.toml")]
    pub keys: Option<PathBuf>,
    /// Title of the body [default: the file's name]
    #[arg(long, value_name = "TEXT")]
    pub title: Option<String>,
    /// Mesh, where a MED file has several
    #[arg(long, value_name = "NAME")]
    pub mesh: Option<String>,
    /// Field of the mode shapes, or a pattern such as "mode_*"
    #[arg(long, value_name = "FIELD")]
    pub displacement: Option<String>,
    /// Field of nodal rotations, where the displacement field has none
    #[arg(long, value_name = "FIELD")]
    pub rotation: Option<String>,
    /// Field of the stress of each mode
    #[arg(long, value_name = "FIELD")]
    pub stress: Option<String>,
    /// Frequencies of the retained modes (Hz) [default: the times of the steps]
    #[arg(long, value_name = "HZ,...", value_delimiter = ',', allow_negative_numbers = true)]
    pub frequencies: Vec<f64>,
    /// Steps to retain, counted from 1 [default: all]
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    pub modes: Vec<usize>,
    /// Damping ratio of all modes, or of each
    #[arg(long, value_name = "X,...", value_delimiter = ',', allow_negative_numbers = true)]
    pub damping_ratio: Vec<f64>,
    /// Density of all volume cells (kg/m^3); by groups in --keys
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub density: Option<f64>,
    /// Mass per area of a mesh of surface cells (kg/m^2)
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub areal_density: Option<f64>,
    /// Field of nodal masses (kg); a list in --keys
    #[arg(long, value_name = "FIELD")]
    pub node_mass: Option<String>,
    /// How the modes were held: cantilever, free-free, craig-bampton or general [default: found from the root]
    #[arg(long, value_name = "NAME")]
    pub boundary: Option<String>,
    /// Interface that carries the inboard hinge and becomes the origin [default: root]
    #[arg(long, value_name = "NAME")]
    pub root: Option<String>,
    /// An interface by a group, or a box of least and greatest coordinates: NAME=GROUP or NAME=box:x,y,z,x,y,z (several times)
    #[arg(long, value_name = "NAME=NODES", allow_hyphen_values = true)]
    pub interface: Vec<String>,
    /// Print the report as one JSON object
    #[arg(long)]
    pub json: bool,
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
    /// Also write files for ParaView beside it: NAME.xdmf with all modes, NAME.modes.xdmf with one step per mode
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub export: Option<ModesFormat>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// Formats of `pliant modes --export`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ModesFormat {
    /// XDMF that points into the modal file
    Xdmf,
}

/// Formats of `pliant export`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// A folder of XDMF files over one HDF5 file, for ParaView, VTK and meshio
    Xdmf,
    /// All histories as comma-separated text
    Csv,
    /// All histories as an Apache Parquet table
    Parquet,
}

/// Arguments of `pliant export`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct ExportArguments {
    /// The results file (.h5) of pliant run --out
    #[arg(value_name = "RUN.h5")]
    pub results: PathBuf,
    /// What to write
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub format: ExportFormat,
    /// Where to write: a folder for xdmf, a file for csv and parquet [default: RUN_xdmf, RUN.csv or RUN.parquet beside RUN.h5]
    #[arg(long, value_name = "PATH")]
    pub out: Option<PathBuf>,
    /// Take every N-th output time
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub every: usize,
    /// Flexible body to export with --format xdmf (may be given several times) [default: all]
    #[arg(long, value_name = "NAME")]
    pub body: Vec<String>,
    /// Modal file that is not where the run read it (may be given several times); bodies find theirs by content
    #[arg(long, value_name = "FILE.h5")]
    pub modal_file: Vec<PathBuf>,
    /// Print one JSON object
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
    /// Add residual modes that answer loads for the modes left out, to every flexible body that leaves some out
    #[arg(long)]
    pub residual_modes: bool,
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

/// Arguments of `pliant sweep`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
#[command(after_help = "A sweep that was ended goes on where it was: give the same command again.")]
pub struct SweepArguments {
    /// The scene (.toml)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// What varies: distributions and grids (.toml), or a table whose heading names keys of the scene, one case per row (.csv)
    #[arg(value_name = "PLAN")]
    pub plan: PathBuf,
    /// Results file to write (HDF5)
    #[arg(long, value_name = "FILE.h5", required_unless_present = "show_case")]
    pub out: Option<PathBuf>,
    /// Run share I of N only, into FILE.I-of-N.state.jsonl beside FILE.h5; put shares together by pliant merge
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<(usize, usize)>,
    /// Cases at a time [default: one per core]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Keep finished cases in this file (JSON lines), and take from it what is there [default: FILE.state.jsonl beside FILE.h5,
    /// deleted when FILE.h5 is written]
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Write the envelope to this table
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Simulated time (s) instead of the scene's
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub duration: Option<f64>,
    /// Print the scene of case N, for pliant run, and run nothing
    #[arg(long, value_name = "N")]
    pub show_case: Option<usize>,
    /// Changes to the scene
    #[command(flatten)]
    pub overrides: SceneArguments,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `pliant merge`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct MergeArguments {
    /// All shards of one campaign (FILE.I-of-N.state.jsonl), in any order
    #[arg(required = true, value_name = "SHARD")]
    pub shards: Vec<PathBuf>,
    /// Results file to write (HDF5)
    #[arg(long, value_name = "FILE.h5")]
    pub out: PathBuf,
    /// Write the envelope to this table
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// "2/3".
fn shard(text: &str) -> Result<(usize, usize), String> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
    parsed.filter(|(i, n)| (1..=*n).contains(i)).ok_or_else(|| "write I/N with I from 1 to N, as in 2/3".to_owned())
}

/// Arguments of `pliant study`.
#[derive(Debug, Args)]
#[command(help_expected = true)]
pub struct StudyArguments {
    /// The scene (.toml)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// Integrators to run [default: all that finish in a million steps]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub integrators: Vec<String>,
    /// Relative tolerances of the error-controlled ones; the absolute one follows [default: 1e-3 to 1e-8]
    #[arg(long, value_name = "X,...", value_delimiter = ',', allow_negative_numbers = true)]
    pub tolerances: Vec<f64>,
    /// Steps of rk4 (s) [default: half of what is stable, halved five times]
    #[arg(long, value_name = "S,...", value_delimiter = ',', allow_negative_numbers = true)]
    pub steps: Vec<f64>,
    /// Lowest modes to retain of every flexible body [default: those of the scene]
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    pub modes: Vec<usize>,
    /// Without residual modes for those left out, with them, or both: off, on [default: as the scene has it]
    #[arg(long, value_name = "off,on", value_delimiter = ',', value_parser = switch)]
    pub residual_modes: Vec<bool>,
    /// Without the geometric stiffness of the modal files, with it, or both: off, on [default: as the scene has it]
    #[arg(long, value_name = "off,on", value_delimiter = ',', value_parser = switch)]
    pub geometric_stiffness: Vec<bool>,
    /// Orders of the inertia in the modal coordinates: 0, 1, 2 [default: those of the scene]
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    pub orders: Vec<u8>,
    /// Methods for all closures [default: those of the scene]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub closure_method: Vec<String>,
    /// Simulated time (s) instead of the scene's
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub duration: Option<f64>,
    /// Results file to compare with, with all loads and stresses of the scene [default: a run with all modes, a hundred times tighter than the tightest tolerance]
    #[arg(long, value_name = "FILE.h5")]
    pub reference: Option<PathBuf>,
    /// Error budget: largest peak error of a load or monitored stress, as 1% or 0.01
    #[arg(long, value_name = "X", default_value = "1%", value_parser = budget, allow_hyphen_values = true)]
    pub error: f64,
    /// Rounds; each runs every setting once, in another order
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub repeat: usize,
    /// Keep finished runs in this file (JSON lines), and take from it what is there
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Write every channel of every setting to this table
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Draw error against run time, and against evaluations of the dynamics, to this picture (SVG)
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// "on" or "off".
fn switch(text: &str) -> Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("write on, off, or off,on".to_owned()),
    }
}

/// "1%" or "0.01".
fn budget(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |n| (n.trim_end(), 0.01));
    match number.parse::<f64>() {
        Ok(x) if unit == 1.0 && x >= 1.0 => Err(format!("{text} would be {:.0} %; write {text}% or a share below 1", 100.0 * x)),
        Ok(x) if x > 0.0 && x.is_finite() => Ok(unit * x),
        _ => Err("write a positive share, as 1% or 0.01".to_owned()),
    }
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
    /// Run again at a tenth of the tolerances (rk4: half the step) and print the true differences of loads and final positions
    #[arg(long)]
    pub verify: bool,
    /// Changes to the scene
    #[command(flatten)]
    pub overrides: SceneArguments,
    /// Print the closing report as one JSON object
    #[arg(long)]
    pub json: bool,
}
