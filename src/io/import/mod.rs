//! Modal data of other codes: a file in XDMF or MED with mode shapes becomes a modal file in schema 1.0.
//!
//! [`xdmf`] and [`med`] turn files into one form ([`mesh`]); the rest is the same for all: `element` integrates over cells, `lumping`
//! makes nodal masses and the sums over nodes that stand for the inertia integrals, `interface_fit` measures the motion of groups of
//! nodes, `orthonormalise` scales the modes to the mass that the file has. Nothing that the file and the request leave open is made up:
//! it is asked for by name. Cost: O(N n^2) for N nodes and n modes.
//!
//! # Bounds on a hostile file
//! XML is at most 64 MiB, 32 levels deep, and never expands an entity; HDF5 passes the guard of modal files; arrays, and the shapes of all modes
//! together, are bounded by 16 MiB and 64 bytes per byte of the files that hold them; includes lead one step; HDF5 files outside the XDMF file's folder are not opened.

mod body;
mod boundary;
mod budget;
pub mod cell;
mod element;
pub mod error;
mod interface_fit;
mod lumping;
pub mod med;
pub mod mesh;
mod modes;
mod moments;
pub mod options;
mod orthonormalise;
mod surface;
mod write;
pub mod xdmf;
mod xdmf_item;
mod xml;

pub use body::{ImportReport, ImportedBody, import, import_to};
pub use error::ImportError;
pub use mesh::ForeignModel;
pub use options::{ImportOptions, InterfaceRequest, MassSource, Selection};
