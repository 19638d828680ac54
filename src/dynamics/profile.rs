//! What the parts of one evaluation cost, measured at a state.

use super::{DynamicsError, Workspace, accelerations, closed_chain, forward_dynamics, sweep};
use crate::model::{State, System};
use std::time::{Duration, Instant};

/// Time (s) of the parts of one evaluation.
///
/// The kernel for trees ([`super::kernel`]) has three parts only: its first pass, poses with velocities, counts as poses, its second,
/// inertias with forces, as inertias.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EvaluationTime {
    /// Poses, maps, and inertias of the deformed bodies.
    pub poses: f64,
    /// Velocities and what they make of accelerations.
    pub velocities: f64,
    /// Articulated inertias and gains.
    pub inertias: f64,
    /// Loads, springs, and residual forces.
    pub forces: f64,
    /// Accelerations.
    pub accelerations: f64,
    /// Multipliers and loads of closures.
    pub closures: f64,
}

impl EvaluationTime {
    /// All parts.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.poses + self.velocities + self.inertias + self.forces + self.accelerations + self.closures
    }
}

/// Times the sweeps, or the passes of the kernel, at `state` one by one, each as often as fits into a share of `budget`, and gives the quickest of each.
///
/// # Errors
/// [`DynamicsError`] if the evaluation has no answer.
pub fn profile(system: &System, state: &State, budget: Duration) -> Result<EvaluationTime, DynamicsError> {
    let mut workspace = Workspace::new(system);
    accelerations(system, state, &mut workspace)?;
    if workspace.is_by_kernel() {
        return profile_kernel(system, state, budget, &mut workspace);
    }
    let Workspace { pose, velocity, inertia, force, acceleration, closed, .. } = &mut workspace;
    let share = budget / 6;
    let poses = quickest(share, || {
        sweep::pose_outward::pose_outward(system, state, pose);
        Ok(())
    })?;
    let velocities = quickest(share, || {
        sweep::velocity_outward::velocity_outward(system, state, pose, velocity);
        closed_chain::check_embedded(system, pose, velocity)
    })?;
    let inertias = quickest(share, || sweep::inertia_inward::inertia_inward(system, pose, inertia))?;
    let forces = quickest(share, || {
        sweep::force_inward::force_inward(system, state, pose, velocity, inertia, force);
        Ok(())
    })?;
    let mut swept = || {
        sweep::acceleration_outward::acceleration_outward(system, pose, velocity, inertia, force, acceleration);
        Ok(())
    };
    let accelerations = quickest(share, &mut swept)?;
    // what closures add cannot be repeated alone: it is what a whole evaluation takes beyond its sweeps
    let mut time = EvaluationTime { poses, velocities, inertias, forces, accelerations, closures: 0.0 };
    if closed.is_some() {
        let whole = quickest(share, || forward_dynamics(system, state, &mut workspace))?;
        time.closures = (whole - time.total()).max(0.0);
    }
    Ok(time)
}

/// The same by the passes of the kernel.
fn profile_kernel(system: &System, state: &State, budget: Duration, workspace: &mut Workspace) -> Result<EvaluationTime, DynamicsError> {
    let Workspace { tree, acceleration, .. } = workspace;
    let mut times = [0.0; 3];
    for (pass, time) in times.iter_mut().enumerate() {
        *time = quickest(budget / 3, || {
            if let Some(tree) = tree {
                tree.repeat_pass(pass, system, state, &mut acceleration.hinge, &mut acceleration.modal);
            }
            Ok(())
        })?;
    }
    let [poses, inertias, accelerations] = times;
    Ok(EvaluationTime { poses, inertias, accelerations, ..EvaluationTime::default() })
}

/// Batches from which the quickest is taken, so that whatever else the machine does counts little.
const BATCHES: u32 = 8;

/// Time of `work`: the average over a batch, of the quickest batch of as many as fit into `share`, at least one of one.
fn quickest(share: Duration, mut work: impl FnMut() -> Result<(), DynamicsError>) -> Result<f64, DynamicsError> {
    let started = Instant::now();
    let mut least = f64::INFINITY;
    while least.is_infinite() || started.elapsed() < share {
        let batch = Instant::now();
        let mut count = 0_u32;
        while count == 0 || batch.elapsed() < share / BATCHES {
            work()?;
            count += 1;
        }
        least = least.min(batch.elapsed().as_secs_f64() / f64::from(count));
    }
    Ok(least)
}
