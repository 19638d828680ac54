//! The architecture as a test: a layer uses only layers before it, foreign crates stay in their rooms, every file says what it is.

use std::fs;
use std::path::{Path, PathBuf};

/// Layers in order; a file may use its own and those before it.
const LAYERS: [&str; 10] = ["spatial", "model", "dynamics", "integrate", "io", "scene", "output", "study", "campaign", "cli"];

/// Foreign crates that only some places may use.
const CONFINED: [(&str, &[&str]); 11] = [
    ("plotters", &["src/study/plot.rs"]),
    ("hdf5::", &["src/io/"]),
    ("ndarray::", &["src/io/"]),
    ("rand_distr::", &["src/campaign/draw.rs"]),
    ("quick_xml", &["src/io/"]),
    ("rerun::", &["src/output/rerun/"]),
    ("clap", &["src/cli/"]),
    ("indicatif", &["src/cli/"]),
    ("println!", &["src/cli/"]),
    ("eprintln!", &["src/cli/"]),
    ("process::exit", &[]),
];

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Files under src with their path from the root and their text without comment lines.
fn sources() -> Vec<(String, String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    rust_files(&root.join("src"), &mut files);
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let code = text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
        (path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/"), text, code)
    };
    files.into_iter().map(read).collect()
}

#[test]
fn layers_use_only_layers_before_them() {
    for (path, _, code) in sources() {
        let Some(layer) = LAYERS.iter().position(|l| path.starts_with(&format!("src/{l}/"))) else {
            continue;
        };
        assert!(!code.contains("crate::{"), "{path}: name each use, crate::{{...}} hides layers from this test");
        for later in &LAYERS[layer + 1..] {
            assert!(!code.contains(&format!("crate::{later}::")), "{path} of layer {} uses the later layer {later}", LAYERS[layer]);
        }
    }
}

#[test]
fn every_folder_of_src_is_a_layer() {
    for entry in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            assert!(LAYERS.contains(&path.file_name().unwrap().to_str().unwrap()), "{} is no layer", path.display());
        }
    }
}

#[test]
fn foreign_crates_and_printing_stay_in_their_rooms() {
    for (path, _, code) in sources() {
        for (word, rooms) in CONFINED {
            if rooms.iter().any(|room| path.starts_with(room)) {
                continue;
            }
            let used = code.lines().any(|line| {
                // `crate::output::rerun::` and the like are our own modules
                line.match_indices(word).any(|(at, _)| {
                    let before = line[..at].chars().next_back();
                    before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != ':')
                })
            });
            assert!(!used, "{path} uses {word}, which belongs to {rooms:?}");
        }
    }
}

#[test]
fn every_file_begins_by_saying_what_it_is() {
    for (path, text, _) in sources() {
        assert!(text.starts_with("//!"), "{path} has no //! header");
    }
}

#[test]
fn the_top_level_holds_what_a_user_needs_and_nothing_else() {
    let allowed = [
        "Cargo.toml",
        "Cargo.lock",
        "src",
        "modes",
        "examples",
        "tests",
        "scripts",
        "README.md",
        "LICENSE-MIT",
        "LICENSE-APACHE",
        ".ci",
        ".gitignore",
        ".cargo",
        "rustfmt.toml",
        "clippy.toml",
    ];
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let ignored = [".git", "target", ".venv", "out", ".pytest_cache"];
    for entry in fs::read_dir(root).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        assert!(allowed.contains(&name.as_str()) || ignored.contains(&name.as_str()), "{name} at the top level");
    }
}
