//! Forward dynamics of trees of rigid and flexible bodies by the split articulated-body (ATBI) recursion, and the hinge loads that
//! fall out of it.
//!
//! # The recursion
//!
//! Every flexible body k is split (Paper section 3.0.1) into the flexible body k, which owns mass, modes and the frame B of its modal
//! file, and a massless virtual rigid body k', which owns the hinge and sits at O. A rigid body is its own k'. One evaluation
//! is five sweeps over bodies that are stored parents first:
//!
//! 1. [`sweep::pose_outward`]: hinge maps, relative poses, mode shapes where bodies are joined;
//! 2. [`sweep::velocity_outward`]: velocities, bias accelerations `a`, gyroscopic forces `b`;
//! 3. [`sweep::inertia_inward`]: articulated inertias `P`, gains `G`, Eq. 32 and 33;
//! 4. [`sweep::force_inward`]: residual forces `z`, innovations, Eq. 34 and 35;
//! 5. [`sweep::acceleration_outward`]: accelerations, Eq. 36 to 41;
//!
//! loops whose closures are embedded take part in these as aggregate bodies ([`aggregate`], Eq. 47 to 69); cut closures are held by a
//! correction pass ([`closed_chain`], Eq. 42 to 46);
//!
//! and, only where something asks, [`hinge_load`]: `f(k') = P+ alpha+ + z+`, Eq. 18 and 38.
//!
//! # Symbols
//!
//! | Paper | here | meaning | shape |
//! |---|---|---|---|
//! | phi(k, j) | `l`, through `spatial::shift` | shift between origins | 3 |
//! | H | `map` | hinge map, one row per rate, O axes | m x 6 |
//! | V, alpha | `V`, `alpha` | spatial velocity, acceleration | 6 |
//! | a | `a`, `a_inboard` | bias acceleration at k', at k | 6 |
//! | b_fl | `b`, `b_modal` | gyroscopic force: rigid rows, modal rows | 6, n |
//! | M_fl | `FlexibleInertia` | inertia of the flexible body: 1, `row`, `rigid` | (n+6) x (n+6) |
//! | Pi(O+), Pi_B(O) | `shape`, `shape_inboard` | mode shape where a child, the parent is joined | 6 x n |
//! | P, P+ | `P`, `P_plus` | articulated inertia before, after the hinge | 6 x 6 |
//! | mu, D_fl, E = D_fl^-1 mu* | `mu`, `modal_block`, `gain_modal` | modal elimination, Eq. 32 | 6 x n, n x n, n x 6 |
//! | D, G | `D`, `G` | hinge inertia, Kalman gain | m x m, 6 x m |
//! | z, z+ | `z`, `z_plus` | residual force before, after the hinge | 6 |
//! | epsilon, nu | `epsilon`, `nu` | innovations, D^-1 epsilon | m, n |
//! | f | `hinge_load` | hinge load | 6 |
//!
//! Departures from the printed equations: Eq. 32 keeps the whole `M_fl` of its first line; Eq. 12 reads `z+ = z + G epsilon`;
//! prescribed accelerations enter once, through `a(k')`; gains belong to their own body (Eq. 13, 38). The interface shape is
//! `Pi(eta) = [Jl(Phi_r eta) Phi_r; Phi_t]`, the rate of the finite rotation `exp(Phi_r eta)`, so that energy is conserved to the
//! integrator's order. Gravity acts as the acceleration `-g` of the world, so `alpha` holds what an accelerometer would feel.

pub mod added_inertia;
pub mod aggregate;
pub mod closed_chain;
pub mod dense;
pub mod energy;
pub mod flexible_inertia;
pub mod frame_motion;
pub mod hinge_load;
pub mod implicit_matrix;
pub mod inverse;
pub mod kernel;
pub mod modal_block;
pub mod profile;
pub mod sweep;
pub mod world;

use crate::model::{Body, ClosureMethod, State, System, hinge};
use crate::spatial::lanes::Processor;
use crate::spatial::shift::angular;
use closed_chain::ClosedChain;
use kernel::TreeKernel;
use nalgebra::{Vector3, Vector6};
use sweep::acceleration_outward::AccelerationScratch;
use sweep::force_inward::ForceScratch;
use sweep::inertia_inward::InertiaScratch;
use sweep::pose_outward::PoseScratch;
use sweep::velocity_outward::VelocityScratch;
use thiserror::Error;

/// Why an evaluation has no answer.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum DynamicsError {
    /// A hinge direction that moves no mass.
    #[error(
        "hinge \"{hinge}\" between \"{parent}\" and \"{child}\": the outboard inertia along its rate {rate} is {inertia:e}, which is zero beside {scale:e}; \
         give \"{child}\" mass or inertia there, or fix or prescribe the hinge{}",
        if *looped { ", or hold its loops by constraint_embedding, which asks for inertia of the loop alone" } else { "" }
    )]
    SingularHinge {
        /// Name of the hinge.
        hinge: String,
        /// Name of the parent body, or "world".
        parent: String,
        /// Name of the child body.
        child: String,
        /// 1-based number of the rate.
        rate: usize,
        /// Whether cut closures load the system: embedded ones need no inertia of every link.
        looped: bool,
        /// Pivot of `D` found.
        inertia: f64,
        /// What it was compared with.
        scale: f64,
    },
    /// A deflection beyond what an energy of second order can hold.
    #[error(
        "hinge \"{hinge}\" between \"{parent}\" and \"{child}\": the outboard inertia along its rate {rate} is {inertia:e}: bodies are bent further than \
         geometric stiffness allows for where modes carry nearly all inertia; give \"{child}\" inertia there, retain fewer modes, or leave out \
         geometric_stiffness outboard"
    )]
    OverDeformed {
        /// Name of the hinge.
        hinge: String,
        /// Name of the parent body, or "world".
        parent: String,
        /// Name of the child body.
        child: String,
        /// 1-based number of the rate.
        rate: usize,
        /// Pivot of `D` found.
        inertia: f64,
    },
    /// Axes of a hinge that lie in one plane (of a gimbal) or line (of a universal hinge).
    #[error(
        "hinge \"{hinge}\" between \"{parent}\" and \"{child}\" is in gimbal lock: its axes are within {spread:.1e} of dependent; \
         use kind = \"spherical\", or order the axes so that the motion stays away from lock"
    )]
    GimbalLock {
        /// Name of the hinge.
        hinge: String,
        /// Name of the parent body, or "world".
        parent: String,
        /// Name of the child body.
        child: String,
        /// Volume or area that the axes span.
        spread: f64,
    },
    /// Accelerations beyond what numbers hold.
    #[error("{place} leaves finite numbers; look for positions, rates, loads or masses that are far too large or too small")]
    NotFinite {
        /// Hinge or mode, as messages name it.
        place: String,
    },
    /// Modes that carry more mass than the body has, seen from its inboard hinge.
    #[error(
        "body \"{body}\": {}",
        if *empty {
            "beside what its modes carry it has no inertia along some direction of its frame, which a hinge that the modes move needs; \
             give it inertia there, retain fewer modes, or use modes that hold the root"
        } else {
            "its modes, held at the inboard hinge, have no positive definite mass; check the modal file with `pliant check`, \
             or look for deflections beyond what it can hold"
        }
    )]
    SingularModes {
        /// Name of the body.
        body: String,
        /// True if nothing is negative: a direction is empty.
        empty: bool,
    },
    /// Closures that no multipliers can satisfy together.
    #[error(
        "closure \"{closure}\" contradicts the other closures or a prescribed hinge: {rank} of {rows} blocked directions are independent, and the others ask for a different motion"
    )]
    ContradictoryClosures {
        /// Name of the closure with the largest part in it.
        closure: String,
        /// Independent directions.
        rank: usize,
        /// Blocked directions.
        rows: usize,
    },
    /// Independent coordinates of an aggregate that move no mass.
    #[error(
        "the loops closed by {closures}: the inertia along {coordinate} of \"{body}\" is {inertia:e}, which is zero beside {scale:e}; \
         give the bodies there mass or inertia"
    )]
    SingularAggregate {
        /// Names of the closures, quoted.
        closures: String,
        /// The independent coordinate.
        coordinate: String,
        /// Name of its body.
        body: String,
        /// Pivot found.
        inertia: f64,
        /// What it was compared with.
        scale: f64,
    },
    /// An embedded closure that no state nearby closes.
    #[error("closure \"{closure}\" came open by {residual:e} m or rad, and no state nearby closes it")]
    Unclosed {
        /// Name of the closure that is furthest open.
        closure: String,
        /// What is left open (m or rad).
        residual: f64,
    },
    /// An embedded loop that loses rank, so that its independent coordinates no longer carry the others.
    #[error("closure \"{closure}\" is at a change point of its loop, where the independent coordinates no longer carry the others")]
    ChangePoint {
        /// Name of the closure.
        closure: String,
    },
    /// Loop inertias that are not numbers.
    #[error("the inertia of the loops (the first closed by \"{closure}\") left finite numbers")]
    BrokenClosures {
        /// Name of the first closure.
        closure: String,
    },
}

impl DynamicsError {
    /// What an inertia that is not positive along rate `rate` of the hinge of body `k` means.
    fn of_hinge(system: &System, pose: &PoseScratch, k: usize, (rate, inertia, scale): (usize, f64, f64)) -> Self {
        let body = &system.bodies[k];
        if !(inertia.is_finite() && scale.is_finite()) {
            return Self::NotFinite { place: format!("the inertia along rate {} of hinge \"{}\"", rate + 1, body.hinge.name) };
        }
        let (hinge, child, rate) = (body.hinge.name.clone(), body.name.clone(), rate + 1);
        let parent = body.parent.map_or_else(|| "world".to_owned(), |p| system.bodies[p].name.clone());
        let spread = body.hinge.kind.axis_spread(&pose.bodies[k].hinge.map);
        if spread < hinge::LOCKED {
            return Self::GimbalLock { hinge, parent, child, spread };
        }
        let stiffens = system.bodies.iter().any(|b| b.flexible().is_some_and(crate::model::FlexibleBody::stiffens));
        if stiffens && is_negative(inertia, scale) {
            return Self::OverDeformed { hinge, parent, child, rate, inertia };
        }
        let looped = system.closures.iter().any(|c| c.method == ClosureMethod::TreeAugmented);
        Self::SingularHinge { hinge, parent, child, rate, looped, inertia, scale }
    }

    /// True if the numbers themselves broke down, as in a motion that diverges: an inertia that is negative beyond rounding or not a
    /// number belongs to no model.
    #[must_use]
    pub fn is_breakdown(&self) -> bool {
        match self {
            Self::SingularHinge { inertia, scale, .. } | Self::SingularAggregate { inertia, scale, .. } => is_negative(*inertia, *scale),
            Self::Unclosed { residual, .. } => !residual.is_finite(),
            Self::SingularModes { .. }
            | Self::OverDeformed { .. }
            | Self::ContradictoryClosures { .. }
            | Self::ChangePoint { .. }
            | Self::GimbalLock { .. } => false,
            Self::BrokenClosures { .. } | Self::NotFinite { .. } => true,
        }
    }
}

/// True if an inertia is no number, or negative beyond rounding: with more than half of the digits of `scale`.
fn is_negative(inertia: f64, scale: f64) -> bool {
    !(inertia.is_finite() && scale.is_finite() && inertia >= -1e-8 * scale.abs())
}

/// Everything an evaluation writes, allocated once per system.
#[derive(Debug, Clone)]
pub struct Workspace {
    /// Poses and maps.
    pub pose: PoseScratch,
    /// Velocities and biases.
    pub velocity: VelocityScratch,
    /// Articulated inertias and gains.
    pub inertia: InertiaScratch,
    /// Residual forces.
    pub force: ForceScratch,
    /// Accelerations.
    pub acceleration: AccelerationScratch,
    /// Closures; none for a tree.
    pub closed: Option<Box<ClosedChain>>,
    /// Kernel for trees; none for other systems.
    tree: Option<Box<TreeKernel>>,
    /// True if the last evaluation was the kernel's, so that the sweeps hold nothing of it but the accelerations of the hinges.
    by_kernel: bool,
}

impl Workspace {
    /// Room for evaluations of `system`.
    #[must_use]
    pub fn new(system: &System) -> Self {
        Self::with(system, TreeKernel::new(system, true))
    }

    /// The same for evaluations whose hinge loads nobody asks for: [`accelerations`] of a tree then leave none.
    #[must_use]
    pub fn without_loads(system: &System) -> Self {
        Self::with(system, TreeKernel::new(system, false))
    }

    /// The same as [`Self::new`] with the instructions of `processor`.
    #[must_use]
    pub fn on(processor: Processor, system: &System) -> Self {
        Self::with(system, TreeKernel::on(processor, system, true))
    }

    fn with(system: &System, tree: Option<TreeKernel>) -> Self {
        Self {
            pose: PoseScratch::new(system),
            velocity: VelocityScratch::new(system),
            inertia: InertiaScratch::new(system),
            force: ForceScratch::new(system),
            acceleration: AccelerationScratch::new(system),
            closed: ClosedChain::new(system),
            tree: tree.map(Box::new),
            by_kernel: false,
        }
    }

    /// Angular velocity (rad/s) and acceleration (angular; linear, less gravity) of frame B of flexible body `k` at the last evaluation, in
    /// B axes.
    #[must_use]
    pub fn frame_motion(&self, k: usize) -> (Vector3<f64>, Vector6<f64>) {
        self.kernel()
            .and_then(|tree| tree.frame_motion(k))
            .unwrap_or_else(|| (angular(&self.velocity.bodies[k].V), self.acceleration.alpha[k]))
    }

    /// Trace of the rotational inertia (kg m^2) of flexible body `k` about B at the last evaluation; none if it does not change or `k` is rigid.
    #[must_use]
    pub fn inertia_trace(&self, k: usize) -> Option<f64> {
        match self.kernel() {
            Some(tree) => tree.inertia_trace(k),
            None => self.pose.bodies[k].flexible.map(|index| self.pose.flexible[index].inertia.inertia.trace()),
        }
    }

    /// True if the last evaluation was that of the kernel for trees.
    #[must_use]
    pub fn is_by_kernel(&self) -> bool {
        self.by_kernel
    }

    /// The kernel of a tree, if the last evaluation was its.
    #[inline]
    #[must_use]
    pub fn kernel(&self) -> Option<&TreeKernel> {
        self.tree.as_deref().filter(|_| self.by_kernel)
    }

    /// Load of closure `index` at the last evaluation: on b at b's point, in a's axes; zero for a gear.
    #[must_use]
    pub fn closure_load(&self, system: &System, index: usize) -> Vector6<f64> {
        let closure = &system.closures[index];
        let load = |c: &ClosedChain| self.pose.closures[index].load(closure, &c.lambda[closure.rows()]);
        self.closed.as_deref().map_or_else(Vector6::zeros, load)
    }

    /// How near the cut loops are to a change point at the last evaluation; infinite without any.
    #[must_use]
    pub fn cut_distance_to_rank_loss(&self) -> f64 {
        self.closed.as_ref().map_or(f64::INFINITY, |c| c.cut_distance_to_rank_loss())
    }

    /// How near the loops are to a change point at the last evaluation, where they lose rank; infinite without closures.
    #[must_use]
    pub fn distance_to_rank_loss(&self) -> f64 {
        self.closed.as_ref().map_or(f64::INFINITY, |c| c.distance_to_rank_loss(&self.pose))
    }

    /// Moves the dependent coordinates and rates of all aggregates until their closures close; nothing happens without aggregates.
    ///
    /// # Errors
    /// If no state nearby closes.
    pub fn close_aggregates(&mut self, system: &System, state: &mut State) -> Result<(), DynamicsError> {
        match &mut self.closed {
            Some(chain) if !system.aggregates.is_empty() => chain.close_aggregates(system, state, &mut self.pose),
            _ => Ok(()),
        }
    }

    /// What to say of loads that the last evaluation could not determine: redundant closures share them by least norm.
    #[must_use]
    pub fn redundancy_warning(&self, system: &System) -> Option<String> {
        let report = self.closed.as_ref()?.rank_report(system, &self.pose);
        let redundant = report.rows.checked_sub(report.rank).filter(|n| *n > 0)?;
        Some(format!(
            "warning: {redundant} of {} closed directions are redundant ({}); how the loads divide over their loops is not determined, those reported have \
             the least multipliers",
            report.rows,
            report.redundant.join(", ")
        ))
    }
}

/// Accelerations of all hinge and modal coordinates at `state`, left in `workspace.acceleration`, and hinge loads: what a step needs.
///
/// Like [`forward_dynamics`], but for trees by a kernel of their own ([`kernel`]), several times as fast. It leaves
/// nothing else: poses, velocities, inertias and forces in `workspace` are then those of an earlier evaluation.
///
/// # Errors
/// As [`forward_dynamics`].
pub fn accelerations(system: &System, state: &State, workspace: &mut Workspace) -> Result<(), DynamicsError> {
    if let Some(tree) = &mut workspace.tree {
        let done = tree.evaluate(system, state, &mut workspace.acceleration.hinge, &mut workspace.acceleration.modal);
        // what is doubtful is for the sweeps to judge, which look closer and name what is wrong
        if done.is_ok() && workspace.acceleration.is_finite() {
            workspace.by_kernel = true;
            return Ok(());
        }
    }
    forward_dynamics(system, state, workspace)
}

/// Accelerations of all hinge and modal coordinates at `state`, left in `workspace.acceleration`, and all that led to them.
///
/// Prescribed hinges must already stand at their functions' values ([`State::apply_prescribed`]). Nothing is allocated.
///
/// # Errors
/// [`DynamicsError`] if a hinge or a modal block is singular, or closures contradict one another.
pub fn forward_dynamics(system: &System, state: &State, workspace: &mut Workspace) -> Result<(), DynamicsError> {
    workspace.by_kernel = false;
    let Workspace { pose, velocity, inertia, force, acceleration, closed, .. } = workspace;
    sweep::pose_outward::pose_outward(system, state, pose);
    sweep::velocity_outward::velocity_outward(system, state, pose, velocity);
    closed_chain::check_embedded(system, pose, velocity)?;
    sweep::inertia_inward::inertia_inward(system, pose, inertia)?;
    sweep::force_inward::force_inward(system, state, pose, velocity, inertia, force);
    sweep::acceleration_outward::acceleration_outward(system, pose, velocity, inertia, force, acceleration);
    if let Some(chain) = closed {
        chain.close(system, pose, velocity, inertia, force, acceleration)?;
        chain.check_closed(system, pose, velocity, acceleration)?;
        chain.recover_embedded(&aggregate::load::Swept { system, state, pose, velocity, inertia, acceleration }, force);
    }
    check_finite(system, acceleration)
}

/// Refuses accelerations that are no numbers: products of finite numbers may overflow.
fn check_finite(system: &System, acceleration: &AccelerationScratch) -> Result<(), DynamicsError> {
    if acceleration.is_finite() {
        return Ok(());
    }
    let all = |x: &[f64]| x.iter().all(|x| x.is_finite());
    let first = |body: &&Body| !(all(&acceleration.hinge[body.velocity_range()]) && all(&acceleration.modal[body.modal_range()]));
    let place = system.bodies.iter().find(first).map_or_else(String::new, |body| {
        if all(&acceleration.hinge[body.velocity_range()]) {
            format!("the acceleration of the modes of body \"{}\"", body.name)
        } else {
            format!("the acceleration of hinge \"{}\"", body.hinge.name)
        }
    });
    Err(DynamicsError::NotFinite { place })
}
