//! Residual modes against all modes of the file: the basis, static loads, histories on the panel slew, and what the estimate of
//! left-out modes says where they are missing.
#![cfg(feature = "hdf5")]

use nalgebra::{Cholesky, DMatrix, DVector};
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::io::ModalFile;
use pliant::model::ModeBasis;
use pliant::model::modal_body::ModalBody;
use pliant::model::mode_basis::interface_loads;
use pliant::scene::{Overrides, Scene, assemble};
use serde_json::Value;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

const SLEW: &str = "examples/11_panel_slew/scene.toml";

fn panel() -> ModalBody {
    ModalFile::load_body(&root().join("modes/panel_40_modes.h5")).unwrap().1
}

fn outboard(body: &ModalBody) -> Vec<DVector<f64>> {
    interface_loads(body.interface("outboard").unwrap())
}

fn lowest(n: usize) -> Vec<usize> {
    (0..n).collect()
}

fn stiffness(body: &ModalBody) -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_iterator(body.mode_count(), body.frequency_hz.iter().map(|f| (TAU * f).powi(2))))
}

#[test]
fn the_basis_and_its_rest_are_orthonormal_and_uncoupled_in_stiffness() {
    let body = panel();
    let basis = ModeBasis::with_residual(&body, vec![0, 1, 2, 5, 9], &outboard(&body)).unwrap();
    let (retained, rest) = (basis.matrix(), basis.left_out(&body));
    assert_eq!(retained.ncols() + rest.ncols(), 40);
    let all = DMatrix::from_columns(&retained.column_iter().chain(rest.column_iter()).collect::<Vec<_>>());
    // Gram-Schmidt by factorisations of 40 x 40: n eps
    assert!((all.transpose() * &all - DMatrix::identity(40, 40)).amax() < 40.0 * f64::EPSILON);
    let projected = retained.transpose() * stiffness(&body) * &retained;
    let highest = projected.diagonal().amax();
    for i in 0..projected.nrows() {
        for j in 0..i {
            assert!(projected[(i, j)].abs() < 40.0 * f64::EPSILON * highest, "{i} {j}");
        }
    }
    // the modes that are kept whole are not touched
    let combined = body.with_basis(&basis);
    assert_eq!(combined.frequency_hz[..5], [0, 1, 2, 5, 9].map(|j: usize| body.frequency_hz[j]));
    assert_eq!(combined.momentum[3], body.momentum[5]);
}

#[test]
fn static_answers_are_those_of_all_modes() {
    let body = panel();
    let full = stiffness(&body);
    let loads = outboard(&body);
    for count in [0, 1, 6, 20] {
        let basis = ModeBasis::with_residual(&body, lowest(count), &loads).unwrap();
        let matrix = basis.matrix();
        let reduced = Cholesky::new(matrix.transpose() * &full * &matrix).unwrap();
        let truncated = lowest(count);
        for (i, load) in loads.iter().chain(&inertial(&body)).enumerate() {
            let exact = load.dot(&Cholesky::new(full.clone()).unwrap().solve(load));
            let found = load.dot(&(&matrix * reduced.solve(&matrix.tr_mul(load))));
            // energy is of second order in what the rank decision leaves out (1e-6 of the largest answer)
            assert!((found / exact - 1.0).abs() < 1e-11, "{count} modes, load {i}: {found:e} for {exact:e}");
            let without: f64 = truncated.iter().map(|&j| load[j].powi(2) / full[(j, j)]).sum();
            assert!(without < exact);
        }
    }
}

/// Work of unit linear accelerations on the modes.
fn inertial(body: &ModalBody) -> Vec<DVector<f64>> {
    (0..3).map(|a| DVector::from_iterator(40, body.momentum.iter().map(|p| p[a]))).collect()
}

fn scene(text: impl Fn(String) -> String, overrides: &Overrides) -> Scene {
    let path = root().join(SLEW);
    let text = text(std::fs::read_to_string(&path).unwrap());
    assemble::assemble(pliant::scene::error::Source { path, text }, overrides).unwrap()
}

#[test]
fn a_basis_that_spans_all_modes_moves_as_all_modes_do() {
    // 39 modes and residual modes span all 40, in other coordinates
    let all = scene(|t| t, &Overrides { modes: Some(40), ..Overrides::default() });
    let rotated = scene(|t| t, &Overrides { modes: Some(39), residual_modes: Some(true), ..Overrides::default() });
    assert_eq!(all.system.modal_count, rotated.system.modal_count);
    let load = |scene: &Scene| {
        let mut state = scene.state.clone();
        state.time = 0.5;
        state.velocity.iter_mut().enumerate().for_each(|(i, v)| *v = 0.02 * (i as f64 + 1.0));
        let mut workspace = Workspace::new(&scene.system);
        forward_dynamics(&scene.system, &state, &mut workspace).unwrap();
        (0..3).map(|k| pliant::dynamics::hinge_load::hinge_load(&workspace, k)).collect::<Vec<_>>()
    };
    for (a, b) in load(&all).iter().zip(load(&rotated)).skip(1) {
        assert!((a - b).amax() < 1e-12 * a.amax(), "{a} {b}");
    }
}

fn run(arguments: &[&str]) -> Value {
    let done = Command::new(env!("CARGO_BIN_EXE_pliant")).args(arguments).arg("--json").output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

#[test]
fn six_modes_with_residual_modes_give_the_loads_of_forty_on_the_panel_slew() {
    let path = root().join(SLEW).display().to_string();
    let lists = ["--integrators", "rosenbrock_w", "--tolerances", "1e-5", "--repeat", "1"];
    let report = run(&[&["study", &path, "--modes", "6,40", "--residual-modes", "off,on"], &lists[..]].concat());
    let error = |modes: u64, residual: bool| {
        let points = report["points"].as_array().unwrap();
        let point = points.iter().find(|p| p["modes"] == modes && p["residual_modes"] == residual).unwrap();
        point["error"]["peak"].as_f64().unwrap()
    };
    let integration = error(40, false);
    assert!(integration < 2e-3, "{integration}");
    // 0.22 without; with them only what the integration leaves
    assert!(error(6, false) > 0.1);
    assert!(error(6, true) < 2e-3, "{}", error(6, true));
}

/// The slew with `count` modes, without residual modes.
fn plain_slew(folder: &Path, count: usize) -> Value {
    let text = std::fs::read_to_string(root().join(SLEW)).unwrap();
    let text = text.replace("residual_modes = true\n", "").replace("../..", &root().display().to_string());
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    run(&["run", &path.display().to_string(), "--modes", &count.to_string()])
}

#[test]
fn the_estimate_of_left_out_modes_follows_what_they_change() {
    let folder = tempfile::tempdir().unwrap();
    let all = plain_slew(folder.path(), 40);
    assert!(all["truncation"].is_null(), "nothing is left out");
    let places = [
        ("hinges", "root", "force"),
        ("hinges", "fold", "force"),
        ("hinges", "fold", "moment"),
        ("bodies", "inner", "von_mises"),
        ("bodies", "outer", "von_mises"),
    ];
    let mut last = [f64::INFINITY; 5];
    for count in [2, 6, 20] {
        let run = plain_slew(folder.path(), count);
        for (i, (kind, name, quantity)) in places.into_iter().enumerate() {
            let peak = |r: &Value| r["peaks"][kind][name][quantity].as_f64().unwrap();
            let change = (peak(&run) / peak(&all) - 1.0).abs();
            let estimate = run["truncation"][kind][name][quantity].as_f64().unwrap() / peak(&run);
            // the first term of a series: a third to three times the change, beside what the integration leaves
            assert!(estimate > change / 3.5 - 1e-3, "{count} modes, {name} {quantity}: {estimate:.2e} for {change:.2e}");
            assert!(estimate < 3.5 * change + 3e-3, "{count} modes, {name} {quantity}: {estimate:.2e} for {change:.2e}");
            assert!(estimate < last[i]);
            last[i] = estimate;
        }
        let warned = run["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains("left out"));
        assert_eq!(warned, count < 20, "{count}: {}", run["warnings"]);
    }
    // residual modes leave nothing of note
    let with = run(&["run", &root().join(SLEW).display().to_string()]);
    for (kind, name, quantity) in places {
        let share = with["truncation"][kind][name][quantity].as_f64().unwrap() / with["peaks"][kind][name][quantity].as_f64().unwrap();
        assert!(share < 1e-3, "{name} {quantity}: {share:e}");
    }
    assert_eq!(with["warnings"].as_array().map(Vec::len), Some(0));
}

#[test]
fn the_key_is_refused_where_it_cannot_be_and_its_modes_are_named() {
    let text = "[[body]]\nname = \"hub\"\nmass = 1.0\nresidual_modes = true\n[[hinge]]\nname = \"h\"\nkind = \"free\"\nparent = \"world\"\nchild = \"hub\"\n";
    let source = pliant::scene::error::Source { path: "scene.toml".into(), text: text.into() };
    let error = assemble::assemble(source, &Overrides::default()).unwrap_err().to_string();
    assert!(error.contains("body \"hub\" has no modal_file; residual_modes belongs to flexible bodies"), "{error}");
    let scene = scene(|t| t, &Overrides::default());
    let inner = scene.system.body_index("inner").unwrap();
    let names = &scene.system.bodies[inner].flexible().unwrap().mode_names;
    assert_eq!((names[5].as_str(), names[6].as_str()), ("mode 6", "residual mode 1"));
    assert!(scene.left_out.iter().any(|l| l.starts_with("34 of 40 modes of \"inner\" (9 residual modes added)")), "{:?}", scene.left_out);
}

#[test]
fn an_exported_run_deforms_by_its_residual_modes_too() {
    let folder = tempfile::tempdir().unwrap();
    let displacement = |modes: &str| {
        let (results, out) = (folder.path().join(format!("{modes}.h5")), folder.path().join(modes));
        let (results, out) = (results.display().to_string(), out.display().to_string());
        let slew = root().join(SLEW).display().to_string();
        run(&["run", &slew, "--modes", modes, "--duration", "1.5", "--out", &results]);
        let exported = run(&["export", &results, "--format", "xdmf", "--out", &out, "--body", "inner"]);
        let files: Vec<_> = exported["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap().to_owned()).collect();
        let heavy = files.iter().find(|f| f.ends_with(".h5")).unwrap();
        let file = hdf5::File::open(heavy).unwrap();
        let group = file.group("inner/displacement_body").unwrap();
        let last = group.member_names().unwrap().into_iter().max().unwrap();
        group.dataset(&last).unwrap().read_2d::<f32>().unwrap()
    };
    let (few, all) = (displacement("6"), displacement("40"));
    let largest = all.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    let worst = few.iter().zip(&all).fold(0.0_f32, |m, (a, b)| m.max((a - b).abs()));
    // 2e-2 without residual modes; with them what the local shape of higher modes leaves
    assert!(worst < 1e-3 * largest, "{worst:e} of {largest:e}");
}
