//! `run`, `eval` and `check` on scenes: what they print, how they exit, and what they say of a faulty scene.
#![cfg(feature = "hdf5")]

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn pliant(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pliant")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text_of(done: &Output) -> String {
    text(&done.stdout) + &text(&done.stderr)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A pendulum on a flexible boom, as text to be broken.
fn scene(folder: &Path) -> String {
    let modal = root().join("modes/boom_craig_bampton.h5");
    std::fs::copy(modal, folder.join("boom.h5")).unwrap();
    r#"name = "pendulum on a boom"
gravity = [0.0, 0.0, -9.81]

[[body]]
name = "boom"
modal_file = "boom.h5"
modes = { count = 4 }

[[body]]
name = "bob"
mass = 2.0
center_of_mass = [0.3, 0.0, 0.0]
inertia = [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]]

[[hinge]]
name = "root"
kind = "fixed"
parent = "world"
child = "boom"

[[hinge]]
name = "pin"
kind = "revolute"
axis = [0.0, 1.0, 0.0]
parent = "boom"
parent_node = "tip"
child = "bob"
position = [0.2]

[simulation]
duration = 0.2
"#
    .to_owned()
}

/// Runs a command on the scene with `from` replaced by `to`.
fn with_change(command: &str, from: &str, to: &str) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let original = scene(folder.path());
    assert!(from.is_empty() || original.contains(from), "{from} is not in the scene");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, original.replacen(from, to, 1)).unwrap();
    pliant(&[command, path.to_str().unwrap()])
}

#[test]
fn a_sound_scene_is_accepted_evaluated_and_run() {
    for command in ["check", "eval", "run"] {
        let done = with_change(command, "", "");
        assert_eq!(done.status.code(), Some(0), "{command}: {}", text(&done.stderr));
    }
}

#[test]
fn faults_of_a_scene_are_named_with_line_key_and_remedy_and_exit_2() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("mass = 2.0", "mas = 2.0", &["line 11", "unknown field `mas`", "mass"]),
        ("mass = 2.0", "mass = \"2 kg\"", &["line 11", "invalid type: string", "expected f64"]),
        ("mass = 2.0", "mass = nan", &["scene.toml:11:8", "body[2].mass", "not finite"]),
        ("mass = 2.0", "mass = -2.0", &["scene.toml:11:8", "\"bob\"", "-2", "zero or positive"]),
        ("mass = 2.0\n", "", &["body[2]", "needs mass and inertia (rigid), or modal_file or import (flexible)"]),
        ("0.01, 0.0, 0.0]", "0.09, 0.0, 0.0]", &["\"bob\"", "principal values", "sum of the other two"]),
        ("parent = \"boom\"", "parent = \"bom\"", &["hinge[2].parent", "\"bom\" is not a body", "\"boom\", \"bob\""]),
        ("parent_node = \"tip\"", "parent_node = \"tp\"", &["hinge[2].parent_node", "\"tp\" is not an interface", "\"root\", \"tip\""]),
        ("parent_node = \"tip\"\n", "", &["\"boom\" is flexible", "parent_node", "\"tip\""]),
        ("child = \"bob\"", "child = \"boom\"", &["\"boom\" is the child of hinge \"root\" and of hinge \"pin\""]),
        ("parent = \"world\"", "parent = \"bob\"", &["cycle", "\"boom\"", "\"bob\""]),
        ("kind = \"revolute\"", "kind = \"revolut\"", &["hinge[2].kind", "known kinds: fixed, revolute"]),
        ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 0.0]", &["hinge[2].axis", "no direction"]),
        ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 1.0]", &["line 24", "invalid length 2"]),
        ("position = [0.2]", "position = [0.2, 0.1]", &["hinge[2].position", "2 value(s)", "expected 1"]),
        ("position = [0.2]", "motion = { sine = { amplitude = 1.0 } }", &["missing field `frequency_hz`"]),
        ("position = [0.2]", "torque = { constant = 1.0, sine = { amplitude = 1.0, frequency_hz = 1.0 } }", &["exactly one of"]),
        ("modes = { count = 4 }", "modes = [1, 99]", &["body[1].modes", "mode 99", "1 to 12"]),
        ("modes = { count = 4 }", "inertia_order = 3", &["body[1].inertia_order", "0, 1 or 2"]),
        (
            "modes = { count = 4 }",
            "inertia_order = 0\ngeometric_stiffness = true",
            &["body[1].geometric_stiffness", "needs inertia_order = 1 or 2"],
        ),
        ("mass = 2.0", "mass = 2.0\ngeometric_stiffness = true", &["body[2].geometric_stiffness", "belongs to flexible bodies"]),
        ("modes = { count = 4 }", "mass = 1.0", &["has a modal_file", "remove mass"]),
        ("\"boom.h5\"", "\"bom.h5\"", &["body[1].modal_file", "bom.h5", "cannot be opened"]),
        ("duration = 0.2", "duration = -1.0", &["simulation.duration", "must be positive"]),
        ("[simulation]", "[viewer]\ndeformation_scale = -1.0\n[simulation]", &["viewer.deformation_scale", "-1 must be positive"]),
        ("duration = 0.2", "integrator = \"rk5\"", &["simulation.integrator", "\"rk5\"", "dormand_prince"]),
        ("[simulation]", "[[closure]]\nname = \"c\"\n[simulation]", &["closure"]),
        (
            "[simulation]",
            "[[monitor]]\nhinge = \"pn\"\n[simulation]",
            &["monitor[1].hinge", "\"pn\" is not a hinge", "there are: \"root\", \"pin\""],
        ),
        ("[simulation]", "[[monitor]]\nbody = \"bob\"\n[simulation]", &["\"bob\" is not a flexible body", "there are: \"boom\""]),
        ("[simulation]", "[[monitor]]\nclosure = \"c\"\n[simulation]", &["\"c\" is not a closure", "there are: none"]),
        ("[simulation]", "[output]\nhinges = [\"pn\"]\n[simulation]", &["output.hinges[1]", "there are: \"root\", \"pin\""]),
        ("position = [0.2]", "torque = 0.5", &["line 28", "a time function, as { constant = 0.5 }"]),
        ("position = [0.2]", "torque = { constnt = 0.5 }", &["unknown field `constnt`", "constant"]),
        (
            "[simulation]",
            "[[load]]\nbody = \"bob\"\nforce = [0.0, 0.0, 1.0]\n[simulation]",
            &["line 32", "a time function", "{ constant = [0.0, 0.0, 1.0] }"],
        ),
        (
            "[simulation]",
            "[[load]]\nbody = \"boom\"\npoint = [1.0, 0.0, 0.0]\nforce = { constant = [0.0, 0.0, 1.0] }\n[simulation]",
            &["load[1].point", "point belongs to rigid bodies", "give node, one of \"root\", \"tip\", or mesh_node"],
        ),
        (
            "[simulation]",
            "[[load]]\nbody = \"bob\"\nnode = \"tip\"\nforce = { constant = [0.0, 0.0, 1.0] }\n[simulation]",
            &["load[1].node", "\"bob\" is not flexible", "give point = [x, y, z] instead"],
        ),
        ("name = \"bob\"", "name = \"world\"", &["body[2].name", "stands for the inertial frame", "another name"]),
        ("name = \"bob\"", "name = \"boom\"", &["two bodies share the name \"boom\""]),
        ("name = \"pin\"", "name = \"\"", &["hinge[2].name", "it is empty"]),
        ("[simulation]", "[[load]]\nbody = \"bob\"\n[simulation]", &["load[1]", "force, moment or both"]),
        ("[simulation]", "[simulation", &["line 30", "TOML parse error"]),
        ("name = \"pendulum on a boom\"", "seed = 2026", &["unknown field `seed`", "plan of a campaign", "pliant sweep SCENE.toml"]),
    ];
    for (from, to, expected) in cases {
        let done = with_change("check", from, to);
        let message = text(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{to}: {message}");
        for part in *expected {
            assert!(message.contains(part), "{to}: no \"{part}\" in: {message}");
        }
    }
}

/// A boom that turns at 3 rad/s: 1.195 x 9 of a stiffness of 530 is 2 %.
#[test]
fn geometric_stiffness_is_used_on_demand_and_asked_for_where_it_matters() {
    let scene = |file: &str, key: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        let file = root().join(file);
        let text = format!(
            "[[body]]\nname = \"boom\"\nmodal_file = {file:?}\n{key}\n[[hinge]]\nname = \"spin\"\nkind = \"revolute\"\naxis = [0.0, 0.0, 1.0]\n\
             parent = \"world\"\nchild = \"boom\"\nvelocity = [3.0]\n[simulation]\nduration = 0.1\n"
        );
        std::fs::write(&path, text).unwrap();
        pliant(&["run", path.to_str().unwrap(), "--json", "--viewer", "none"])
    };
    for (key, used) in [("", false), ("geometric_stiffness = false", false), ("geometric_stiffness = true", true)] {
        let done = scene("modes/boom_cantilever.h5", key);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        let says = |list: &str, what: &str| report[list].as_array().unwrap().iter().any(|line| line.as_str().unwrap().contains(what));
        assert_eq!(says("left_out", "geometric stiffness of \"boom\""), !used, "{}", report["left_out"]);
        assert_eq!(says("warnings", "would change that of mode 1 by 2.0"), !used, "{}", report["warnings"]);
        assert_eq!(says("warnings", "set geometric_stiffness = true"), !used);
    }
    let done = scene("tests/data/cantilever.h5", "geometric_stiffness = true");
    assert_eq!(done.status.code(), Some(2));
    let message = text(&done.stderr);
    assert!(message.contains("body[1].geometric_stiffness") && message.contains("no geometric stiffness"), "{message}");
}

#[test]
fn a_scene_without_duration_is_evaluated_but_not_run() {
    assert_eq!(with_change("eval", "duration = 0.2", "").status.code(), Some(0));
    let done = with_change("run", "duration = 0.2", "");
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("--duration"));
}

#[test]
fn a_missing_scene_says_so() {
    let done = pliant(&["run", "no/such/scene.toml"]);
    assert_eq!(done.status.code(), Some(2));
    let message = text(&done.stderr);
    assert!(message.contains("no/such/scene.toml: cannot read the scene: ") && message.contains("name a scene file (.toml)"), "{message}");
    assert!(!message.contains("caused by"), "{message}");
    let results = root().join("modes/panel_cantilever.h5");
    let done = pliant(&["run", results.to_str().unwrap()]);
    assert!(text(&done.stderr).contains("it is not a text; name a scene file (.toml)"), "{}", text(&done.stderr));
}

#[test]
fn a_hinge_that_moves_no_mass_is_named() {
    let done = with_change(
        "run",
        "mass = 2.0\ncenter_of_mass = [0.3, 0.0, 0.0]\ninertia = [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]]",
        "mass = 0.0",
    );
    assert_eq!(done.status.code(), Some(2), "{}", text(&done.stderr));
    assert!(text(&done.stderr).contains("hinge \"pin\" between \"boom\" and \"bob\""), "{}", text(&done.stderr));
}

#[test]
fn the_report_of_a_run_has_the_documented_keys() {
    let example = root().join("examples/01_double_pendulum/scene.toml");
    let done = pliant(&["run", example.to_str().unwrap(), "--json"]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    for key in ["simulated_s", "wall_s", "integrator", "steps", "rejected_steps", "evaluations", "errors", "peaks", "final", "left_out"] {
        assert!(!report[key].is_null(), "{key}");
    }
    for key in ["energy", "momentum", "audit", "closure", "local"] {
        assert!(report["errors"].get(key).is_some(), "errors.{key}");
    }
    assert_eq!(report["simulated_s"], 2.0);
    let peak = &report["peaks"]["hinges"]["shoulder"];
    assert!(peak["moment"].as_f64().unwrap() < 1e-9 && peak["force"].as_f64().unwrap() > 9.81 && peak["time_s"].is_number());
    assert!(report["final"]["hinges"]["elbow"]["load"]["force"].is_array());
}

#[test]
fn overrides_change_the_scene_and_faulty_ones_are_refused() {
    let example = root().join("examples/02_hub_two_panels/scene.toml");
    let example = example.to_str().unwrap();
    let run = |more: &[&str]| pliant(&[&["eval", example, "--json"], more].concat());
    let modes = |done: &Output, body: &str| {
        let value: Value = serde_json::from_slice(&done.stdout).unwrap();
        value["bodies"][body]["modal_position"].as_array().unwrap().len()
    };
    assert_eq!(modes(&run(&["--modes", "3"]), "panel_left"), 3);
    let rigid = run(&["--rigid", "panel_left"]);
    assert_eq!((modes(&rigid, "panel_left"), modes(&rigid, "panel_right")), (0, 10));
    let wrong = run(&["--rigid", "hub"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text(&wrong.stderr).contains("panel_left, panel_right"));
    let wrong = pliant(&["run", example, "--integrator", "euler"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text(&wrong.stderr).contains("--integrator: \"euler\""), "{}", text(&wrong.stderr));
}

/// Where every hinge is prescribed nothing that is integrated limits the steps: they must see the motion all the same.
#[test]
fn a_prescribed_slew_between_two_output_times_is_not_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let run = |motion: &str, more: &[&str]| -> Value {
        let text = format!(
            "[[body]]\nname = \"dish\"\nmass = 1.0\ninertia = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n[[hinge]]\nname = \"drive\"\n\
             kind = \"revolute\"\naxis = [0.0, 0.0, 1.0]\nparent = \"world\"\nchild = \"dish\"\nmotion = {motion}\n[[monitor]]\nhinge = \"drive\"\n\
             moment_limit = 1.5\n[simulation]\nduration = 40.0\n[output]\nrate_hz = 1.0\n"
        );
        std::fs::write(&path, text).unwrap();
        let done = pliant(&[&["run", path.to_str().unwrap(), "--viewer", "none", "--json"], more].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text_of(&done));
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let peak = |report: &Value| report["peaks"]["hinges"]["drive"]["moment"].as_f64().unwrap();
    for integrator in ["dormand_prince", "rosenbrock_w"] {
        // 10 / sqrt(3) of d / T^2, and what half a step of T / 38 misses of it: (1 / 76)^2 / 2 of a curvature of 36 peaks
        let slew = run("{ smooth_step = { from = 0.0, to = 1.0, start = 1.0, end = 1.5 } }", &["--integrator", integrator]);
        let exact = 10.0 / 3.0_f64.sqrt() / 0.25;
        assert!(peak(&slew) <= exact * (1.0 + 1e-12) && peak(&slew) > exact * (1.0 - 18.0 / 76.0_f64.powi(2)), "{}", peak(&slew));
        assert_eq!(slew["exceedances"].as_array().unwrap().len(), 2);
        // work done by steps of T / 38 in a slew of 1.76 J: (1 / 38)^4 / 120 of it at the third order of the worse method
        assert!(slew["errors"]["energy"].as_f64().unwrap() < 38.0_f64.powi(-4), "{}", slew["errors"]["energy"]);
        let sine = run("{ sine = { amplitude = 0.2, frequency_hz = 3.0 } }", &["--integrator", integrator]);
        let exact = 0.2 * (6.0 * std::f64::consts::PI).powi(2);
        assert!(peak(&sine) <= exact * (1.0 + 1e-12) && peak(&sine) > exact * (std::f64::consts::PI / 40.0).cos(), "{}", peak(&sine));
        // the spline of a table begins with an acceleration at once: (0, 0.4) at rest at both ends, 6 d / T^2
        let table = run("{ table = [[0.0, 0.0], [1.0, 0.4]] }", &["--integrator", integrator]);
        assert!((peak(&table) - 2.4).abs() < 1e-9, "{}", peak(&table));
    }
}

/// Rounding of a triangle that carries its weight is no loss of energy, though nothing else moves.
#[test]
fn a_structure_at_rest_keeps_its_energy() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let hinge = |name: &str, child: &str, at: &str| {
        format!(
            "[[hinge]]\nname = \"{name}\"\nkind = \"revolute\"\naxis = [0.0, 1.0, 0.0]\nparent = \"world\"\nparent_frame = {{ position = {at} }}\n\
             child = \"{child}\"\n"
        )
    };
    let body = |name: &str, center: &str| {
        format!(
            "[[body]]\nname = \"{name}\"\nmass = 3.0\ncenter_of_mass = {center}\ninertia = [[0.1, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0]]\n"
        )
    };
    let text = format!(
        "gravity = [0.0, 0.0, -9.81]\n{}{}{}{}[[closure]]\nname = \"top\"\nkind = \"revolute\"\naxis = [0.0, 1.0, 0.0]\nbody_a = \"strut\"\n\
         frame_a = {{ position = [0.0, 0.0, 1.0] }}\nbody_b = \"rod\"\nframe_b = {{ position = [2.0, 0.0, 0.0] }}\n[simulation]\nduration = 0.5\n",
        body("rod", "[0.5, 0.0, 0.0]"),
        body("strut", "[0.1, 0.0, 0.3]"),
        hinge("left", "rod", "[0.0, 0.0, 0.0]"),
        hinge("base", "strut", "[2.0, 0.0, -1.0]")
    );
    std::fs::write(&path, text).unwrap();
    let done = pliant(&["run", path.to_str().unwrap(), "--viewer", "none", "--json"]);
    assert_eq!(done.status.code(), Some(0), "{}", text_of(&done));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    // rounding of the energies, some eps, against the square root of eps of them
    let error = report["errors"]["energy"].as_f64().unwrap();
    assert!(error < 100.0 * f64::EPSILON.sqrt(), "{error}");
}

/// Modes take part in closing a loop, which may be a preload that nobody meant; rates that a loop does not allow are changed.
#[test]
fn what_assembly_does_to_given_values_is_said() {
    let closure = |frame: &str| {
        let to = format!(
            "[[closure]]\nname = \"tie\"\nkind = \"spherical\"\nbody_a = \"boom\"\nnode_a = \"tip\"\nbody_b = \"world\"\nframe_b = {{ position = {frame} }}\n[simulation]"
        );
        let done = with_change("check", "[simulation]", &to);
        assert_eq!(done.status.code(), Some(0), "{}", text_of(&done));
        text(&done.stdout)
    };
    let bent = closure("[3.0, 0.0, 0.01]");
    for part in ["warning: ", "stay open by 0.01", "by bending \"boom\" (strain energy ", "preload"] {
        assert!(bent.contains(part), "no \"{part}\" in: {bent}");
    }
    assert!(!closure("[3.0, 0.0, 0.0]").contains("warning"));
    let damped = text(&with_change("check", "modes = { count = 4 }", "damping_ratio = 5.0").stdout);
    assert!(damped.contains("warning: modes of \"boom\" are damped by 5.000 of critical; damping_ratio is a share"), "{damped}");
    let (sine, cosine) = 0.2_f64.sin_cos();
    let lock = format!(
        "velocity = [1.0]\nposition = [0.2]\n[[closure]]\nname = \"lock\"\nkind = \"spherical\"\nbody_a = \"bob\"\n\
         frame_a = {{ position = [0.3, 0.0, 0.0] }}\nbody_b = \"boom\"\nnode_b = \"tip\"\nframe_b = {{ position = [{}, 0.0, {}] }}\n",
        0.3 * cosine,
        -0.3 * sine
    );
    let turned = text(&with_change("check", "position = [0.2]\n", &lock).stdout);
    assert!(turned.contains("change the given velocity of hinge \"pin\" from 1.000 to "), "{turned}");
}

/// One scene serves a comparison: a stress monitor does not stand in the way of a body that is to be rigid.
#[test]
fn stress_of_a_body_without_modes_is_left_out_and_said() {
    let example = root().join("examples/02_hub_two_panels/scene.toml");
    let run = |more: &[&str]| {
        let done = pliant(&[&["run", example.to_str().unwrap(), "--viewer", "none", "--duration", "0.1", "--json"], more].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        let bodies: Vec<_> = report["peaks"]["bodies"].as_object().unwrap().keys().cloned().collect();
        (bodies, report["left_out"].as_array().unwrap().iter().map(|line| line.as_str().unwrap().to_owned()).collect::<Vec<_>>())
    };
    let (bodies, left_out) = run(&["--rigid", "panel_left"]);
    assert_eq!(bodies, ["panel_right"]);
    assert!(left_out.iter().any(|line| line == "stress of \"panel_left\", which retains no mode"), "{left_out:?}");
    let rigid = pliant(&["run", example.to_str().unwrap(), "--viewer", "none", "--duration", "0.1", "--rigid", "panel_left"]);
    let warned = "warning: the stress limit of \"panel_left\" is not watched: the body retains no mode";
    assert!(text(&rigid.stdout).contains(warned), "{}", text(&rigid.stdout));
    let (bodies, left_out) = run(&["--modes", "0"]);
    assert!(bodies.is_empty() && left_out.iter().any(|line| line.contains("stress of \"panel_left\"")), "{bodies:?} {left_out:?}");
}

#[test]
fn stress_that_the_modal_file_lacks_is_left_out_or_refused_where_it_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let sound = scene(folder.path()).replace("count = 4", "count = 3");
    std::fs::copy(root().join("tests/data/cantilever.h5"), folder.path().join("boom.h5")).unwrap();
    let command = |command: &[&str], more: &str| {
        std::fs::write(&path, sound.replace("[simulation]", &format!("{more}\n[simulation]"))).unwrap();
        pliant(&[command, &[path.to_str().unwrap()]].concat())
    };
    let done = command(&["run", "--viewer", "none"], "");
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    assert!(text(&done.stdout).contains("stress of \"boom\", whose modal file has no stress modes"), "{}", text(&done.stdout));
    for (more, key) in
        [("[[monitor]]\nbody = \"boom\"\nstress_limit = 1e6", "monitor[1].body"), ("[output]\nstress = [\"boom\"]", "output.stress[1]")]
    {
        // what a run refuses, a check refuses too
        for refused in [command(&["check"], more), command(&["run", "--viewer", "none"], more)] {
            assert_eq!(refused.status.code(), Some(2));
            let message = text(&refused.stderr);
            for part in ["scene.toml:", key, "the modal file of \"boom\" has no stress modes", "modes/stress", "drop"] {
                assert!(message.contains(part), "no \"{part}\" in: {message}");
            }
        }
    }
    let rigid = command(&["check"], "[output]\nstress = [\"bob\"]");
    assert!(text(&rigid.stderr).contains("\"bob\" is not a flexible body of the scene"), "{}", text(&rigid.stderr));
}

#[test]
fn loops_run_by_every_method_and_integrator_and_the_report_says_which() {
    let example = root().join("examples/06_four_bar/scene.toml");
    let example = example.to_str().unwrap();
    let mut ends = Vec::new();
    for (method, integrator) in [("auto", "auto"), ("constraint_embedding", "rosenbrock_w"), ("tree_augmented", "rosenbrock_w")] {
        let done = pliant(&["run", example, "--duration", "1", "--closure-method", method, "--integrator", integrator, "--json"]);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let said = text(&done.stderr);
        let expected = if method == "auto" { "closures: 1 by tree_augmented (auto: " } else { &format!("closures: 1 by {method}") };
        assert!(said.contains(expected), "{said}");
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        // positions are closed to rounding, or projected until they close to 1e-10
        assert!(report["errors"]["closure"].as_f64().unwrap() < 1e-10);
        assert_eq!(report["integrator"], if integrator == "auto" { "dormand_prince" } else { integrator });
        ends.push(report["final"]["hinges"]["crank_foot"]["position"][0].as_f64().unwrap());
    }
    // a relative tolerance of 1e-9 over some hundred steps
    assert!(ends.iter().all(|e| (e - ends[0]).abs() < 1e-6), "{ends:?}");
    let wrong = pliant(&["eval", example, "--closure-method", "embedding"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text(&wrong.stderr).contains("known: auto, tree_augmented, constraint_embedding"), "{}", text(&wrong.stderr));
}

#[test]
fn outputs_do_not_write_over_inputs_or_one_another() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, scene(folder.path())).unwrap();
    let (path, boom, other) = (path.to_str().unwrap(), folder.path().join("boom.h5"), folder.path().join("other"));
    let before = std::fs::read(path).unwrap();
    for more in [
        ["--out", path].as_slice(),
        &["--out", "run.csv"],
        &["--out", other.to_str().unwrap(), "--rrd", "run.h5"],
        &["--out", boom.to_str().unwrap()],
        &["--out", other.to_str().unwrap(), "--rrd", other.to_str().unwrap()],
    ] {
        let done = pliant(&[&["run", path], more].concat());
        assert_eq!(done.status.code(), Some(2), "{more:?}");
        assert!(text(&done.stderr).contains("--out") || text(&done.stderr).contains("ends in .rrd"), "{}", text(&done.stderr));
    }
    assert_eq!(std::fs::read(path).unwrap(), before);
    assert!(!other.exists());
}

#[test]
fn an_unreachable_viewer_leaves_the_results_of_an_earlier_run() {
    let folder = tempfile::tempdir().unwrap();
    let (example, results) = (root().join("examples/01_double_pendulum/scene.toml"), folder.path().join("run.h5"));
    let run = |more: &[&str]| pliant(&[&["run", example.to_str().unwrap(), "--out", results.to_str().unwrap()], more].concat());
    assert_eq!(run(&[]).status.code(), Some(0));
    let before = std::fs::read(&results).unwrap();
    assert_eq!(run(&["--viewer", "connect", "--url", "rerun+http://127.0.0.1:9/proxy"]).status.code(), Some(2));
    assert_eq!(std::fs::read(&results).unwrap(), before);
}

#[test]
fn peaks_and_limits_of_loads_do_not_wait_for_output_times() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    // a point mass on a link falls from the horizontal: three times its weight at the bottom, 0.59 s later
    let pendulum = "gravity = [0.0, 0.0, -10.0]\n[[body]]\nname = \"a\"\nmass = 2.0\ncenter_of_mass = [1.0, 0.0, 0.0]\n[[hinge]]\nname = \"h\"\n\
                    kind = \"revolute\"\naxis = [0.0, -1.0, 0.0]\nparent = \"world\"\nchild = \"a\"\n[[monitor]]\nhinge = \"h\"\nforce_limit = 50.0\n\
                    [simulation]\nduration = 1.2\n[output]\nrate_hz = 1.0\n";
    std::fs::write(&path, pendulum).unwrap();
    let done = pliant(&["run", path.to_str().unwrap(), "--json"]);
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let force = report["peaks"]["hinges"]["h"]["force"].as_f64().unwrap();
    // steps of a twentieth of the swing see the peak to a tenth of a per cent or so
    assert!(force > 59.0 && force < 60.001, "{force}");
    assert_eq!(report["exceedances"].as_array().unwrap().len(), 1);
}

#[test]
fn redundant_closures_and_endless_outputs_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let four_bar = std::fs::read_to_string(root().join("examples/06_four_bar/scene.toml")).unwrap();
    let run = |text_of: String, more: &[&str]| {
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text_of).unwrap();
        pliant(&[&["run", path.to_str().unwrap()], more].concat())
    };
    // a planar loop of revolute joints holds itself in its plane three times over
    let done = run(four_bar.clone(), &["--duration", "0.1"]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    assert!(text(&done.stderr).contains("3 of 5 closed directions are redundant (rocker_pin)"), "{}", text(&done.stderr));
    let done = run(format!("{four_bar}\n[output]\nrate_hz = 1e12\n"), &[]);
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("output times, more than"), "{}", text(&done.stderr));
}

#[test]
fn an_evaluation_beyond_finite_numbers_is_an_input_fault() {
    let done = with_change("eval", "position = [0.2]", "velocity = [1e200]");
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("leaves finite numbers"), "{}", text(&done.stderr));
}

#[test]
fn a_run_that_diverges_stops_with_exit_3_and_keeps_what_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let scene = scene(folder.path()).replace("duration = 0.2", "duration = 5.0\nintegrator = \"rk4\"\nstep = 0.05");
    std::fs::write(&path, scene).unwrap();
    let results = folder.path().join("run.h5");
    let done = pliant(&["run", path.to_str().unwrap(), "--out", results.to_str().unwrap()]);
    let message = text(&done.stderr);
    assert_eq!(done.status.code(), Some(3), "{message}");
    assert!(message.contains("larger than that") && message.contains("left finite numbers, fastest in"), "{message}");
    let file = hdf5::File::open(&results).unwrap();
    assert!(file.dataset("time").unwrap().size() > 1);
    assert!(text(&done.stdout).contains("peak hinge loads"));
}

#[test]
fn files_that_cannot_be_written_are_named() {
    let example = root().join("examples/01_double_pendulum/scene.toml");
    let done = pliant(&["run", example.to_str().unwrap(), "--out", "no/such/folder/run.h5"]);
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("no/such/folder/run.h5"), "{}", text(&done.stderr));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_said_and_the_report_still_comes() {
    // every write to /dev/full fails as on a full disk
    let example = root().join("examples/01_double_pendulum/scene.toml");
    let done = pliant(&["run", example.to_str().unwrap(), "--out", "/dev/full"]);
    assert!(matches!(done.status.code(), Some(2 | 3)), "{:?}", done.status);
    assert!(text(&done.stderr).contains("/dev/full"), "{}", text(&done.stderr));
}

#[test]
fn a_closed_pipe_ends_the_program_quietly() {
    let example = root().join("examples/01_double_pendulum/scene.toml");
    let mut child = Command::new(env!("CARGO_BIN_EXE_pliant"))
        .args(["run", example.to_str().unwrap(), "--json"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let done = child.wait_with_output().unwrap();
    assert!(!text(&done.stderr).contains("panicked"), "{}", text(&done.stderr));
    assert_eq!(done.status.code(), Some(0));
}

#[test]
fn every_number_of_an_evaluation_reads_back_to_the_same_f64() {
    let example = root().join("examples/03_boom_tip_mass/scene.toml");
    let json = |()| text(&pliant(&["eval", example.to_str().unwrap(), "--time", "1.0", "--json"]).stdout);
    let first = json(());
    let value: Value = serde_json::from_str(&first).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&serde_json::to_string(&value).unwrap()).unwrap(), value);
    assert_eq!(first, json(()), "the same scene twice is bit-equal");
}

/// A TOML file that is no plan of a campaign.
fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "toml") && !path.ends_with("plan.toml")
}

#[test]
fn every_example_passes_its_check() {
    let folder = root().join("examples");
    let mut scenes = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        assert!(path.join("README.md").exists(), "{} has no README.md", path.display());
        scenes.extend(std::fs::read_dir(path).unwrap().map(|e| e.unwrap().path()).filter(|p| is_scene(p)));
    }
    assert!(scenes.len() >= 6);
    let names: Vec<_> = scenes.iter().map(|p| p.to_str().unwrap()).collect();
    let done = pliant(&[&["check"], names.as_slice()].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
}

#[test]
fn a_table_in_a_csv_file_prescribes_a_hinge_like_the_same_rows_in_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("slew.csv"), "# a comment\ntime, angle\n0.0, 0.0\n0.5, 0.3\n1.0, 0.4\n2.0, 0.1\n").unwrap();
    let original = scene(folder.path());
    let evaluate = |motion: &str| {
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, original.replace("position = [0.2]", &format!("motion = {motion}"))).unwrap();
        let done = pliant(&["eval", path.to_str().unwrap(), "--time", "0.7", "--json"]);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        text(&done.stdout)
    };
    let rows = "{ table = [[0.0, 0.0], [0.5, 0.3], [1.0, 0.4], [2.0, 0.1]] }";
    assert_eq!(evaluate("{ table = \"slew.csv\" }"), evaluate(rows));
    // the hinge stands on the spline between its rows
    let value: Value = serde_json::from_str(&evaluate(rows)).unwrap();
    let angle = value["hinges"]["pin"]["position"][0].as_f64().unwrap();
    assert!(angle > 0.3 && angle < 0.45, "{angle}");
    let sum = evaluate(&format!("{{ sum = [{rows}, {{ constant = 0.5 }}] }}"));
    let value: Value = serde_json::from_str(&sum).unwrap();
    assert!((value["hinges"]["pin"]["position"][0].as_f64().unwrap() - angle - 0.5).abs() < 1e-15);

    std::fs::write(folder.path().join("slew.csv"), "0.0, 0.0\n0.5, x\n").unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, original.replace("position = [0.2]", "motion = { table = \"slew.csv\" }")).unwrap();
    let done = pliant(&["check", path.to_str().unwrap()]);
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("slew.csv: row 2 is \"0.5,x\""), "{}", text(&done.stderr));
}

#[test]
fn a_force_on_a_mesh_node_is_that_on_the_interface_which_the_node_is() {
    // the random body's interface "tip" is a single node
    let folder = tempfile::tempdir().unwrap();
    let modal = root().join("tests/data/cantilever.h5");
    std::fs::copy(&modal, folder.path().join("body.h5")).unwrap();
    let file = hdf5::File::open(&modal).unwrap();
    let node = file.dataset("interfaces/tip/nodes").unwrap().read_raw::<i64>().unwrap();
    assert_eq!(node.len(), 1);
    let evaluate = |place: &str| {
        let text_of = format!(
            "[[body]]\nname = \"b\"\nmodal_file = \"body.h5\"\n[[hinge]]\nname = \"h\"\nkind = \"free\"\nparent = \"world\"\nchild = \"b\"\n\
             [[load]]\nbody = \"b\"\n{place}\nforce = {{ constant = [1.0, -2.0, 0.5] }}\n"
        );
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text_of).unwrap();
        let done = pliant(&["eval", path.to_str().unwrap(), "--json"]);
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        serde_json::from_slice::<Value>(&done.stdout).unwrap()["bodies"]["b"]["modal_acceleration"].clone()
    };
    let (on_node, on_interface) = (evaluate(&format!("mesh_node = {}", node[0])), evaluate("node = \"tip\""));
    for (a, b) in on_node.as_array().unwrap().iter().zip(on_interface.as_array().unwrap()) {
        let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
        // the 6-vector agrees with the node within the rule of the schema, 1e-6
        assert!((a - b).abs() <= 1e-6 * b.abs().max(1.0), "{a} {b}");
    }
}

#[test]
fn a_viewer_that_does_not_listen_is_said_at_once() {
    let example = root().join("examples/01_double_pendulum/scene.toml");
    let started = std::time::Instant::now();
    let done = pliant(&["run", example.to_str().unwrap(), "--viewer", "connect", "--url", "rerun+http://127.0.0.1:9/proxy"]);
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("127.0.0.1:9") || cfg!(not(feature = "rerun")), "{}", text(&done.stderr));
    assert!(started.elapsed().as_secs() < 20);
}
