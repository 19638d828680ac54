//! pliant: flexible multibody dynamics with the six-component load at every hinge.
//!
//! Bodies are rigid or carry assumed modes from a FEM code, hinges join them into trees, and forward dynamics is the split
//! articulated-body (ATBI) recursion of A. Jain, "Computing Inter-Body Constraint Forces in Recursive Multibody Dynamics": O(N) in
//! bodies, linear in modes, with the load at every hinge as a by-product.
//!
//! # Layers
//!
//! Each uses only those before it (held by `tests/layers.rs`):
//!
//! - [`spatial`]: rotations, 6-vectors, inertias, and the conventions of everything;
//! - [`model`]: what a system is, checked once and frozen, and its state;
//! - [`dynamics`]: one evaluation: the sweeps, hinge loads, their audit, the dense twin, energies;
//! - [`integrate`]: time: charts, steppers, step control, the loop, observers;
//! - `io`: modal files, their import from other codes, and results files (feature `hdf5`);
//! - [`scene`]: scene files to systems and settings;
//! - [`output`]: observers that keep peaks and limits, write results and stream to the viewer (feature `rerun`);
//! - [`study`]: error against run time over settings of one scene;
//! - `campaign`: one scene for many values of its keys, and the envelope of its loads (feature `hdf5`);
//! - [`cli`]: the program.
//!
//! # One evaluation
//!
//! ```
//! use nalgebra::{Matrix3, Vector3};
//! use pliant::dynamics::{Workspace, forward_dynamics, hinge_load::hinge_load};
//! use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, HingeDefinition};
//!
//! // a 2 kg rod of 1 m, held horizontally by a hinge about y and let go
//! let inertia = Matrix3::from_diagonal(&Vector3::new(0.0, 2.0 / 12.0, 2.0 / 12.0));
//! let definition = Definition {
//!     gravity: Vector3::new(0.0, 0.0, -9.81),
//!     bodies: vec![BodyDefinition {
//!         name: "rod".into(),
//!         kind: BodyDefinitionKind::Rigid { mass: 2.0, center_of_mass: Vector3::new(0.5, 0.0, 0.0), inertia },
//!     }],
//!     hinges: vec![HingeDefinition {
//!         name: "pin".into(),
//!         kind: "revolute".into(),
//!         axes: vec![Vector3::y()],
//!         parent: "world".into(),
//!         child: "rod".into(),
//!         ..HingeDefinition::default()
//!     }],
//!     ..Definition::default()
//! };
//! let (system, state) = definition.build()?;
//! let mut workspace = Workspace::new(&system);
//! forward_dynamics(&system, &state, &mut workspace)?;
//! // a falling rod loads its pin with a quarter of its weight
//! let load = hinge_load(&workspace, 0);
//! assert!((load[5] - 2.0 * 9.81 / 4.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "hdf5")]
pub mod campaign;
pub mod cli;
pub mod dynamics;
pub mod integrate;
#[cfg(feature = "hdf5")]
pub mod io;
pub mod model;
pub mod output;
pub mod scene;
pub mod spatial;
pub mod study;
