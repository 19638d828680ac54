//! `pliant sweep` and `pliant merge`: one result for any number of threads, shards and ends; numbers of `pliant run`; what is refused.
#![cfg(feature = "hdf5")]

use nalgebra::Vector6;
use pliant::campaign::{Campaign, Plan};
use pliant::dynamics::hinge_load::hinge_load;
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use pliant::scene::{Overrides, assemble};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn example(name: &str) -> String {
    root().join("examples").join(name).join("scene.toml").display().to_string()
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).env("HDF5_USE_FILE_LOCKING", "FALSE");
    command
}

fn pliant(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The JSON report of a command that must end with `code`.
fn report(code: i32, arguments: &[&str]) -> Value {
    let done = pliant(&[arguments, &["--json"]].concat());
    assert_eq!(done.status.code(), Some(code), "{arguments:?}: {}", text(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

/// What a command that is refused says; it must leave no results.
fn refused(arguments: &[&str]) -> String {
    let done = pliant(arguments);
    assert_eq!(done.status.code(), Some(2), "{arguments:?}: {}{}", text(&done.stdout), text(&done.stderr));
    text(&done.stderr)
}

/// A folder with a pendulum of two rods and a plan over it.
struct Folder {
    folder: tempfile::TempDir,
}

const PLAN: &str = r#"
seed = 5
samples = 6
[[parameter]]
key = "hinge.elbow.damping"
uniform = { min = 0.0, max = 0.1 }
[[parameter]]
key = "hinge.shoulder.position[1]"
grid = [0.0, 0.5]
[[parameter]]
key = "simulation.integrator"
choice = ["dormand_prince", "rosenbrock_w"]
"#;

impl Folder {
    fn new(plan: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(example("01_double_pendulum"), folder.path().join("scene.toml")).unwrap();
        fs::write(folder.path().join("plan.toml"), plan).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    /// Arguments of a sweep of `plan` to `out`.
    fn sweep(&self, plan: &str, out: &str, more: &[&str]) -> Vec<String> {
        let arguments = ["sweep".to_owned(), self.path("scene.toml"), self.path(plan), "--out".to_owned(), self.path(out)];
        arguments.into_iter().chain(more.iter().map(|a| (*a).to_owned())).collect()
    }

    fn run(&self, code: i32, plan: &str, out: &str, more: &[&str]) -> Value {
        let arguments = self.sweep(plan, out, more);
        report(code, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
    }

    fn refused(&self, plan: &str, more: &[&str]) -> String {
        let arguments = self.sweep(plan, "refused.h5", more);
        let message = refused(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(!Path::new(&self.path("refused.h5")).exists());
        message
    }

    /// Holds two files against each other byte by byte.
    fn assert_same(&self, found: &str, expected: &str) {
        let [found, expected] = [found, expected].map(|name| fs::read(self.path(name)).unwrap());
        let first = found.iter().zip(&expected).position(|(a, b)| a != b);
        assert!(found == expected, "the first difference is at {first:?}; {} and {} bytes", found.len(), expected.len());
    }
}

fn shards(folder: &Folder, out: &str, count: usize) -> Vec<String> {
    (1..=count).map(|i| folder.path(&format!("{out}.{i}-of-{count}.state.jsonl"))).collect()
}

#[test]
fn threads_and_shards_do_not_change_a_byte() {
    // flexible bodies from two files, six parameters
    let folder = Folder::new("");
    let plan = fs::read_to_string(root().join("examples/12_campaign/plan.toml")).unwrap().replace("samples = 40 ", "samples = 3 ");
    let plan = folder.write("panels.toml", &plan);
    let scene = example("12_campaign");
    let sweep = |out: &str, more: &[&str]| {
        let out = folder.path(out);
        report(0, &[&["sweep", &scene, &plan, "--duration", "0.5", "--out", &out], more].concat())
    };
    let one = sweep("one.h5", &["--threads", "1"]);
    let two = sweep("two.h5", &["--threads", "2"]);
    folder.assert_same("two.h5", "one.h5");
    assert_eq!((one["cases"].as_u64(), one["completed"].as_u64(), one["resumed"].as_u64()), (Some(9), Some(9), Some(0)));
    assert_eq!(one["hinges"], two["hinges"]);
    for index in 1..=4 {
        let shard = sweep("parts.h5", &["--shard", &format!("{index}/4"), "--threads", "2"]);
        assert_eq!(shard["completed"].as_u64(), Some(if index == 1 { 3 } else { 2 }));
    }
    assert!(!Path::new(&folder.path("parts.h5")).exists());
    let parts = shards(&folder, "parts", 4);
    let merged = folder.path("parts.h5");
    let order: Vec<&str> = [2, 0, 3, 1].iter().map(|&i| parts[i].as_str()).collect();
    let merged_report = report(0, &[&["merge", "--out", &merged], &order[..]].concat());
    folder.assert_same("parts.h5", "one.h5");
    assert_eq!(merged_report["hinges"], one["hinges"]);
}

/// Waits until a state file holds some cases and kills the process without warning.
fn kill_after(child: &mut Child, state: &str, cases: usize) {
    let started = Instant::now();
    while fs::read_to_string(state).map_or(0, |text| text.matches('\n').count()) < 1 + cases {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was killed");
        assert!(started.elapsed() < Duration::from_secs(60), "no case in {state}");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_campaign_that_was_killed_goes_on_to_the_same_bytes() {
    // long enough a case for a process to be killed in the middle: 5 s of a stiff tolerance
    let folder = Folder::new(&PLAN.replace("choice = [\"dormand_prince\", \"rosenbrock_w\"]", "choice = [\"dormand_prince\"]"));
    let slow = ["--duration", "40", "--threads", "1"];
    let arguments = folder.sweep("plan.toml", "killed.h5", &slow);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let state = folder.path("killed.state.jsonl");
    for cases in [1, 3] {
        kill_after(&mut command(&arguments).spawn().unwrap(), &state, cases);
        assert!(!Path::new(&folder.path("killed.h5")).exists());
    }
    // as a write that the end of the machine cut short leaves it
    let cut = fs::read(&state).unwrap();
    fs::write(&state, [&cut[..], b"{\"case\":9,\"values\":[0.0"].concat()).unwrap();
    let resumed = folder.run(0, "plan.toml", "killed.h5", &["--duration", "40", "--threads", "2"]);
    let there = resumed["resumed"].as_u64().unwrap();
    assert!((3..12).contains(&there), "{there}");
    assert!(!Path::new(&state).exists(), "the state is in the results");
    folder.run(0, "plan.toml", "straight.h5", &slow);
    folder.assert_same("killed.h5", "straight.h5");
    // a shard goes on as well
    let arguments = folder.sweep("plan.toml", "shard.h5", &[&slow[..], &["--shard", "1/2"]].concat());
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    kill_after(&mut command(&arguments).spawn().unwrap(), &folder.path("shard.1-of-2.state.jsonl"), 1);
    let parts = shards(&folder, "shard", 2);
    let merged = folder.path("shard.h5");
    let message = refused(&["merge", &parts[0], "--out", &merged]);
    assert!(message.contains("of 6 cases are missing") && message.contains("run shard 1/2 again"), "{message}");
    assert!(message.contains("no file is of shard 2/2"), "{message}");
    for shard in ["1/2", "2/2"] {
        folder.run(0, "plan.toml", "shard.h5", &[&slow[..], &["--shard", shard]].concat());
    }
    report(0, &["merge", &parts[0], &parts[1], "--out", &merged]);
    folder.assert_same("shard.h5", "straight.h5");
}

/// Every load of every hinge at all steps and output times.
#[derive(Default)]
struct All(Vec<(f64, Vec<Vector6<f64>>)>);

impl All {
    fn add(&mut self, sample: &Sample<'_>) -> Flow {
        let loads = (0..sample.system.bodies.len()).map(|k| hinge_load(sample.workspace, k)).collect();
        self.0.push((sample.state.time, loads));
        Flow::Continue
    }
}

impl Observer for All {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        self.add(sample)
    }

    fn step(&mut self, step: &Sample<'_>) -> Flow {
        self.add(step)
    }
}

fn numbers(file: &hdf5::File, path: &str) -> Vec<f64> {
    file.dataset(path).unwrap().read_raw::<f64>().unwrap()
}

#[test]
fn the_file_holds_the_extremes_of_every_case_and_their_envelope() {
    let folder = Folder::new(PLAN);
    let csv = folder.path("envelope.csv");
    let found = folder.run(0, "plan.toml", "out.h5", &["--csv", &csv]);
    let file = hdf5::File::open(folder.path("out.h5")).unwrap();
    let cases = 12;
    let shoulder = |what: &str| numbers(&file, &format!("hinges/shoulder/{what}"));
    let (max, max_time, at_max, min) = (shoulder("max"), shoulder("max_time"), shoulder("load_at_max"), shoulder("min"));
    assert_eq!((max.len(), at_max.len()), (cases * 6, cases * 36));
    let angle = numbers(&file, "parameters/hinge.shoulder.position[1]");
    assert_eq!((angle[0], angle[6]), (0.0, 0.5));
    // the same draws at both values of the grid
    let damping = numbers(&file, "parameters/hinge.elbow.damping");
    assert!(damping[..6] == damping[6..] && damping[0] != damping[1]);

    // each case by itself, from the scene that the program shows
    for case in [1, 8, 12] {
        let shown = pliant(&["sweep", &folder.path("scene.toml"), &folder.path("plan.toml"), "--show-case", &case.to_string()]);
        assert!(shown.status.success(), "{}", text(&shown.stderr));
        let path = folder.write("case.toml", &text(&shown.stdout));
        let scene = assemble::load(Path::new(&path), &Overrides::default()).unwrap();
        assert_eq!(scene.name, "double pendulum");
        let mut all = All::default();
        let settings = Settings { duration: scene.duration.unwrap(), method: scene.method, rate_hz: scene.rate_hz };
        assert_eq!(simulate(&scene.system, &scene.state, &settings, &mut [&mut all]).outcome, Outcome::Completed);
        let k = scene.system.hinge_index("shoulder").unwrap();
        for component in 0..6 {
            let values = || all.0.iter().map(|(_, loads)| loads[k][component]);
            let row = (case - 1) * 6 + component;
            assert_eq!(max[row].to_bits(), values().fold(f64::NEG_INFINITY, f64::max).to_bits(), "case {case}, component {component}");
            assert_eq!(min[row].to_bits(), values().fold(f64::INFINITY, f64::min).to_bits());
            let (time, loads) = all.0.iter().find(|(_, loads)| loads[k][component] == max[row]).unwrap();
            assert_eq!(*time, max_time[row]);
            assert_eq!(loads[k].as_slice(), &at_max[row * 6..row * 6 + 6]);
        }
    }

    // the envelope, from the rows
    let whole = |what: &str| numbers(&file, &format!("envelope/hinges/shoulder/{what}"));
    let numbers_of = file.dataset("envelope/hinges/shoulder/max_case").unwrap().read_raw::<i64>().unwrap();
    for component in 0..6 {
        let best = (0..cases).rev().max_by(|a, b| max[a * 6 + component].total_cmp(&max[b * 6 + component])).unwrap();
        let row = best * 6 + component;
        assert_eq!(whole("max")[component], max[row]);
        assert_eq!(numbers_of[component], best as i64 + 1, "component {component}");
        assert_eq!(whole("max_time")[component], max_time[row]);
        assert_eq!(whole("load_at_max")[component * 6..component * 6 + 6], at_max[row * 6..row * 6 + 6]);
        let shown = &found["hinges"]["shoulder"]["rows"][component];
        assert_eq!((shown["extreme"].as_str(), shown["value"].as_f64()), (Some("max"), Some(max[row])));
        assert_eq!((shown["case"].as_i64(), shown["parameters"][1].as_f64()), (Some(best as i64 + 1), Some(angle[best])));
    }
    let side: hdf5::types::FixedUnicode<64> =
        file.dataset("hinges/elbow/max").unwrap().attr("side").unwrap().as_reader().read_scalar().unwrap();
    assert_eq!(side.as_str(), "by upper on lower");

    // and as a table: 2 hinges of 12 rows
    let mut reader = csv::Reader::from_path(&csv).unwrap();
    let headings: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    assert_eq!(headings[..5], ["load", "name", "extreme", "component", "value"]);
    assert_eq!(headings[13..], ["time (s)", "hinge.elbow.damping", "hinge.shoulder.position[1]", "simulation.integrator"]);
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 24);
    let force_z = rows.iter().find(|r| &r[1] == "shoulder" && &r[2] == "max" && &r[3] == "force_z").unwrap();
    assert_eq!(force_z[4].parse::<f64>().unwrap(), whole("max")[5]);
    assert_eq!(force_z[4], force_z[11]);
}

#[test]
fn a_case_that_fails_is_recorded_and_the_others_go_on() {
    let folder = Folder::new("");
    folder.write("table.csv", "body.upper.mass,simulation.integrator\n1.0,rk4\n-1.0,rk4\n2.5,rk4\n1.0,euler\n");
    let found = folder.run(3, "table.csv", "out.h5", &[]);
    assert_eq!((found["completed"].as_u64(), found["failed"].as_u64()), (Some(2), Some(2)));
    let message = found["failures"][0]["message"].as_str().unwrap();
    assert!(found["failures"][0]["case"] == 2 && message.starts_with("scene.toml:7:8: body[1].mass: "), "{message}");
    assert!(found["failures"][1]["message"].as_str().unwrap().contains("\"euler\" is not an integrator"), "{found}");
    let file = hdf5::File::open(folder.path("out.h5")).unwrap();
    assert_eq!(file.dataset("cases/completed").unwrap().read_raw::<i64>().unwrap(), [1, 0, 1, 0]);
    let max = numbers(&file, "hinges/shoulder/max");
    assert!(max[..6].iter().all(|x| x.is_finite()) && max[6..12].iter().all(|x| x.is_nan()));
    let messages = file.dataset("cases/message").unwrap().read_raw::<hdf5::types::FixedUnicode<1024>>().unwrap();
    assert_eq!((messages[0].as_str(), messages[1].as_str()), ("", message));
    let names = file.dataset("parameters/simulation.integrator").unwrap().read_raw::<hdf5::types::FixedUnicode<16>>().unwrap();
    assert_eq!(names.iter().map(|n| n.as_str()).collect::<Vec<_>>(), ["rk4", "rk4", "rk4", "euler"]);
    let done = pliant(&folder.sweep("table.csv", "out.h5", &[]).iter().map(String::as_str).collect::<Vec<_>>());
    assert!(text(&done.stderr).contains("2 of 4 cases failed and count for nothing in the envelope"), "{}", text(&done.stderr));
    // the planar pendulum has no load out of its plane to show
    assert!(text(&done.stdout).contains("max force x") && !text(&done.stdout).contains("max force y"), "{}", text(&done.stdout));
    assert!(text(&done.stdout).contains("case 2 (body.upper.mass = -1.0, simulation.integrator = rk4): "), "{}", text(&done.stdout));
}

#[test]
fn closures_and_gears_have_their_envelope() {
    let folder = Folder::new("");
    let plan = folder.write("drive.toml", "[[parameter]]\nkey = \"closure.cable.ratio\"\ngrid = [-2.0]\n");
    let out = folder.path("out.h5");
    let found = report(0, &["sweep", &example("10_synchronised_panels"), &plan, "--duration", "1.5", "--out", &out]);
    let file = hdf5::File::open(&out).unwrap();
    assert_eq!(file.dataset("closures/cable/max").unwrap().shape(), [1, 1]);
    assert_eq!(file.dataset("closures/panel_2_line/load_at_max").unwrap().shape(), [1, 6, 6]);
    assert_eq!(found["closures"]["cable"]["rows"][0]["component"], "coordinate_force");
    let table = text(&pliant(&["sweep", &example("10_synchronised_panels"), &plan, "--duration", "1.5", "--out", &out]).stdout);
    assert!(table.contains("min coordinate force"), "{table}");
}

#[test]
fn modal_files_are_read_once_for_all_cases() {
    let folder = Folder::new("");
    fs::copy(root().join("modes/panel_cantilever.h5"), folder.path("panel.h5")).unwrap();
    let scene = folder.write("panel.toml", PANEL);
    let plan = folder.write(
        "modes.toml",
        "[[parameter]]\nkey = \"body.panel.modes.count\"\ngrid = [2, 4]\n[[parameter]]\nkey = \"load[1].mesh_node\"\ngrid = [3]\n",
    );
    let campaign = Campaign::new(Path::new(&scene), Overrides::default(), Plan::load(Path::new(&plan)).unwrap()).unwrap();
    // what is read anew would not be found
    fs::remove_file(folder.path("panel.h5")).unwrap();
    for case in 0..2 {
        let record = campaign.run_case(case, &AtomicBool::new(false)).unwrap();
        assert_eq!(record.failure, None);
        assert!(record.loads[0].is_whole(6));
    }
}

const PANEL: &str = r#"
[[body]]
name = "panel"
modal_file = "panel.h5"
modes = { count = 3 }
[[hinge]]
name = "root"
kind = "fixed"
parent = "world"
child = "panel"
[[load]]
body = "panel"
mesh_node = 5
force = { constant = [0.0, 0.0, 1.0] }
[simulation]
duration = 0.2
"#;

#[test]
fn a_state_of_another_campaign_is_refused_and_what_differs_is_named() {
    let folder = Folder::new("");
    fs::copy(root().join("modes/panel_cantilever.h5"), folder.path("panel.h5")).unwrap();
    fs::write(folder.path("scene.toml"), PANEL).unwrap();
    folder.write("table.csv", "body.panel.damping_ratio\n0.01\n0.02\n");
    let state = folder.path("kept.jsonl");
    folder.run(0, "table.csv", "out.h5", &["--state", &state]);
    let kept = fs::read(&state).unwrap();
    // a state that was named stays, and is taken
    assert_eq!(folder.run(0, "table.csv", "out.h5", &["--state", &state])["resumed"].as_u64(), Some(2));
    let differs = |more: &[&str]| {
        let message = folder.refused("table.csv", &[&["--state", &state], more].concat());
        assert_eq!(fs::read(&state).unwrap(), kept, "it was touched");
        message
    };
    let message = differs(&["--integrator", "rk4"]);
    assert!(message.contains("of another campaign: the options of the command line are not the same"), "{message}");
    let message = differs(&["--shard", "1/2"]);
    assert!(message.contains("the shard (1/1 there) is not the same"), "{message}");
    fs::write(folder.path("scene.toml"), PANEL.replace("0.2", "0.3")).unwrap();
    assert!(differs(&[]).contains("the scene is not the same"));
    fs::write(folder.path("scene.toml"), PANEL).unwrap();
    fs::copy(root().join("modes/panel_sandwich.h5"), folder.path("panel.h5")).unwrap();
    assert!(differs(&[]).contains("the modal file of body \"panel\" is not the same"));
    fs::copy(root().join("modes/panel_cantilever.h5"), folder.path("panel.h5")).unwrap();
    // a file of a time function
    fs::write(folder.path("scene.toml"), PANEL.replace("{ constant = [0.0, 0.0, 1.0] }", "{ table = \"push.csv\" }")).unwrap();
    folder.write("push.csv", "0,0,0,1\n1,0,0,1\n");
    let other = folder.path("push.jsonl");
    folder.run(0, "table.csv", "out.h5", &["--state", &other]);
    folder.write("push.csv", "0,0,0,1\n1,0,0,2\n");
    assert!(folder.refused("table.csv", &["--state", &other]).contains("the file push.csv is not the same"));
    fs::write(folder.path("scene.toml"), PANEL).unwrap();
    folder.write("table.csv", "body.panel.damping_ratio\n0.01\n0.03\n");
    assert!(differs(&[]).contains("the plan and the table of cases are not the same"));
    let old = text(&kept).replacen(
        &format!("\"the version of pliant\":\"{}\"", env!("CARGO_PKG_VERSION")),
        "\"the version of pliant\":\"0.0.1\"",
        1,
    );
    folder.write("table.csv", "body.panel.damping_ratio\n0.01\n0.02\n");
    fs::write(&state, &old).unwrap();
    let message = folder.refused("table.csv", &["--state", &state]);
    assert!(message.contains("the version of pliant is not the same; delete the file to start anew"), "{message}");
    fs::write(&state, "a,b\n1,2\n").unwrap();
    assert!(folder.refused("table.csv", &["--state", &state]).contains("not the state of a campaign; it is left as it is"));
    assert_eq!(fs::read_to_string(&state).unwrap(), "a,b\n1,2\n");
}

#[test]
fn shards_that_make_no_whole_are_named() {
    let folder = Folder::new(PLAN);
    for shard in ["1/3", "2/3", "3/3"] {
        folder.run(0, "plan.toml", "a.h5", &["--shard", shard, "--duration", "0.1"]);
    }
    folder.run(0, "plan.toml", "b.h5", &["--shard", "2/3", "--duration", "0.2"]);
    folder.run(0, "plan.toml", "c.h5", &["--shard", "2/2", "--duration", "0.1"]);
    let (a, b, c) = (shards(&folder, "a", 3), shards(&folder, "b", 3), shards(&folder, "c", 2));
    let out = folder.path("out.h5");
    let merge = |parts: &[&String]| {
        let parts: Vec<&str> = parts.iter().map(|p| p.as_str()).collect();
        let message = refused(&[&["merge", "--out", &out], &parts[..]].concat());
        assert!(!Path::new(&out).exists());
        message
    };
    let message = merge(&[&a[0]]);
    assert!(message.contains("no file is of shard 2/3, 3/3; run it by pliant sweep --shard"), "{message}");
    let message = merge(&[&a[0], &a[1], &a[2], &a[1]]);
    assert!(message.contains("a.2-of-3.state.jsonl: shard 2 of 3, which") && message.contains("give each once"), "{message}");
    let message = merge(&[&a[0], &b[1], &a[2]]);
    assert!(message.contains("b.2-of-3.state.jsonl: of another campaign than"), "{message}");
    assert!(
        message.contains("not the same are the options of the command line") && message.contains("no file is of shard 2/3"),
        "{message}"
    );
    let message = merge(&[&a[0], &a[1], &a[2], &c[1]]);
    assert!(message.contains("merge shards of one division"), "{message}");
    let foreign = folder.write("x.jsonl", "x\n");
    assert!(merge(&[&foreign]).contains("not the state of a campaign"));
    assert!(merge(&[&folder.path("absent.jsonl")]).contains("cannot be opened"));
    report(0, &["merge", &a[0], &a[1], &a[2], "--out", &out]);
}

#[test]
fn what_cannot_be_swept_is_refused_before_anything_runs() {
    let folder = Folder::new(PLAN);
    let plan = |text: &str| folder.write("p.toml", text);
    plan("[[parameter]]\nkey = \"hinge.shulder.damping\"\ngrid = [1.0]\n");
    let message = folder.refused("p.toml", &[]);
    assert!(
        message.contains(
            "p.toml:2:7: parameter[1].key: \"hinge.shulder.damping\": the scene has no hinge \"shulder\"; did you mean shoulder?"
        ),
        "{message}"
    );
    plan("[[parameter]]\nkey = \"hinge.shoulder.dampnig\"\ngrid = [1.0]\n");
    assert!(folder.refused("p.toml", &[]).contains("the scene has no key \"dampnig\"; did you mean damping?"));
    plan("[[parameter]]\nkey = \"hinge.shoulder.damping\"\nuniform = { min = 0.0, max = 1.0 }\n");
    assert!(folder.refused("p.toml", &[]).contains("samples: say how many cases to draw"));
    folder.write("t.csv", "hinge.shoulder.damping,hinge.shoulder.dampng\n1.0,2.0\n");
    assert!(folder.refused("t.csv", &[]).contains("t.csv:1:1: heading: \"hinge.shoulder.dampng\": the scene has no key"));
    folder.write("t.csv", "hinge.shoulder.damping\n1.0,2.0\n");
    assert!(folder.refused("t.csv", &[]).contains("t.csv:2:1: row: 2 values"));
    assert!(folder.refused("absent.toml", &[]).contains("absent.toml: cannot read"));
    assert!(folder.refused("plan.toml", &["--threads", "0"]).contains("--threads 0 runs nothing"));
    assert!(folder.refused("plan.toml", &["--shard", "4/3"]).contains("write I/N with I from 1 to N"));
    assert!(folder.refused("plan.toml", &["--csv", &folder.path("none/x.csv")]).contains("name a file in a folder that exists"));
    assert!(folder.refused("plan.toml", &["--state", &folder.path("scene.toml")]).contains("is an input or another output"));
    assert!(folder.refused("plan.toml", &["--show-case", "13"]).contains("the campaign has cases 1 to 12"));
    let message = refused(&["sweep", &folder.path("scene.toml"), &folder.path("plan.toml")]);
    assert!(message.contains("--out"), "{message}");
    let scene = fs::read_to_string(folder.path("scene.toml")).unwrap();
    fs::write(folder.path("scene.toml"), scene.replace("duration", "largest_step")).unwrap();
    assert!(folder.refused("plan.toml", &[]).contains("the scene has no [simulation] duration"));
}

#[test]
fn the_plan_of_the_readme_fits_the_example() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let block = readme.split("```toml\n").find(|t| t.starts_with("seed = ")).and_then(|t| t.split("```").next()).unwrap();
    let folder = Folder::new(block);
    folder.write("cases.csv", "hinge.right_line.damping\n0.5\n0.6\n");
    let shown = pliant(&["sweep", &example("12_campaign"), &folder.path("plan.toml"), "--show-case", "240"]);
    assert!(shown.status.success(), "{}", text(&shown.stderr));
    let scene: toml::Table = text(&shown.stdout).parse().unwrap();
    // the last row of the table, the last value of the grid
    assert_eq!(scene["hinge"][4]["damping"].as_float(), Some(0.6));
    assert_eq!(scene["hinge"][1]["position"][0].as_float(), Some(std::f64::consts::FRAC_PI_2));
    let factor = scene["hinge"][2]["stiffness"].as_float().unwrap() / 400.0;
    assert!(factor != 1.0 && (0.7..=1.3).contains(&factor), "{factor}");
}

#[test]
#[cfg(unix)]
fn ctrl_c_ends_a_campaign_with_what_is_finished() {
    let folder = Folder::new(PLAN);
    let slow = ["--duration", "100", "--threads", "2"];
    let arguments = folder.sweep("plan.toml", "out.h5", &slow);
    let child = command(&arguments.iter().map(String::as_str).collect::<Vec<_>>()).spawn().unwrap();
    let (state, started) = (folder.path("out.state.jsonl"), Instant::now());
    while fs::read_to_string(&state).map_or(0, |text| text.matches('\n').count()) < 2 {
        assert!(started.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(2));
    }
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let done = child.wait_with_output().unwrap();
    let message = text(&done.stderr);
    assert_eq!(done.status.code(), Some(3), "{message}");
    assert!(message.contains("interrupted with ") && message.contains(" of 12 cases finished; they are in "), "{message}");
    assert!(Path::new(&state).exists() && !Path::new(&folder.path("out.h5")).exists());
}
