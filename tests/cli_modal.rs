//! `pliant check` and `pliant modes` as a user meets them: exit codes, streams, tables and JSON.
#![cfg(feature = "hdf5")]

use serde_json::Value;
use std::process::{Command, Output, Stdio};

fn pliant(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pliant"))
        .args(arguments)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data"))
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn without_arguments_help_is_printed() {
    let output = pliant(&[]);
    assert!(output.status.success() && output.stderr.is_empty());
    assert!(["Usage", "check", "modes", "Exit codes"].iter().all(|word| stdout(&output).contains(word)));
}

#[test]
fn an_unknown_command_is_an_input_fault() {
    let output = pliant(&["fly"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("fly"));
}

#[test]
fn a_sound_file_gets_one_row_per_rule() {
    let output = pliant(&["check", "complete.h5"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.starts_with("complete.h5: accepted"));
    // file, headings, 35 rules, blank line
    assert_eq!(text.lines().count(), 38, "{text}");
    assert!(text.lines().any(|line| line.contains("modes mass-orthonormal") && line.contains("<= 1e-6") && line.contains(" ok ")));
}

#[test]
fn all_files_are_checked_before_the_command_fails() {
    let output = pliant(&["check", "absent.h5", "cantilever.h5", "scene.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stdout(&output).contains("cantilever.h5: accepted"));
    let faults = stderr(&output);
    assert!(faults.starts_with("error: absent.h5") && faults.contains("\nerror: scene.toml"), "{faults}");
}

#[test]
fn check_prints_one_json_object() {
    let output = pliant(&["check", "--json", "cantilever.h5", "absent.h5"]);
    assert_eq!(output.status.code(), Some(2));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["accepted"], false);
    assert_eq!(report["files"][0]["accepted"], true);
    let rules = report["files"][0]["rules"].as_array().unwrap();
    assert_eq!(rules.len(), 35);
    assert!(rules.iter().all(|rule| rule["rule"].is_string() && rule["verdict"].is_string() && rule["protects"].is_string()));
    assert!(report["files"][1]["messages"][0].as_str().unwrap().contains("cannot be opened"));
}

#[test]
fn modes_prints_percentages_that_follow_from_the_participation() {
    let output = pliant(&["modes", "cantilever.h5", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let object: Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let mass = number(&object["mass"]);
    let mut total = 0.0;
    for mode in object["modes"].as_array().unwrap() {
        let percent = number(&mode["effective_mass_percent"][1]);
        total += percent;
        // two roundings of numbers up to 100
        assert!((percent - 100.0 * number(&mode["momentum"][1]).powi(2) / mass).abs() < 400.0 * f64::EPSILON);
        assert!((number(&mode["cumulative_mass_percent"][1]) - total).abs() < 400.0 * f64::EPSILON);
        let inertia = number(&object["inertia"][2][2]);
        let expected = 100.0 * number(&mode["angular_momentum"][2]).powi(2) / inertia;
        assert!((number(&mode["effective_inertia_percent"][2]) - expected).abs() < 400.0 * f64::EPSILON);
    }
    assert_eq!(object["interfaces"][1]["name"], "root");
    assert_eq!(object["rules"].as_array().unwrap().len(), 35);
}

#[test]
fn modes_shows_modes_interfaces_and_rules() {
    let text = stdout(&pliant(&["modes", "complete.h5"]));
    for word in ["cantilever", "full modal stiffness", "cum rz", "craig-bampton", "rbe3", "Participation", "geometric stiffness symmetric"]
    {
        assert!(text.contains(word), "{word} is missing in\n{text}");
    }
}

#[test]
fn modes_of_an_unreadable_file_is_an_input_fault() {
    let output = pliant(&["modes", "README.md"]);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    assert!(stderr(&output).starts_with("error: README.md: cannot be opened"));
}

#[cfg(unix)]
#[test]
fn a_closed_pipe_ends_quietly() {
    let script =
        format!("for i in 1 2 3 4 5 6 7 8; do set -- \"$@\" complete.h5; done; '{}' check \"$@\" | true", env!("CARGO_BIN_EXE_pliant"));
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");
    let output = Command::new("sh").args(["-c", &script]).current_dir(folder).stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", stderr(&output));
}
