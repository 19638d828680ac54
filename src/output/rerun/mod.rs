//! The Rerun stream: what is logged where, and the layout in which a viewer opens it. The only folder that knows the Rerun SDK.
//!
//! Mesh topology, boxes, names and units are logged once as static data; positions and colours follow at output times through partial
//! updates, since static data would hide what is logged later under the same component. Output times are gathered into columns, for at
//! most as long as nobody notices. The SDK waits for ever if nobody takes its data, so every flush here has a time limit, and a stream that
//! failed is not dropped but left to the end of the process.

mod columns;
mod layout;

use super::background::in_background;
use super::picture::{BodyPicture, ClosurePicture, ClosureSnapshot, LoadSnapshot, Picture, Snapshot};
use super::plan::OutputPlan;
use super::scales::{ColourMap, Scales, line_colour};
use super::viewer::{FrameLog, ViewerError, ViewerStream, ViewerTarget};
use super::viewer_program::{free_port, probe, spawn};
use crate::model::{State, System};
use columns::Columns;
use layout::send_blueprint;
use rerun::external::re_log_types::{EntityPath, EntityPathPart};
use rerun::sink::SinkFlushError;
use rerun::{RecordingStream, RecordingStreamBuilder, RecordingStreamError, RecordingStreamResult};
use std::path::Path;
use std::time::{Duration, Instant};

/// Name under which viewers keep the layout.
const APPLICATION: &str = "pliant";
/// Timeline of simulated time (s).
pub const TIMELINE: &str = "sim_time";
/// How long a flush may take (s).
const FLUSH: Duration = Duration::from_secs(20);
/// How long a file may stand still while it is flushed (s).
const STALLED: Duration = Duration::from_secs(3);
/// How long output times are held back to be passed on together: one picture of a screen where somebody may be watching.
const HELD_FOR_EYES: Duration = Duration::from_millis(16);
const HELD_FOR_FILE: Duration = Duration::from_millis(250);
/// Length of the longest arrow relative to the radius of the scene.
const ARROW: f64 = 0.45;
/// Colours of moments and forces in the 3D view, and of x, y, z, magnitude and limit in plots.
const MOMENT: [u8; 3] = [255, 140, 0];
const FORCE: [u8; 3] = [0, 200, 255];
const SERIES: [[u8; 3]; 5] = [[230, 80, 60], [80, 190, 90], [80, 130, 240], [230, 230, 230], [255, 200, 0]];
/// Pa to MPa.
const MEGA: f64 = 1e-6;

/// Opens a stream, or says why there is none.
///
/// # Errors
/// If the file cannot be made, no viewer listens or can be started, or a port is taken.
pub fn open(target: &ViewerTarget, plan: &OutputPlan, system: &System, start: &State) -> Result<ViewerStream, ViewerError> {
    const AGAIN: &str = "start the viewer again, or save a recording instead";
    let builder = RecordingStreamBuilder::new(APPLICATION).recording_name(plan.scene_name.as_str());
    let (recording, shown, remedy, end) = match target {
        ViewerTarget::Save(file) => {
            let refused = |e: std::io::Error| ViewerError::Create { file: file.clone(), cause: e.to_string() };
            std::fs::File::create(file).map_err(refused)?;
            let recording = made(|| builder.save(file))?;
            (recording, file.display().to_string(), "look for a full disk", End::File(file.clone()))
        }
        ViewerTarget::Spawn { executable } => {
            let url = spawn(executable.as_deref())?;
            (made(|| builder.connect_grpc_opts(url.as_str()))?, url, AGAIN, End::Viewer)
        }
        ViewerTarget::Connect { url } => {
            let url = probe(url)?;
            (made(|| builder.connect_grpc_opts(url.as_str()))?, url, AGAIN, End::Viewer)
        }
        ViewerTarget::Web { port, grpc_port } => {
            free_port(*port)?;
            free_port(*grpc_port)?;
            let recording = made(|| builder.serve_grpc_opts("127.0.0.1", *grpc_port, rerun::ServerOptions::default()))?;
            let data = format!("rerun+http://127.0.0.1:{grpc_port}/proxy");
            let config = rerun::web_viewer::WebViewerConfig {
                bind_ip: "127.0.0.1".into(),
                web_port: (*port).into(),
                connect_to: vec![data],
                open_browser: false,
                ..Default::default()
            };
            let page = rerun::serve_web_viewer(config).map_err(|e| ViewerError::Port { port: *port, cause: e.to_string() })?;
            page.detach();
            let url = format!("http://127.0.0.1:{port}/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{grpc_port}%2Fproxy");
            (recording, url, AGAIN, End::Server)
        }
    };
    stream(recording, shown, remedy, end, plan, system, start)
}

/// What `work` makes, with the threads that it starts behind the solver's.
fn made(work: impl FnOnce() -> RecordingStreamResult<RecordingStream> + Send) -> Result<RecordingStream, ViewerError> {
    let setup = |e: RecordingStreamError| ViewerError::Setup { cause: e.to_string() };
    in_background(work).ok_or_else(|| ViewerError::Setup { cause: "no thread can be started".into() })?.map_err(setup)
}

/// A stream into a recording that the caller made.
///
/// # Errors
/// If the first messages cannot be logged.
pub fn into_recording(recording: RecordingStream, plan: &OutputPlan, system: &System, start: &State) -> Result<ViewerStream, ViewerError> {
    stream(recording, "recording".into(), "look at the recording's sink", End::Viewer, plan, system, start)
}

fn stream(
    recording: RecordingStream,
    target: String,
    remedy: &'static str,
    end: End,
    plan: &OutputPlan,
    system: &System,
    start: &State,
) -> Result<ViewerStream, ViewerError> {
    recording.set_log_time_enabled(false);
    recording.set_log_tick_enabled(false);
    let picture = Picture::new(system, plan, start);
    let bytes = picture.snapshot_bytes();
    let log = RerunLog::new(recording, picture, end).map_err(|e| ViewerError::Setup { cause: e.to_string() })?;
    ViewerStream::start(log, target, remedy, plan.loaded_hinges(), plan.loaded_closures(), bytes)
}

/// What the end of a stream has to see to.
#[derive(Debug)]
enum End {
    File(std::path::PathBuf),
    Viewer,
    Server,
}

fn path(parts: &[&str]) -> EntityPath {
    EntityPath::new(parts.iter().map(|part| EntityPathPart::new(*part)).collect())
}

/// Entity of a body; `hinges` and `closures` under `world` are taken.
fn body_path(name: &str) -> EntityPath {
    match name {
        "hinges" => path(&["world", "hinges (body)"]),
        "closures" => path(&["world", "closures (body)"]),
        _ => path(&["world", name]),
    }
}

/// Names of the lines of a load, with colours.
fn load_series(quantity: &str, unit: &str, limit: Option<f64>) -> rerun::SeriesLines {
    let count = 4 + usize::from(limit.is_some());
    let names = ["x", "y", "z", "magnitude", "limit"].iter().take(count).map(|part| format!("{quantity} {part} ({unit})"));
    rerun::SeriesLines::new().with_names(names).with_colors(SERIES.into_iter().take(count))
}

fn below(parent: &EntityPath, part: &str) -> EntityPath {
    parent.join(&path(&[part]))
}

fn single(x: [f64; 3]) -> [f32; 3] {
    x.map(|x| x as f32)
}

struct RerunLog {
    recording: RecordingStream,
    picture: Picture,
    end: End,
    colours: ColourMap,
    points: Vec<Vec<[f32; 3]>>,
    values: Vec<Vec<f32>>,
    scales: Scales,
    columns: Columns,
    begun: bool,
}

impl RerunLog {
    fn new(recording: RecordingStream, picture: Picture, end: End) -> RecordingStreamResult<Self> {
        let room = |body: &BodyPicture| body.surface.as_ref().map_or(0, |s| s.surface.points.len());
        let log = Self {
            points: picture.bodies.iter().map(|b| vec![[0.0; 3]; room(b)]).collect(),
            values: picture.bodies.iter().map(|b| vec![0.0; room(b)]).collect(),
            colours: ColourMap::default(),
            scales: Scales::new(&picture),
            columns: Columns::default(),
            begun: false,
            recording,
            picture,
            end,
        };
        send_blueprint(&log.recording, &log.picture)?;
        log.log_static()?;
        Ok(log)
    }

    /// What never changes: axes, topology, boxes, names and units.
    fn log_static(&self) -> RecordingStreamResult<()> {
        let rec = &self.recording;
        rec.log_static("world", &rerun::ViewCoordinates::RIGHT_HAND_Z_UP())?;
        for body in &self.picture.bodies {
            let entity = body_path(&body.name);
            if let Some(shape) = &body.shape {
                let [w, x, y, z] = shape.quaternion.map(|q| q as f32);
                let boxes = rerun::Boxes3D::from_centers_and_half_sizes([shape.center], [shape.half_size])
                    .with_quaternions([rerun::Quaternion::from_xyzw([x, y, z, w])])
                    .with_fill_mode(rerun::FillMode::TransparentFillMajorWireframe)
                    .with_colors([[60_u8, 66, 78]]);
                rec.log_static(below(&entity, "box"), &boxes)?;
            }
            if let Some(surface) = &body.surface {
                let mesh = rerun::Mesh3D::update_fields().with_triangle_indices(surface.surface.triangles.iter().copied());
                let mesh = if surface.stress { mesh } else { mesh.with_albedo_factor([90_u8, 120, 170, 255]) };
                rec.log_static(below(&entity, "mesh"), &mesh)?;
                if surface.stress {
                    let names = ["von Mises peak (MPa)", "limit (MPa)"];
                    let count = 1 + usize::from(surface.stress_limit.is_some());
                    let names = names[..count].iter().map(|name| format!("{}: {name}", body.name));
                    rec.log_static(path(&["stress", &body.name]), &rerun::SeriesLines::new().with_names(names))?;
                }
            }
            if !body.mode_names.is_empty() {
                let series = rerun::SeriesLines::new().with_names(body.mode_names.iter().map(String::as_str));
                let series = series.with_colors((0..body.mode_names.len()).map(line_colour));
                rec.log_static(path(&["modes", &body.name]), &series)?;
            }
        }
        for hinge in &self.picture.hinges {
            for (quantity, unit, limit) in [("moment", "N m", hinge.moment_limit), ("force", "N", hinge.force_limit)] {
                rec.log_static(path(&["loads", &hinge.name, quantity]), &load_series(quantity, unit, limit))?;
            }
            self.log_static_arrows("hinges", &hinge.name)?;
        }
        self.picture.closures.iter().try_for_each(|closure| self.log_static_closure(closure))
    }

    fn log_static_closure(&self, closure: &ClosurePicture) -> RecordingStreamResult<()> {
        let (rec, name) = (&self.recording, closure.name.as_str());
        match closure.gear_unit {
            Some(unit) => {
                let count = 2 + usize::from(closure.gear_limit().is_some());
                let names = ["", " magnitude", " limit"].iter().take(count).map(|part| format!("coordinate force{part} ({unit})"));
                let series = rerun::SeriesLines::new().with_names(names).with_colors(SERIES.into_iter().skip(2).take(count));
                rec.log_static(path(&["closures", name, "coordinate_force"]), &series)?;
            }
            None => {
                for (quantity, unit, limit) in [("moment", "N m", closure.moment_limit), ("force", "N", closure.force_limit)] {
                    rec.log_static(path(&["closures", name, quantity]), &load_series(quantity, unit, limit))?;
                }
                self.log_static_arrows("closures", name)?;
            }
        }
        let residual = rerun::SeriesLines::new().with_names([format!("residual ({})", closure.residual_unit)]);
        rec.log_static(path(&["closures", name, "residual"]), &residual)
    }

    /// Colours and radii of the arrows of a load.
    fn log_static_arrows(&self, group: &str, name: &str) -> RecordingStreamResult<()> {
        let radius = (0.012 * self.picture.radius) as f32;
        [("moment", MOMENT), ("force", FORCE)].into_iter().try_for_each(|(quantity, colour)| {
            let arrows = rerun::Arrows3D::update_fields().with_colors([colour]).with_radii([radius]);
            self.recording.log_static(path(&["world", group, name, quantity]), &arrows)
        })
    }

    fn log_frame(&mut self, snapshot: &Snapshot) -> RecordingStreamResult<()> {
        self.recording.set_duration_secs(TIMELINE, snapshot.time);
        let mut rescaled = !self.begun;
        let mut peaks = vec![0.0; self.picture.bodies.len()];
        for (k, body) in self.picture.bodies.iter().enumerate() {
            let Some(surface) = &body.surface else { continue };
            let eta = snapshot.modal_position.get(body.modes.clone()).unwrap_or_default();
            surface.surface.deform(eta, self.picture.deformation_scale, &mut self.points[k]);
            if surface.stress {
                peaks[k] = surface.surface.point_stress(eta, &mut self.values[k]).value;
                rescaled |= self.scales.stress.cover(peaks[k]);
            }
        }
        for load in snapshot.loads.iter().chain(snapshot.closures.iter().filter_map(|c| c.joint.as_ref())) {
            rescaled |= self.scales.moment.cover(load.load.fixed_rows::<3>(0).norm());
            rescaled |= self.scales.force.cover(load.load.fixed_rows::<3>(3).norm());
        }
        if rescaled {
            self.log_legend()?;
        }
        self.columns.begin(snapshot.time);
        self.gather_bodies(snapshot, &peaks);
        let Self { picture, columns, scales, .. } = self;
        let drawing = Drawing { length: ARROW * picture.radius, scales };
        for (hinge, load) in picture.hinges.iter().zip(&snapshot.loads) {
            drawing.gather_load(columns, ["hinges", "loads"], &hinge.name, [hinge.moment_limit, hinge.force_limit], load);
        }
        for (closure, at) in picture.closures.iter().zip(&snapshot.closures) {
            drawing.gather_closure(columns, closure, at);
        }
        for (warning, text) in &snapshot.events {
            self.log_line(text, if *warning { rerun::TextLogLevel::WARN } else { rerun::TextLogLevel::INFO })?;
        }
        self.begun = true;
        if self.columns.is_full() { self.columns.send(&self.recording) } else { Ok(()) }
    }

    fn gather_bodies(&mut self, snapshot: &Snapshot, peaks: &[f64]) {
        let Self { picture, columns, colours, scales, .. } = self;
        for (k, (body, (position, [w, x, y, z]))) in picture.bodies.iter().zip(&snapshot.poses).enumerate() {
            let turn = rerun::Quaternion::from_xyzw([*x, *y, *z, *w].map(|q| q as f32));
            columns.pose(|| body_path(&body.name), single(*position), turn);
            if let Some(surface) = &body.surface {
                // no values, no colours: a surface without stress has one colour
                let values = if surface.stress { &self.values[k][..] } else { &[] };
                let colour = |value: &f32| colours.colour(scales.stress.share(f64::from(*value)));
                columns.surface(|| below(&body_path(&body.name), "mesh"), &self.points[k], values.iter().map(colour));
                if surface.stress {
                    let values = std::iter::once(peaks[k]).chain(surface.stress_limit).map(|pascal| pascal * MEGA);
                    columns.numbers(|| path(&["stress", &body.name]), values);
                }
            }
            if !body.mode_names.is_empty() {
                let eta = snapshot.modal_position.get(body.modes.clone()).unwrap_or_default();
                columns.numbers(|| path(&["modes", &body.name]), eta.iter().copied());
            }
        }
    }

    /// The ranges in use, as a document that a view shows and as a log line.
    fn log_legend(&self) -> RecordingStreamResult<()> {
        self.recording.log("legend", &rerun::TextDocument::from_markdown(self.scales.legend(&self.picture)))?;
        self.log_line(&self.scales.line(), rerun::TextLogLevel::INFO)
    }

    fn log_line(&self, text: &str, level: &str) -> RecordingStreamResult<()> {
        self.recording.log("events", &rerun::TextLog::new(text).with_level(level))
    }
}

/// How loads are drawn at one time.
struct Drawing<'d> {
    /// Of the longest arrow (m).
    length: f64,
    scales: &'d Scales,
}

impl Drawing<'_> {
    fn gather_closure(&self, columns: &mut Columns, closure: &ClosurePicture, at: &ClosureSnapshot) {
        let name = closure.name.as_str();
        if let Some(load) = &at.joint {
            self.gather_load(columns, ["closures"; 2], name, [closure.moment_limit, closure.force_limit], load);
        }
        if let Some(force) = at.gear {
            let values = [force, force.abs()].into_iter().chain(closure.gear_limit());
            columns.numbers(|| path(&["closures", name, "coordinate_force"]), values);
        }
        columns.numbers(|| path(&["closures", name, "residual"]), [at.residual]);
    }

    /// Arrows under `world` in the first of `groups`, numbers in the second; `limits` are those of moment and force.
    fn gather_load(&self, columns: &mut Columns, groups: [&str; 2], name: &str, limits: [Option<f64>; 2], load: &LoadSnapshot) {
        let parts =
            [("moment", load.moment_world, 0, self.scales.moment, limits[0]), ("force", load.force_world, 3, self.scales.force, limits[1])];
        for (quantity, vector, row, scale, limit) in parts {
            let arrow = vector.map(|x| (self.length * scale.share(x)) as f32);
            columns.arrow(|| path(&["world", groups[0], name, quantity]), single(load.point), arrow);
            let components = load.load.fixed_rows::<3>(row);
            let values = components.iter().copied().chain([components.norm()]).chain(limit);
            columns.numbers(|| path(&[groups[1], name, quantity]), values);
        }
    }
}

impl FrameLog for RerunLog {
    fn frame(&mut self, snapshot: &Snapshot) -> Result<(), String> {
        self.log_frame(snapshot).map_err(|e| e.to_string())
    }

    fn note(&mut self, time: f64, text: &str) -> Result<(), String> {
        self.recording.set_duration_secs(TIMELINE, time);
        self.log_line(text, rerun::TextLogLevel::ERROR).map_err(|e| e.to_string())
    }

    fn patience(&self) -> Duration {
        if matches!(self.end, End::File(_)) { HELD_FOR_FILE } else { HELD_FOR_EYES }
    }

    fn flush(&mut self) -> Result<(), String> {
        self.columns.send(&self.recording).map_err(|e| e.to_string())
    }

    fn close(mut self) -> Result<(), String> {
        self.flush()?;
        let Self { recording, end, .. } = self;
        let flushed = match &end {
            End::File(file) => flush_to_disk(&recording, file),
            End::Viewer | End::Server => recording.flush_with_timeout(FLUSH),
        };
        if let Err(error) = flushed {
            // dropping would wait for a viewer that is gone
            std::mem::forget(recording);
            return Err(error.to_string());
        }
        match end {
            // the page and its data last as long as the process
            End::Server => std::mem::forget(recording),
            End::Viewer => drop(recording),
            End::File(file) => {
                drop(recording);
                if !ends_in_footer(&file) {
                    return Err("the file has no end".into());
                }
            }
        }
        Ok(())
    }
}

/// Flushes for as long as the file grows: on a full disk the SDK's writer is gone, and the flush would only end with its time limit.
fn flush_to_disk(recording: &RecordingStream, file: &Path) -> Result<(), SinkFlushError> {
    let length = || std::fs::metadata(file).map_or(0, |m| m.len());
    let begin = Instant::now();
    loop {
        let before = length();
        let flushed = recording.flush_with_timeout(STALLED);
        if flushed.is_ok() || length() == before || begin.elapsed() > FLUSH {
            return flushed;
        }
    }
}

/// True if the last bytes of a recording are its footer, which is written when it is closed.
fn ends_in_footer(file: &Path) -> bool {
    use std::io::{Read, Seek, SeekFrom};
    let mut tail = Vec::new();
    let read = std::fs::File::open(file).and_then(|mut f| {
        let length = f.metadata()?.len();
        f.seek(SeekFrom::Start(length.saturating_sub(64)))?;
        f.read_to_end(&mut tail)
    });
    read.is_ok() && tail.windows(4).any(|word| word == b"FOOT")
}
