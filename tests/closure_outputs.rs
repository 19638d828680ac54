//! Loads of closures over time: results file, peaks, limits and stream, against the evaluation, the closing report and closed solutions.
#![cfg(feature = "hdf5")]

use nalgebra::Vector3;
use pliant::integrate::{Flow, Observer, Sample, Settings, Summary, simulate};
use pliant::output::frame::FrameEvaluator;
use pliant::output::picture::Snapshot;
use pliant::output::{Evaluation, Monitor, OutputPlan, OutputSet, RunReport, scene_plan};
use pliant::scene::error::Source;
use pliant::scene::{Overrides, Scene, assemble};
use pliant::spatial::rotation::matrix_of_quaternion;
use std::error::Error;
use std::f64::consts::PI;
use std::path::Path;
use std::time::Duration;

type Tested = Result<(), Box<dyn Error>>;

/// Beside the four-bar: a motor turns a wheel, which drives another by a cable and a slide by a rack.
const GEARS: &str = r#"
[[body]]
name = "wheel"
mass = 1.0
inertia = [[0.4, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.4]]
[[body]]
name = "drum"
mass = 1.0
inertia = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]
[[body]]
name = "slide"
mass = 8.0
inertia = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]
[[hinge]]
name = "motor"
kind = "revolute"
axis = [0.0, 0.0, 1.0]
parent = "world"
child = "wheel"
torque = { sine = { amplitude = 2.0, frequency_hz = 0.5 } }
[[hinge]]
name = "axle"
kind = "revolute"
axis = [0.0, 0.0, 1.0]
parent = "world"
child = "drum"
[[hinge]]
name = "rail"
kind = "prismatic"
axis = [1.0, 0.0, 0.0]
parent = "world"
child = "slide"
[[closure]]
name = "cable/1"
kind = "gear"
hinge_a = "motor"
hinge_b = "axle"
ratio = -2.0
[[closure]]
name = "rack"
kind = "gear"
hinge_a = "motor"
hinge_b = "rail"
ratio = 0.05
"#;

/// Limits of the four-bar's pin (N) and of the cable (N m).
const PIN_LIMIT: f64 = 20.0;
const CABLE_LIMIT: f64 = 0.3;

fn assembled(more: &str) -> Result<Scene, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/06_four_bar/scene.toml");
    let text = std::fs::read_to_string(&path)? + GEARS + more;
    Ok(assemble::assemble(Source { path, text }, &Overrides::default())?)
}

fn run(scene: &Scene, outputs: &mut OutputSet<'_>) -> Summary {
    let settings = Settings { duration: 1.0, method: scene.method, rate_hz: scene.rate_hz };
    simulate(&scene.system, &scene.state, &settings, &mut [outputs])
}

fn closed(outputs: OutputSet<'_>, summary: &Summary) -> RunReport {
    outputs.finish(summary, "dormand_prince", Duration::from_secs(1), vec![])
}

/// What cable and rack carry at `time`: `J_b r a` and `m r a`, a = T / (J_a + r^2 J_b + r^2 m).
fn gear_forces(time: f64) -> [f64; 2] {
    let acceleration = 2.0 * (PI * time).sin() / (0.4 + 4.0 * 0.1 + 0.05 * 0.05 * 8.0);
    [-2.0 * 0.1 * acceleration, 0.05 * 8.0 * acceleration]
}

fn limits() -> String {
    format!(
        "[[monitor]]\nclosure = \"rocker_pin\"\nforce_limit = {PIN_LIMIT}\n[[monitor]]\nclosure = \"cable/1\"\nmoment_limit = {CABLE_LIMIT}\n"
    )
}

fn text(attribute: &hdf5::Attribute) -> Result<String, hdf5::Error> {
    Ok(attribute.read_scalar::<hdf5::types::FixedUnicode<4096>>()?.as_str().to_owned())
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn histories_start_with_the_evaluation_and_end_with_the_report() -> Tested {
    let scene = assembled("")?;
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("run.h5");
    let mut outputs = OutputSet::new(&scene.system, scene_plan::plan(&scene, false)?)?;
    outputs.write_results(&file)?;
    let summary = run(&scene, &mut outputs);
    let report = closed(outputs, &summary);
    let (start, end) = (Evaluation::of(&scene.system, &scene.state)?, report.end.ok_or("no final record")?);

    let h5 = hdf5::File::open(&file)?;
    let pin = h5.group("closures/rocker_pin")?;
    let (first, last) = (start.closures.get("rocker_pin").ok_or("no pin")?, end.closures.get("rocker_pin").ok_or("no pin")?);
    for (name, unit, at_start, at_end) in
        [("load_moment", "N m", first.load.moment, last.load.moment), ("load_force", "N", first.load.force, last.load.force)]
    {
        let dataset = pin.dataset(name)?;
        let [u, frame, point, side] = ["unit", "frame", "point", "side"].map(|a| dataset.attr(a).and_then(|a| text(&a)));
        assert_eq!((u?.as_str(), point?.as_str(), side?.as_str()), (unit, "origin of frame b", "by coupler on rocker"));
        assert_eq!(frame?, "frame a of closure rocker_pin (on coupler)");
        let rows = dataset.read_2d::<f64>()?;
        assert_eq!(rows.shape(), [61, 3]);
        assert_eq!(rows.row(0).to_vec(), at_start, "the same evaluation");
        for (found, expected) in rows.row(60).iter().zip(at_end) {
            // the end is the interpolant's last point, projected onto the closures
            assert!((found - expected).abs() <= 1e-9 * (1.0 + norm(&at_end)), "{found} {expected}");
        }
    }
    let residual = pin.dataset("residual")?;
    assert_eq!(text(&residual.attr("unit")?)?, "m or rad");
    let residual = residual.read_raw::<f64>()?;
    assert!(residual.len() == 61 && residual[0] == first.residual && residual.iter().all(|r| (0.0..1e-10).contains(r)));

    // the report looks at every step as well
    let forces = pin.dataset("load_force")?.read_2d::<f64>()?;
    let largest = forces.rows().into_iter().map(|r| norm(&r.to_vec())).fold(0.0, f64::max);
    let peak = report.peaks.closures.get("rocker_pin").ok_or("no peak")?;
    assert!(largest <= peak.force * (1.0 + 1e-12) && peak.force < 1.05 * largest, "{} {largest}", peak.force);
    assert!(peak.moment == 0.0 && peak.time_s == peak.force_time_s && peak.time_s > 0.0);
    assert_eq!(report.peaks.closures.iter().map(|(name, _)| name).collect::<Vec<_>>(), ["rocker_pin", "cable/1", "rack"]);
    Ok(())
}

#[test]
fn gears_have_the_force_on_their_coordinate_in_its_unit() -> Tested {
    let scene = assembled("")?;
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("run.h5");
    let mut outputs = OutputSet::new(&scene.system, scene_plan::plan(&scene, false)?)?;
    outputs.write_results(&file)?;
    let summary = run(&scene, &mut outputs);
    let report = closed(outputs, &summary);

    let h5 = hdf5::File::open(&file)?;
    let times = h5.dataset("time")?.read_raw::<f64>()?;
    let gears = [("cable%2F1", "N m", "rad", "axle"), ("rack", "N", "m", "rail")];
    for (i, (name, unit, residual_unit, hinge)) in gears.into_iter().enumerate() {
        let group = h5.group(&format!("closures/{name}"))?;
        assert_eq!(group.len(), 2, "coordinate_force and residual");
        let force = group.dataset("coordinate_force")?;
        assert_eq!(text(&force.attr("unit")?)?, unit);
        assert_eq!(text(&force.attr("side")?)?, format!("by coordinate 1 of motor on coordinate 1 of {hinge}"));
        assert_eq!(text(&group.dataset("residual")?.attr("unit")?)?, residual_unit);
        let force = force.read_raw::<f64>()?;
        assert_eq!((force.len(), group.dataset("residual")?.size()), (61, 61));
        for (found, time) in force.iter().zip(&times) {
            assert!((found - gear_forces(*time)[i]).abs() < 1e-12, "{name} at {time}: {found}");
        }
    }
    let [cable, rack] = ["cable/1", "rack"].map(|name| report.peaks.closures.get(name).copied().unwrap_or_default());
    // the half wave has its top at 0.5 s, which is an output time
    assert!((cable.moment - gear_forces(0.5)[0].abs()).abs() < 1e-12 && cable.force == 0.0, "{cable:?}");
    assert!((rack.force - gear_forces(0.5)[1].abs()).abs() < 1e-12 && rack.moment == 0.0, "{rack:?}");
    assert!((cable.time_s - 0.5).abs() < 1e-3 && (rack.time_s - 0.5).abs() < 1e-3, "{cable:?} {rack:?}");
    Ok(())
}

#[test]
fn limits_of_closures_are_watched() -> Tested {
    let scene = assembled(&limits())?;
    let mut outputs = OutputSet::new(&scene.system, scene_plan::plan(&scene, false)?)?;
    let summary = run(&scene, &mut outputs);
    let report = closed(outputs, &summary);
    let of = |name: &str| report.exceedances.iter().filter(|e| e.name == name).collect::<Vec<_>>();
    let cable = of("cable/1");
    assert_eq!(cable.len(), 1);
    assert_eq!((cable[0].kind, cable[0].quantity, cable[0].unit, cable[0].limit), ("closure", "moment", "N m", CABLE_LIMIT));
    // up to the next output time after the crossing
    let crossing = (CABLE_LIMIT / gear_forces(0.5)[0].abs()).asin() / PI;
    let late = [cable[0].start_s - crossing, cable[0].end_s.ok_or("no end")? - (1.0 - crossing)];
    assert!(late.iter().all(|t| (0.0..1.0 / 60.0 + 1e-9).contains(t)), "{late:?}");
    let pin = of("rocker_pin");
    assert!(!pin.is_empty() && pin.iter().all(|e| e.quantity == "force" && e.unit == "N" && e.peak > PIN_LIMIT), "{pin:?}");
    let peak = report.peaks.closures.get("rocker_pin").ok_or("no peak")?;
    assert_eq!(pin.iter().map(|e| e.peak).fold(0.0, f64::max), peak.force);
    Ok(())
}

#[test]
fn the_scene_chooses_which_closures_are_output() -> Tested {
    let scene = assembled("[output]\nclosures = [\"rack\"]\n[[monitor]]\nclosure = \"cable/1\"\nmoment_limit = 0.3\n")?;
    assert!(scene.left_out.contains(&"loads at 2 of 3 closures".to_owned()), "{:?}", scene.left_out);
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("run.h5");
    let mut outputs = OutputSet::new(&scene.system, scene_plan::plan(&scene, false)?)?;
    outputs.write_results(&file)?;
    let summary = run(&scene, &mut outputs);
    let report = closed(outputs, &summary);
    assert_eq!(hdf5::File::open(&file)?.group("closures")?.member_names()?, ["rack"]);
    let peaks: Vec<_> = report.peaks.closures.iter().map(|(name, _)| name).collect();
    assert_eq!(peaks, ["cable/1", "rack"], "a limit is watched whether or not the load is written");
    // the final record and the error figure are whole
    assert_eq!(report.end.ok_or("no final record")?.closures.0.len(), 3);
    assert!(report.errors.closure.is_some_and(|c| c < 1e-10));
    Ok(())
}

#[test]
fn scenes_without_closures_have_no_group_for_them() -> Tested {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/01_double_pendulum/scene.toml");
    let scene = assemble::load(&path, &Overrides::default())?;
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("run.h5");
    let mut outputs = OutputSet::new(&scene.system, scene_plan::plan(&scene, false)?)?;
    outputs.write_results(&file)?;
    let summary = run(&scene, &mut outputs);
    let report = closed(outputs, &summary);
    assert!(!hdf5::File::open(&file)?.link_exists("closures"));
    assert!(report.peaks.closures.0.is_empty() && report.errors.closure.is_none());
    Ok(())
}

#[test]
fn faults_of_closure_outputs_are_named() -> Tested {
    let refused = |more: &str| assembled(more).err().map(|e| e.to_string()).unwrap_or_default();
    let cases: &[(&str, &[&str])] = &[
        ("[[monitor]]\nclosure = \"pin\"\n", &["monitor[1].closure", "\"pin\" is not a closure of the scene"]),
        ("[[monitor]]\nclosure = \"rocker_pin\"\nforce_limit = -2.0\n", &["monitor[1].force_limit", "-2 must be positive"]),
        (
            "[[monitor]]\nclosure = \"rocker_pin\"\nstress_limit = 2.0\n",
            &["monitor[1]", "hinge = NAME or closure = NAME with moment_limit, force_limit"],
        ),
        ("[[monitor]]\nclosure = \"rocker_pin\"\nhinge = \"motor\"\n", &["monitor[1]", "watches one of"]),
        (
            "[[monitor]]\nclosure = \"cable/1\"\nforce_limit = 2.0\n",
            &["monitor[1].force_limit", "\"cable/1\" is a gear", "coordinate b is in N m; give moment_limit instead"],
        ),
        (
            "[[monitor]]\nclosure = \"rack\"\nmoment_limit = 2.0\n",
            &["monitor[1].moment_limit", "\"rack\" is a gear", "coordinate b is in N; give force_limit instead"],
        ),
        ("[output]\nclosures = [\"rack\", \"pin\"]\n", &["output.closures[2]", "\"pin\" is not a closure of the scene"]),
        ("[output]\nclosures = [\"rack\", \"rack\"]\n", &["output.closures[2]", "\"rack\" is named twice"]),
        ("[output]\nhinges = [\"motor\", \"motor\"]\n", &["output.hinges[2]", "\"motor\" is named twice"]),
    ];
    for (more, expected) in cases {
        let message = refused(more);
        for part in *expected {
            assert!(message.contains(part), "{more}: no \"{part}\" in: {message}");
        }
    }
    let scene = assembled("")?;
    let refused = |plan: OutputPlan| OutputSet::new(&scene.system, plan).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(refused(OutputPlan { closures: vec![9], ..OutputPlan::default() }).contains("closure 9, but the system has 3 closures"));
    let monitors = vec![Monitor::Closure { closure: 0, moment_limit: None, force_limit: Some(-1.0) }];
    assert!(refused(OutputPlan { monitors, ..OutputPlan::default() }).contains("the force limit of closure \"rocker_pin\" is -1"));
    Ok(())
}

/// Snapshots of the four-bar's pin.
struct Snapshots {
    evaluator: FrameEvaluator,
    plan: OutputPlan,
    taken: Vec<(Vec<f64>, Snapshot)>,
}

impl Observer for Snapshots {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        self.evaluator.evaluate(&self.plan, sample);
        let snapshot = Snapshot::of(&[], &self.plan.loaded_closures(), sample, &self.evaluator.frame, &[]);
        self.taken.push((sample.state.position.clone(), snapshot));
        Flow::Continue
    }
}

#[test]
fn arrows_of_a_closure_stand_at_the_point_of_b_in_inertial_axes() -> Tested {
    let scene = assembled("")?;
    let plan = scene_plan::plan(&scene, false)?;
    let mut snapshots = Snapshots { evaluator: FrameEvaluator::new(&scene.system, &plan), plan, taken: Vec::new() };
    let settings = Settings { duration: 0.5, method: scene.method, rate_hz: 20.0 };
    simulate(&scene.system, &scene.state, &settings, &mut [&mut snapshots]);
    let coordinate = |name: &str| scene.system.hinge_index(name).map(|k| scene.system.bodies[k].position).ok_or("no such hinge");
    let (foot, pin, rocker) = (coordinate("crank_foot")?, coordinate("crank_pin")?, coordinate("rocker_foot")?);
    assert_eq!(snapshots.taken.len(), 11);
    for (position, snapshot) in &snapshots.taken {
        let joint = snapshot.closures[0].joint.ok_or("no load")?;
        // the rocker, 1.5 m long, turns about x = 2 m; frame a turns with the coupler
        let (sin, cos) = position[rocker].sin_cos();
        for (found, expected) in joint.point.iter().zip([2.0 + 1.5 * cos, 1.5 * sin, 0.0]) {
            assert!((found - expected).abs() < 1e-12, "{:?}", joint.point);
        }
        let (sin, cos) = (position[foot] + position[pin]).sin_cos();
        let force = [3, 4, 5].map(|i| joint.load[i]);
        let turned = [cos * force[0] - sin * force[1], sin * force[0] + cos * force[1], force[2]];
        for (found, expected) in joint.force_world.iter().zip(turned) {
            assert!((found - expected).abs() < 1e-12 * (1.0 + norm(&force)), "{:?} {turned:?}", joint.force_world);
        }
        assert!(snapshot.closures[1].joint.is_none() && snapshot.closures[1].gear.is_some());
    }
    Ok(())
}

#[test]
fn arrows_of_a_closure_on_a_flexible_body_move_with_it() -> Tested {
    // the scene of the README, its panel held near 0.3 rad by a rod between hub and outboard end
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("README.md"))?;
    let block = |i: usize| readme.split("```toml\n").nth(i).and_then(|block| block.split("```").next());
    let (base, rod) = (block(1).ok_or("no scene")?, block(2).ok_or("no loop")?);
    let source = Source { path: root.join("README.toml"), text: format!("{base}\n{rod}") };
    let scene = assemble::assemble(source, &Overrides::default())?;
    let plan = scene_plan::plan(&scene, false)?;
    let mut snapshots = Snapshots { evaluator: FrameEvaluator::new(&scene.system, &plan), plan, taken: Vec::new() };
    let settings = Settings { duration: 2.0, method: scene.method, rate_hz: 10.0 };
    simulate(&scene.system, &scene.state, &settings, &mut [&mut snapshots]);
    let rod = scene.system.body_index("rod").ok_or("no rod")?;
    let (mut moved, mut carried) = (0.0_f64, 0.0_f64);
    for (_, snapshot) in &snapshots.taken {
        let joint = snapshot.closures[0].joint.ok_or("no load")?;
        let (position, quaternion) = snapshot.poses[rod];
        let end = matrix_of_quaternion(&quaternion) * Vector3::new(0.0, 1.41, 0.61) + Vector3::from(position);
        // b's point, found by way of the panel's modes, is a's as far as the closure is closed
        let apart = (Vector3::from(joint.point) - end).norm();
        assert!(apart < 1e-9, "{apart:e} at {}", snapshot.time);
        moved = snapshot.modal_position.iter().fold(moved, |m, x| m.max(x.abs()));
        carried = carried.max(norm(&joint.force_world));
    }
    assert!(snapshots.taken.len() == 21 && moved > 1e-6 && carried > 1e-3, "{moved} {carried}");
    Ok(())
}

#[cfg(feature = "rerun")]
mod stream {
    use super::*;
    use rerun::external::re_log_types::LogMsg;
    use std::collections::BTreeMap;

    /// Scalars by entity in the order of time, names of series, arrows per entity.
    #[derive(Default)]
    struct Logged {
        scalars: BTreeMap<String, Vec<Vec<f64>>>,
        names: BTreeMap<String, Vec<String>>,
        arrows: BTreeMap<String, usize>,
        legend: String,
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
            let scalars = chunk.iter_component::<rerun::components::Scalar>(rerun::Scalars::descriptor_scalars().component);
            let rows = scalars.map(|row| row.as_slice().iter().map(|s| s.0.0).collect::<Vec<f64>>());
            logged.scalars.entry(entity.clone()).or_default().extend(rows);
            let names = chunk.iter_component::<rerun::components::Name>(rerun::SeriesLines::descriptor_names().component);
            let names = names.flat_map(|row| row.as_slice().iter().map(|t| t.to_string()).collect::<Vec<_>>());
            logged.names.entry(entity.clone()).or_default().extend(names);
            let arrows = chunk.iter_component::<rerun::components::Vector3D>(rerun::Arrows3D::descriptor_vectors().component).count();
            *logged.arrows.entry(entity).or_default() += arrows;
            let texts = chunk.iter_component::<rerun::components::Text>(rerun::TextDocument::descriptor_text().component);
            logged.legend.extend(texts.flat_map(|row| row.as_slice().iter().map(|t| t.to_string()).collect::<Vec<_>>()));
        }
        Ok(logged)
    }

    #[test]
    fn the_stream_has_the_numbers_of_the_file_and_arrows() -> Tested {
        let scene = assembled(&limits())?;
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("run.h5");
        let (recording, store) = rerun::RecordingStreamBuilder::new("test").memory()?;
        let mut outputs = OutputSet::new(&scene.system, scene_plan::plan(&scene, true)?)?;
        outputs.write_results(&file)?;
        let stream = pliant::output::rerun::into_recording(recording.clone(), outputs.plan(), &scene.system, &scene.state)?;
        outputs.add_viewer(stream);
        let summary = run(&scene, &mut outputs);
        let report = closed(outputs, &summary);
        assert!(report.files.iter().all(|f| f.problem.is_none() && f.frames == 61), "{:?}", report.files);
        let logged = read(store.take())?;
        let h5 = hdf5::File::open(&file)?;

        let (series, rows) =
            (&logged.scalars["/closures/rocker_pin/force"], h5.dataset("closures/rocker_pin/load_force")?.read_2d::<f64>()?);
        assert_eq!(series.len(), 61);
        for (values, row) in series.iter().zip(rows.rows()) {
            assert_eq!(values[..3], row.to_vec()[..]);
            assert_eq!(values[4], PIN_LIMIT);
        }
        assert_eq!(logged.names["/closures/rocker_pin/force"][4], "force limit (N)");
        assert_eq!(logged.scalars["/closures/rocker_pin/moment"][0].len(), 4, "no limit, no line for one");

        let (series, rows) = (&logged.scalars["/closures/cable\\/1/coordinate_force"], h5.dataset("closures/cable%2F1/coordinate_force")?);
        for (values, force) in series.iter().zip(rows.read_raw::<f64>()?) {
            assert_eq!(values[..], [force, force.abs(), CABLE_LIMIT]);
        }
        let names = ["coordinate force (N m)", "coordinate force magnitude (N m)", "coordinate force limit (N m)"];
        assert_eq!(logged.names["/closures/cable\\/1/coordinate_force"], names);
        assert_eq!(logged.scalars["/closures/rack/coordinate_force"].len(), 61);
        assert_eq!(logged.scalars["/closures/rack/residual"].len(), 61);
        assert_eq!(logged.names["/closures/rack/residual"], ["residual (m)"]);

        assert_eq!(logged.arrows["/world/closures/rocker_pin/force"], 61);
        assert!(
            !logged.arrows.keys().any(|entity| entity.starts_with("/world/closures/rack")),
            "a gear acts on a coordinate, not at a point"
        );
        assert!(logged.legend.contains("at closures, by a on b"), "{}", logged.legend);
        Ok(())
    }
}
