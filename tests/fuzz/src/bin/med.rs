//! MED files, imported to the body that a run would use.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pliant_fuzz::{Seed, build, folder, import, keep, options};
use std::sync::OnceLock;

static SEEDS: OnceLock<Vec<Seed>> = OnceLock::new();

fuzz_target!(|data: &[u8]| {
    let file = folder().join("fuzz.med");
    let seeds = SEEDS.get_or_init(|| {
        let of = |bytes| Seed::of(bytes, &file);
        vec![
            of(include_bytes!("../../../data/import/beam_h5py.med")),
            of(include_bytes!("../../../data/import/plate.med")),
            of(include_bytes!("../../../data/import/beam.med")),
        ]
    });
    build(seeds, data, &file);
    keep(&[&file]);
    let options = options(&[
        include_str!("../../../data/import/beam_h5py.med.toml"),
        include_str!("../../../data/import/plate.med.toml"),
        include_str!("../../../data/import/beam.med.toml"),
    ]);
    // the keys of the file, chosen by the same byte
    import(&file, &options[usize::from(data.first().copied().unwrap_or(0)) % options.len()]);
});
