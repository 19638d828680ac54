//! The command line: the only layer that prints, parses arguments and chooses exit codes.
//!
//! Results go to standard output, messages to standard error. Each subcommand has a file with one function that writes to a given
//! sink and returns a `Failure`; `args` holds clap's structs and nothing else.
//! A new subcommand is one variant of [`args::Command`], one file here and one arm of `run`.

pub mod args;
mod built_in;
mod check;
mod eval;
#[cfg(feature = "hdf5")]
mod export;
mod failure;
#[cfg(feature = "hdf5")]
mod import;
#[cfg(feature = "hdf5")]
mod modes;
mod report;
mod run;
mod run_report;
mod study;
#[cfg(feature = "hdf5")]
mod sweep;

use args::{Arguments, Command};
use clap::{CommandFactory, Parser};
use failure::Failure;
use std::io::Write;
use std::process::ExitCode;

/// Parses the arguments of the process, runs the command and reports its outcome.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        // help and version also come this way; a closed pipe is no reason to complain about them
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(failure::INPUT));
        }
    };
    let mut output = std::io::BufWriter::new(std::io::stdout().lock());
    let outcome = run(arguments, &mut output).and_then(|()| output.flush().map_err(Failure::from));
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // what was computed is kept and said, also when the command failed
            let _ = output.flush();
            failure.report()
        }
    }
}

fn run(arguments: Arguments, output: &mut dyn Write) -> Result<(), Failure> {
    match arguments.command {
        None => Ok(write!(output, "{}", Arguments::command().render_help())?),
        Some(Command::Run(arguments)) => run::run(&arguments, output),
        Some(Command::Eval(arguments)) => eval::run(&arguments, output),
        Some(Command::Study(arguments)) => study::run(&arguments, output),
        #[cfg(feature = "hdf5")]
        Some(Command::Sweep(arguments)) => sweep::run(&arguments, output),
        #[cfg(feature = "hdf5")]
        Some(Command::Merge(arguments)) => sweep::merge(&arguments, output),
        #[cfg(not(feature = "hdf5"))]
        Some(Command::Sweep(_) | Command::Merge(_)) => {
            Err(Failure::input("this build writes no results files; build with the feature \"hdf5\""))
        }
        Some(Command::Check(arguments)) => check::run(&arguments, output),
        #[cfg(feature = "hdf5")]
        Some(Command::Export(arguments)) => export::run(&arguments, output),
        #[cfg(not(feature = "hdf5"))]
        Some(Command::Export(_)) => Err(Failure::input("this build cannot read results files; build with the feature \"hdf5\"")),
        #[cfg(feature = "hdf5")]
        Some(Command::Modes(arguments)) => modes::run(&arguments, output),
        #[cfg(feature = "hdf5")]
        Some(Command::Import(arguments)) => import::run(&arguments, output),
        #[cfg(not(feature = "hdf5"))]
        Some(Command::Modes(_) | Command::Import(_)) => {
            Err(Failure::input("this build cannot read modal files; build with the feature \"hdf5\""))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_has_a_help_text() {
        Arguments::command().debug_assert();
    }
}
