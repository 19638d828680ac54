//! Damaged and hostile files of other codes: `pliant import` ends by itself with exit code 0 or 2, says what is wrong, and stays within its memory.
//!
//! Each mutant is read by the built program in a process of its own, because a fault of the C library could not be caught otherwise. Mutants are
//! made by damage to bytes and, in XML, by exchanging words for such as a hostile writer would choose. PLIANT_MUTANTS=20000 makes
//! 100,000 of them over the five samples; PLIANT_KEEP_MUTANTS=FOLDER keeps those that fail.
#![cfg(feature = "hdf5")]

#[path = "support/damage.rs"]
mod damage;
#[path = "support/limits.rs"]
mod limits;

use damage::KINDS;
use limits::{CPU_LIMIT, run_within};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::{Duration, Instant};

/// Address space in KiB; what the program holds is less.
const ADDRESS_SPACE_KIB: u64 = 1 << 20;
/// Mutants per sample; about 10 ms each.
const MUTANTS: usize = 150;
/// What stands in XML in place of a word.
const WORDS: [&str; 22] = [
    "18446744073709551615",
    "9223372036854775807 9223372036854775807",
    "-1",
    "0",
    "1e400",
    "nan",
    "4294967296 3",
    "&bomb;",
    "<!DOCTYPE x [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY bomb \"&a;&a;&a;\">]>",
    "../../../etc/passwd:/data0",
    "/etc/passwd:/data0",
    "beam.h5:/",
    "beam.h5:/data1",
    "missing.h5:/data0",
    "xpointer(//Grid[@Name=\"TimeSeries_meshio\"]/Grid[1]/*)",
    "<Grid>",
    "</Grid>",
    "Mixed",
    "Hexahedron_27",
    "HyperSlab",
    "Binary",
    "\u{0}\u{1b}[2J",
];

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name)
}

/// Runs `pliant import` within the limits; `None` if it had to be stopped.
fn import(file: &Path, keys: &Path) -> Option<Output> {
    let out = file.with_file_name("out.h5");
    run_within(
        &["import".as_ref(), file.as_os_str(), "--keys".as_ref(), keys.as_os_str(), "--out".as_ref(), out.as_os_str()],
        ADDRESS_SPACE_KIB,
    )
}

/// What is wrong with the outcome, if anything.
fn complaint(file: &Path, keys: &Path) -> Option<String> {
    let Some(output) = import(file, keys) else { return Some("waits for ever".to_owned()) };
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    let folder = file.parent().unwrap().to_string_lossy().into_owned();
    let printable = |text: &str| text.chars().all(|c| c == '\n' || !c.is_control());
    match output.status.code() {
        Some(0) => None,
        Some(2) if message.starts_with("error: ") && message.contains(&folder) && printable(&message) => None,
        Some(code) => Some(format!("exit code {code}, message {message:?}")),
        None => Some(format!("ended by a signal ({CPU_LIMIT} s are allowed): {}, message {message:?}", output.status)),
    }
}

/// One seeded kind of damage.
fn damage(bytes: &mut Vec<u8>, random: &mut StdRng, text: bool) -> &'static str {
    match random.random_range(0..if text { KINDS + 3 } else { KINDS }) {
        kind if kind < KINDS => damage::damage(kind, bytes, random),
        // what stands between quotes, tags or blanks, exchanged
        _ => {
            let is_edge = |b: &u8| b"\"'<> \n".contains(b);
            let edges: Vec<usize> = bytes.iter().enumerate().filter(|(_, b)| is_edge(b)).map(|(i, _)| i).collect();
            for _ in 0..random.random_range(1..=2) {
                let edge = edges[random.random_range(0..edges.len())];
                if edge + 1 < bytes.len() {
                    let end = bytes[edge + 1..].iter().position(is_edge).map_or(bytes.len(), |n| edge + 1 + n);
                    bytes.splice(edge + 1..end, WORDS[random.random_range(0..WORDS.len())].bytes());
                }
            }
            "words exchanged"
        }
    }
}

/// Mutants of one file of a sample, whose other files stay whole; all complaints with what reproduces them.
fn stress(sample: &str, damaged: &[&str], seed: u64) {
    let folder = tempfile::tempdir().unwrap();
    let wholes: Vec<(PathBuf, Vec<u8>)> =
        damaged.iter().map(|name| (folder.path().join(name), std::fs::read(data(name)).unwrap())).collect();
    let (file, keys) = (folder.path().join(sample), data(&format!("{sample}.toml")));
    let mut random = StdRng::seed_from_u64(seed);
    let mut complaints = Vec::new();
    let count = std::env::var("PLIANT_MUTANTS").ok().and_then(|text| text.parse().ok()).unwrap_or(MUTANTS);
    let mut slowest = Duration::ZERO;
    for index in 0..count {
        let victim = index % wholes.len();
        let mut kind = "";
        for (number, (path, whole)) in wholes.iter().enumerate() {
            let mut bytes = whole.clone();
            if number == victim {
                kind = damage(&mut bytes, &mut random, path.extension().is_some_and(|e| e == "xdmf"));
            }
            std::fs::write(path, &bytes).unwrap();
        }
        let start = Instant::now();
        if let Some(text) = complaint(&file, &keys) {
            if let Ok(keep) = std::env::var("PLIANT_KEEP_MUTANTS") {
                let name = wholes[victim].0.file_name().unwrap().to_string_lossy().into_owned();
                std::fs::copy(&wholes[victim].0, Path::new(&keep).join(format!("{seed}_{index}_{name}"))).unwrap();
            }
            complaints.push(format!("{sample}, seed {seed}, mutant {index} ({kind}): {text}"));
        }
        slowest = slowest.max(start.elapsed());
    }
    println!("{sample}: {count} mutants, slowest {slowest:?}");
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn samples_are_imported() {
    for sample in ["beam.xdmf", "beam_inline.xdmf", "mixed.xdmf", "beam.med", "beam_h5py.med", "plate.med"] {
        let folder = tempfile::tempdir().unwrap();
        for name in [sample, "beam.h5"] {
            std::fs::copy(data(name), folder.path().join(name)).unwrap();
        }
        let output = import(&folder.path().join(sample), &data(&format!("{sample}.toml"))).unwrap();
        assert_eq!(output.status.code(), Some(0), "{sample}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn damaged_xdmf_files_with_hdf5_are_refused_or_read_and_never_crash() {
    stress("beam.xdmf", &["beam.xdmf", "beam.h5"], 21);
}

#[test]
fn damaged_inline_xdmf_files_are_refused_or_read_and_never_crash() {
    stress("beam_inline.xdmf", &["beam_inline.xdmf"], 22);
}

#[test]
fn damaged_mixed_xdmf_files_are_refused_or_read_and_never_crash() {
    stress("mixed.xdmf", &["mixed.xdmf"], 23);
}

#[test]
fn damaged_files_of_the_med_library_are_refused_or_read_and_never_crash() {
    stress("beam.med", &["beam.med"], 24);
}

#[test]
fn damaged_med_files_with_shells_are_refused_or_read_and_never_crash() {
    stress("plate.med", &["plate.med"], 25);
}
