//! Modal files whose modes are duplicates or nearly dependent (S13).
#![cfg(feature = "hdf5")]

use crate::row::{Row, assert_rows};
use hdf5::File;
use hdf5::types::FixedAscii;
use pliant::io::{ModalFile, examine};
use std::path::Path;

/// Makes mode 2 of a file `mode 1 + share (mode 2)`, scaled to unit modal mass, in everything that the file holds of it.
fn blend(file: &File, share: f64) {
    let size = share.hypot(1.0);
    let change = |path: &str, mix: &dyn Fn(&mut [f64])| {
        let dataset = file.dataset(path).unwrap();
        let mut values = dataset.read_raw::<f64>().unwrap();
        mix(&mut values);
        dataset.write_raw(&values).unwrap();
    };
    let rows = |values: &mut [f64], width: usize| {
        for i in 0..width {
            values[width + i] = (values[i] + share * values[width + i]) / size;
        }
    };
    let first = file.dataset("modes/displacement/0000").unwrap().read_raw::<f64>().unwrap();
    change("modes/displacement/0001", &|v| v.iter_mut().zip(&first).for_each(|(x, f)| *x = (f + share * *x) / size));
    change("inertia/momentum", &|v| rows(v, 3));
    change("inertia/first_moment", &|v| rows(v, 9));
    let modes = file.dataset("modes/frequency").unwrap().size();
    change("inertia/second_moment", &|v| {
        rows(v, 9 * modes);
        v.chunks_mut(9 * modes).for_each(|row| rows(row, 9));
    });
    for name in file.group("interfaces").unwrap().member_names().unwrap() {
        change(&format!("interfaces/{name}/displacement"), &|v| rows(v, 6));
    }
}

fn refusal(share: f64) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cantilever.h5");
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/cantilever.h5"), &path).unwrap();
    let file = File::open_rw(&path).unwrap();
    blend(&file, share);
    file.close().unwrap();
    let digest = ModalFile::open(&path).and_then(|file| file.content_sha256()).unwrap();
    let file = File::open_rw(&path).unwrap();
    file.delete_attr("content_sha256").unwrap();
    let attribute = file.new_attr::<FixedAscii<64>>().create("content_sha256").unwrap();
    attribute.write_scalar(&FixedAscii::<64>::from_ascii(&digest).unwrap()).unwrap();
    file.close().unwrap();
    assert_eq!(ModalFile::load(&path).is_err(), !examine(&path).messages().is_empty());
    ModalFile::load(&path).err().map(|e| e.to_string())
}

#[test]
fn files_of_dependent_modes_are_refused() {
    let rows = [(0.0, "mode 2 is mode 1"), (1e-8, "mode 2 is mode 1 to 1e-8"), (1e-3, "mode 2 is mode 1 to 1e-3")].map(|(share, what)| {
        Row::says("S13", format!("modal file whose {what}"), refusal(share), &["cantilever.h5", "inertia/second_moment"])
    });
    assert_rows(&rows);
}
