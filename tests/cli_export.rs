//! `pliant export` and `pliant modes --export` as a user meets them: what is written, and every refusal by its text.
//! That meshio and VTK read the files, with the numbers of the results file, is tested in tests/python/test_export.py.
#![cfg(feature = "hdf5")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// HDF5's file locks stay off: a command that another test starts while a file is open here inherits its lock, and would
/// keep it from the command that is to read the file next.
fn pliant(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    command.args(arguments).current_dir(ROOT).env("HDF5_USE_FILE_LOCKING", "FALSE").output().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// The one message of a command that must fail for its input.
fn refused(arguments: &[&str]) -> String {
    let output = pliant(arguments);
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}{}", stdout(&output));
    text.trim_end().to_owned()
}

/// A short run of a scene, and the folder that holds it.
fn run_of(scene: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let output = pliant(&["run", scene, "--duration", "0.5", "--out", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    (folder, path)
}

const PANELS: &str = "examples/02_hub_two_panels/scene.toml";

#[test]
fn a_run_becomes_one_collection_per_flexible_body_and_one_of_loads() {
    let (folder, run) = run_of(PANELS);
    let output = pliant(&["export", run.to_str().unwrap(), "--format", "xdmf", "--every", "4", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // 16 output times, the first and every fourth
    assert_eq!(said["output_times"], 4);
    let mut names: Vec<_> = std::fs::read_dir(folder.path().join("run_xdmf")).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["fields.h5", "loads.xdmf", "panel_left.xdmf", "panel_right.xdmf"]);
    let loads = std::fs::read_to_string(folder.path().join("run_xdmf/loads.xdmf")).unwrap();
    assert!(loads.contains(r#"<Information Name="index" Value="attitude; drive_left; drive_right"/>"#), "{loads}");
}

#[test]
fn a_scene_without_flexible_bodies_still_has_its_loads() {
    let (_folder, run) = run_of("examples/06_four_bar/scene.toml");
    let output = pliant(&["export", run.to_str().unwrap(), "--format", "xdmf"]);
    assert_eq!(output.status.code(), Some(0));
    let loads = std::fs::read_to_string(run.with_file_name("run_xdmf").join("loads.xdmf")).unwrap();
    assert!(loads.contains("rocker_pin"), "closures are load points, too: {loads}");
}

#[test]
fn the_built_in_example_needs_no_modal_file() {
    let folder = tempfile::tempdir().unwrap();
    let (run, rrd) = (folder.path().join("run.h5"), folder.path().join("run.rrd"));
    let mut arguments = vec!["run", "--duration", "0.1", "--out", run.to_str().unwrap()];
    if cfg!(feature = "rerun") {
        arguments.extend(["--rrd", rrd.to_str().unwrap()]);
    }
    assert!(pliant(&arguments).status.success());
    assert_eq!(pliant(&["export", run.to_str().unwrap(), "--format", "xdmf"]).status.code(), Some(0));
}

#[test]
fn a_body_made_rigid_moves_without_deforming() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run.h5");
    let run = run.to_str().unwrap();
    let scene = "examples/03_boom_tip_mass/scene.toml";
    assert!(pliant(&["run", scene, "--duration", "0.1", "--rigid", "boom", "--out", run]).status.success());
    assert_eq!(pliant(&["export", run, "--format", "xdmf", "--body", "boom"]).status.code(), Some(0));
}

#[test]
fn a_csv_table_reads_back_to_the_numbers_of_the_file() {
    let (_folder, run) = run_of(PANELS);
    assert_eq!(pliant(&["export", run.to_str().unwrap(), "--format", "csv", "--every", "2"]).status.code(), Some(0));
    let mut reader = csv::Reader::from_path(run.with_extension("csv")).unwrap();
    let column = reader.headers().unwrap().iter().position(|h| h == "hinges/drive_left/load_moment/x (N m)").unwrap();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let file = hdf5::File::open(&run).unwrap();
    let moment = file.dataset("hinges/drive_left/load_moment").unwrap().read_2d::<f64>().unwrap();
    assert_eq!(rows.len(), moment.nrows().div_ceil(2));
    for (i, row) in rows.iter().enumerate() {
        assert_eq!(row[column].parse::<f64>().unwrap().to_bits(), moment[(2 * i, 0)].to_bits());
        assert_eq!(row.len(), reader.headers().unwrap().len());
    }
}

#[test]
fn what_is_no_results_file_is_refused_with_what_was_found_and_what_to_do() {
    let text = refused(&["export", "absent.h5", "--format", "csv"]);
    assert!(text.starts_with("error: absent.h5: cannot be opened: "), "{text}");
    assert!(text.ends_with("; name a file that pliant run --out has written for this scene"), "{text}");
    let text = refused(&["export", "modes/panel_cantilever.h5", "--format", "csv"]);
    let expected = "modes/panel_cantilever.h5: @format: found \"flexible-body-modes\", expected pliant-results; name a file that";
    assert!(text.contains(expected), "{text}");
}

#[test]
fn options_that_say_nothing_are_refused() {
    let text = refused(&["export", "run.h5", "--format", "csv", "--every", "0"]);
    assert_eq!(text, "error: --every 0 takes no output time; write 1 for all of them, N for every N-th");
    let text = refused(&["export", "run.h5", "--format", "csv", "--body", "panel"]);
    assert_eq!(text, "error: --body and --modal-file go with --format xdmf only; a table holds all histories, leave them out");
}

#[test]
fn a_body_that_is_not_there_is_refused_with_those_that_are() {
    let (_folder, run) = run_of(PANELS);
    let text = refused(&["export", run.to_str().unwrap(), "--format", "xdmf", "--body", "hub"]);
    let run = run.display();
    assert_eq!(
        text,
        format!("error: {run}: body \"hub\": found no such flexible body, expected one of: panel_left, panel_right; correct --body")
    );
}

#[test]
fn no_output_takes_the_place_of_an_input() {
    let (folder, run) = run_of(PANELS);
    let run = run.to_str().unwrap();
    let link = folder.path().join("link.csv");
    std::os::unix::fs::symlink(run, &link).unwrap();
    let text = refused(&["export", run, "--format", "csv", "--out", link.to_str().unwrap()]);
    assert_eq!(text, format!("error: {}: is an input of this export; write to another place (--out)", link.display()));
    // a results file that has the name of the arrays' file
    let own = folder.path().join("fields.h5");
    std::fs::copy(run, &own).unwrap();
    let text = refused(&["export", own.to_str().unwrap(), "--format", "xdmf", "--out", folder.path().to_str().unwrap()]);
    assert!(text.contains("fields.h5: is an input of this export"), "{text}");
    assert_eq!(std::fs::read(&own).unwrap(), std::fs::read(run).unwrap());
}

#[test]
fn a_target_that_cannot_be_written_is_refused_with_the_reason() {
    let (folder, run) = run_of(PANELS);
    let run = run.to_str().unwrap();
    for format in ["csv", "parquet"] {
        if format == "parquet" && !cfg!(feature = "parquet") {
            continue;
        }
        let target = folder.path().join("absent").join("table");
        let text = refused(&["export", run, "--format", format, "--out", target.to_str().unwrap()]);
        assert!(text.contains("absent/table: cannot be written: ") && text.contains("name a folder that exists"), "{text}");
    }
    let text = refused(&["export", run, "--format", "xdmf", "--out", &format!("{run}/folder")]);
    assert!(text.contains("run.h5/folder: cannot be written: Not a directory"), "{text}");
}

#[test]
fn arrays_that_cannot_be_written_are_refused_with_the_reason() {
    let (folder, run) = run_of(PANELS);
    std::fs::create_dir_all(folder.path().join("run_xdmf/fields.h5")).unwrap();
    let text = refused(&["export", run.to_str().unwrap(), "--format", "xdmf"]);
    assert!(text.contains("run_xdmf/fields.h5: cannot be written: Is a directory"), "{text}");
}

#[test]
fn a_run_without_anything_to_draw_is_refused_with_what_there_is_instead() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, run) = (folder.path().join("scene.toml"), folder.path().join("run.h5"));
    let body = "[[body]]\nname = \"hub\"\nmass = 1.0\ninertia = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n";
    let hinge = "[[hinge]]\nname = \"base\"\nkind = \"free\"\nparent = \"world\"\nchild = \"hub\"\n";
    std::fs::write(&scene, format!("{body}{hinge}[simulation]\nduration = 0.1\n[output]\nhinges = []\n")).unwrap();
    assert!(pliant(&["run", scene.to_str().unwrap(), "--out", run.to_str().unwrap()]).status.success());
    let text = refused(&["export", run.to_str().unwrap(), "--format", "xdmf"]);
    let end = "run.h5: found neither flexible bodies nor loads, expected at least one of them; export the histories with --format csv";
    assert!(text.ends_with(end), "{text}");
}

#[test]
fn cells_that_xdmf_does_not_name_are_refused_with_those_that_it_does() {
    let folder = tempfile::tempdir().unwrap();
    let modal = folder.path().join("panel.h5");
    std::fs::copy(format!("{ROOT}/modes/panel_cantilever.h5"), &modal).unwrap();
    let file = hdf5::File::open_rw(&modal).unwrap();
    let cells = file.dataset("mesh/cells").unwrap();
    cells.delete_attr("cell_type").unwrap();
    let word: hdf5::types::FixedAscii<16> = hdf5::types::FixedAscii::from_ascii("polyhedron").unwrap();
    cells.new_attr::<hdf5::types::FixedAscii<16>>().create("cell_type").unwrap().write_scalar(&word).unwrap();
    drop((cells, file));
    let text = refused(&["modes", modal.to_str().unwrap(), "--export", "xdmf"]);
    assert!(text.contains("panel.h5: mesh/cells@cell_type: found \"polyhedron\", expected one of: vertex, line, "), "{text}");
    assert!(text.ends_with("write the mesh with one of these"), "{text}");
}

/// A scene of one panel whose modal file lies beside it.
fn scene_beside_its_modal_file(folder: &Path) -> (PathBuf, PathBuf) {
    let (scene, modal) = (folder.join("scene.toml"), folder.join("panel.h5"));
    std::fs::copy(format!("{ROOT}/modes/panel_cantilever.h5"), &modal).unwrap();
    let text = "[[body]]\nname = \"panel\"\nmodal_file = \"panel.h5\"\n[[hinge]]\nname = \"root\"\nkind = \"fixed\"\nparent = \"world\"\nchild = \"panel\"\n[simulation]\nduration = 0.1\n";
    std::fs::write(&scene, text).unwrap();
    (scene, modal)
}

#[test]
fn a_modal_file_that_moved_is_found_by_its_content() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, modal) = scene_beside_its_modal_file(folder.path());
    let run = folder.path().join("run.h5");
    assert!(pliant(&["run", scene.to_str().unwrap(), "--out", run.to_str().unwrap()]).status.success());
    // the panel of the built-in example is known to the program; another content is not
    std::fs::copy(format!("{ROOT}/modes/panel_sandwich.h5"), &modal).unwrap();
    assert!(pliant(&["export", run.to_str().unwrap(), "--format", "xdmf"]).status.success());

    std::fs::copy(format!("{ROOT}/modes/panel_sandwich.h5"), &modal).unwrap();
    assert!(pliant(&["run", scene.to_str().unwrap(), "--out", run.to_str().unwrap()]).status.success());
    std::fs::copy(format!("{ROOT}/modes/boom_cantilever.h5"), &modal).unwrap();
    let text = refused(&["export", run.to_str().unwrap(), "--format", "xdmf"]);
    let found = format!("{}: body \"panel\": found {} with another content", run.display(), modal.display());
    assert!(text.contains(&found), "{text}");
    assert!(text.contains("expected the modal file whose content_sha256 begins with "), "{text}");
    assert!(text.ends_with("give it with --modal-file FILE"), "{text}");
    std::fs::remove_file(&modal).unwrap();
    let text = refused(&["export", run.to_str().unwrap(), "--format", "xdmf"]);
    assert!(text.contains("found no modal file at "), "{text}");
    let moved = ["export", run.to_str().unwrap(), "--format", "xdmf", "--modal-file", "modes/panel_sandwich.h5"];
    assert_eq!(pliant(&moved).status.code(), Some(0));
}

#[test]
fn a_damaged_results_file_is_refused_by_the_object() {
    let (folder, run) = run_of(PANELS);
    let copy = |name: &str, change: &dyn Fn(&hdf5::File)| {
        let path = folder.path().join(name);
        std::fs::copy(&run, &path).unwrap();
        change(&hdf5::File::open_rw(&path).unwrap());
        refused(&["export", path.to_str().unwrap(), "--format", "xdmf"])
    };
    let text = copy("old.h5", &|file| file.unlink("hinges/drive_left/load_point").unwrap());
    let end = "hinges/drive_left/load_point: found nothing, expected where the load acts; run the scene again with this version of pliant";
    assert!(text.ends_with(end), "{text}");
    let text = copy("short.h5", &|file| file.dataset("bodies/panel_left/position").unwrap().resize((3, 3)).unwrap());
    assert!(text.contains("short.h5: bodies/panel_left/position: found shape (3, 3), expected (16, 3): one row per output time"), "{text}");
    let text = copy("text.h5", &|file| {
        let series = file.dataset("bodies/panel_left/modal_position").unwrap();
        series.delete_attr("components").unwrap();
    });
    assert!(text.contains("modal_position@components: found \"\", expected \"mode N\" or \"residual mode N\""), "{text}");
    let text = copy("gone.h5", &|file| file.unlink("bodies/panel_left/quaternion").unwrap());
    assert!(text.contains("bodies/panel_left/quaternion: found nothing, expected a dataset"), "{text}");
    let text = copy("empty.h5", &|file| {
        let mut open = vec![file.as_group().unwrap()];
        while let Some(group) = open.pop() {
            open.extend(group.groups().unwrap());
            for series in group.datasets().unwrap().iter().filter(|d| !d.name().starts_with("/scene")) {
                let mut shape = series.shape();
                shape[0] = 0;
                series.resize(shape).unwrap();
            }
        }
    });
    assert!(text.ends_with("empty.h5: time: found no output times, expected at least one; let the run go on for longer"), "{text}");
}

#[test]
fn modes_are_written_beside_their_file_which_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let modal = folder.path().join("panel.h5");
    std::fs::copy(format!("{ROOT}/modes/panel_cantilever.h5"), &modal).unwrap();
    let output = pliant(&["modes", modal.to_str().unwrap(), "--export", "xdmf", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap();
    assert!(folder.path().join("panel.xdmf").is_file() && folder.path().join("panel.modes.xdmf").is_file());
    assert_eq!(std::fs::read(&modal).unwrap(), std::fs::read(format!("{ROOT}/modes/panel_cantilever.h5")).unwrap());

    let colon = folder.path().join("a:b.h5");
    std::fs::copy(&modal, &colon).unwrap();
    let text = refused(&["modes", colon.to_str().unwrap(), "--export", "xdmf"]);
    assert!(text.contains("a:b.h5: found the character ':' in the name") && text.ends_with("rename the file"), "{text}");
    let own = folder.path().join("panel.xdmf");
    std::fs::copy(&modal, &own).unwrap();
    let text = refused(&["modes", own.to_str().unwrap(), "--export", "xdmf"]);
    assert!(text.contains("panel.xdmf: is an input of this export"), "{text}");
}
