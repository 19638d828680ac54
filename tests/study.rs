//! `pliant study` and `run --verify`: errors, the cheapest setting, gaps, what is kept and taken up again.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn pendulum() -> String {
    root().join("examples/01_double_pendulum/scene.toml").display().to_string()
}

fn four_bar() -> String {
    root().join("examples/06_four_bar/scene.toml").display().to_string()
}

fn pliant(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    command.args(arguments).env("HDF5_USE_FILE_LOCKING", "FALSE").stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The parsed report of a study that must end well.
fn study(arguments: &[&str]) -> Value {
    let done = pliant(&[&["study"], arguments, &["--json"]].concat());
    assert_eq!(done.status.code(), Some(0), "{arguments:?}: {}", text(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

/// Peak errors of the points of one integrator, in their order.
fn errors(report: &Value, integrator: &str) -> Vec<f64> {
    let points = report["points"].as_array().unwrap().iter().filter(|p| p["integrator"] == integrator);
    points.map(|p| p["error"]["peak"].as_f64().unwrap()).collect()
}

/// A coarse and quick study of the double pendulum.
const QUICK: [&str; 8] = ["--duration", "0.5", "--repeat", "2", "--tolerances", "1e-3,1e-5", "--steps", "0.02,0.01"];

fn quick(more: &[&str]) -> Value {
    let scene = pendulum();
    study(&[&[scene.as_str()], &QUICK[..], more].concat())
}

#[test]
fn errors_fall_with_the_tolerance_and_the_step() {
    for scene in [pendulum(), four_bar()] {
        let report = study(&[&scene, "--duration", "1", "--repeat", "1", "--tolerances", "1e-3,1e-5,1e-7", "--steps", "0.02,0.01,0.005"]);
        for integrator in ["dormand_prince", "rosenbrock_w", "rk4"] {
            let errors = errors(&report, integrator);
            assert_eq!(errors.len(), 3);
            assert!(errors.windows(2).all(|w| w[1] < 0.3 * w[0]), "{integrator}: {errors:?}");
        }
        // order 4: two halvings of the step make a factor of about 256 in all
        let rk4 = errors(&report, "rk4");
        let factor = rk4[0] / rk4[2];
        assert!(factor > 100.0 && factor < 700.0, "{rk4:?}");
        let own = report["reference"]["own_error"].as_f64().unwrap();
        assert!(errors(&report, "dormand_prince").iter().all(|e| *e > own), "{report}");
    }
}

#[test]
fn the_cheapest_setting_is_the_cheapest_that_meets_the_budget() {
    let report = quick(&["--error", "0.01%"]);
    assert_eq!(report["error_budget"].as_f64().unwrap(), 1e-4);
    let points = report["points"].as_array().unwrap();
    let cost = |p: &Value| p["run_time_s"]["median"].as_f64().unwrap();
    for p in points {
        assert_eq!(p["meets"].as_bool().unwrap(), p["error"]["peak"].as_f64().unwrap() <= 1e-4);
        assert_eq!(p["run_time_s"]["runs"], 2);
    }
    let meeting: Vec<&Value> = points.iter().filter(|p| p["meets"] == true).collect();
    assert!(!meeting.is_empty() && meeting.len() < points.len());
    let cheapest = &points[report["cheapest"]["point"].as_u64().unwrap() as usize];
    assert!(cheapest["meets"] == true && cheapest["pareto"] == true);
    assert!(meeting.iter().all(|p| cost(p) >= cost(cheapest)));
    // its lines are TOML that says what the point says
    let lines = report["cheapest"]["lines"].as_array().unwrap().iter().map(|l| l.as_str().unwrap()).collect::<Vec<_>>().join("\n");
    let parsed: toml::Table = lines.parse().unwrap();
    assert_eq!(parsed["integrator"].as_str(), cheapest["integrator"].as_str());
    match cheapest["tolerance"].as_f64() {
        // the scene's own absolute tolerance is a tenth of its relative one
        Some(tolerance) => {
            assert_eq!(parsed["relative_tolerance"].as_float(), Some(tolerance));
            assert!((parsed["absolute_tolerance"].as_float().unwrap() / tolerance - 0.1).abs() < 1e-9);
        }
        None => assert_eq!(parsed["step"].as_float(), cheapest["step"].as_f64()),
    }
    // the table says the same and marks one row
    let scene = pendulum();
    let table = text(&pliant(&[&["study", &scene], &QUICK[..], &["--error", "1e-4"]].concat()).stdout);
    assert!(table.contains("cheapest within 0.01 %") && table.contains("# in [simulation]"), "{table}");
    assert_eq!(table.lines().filter(|l| l.starts_with("  > ")).count(), 1, "{table}");
}

#[test]
fn a_budget_that_nothing_meets_is_said() {
    let report = quick(&["--error", "1e-15"]);
    assert_eq!(report["cheapest"], Value::Null);
}

#[test]
fn channels_of_rounding_are_not_counted() {
    // the pins of a planar double pendulum carry no moment
    let report = quick(&[]);
    assert_eq!(report["silent"], serde_json::json!(["shoulder moment", "elbow moment"]));
    assert!(report["points"][0]["channels"]["shoulder force"]["rms"].as_f64().unwrap() > 0.0);
    let closures = study(&[&four_bar(), "--duration", "0.2", "--repeat", "1", "--tolerances", "1e-4"]);
    assert!(closures["points"][0]["channels"]["closure rocker_pin force"]["peak"].is_number(), "{closures}");
}

/// A scene that steps of rk4 cannot follow: a very stiff spring.
fn stiff(folder: &Path) -> String {
    changed_pendulum(folder, &[("position = [0.0] ", "stiffness = 1e7\nposition = [0.01] ")])
}

#[test]
fn a_point_that_fails_is_a_gap_in_every_output() {
    let folder = tempfile::tempdir().unwrap();
    let scene = stiff(folder.path());
    let (csv, svg) = (folder.path().join("out.csv"), folder.path().join("out.svg"));
    let lists = ["--duration", "0.1", "--repeat", "2", "--integrators", "rk4,dormand_prince", "--steps", "0.01,1e-4,5e-5"];
    let files = ["--tolerances", "1e-4,1e-6", "--csv", csv.to_str().unwrap(), "--svg", svg.to_str().unwrap()];
    let report = study(&[&[scene.as_str()], &lists[..], &files[..]].concat());
    let failed = &report["points"][0];
    assert_eq!(failed["step"], 0.01);
    assert!(failed["failure"].as_str().unwrap().contains("finite numbers"), "{failed}");
    assert!(failed["error"].is_null() && failed["run_time_s"].is_null() && failed["meets"] == false && failed["pareto"] == false);
    assert!(report["points"][1]["error"]["peak"].is_number());
    let rows = fs::read_to_string(&csv).unwrap();
    let row = rows.lines().find(|l| l.starts_with("rk4,,0.01,")).unwrap();
    assert!(row.contains("finite numbers"), "{row}");
    // four channels at most of each of the other four points, and the heading
    assert!(rows.lines().count() > 5);
    assert!(fs::read_to_string(&svg).unwrap().contains("rk4 (1 failed)"));
}

/// Elements of well-formed XML by name, with their attributes; no text, comments or CDATA are looked into.
fn elements(xml: &str) -> Vec<(String, String)> {
    let (mut open, mut found) = (Vec::new(), Vec::new());
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        assert!(!rest[..start].contains('>') && !rest[..start].replace("&lt;", "").replace("&gt;", "").replace("&amp;", "").contains("& "));
        let end = start + rest[start..].find('>').expect("a tag that is not closed");
        let tag = &rest[start + 1..end];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name));
        } else if !tag.starts_with(['?', '!']) {
            let name = tag.split([' ', '/', '\n']).next().unwrap().to_owned();
            assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
            found.push((name.clone(), tag.to_owned()));
            if !tag.ends_with('/') {
                open.push(name);
            }
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty(), "{open:?}");
    found
}

#[test]
fn the_plot_is_xml_with_one_line_per_curve_and_panel() {
    let folder = tempfile::tempdir().unwrap();
    let svg = folder.path().join("plot.svg");
    quick(&["--svg", svg.to_str().unwrap()]);
    let xml = fs::read_to_string(&svg).unwrap();
    let elements = elements(&xml);
    assert_eq!(elements[0].0, "svg");
    let lines = elements.iter().filter(|(name, tag)| name == "polyline" && tag.contains("stroke-width=\"2\"")).count();
    assert_eq!(lines, 2 * 3, "{xml}");
    for label in ["dormand_prince", "rosenbrock_w", "rk4", "Pareto front", "run time (s)", "evaluations of the dynamics"] {
        assert!(xml.contains(label), "{label}");
    }
}

/// The report of one `pliant run` of a scene.
fn run(scene: &str, more: &[&str]) -> Value {
    let done = pliant(&[&["run", scene, "--viewer", "none", "--json"], more].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

/// The double pendulum with other lines put in for some of its own.
fn changed_pendulum(folder: &Path, changes: &[(&str, &str)]) -> String {
    let mut scene = fs::read_to_string(pendulum()).unwrap();
    for (old, new) in changes {
        assert!(scene.contains(old), "{old}");
        scene = scene.replace(old, new);
    }
    let path = folder.join("scene.toml");
    fs::write(&path, scene).unwrap();
    path.display().to_string()
}

#[test]
fn evaluations_are_those_that_runs_report() {
    let folder = tempfile::tempdir().unwrap();
    let scene = changed_pendulum(folder.path(), &[("= 1e-12", "= 1e-5"), ("= 1e-13", "= 1e-6")]);
    let csv = folder.path().join("out.csv");
    // without a step, rk4 takes one per output time
    let lists = ["--duration", "0.5", "--repeat", "1", "--tolerances", "1e-5", "--steps", "0.016666666666666666"];
    let arguments = [&[scene.as_str()], &lists[..], &["--csv", csv.to_str().unwrap()]].concat();
    let report = study(&arguments);
    let table = text(&pliant(&[&["study"], &arguments[..]].concat()).stdout);
    let rows = fs::read_to_string(&csv).unwrap();
    assert_eq!(rows.lines().next().unwrap().split(',').nth(14), Some("evaluations"));
    for point in report["points"].as_array().unwrap() {
        let integrator = point["integrator"].as_str().unwrap();
        let alone = run(&scene, &["--duration", "0.5", "--integrator", integrator]);
        assert_eq!(point["steps"], alone["steps"], "{integrator}");
        let [steps, own, evaluations] = [&point["steps"], &point["evaluations"], &alone["evaluations"]].map(|n| n.as_u64().unwrap());
        // a run looks at the local error of every eighth step for its report, where there is one
        let looks = if integrator == "rk4" { 0 } else { steps / 8 };
        assert_eq!(own + looks, evaluations, "{integrator}");
        let own = own.to_string();
        let row = rows.lines().find(|l| l.starts_with(&format!("{integrator},"))).unwrap();
        assert_eq!(row.split(',').nth(14), Some(own.as_str()), "{row}");
        let line = table.lines().find(|l| l.starts_with("  ") && l.contains(&format!(" {integrator} "))).unwrap();
        assert!(line.split_whitespace().any(|cell| cell == own), "{table}");
    }
}

#[test]
fn nothing_beats_the_front_of_evaluations_and_all_else_is_beaten() {
    let report = quick(&[]);
    let points = report["points"].as_array().unwrap();
    let place = |p: &Value| (p["evaluations"].as_u64().unwrap(), p["error"]["peak"].as_f64().unwrap());
    let beats = |a: &Value, b: &Value| place(a) != place(b) && place(a).0 <= place(b).0 && place(a).1 <= place(b).1;
    for p in points {
        assert_eq!(p["pareto_evaluations"], !points.iter().any(|other| beats(other, p)), "{p}");
    }
}

#[test]
fn the_table_shows_every_channel_along_the_front() {
    let report = quick(&[]);
    let scene = pendulum();
    let table = text(&pliant(&[&["study", &scene], &QUICK[..]].concat()).stdout);
    let (_, channels) = table.split_once("peak / rms error of each channel").unwrap();
    for (name, _) in report["points"][0]["channels"].as_object().unwrap() {
        let line = channels.lines().find(|l| l.trim_start().starts_with(name.as_str())).unwrap();
        assert!(line.contains("e-") && line.contains(" / "), "{line}");
    }
}

#[test]
fn loads_that_are_only_monitored_are_compared_too() {
    let folder = tempfile::tempdir().unwrap();
    let monitor = "[output]\nhinges = [\"elbow\"]\n\n[[monitor]]\nhinge = \"shoulder\"\n\n[simulation]";
    let scene = changed_pendulum(folder.path(), &[("[simulation]", monitor)]);
    let report = study(&[&[scene.as_str()], &QUICK[..]].concat());
    assert_eq!(report["points"][0]["channels"], quick(&[])["points"][0]["channels"].clone());
    assert!(report["points"][0]["channels"]["shoulder force"]["peak"].is_number(), "{report}");
}

fn lines_of(path: &Path) -> Vec<String> {
    fs::read_to_string(path).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn finished_runs_are_taken_from_the_state_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.jsonl");
    let state = ["--state", path.to_str().unwrap()];
    let first = quick(&state);
    let lines = lines_of(&path);
    // three integrators, two accuracies, two rounds, and the reference
    assert_eq!(lines.len(), 13);
    let again = quick(&state);
    assert_eq!(lines_of(&path), lines, "finished runs were run again");
    assert_eq!((&again["points"], &again["reference"]), (&first["points"], &first["reference"]));
    assert!(again["notes"].to_string().contains("12 of 12 runs are from the state file"), "{}", again["notes"]);
    // another round runs what is missing only; another tightest tolerance has another reference, to which nothing fits
    let scene = pendulum();
    let more = |repeat, tolerances| {
        let lists = ["--duration", "0.5", "--repeat", repeat, "--tolerances", tolerances, "--steps", "0.02,0.01"];
        study(&[&[scene.as_str()], &lists[..], &state[..]].concat());
        lines_of(&path).len()
    };
    assert_eq!(more("3", "1e-3,1e-5"), 13 + 6);
    assert_eq!(more("1", "1e-3,1e-6"), 19 + 7);
}

#[test]
fn a_state_file_whose_last_line_was_cut_short_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.jsonl");
    let state = ["--state", path.to_str().unwrap()];
    quick(&state);
    let whole = fs::read_to_string(&path).unwrap();
    fs::write(&path, &whole[..whole.len() - 40]).unwrap();
    let report = quick(&state);
    assert!(report["points"].as_array().unwrap().iter().all(|p| p["run_time_s"]["runs"] == 2));
    let lines = lines_of(&path);
    assert_eq!(lines.len(), 14);
    assert_eq!(lines.iter().filter(|l| serde_json::from_str::<Value>(l).is_err()).count(), 1);
    // another scene shares the file, not the runs
    study(&[
        &four_bar(),
        "--duration",
        "0.1",
        "--repeat",
        "1",
        "--tolerances",
        "1e-4",
        "--integrators",
        "dormand_prince",
        state[0],
        state[1],
    ]);
    assert_eq!(lines_of(&path).len(), 16);
}

#[test]
fn a_file_that_is_no_state_file_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notes.txt");
    fs::write(&path, "a\nb\n").unwrap();
    let done = pliant(&["study", &pendulum(), "--duration", "0.1", "--state", path.to_str().unwrap()]);
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("no line of it is of a study"), "{}", text(&done.stderr));
    assert_eq!(fs::read_to_string(&path).unwrap(), "a\nb\n");
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_what_was_finished_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.jsonl");
    let scene = pendulum();
    let arguments =
        ["study", &scene, "--duration", "2", "--repeat", "1000000", "--tolerances", "1e-3,1e-4", "--integrators", "dormand_prince"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    let command = command.args(arguments).args(["--state", path.to_str().unwrap()]);
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    while fs::read_to_string(&path).is_ok_and(|t| t.lines().count() < 4) || !path.exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let done = child.wait_with_output().unwrap();
    let message = text(&done.stderr);
    assert_eq!(done.status.code(), Some(3), "{message}");
    assert!(message.contains("interrupted with") && message.contains("state.jsonl") && message.contains("goes on from there"), "{message}");
    assert!(text(&done.stdout).contains("dormand_prince"));
    assert!(lines_of(&path).iter().all(|l| serde_json::from_str::<Value>(l).is_ok()));
}

#[test]
fn lists_that_cannot_be_are_refused_by_name() {
    let scene = pendulum();
    let cases: &[(&[&str], &[&str])] = &[
        (&["--integrators", "rk5"], &["--integrators", "\"rk5\" is not an integrator", "dormand_prince"]),
        (&["--tolerances", "2"], &["--tolerances", "2 must lie between"]),
        (&["--tolerances", "1e-14"], &["--tolerances", "must lie between 1e-11 and 1"]),
        (&["--tolerances", "1e-3,x"], &["--tolerances", "x"]),
        (&["--tolerances", "nan"], &["--tolerances", "NaN must lie between"]),
        (&["--tolerances", "1e-3,1e-3"], &["--tolerances", "named twice"]),
        (&["--steps", "-1"], &["--steps", "-1 s must be positive"]),
        (&["--steps", "0.1", "--integrators", "rosenbrock_w"], &["--steps", "steps belong to rk4"]),
        (&["--tolerances", "0.1", "--integrators", "rk4"], &["--tolerances", "rk4 takes fixed steps"]),
        (&["--modes", "3"], &["--modes", "no flexible body"]),
        (&["--orders", "1"], &["--orders", "no flexible body"]),
        (&["--orders", "3"], &["--orders", "3 must be 0, 1 or 2"]),
        (&["--closure-method", "constraint_embedding"], &["--closure-method", "no closures"]),
        (&["--closure-method", "glue"], &["--closure-method", "\"glue\" is not a closure method", "tree_augmented"]),
        (&["--error", "-1%"], &["--error", "1% or 0.01"]),
        (&["--repeat", "0"], &["--repeat 0"]),
        (&["--duration", "-1"], &["--duration -1"]),
        (&["--csv", &scene], &["--csv", "is an input"]),
        (&["--csv", "a.txt", "--svg", "a.txt"], &["--svg", "another output"]),
        (&["--svg", "/nowhere/a.svg"], &["--svg /nowhere/a.svg", "may be written"]),
        (&["--state", "/nowhere/state"], &["--state /nowhere/state", "cannot be opened"]),
    ];
    for (arguments, expected) in cases {
        let done = pliant(&[&["study", &scene], *arguments].concat());
        let message = text(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{arguments:?}: {message}");
        for part in *expected {
            assert!(message.contains(part), "{arguments:?}: no \"{part}\" in: {message}");
        }
    }
}

#[test]
fn closures_are_compared_by_both_methods() {
    let methods = "tree_augmented,constraint_embedding";
    let report = study(&[&four_bar(), "--duration", "0.5", "--repeat", "1", "--tolerances", "1e-5,1e-6", "--closure-method", methods]);
    for point in report["points"].as_array().unwrap().iter().filter(|p| p["integrator"] == "dormand_prince") {
        assert!(point["error"]["peak"].as_f64().unwrap() < 1e-3, "{point}");
        assert!(point["closure_method"].is_string());
    }
}

#[test]
fn verify_prints_the_true_differences() {
    let (scene, base) = (pendulum(), ["--viewer", "none", "--verify", "--json"]);
    let run = |more: &[&str]| -> Value {
        let done = pliant(&[&["run", &scene], &base[..], more].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let tight = run(&[]);
    let verify = &tight["verify"];
    assert!((verify["relative_tolerance"].as_f64().unwrap() / 1e-13 - 1.0).abs() < 1e-9);
    let history = verify["hinges"]["shoulder"]["force_history"]["peak"].as_f64().unwrap();
    assert!(history < 1e-9, "{verify}");
    // peaks are taken where steps happen to end, some 1e-3 of a period from the top
    let force = verify["hinges"]["shoulder"]["force"].as_f64().unwrap();
    assert!(force < 1e-4, "{verify}");
    // the pins carry no moment, so that no difference is relative to anything
    assert!(verify["hinges"]["shoulder"]["moment"].is_null());
    let coarse = run(&["--integrator", "rk4", "--duration", "1"]);
    let verify = &coarse["verify"];
    assert!((verify["step"].as_f64().unwrap() - 0.5 / 60.0).abs() < 1e-15);
    let moved = verify["hinges"]["elbow"]["position"].as_f64().unwrap();
    assert!(moved > 1e-9 && moved < 1e-2, "{verify}");
    assert!(verify["hinges"]["elbow"]["force_history"]["rms"].as_f64().unwrap() > 1e-10);
    let done = pliant(&["run", &scene, "--viewer", "none", "--verify", "--duration", "0.2"]);
    assert!(text(&done.stdout).contains("verified with a relative tolerance of 1e-13"), "{}", text(&done.stdout));
}

#[cfg(feature = "hdf5")]
mod flexible {
    use super::*;

    fn hub() -> String {
        root().join("examples/02_hub_two_panels/scene.toml").display().to_string()
    }

    #[test]
    fn fewer_modes_and_lower_orders_have_their_error_and_are_proposed() {
        let lists = ["--modes", "3,6", "--orders", "0,2", "--tolerances", "1e-4,1e-6", "--integrators", "rosenbrock_w"];
        let report = study(&[&[hub().as_str(), "--duration", "4", "--repeat", "1", "--error", "50%"], &lists[..]].concat());
        let points = report["points"].as_array().unwrap();
        assert_eq!(points.len(), 8);
        let error = |modes: u64, order: u64| {
            let found = points.iter().find(|p| p["modes"] == modes && p["inertia_order"] == order && p["tolerance"] == 1e-6);
            found.unwrap()["error"]["peak"].as_f64().unwrap()
        };
        // the reference retains all ten modes and the exact inertia
        assert!(error(6, 2) < error(3, 2), "{} {}", error(6, 2), error(3, 2));
        assert!(report["reference"]["what"].as_str().unwrap().contains("all modes"));
        let proposals = report["proposals"].to_string();
        assert!(proposals.contains("modes per body: 3 is enough"), "{proposals}");
        assert!(proposals.contains("inertia order: 0 is enough"), "{proposals}");
        let done = pliant(&["study", &hub(), "--modes", "3,11"]);
        assert_eq!(done.status.code(), Some(2));
        assert!(
            text(&done.stderr).contains("--modes: 11, but no modal file of the scene has more than 10 modes"),
            "{}",
            text(&done.stderr)
        );
        let lines = report["cheapest"]["lines"].to_string();
        assert!(lines.contains("modes = { count = ") && lines.contains("inertia_order = "), "{lines}");
    }

    /// The hub with two panels with other lines put in for some of its own.
    fn changed_hub(folder: &Path, changes: &[(&str, &str)]) -> String {
        let mut scene = fs::read_to_string(hub()).unwrap().replace("../../modes", root().join("modes").to_str().unwrap());
        for (old, new) in changes {
            assert!(scene.contains(old), "{old}");
            scene = scene.replace(old, new);
        }
        let path = folder.join("scene.toml");
        fs::write(&path, scene).unwrap();
        path.display().to_string()
    }

    const MONITOR: &str = "[[monitor]]\nbody = \"panel_left\"\nstress_limit = 2.5e4";

    fn history(file: &Path, name: &str) -> Vec<f64> {
        hdf5::File::open(file).unwrap().dataset(name).unwrap().read_raw::<f64>().unwrap()
    }

    #[test]
    fn the_stress_error_of_few_modes_is_the_difference_of_two_runs() {
        let folder = tempfile::tempdir().unwrap();
        let tolerances = "[simulation]\nrelative_tolerance = 1e-4\nabsolute_tolerance = 1e-7";
        let scene = changed_hub(folder.path(), &[("[simulation]", tolerances)]);
        let files = ["all.h5", "few.h5"].map(|name| folder.path().join(name));
        let how = ["--duration", "4", "--integrator", "rosenbrock_w"];
        run(&scene, &[&how[..], &["--out", files[0].to_str().unwrap()]].concat());
        let alone = run(&scene, &[&how[..], &["--modes", "3", "--out", files[1].to_str().unwrap()]].concat());
        let [all, few] = [0, 1].map(|i| history(&files[i], "bodies/panel_left/von_mises_peak"));
        assert!(all.len() == 121 && few.len() == all.len());
        let largest = all.iter().fold(0.0_f64, |m, x| m.max(*x));
        let differences: Vec<f64> = all.iter().zip(&few).map(|(a, b)| (a - b).abs() / largest).collect();
        let peak = differences.iter().fold(0.0_f64, |m, x| m.max(*x));
        let rms = (differences.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt();

        let lists = ["--duration", "4", "--repeat", "1", "--integrators", "rosenbrock_w", "--tolerances", "1e-4", "--modes", "0,3"];
        let csv = folder.path().join("out.csv");
        let more = ["--reference", files[0].to_str().unwrap(), "--csv", csv.to_str().unwrap(), "--error", "50%"];
        let report = study(&[&[scene.as_str()], &lists[..], &more[..]].concat());
        assert_eq!(report["stress_bodies"], serde_json::json!(["panel_left"]));
        let [none, point] = [0, 1].map(|i| &report["points"][i]);
        let found = &point["channels"]["panel_left stress"];
        // the same numbers in both: sums of 121 squares may differ by as many roundings
        let bound = all.len() as f64 * f64::EPSILON;
        for (what, expected) in [("peak", peak), ("rms", rms)] {
            let found = found[what].as_f64().unwrap();
            assert!(expected > 1e-5 && (found / expected - 1.0).abs() < bound, "{what}: {found} {expected}");
        }
        // the largest error is the largest of all channels, and a body without modes has no stress, so that it misses all of it
        let channels = |p: &Value| p["channels"].as_object().unwrap().values().map(|c| c["peak"].as_f64().unwrap()).fold(0.0, f64::max);
        assert_eq!(point["error"]["peak"].as_f64().unwrap(), channels(point));
        assert_eq!(none["channels"]["panel_left stress"]["peak"], 1.0);
        assert!(none["error"]["peak"] == 1.0 && none["meets"] == false && point["meets"] == true, "{none}");
        assert!(alone["peaks"]["bodies"]["panel_left"]["von_mises"].as_f64().unwrap() >= few.iter().fold(0.0, |m, x| x.max(m)));
        let rows = fs::read_to_string(&csv).unwrap();
        let row = rows.lines().find(|l| l.starts_with("rosenbrock_w,0.0001,,3,") && l.contains(",panel_left stress,")).unwrap();
        assert!(row.contains(&format!(",{},", found["peak"])), "{row}");
    }

    #[test]
    fn stress_is_compared_where_the_scene_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let bodies = |changes: &[(&str, &str)]| {
            let scene = changed_hub(folder.path(), changes);
            let lists = ["--duration", "3", "--repeat", "1", "--integrators", "dormand_prince", "--tolerances", "1e-4", "--modes", "3"];
            let report = study(&[&[scene.as_str()], &lists[..]].concat());
            let channels = report["points"][0]["channels"].as_object().unwrap().clone();
            let stressed: Vec<String> = channels.keys().filter_map(|name| name.strip_suffix(" stress")).map(str::to_owned).collect();
            assert_eq!(report["stress_bodies"], serde_json::json!(stressed));
            stressed
        };
        assert_eq!(bodies(&[]), ["panel_left"]);
        assert_eq!(bodies(&[("[output]", "[output]\nstress = [\"panel_right\"]")]), ["panel_left", "panel_right"]);
        // a run evaluates the stress of all bodies by default; what nobody asks for is not compared
        assert!(bodies(&[(MONITOR, "")]).is_empty());
    }

    #[test]
    fn stress_that_is_not_there_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.h5");
        let scene = changed_hub(folder.path(), &[(MONITOR, ""), ("[output]", "[output]\nstress = []")]);
        run(&scene, &["--duration", "1", "--out", file.to_str().unwrap()]);
        let refused = |scene: &str, more: &[&str]| {
            let done = pliant(&[&["study", scene, "--duration", "1"], more].concat());
            assert_eq!(done.status.code(), Some(2), "{}", text(&done.stderr));
            text(&done.stderr)
        };
        let message = refused(&hub(), &["--reference", file.to_str().unwrap()]);
        for part in ["--reference", "run.h5", "bodies/panel_left/von_mises_peak is not in it", "output.stress"] {
            assert!(message.contains(part), "no \"{part}\" in: {message}");
        }
        let (from, to) = (root().join("modes/panel_cantilever.h5"), root().join("tests/data/cantilever.h5"));
        let scene = changed_hub(folder.path(), &[(from.to_str().unwrap(), to.to_str().unwrap())]);
        let message = refused(&scene, &[]);
        for part in ["scene.toml", "the modal file of \"panel_left\" has no stress modes", "drop the name"] {
            assert!(message.contains(part), "no \"{part}\" in: {message}");
        }
    }

    #[test]
    fn a_results_file_can_be_the_reference() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.h5");
        let (scene, out) = (pendulum(), file.display().to_string());
        let done = pliant(&["run", &scene, "--viewer", "none", "--duration", "0.5", "--out", &out]);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let (own, given) = (quick(&[]), quick(&["--reference", &out]));
        let (own, given) = (errors(&own, "dormand_prince"), errors(&given, "dormand_prince"));
        assert!(own.iter().zip(&given).all(|(a, b)| (a / b - 1.0).abs() < 0.05), "{own:?} {given:?}");
        let other = pliant(&["study", &four_bar(), "--reference", &out]);
        assert_eq!(other.status.code(), Some(2));
        assert!(text(&other.stderr).contains("hinges/crank_foot/load_moment is not in it"), "{}", text(&other.stderr));
        let longer = pliant(&["study", &scene, "--reference", &out]);
        assert!(text(&longer.stderr).contains("has no output time at 0.5166"), "{}", text(&longer.stderr));
        let none = pliant(&["study", &scene, "--reference", "nothing.h5"]);
        assert_eq!(none.status.code(), Some(2));
        assert!(text(&none.stderr).contains("--reference nothing.h5"), "{}", text(&none.stderr));
    }
}
