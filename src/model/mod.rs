//! What a system is: bodies joined by hinges into a tree, closures that make loops of it, and what acts on them. Frozen once built.
//!
//! [`build`] turns a definition by names into a [`System`] by indices and refuses what cannot be; [`State`] holds what is integrated.

pub mod aggregate;
pub mod build;
pub mod build_closure;
mod build_hinge;
pub mod closure;
pub mod definition;
pub mod error;
pub mod flexible_body;
pub mod hinge;
mod inertia_check;
pub mod left_out;
pub mod load;
pub mod modal_body;
pub mod mode_basis;
pub mod mode_products;
pub mod state;
pub mod surface;
pub mod time_function;

pub use aggregate::{Aggregate, Member, Role};
pub use closure::{Closure, ClosureJoint, ClosureKind, ClosureMethod, ClosureSide};
pub use error::ModelError;
pub use flexible_body::{Attachment, FlexibleBody, InertiaOrder};
pub use hinge::{Hinge, HingeKind};
pub use left_out::LeftOutModes;
pub use load::{Load, LoadAxes, LoadPoint};
pub use mode_basis::ModeBasis;
pub use state::State;
pub use surface::Surface;
pub use time_function::TimeFunction;

use crate::spatial::SpatialInertia;
use nalgebra::{Matrix3, Vector3};

/// Rigid or flexible.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "rigid inertias lie in the array that the sweeps walk")]
pub enum BodyKind {
    /// Inertia about O in O axes.
    Rigid(SpatialInertia),
    /// Modal body; its frame of the recursion is that of the modal file.
    Flexible(Box<FlexibleBody>),
}

/// A body with its inboard hinge.
///
/// The recursion's frame of a rigid body is O of its hinge; that of a flexible body is the frame B of its modal file.
#[derive(Debug, Clone)]
pub struct Body {
    /// Name, unique among bodies.
    pub name: String,
    /// Rigid or flexible.
    pub kind: BodyKind,
    /// The hinge that carries the body.
    pub hinge: Hinge,
    /// Index of the parent body, none for the world. Always smaller than the body's own index.
    pub parent: Option<usize>,
    /// Frame O+ on the parent.
    pub parent_side: Attachment,
    /// Axes of the body frame B in the recursion's frame; identity for a flexible body.
    pub frame_rotation: Matrix3<f64>,
    /// Origin of the body frame B in the recursion's frame (m); zero for a flexible body.
    pub frame_position: Vector3<f64>,
    /// First hinge coordinate in [`State::position`].
    pub position: usize,
    /// First hinge rate in [`State::velocity`].
    pub velocity: usize,
    /// First modal coordinate in [`State::modal_position`].
    pub modal: usize,
}

impl Body {
    /// The modal part, if the body is flexible.
    #[must_use]
    pub fn flexible(&self) -> Option<&FlexibleBody> {
        match &self.kind {
            BodyKind::Rigid(_) => None,
            BodyKind::Flexible(flexible) => Some(flexible),
        }
    }

    /// Number of retained modes, zero for a rigid body.
    #[must_use]
    pub fn mode_count(&self) -> usize {
        self.flexible().map_or(0, FlexibleBody::mode_count)
    }

    /// Range of the hinge coordinates in [`State::position`].
    #[must_use]
    pub fn position_range(&self) -> std::ops::Range<usize> {
        self.position..self.position + self.hinge.kind.position_count()
    }

    /// Range of the hinge rates in [`State::velocity`].
    #[must_use]
    pub fn velocity_range(&self) -> std::ops::Range<usize> {
        self.velocity..self.velocity + self.hinge.kind.rate_count()
    }

    /// Range of the modal coordinates in [`State::modal_position`].
    #[must_use]
    pub fn modal_range(&self) -> std::ops::Range<usize> {
        self.modal..self.modal + self.mode_count()
    }

    /// Mass (kg).
    #[must_use]
    pub fn mass(&self) -> f64 {
        match &self.kind {
            BodyKind::Rigid(inertia) => inertia.translational[(0, 0)],
            BodyKind::Flexible(flexible) => flexible.integrals.mass,
        }
    }
}

/// A multibody system: a tree, and the closures that close loops in it.
#[derive(Debug, Clone)]
pub struct System {
    /// Uniform gravity (m/s^2, inertial axes).
    pub gravity: Vector3<f64>,
    /// Bodies, every parent before its children.
    pub bodies: Vec<Body>,
    /// External loads, sorted by body.
    pub loads: Vec<Load>,
    /// Closures in the order of their definition.
    pub closures: Vec<Closure>,
    /// Sub-trees whose closures are embedded.
    pub aggregates: Vec<Aggregate>,
    /// What the sweeps do at each body; empty without aggregates.
    pub roles: Vec<Role>,
    /// Indices of bodies whose hinge is prescribed.
    pub prescribed: Vec<usize>,
    /// Length of [`State::position`].
    pub position_count: usize,
    /// Length of [`State::velocity`].
    pub velocity_count: usize,
    /// Length of [`State::modal_position`].
    pub modal_count: usize,
    /// Body indices in the order in which they were defined.
    pub definition_order: Vec<usize>,
}

impl System {
    /// Index of the body of that name.
    #[must_use]
    pub fn body_index(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|b| b.name == name)
    }

    /// Index of the body that the hinge of that name carries.
    #[must_use]
    pub fn hinge_index(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|b| b.hinge.name == name)
    }

    /// External loads on a body.
    #[must_use]
    pub fn loads_of(&self, body: usize) -> &[Load] {
        let first = self.loads.partition_point(|l| l.body < body);
        let count = self.loads[first..].partition_point(|l| l.body == body);
        &self.loads[first..first + count]
    }

    /// What the sweeps do at a body.
    #[inline]
    #[must_use]
    pub fn role(&self, body: usize) -> Role {
        self.roles.get(body).copied().unwrap_or(Role::Own)
    }

    /// Number of multipliers of all closures.
    #[must_use]
    pub fn closure_rows(&self) -> usize {
        self.closures.last().map_or(0, |c| c.rows().end)
    }

    /// Times (s) at which some function of the system jumps in a derivative, ascending, each once.
    #[must_use]
    pub fn breaks(&self) -> Vec<f64> {
        let mut times = Vec::new();
        self.functions().for_each(|f| f.breaks(&mut times));
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Longest step (s) around time `t` that sees the course of every function, between two breaks.
    #[must_use]
    pub fn resolution(&self, t: f64) -> f64 {
        self.functions().map(|f| f.resolution(t)).fold(f64::INFINITY, f64::min)
    }

    fn functions(&self) -> impl Iterator<Item = &TimeFunction> {
        let hinges = self.bodies.iter().flat_map(|b| [&b.hinge.torque, &b.hinge.motion]);
        let loads = self.loads.iter().flat_map(|l| [&l.force, &l.moment]);
        hinges.chain(loads).flatten()
    }

    /// Largest number of modes of one body.
    #[must_use]
    pub fn largest_mode_count(&self) -> usize {
        self.bodies.iter().map(Body::mode_count).max().unwrap_or(0)
    }

    /// True if some load is given in inertial axes, so that an evaluation needs the attitude of its body.
    #[must_use]
    pub fn has_world_loads(&self) -> bool {
        self.loads.iter().any(|l| l.axes == LoadAxes::World)
    }
}
