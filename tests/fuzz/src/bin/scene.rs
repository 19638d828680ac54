//! Scenes: from the text to one evaluation of the assembled system, with a modal file and an XDMF file beside them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pliant::output::Evaluation;
use pliant::scene::error::Source;
use pliant::scene::{Overrides, assemble};
use pliant_fuzz::{check_name, folder, keep};
use std::sync::OnceLock;

static BESIDE: OnceLock<()> = OnceLock::new();

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    BESIDE.get_or_init(|| {
        let write = |name: &str, bytes: &[u8]| std::fs::write(folder().join(name), bytes).expect("the folder can be written");
        write("m.h5", include_bytes!("../../../data/cantilever.h5"));
        write("f.h5", include_bytes!("../../../data/free_free.h5"));
        write("i.xdmf", include_bytes!("../../../data/import/beam_inline.xdmf"));
    });
    let path = folder().join("scene.toml");
    if std::env::var_os("PLIANT_FUZZ_KEEP").is_some() {
        std::fs::write(&path, data).expect("the folder can be written");
        keep(&[&path]);
    }
    let source = Source { path: path.clone(), text: text.to_owned() };
    match assemble::assemble(source, &Overrides::default()) {
        // a system that is singular where it stands is an error of its own
        Ok(scene) => drop(Evaluation::of(&scene.system, &scene.state)),
        // lines of the scene are shown as they are; the program prints them without control characters
        Err(error) => check_name(&error.to_string(), &path),
    }
});
