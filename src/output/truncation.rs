//! How much the modes that a scene leaves out would change its loads and stresses: followed over a run, at little cost.
//!
//! The left-out modes are driven by the motion that the retained ones make, one way: each is an oscillator under the force that a
//! Newton-Euler sweep of the system with all modes finds for it. At output times the forces that their motion exerts on the bodies act
//! on the retained system, and what that changes at the hinges is the estimate; stress takes their part directly. This is the first
//! term of a series in the left-out flexibility: it tells 1 % from 10 %, not 1.0 % from 1.1 %. A run with all modes tells the rest.

use super::closure_load::ClosureGauge;
use super::evaluation::Named;
use super::frame::OutputFrame;
use super::plan::{OutputPlan, TruncationPlan};
use super::report::{StressTruncation, Truncation, TruncationFigures};
use crate::dynamics::closed_chain::constraint::SystemForces;
use crate::dynamics::hinge_load::hinge_load;
use crate::dynamics::inverse::NewtonEuler;
use crate::dynamics::sweep::force_inward::{ForceScratch, gather_applied};
use crate::dynamics::sweep::pose_outward::{PoseScratch, pose_outward};
use crate::dynamics::{Workspace, forward_dynamics};
use crate::integrate::Sample;
use crate::model::left_out::LeftOut;
use crate::model::{State, System};
use crate::spatial::shift::{angular, linear};
use nalgebra::{DVector, DVectorView, DVectorViewMut, Vector6};
use std::sync::Arc;

/// Share of the largest stress so far from which a stress is worth an estimate.
const NEAR_PEAK: f64 = 0.5;

/// Left-out modes of one body; every vector has one entry per mode of the rest.
#[derive(Debug, Clone)]
struct Oscillators {
    position: DVector<f64>,
    velocity: DVector<f64>,
    acceleration: DVector<f64>,
    /// Generalised force now and at the two times before.
    force: [DVector<f64>; 3],
}

/// Largest estimates so far and what they belong to.
#[derive(Debug, Clone)]
struct LoadEstimate {
    name: String,
    moment: f64,
    force: f64,
}

impl LoadEstimate {
    fn of(name: &str) -> Self {
        Self { name: name.to_owned(), moment: 0.0, force: 0.0 }
    }

    fn raise(&mut self, change: &Vector6<f64>) {
        self.moment = self.moment.max(angular(change).norm());
        self.force = self.force.max(linear(change).norm());
    }
}

/// Follows the left-out modes of one run.
#[derive(Debug, Clone)]
pub struct TruncationGauge {
    plan: TruncationPlan,
    // the system with all modes
    state: State,
    /// Modal accelerations; once they are used, room for differences of rows.
    modal_acceleration: Vec<f64>,
    pose: PoseScratch,
    force: ForceScratch,
    still: NewtonEuler,
    moving: NewtonEuler,
    generalised: [Vec<f64>; 2],
    oscillators: Vec<Oscillators>,
    /// Time of the last force, and the interval before it.
    time: Option<f64>,
    interval: f64,
    /// The retained system under the forces of the left-out modes.
    changed: Workspace,
    hinges: Vec<(usize, LoadEstimate)>,
    closures: Vec<(ClosureGauge, LoadEstimate)>,
    /// Name, largest stress so far, and estimate of each surface's body.
    stress: Vec<(String, f64, f64)>,
}

impl TruncationGauge {
    /// A gauge of what `plan` puts out of `system`; none where nothing is left out or the plan does not ask for it.
    #[must_use]
    pub fn new(system: &System, plan: &OutputPlan) -> Option<Self> {
        let truncation = plan.truncation.clone()?;
        let all = &truncation.modes.system;
        let zeros = |n: usize| DVector::zeros(n);
        let oscillators = truncation.modes.bodies.iter().map(|left| {
            let n = left.omega.len();
            Oscillators { position: zeros(n), velocity: zeros(n), acceleration: zeros(n), force: [zeros(n), zeros(n), zeros(n)] }
        });
        let mut changed = Workspace::new(system);
        changed.force.make_room_for_added(system);
        let hinges = plan.loaded_hinges().into_iter().map(|k| (k, LoadEstimate::of(&system.bodies[k].hinge.name)));
        let closures =
            plan.loaded_closures().into_iter().map(|i| (ClosureGauge::new(system, i), LoadEstimate::of(&system.closures[i].name)));
        Some(Self {
            state: State::reference(all),
            modal_acceleration: vec![0.0; all.modal_count],
            pose: PoseScratch::new(all),
            force: ForceScratch::new(all),
            still: NewtonEuler::new(all),
            moving: NewtonEuler::new(all),
            generalised: [vec![0.0; all.velocity_count], vec![0.0; all.modal_count]],
            oscillators: oscillators.collect(),
            time: None,
            interval: 0.0,
            changed,
            hinges: hinges.collect(),
            closures: closures.collect(),
            stress: plan.surfaces.iter().map(|s| (system.bodies[s.body].name.clone(), 0.0, 0.0)).collect(),
            plan: truncation,
        })
    }

    /// Takes the left-out modes to the time of `sample`, an output time or the end of a step.
    pub fn follow(&mut self, sample: &Sample<'_>) {
        let modes = Arc::clone(&self.plan.modes);
        let time = sample.state.time;
        let step = self.time.map(|before| time - before);
        // an output time that is the end of a step comes twice
        if step.is_some_and(|h| h <= 1e-12 * time.abs().max(1.0)) {
            return;
        }
        self.set_motion(sample, false);
        pose_outward(&modes.system, &self.state, &mut self.pose);
        self.gather_forces(sample);
        let acceleration = &sample.workspace.acceleration.hinge;
        self.still.sweep(&modes.system, &self.state, acceleration, &self.modal_acceleration, &self.pose, &self.force);
        let [hinge, modal] = &mut self.generalised;
        self.still.generalised_force(&modes.system, &self.state, &self.pose, hinge, modal);
        for (left, oscillators) in modes.bodies.iter().zip(&mut self.oscillators) {
            let row = &modal[modes.system.bodies[left.body].modal_range()];
            oscillators.take_force(left, row);
            oscillators.advance(left, step, self.interval);
        }
        self.interval = step.unwrap_or(0.0);
        self.time = Some(time);
    }

    /// Takes in one output time.
    pub fn observe(&mut self, plan: &OutputPlan, sample: &Sample<'_>, frame: &OutputFrame) {
        self.follow(sample);
        let (system, modes) = (sample.system, Arc::clone(&self.plan.modes));
        self.set_motion(sample, true);
        let acceleration = &sample.workspace.acceleration.hinge;
        pose_outward(&modes.system, &self.state, &mut self.pose);
        self.gather_forces(sample);
        self.moving.sweep(&modes.system, &self.state, acceleration, &self.modal_acceleration, &self.pose, &self.force);
        let Some(added) = &mut self.changed.force.added else { return };
        for (k, added) in added.external.iter_mut().enumerate() {
            *added = self.still.inertial[k] - self.moving.inertial[k];
        }
        added.modal.fill(0.0);
        for (k, body) in system.bodies.iter().enumerate().filter(|(_, b)| b.mode_count() > 0) {
            let all = modes.system.bodies[k].modal_range();
            let change = &mut self.modal_acceleration[all.clone()];
            change.iter_mut().zip(all).for_each(|(c, m)| *c = self.still.modal_row(m) - self.moving.modal_row(m));
            let added = &mut added.modal[body.modal_range()];
            match modes.bodies.iter().find(|left| left.body == k) {
                Some(left) => DVectorViewMut::from_slice(added, added.len()).gemv_tr(1.0, &left.retained, &view(change), 0.0),
                None => added.copy_from_slice(change),
            }
        }
        // a state that has no answer so changed says nothing more
        if forward_dynamics(system, sample.state, &mut self.changed).is_ok() {
            for (k, estimate) in &mut self.hinges {
                estimate.raise(&(hinge_load(&self.changed, *k) - hinge_load(sample.workspace, *k)));
            }
            for (gauge, estimate) in &mut self.closures {
                let [after, before] = [&self.changed, sample.workspace].map(|w| gauge.read(system, w).load);
                let [moment, force] = after.difference(&before);
                estimate.moment = estimate.moment.max(moment);
                estimate.force = estimate.force.max(force);
            }
        }
        for (i, ((surface, rest), (_, peak, estimate))) in plan.surfaces.iter().zip(&self.plan.stress).zip(&mut self.stress).enumerate() {
            let Some((rest, index)) = rest.as_ref().filter(|_| surface.stress) else { continue };
            let base = frame.stress[i].value;
            *peak = peak.max(base);
            // what changes little stresses changes no peak, and this is proportional to the nodes
            if base < NEAR_PEAK * *peak {
                continue;
            }
            let eta = &sample.state.modal_position[system.bodies[surface.body].modal_range()];
            let with = surface.surface.stress_peak_with(eta, rest, self.oscillators[*index].position.as_slice());
            *estimate = estimate.max((with.value - base).abs());
        }
    }

    /// The state with all modes: the retained ones, and with `left_out` those as well.
    fn set_motion(&mut self, sample: &Sample<'_>, left_out: bool) {
        let (from, modes) = (sample.state, &self.plan.modes);
        self.state.time = from.time;
        self.state.position.copy_from_slice(&from.position);
        self.state.velocity.copy_from_slice(&from.velocity);
        for (k, body) in sample.system.bodies.iter().enumerate() {
            let (own, all) = (body.modal_range(), modes.system.bodies[k].modal_range());
            let moves = [
                (&from.modal_position[own.clone()], &mut self.state.modal_position[all.clone()]),
                (&from.modal_velocity[own.clone()], &mut self.state.modal_velocity[all.clone()]),
                (&sample.workspace.acceleration.modal[own], &mut self.modal_acceleration[all]),
            ];
            let index = modes.bodies.iter().position(|left| left.body == k);
            for (i, (retained, target)) in moves.into_iter().enumerate() {
                let Some(index) = index else {
                    target.copy_from_slice(retained);
                    continue;
                };
                let left = &modes.bodies[index];
                let mut target = DVectorViewMut::from_slice(target, target.len());
                target.gemv(1.0, &left.retained, &view(retained), 0.0);
                if left_out {
                    let own = &self.oscillators[index];
                    target.gemv(1.0, &left.rest, [&own.position, &own.velocity, &own.acceleration][i], 1.0);
                }
            }
        }
    }

    /// Loads and closure forces of `sample` on the system with all modes.
    fn gather_forces(&mut self, sample: &Sample<'_>) {
        let all = &self.plan.modes.system;
        gather_applied(all, &self.state, &self.pose, &mut self.force);
        let Some(chain) = &sample.workspace.closed else { return };
        let ForceScratch { external, external_modal, applied, .. } = &mut self.force;
        for (closure, at) in all.closures.iter().zip(&self.pose.closures) {
            let mut forces = SystemForces { system: all, external, modal: external_modal, applied };
            at.push(closure, &chain.lambda[closure.rows()], &mut forces);
        }
    }

    /// The estimates.
    #[must_use]
    pub fn report(&self, system: &System) -> Truncation {
        let loads = |e: &LoadEstimate| (e.name.clone(), TruncationFigures { moment: e.moment, force: e.force });
        let in_order = |k: &usize| self.hinges.iter().find(|(body, _)| body == k).map(|(_, e)| loads(e));
        let stress = self.stress.iter().zip(&self.plan.stress).filter(|(_, rest)| rest.is_some());
        Truncation {
            hinges: system.definition_order.iter().filter_map(in_order).collect(),
            closures: self.closures.iter().map(|(_, e)| loads(e)).collect(),
            bodies: stress.map(|((name, _, change), _)| (name.clone(), StressTruncation { von_mises: *change })).collect::<Named<_>>(),
        }
    }
}

/// A slice as a vector.
fn view(x: &[f64]) -> DVectorView<'_, f64> {
    DVectorView::from_slice(x, x.len())
}

impl Oscillators {
    /// The force that the rows of all modes leave over for the rest.
    fn take_force(&mut self, left: &LeftOut, row: &[f64]) {
        self.force.rotate_right(1);
        self.force[0].gemv_tr(-1.0, &left.rest, &view(row), 0.0);
    }

    /// Moves to the time of the newest force, `step` after the one before; at rest under it without a step. `before` is the step before.
    ///
    /// A mode that the step does not resolve follows its force with the lag of its inertia; others take the exact answer to a force
    /// that grows linearly over the step.
    fn advance(&mut self, left: &LeftOut, step: Option<f64>, before: f64) {
        for j in 0..left.omega.len() {
            let (omega, zeta) = (left.omega[j], left.damping_ratio[j].min(0.99));
            let [f, f0, f1] = [0, 1, 2].map(|i| self.force[i][j]);
            if !(omega > 0.0) {
                continue;
            }
            let stiffness = omega * omega;
            let Some(h) = step else {
                (self.position[j], self.velocity[j], self.acceleration[j]) = (f / stiffness, 0.0, 0.0);
                continue;
            };
            let slope = (f - f0) / h;
            if omega * h > 1.0 {
                let bend = if before > 0.0 { 2.0 * (slope - (f0 - f1) / before) / (h + before) } else { 0.0 };
                (self.position[j], self.velocity[j], self.acceleration[j]) = (f / stiffness, slope / stiffness, bend / stiffness);
                continue;
            }
            // x = particular + free; particular: (f(t) - 2 zeta slope / omega) / omega^2
            let particular = |f: f64| (f - 2.0 * zeta * slope / omega) / stiffness;
            let (x, v) = (self.position[j] - particular(f0), self.velocity[j] - slope / stiffness);
            let damped = omega * (1.0 - zeta * zeta).sqrt();
            let (sin, cos) = (damped * h).sin_cos();
            let decay = (-zeta * omega * h).exp();
            let b = (v + zeta * omega * x) / damped;
            let free = decay * (x * cos + b * sin);
            let free_rate = decay * (damped * (b * cos - x * sin)) - zeta * omega * free;
            self.position[j] = particular(f) + free;
            self.velocity[j] = slope / stiffness + free_rate;
            self.acceleration[j] = -2.0 * zeta * omega * free_rate - stiffness * free;
        }
    }
}
