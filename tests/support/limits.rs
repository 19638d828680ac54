//! The built program in a process of its own, within bounds of processor time and memory.

use std::ffi::OsStr;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Processor time (s) after which the system ends the program. Time on the clock says nothing on a machine that does other work as well.
pub const CPU_LIMIT: u64 = 10;
/// Time on the clock after which a program counts as one that waits for ever.
const PATIENCE: Duration = Duration::from_secs(300);

/// Runs the program; `None` if it had to be stopped. What it writes must fit into a pipe (64 KiB), for nothing is drained meanwhile.
pub fn run_within<S: AsRef<OsStr>>(arguments: &[S], address_space_kib: u64) -> Option<Output> {
    let program = env!("CARGO_BIN_EXE_pliant");
    let mut command = if cfg!(target_os = "linux") {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit -v {address_space_kib}; ulimit -t {CPU_LIMIT}; exec \"$0\" \"$@\""), program]);
        shell
    } else {
        Command::new(program)
    };
    // a program that another test starts meanwhile may hold, and keep locked, what this process has open
    command.env("HDF5_USE_FILE_LOCKING", "FALSE");
    let mut child = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            return None;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Some(child.wait_with_output().unwrap())
}
