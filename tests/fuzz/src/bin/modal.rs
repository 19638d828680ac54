//! Modal files of schema 1.0: every rule, the body, and what pictures and exports read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pliant::io::{ModalFile, examine};
use pliant::model::modal_body::ModalBody;
use pliant_fuzz::{Seed, build, check_message, folder, keep};
use std::sync::OnceLock;

static SEEDS: OnceLock<Vec<Seed>> = OnceLock::new();

fuzz_target!(|data: &[u8]| {
    let file = folder().join("modal.h5");
    let seeds = SEEDS.get_or_init(|| {
        let of = |bytes| Seed::of(bytes, &file);
        vec![
            of(include_bytes!("../../../data/cantilever.h5")),
            of(include_bytes!("../../../data/complete.h5")),
            of(include_bytes!("../../../data/free_free.h5")),
        ]
    });
    build(seeds, data, &file);
    keep(&[&file]);
    let examination = examine(&file);
    examination.messages().iter().for_each(|message| check_message(message, &file));
    if let Err(error) = examination.into_accepted().and_then(|(modal, body)| use_up(&modal, &body)) {
        check_message(&error.to_string(), &file);
    }
});

/// What a run and an export read of an accepted file.
fn use_up(modal: &ModalFile, body: &ModalBody) -> Result<(), pliant::io::ModalFileError> {
    modal.content_sha256()?;
    modal.read_mode_kinds()?;
    modal.field_layout()?;
    let all: Vec<usize> = (0..body.mode_count()).collect();
    let surface = modal.read_surface(&all)?;
    for node in [0, surface.points.len().saturating_sub(1)] {
        modal.node_displacement(node)?;
        modal.node_rotation(node)?;
        modal.node_position(node)?;
    }
    for interface in modal.interface_names() {
        modal.read_interface_geometric_stiffness(&interface)?;
    }
    Ok(())
}
