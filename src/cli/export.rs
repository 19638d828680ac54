//! `pliant export`: a finished run for other programs. `pliant modes --export` does the same for a modal file.

use super::args::{ExportArguments, ExportFormat, ModesArguments};
use super::built_in;
use super::failure::{Failure, with_causes};
use crate::io::{ModalFile, ResultsReader};
use crate::output::export::{
    ExportError, Exported, ModalSource, Motion, TableFormat, check_target, write_modes, write_motion, write_series, write_table,
};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Exports a run and says what was written.
pub fn run(arguments: &ExportArguments, output: &mut dyn Write) -> Result<(), Failure> {
    if arguments.every == 0 {
        return Err(Failure::input("--every 0 takes no output time; write 1 for all of them, N for every N-th"));
    }
    let table = match arguments.format {
        ExportFormat::Xdmf => None,
        ExportFormat::Csv => Some((TableFormat::Csv, "csv")),
        ExportFormat::Parquet => Some((TableFormat::Parquet, "parquet")),
    };
    if table.is_some() && !(arguments.body.is_empty() && arguments.modal_file.is_empty()) {
        return Err(Failure::input("--body and --modal-file go with --format xdmf only; a table holds all histories, leave them out"));
    }
    let results = ResultsReader::open(&arguments.results).map_err(|e| Failure::input(with_causes(&e)))?;
    let exported = match table {
        Some((format, extension)) => {
            let target = arguments.out.clone().unwrap_or_else(|| arguments.results.with_extension(extension));
            write_table(&results, format, &target, arguments.every)?
        }
        None => {
            // the modal file of the built-in example is gone with the run's folder, but the program has it
            let example = built_in::Unpacked::new()?;
            let files = arguments.modal_file.iter().cloned().chain([example.modal_file()]).collect();
            let motion = Motion {
                folder: arguments.out.clone().unwrap_or_else(|| default_folder(&arguments.results)),
                bodies: arguments.body.clone(),
                every: arguments.every,
                modal: ModalSource { files },
            };
            write_motion(&results, &motion)?
        }
    };
    tell(&exported, arguments.json, output)
}

/// RUN_xdmf beside RUN.h5.
fn default_folder(results: &Path) -> PathBuf {
    let stem = results.file_stem().unwrap_or_default().to_string_lossy();
    results.with_file_name(format!("{stem}_xdmf"))
}

/// Writes the XDMF files of a modal file beside it: NAME.xdmf with all modes, NAME.modes.xdmf with one step per mode.
pub fn modes(arguments: &ModesArguments) -> Result<(), Failure> {
    let modal = ModalFile::open(&arguments.file)?;
    let targets = [arguments.file.with_extension("xdmf"), arguments.file.with_extension("modes.xdmf")];
    for target in &targets {
        check_target(target, std::slice::from_ref(&arguments.file))?;
    }
    write_modes(&modal, &targets[0])?;
    write_series(&modal, &targets[1])?;
    let mut sink = std::io::stderr().lock();
    for target in &targets {
        // nothing is lost if standard error is closed
        let _ = writeln!(sink, "wrote {}", target.display());
    }
    Ok(())
}

fn tell(exported: &Exported, as_json: bool, output: &mut dyn Write) -> Result<(), Failure> {
    let Exported { files, times, left_out } = exported;
    if as_json {
        let files = files.iter().map(|f| f.to_string_lossy()).collect::<Vec<_>>();
        writeln!(output, "{}", json!({ "files": files, "output_times": times, "left_out": left_out }))?;
        return Ok(());
    }
    for file in files {
        writeln!(output, "wrote {}", file.display())?;
    }
    writeln!(output, "{times} output times")?;
    for what in left_out {
        writeln!(output, "left out: {what}")?;
    }
    Ok(())
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        Self::input(with_causes(&error))
    }
}
