//! Figures of a run's report that stand beside its run time: the local error of loads, and where the time went.

use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;

fn run(scene: &str, tolerance: &str) -> Value {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join(scene)).unwrap();
    let own = |line: &&str| line.starts_with("relative_tolerance") || line.starts_with("absolute_tolerance");
    let text = text.lines().filter(|l| !own(l)).collect::<Vec<_>>().join("\n");
    let text = text.replace("[simulation]", &format!("[simulation]\nrelative_tolerance = {tolerance}"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_pliant")).args(["run", "--viewer", "none", "--json"]).arg(&path).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

#[test]
fn the_local_error_of_loads_falls_with_the_tolerance() {
    let at = |tolerance| run("examples/01_double_pendulum/scene.toml", tolerance)["errors"]["local_load"].as_f64().unwrap();
    let errors = ["1e-3", "1e-5", "1e-7"].map(at);
    // the estimate of a 5(4) pair is of the tolerance's size times what the loads magnify, so that it falls with it
    assert!(errors[0] < 1e-1 && errors[2] > 0.0, "{errors:?}");
    assert!(errors.windows(2).all(|w| w[1] < 0.1 * w[0]), "{errors:?}");
}

#[test]
fn the_time_of_a_run_is_divided_without_rest() {
    let report = run("examples/06_four_bar/scene.toml", "1e-6");
    let (time, wall) = (&report["time"], report["wall_s"].as_f64().unwrap());
    let part = |name: &str| time[name].as_f64().unwrap();
    let sum = part("evaluations_s") + part("outputs_s") + part("integrator_s");
    assert!((sum / wall - 1.0).abs() < 1e-9, "{sum} of {wall}");
    let shares: f64 = time["sweeps"].as_object().unwrap().values().map(|x| x.as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-9);
    assert!(part("per_evaluation_s") > 1e-7 && part("per_evaluation_s") < 1e-2);
    assert!(time["sweeps"]["closures"].as_f64().unwrap() > 0.0);
}
