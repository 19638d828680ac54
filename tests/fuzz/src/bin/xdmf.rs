//! XDMF files with their HDF5 items, imported to the body that a run would use.
//!
//! An input is the text of the XDMF file and, after a zero byte, the number of the keys to import it with and the edits of the HDF5 file
//! that lies beside it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pliant_fuzz::{Seed, build, folder, import, keep, options};
use std::sync::OnceLock;

static SEEDS: OnceLock<Vec<Seed>> = OnceLock::new();

fuzz_target!(|data: &[u8]| {
    let (file, items) = (folder().join("fuzz.xdmf"), folder().join("beam.h5"));
    let seeds = SEEDS.get_or_init(|| vec![Seed::of(include_bytes!("../../../data/import/beam.h5"), &items)]);
    let end = data.iter().position(|&byte| byte == 0);
    let (text, rest) = end.map_or((data, &[][..]), |end| (&data[..end], &data[end + 1..]));
    build(seeds, rest, &items);
    std::fs::write(&file, text).expect("the folder can be written");
    keep(&[&file, &items]);
    let options = options(&[
        include_str!("../../../data/import/beam.xdmf.toml"),
        include_str!("../../../data/import/mixed.xdmf.toml"),
        // asks for little, so that a short text can pass
        "displacement = \"u\"\nfrequency_hz = [1.0]\nareal_density = 5.0\ndamping_ratio = 0.0\nmodes = [1]\ninterface.root.nodes = [0, 1, 2]",
        "displacement = \"displacement\"\nrotation = \"displacement\"\nnode_mass = \"ROOT\"\ndamping_ratio = 0.0\ninterface.root.nodes = [0]",
    ]);
    import(&file, &options[usize::from(rest.first().copied().unwrap_or(0)) % options.len()]);
});
