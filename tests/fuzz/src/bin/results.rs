//! Results files: read back and exported, as a table and as pictures.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pliant::integrate::simulate::{Settings, simulate};
use pliant::io::ResultsReader;
use pliant::output::export::{ExportError, ModalSource, Motion, TableFormat, write_motion, write_table};
use pliant::output::{OutputSet, scene_plan};
use pliant::scene::error::Source;
use pliant::scene::{Overrides, assemble};
use pliant_fuzz::{Seed, build, check_message, folder, keep};
use std::sync::OnceLock;
use std::time::Duration;

/// A boom on a hinge with a body at its tip, a few output times long.
const SCENE: &str = r#"
body = [{ name = "boom", modal_file = "cantilever.h5", damping_ratio = 0.05 }, { name = "tip", mass = 1.0 }]
hinge = [
    { name = "root", kind = "revolute", axes = [[0.0, 1.0, 0.0]], parent = "world", child = "boom" },
    { name = "end", kind = "fixed", parent = "boom", parent_node = "tip", child = "tip" },
]
load = [{ body = "tip", force = { constant = [0.0, 0.0, 1.0] } }]
simulation = { duration = 0.03 }
output = { rate_hz = 100.0 }
"#;

static SEEDS: OnceLock<Vec<Seed>> = OnceLock::new();

fuzz_target!(|data: &[u8]| {
    let file = folder().join("run.h5");
    let seeds = SEEDS.get_or_init(|| vec![Seed::of(run().leak(), &file)]);
    build(seeds, data, &file);
    keep(&[&file]);
    if let Err(error) = export(&file) {
        check_message(&error, folder());
    }
});

/// The results file of the scene.
fn run() -> Vec<u8> {
    let (modal, file) = (folder().join("cantilever.h5"), folder().join("run.h5"));
    std::fs::write(&modal, include_bytes!("../../../data/cantilever.h5")).expect("the folder can be written");
    let source = Source { path: folder().join("scene.toml"), text: SCENE.to_owned() };
    let scene = assemble::assemble(source, &Overrides::default()).expect("a sound scene");
    let plan = scene_plan::plan(&scene, false).expect("a sound scene");
    let mut outputs = OutputSet::new(&scene.system, plan).expect("a sound scene");
    outputs.write_results(&file).expect("the folder can be written");
    let settings = Settings { duration: 0.03, method: scene.method, rate_hz: scene.rate_hz };
    let summary = simulate(&scene.system, &scene.state, &settings, &mut [&mut outputs]);
    let _ = outputs.finish(&summary, "dormand_prince", Duration::ZERO, Vec::new());
    std::fs::read(&file).expect("the run has written it")
}

fn export(file: &std::path::Path) -> Result<(), String> {
    let results = ResultsReader::open(file).map_err(|error| error.to_string())?;
    let said = |error: ExportError| error.to_string();
    // both, whatever the first says
    let table = write_table(&results, TableFormat::Csv, &folder().join("run.csv"), 1).map_err(said);
    let motion = Motion {
        folder: folder().join("run_xdmf"),
        bodies: Vec::new(),
        every: 1,
        modal: ModalSource { files: vec![folder().join("cantilever.h5")] },
    };
    let motion = write_motion(&results, &motion).map_err(said);
    table.and(motion).map(drop)
}
