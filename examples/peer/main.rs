//! pliant under the line protocol of the benchmark (`scripts/benchmark.py`), and the hot paths whose instructions are counted.
//!
//! Reads one request per line, answers each with one line:
//!
//! - `peer rigid`: `<model> <n> <op> <seconds>` -> `<least ns per call> <median ns> <check>`, see [`rigid`];
//! - `peer flexible FOLDER`: `<panels> <modes> <solver> <h> <T>` -> a JSON object, see [`flexible`]; FOLDER holds `panel_<modes>.h5`;
//! - `peer modes FOLDER`: `<bodies> <modes> order<0|1|2> <seconds>` -> as `rigid`, for one evaluation of a chain of such panels;
//! - `peer count CASE N`: N evaluations (or steps) of one of the cases of [`count`], and nothing else.

mod count;
mod flexible;
mod links;
mod panels;
mod protocol;
mod rigid;

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

const USAGE: &str = "usage: peer rigid | peer flexible FOLDER | peer modes FOLDER | peer count CASE N";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done: Result<(), Box<dyn Error>> = match arguments[..] {
        ["rigid"] => protocol::serve(rigid::Rigid::build),
        ["flexible", folder] => flexible::serve(Path::new(folder)),
        ["modes", folder] => protocol::serve(|model, modes| panels::Chain::build(Path::new(folder), model, modes)),
        ["count", case, times] => times.parse().map_err(Into::into).and_then(|times| count::run(case, times)),
        _ => Err(USAGE.into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("peer: {error}");
            ExitCode::from(2)
        }
    }
}
