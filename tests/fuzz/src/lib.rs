//! What the fuzz targets share: a private folder, and HDF5 files made from a sound one by a list of edits.

mod edits;

pub use edits::{Seed, build};

use pliant::io::import::ImportOptions;
use pliant::scene::ImportSpec;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A folder of this process alone; `TMPDIR` says where (scripts/fuzz.sh puts it into memory and removes it).
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| tempfile::Builder::new().prefix("pliant-fuzz").tempdir().expect("TMPDIR can be written").keep())
}

/// A message must name the file, in characters that a terminal does not obey and in a length that can be read.
pub fn check_message(message: &str, file: &Path) {
    check_name(message, file);
    assert!(message.chars().all(|c| c == '\n' || !c.is_control()), "control characters: {message:?}");
    assert!(message.len() < 20_000, "a message of {} bytes", message.len());
}

/// A message must name the file.
pub fn check_name(message: &str, file: &Path) {
    assert!(message.contains(&*file.to_string_lossy()), "the file is not named: {message}");
}

/// With PLIANT_FUZZ_KEEP=FOLDER, the files of the last input are copied there, for `pliant import` and `pliant check`.
pub fn keep(files: &[&Path]) {
    let Some(folder) = std::env::var_os("PLIANT_FUZZ_KEEP") else { return };
    for file in files {
        let name = file.file_name().expect("a file");
        std::fs::copy(file, Path::new(&folder).join(name)).expect("PLIANT_FUZZ_KEEP is a folder that can be written");
    }
}

/// Options of import from keys as `pliant import --keys` takes them.
pub fn options(keys: &[&str]) -> &'static [ImportOptions] {
    static OPTIONS: OnceLock<Vec<ImportOptions>> = OnceLock::new();
    let parse = |text: &&str| toml::from_str::<ImportSpec>(text).expect("keys of an import").options().expect("sound keys");
    OPTIONS.get_or_init(|| keys.iter().map(parse).collect())
}

/// Imports a file into a body and reads what pictures need of it.
pub fn import(file: &Path, options: &ImportOptions) {
    match pliant::io::import::import(file, options) {
        Ok((modal, body)) => {
            // what the importer has written itself holds every rule
            let all: Vec<usize> = (0..body.mode_count()).collect();
            modal.read_surface(&all).expect("the surface of an imported body");
            modal.read_mode_kinds().expect("the kinds of its modes");
        }
        Err(error) => {
            let folder = file.parent().expect("a file in a folder");
            check_message(&error.to_string(), folder);
        }
    }
}
