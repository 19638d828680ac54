//! Constraint embedding: the bodies of a loop as one aggregate body with independent coordinates (Paper section 5).
//!
//! An aggregate takes part in the sweeps of [`super::sweep`] like any other body, at its first member:
//!
//! 1. [`embedding`]: which coordinates are independent, and `X` (pose sweep, Eq. 53); [`bias`]: `X_dot` times the rates (velocity sweep,
//!    Eq. 58);
//! 2. [`inertia`]: `D_E`, and the articulated inertia that the root feels (inertia sweep, Eq. 62 and 63);
//! 3. [`force`]: residual forces and innovations (force sweep, Eq. 64 and 65);
//! 4. [`acceleration`]: accelerations of all members (acceleration sweep, Eq. 66 and 67);
//! 5. [`load`]: the closures' multipliers and every load inside (Eq. 68 and 69);
//!
//! and [`closing`] moves the dependent coordinates of a state until the closures close to rounding.
//!
//! | Paper | here | meaning | shape |
//! |---|---|---|---|
//! | X_E | `X` | rates of dependent per independent coordinates | r x m |
//! | X_E-dot times rates | `particular` | accelerations that the rates alone make | n |
//! | M of Eq. 63 | `mass` | mass matrix of the sub-tree with `P_E` for inertias | n x n |
//! | D_E | `D` | reduced mass matrix, factored | m x m |
//! | H_RE P_E (E phi)' | `U` | force on the root per independent acceleration | 6 x m |
//! | D_E^-1 times that | `W` | gain towards the root, `E phi G_E` transposed | m x 6 |
//!
//! n coordinates of the members, r of them dependent, m = n - r independent. Departures from the printed equations: the connector
//! `B_E` selects the member that carries a child, and the shift to that child enters once (Eq. 49, 50); the bias of Eq. 64, 66
//! and 68 is `phi_E* a'_E` as in Eq. 59. `f_E` of Eq. 69 is the load of the tree without its cut joints: the loads that are seen follow by
//! taking the multipliers' forces off it.

pub mod acceleration;
pub mod bias;
pub mod closing;
pub mod embedding;
pub mod force;
pub mod inertia;
pub mod load;
pub mod projection;
pub mod spread;

pub use embedding::Embedding;
