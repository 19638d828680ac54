//! How a command ends when it does not end well.

use std::io::{self, ErrorKind, Write as _};
use std::process::ExitCode;

/// Exit code: the input is at fault.
pub const INPUT: u8 = 2;
/// Exit code: the run stopped early.
pub const STOPPED: u8 = 3;

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// The input is at fault; one message for each fault.
    Input(Vec<String>),
    /// The run stopped early; what was computed is kept.
    Stopped(String),
    /// The output cannot be written.
    Output(io::Error),
}

impl Failure {
    /// One fault of the input.
    pub fn input(message: impl Into<String>) -> Self {
        Self::Input(vec![message.into()])
    }

    /// Says on standard error what failed; the exit code of the process. A reader that has closed its end is no failure.
    pub fn report(&self) -> ExitCode {
        let (messages, code) = match self {
            Self::Input(messages) => (messages.clone(), INPUT),
            Self::Stopped(message) => (vec![message.clone()], STOPPED),
            Self::Output(error) if error.kind() == ErrorKind::BrokenPipe => return ExitCode::SUCCESS,
            Self::Output(error) => (vec![format!("cannot write the output: {error}")], STOPPED),
        };
        let mut sink = io::stderr().lock();
        for message in messages {
            // nothing is left to tell anyone if standard error is closed too
            let _ = writeln!(sink, "error: {}", printable(&message));
        }
        ExitCode::from(code)
    }
}

/// A message without what a terminal would obey: lines of a file are shown in it.
fn printable(message: &str) -> String {
    message.chars().map(|c| if c.is_control() && !matches!(c, '\n' | '\t') { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

/// An error and its causes in one text.
pub fn with_causes(error: &dyn std::error::Error) -> String {
    use std::fmt::Write as _;
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let _ = write!(text, "\n  caused by: {inner}");
        cause = inner.source();
    }
    text
}

impl From<crate::scene::SceneError> for Failure {
    fn from(error: crate::scene::SceneError) -> Self {
        Self::input(with_causes(&error))
    }
}

impl From<crate::dynamics::DynamicsError> for Failure {
    fn from(error: crate::dynamics::DynamicsError) -> Self {
        Self::input(with_causes(&error))
    }
}

#[cfg(feature = "hdf5")]
impl From<crate::io::ModalFileError> for Failure {
    fn from(error: crate::io::ModalFileError) -> Self {
        Self::input(with_causes(&error))
    }
}
