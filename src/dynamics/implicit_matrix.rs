//! The matrix of linearly implicit steps, `M + N` with N on the diagonal blocks of modes and hinges: factored once per step, solved for
//! generalised forces once per stage.
//!
//! Trees have it from their kernel ([`super::kernel::response`]), other systems from the sweeps ([`super::sweep::response`]), which
//! also judge what the kernel finds doubtful. Accelerations of closed systems keep the closures: embedded ones by the
//! sweeps themselves, cut ones by multipliers.

use super::DynamicsError;
use super::added_inertia::AddedInertia;
use super::closed_chain::ClosedChain;
use super::kernel::response::TreeResponse;
use super::sweep::inertia_inward::{InertiaScratch, inertia_inward_with};
use super::sweep::pose_outward::{PoseScratch, pose_outward};
use super::sweep::response::Response;
use crate::model::{State, System};
use crate::spatial::lanes::Processor;

/// `M + N` of one system at one state.
#[derive(Debug, Clone)]
pub struct ImplicitMatrix {
    /// N, to be set before it is factored.
    pub added: AddedInertia,
    /// Forces, and the accelerations that they cause.
    pub response: Response,
    tree: Option<Box<TreeResponse>>,
    by_kernel: bool,
    pose: PoseScratch,
    inertia: InertiaScratch,
    all: Vec<usize>,
    /// Cut closures; none for a tree.
    closed: Option<Box<ClosedChain>>,
}

impl ImplicitMatrix {
    /// Room for `system`, with nothing added.
    #[must_use]
    pub fn new(system: &System) -> Self {
        Self::on(Processor::detect(), system)
    }

    /// The same with the instructions of `processor`.
    #[must_use]
    pub fn on(processor: Processor, system: &System) -> Self {
        Self {
            added: AddedInertia::none(system),
            response: Response::new(system),
            tree: TreeResponse::on(processor, system).map(Box::new),
            by_kernel: false,
            pose: PoseScratch::new(system),
            inertia: InertiaScratch::new(system),
            all: (0..system.bodies.len()).collect(),
            closed: ClosedChain::new(system),
        }
    }

    /// True if it was last factored by the kernel for trees.
    #[must_use]
    pub fn is_by_kernel(&self) -> bool {
        self.by_kernel
    }

    /// Factors it at the coordinates of `state`. Nothing is allocated.
    ///
    /// # Errors
    /// [`DynamicsError`] naming the hinge, body or closure whose inertia is singular.
    pub fn factor(&mut self, system: &System, state: &State) -> Result<(), DynamicsError> {
        self.by_kernel = self.tree.as_mut().is_some_and(|tree| tree.factor(system, state, &self.added).is_ok());
        if self.by_kernel {
            return Ok(());
        }
        pose_outward(system, state, &mut self.pose);
        inertia_inward_with(system, &self.pose, Some(&self.added), &mut self.inertia)?;
        self.closed.as_mut().map_or(Ok(()), |c| c.prepare(system, &self.pose, &self.inertia))
    }

    /// Accelerations `hinge` and `modal` in [`Self::response`] from its forces `applied` on the hinge rates and `external_modal` on the modes,
    /// by the factors of the last call of [`Self::factor`]. Prescribed hinges do not move.
    pub fn solve(&mut self, system: &System) {
        let response = &mut self.response;
        if let Some(tree) = self.tree.as_mut().filter(|_| self.by_kernel) {
            tree.solve(system, &response.applied, &response.external_modal, &mut response.hinge, &mut response.modal);
            return;
        }
        response.solve(system, &self.pose, &self.inertia, &self.all);
        if let Some(chain) = &mut self.closed {
            chain.hold(system, &self.pose, &self.inertia, response);
        }
    }
}
