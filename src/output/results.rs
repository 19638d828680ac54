//! The results file of a run: `channels` laid out as HDF5 paths, one row per output time, written by a thread of its own.
//!
//! The order of [`ResultsWriter::write`] is that of [`result_channels`]; a test holds the two together. Rows are handed over in blocks
//! through a bounded channel: the solver waits if the disk is that slow, and nothing is dropped.

use super::background::stand_back;
use super::channels::{Channel, result_channels};
use super::frame::OutputFrame;
use super::load_pose::{closure_pose, hinge_pose};
use super::plan::OutputPlan;
use crate::dynamics::world::WorldFrame;
use crate::integrate::Sample;
use crate::io::results_file::{Preface, ResultsError, ResultsFile, SeriesSpec, escape};
use crate::model::System;
use crate::spatial::rotation::quaternion_of_matrix;
use crossbeam_channel::{Receiver, Sender, bounded};
use nalgebra::Vector6;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

/// Name of the schema.
pub const FORMAT: &str = "pliant-results";
/// Version of the schema.
pub const VERSION: &str = "1.0";

/// Memory (bytes) for blocks on their way to the thread; one more is being filled and one being written.
const ROOM: usize = 32 << 20;

/// Writes one results file.
#[derive(Debug)]
pub struct ResultsWriter {
    path: PathBuf,
    /// Numbers per output time.
    width: usize,
    /// Rows that are not yet handed over.
    block: Vec<f64>,
    /// Rows of a whole block.
    block_rows: usize,
    sender: Sender<Vec<f64>>,
    /// Blocks that were written, to be filled again.
    written: Receiver<Vec<f64>>,
    thread: JoinHandle<Result<ResultsFile, ResultsError>>,
    /// Last quaternion of every pose in the order of the row: of the two that mean the same, the one nearer to the last is written.
    quaternions: Vec<[f64; 4]>,
}

impl ResultsWriter {
    /// Makes the file with its attributes, the scene and empty series, and starts the thread.
    ///
    /// # Errors
    /// If the file cannot be made, or the system gives no thread.
    pub fn create(path: &Path, system: &System, plan: &OutputPlan) -> Result<Self, ResultsError> {
        let series: Vec<_> = result_channels(system, plan).iter().map(series_of).collect();
        let width: usize = series.iter().map(|s| s.width.unwrap_or(1)).sum();
        let mut file = ResultsFile::create(path, &preface(plan), &series)?;
        let block_rows = file.block_rows();
        let in_flight = ROOM / (size_of::<f64>() * width.max(1) * block_rows);
        let (sender, receiver) = bounded::<Vec<f64>>(in_flight);
        let (returned, written) = bounded(in_flight + 1);
        let work = move || {
            stand_back();
            for block in receiver {
                file.append(&block)?;
                // the run keeps no room for more blocks than are in use
                let _ = returned.try_send(block);
            }
            Ok(file)
        };
        let thread = std::thread::Builder::new().name("results".into()).spawn(work);
        let thread = thread.map_err(|e| ResultsError::Create { file: path.to_owned(), cause: e.to_string() })?;
        let block = Vec::with_capacity(width * block_rows);
        Ok(Self { path: path.to_owned(), width, block, block_rows, sender, written, thread, quaternions: Vec::new() })
    }

    /// The path as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Takes one output time. False if the thread could not write what it was given before; [`Self::finish`] says why.
    #[must_use]
    pub fn write(&mut self, plan: &OutputPlan, sample: &Sample<'_>, frame: &OutputFrame) -> bool {
        let Sample { system, state, workspace, work, .. } = *sample;
        let row = &mut self.block;
        let start = row.len();
        let mut poses = 0;
        let mut pose = |row: &mut Vec<f64>, frame: &WorldFrame| {
            if poses == self.quaternions.len() {
                self.quaternions.push([1.0, 0.0, 0.0, 0.0]);
            }
            row.extend(frame.position.iter());
            let last = &mut self.quaternions[poses];
            let mut quaternion = quaternion_of_matrix(&frame.rotation);
            if quaternion.iter().zip(last.iter()).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
                quaternion = quaternion.map(|x| -x);
            }
            *last = quaternion;
            row.extend(quaternion);
            poses += 1;
        };
        row.push(state.time);
        // the loads of a frame start with those of the plan's hinges
        for (&k, load) in plan.hinges.iter().zip(&frame.loads) {
            let (body, load): (_, &Vector6<f64>) = (&system.bodies[k], load);
            row.extend_from_slice(&state.position[body.position_range()]);
            row.extend_from_slice(&state.velocity[body.velocity_range()]);
            row.extend_from_slice(&workspace.acceleration.hinge[body.velocity_range()]);
            row.extend(load.iter());
            pose(row, &hinge_pose(sample, k, &frame.frames));
        }
        // as those of its closures do
        for (&i, record) in plan.closures.iter().zip(&frame.closures) {
            match record.load.coordinate_force() {
                Some(force) => row.push(force),
                None => row.extend(record.load.spatial().iter()),
            }
            if let Some(at) = closure_pose(sample, i, &frame.frames) {
                pose(row, &at);
            }
            row.push(record.residual);
        }
        for &k in &system.definition_order {
            let body = &system.bodies[k];
            pose(row, &frame.frames[k].body_frame(body));
            row.extend_from_slice(&state.modal_position[body.modal_range()]);
            row.extend_from_slice(&state.modal_velocity[body.modal_range()]);
            row.extend_from_slice(&workspace.acceleration.modal[body.modal_range()]);
            if let Some(index) = plan.surfaces.iter().position(|s| s.body == k && s.stress) {
                row.push(frame.stress[index].value);
            }
        }
        row.extend([frame.energy.kinetic, frame.energy.strain, frame.energy.potential, work]);
        row.extend(frame.audit.map(|audit| audit.load));
        debug_assert_eq!(row.len() - start, self.width, "a row has one number per column");
        row.resize(start + self.width, f64::NAN);
        if row.len() < self.width * self.block_rows {
            return true;
        }
        let next = self.written.try_recv().unwrap_or_else(|_| Vec::with_capacity(self.width * self.block_rows));
        let full = std::mem::replace(&mut self.block, next);
        self.block.clear();
        self.sender.send(full).is_ok()
    }

    /// Waits until all rows are in the file and writes how the run ended; returns the number of rows.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self, completed: bool, end_time: f64) -> Result<u64, ResultsError> {
        let Self { path, block, sender, thread, .. } = self;
        drop(sender);
        let ended = thread.join();
        let mut file = ended.unwrap_or_else(|_| Err(ResultsError::Write { file: path, rows: 0, cause: "its thread ended".into() }))?;
        file.append(&block)?;
        file.finish(completed, end_time)
    }
}

fn series_of(channel: &Channel) -> SeriesSpec {
    let owner = escape(&channel.owner);
    let steps = [channel.group, owner.as_str(), channel.quantity];
    let path = steps.into_iter().filter(|step| !step.is_empty()).collect::<Vec<_>>().join("/");
    let mut attributes = vec![("unit", channel.unit.clone())];
    let optional = [("frame", &channel.frame), ("point", &channel.point), ("side", &channel.side), ("components", &channel.components)];
    attributes.extend(optional.into_iter().filter_map(|(name, text)| Some((name, text.clone()?))));
    SeriesSpec { path, width: channel.width, attributes }
}

fn preface(plan: &OutputPlan) -> Preface {
    let modal_file = |record: &super::plan::ModalFileRecord| {
        let attributes = vec![("path", record.path.clone()), ("content_sha256", record.content_sha256.clone())];
        (format!("scene/modal_files/{}", escape(&record.body)), attributes)
    };
    let residual = |record: &super::plan::ModalFileRecord| {
        Some((format!("scene/modal_files/{}/residual_modes", escape(&record.body)), record.residual_modes.clone()?))
    };
    Preface {
        attributes: vec![
            ("format", FORMAT.into()),
            ("version", VERSION.into()),
            ("pliant_version", env!("CARGO_PKG_VERSION").into()),
            ("scene_name", plan.scene_name.clone()),
        ],
        bytes: vec![("scene/toml".into(), plan.scene_text.clone().into_bytes())],
        groups: plan.modal_files.iter().map(modal_file).collect(),
        matrices: plan.modal_files.iter().filter_map(residual).collect(),
    }
}
