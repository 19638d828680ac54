//! `pliant import` from the command line. Alone in its process: a command that starts while another test writes an HDF5 file takes over the
//! lock of that file.
#![cfg(feature = "hdf5")]

use std::path::{Path, PathBuf};
use std::process::Command;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name)
}

#[test]
fn the_command_ends_with_code_2_and_one_message() {
    let run = |arguments: &[&str]| Command::new(env!("CARGO_BIN_EXE_pliant")).args(arguments).current_dir(data("")).output().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("b.h5");
    let out = out.to_str().unwrap();
    let said = |arguments: &[&str], words: &[&str]| {
        let output = run(arguments);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(words.iter().all(|word| text.contains(word)), "{words:?} in {text}");
    };
    let whole = [
        "import",
        "beam.xdmf",
        "--out",
        out,
        "--displacement",
        "displacement",
        "--density",
        "250",
        "--damping-ratio",
        "0.01",
        "--interface",
        "root=ROOT",
        "--interface",
        "tip=box:2.9,-1,-1,3.1,1,1",
        "--json",
    ];
    let output = run(&whole);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((report["nodes"].as_u64(), report["modes"].as_u64(), report["format"].as_str()), (Some(20), Some(2), Some("XDMF")));
    assert!(report["departure"].as_f64().is_some_and(|d| d > 0.5) && report["rules"].as_array().is_some_and(|r| r.len() == 35));
    said(&["import", "beam.xdmf", "--out", out, "--interface", "root"], &["error: --interface root: write NAME=GROUP, or NAME=box:"]);
    said(&["import", "beam.xdmf", "--out", out, "--interface", "root=box:1,2"], &["write NAME=GROUP"]);
    said(&["import", "beam.xdmf", "--out", out, "--keys", "absent.toml"], &["error: absent.toml: cannot be read"]);
    said(&["import", "beam.xdmf", "--out", out, "--keys", "beam.xdmf"], &["error: beam.xdmf: TOML parse error"]);
    said(&["import", "beam.xdmf", "--out", out, "--density", "-1"], &["error: beam.xdmf: density: -1 must be positive"]);
    said(
        &["import", "beam.xdmf", "--out", out, "--density", "1", "--node-mass", "m"],
        &["node_mass: give one of density, areal_density and node_mass"],
    );
    said(&["import", "beam.xdmf", "--out", out, "--damping-ratio", "-0.1"], &["damping_ratio: -0.1 must be zero or more"]);
    said(
        &["import", "beam.xdmf", "--out", out, "--boundary", "glued"],
        &["boundary: \"glued\" must be cantilever, free-free, craig-bampton or general"],
    );
    let keyed = |text: &str| {
        let keys = folder.path().join("keys.toml");
        std::fs::write(&keys, text).unwrap();
        keys.to_str().unwrap().to_owned()
    };
    let keys = keyed("interface.tip.box = [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]");
    said(
        &["import", "beam.xdmf", "--out", out, "--keys", &keys],
        &["beam.xdmf: interface: \"tip\": box = [low, high] needs low at most high along every axis"],
    );
    let keys = keyed("interface.tip = { group = \"TIP\", coupling = \"glue\" }");
    said(&["import", "beam.xdmf", "--out", out, "--keys", &keys], &["interface: \"tip\": coupling \"glue\" must be rbe3 or rbe2"]);
    // a line of the file is shown, but nothing of it that a terminal would obey
    let keys = keyed("title = \u{1b}[2J");
    said(&["import", "beam.xdmf", "--out", out, "--keys", &keys], &["title = \u{fffd}[2J"]);
    for name in ["beam.xdmf", "beam.h5"] {
        std::fs::copy(data(name), folder.path().join(name)).unwrap();
    }
    let (copy, numbers) = (folder.path().join("beam.xdmf"), folder.path().join("beam.h5"));
    let mut over = whole;
    (over[1], over[3]) = (copy.to_str().unwrap(), numbers.to_str().unwrap());
    said(&over, &["beam.h5: cannot be written: it is a file that is imported"]);
    assert_eq!(std::fs::read(&numbers).unwrap(), std::fs::read(data("beam.h5")).unwrap());
    let nowhere = folder.path().join("no/b.h5");
    let mut moved = whole;
    moved[3] = nowhere.to_str().unwrap();
    said(&moved, &["cannot be written", "a folder that exists"]);
}
