//! What a run writes: results file, viewer stream and report, read back and held against one another.

#![cfg(all(feature = "hdf5", feature = "rerun"))]

use nalgebra::{Matrix3, Vector3};
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Settings, Summary, simulate};
use pliant::io::results_file::{BLOCK_ROWS, Preface, SeriesSpec};
use pliant::io::{ModalFile, ResultsFile};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, FlexibleDefinition, Frame, HingeDefinition, WORLD};
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::{InertiaOrder, State, System, TimeFunction};
use pliant::output::viewer_program::probe;
use pliant::output::{BodyBox, BodySurface, ModalFileRecord, Monitor, OutputPlan, OutputSet, RunReport, ViewerError, ViewerTarget};
use rerun::external::re_log_types::LogMsg;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

type Tested = Result<(), Box<dyn Error>>;

const MOMENT_LIMIT: f64 = 8.0;

/// A free hub with two flexible panels whose drives turn them; the modes are the first six of the file.
fn hub_with_two_panels() -> Result<(System, State, OutputPlan), Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("modes/panel_cantilever.h5");
    let (file, modal) = ModalFile::load_body(&path)?;
    let count = modal.mode_count();
    let names: Vec<String> = (1..=count).map(|i| format!("mode {i}")).collect();
    let surface = Arc::new(file.read_surface(&(0..count).collect::<Vec<_>>())?);
    let (integrals, modal) = (Arc::new(ModalIntegrals::of(&modal)), Arc::new(modal));
    let hub = BodyDefinition {
        name: "hub".into(),
        kind: BodyDefinitionKind::Rigid {
            mass: 420.0,
            center_of_mass: Vector3::new(0.0, 0.0, 0.1),
            inertia: Matrix3::from_diagonal(&Vector3::new(90.0, 80.0, 70.0)),
        },
    };
    let panel = |name: &str| BodyDefinition {
        name: name.into(),
        kind: BodyDefinitionKind::Flexible(FlexibleDefinition {
            modal: Arc::clone(&modal),
            integrals: Arc::clone(&integrals),
            mode_names: names.clone(),
            damping_ratio: vec![0.005; count],
            order: InertiaOrder::Second,
            modal_position: vec![],
            modal_velocity: vec![],
        }),
    };
    let turn = std::f64::consts::FRAC_1_SQRT_2;
    let drive = |name: &str, child: &str, side: f64| HingeDefinition {
        name: name.into(),
        kind: "revolute".into(),
        axes: vec![Vector3::y()],
        parent: "hub".into(),
        parent_frame: Frame { position: Vector3::new(0.0, 0.8 * side, 0.0), quaternion: [turn, 0.0, 0.0, turn * side] },
        child: child.into(),
        child_node: Some("root".into()),
        motion: Some(TimeFunction::SmoothStep { from: vec![0.0], to: vec![-0.8], start: 0.3, end: 2.3 }),
        ..HingeDefinition::default()
    };
    let base = HingeDefinition {
        name: "base".into(),
        kind: "free".into(),
        parent: WORLD.into(),
        child: "hub".into(),
        ..HingeDefinition::default()
    };
    let definition = Definition {
        gravity: Vector3::zeros(),
        bodies: vec![hub, panel("left"), panel("right")],
        hinges: vec![base, drive("left/drive", "left", 1.0), drive("right drive", "right", -1.0)],
        loads: vec![],
        closures: vec![],
    };
    let (system, state) = definition.build()?;
    let index = |name: &str| system.body_index(name).ok_or("no such body");
    let (left, right) = (index("left")?, index("right")?);
    let surface_of = |body| BodySurface { body, surface: Arc::clone(&surface), stress: true };
    let plan = OutputPlan {
        scene_name: "hub with two panels".into(),
        scene_text: "name = \"hub with two panels\"\n# µ\n".into(),
        modal_files: vec![ModalFileRecord {
            body: "left".into(),
            path: "modes/panel_cantilever.h5".into(),
            content_sha256: "ab".repeat(32),
            residual_modes: None,
        }],
        hinges: vec![left, right],
        surfaces: vec![surface_of(left), surface_of(right)],
        boxes: vec![BodyBox { body: index("hub")?, size: [1.2, 1.6, 1.4], center: [0.0, 0.0, 0.1] }],
        monitors: vec![Monitor::Hinge { body: left, moment_limit: Some(MOMENT_LIMIT), force_limit: None }],
        audit: true,
        ..OutputPlan::default()
    };
    Ok((system, state, plan))
}

fn run(system: &System, state: &State, outputs: &mut OutputSet<'_>, duration: f64) -> Summary {
    let tolerance = Tolerance { relative: 1e-7, absolute: 1e-9 };
    let settings = Settings { duration, method: Method::DormandPrince { tolerance, largest_step: 0.05 }, rate_hz: 30.0 };
    simulate(system, state, &settings, &mut [outputs])
}

fn report(outputs: OutputSet<'_>, summary: &Summary) -> RunReport {
    outputs.finish(summary, "dormand-prince 5(4)", Duration::from_secs(1), vec!["closures".into()])
}

/// Logged numbers by entity and time, texts by entity, and the names of the static series.
#[derive(Default)]
struct Logged {
    scalars: BTreeMap<String, Vec<(i64, Vec<f64>)>>,
    texts: BTreeMap<String, Vec<String>>,
    names: BTreeMap<String, Vec<String>>,
    rows: BTreeMap<String, usize>,
    statics: BTreeMap<String, usize>,
    timelines: std::collections::BTreeSet<String>,
    vertices: BTreeMap<String, usize>,
}

fn read(messages: Vec<LogMsg>) -> Result<Logged, Box<dyn Error>> {
    let mut logged = Logged::default();
    for message in messages {
        let LogMsg::ArrowMsg(store, arrow) = message else { continue };
        if store.kind() != rerun::StoreKind::Recording {
            continue;
        }
        let chunk = rerun::log::Chunk::from_arrow_msg(&arrow)?;
        let entity = chunk.entity_path().to_string();
        let count = if chunk.is_static() { &mut logged.statics } else { &mut logged.rows };
        *count.entry(entity.clone()).or_default() += chunk.num_rows();
        logged.timelines.extend(chunk.timelines().keys().map(ToString::to_string));
        let scalars = chunk.iter_component::<rerun::components::Scalar>(rerun::Scalars::descriptor_scalars().component);
        let times = chunk.timelines().values().next().map(|t| t.times_raw().to_vec()).unwrap_or_default();
        for (time, row) in times.iter().zip(scalars) {
            let row = row.as_slice().iter().map(|s| s.0.0).collect();
            logged.scalars.entry(entity.clone()).or_default().push((*time, row));
        }
        let texts = |component| {
            let rows = chunk.iter_component::<rerun::components::Text>(component);
            rows.flat_map(|row| row.as_slice().iter().map(|t| t.to_string()).collect::<Vec<_>>()).collect::<Vec<_>>()
        };
        let found = [texts(rerun::TextLog::descriptor_text().component), texts(rerun::TextDocument::descriptor_text().component)].concat();
        logged.texts.entry(entity.clone()).or_default().extend(found);
        let names = chunk.iter_component::<rerun::components::Name>(rerun::SeriesLines::descriptor_names().component);
        let names = names.flat_map(|row| row.as_slice().iter().map(|t| t.to_string()).collect::<Vec<_>>());
        logged.names.entry(entity.clone()).or_default().extend(names);
        let vertices = chunk
            .iter_component::<rerun::components::Position3D>(rerun::Mesh3D::descriptor_vertex_positions().component)
            .map(|r| r.as_slice().len());
        if let Some(count) = vertices.max() {
            logged.vertices.insert(entity, count);
        }
    }
    Ok(logged)
}

fn text(attribute: &hdf5::Attribute) -> Result<String, hdf5::Error> {
    Ok(attribute.read_scalar::<hdf5::types::FixedUnicode<4096>>()?.as_str().to_owned())
}

#[test]
fn stream_results_and_report_say_the_same() -> Tested {
    let (system, state, plan) = hub_with_two_panels()?;
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("run.h5");
    let (recording, store) = rerun::RecordingStreamBuilder::new("test").memory()?;
    let mut outputs = OutputSet::new(&system, plan)?;
    outputs.write_results(&file)?;
    outputs.add_viewer(pliant::output::rerun::into_recording(recording.clone(), outputs.plan(), &system, &state)?);
    let summary = run(&system, &state, &mut outputs, 2.0);
    let report = report(outputs, &summary);
    assert_eq!(report.outcome.status, "completed");
    assert!(report.files.iter().all(|f| f.problem.is_none() && f.frames == 61), "{:?}", report.files);

    let h5 = hdf5::File::open(&file)?;
    assert_eq!(text(&h5.attr("format")?)?, "pliant-results");
    assert_eq!(text(&h5.attr("version")?)?, "1.0");
    assert_eq!(h5.attr("completed")?.read_scalar::<u8>()?, 1);
    assert_eq!(h5.attr("end_time")?.read_scalar::<f64>()?, 2.0);
    assert_eq!(h5.dataset("scene/toml")?.read_raw::<u8>()?, "name = \"hub with two panels\"\n# µ\n".as_bytes());
    assert_eq!(text(&h5.group("scene/modal_files/left")?.attr("content_sha256")?)?, "ab".repeat(32));
    let times = h5.dataset("time")?.read_raw::<f64>()?;
    assert_eq!(times.len(), 61);
    let moments = h5.dataset("hinges/left%2Fdrive/load_moment")?;
    let texts = ["unit", "frame", "point", "side"].map(|name| moments.attr(name).and_then(|a| text(&a)));
    let [unit, frame, point, side] = texts;
    assert_eq!((unit?.as_str(), point?.as_str(), side?.as_str()), ("N m", "O", "by hub on left"));
    assert_eq!(frame?, "O of hinge left/drive (child side)");
    let moments = moments.read_2d::<f64>()?;
    for name in ["bodies/hub/position", "bodies/left/quaternion", "bodies/left/modal_acceleration", "energy/work", "audit/load_residual"] {
        assert_eq!(h5.dataset(name)?.shape()[0], 61, "{name}");
        assert!(!text(&h5.dataset(name)?.attr("unit")?)?.is_empty(), "{name}");
    }

    let logged = read(store.take())?;
    let series = &logged.scalars["/loads/left\\/drive/moment"];
    assert_eq!(series.len(), 61);
    for (time, values) in series {
        let row = times.iter().position(|t| (t * 1e9 - *time as f64).abs() < 2.0).ok_or("a time of its own")?;
        assert_eq!(values[..3], moments.row(row).to_vec()[..], "the stream has the numbers of the file");
        assert_eq!(values[4], MOMENT_LIMIT);
    }
    let names = &logged.names["/loads/left\\/drive/moment"];
    assert_eq!(names[0], "moment x (N m)");
    assert_eq!(names[4], "moment limit (N m)");
    assert!(logged.names["/modes/left"][0].starts_with("mode 1, 1.818 Hz (m kg^(1/2))"), "{:?}", logged.names["/modes/left"]);
    assert_eq!(logged.timelines.iter().map(String::as_str).collect::<Vec<_>>(), ["sim_time"]);
    assert_eq!(logged.rows["/world/left/mesh"], 61);
    assert_eq!(logged.vertices["/world/left/mesh"], 428);
    assert!(logged.statics.contains_key("/world/left/mesh") && logged.statics.contains_key("/world/hub/box"));
    assert_eq!(logged.rows["/world/hinges/right\\ drive/force"], 61);
    assert!(logged.texts["/legend"].iter().any(|t| t.contains("MPa") && t.contains("viridis")));

    let peak = report.peaks.hinges.get("left/drive").ok_or("no peak")?;
    let largest = moments.rows().into_iter().map(|r| r.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max);
    // the report looks at every step as well: no less than the file, and hardly more at this rate of output
    assert!(largest <= peak.moment * (1.0 + 1e-12) && peak.moment < 1.02 * largest, "{} {largest}", peak.moment);
    assert!(largest > MOMENT_LIMIT && !report.exceedances.is_empty());
    let exceeded: Vec<_> = logged.texts["/events"].iter().filter(|t| t.contains("above its limit")).collect();
    assert_eq!(exceeded.len(), report.exceedances.len());
    let stress = logged.scalars["/stress/left"].iter().map(|(_, s)| s[0]).fold(0.0, f64::max);
    let body = report.peaks.bodies.get("left").ok_or("no stress")?;
    assert!((body.von_mises - stress * 1e6).abs() < 1e-9 * body.von_mises && body.node < 428);
    assert!(report.errors.energy < 1e-5 && report.errors.audit.is_some_and(|a| a < 1e-9), "{:?}", report.errors);
    assert!(report.errors.momentum.is_some_and(|m| m < 1e-6), "{:?}", report.errors);
    Ok(())
}

#[test]
fn report_has_the_keys_of_the_interface() -> Tested {
    let (system, state, plan) = hub_with_two_panels()?;
    let mut outputs = OutputSet::new(&system, plan)?;
    let summary = run(&system, &state, &mut outputs, 0.2);
    let json = serde_json::to_value(report(outputs, &summary))?;
    for key in [
        "simulated_s",
        "wall_s",
        "integrator",
        "steps",
        "rejected_steps",
        "evaluations",
        "errors",
        "peaks",
        "final",
        "left_out",
        "warnings",
        "exceedances",
        "files",
        "outcome",
    ] {
        assert!(json.get(key).is_some(), "{key}");
    }
    for key in ["energy", "momentum", "audit", "closure", "local"] {
        assert!(json["errors"].get(key).is_some(), "{key}");
    }
    assert_eq!(json["final"]["bodies"]["left"]["modal_position"].as_array().map(Vec::len), Some(10));
    assert!(json["peaks"]["bodies"]["right"]["node"].is_u64());
    Ok(())
}

#[test]
fn a_recording_on_disk_is_whole() -> Tested {
    let (system, state, plan) = hub_with_two_panels()?;
    let folder = tempfile::tempdir()?;
    // to look at the picture: PLIANT_RRD=run.rrd, then open it in a viewer
    let file = std::env::var_os("PLIANT_RRD").map_or_else(|| folder.path().join("run.rrd"), PathBuf::from);
    let mut outputs = OutputSet::new(&system, plan)?;
    outputs.write_results(&file.with_extension("h5"))?;
    outputs.open_viewer(&ViewerTarget::Save(file.clone()), &state)?;
    let begin = Instant::now();
    let summary = run(&system, &state, &mut outputs, 2.0);
    let wall = begin.elapsed();
    let report = report(outputs, &summary);
    let viewer = report.files.iter().find(|f| f.kind == "viewer").ok_or("no viewer")?;
    assert!(report.files.iter().all(|f| f.problem.is_none()), "{:?}", report.files);
    println!("{} frames in {wall:?}, {:?} with the flush, {} bytes", viewer.frames, begin.elapsed(), std::fs::metadata(&file)?.len());
    assert_eq!((viewer.frames, &viewer.problem), (61, &None));
    Ok(())
}

#[test]
fn what_cannot_be_written_is_said_and_the_run_goes_on() -> Tested {
    let (system, state, plan) = hub_with_two_panels()?;
    let mut outputs = OutputSet::new(&system, plan)?;
    let missing = outputs.write_results(Path::new("/no/such/folder/run.h5")).err().ok_or("made")?.to_string();
    assert!(missing.contains("/no/such/folder/run.h5") && missing.contains("folder that exists"), "{missing}");
    let device = outputs.write_results(Path::new("/dev/full")).err().ok_or("made")?.to_string();
    assert!(device.contains("not a regular file"), "{device}");
    let missing = outputs.open_viewer(&ViewerTarget::Save("/no/such/folder/run.rrd".into()), &state).err().ok_or("made")?.to_string();
    assert!(missing.contains("/no/such/folder/run.rrd"), "{missing}");

    // a recording on a full disk: the results file is whole all the same
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("run.h5");
    outputs.write_results(&file)?;
    let opened = outputs.open_viewer(&ViewerTarget::Save("/dev/full".into()), &state);
    let summary = run(&system, &state, &mut outputs, 1.0);
    let report = report(outputs, &summary);
    if opened.is_ok() {
        let viewer = report.files.iter().find(|f| f.kind == "viewer").ok_or("no viewer")?;
        assert!(viewer.problem.as_ref().is_some_and(|p| p.contains("full disk")), "{viewer:?}");
    }
    let results = report.files.iter().find(|f| f.kind == "results").ok_or("no results")?;
    assert_eq!((results.frames, &results.problem), (31, &None));
    assert_eq!(hdf5::File::open(&file)?.dataset("time")?.shape(), [31]);
    Ok(())
}

/// What is on disk while the file is still open is what a killed run leaves.
#[test]
fn a_killed_run_leaves_a_readable_file() -> Tested {
    let folder = tempfile::tempdir()?;
    let (file, left) = (folder.path().join("run.h5"), folder.path().join("left.h5"));
    let series = [("time", None), ("a/pair", Some(2))].map(|(path, width)| SeriesSpec { path: path.into(), width, attributes: vec![] });
    let mut results = ResultsFile::create(&file, &Preface::default(), &series)?;
    let rows = |from: usize, to: usize| (from..to).map(|i| i as f64).flat_map(|t| [t, 2.0 * t, 3.0 * t]).collect::<Vec<_>>();
    results.append(&rows(0, BLOCK_ROWS))?;
    std::fs::copy(&file, &left)?;
    let read = hdf5::File::open(&left)?;
    assert_eq!(read.dataset("time")?.shape(), [BLOCK_ROWS]);
    assert_eq!(read.dataset("a/pair")?.read_2d::<f64>()?[(BLOCK_ROWS - 1, 1)], 3.0 * (BLOCK_ROWS - 1) as f64);
    assert!(read.attr("completed").is_err());
    drop(read);
    results.append(&rows(BLOCK_ROWS, BLOCK_ROWS + 7))?;
    assert_eq!(results.finish(false, 70.0)?, BLOCK_ROWS as u64 + 7);
    let whole = hdf5::File::open(&file)?;
    assert_eq!(whole.attr("completed")?.read_scalar::<u8>()?, 0);
    assert_eq!(whole.dataset("a/pair")?.shape(), [BLOCK_ROWS + 7, 2]);
    Ok(())
}

#[test]
fn without_a_viewer_connecting_fails_soon_and_says_what_to_do() -> Tested {
    let (system, state, plan) = hub_with_two_panels()?;
    let mut outputs = OutputSet::new(&system, plan)?;
    // a port that was free a moment ago
    let port = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    let begin = Instant::now();
    let url = format!("rerun+http://127.0.0.1:{port}/proxy");
    let error = outputs.open_viewer(&ViewerTarget::Connect { url: url.clone() }, &state).err().ok_or("connected")?;
    assert!(begin.elapsed() < Duration::from_secs(5));
    assert!(matches!(&error, ViewerError::NoListener { .. }));
    let text = error.to_string();
    assert!(text.contains(&url) && text.contains("0.36.3") && text.contains("pip install"), "{text}");
    assert!(matches!(probe("rerun+http://"), Err(ViewerError::Address { .. })));
    let executable = Some(PathBuf::from("/no/such/rerun"));
    let text = outputs.open_viewer(&ViewerTarget::Spawn { executable }, &state).err().ok_or("spawned")?.to_string();
    assert!(text.contains("/no/such/rerun") && text.contains("pip install"), "{text}");
    Ok(())
}

#[test]
fn a_plan_that_does_not_fit_is_refused() -> Tested {
    let (system, _, plan) = hub_with_two_panels()?;
    let refused = |plan: OutputPlan| OutputSet::new(&system, plan).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(refused(OutputPlan { hinges: vec![9], ..plan.clone() }).contains("3 bodies"));
    assert!(
        refused(OutputPlan { surfaces: vec![], monitors: vec![Monitor::Body { body: 1, stress_limit: Some(1.0) }], ..plan.clone() })
            .contains("no surface")
    );
    assert!(
        refused(OutputPlan { monitors: vec![Monitor::Hinge { body: 1, moment_limit: Some(-1.0), force_limit: None }], ..plan.clone() })
            .contains("-1")
    );
    let mut surfaces = plan.surfaces.clone();
    surfaces[0].body = 0;
    assert!(refused(OutputPlan { surfaces, ..plan }).contains("retains 0"));
    Ok(())
}
