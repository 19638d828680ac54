//! The Rerun stream: what is logged where, and the layout in which a viewer opens it. The only file that knows the Rerun SDK.
//!
//! Mesh topology, boxes, names and units are logged once as static data; positions and colours follow at output times through partial
//! updates, since static data would hide what is logged later under the same component. The SDK waits for ever if nobody takes its data, so
//! every flush here has a time limit, and a stream that failed is not dropped but left to the end of the process.

use super::picture::{BodyPicture, ClosurePicture, ClosureSnapshot, LoadSnapshot, Picture, Snapshot};
use super::plan::OutputPlan;
use super::scales::{ColourMap, Scales, line_colour};
use super::viewer::{FrameLog, ViewerError, ViewerStream, ViewerTarget, free_port, probe, spawn};
use crate::model::{State, System};
use rerun::blueprint::components::{BackgroundKind, PanelState, PlayState, TextLogColumn};
use rerun::blueprint::datatypes::{self, TextLogColumnKind};
use rerun::blueprint::{
    Blueprint, BlueprintPanel, ContainerLike, Grid, Horizontal, SelectionPanel, Spatial3DView, Tabs, TextDocumentView, TextLogView,
    TimePanel, TimeSeriesView, Vertical,
};
use rerun::external::re_log_types::{BlueprintActivationCommand, EntityPath, EntityPathPart, LogMsg};
use rerun::external::re_sdk_types::blueprint::archetypes::{Background, EyeControls3D, LineGrid3D, PlotLegend, TextLogColumns};
use rerun::sink::SinkFlushError;
use rerun::{AsComponents, RecordingStream, RecordingStreamBuilder, RecordingStreamError, RecordingStreamResult};
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
/// Length of the longest arrow relative to the radius of the scene.
const ARROW: f64 = 0.45;
/// Colours of moments and forces in the 3D view, and of x, y, z, magnitude and limit in plots.
const MOMENT: [u8; 3] = [255, 140, 0];
const FORCE: [u8; 3] = [0, 200, 255];
const SERIES: [[u8; 3]; 5] = [[230, 80, 60], [80, 190, 90], [80, 130, 240], [230, 230, 230], [255, 200, 0]];
/// Background of the 3D view: dark and bright ends of the colour map stand out from it.
const SKY: [u8; 3] = [170, 176, 184];
/// Pa to MPa.
const MEGA: f64 = 1e-6;

/// Opens a stream, or says why there is none.
///
/// # Errors
/// If the file cannot be made, no viewer listens or can be started, or a port is taken.
pub fn open(target: &ViewerTarget, plan: &OutputPlan, system: &System, start: &State) -> Result<ViewerStream, ViewerError> {
    const AGAIN: &str = "start the viewer again, or save a recording instead";
    let builder = RecordingStreamBuilder::new(APPLICATION).recording_name(plan.scene_name.as_str());
    let setup = |e: RecordingStreamError| ViewerError::Setup { cause: e.to_string() };
    let (recording, shown, remedy, end) = match target {
        ViewerTarget::Save(file) => {
            let refused = |e: std::io::Error| ViewerError::Create { file: file.clone(), cause: e.to_string() };
            std::fs::File::create(file).map_err(refused)?;
            let recording = builder.save(file).map_err(setup)?;
            (recording, file.display().to_string(), "look for a full disk", End::File(file.clone()))
        }
        ViewerTarget::Spawn { executable } => {
            let url = spawn(executable.as_deref())?;
            (builder.connect_grpc_opts(url.as_str()).map_err(setup)?, url, AGAIN, End::Viewer)
        }
        ViewerTarget::Connect { url } => {
            let url = probe(url)?;
            (builder.connect_grpc_opts(url.as_str()).map_err(setup)?, url, AGAIN, End::Viewer)
        }
        ViewerTarget::Web { port, grpc_port } => {
            free_port(*port)?;
            free_port(*grpc_port)?;
            let recording = builder.serve_grpc_opts("127.0.0.1", *grpc_port, rerun::ServerOptions::default()).map_err(setup)?;
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
    let log = RerunLog::new(recording, picture, end).map_err(|e| ViewerError::Setup { cause: e.to_string() })?;
    ViewerStream::start(log, target, remedy, plan.loaded_hinges(), plan.loaded_closures())
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
            }
        }
        let residual = rerun::SeriesLines::new().with_names([format!("residual ({})", closure.residual_unit)]);
        rec.log_static(path(&["closures", name, "residual"]), &residual)
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
        self.log_bodies(snapshot, &peaks)?;
        for (hinge, load) in self.picture.hinges.iter().zip(&snapshot.loads) {
            self.log_load(["hinges", "loads"], &hinge.name, [hinge.moment_limit, hinge.force_limit], load)?;
        }
        for (closure, at) in self.picture.closures.iter().zip(&snapshot.closures) {
            self.log_closure(closure, at)?;
        }
        for (warning, text) in &snapshot.events {
            self.log_line(text, if *warning { rerun::TextLogLevel::WARN } else { rerun::TextLogLevel::INFO })?;
        }
        self.begun = true;
        Ok(())
    }

    fn log_bodies(&self, snapshot: &Snapshot, peaks: &[f64]) -> RecordingStreamResult<()> {
        let rec = &self.recording;
        for (k, (body, (position, [w, x, y, z]))) in self.picture.bodies.iter().zip(&snapshot.poses).enumerate() {
            let entity = body_path(&body.name);
            let turn = rerun::Quaternion::from_xyzw([*x, *y, *z, *w].map(|q| q as f32));
            rec.log(entity.clone(), &rerun::Transform3D::from_translation_rotation(single(*position), turn))?;
            if let Some(surface) = &body.surface {
                let mesh = rerun::Mesh3D::update_fields().with_vertex_positions(self.points[k].iter().copied());
                let mesh = if surface.stress {
                    let colour = |value: &f32| self.colours.colour(self.scales.stress.share(f64::from(*value)));
                    mesh.with_vertex_colors(self.values[k].iter().map(colour))
                } else {
                    mesh
                };
                rec.log(below(&entity, "mesh"), &mesh)?;
                if surface.stress {
                    let values = std::iter::once(peaks[k]).chain(surface.stress_limit).map(|pascal| pascal * MEGA);
                    rec.log(path(&["stress", &body.name]), &rerun::Scalars::new(values))?;
                }
            }
            if !body.mode_names.is_empty() {
                let eta = snapshot.modal_position.get(body.modes.clone()).unwrap_or_default();
                rec.log(path(&["modes", &body.name]), &rerun::Scalars::new(eta.iter().copied()))?;
            }
        }
        Ok(())
    }

    fn log_closure(&self, closure: &ClosurePicture, at: &ClosureSnapshot) -> RecordingStreamResult<()> {
        let name = closure.name.as_str();
        if let Some(load) = &at.joint {
            self.log_load(["closures"; 2], name, [closure.moment_limit, closure.force_limit], load)?;
        }
        if let Some(force) = at.gear {
            let values = [force, force.abs()].into_iter().chain(closure.gear_limit());
            self.recording.log(path(&["closures", name, "coordinate_force"]), &rerun::Scalars::new(values))?;
        }
        self.recording.log(path(&["closures", name, "residual"]), &rerun::Scalars::single(at.residual))
    }

    /// Arrows under `world` in the first of `groups`, numbers in the second; `limits` are those of moment and force.
    fn log_load(&self, groups: [&str; 2], name: &str, limits: [Option<f64>; 2], load: &LoadSnapshot) -> RecordingStreamResult<()> {
        let length = ARROW * self.picture.radius;
        let parts = [
            ("moment", load.moment_world, 0, self.scales.moment, MOMENT, limits[0]),
            ("force", load.force_world, 3, self.scales.force, FORCE, limits[1]),
        ];
        for (quantity, vector, row, scale, colour, limit) in parts {
            let arrow = vector.map(|x| (length * scale.share(x)) as f32);
            let arrows = rerun::Arrows3D::from_vectors([arrow])
                .with_origins([single(load.point)])
                .with_colors([colour])
                .with_radii([(0.012 * self.picture.radius) as f32]);
            self.recording.log(path(&["world", groups[0], name, quantity]), &arrows)?;
            let components = load.load.fixed_rows::<3>(row);
            let values = components.iter().copied().chain([components.norm()]).chain(limit);
            self.recording.log(path(&[groups[1], name, quantity]), &rerun::Scalars::new(values))?;
        }
        Ok(())
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

impl FrameLog for RerunLog {
    fn frame(&mut self, snapshot: &Snapshot) -> Result<(), String> {
        self.log_frame(snapshot).map_err(|e| e.to_string())
    }

    fn note(&mut self, time: f64, text: &str) -> Result<(), String> {
        self.recording.set_duration_secs(TIMELINE, time);
        self.log_line(text, rerun::TextLogLevel::ERROR).map_err(|e| e.to_string())
    }

    fn close(self) -> Result<(), String> {
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

/// Most hinges and closures whose plots are all open at once; with more, each has a tab.
const OPEN_PLOTS: usize = 3;

/// A hinge or closure with plots of its load.
struct Plotted<'p> {
    group: &'static str,
    name: &'p str,
    side: &'p str,
    /// Entity, words and unit of each plot.
    quantities: Vec<(&'static str, &'static str, &'static str)>,
}

/// What has plots, two each and in this order; gears, which have one, come last.
fn plotted<'p>(picture: &'p Picture) -> Vec<Plotted<'p>> {
    let spatial = || vec![("moment", "moment", "N m"), ("force", "force", "N")];
    let hinges = picture.hinges.iter().filter(|h| h.carries);
    let hinges = hinges.map(|h| Plotted { group: "loads", name: &h.name, side: &h.side, quantities: spatial() });
    let of_closure = |c: &'p ClosurePicture, quantities| Plotted { group: "closures", name: &c.name, side: &c.side, quantities };
    let joints = picture.closures.iter().filter(|c| c.gear_unit.is_none()).map(|c| of_closure(c, spatial()));
    let gears = picture.closures.iter().filter_map(|c| {
        let unit = c.gear_unit?;
        let words = if unit == "N" { "force" } else { "moment" };
        Some(of_closure(c, vec![("coordinate_force", words, unit)]))
    });
    hinges.chain(joints).chain(gears).collect()
}

/// Properties of views by entity in the blueprint's store: the blueprint builder has none for these kinds of view.
type Properties = Vec<(EntityPath, Box<dyn AsComponents>)>;

/// The layout: the whole system on the left above legend and events, plots of every load, stress and mode on the right.
fn layout(picture: &Picture, properties: &mut Properties) -> Blueprint {
    let mut set = |view: &ContainerLike, name: &str, property: Box<dyn AsComponents>| {
        if let ContainerLike::View(view) = view {
            properties.push((below(&view.blueprint_path(), name), property));
        }
    };
    let space: ContainerLike = Spatial3DView::new(picture.scene.as_str()).with_origin("/world").into();
    let eye =
        EyeControls3D::new().with_position(single(picture.eye)).with_look_target(single(picture.center)).with_eye_up([0.0_f32, 0.0, 1.0]);
    set(&space, "EyeControls3D", Box::new(eye));
    set(&space, "LineGrid3D", Box::new(LineGrid3D::new().with_visible(false)));
    set(&space, "Background", Box::new(Background::new(BackgroundKind::SolidColor).with_color(SKY)));
    let events: ContainerLike = TextLogView::new("events").with_origin("/events").into();
    let columns = [(TextLogColumnKind::LogLevel, true), (TextLogColumnKind::Body, true)];
    let columns = columns.map(|(kind, visible)| TextLogColumn(datatypes::TextLogColumn { kind, visible: visible.into() }));
    set(&events, "TextLogColumns", Box::new(TextLogColumns::new().with_text_log_columns(columns)));
    let legend: ContainerLike = TextDocumentView::new("legend").with_origin("/legend").into();

    let mut plot = |name: String, origin: EntityPath, named: bool| -> ContainerLike {
        let view: ContainerLike = TimeSeriesView::new(name).with_origin(origin).into();
        // the legend of a small plot hides it; names show under the pointer, colours are in the legend
        set(&view, "PlotLegend", Box::new(PlotLegend::new().with_visible(named)));
        view
    };
    let mut loads = Vec::new();
    for Plotted { group, name, side, quantities } in plotted(picture) {
        let of = |(quantity, words, unit): &(&str, &str, &str)| {
            plot(format!("{name}: {words} {side}, {unit}"), path(&[group, name, quantity]), false)
        };
        loads.push((name, quantities.iter().map(of).collect::<Vec<_>>()));
    }
    let count = loads.len();
    let loads: Option<ContainerLike> = match count {
        0 => None,
        1..=OPEN_PLOTS => Some(Grid::new(loads.into_iter().flat_map(|(_, plots)| plots)).with_grid_columns(2).into()),
        _ => Some(Tabs::new(loads.into_iter().map(|(name, plots)| Vertical::new(plots).with_name(name).into())).into()),
    };
    let stressed = picture.bodies.iter().any(|b| b.surface.as_ref().is_some_and(|s| s.stress));
    let stress = stressed.then(|| plot("von Mises peak, MPa".into(), path(&["stress"]), true));
    let modes = picture.bodies.iter().filter(|b| !b.mode_names.is_empty());
    let modes: Vec<_> = modes.map(|b| plot(format!("{}: modal coordinates", b.name), path(&["modes", &b.name]), false)).collect();
    let modes = (!modes.is_empty()).then(|| Tabs::new(modes).into());
    let lower: Vec<ContainerLike> = stress.into_iter().chain(modes).collect();
    let lower = (!lower.is_empty()).then(|| Horizontal::new(lower).into());
    let shares: Vec<f32> = loads.iter().map(|_| count.min(OPEN_PLOTS) as f32).chain(lower.iter().map(|_| 1.0)).collect();
    let right: Vec<ContainerLike> = loads.into_iter().chain(lower).collect();
    let left = Vertical::new([space, Horizontal::new([legend, events]).into()]).with_row_shares(vec![2.6, 1.0]);
    let columns: Vec<ContainerLike> =
        if right.is_empty() { vec![left.into()] } else { vec![left.into(), Vertical::new(right).with_row_shares(shares).into()] };
    let time = TimePanel::new().with_timeline(TIMELINE).with_state(PanelState::Collapsed).with_play_state(PlayState::Following);
    Blueprint::new(Horizontal::new(columns))
        .with_time_panel(time)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Hidden))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
        .with_auto_views(false)
        .with_auto_layout(false)
}

/// Sends the layout with the properties of its views, which are plain data in the blueprint's store.
fn send_blueprint(recording: &RecordingStream, picture: &Picture) -> RecordingStreamResult<()> {
    let mut properties = Properties::new();
    let blueprint = layout(picture, &mut properties);
    let (scratch, store) = RecordingStreamBuilder::new(APPLICATION).memory()?;
    blueprint.send(&scratch, Default::default())?;
    let wanted = |m: &LogMsg| m.store_id().kind() == rerun::StoreKind::Blueprint && !matches!(m, LogMsg::BlueprintActivationCommand(_));
    let mut messages: Vec<LogMsg> = store.take().into_iter().filter(wanted).collect();
    let Some(id) = messages.first().map(|m| m.store_id().clone()) else { return Ok(()) };
    let (extra, store) = RecordingStreamBuilder::from_store_id(&id).memory()?;
    extra.set_time_sequence("blueprint", 0);
    properties.iter().try_for_each(|(entity, property)| extra.log(entity.clone(), property.as_ref()))?;
    messages.extend(store.take().into_iter().filter(|m| matches!(m, LogMsg::ArrowMsg(..))));
    recording.send_blueprint(messages, BlueprintActivationCommand { blueprint_id: id, make_active: true, make_default: true });
    Ok(())
}
