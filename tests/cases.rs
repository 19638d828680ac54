//! Worked cases: random scenes of every hinge kind and mode set, with results of an independent first-principles program.
//!
//! `tests/data/cases` holds scene, modal files and expected result; the expected numbers hold to about 1e-15 x condition.
#![cfg(feature = "hdf5")]

use pliant::output::Evaluation;
use pliant::scene::{Overrides, assemble};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn cases() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/cases");
    let mut scenes: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
    scenes.sort();
    scenes
}

/// All numbers of one quantity in a case, expected and found.
#[derive(Default)]
struct Quantity(Vec<(f64, f64)>);

impl Quantity {
    fn add(&mut self, expected: &Value, found: &[f64]) {
        let expected: Vec<f64> = expected.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        assert_eq!(expected.len(), found.len());
        self.0.extend(expected.into_iter().zip(found.iter().copied()));
    }

    /// Largest error over the largest expected entry, or over `floor` where the physics makes all entries zero.
    fn error(&self, floor: f64) -> f64 {
        let size = self.0.iter().fold(floor, |m, (e, _)| m.max(e.abs()));
        self.0.iter().fold(0.0_f64, |m, (e, f)| m.max((e - f).abs())) / size
    }
}

#[test]
fn every_case_is_reproduced_within_its_condition() {
    let scenes = cases();
    assert!(scenes.len() >= 30, "{} cases found", scenes.len());
    for path in scenes {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let expected: Value = serde_json::from_str(&std::fs::read_to_string(path.with_extension("json")).unwrap()).unwrap();
        let looped = expected["closures"].as_object().is_some_and(|c| !c.is_empty());
        for method in if looped { ["tree_augmented", "constraint_embedding"].as_slice() } else { &["auto"] } {
            compare(&path, &format!("{name}, {method}"), method, &expected);
        }
    }
}

fn compare(path: &Path, name: &str, method: &str, expected: &Value) {
    let overrides = Overrides { closure_method: Some(method.to_owned()), ..Overrides::default() };
    let scene = assemble::load(path, &overrides).unwrap();
    let found = Evaluation::of(&scene.system, &scene.state).unwrap();

    let [mut acceleration, mut moment, mut force, mut modal] = <[Quantity; 4]>::default();
    for (hinge, value) in expected["hinges"].as_object().unwrap() {
        let record = found.hinges.get(hinge).unwrap();
        acceleration.add(&value["acceleration"], &record.acceleration);
        moment.add(&value["load"]["moment"], &record.load.moment);
        force.add(&value["load"]["force"], &record.load.force);
    }
    for (body, value) in expected["bodies"].as_object().unwrap() {
        modal.add(&value["modal_acceleration"], &found.bodies.get(body).unwrap().modal_acceleration);
    }
    for (closure, value) in expected["closures"].as_object().into_iter().flatten() {
        let record = found.closures.get(closure).unwrap();
        moment.add(&value["load"]["moment"], &record.load.moment);
        force.add(&value["load"]["force"], &record.load.force);
        assert!(record.residual < 1e-12, "{name}: {closure} is open by {:e}", record.residual);
    }
    let condition = expected["condition"].as_f64().unwrap();
    // the tolerance the cases are published with: their own accuracy is 1e-15 x condition
    let allowed = 1e-9 + 2e-14 * condition;
    // arms in the cases are about 1 m long: a moment is measured against the forces where all moments vanish
    let force_size = force.0.iter().fold(0.0_f64, |m, (e, _)| m.max(e.abs()));
    for (what, error) in [
        ("hinge acceleration", acceleration.error(0.0)),
        ("moment", moment.error(1e-3 * force_size)),
        ("force", force.error(0.0)),
        ("modal acceleration", if modal.0.is_empty() { 0.0 } else { modal.error(0.0) }),
        ("kinetic energy", (found.energy.kinetic / expected["energy"]["kinetic"].as_f64().unwrap() - 1.0).abs()),
        ("load audit", found.audit.load_residual),
    ] {
        assert!(error <= allowed, "{name}: {what} is off by {error:e}, allowed {allowed:e}");
    }
}
