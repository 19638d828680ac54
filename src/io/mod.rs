//! Files to model types and back: the only layer that opens HDF5 files. It uses `model` alone, and holds no physics but the nodal sums that
//! turn the files of other codes into modal files ([`import`]).
//! [`results_file`] writes time histories and [`results_reader`] reads them back; what they mean is the business of the layer above.
//! [`campaign_file`] writes what a campaign leaves: one row per case.
//! [`field_file`] writes the arrays that exported pictures point into.
//!
//! A modal file (schema `flexible-body-modes` 1.0) comes from elsewhere and is never trusted: `guard` decides what may be read
//! at all, [`modal_file`] turns datasets into a [`crate::model::modal_body::ModalBody`], [`modal_mesh`] reads the per-node data that
//! only pictures and point loads need, and [`modal_check`] holds the file against every rule of the schema. A file that breaks
//! a rule is refused; nothing is filled in or repaired.
//!
//! # Bounds on a damaged file
//! No dataset above 2 GiB is read, none that declares more than deflate could unpack from the file's own length, and none whose
//! storage is incomplete or lies outside the file. At any time the reader holds at most one dataset of up to 2 GiB and 256 MiB of mode
//! shapes besides the modal integrals, and libhdf5 one chunk of up to 256 MiB. A chunk made to unpack to more than it declares is refused
//! only after libhdf5 has unpacked it, so a hostile file of F bytes can cost up to 1032 F for that moment. The content pass reads at most 16 GiB in
//! all. libhdf5 is C code that has looped on damaged variable-length data, so those types are refused by their descriptor before any read.

mod array;
pub mod campaign_file;
mod chunks;
mod digest;
pub mod error;
pub mod field_file;
mod foreign;
mod guard;
pub mod header;
pub mod health;
pub mod import;
mod lumped;
pub mod modal_check;
pub mod modal_file;
pub mod modal_layout;
pub mod modal_mesh;
mod modal_writer;
pub mod results_file;
pub mod results_reader;
mod whole_chunks;

pub use campaign_file::{CampaignFile, CampaignFileError};
pub use error::ModalFileError;
pub use header::{Header, NodeMassKind};
pub use health::{Bound, HealthReport, Rule, RuleResult, Verdict};
pub use modal_check::{Examination, examine};
pub use modal_file::{Coupling, InterfaceSupport, ModalFile, ModeKind};
pub use results_file::{ResultsError, ResultsFile};
pub use results_reader::ResultsReader;
