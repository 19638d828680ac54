//! Responses in the manner of the kernel: `(M + N)^-1 f` of generalised forces f, N what a linearly implicit integrator adds on the
//! diagonal blocks of hinges and modes ([`AddedInertia`]).
//!
//! The factors are those of an evaluation at rest, whose biases and gyroscopic forces vanish: with `D = H P H* + N` of hinges and
//! `Lambda = 1 + N` of modes every formula of the recursion stays as it is. They are left once per pose and N, and serve any number of
//! forces. Prescribed hinges do not move.
//!
//! | pass | leaves | numbers per body |
//! |---|---|---|
//! | `factor`: poses, articulated inertias | `Factor` | 16 |
//! | `inward`: residual forces | `nu` | 1 per rate |
//! | `outward`: accelerations | the response | 1 per rate |
//!
//! A residual force is handed on as seen from the origin of the parent, by a gain that is seen from there too: with `G^ = phi G` both
//! `phi z+ = phi z + G^ epsilon` and `H* theta = nu - G^* alpha(parent)` wait for one sum per hinge only.
//!
//! Source: Paper Eq. 34 to 41 without rates, gravity, springs and prescribed accelerations; N by DESIGN 3.6.

mod factor;
mod flexible;
mod solve;

use super::layout::Passage;
use super::record::{Outboard, Quad};
use super::{Doubtful, TreeKernel, outward};
use crate::dynamics::added_inertia::AddedInertia;
use crate::model::{State, System};
use crate::spatial::lanes::{Kernel, Lanes, Processor};
use flexible::FlexibleFactor;

/// What a hinge leaves, inertial axes.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
struct Factor {
    /// Of a hinge of one rate.
    axis: Quad,
    /// Gain `G = P H* / D` of a hinge of one rate seen from O of the parent, angular half; the fourth number is `1 / D`.
    gain_angular: Quad,
    /// Its linear half.
    gain_linear: Quad,
    /// O of the parent to O (m).
    l: Quad,
}

/// Factors for one tree, and room for a response.
#[derive(Debug, Clone)]
pub struct TreeResponse {
    /// Poses.
    tree: TreeKernel,
    /// The pose, at rest.
    rest: State,
    factors: Vec<Factor>,
    flexible: Vec<FlexibleFactor>,
}

impl TreeResponse {
    /// Room for `system`, if it is a tree that the kernel serves.
    #[must_use]
    pub fn new(system: &System) -> Option<Self> {
        Self::on(Processor::detect(), system)
    }

    /// The same with the instructions of `processor`.
    #[must_use]
    pub fn on(processor: Processor, system: &System) -> Option<Self> {
        let mut tree = TreeKernel::on(processor, system, false)?;
        // only its first pass is run, at rest
        (tree.hinges, tree.velocity, tree.external) = (vec![], vec![], vec![]);
        let flexible = tree.flexible.iter().map(|f| FlexibleFactor::new(&tree.modal_shapes[f.shape], f.tips.len())).collect();
        Some(Self { rest: State::reference(system), factors: vec![Factor::default(); system.bodies.len()], flexible, tree })
    }

    /// Factors `M + N` at the coordinates of `state`.
    pub(in crate::dynamics) fn factor(&mut self, system: &System, state: &State, added: &AddedInertia) -> Result<(), Doubtful> {
        self.rest.time = state.time;
        self.rest.position.copy_from_slice(&state.position);
        self.rest.modal_position.copy_from_slice(&state.modal_position);
        self.tree.processor.run(Factoring { of: self, system, added })
    }

    /// Accelerations of hinge rates and modes, into `hinge` and `modal`, that the forces `applied` on the rates and `external_modal` on the
    /// modes cause; those of prescribed hinges stay as they were.
    pub(in crate::dynamics) fn solve(
        &mut self,
        system: &System,
        applied: &[f64],
        external_modal: &[f64],
        hinge: &mut [f64],
        modal: &mut [f64],
    ) {
        self.tree.processor.run(Solution { of: self, system, applied, external_modal, hinge, modal });
    }
}

struct Factoring<'a> {
    of: &'a mut TreeResponse,
    system: &'a System,
    added: &'a AddedInertia,
}

impl Kernel for Factoring<'_> {
    type Output = Result<(), Doubtful>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Result<(), Doubtful> {
        let Self { of, system, added } = self;
        outward::outward(lanes, &mut of.tree, system, &of.rest);
        factor::factor(lanes, of, system, added)
    }
}

struct Solution<'a> {
    of: &'a mut TreeResponse,
    system: &'a System,
    applied: &'a [f64],
    external_modal: &'a [f64],
    hinge: &'a mut [f64],
    modal: &'a mut [f64],
}

impl Kernel for Solution<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { of, system, applied, external_modal, hinge, modal } = self;
        solve::inward(lanes, of, system, applied, external_modal, hinge);
        solve::outward(lanes, of, system, hinge, modal);
    }
}
