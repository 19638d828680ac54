//! The initial value problem of one step, in coordinates local to the step's start.
//!
//! y = (increments of hinge and modal coordinates; hinge and modal rates; work of what is not conservative). Increments of
//! rotations are rotation vectors with rate `Jr^-1 omega`, so y starts at zero increments in every step (a Munthe-Kaas method).

use crate::dynamics::{DynamicsError, Workspace, accelerations, energy};
use crate::model::hinge::MAX_RATES;
use crate::model::{State, System};
use std::time::{Duration, Instant};

/// Evaluations from one that is timed to the next.
const TIMED_EVERY: u64 = 16;

/// Local problem: a base state and the map from y to states and rates.
#[derive(Debug)]
pub struct Chart<'a> {
    /// The system.
    pub system: &'a System,
    /// State at the step's start.
    pub base: State,
    /// What rounding has left out of `base.time` (s): the step starts at the sum of the two.
    pub clock_rest: f64,
    /// The next time (s) at which a function may jump: no stage is evaluated beyond it, where rounding of t + h would.
    pub stop: f64,
    /// Work done up to the step's start (J).
    pub work: f64,
    /// Evaluations so far.
    pub evaluations: u64,
    /// Wall-clock time of those evaluations that were timed, and how many they are.
    pub timed: (Duration, u32),
    /// How near the loops came to a change point since this was last set: all, and cut ones.
    pub nearest_rank_loss: [f64; 2],
    /// The last evaluation.
    pub workspace: Workspace,
    state: State,
    /// Coordinates that are sums of their increments, as runs: the first, its increment, their number.
    straight: Vec<[usize; 3]>,
    /// Bodies whose hinge has others.
    turning: Vec<usize>,
}

impl<'a> Chart<'a> {
    /// A chart at `start`.
    #[must_use]
    pub fn new(system: &'a System, start: &State) -> Self {
        Self {
            system,
            base: start.clone(),
            clock_rest: 0.0,
            stop: f64::INFINITY,
            work: 0.0,
            evaluations: 0,
            timed: (Duration::ZERO, 0),
            nearest_rank_loss: [f64::INFINITY; 2],
            workspace: Workspace::new(system),
            state: start.clone(),
            straight: straight_runs(system),
            turning: (0..system.bodies.len()).filter(|&k| system.bodies[k].hinge.kind.has_quaternion()).collect(),
        }
    }

    /// Number of increments: hinge rates and modes.
    #[must_use]
    pub fn increments(&self) -> usize {
        self.system.velocity_count + self.system.modal_count
    }

    /// Length of y.
    #[must_use]
    pub fn len(&self) -> usize {
        2 * self.increments() + 1
    }

    /// True for a system without coordinates.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.increments() == 0
    }

    /// y of the base.
    pub fn base_vector(&self, y: &mut [f64]) {
        let (n, nv) = (self.increments(), self.system.velocity_count);
        y[..n].fill(0.0);
        y[n..n + nv].copy_from_slice(&self.base.velocity);
        y[n + nv..2 * n].copy_from_slice(&self.base.modal_velocity);
        y[2 * n] = self.work;
    }

    /// State that y stands for at `time` (s), prescribed hinges at their functions' values.
    pub fn state_of(&self, time: f64, y: &[f64], out: &mut State) {
        let (n, nv) = (self.increments(), self.system.velocity_count);
        out.time = time;
        for &[q, v, count] in &self.straight {
            let sums = self.base.position[q..q + count].iter().zip(&y[v..v + count]);
            out.position[q..q + count].iter_mut().zip(sums).for_each(|(o, (q, d))| *o = q + d);
        }
        for body in self.turning.iter().map(|&k| &self.system.bodies[k]) {
            let (q, v) = (body.position_range(), body.velocity_range());
            body.hinge.kind.advance(&self.base.position[q.clone()], &y[v], &mut out.position[q]);
        }
        for (o, (b, d)) in out.modal_position.iter_mut().zip(self.base.modal_position.iter().zip(&y[nv..n])) {
            *o = b + d;
        }
        out.velocity.copy_from_slice(&y[n..n + nv]);
        out.modal_velocity.copy_from_slice(&y[n + nv..2 * n]);
        out.apply_prescribed(self.system);
    }

    /// Evaluates the rate of y at `time` (s).
    ///
    /// # Errors
    /// If the dynamics have no answer there.
    pub fn rate(&mut self, time: f64, y: &[f64], rate: &mut [f64]) -> Result<(), DynamicsError> {
        let time = time.min(self.stop);
        let mut state = std::mem::replace(
            &mut self.state,
            State { time, position: vec![], velocity: vec![], modal_position: vec![], modal_velocity: vec![] },
        );
        self.state_of(time, y, &mut state);
        let closed = self.workspace.close_aggregates(self.system, &mut state);
        let done = closed.and_then(|()| self.rate_at(&state, y, rate));
        self.state = state;
        done
    }

    fn rate_at(&mut self, state: &State, y: &[f64], rate: &mut [f64]) -> Result<(), DynamicsError> {
        let started = self.evaluations.is_multiple_of(TIMED_EVERY).then(Instant::now);
        self.evaluations += 1;
        let done = accelerations(self.system, state, &mut self.workspace);
        if let Some(started) = started {
            self.timed.0 += started.elapsed();
            self.timed.1 += 1;
        }
        let [all, cut] = self.nearest_rank_loss;
        self.nearest_rank_loss = [all.min(self.workspace.distance_to_rank_loss()), cut.min(self.workspace.cut_distance_to_rank_loss())];
        done?;
        let (n, nv) = (self.increments(), self.system.velocity_count);
        self.increment_rates(state, Some(y), rate);
        rate[nv..n].copy_from_slice(&state.modal_velocity);
        rate[n..n + nv].copy_from_slice(&self.workspace.acceleration.hinge);
        rate[n + nv..2 * n].copy_from_slice(&self.workspace.acceleration.modal);
        for &k in &self.system.prescribed {
            let v = self.system.bodies[k].velocity_range();
            rate[n + v.start..n + v.end].fill(0.0);
        }
        rate[2 * n] = energy::power(self.system, state, &self.workspace);
        Ok(())
    }

    /// Rates of the increments `y` (zero if there are none) of the hinges, which have led to `state`, into `rate`.
    fn increment_rates(&self, state: &State, y: Option<&[f64]>, rate: &mut [f64]) {
        rate[..self.system.velocity_count].copy_from_slice(&state.velocity);
        for body in self.turning.iter().map(|&k| &self.system.bodies[k]) {
            let (q, v) = (&state.position[body.position_range()], body.velocity_range());
            let delta = y.map_or(&[0.0; MAX_RATES][..v.len()], |y| &y[v.clone()]);
            body.hinge.kind.increment_rate(q, delta, &state.velocity[v.clone()], &mut rate[v]);
        }
        for &k in &self.system.prescribed {
            rate[self.system.bodies[k].velocity_range()].fill(0.0);
        }
    }

    /// Moves the base to the state that y stands for `h` (s) later, and the rate of y to the new chart's.
    ///
    /// The clock is a compensated sum: equal steps round alike, and a million of them would put it off by a million half ulps.
    pub fn rebase(&mut self, h: f64, y: &[f64], rate: &mut [f64]) {
        let step = h + self.clock_rest;
        let time = self.base.time + step;
        self.clock_rest = step - (time - self.base.time);
        let mut state = std::mem::replace(
            &mut self.state,
            State { time, position: vec![], velocity: vec![], modal_position: vec![], modal_velocity: vec![] },
        );
        self.state_of(time, y, &mut state);
        // independent coordinates are chosen between steps; the step's last evaluation has closed this state already
        self.workspace.pose.hold_coordinates(false);
        let _ = self.workspace.close_aggregates(self.system, &mut state);
        self.workspace.pose.hold_coordinates(true);
        std::mem::swap(&mut self.base, &mut state);
        self.state = state;
        self.work = y[2 * self.increments()];
        self.increment_rates(&self.base, None, rate);
    }
}

/// Runs of hinge coordinates that are sums of their increments, with a quaternion between them: first coordinate, first increment, number.
fn straight_runs(system: &System) -> Vec<[usize; 3]> {
    let mut runs: Vec<[usize; 3]> = vec![];
    for body in system.bodies.iter().filter(|b| !b.hinge.kind.has_quaternion()) {
        let (q, v) = (body.position_range(), body.velocity_range());
        match runs.last_mut() {
            Some([first, _, count]) if *first + *count == q.start => *count += q.len(),
            _ => runs.push([q.start, v.start, q.len()]),
        }
    }
    runs
}
