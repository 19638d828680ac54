//! What all outputs of one output time share, evaluated once.

use super::closure_load::{ClosureGauge, ClosureRecord};
use super::plan::OutputPlan;
use super::surface::StressPeak;
use crate::dynamics::energy::{Energy, Momentum, balance};
use crate::dynamics::hinge_load::hinge_load;
use crate::dynamics::inverse::{AuditResidual, NewtonEuler};
use crate::dynamics::world::WorldFrame;
use crate::integrate::Sample;
use crate::model::System;
use nalgebra::Vector6;

/// Derived quantities of one output time.
#[derive(Debug, Clone)]
pub struct OutputFrame {
    /// Loads at the plan's loaded hinges: (moment N m about O; force N), by the parent on the child, O axes.
    pub loads: Vec<Vector6<f64>>,
    /// The plan's loaded closures.
    pub closures: Vec<ClosureRecord>,
    /// World poses of the recursion's frames, one per body.
    pub frames: Vec<WorldFrame>,
    /// J.
    pub energy: Energy,
    /// Inertial axes.
    pub momentum: Momentum,
    /// Per surface of the plan; zero where no stress is asked for.
    pub stress: Vec<StressPeak>,
    /// Of the audit, if the plan has one.
    pub audit: Option<AuditResidual>,
    /// Largest violation of a closure (m or rad), if there are closures.
    pub closure: Option<f64>,
}

/// Evaluates frames into room of its own.
#[derive(Debug, Clone)]
pub struct FrameEvaluator {
    hinges: Vec<usize>,
    closures: Vec<ClosureGauge>,
    audit: Option<NewtonEuler>,
    /// The last frame.
    pub frame: OutputFrame,
}

impl FrameEvaluator {
    /// Room for what `plan` asks of `system`.
    #[must_use]
    pub fn new(system: &System, plan: &OutputPlan) -> Self {
        let hinges = plan.loaded_hinges();
        let closures: Vec<_> = plan.loaded_closures().into_iter().map(|i| ClosureGauge::new(system, i)).collect();
        let frame = OutputFrame {
            loads: vec![Vector6::zeros(); hinges.len()],
            closures: closures.iter().map(ClosureGauge::nothing).collect(),
            frames: vec![WorldFrame::default(); system.bodies.len()],
            energy: Energy::default(),
            momentum: Momentum::default(),
            stress: vec![StressPeak::default(); plan.surfaces.len()],
            audit: None,
            closure: None,
        };
        Self { hinges, closures, audit: plan.audit.then(|| NewtonEuler::new(system)), frame }
    }

    /// Evaluates the frame of `sample`.
    pub fn evaluate(&mut self, plan: &OutputPlan, sample: &Sample<'_>) {
        let Self { hinges, closures, audit, frame } = self;
        let Sample { system, state, workspace, .. } = *sample;
        for (load, &body) in frame.loads.iter_mut().zip(hinges.iter()) {
            *load = hinge_load(workspace, body);
        }
        for (record, gauge) in frame.closures.iter_mut().zip(closures.iter()) {
            *record = gauge.read(system, workspace);
        }
        (frame.energy, frame.momentum) = balance(system, state, workspace, &mut frame.frames);
        for (peak, surface) in frame.stress.iter_mut().zip(&plan.surfaces) {
            if surface.stress {
                *peak = surface.surface.stress_peak(&state.modal_position[system.bodies[surface.body].modal_range()]);
            }
        }
        let worst = (0..system.closures.len()).map(|i| workspace.pose.closure_residual(system, i)).reduce(f64::max);
        frame.closure = worst;
        frame.audit = audit.as_mut().map(|audit| audit.audit(system, state, workspace));
    }
}
