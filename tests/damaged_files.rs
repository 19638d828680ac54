//! Damaged modal files: `pliant check` ends by itself with exit code 0 or 2, says what is wrong, and stays within its memory.
//!
//! Each mutant is read by the built program in a process of its own, because a fault of the C library could not be caught otherwise.
#![cfg(feature = "hdf5")]

#[path = "support/damage.rs"]
mod damage;
#[path = "support/limits.rs"]
mod limits;

use damage::{KINDS, damage};
use limits::{CPU_LIMIT, run_within};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use std::path::{Path, PathBuf};
use std::process::Output;

/// Address space in KiB: the program needs 0.3 GiB, one refused array would be 2 GiB.
const ADDRESS_SPACE_KIB: u64 = 2 << 20;
/// Mutants per sample file; about 10 ms each.
const MUTANTS: usize = 250;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// Runs `pliant check` within the limits; `None` if it had to be stopped.
fn check(file: &Path) -> Option<Output> {
    run_within(&["check".as_ref(), file.as_os_str()], ADDRESS_SPACE_KIB)
}

/// What is wrong with the outcome, if anything.
fn complaint(file: &Path) -> Option<String> {
    let Some(output) = check(file) else { return Some("waits for ever".to_owned()) };
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    match output.status.code() {
        Some(0) => None,
        Some(2) if message.starts_with("error: ") && message.contains(&*file.to_string_lossy()) => None,
        Some(code) => Some(format!("exit code {code}, message {message:?}")),
        None => Some(format!("ended by a signal ({CPU_LIMIT} s are allowed): {}, message {message:?}", output.status)),
    }
}

/// Mutants of one sample; all complaints with what reproduces them.
fn stress(sample: &str, seed: u64) -> Vec<String> {
    let whole = std::fs::read(data(sample)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mutant.h5");
    let mut random = StdRng::seed_from_u64(seed);
    let mut complaints = Vec::new();
    let count = std::env::var("PLIANT_MUTANTS").ok().and_then(|text| text.parse().ok()).unwrap_or(MUTANTS);
    for index in 0..count {
        let mut bytes = whole.clone();
        let kind = random.random_range(0..KINDS);
        let kind = damage(kind, &mut bytes, &mut random);
        std::fs::write(&file, &bytes).unwrap();
        if let Some(text) = complaint(&file) {
            if let Ok(keep) = std::env::var("PLIANT_KEEP_MUTANTS") {
                std::fs::write(Path::new(&keep).join(format!("{seed}_{index}.h5")), &bytes).unwrap();
            }
            complaints.push(format!("{sample}, seed {seed}, mutant {index} ({kind}): {text}"));
        }
    }
    complaints
}

#[test]
fn samples_are_accepted() {
    for sample in ["cantilever.h5", "free_free.h5", "complete.h5"] {
        let output = check(&data(sample)).unwrap();
        assert_eq!(output.status.code(), Some(0), "{sample}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn damaged_contiguous_files_are_refused_or_read_and_never_crash() {
    let complaints = stress("cantilever.h5", 7);
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn damaged_chunked_files_are_refused_or_read_and_never_crash() {
    let complaints = stress("complete.h5", 11);
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}
