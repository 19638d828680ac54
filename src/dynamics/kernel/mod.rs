//! Trees in one kernel: accelerations and hinge loads at a few nanoseconds per operation.
//!
//! The sweeps of [`super::sweep`] serve every system, closed ones and bodies whose modes move their own hinge included; most of what they
//! carry a tree of rigid and cantilevered bodies does not need. Here the recursion (Paper Eq. 8 to 13 and 18, modes by Eq. 32 to 41) runs in
//! inertial axes, so that an articulated inertia is shifted from hinge to hinge and never turned, in three passes over records that lie in
//! the order of the passes:
//!
//! | pass | leaves | numbers per body |
//! |---|---|---|
//! | `outward`: attitude and angular velocity | `Motion` | 16 |
//! | `inward`: articulated inertias, residual forces | `Hinge` | 20 |
//! | the same, where loads are asked for | `Outboard` | 36 |
//! | `accelerate`: accelerations, and `Load`s if asked for | `Load` | 8 |
//!
//! What implicit steps ask for, responses to generalised forces, is [`response`]. Modes are the business of `flexible`, in the axes of each body.
//!
//! Bodies that are alike share their constants. A child that follows its parent in the order, as in every chain, finds the
//! parent's quantities in registers; only branching bodies keep theirs in memory.
//!
//! Axes: "link axes" are those of O, turned so that the axis of a hinge of one rate is their third. Registers: [`crate::spatial::lanes`].

mod accelerate;
mod cyclic;
mod flexible;
mod hinge;
mod inward;
mod layout;
mod modal_shape;
mod outward;
mod record;
pub mod response;
mod rows;
mod six;
mod tip;

use crate::model::{State, System};
use crate::spatial::lanes::{Kernel, Lanes, Processor};
use crate::spatial::shift::{rotate_back, spatial};
use flexible::FlexibleLink;
use hinge::GeneralHinge;
use layout::{Layout, Link, NONE, Passage, Shape};
use modal_shape::ModalShape;
use nalgebra::{Vector3, Vector6};
use record::{Hinge, Load, Motion, Outboard, Quad};

/// Quantities of a body that some child does not follow directly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    /// What those children add to its inertia and residual force.
    pub felt: Outboard,
    /// Its acceleration (angular; linear) at O in inertial axes.
    pub acceleration: [Quad; 2],
}

/// An evaluation that the kernel leaves to the sweeps: a hinge inertia at the edge of rounding, or a load that is no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Doubtful;

/// Kernel for one tree, with room for one evaluation.
#[derive(Debug, Clone)]
pub struct TreeKernel {
    processor: Processor,
    layout: Layout,
    motion: Vec<Motion>,
    /// Force of motor, spring and damper on the rate of hinges of one (N m or N).
    applied: Vec<f64>,
    hinges: Vec<Hinge>,
    /// None if loads are not asked for.
    outboard: Vec<Outboard>,
    loads: Vec<Load>,
    branches: Vec<Branch>,
    general: Vec<GeneralHinge>,
    flexible: Vec<FlexibleLink>,
    modal_shapes: Vec<ModalShape>,
    /// Velocity of O in inertial axes of all bodies up to the last with a load.
    velocity: Vec<Vector3<f64>>,
    /// External force on the loaded bodies at O in inertial axes.
    external: Vec<Vector6<f64>>,
}

impl TreeKernel {
    /// Room for `system`, if it is a tree that the kernel serves; `with_loads` if hinge loads will be asked for.
    #[must_use]
    pub fn new(system: &System, with_loads: bool) -> Option<Self> {
        Self::on(Processor::detect(), system, with_loads)
    }

    /// The same with the instructions of `processor`.
    #[must_use]
    pub fn on(processor: Processor, system: &System, with_loads: bool) -> Option<Self> {
        let layout = Layout::new(system)?;
        let n = system.bodies.len();
        let (mut flexible, mut modal_shapes) = (Vec::new(), Vec::new());
        for (body, children) in &layout.flexible {
            let of = system.bodies[*body].flexible()?;
            let sides: Vec<_> = children.iter().map(|&c| &system.bodies[c].parent_side).collect();
            let shape = ModalShape::find(&mut modal_shapes, of, &sides);
            let turn = &layout.shapes[layout.links[*body].shape as usize].turn;
            flexible.push(FlexibleLink::new(system, *body, of, children, &modal_shapes[shape], shape, turn));
        }
        Some(Self {
            processor,
            motion: vec![Motion::REST; n],
            applied: vec![0.0; n],
            hinges: vec![Hinge::default(); n],
            outboard: vec![Outboard::default(); if with_loads { n } else { 0 }],
            loads: vec![Load::default(); if with_loads { n } else { 0 }],
            branches: vec![Branch { felt: Outboard::default(), acceleration: [[0.0; 4]; 2] }; layout.branches],
            general: layout.general.iter().map(|&body| GeneralHinge::new(system, body)).collect(),
            velocity: vec![Vector3::zeros(); system.loads.iter().map(|l| l.body + 1).max().unwrap_or(0)],
            external: vec![Vector6::zeros(); layout.loaded.len()],
            flexible,
            modal_shapes,
            layout,
        })
    }

    /// Accelerations of all hinge rates and modal coordinates at `state`, into `hinge` and `modal`.
    pub(super) fn evaluate(&mut self, system: &System, state: &State, hinge: &mut [f64], modal: &mut [f64]) -> Result<(), Doubtful> {
        self.run([true; 3], system, state, hinge, modal)
    }

    /// One of the three passes alone, at a state that was evaluated before: for measuring it. What it leaves is of no other use.
    pub(super) fn repeat_pass(&mut self, pass: usize, system: &System, state: &State, hinge: &mut [f64], modal: &mut [f64]) {
        let _ = self.run(std::array::from_fn(|i| i == pass), system, state, hinge, modal);
    }

    /// Both with a copy of the passes that knows whether loads are asked for.
    fn run(&mut self, passes: [bool; 3], system: &System, state: &State, hinge: &mut [f64], modal: &mut [f64]) -> Result<(), Doubtful> {
        let processor = self.processor;
        if self.loads.is_empty() {
            processor.run(Evaluation::<false> { tree: self, system, state, hinge, modal, passes })
        } else {
            processor.run(Evaluation::<true> { tree: self, system, state, hinge, modal, passes })
        }
    }

    /// Load at the hinge of body `k` after the last evaluation: (moment N m about O; force N), by the parent on the child, inertial axes. Not
    /// a number if loads were not asked for.
    #[must_use]
    pub fn inertial_load(&self, k: usize) -> Vector6<f64> {
        self.loads.get(k).map_or_else(|| Vector6::repeat(f64::NAN), Load::plain)
    }

    /// The same in O axes.
    #[must_use]
    pub fn hinge_load(&self, k: usize) -> Vector6<f64> {
        let axes = self.motion[k].rotation() * self.layout.shapes[self.layout.links[k].shape as usize].turn.transpose();
        rotate_back(&axes, &self.inertial_load(k))
    }

    /// Power (W) of motors, dampers, prescribed motions and external loads at the last evaluation, at `state`.
    #[must_use]
    pub fn power(&self, system: &System, state: &State) -> f64 {
        let mut total = 0.0;
        for link in &self.layout.links {
            if link.passage == Passage::General {
                total += self.general[link.general as usize].power(system, state, |k| self.hinge_load(k));
            } else if link.passage != Passage::Fixed {
                let v = state.velocity[link.v as usize];
                let damping = self.layout.drives.get(link.drive as usize).map_or(0.0, |d| d.damping);
                total += v * (link.motor(system, state, &self.layout) - damping * v);
            }
        }
        for (&body, force) in self.layout.loaded.iter().zip(&self.external) {
            total += force.dot(&spatial(&self.motion[body].angular_velocity(), &self.velocity[body]));
        }
        total + self.flexible.iter().map(|f| f.power(system, state, &self.modal_shapes[f.shape])).sum::<f64>()
    }

    /// Angular velocity and acceleration (angular; linear, less gravity) of frame B of flexible body `k` at the last evaluation, B axes.
    #[must_use]
    pub fn frame_motion(&self, k: usize) -> Option<(Vector3<f64>, Vector6<f64>)> {
        let own = self.flexible.get(self.layout.links[k].flexible as usize)?;
        Some((own.omega, own.alpha))
    }

    /// Trace of the rotational inertia (kg m^2) of flexible body `k` about B at the last evaluation, where its deformation changes it.
    #[must_use]
    pub fn inertia_trace(&self, k: usize) -> Option<f64> {
        self.flexible.get(self.layout.links[k].flexible as usize)?.inertia_trace()
    }
}

/// One evaluation.
struct Evaluation<'a, const LOADS: bool> {
    tree: &'a mut TreeKernel,
    system: &'a System,
    state: &'a State,
    hinge: &'a mut [f64],
    modal: &'a mut [f64],
    passes: [bool; 3],
}

impl<const LOADS: bool> Kernel for Evaluation<'_, LOADS> {
    type Output = Result<(), Doubtful>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Result<(), Doubtful> {
        let Self { tree, system, state, hinge, modal, passes } = self;
        if passes[0] {
            outward::outward(lanes, tree, system, state);
        }
        if passes[1] {
            inward::inward::<L, LOADS>(lanes, tree, system, state)?;
        }
        if passes[2] {
            accelerate::accelerate::<L, LOADS>(lanes, tree, system, hinge, modal);
        }
        Ok(())
    }
}

/// What the motion of the parent makes of a hinge of at most one rate.
struct Arm<V> {
    /// O of the parent to O of the link.
    l: V,
    /// Bias acceleration at O: angular.
    angular: V,
    /// Linear.
    linear: V,
}

/// Arm and bias of such a hinge about or along `axis`.
#[inline(always)]
fn arm<L: Lanes>(s: L, link: &Link, shape: &Shape, state: &State, parent: [L::V; 3], omega: L::V, axis: L::V) -> Arm<L::V> {
    let l = s.combine_numbers(parent, shape.offset);
    match link.passage {
        Passage::Revolute => {
            let angular = s.cross(omega, s.mul(axis, s.splat(state.velocity[link.v as usize])));
            Arm { l, angular, linear: s.cross(omega, s.cross(omega, l)) }
        }
        Passage::Slide => {
            let (q, v) = (state.position[link.q as usize], state.velocity[link.v as usize]);
            let l = s.mul_add(axis, s.splat(shape.travel_rate * q), l);
            let angular = s.cross(omega, s.mul(axis, s.splat(shape.turn_rate * v)));
            let slide = s.mul(axis, s.splat(2.0 * shape.travel_rate * v));
            Arm { l, angular, linear: s.cross(omega, s.add(s.cross(omega, l), slide)) }
        }
        Passage::Fixed | Passage::General => Arm { l, angular: s.splat(0.0), linear: s.cross(omega, s.cross(omega, l)) },
    }
}

/// Attitude and angular velocity of what carries `link`: its parent, or the frame on the parent that modes move.
#[inline(always)]
fn parent_motion<L: Lanes>(s: L, link: &Link, layout: &Layout, motion: &[Motion], flexible: &[FlexibleLink]) -> ([L::V; 3], L::V) {
    let m = carrier(link, layout, motion, flexible).unwrap_or(&Motion::REST);
    (record::block(s, &m.turn), s.load(m.omega))
}

#[inline(always)]
fn carrier<'a>(link: &Link, layout: &Layout, motion: &'a [Motion], flexible: &'a [FlexibleLink]) -> Option<&'a Motion> {
    match layout.tips.get(link.tip as usize) {
        None => motion.get(link.parent as usize),
        Some(&(body, tip)) => Some(&flexible[body as usize].tips[tip as usize].motion),
    }
}
