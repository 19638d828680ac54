//! The viewer stream.
use super::frame::OutputFrame;
use super::plan::OutputPlan;
use super::tracker::Event;
use crate::integrate::Sample;
use crate::model::System;
use std::path::PathBuf;

/// Where the stream goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewerTarget {
    /// A recording on disk.
    Save(PathBuf),
    /// A viewer of its own; found on PATH or in `.venv/bin` if no executable is named.
    Spawn {
        /// The viewer to start.
        executable: Option<PathBuf>,
    },
    /// A viewer that listens, as `rerun+http://HOST:PORT/proxy`.
    Connect {
        /// Address.
        url: String,
    },
    /// A web page served by this process.
    Web {
        /// Port of the page.
        port: u16,
        /// Port of the data.
        grpc_port: u16,
    },
}

/// Why there is no stream.
#[derive(Debug, thiserror::Error)]
#[error("no viewer")]
pub struct ViewerError;
impl ViewerError {
    pub fn frames(&self) -> u64 {
        0
    }
}
#[derive(Debug)]
pub struct ViewerSummary {
    pub frames: u64,
}
#[derive(Debug)]
pub struct RerunStream {}
impl RerunStream {
    pub fn open(_: ViewerTarget, _: &OutputPlan, _: &System) -> Result<Self, ViewerError> {
        Err(ViewerError)
    }
    pub fn target(&self) -> &str {
        ""
    }
    pub fn send(&mut self, _: &Sample<'_>, _: &OutputFrame, _: &[Event]) {}
    pub fn note(&mut self, _: f64, _: &str) {}
    pub fn finish(self) -> Result<ViewerSummary, ViewerError> {
        Err(ViewerError)
    }
}
