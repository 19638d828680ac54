//! The `pliant` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    pliant::cli::main()
}
