//! The time loop: steps, breaks, output times, and an orderly end whatever happens.

use super::change_point::{self, Passage};
use super::chart::Chart;
use super::failure::RunFailure;
use super::observer::{Flow, LocalError, Observer, Sample};
use super::rosenbrock_w::RosenbrockW;
use super::runge_kutta::RungeKutta;
use super::stability::{fastest_mode, stable_step};
use super::step_control::{Controller, Tolerance};
use super::tableau::Tableau;
use super::w_tableau::ROS34PW2;
use super::{Stepper, tableau};
use crate::dynamics::closed_chain::drift;
use crate::dynamics::{DynamicsError, Workspace, accelerations, forward_dynamics};
use crate::model::hinge::HingePose;
use crate::model::{Body, ClosureMethod, HingeKind, State, System};

/// A method with its step or tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Fixed steps of the classical method of order 4 (s).
    RungeKutta4 { step: f64 },
    /// Dormand-Prince 5(4) with error control; `largest_step` in s.
    DormandPrince { tolerance: Tolerance, largest_step: f64 },
    /// The linearly implicit ROS34PW2 with error control; `largest_step` in s.
    RosenbrockW { tolerance: Tolerance, largest_step: f64 },
}

impl Method {
    /// Name in scenes and reports.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.tableau().map_or(ROS34PW2.name, |t| t.name)
    }

    /// Coefficients of an explicit method.
    #[must_use]
    pub fn tableau(&self) -> Option<Tableau> {
        match self {
            Self::RungeKutta4 { .. } => Some(tableau::RK4),
            Self::DormandPrince { .. } => Some(tableau::DORMAND_PRINCE),
            Self::RosenbrockW { .. } => None,
        }
    }

    /// Largest stable step (s) with a mode of `frequency_hz` and `damping_ratio`; infinite for an implicit method.
    #[must_use]
    pub fn stable_step(&self, frequency_hz: f64, damping_ratio: f64) -> f64 {
        self.tableau().map_or(f64::INFINITY, |t| stable_step(&t, frequency_hz, damping_ratio))
    }

    fn stepper(&self, chart: &Chart<'_>) -> Box<dyn Stepper> {
        match *self {
            Self::RungeKutta4 { .. } => Box::new(RungeKutta::new(tableau::RK4, None, chart)),
            Self::DormandPrince { tolerance, .. } => Box::new(RungeKutta::new(tableau::DORMAND_PRINCE, Some(tolerance), chart)),
            Self::RosenbrockW { tolerance, .. } => Box::new(RosenbrockW::new(ROS34PW2, tolerance, chart)),
        }
    }
}

/// What to run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// s.
    pub duration: f64,
    /// Method.
    pub method: Method,
    /// Output times per second.
    pub rate_hz: f64,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// At its duration.
    Completed,
    /// Where an observer asked to stop.
    Stopped,
    /// Early.
    Failed(RunFailure),
}

/// What a run did.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// How it ended.
    pub outcome: Outcome,
    /// Time reached (s).
    pub time: f64,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Evaluations of the dynamics, output included.
    pub evaluations: u64,
    /// Wall-clock time (s) of one evaluation, the average of every sixteenth.
    pub evaluation_s: f64,
    /// Largest accepted local error estimate relative to the motion; none for fixed steps.
    pub local_error: Option<f64>,
    /// Last state.
    pub end: State,
}

/// Integrates from `start` and shows every output time to the observers; all that is computed reaches them even if the run ends early.
pub fn simulate(system: &System, start: &State, settings: &Settings, observers: &mut [&mut dyn Observer]) -> Summary {
    let mut chart = Chart::new(system, start);
    let (tolerance, step, largest) = match settings.method {
        Method::RungeKutta4 { step } => (None, step, step),
        Method::DormandPrince { tolerance, largest_step } | Method::RosenbrockW { tolerance, largest_step } => {
            (Some(tolerance), first_step(system, settings, largest_step), largest_step)
        }
    };
    let mut stepper = settings.method.stepper(&chart);
    let mut run = Run {
        chart: &mut chart,
        controller: stepper.controlled_order().map(Controller::new),
        step,
        accepted: step,
        crept: 0,
        largest,
        resolution: f64::INFINITY,
        relative: tolerance.map_or(0.0, |t| t.relative),
        output: Workspace::new(system),
        sampled: start.clone(),
        outputs: OutputTimes { start: start.time, end: start.time + settings.duration, rate_hz: settings.rate_hz, next: 0, done: false },
        steps: 0,
        rejected: 0,
        evaluations: 0,
        local_error: 0.0,
    };
    let mut outcome = run.go(stepper.as_mut(), observers);
    if let Outcome::Failed(failure) = &mut outcome
        && let Some(locked) = gimbal_lock(run.chart)
    {
        *failure = locked;
    }
    let Run { steps, rejected, evaluations, local_error, .. } = run;
    Summary {
        outcome,
        time: chart.base.time,
        steps,
        rejected,
        evaluations: evaluations + chart.evaluations,
        evaluation_s: chart.timed.0.as_secs_f64() / f64::from(chart.timed.1.max(1)),
        local_error: tolerance.map(|_| local_error),
        end: chart.base,
    }
}

/// A cautious first step: the controller lets it grow fivefold a step.
fn first_step(system: &System, settings: &Settings, largest: f64) -> f64 {
    let stable = fastest_mode(system).map_or(f64::INFINITY, |m| settings.method.stable_step(m.frequency_hz, m.damping_ratio));
    let cautious = (1e-3 * settings.duration).min(0.1 * stable).min(1e-2);
    cautious.min(largest)
}

/// Output times: multiples of the interval, and the end.
#[derive(Debug)]
struct OutputTimes {
    start: f64,
    end: f64,
    rate_hz: f64,
    next: u64,
    done: bool,
}

impl OutputTimes {
    /// The next output time, if it is not after `time`.
    fn due(&mut self, time: f64) -> Option<f64> {
        if self.done {
            return None;
        }
        let at = self.start + self.next as f64 / self.rate_hz;
        // the end is an output time of its own; a multiple within rounding of it is the same
        let at = if at >= self.end - 1e-9 / self.rate_hz { self.end } else { at };
        if at > time {
            return None;
        }
        self.done = at == self.end;
        self.next += 1;
        Some(at)
    }
}

/// Accepted steps from one look at the local error to the next: a share of the evaluations that is not felt.
const LOCAL_ERROR_EVERY: u64 = 8;

struct Run<'r, 's> {
    chart: &'r mut Chart<'s>,
    controller: Option<Controller>,
    step: f64,
    /// The last accepted step.
    accepted: f64,
    /// Very short steps in a row.
    crept: u32,
    largest: f64,
    /// Longest step that sees the course of all functions up to the next break.
    resolution: f64,
    relative: f64,
    output: Workspace,
    sampled: State,
    outputs: OutputTimes,
    steps: u64,
    rejected: u64,
    evaluations: u64,
    local_error: f64,
}

impl Run<'_, '_> {
    fn go(&mut self, stepper: &mut dyn Stepper, observers: &mut [&mut dyn Observer]) -> Outcome {
        let (start, end) = (self.outputs.start, self.outputs.end);
        let mut stops: Vec<f64> = self.chart.system.breaks().into_iter().filter(|&t| t > start && t < end).collect();
        stops.push(end);
        match self.emit(stepper, 0.0, observers) {
            Ok(Flow::Continue) => {}
            Ok(Flow::Stop) => return Outcome::Stopped,
            Err(failure) => return Outcome::Failed(failure),
        }
        for stop in stops {
            self.chart.stop = stop;
            self.resolution = self.chart.system.resolution(0.5 * (self.chart.base.time + stop));
            match self.begin_anew(stepper, observers) {
                Ok(Flow::Continue) => {}
                Ok(Flow::Stop) => return Outcome::Stopped,
                Err(failure) => return Outcome::Failed(failure),
            }
            while self.chart.base.time < stop {
                let done = self.advance(stepper, stop).and_then(|taken| {
                    self.steps += 1;
                    self.creep(taken, end - start)?;
                    let flow = self.emit(stepper, taken, observers);
                    if self.steps.is_multiple_of(LOCAL_ERROR_EVERY) {
                        self.show_local_error(stepper, observers);
                    }
                    stepper.accept(self.chart);
                    if self.chart.base.time + 4.0 * f64::EPSILON * stop.abs() >= stop {
                        // rounding of t + h must not leave a step of a few ulps
                        self.chart.base.time = stop;
                        self.chart.clock_rest = 0.0;
                    }
                    if !self.chart.system.closures.is_empty() {
                        self.hold_closures(stepper)?;
                    }
                    if self.show_step(observers) == Flow::Stop { Ok(Flow::Stop) } else { flow }
                });
                match done {
                    Ok(Flow::Continue) => {}
                    Ok(Flow::Stop) => return Outcome::Stopped,
                    Err(failure) => return Outcome::Failed(failure),
                }
            }
        }
        Outcome::Completed
    }

    /// Starts from the base with the functions' values from just after it, as some may have jumped, and shows what they do there.
    fn begin_anew(&mut self, stepper: &mut dyn Stepper, observers: &mut [&mut dyn Observer]) -> Result<Flow, RunFailure> {
        let time = self.chart.base.time;
        self.chart.base.time = time.next_up();
        let restarted = stepper.restart(self.chart);
        self.chart.base.time = time;
        restarted.map_err(|source| RunFailure::Dynamics { time, source })?;
        Ok(self.show_step(observers))
    }

    fn show_step(&self, observers: &mut [&mut dyn Observer]) -> Flow {
        let chart = &*self.chart;
        let step = Sample { system: chart.system, state: &chart.base, workspace: &chart.workspace, work: chart.work, steps: self.steps };
        observers.iter_mut().fold(Flow::Continue, |flow, o| if o.step(&step) == Flow::Stop { Flow::Stop } else { flow })
    }

    /// Carries the local error of the attempted step to what the observers look at. A solution without an evaluation says nothing.
    fn show_local_error(&mut self, stepper: &mut dyn Stepper, observers: &mut [&mut dyn Observer]) {
        let system = self.chart.system;
        if !observers.iter().any(|o| o.wants_local_errors()) || !stepper.embedded(self.chart, &mut self.sampled) {
            return;
        }
        self.evaluations += 1;
        let closed = system.closures.is_empty() || drift::project(system, &mut self.sampled, &mut self.output).is_ok();
        if closed && accelerations(system, &self.sampled, &mut self.output).is_ok() {
            let error = LocalError { system, workspace: &self.chart.workspace, other: &self.output };
            observers.iter_mut().filter(|o| o.wants_local_errors()).for_each(|o| o.local_error(&error));
        }
    }

    /// True if some closure is cut.
    fn has_cut(&self) -> bool {
        self.chart.system.closures.iter().any(|c| c.method == ClosureMethod::TreeAugmented)
    }

    /// Takes back what the last step drifted off the closures.
    fn hold_closures(&mut self, stepper: &mut dyn Stepper) -> Result<(), RunFailure> {
        let time = self.chart.base.time;
        let cut = self.has_cut();
        let near = change_point::is_near(self.chart.nearest_rank_loss[0]);
        let wrap = |source| {
            if near { RunFailure::ChangePoint { time, cut, source: Some(source) } } else { RunFailure::Dynamics { time, source } }
        };
        let chart = &mut *self.chart;
        let drift = drift::project(chart.system, &mut chart.base, &mut chart.workspace).map_err(wrap)?;
        if drift.position > OPEN {
            return Err(opened(chart.system, &chart.workspace, time));
        }
        if drift.moved { stepper.restart(chart).map_err(wrap) } else { Ok(()) }
    }

    /// Ends a run that hardly moves: it would take longer than anyone waits.
    fn creep(&mut self, taken: f64, duration: f64) -> Result<(), RunFailure> {
        self.crept = if taken < CREEPING * duration { self.crept + 1 } else { 0 };
        if self.crept < CREEPING_STEPS {
            return Ok(());
        }
        let time = self.chart.base.time;
        Err(if change_point::is_near(self.chart.nearest_rank_loss[0]) {
            RunFailure::ChangePoint { time, cut: self.has_cut(), source: None }
        } else {
            RunFailure::StepUnderflow { time, step: taken, place: fastest_place(self.chart) }
        })
    }

    /// Finds a step towards `stop` that meets the tolerance; returns its length.
    fn advance(&mut self, stepper: &mut dyn Stepper, stop: f64) -> Result<f64, RunFailure> {
        let mut passage = Passage::default();
        loop {
            let time = self.chart.base.time;
            let left = (stop - time) - self.chart.clock_rest;
            // an error that is small because little moves must not let a step pass over a torque or a prescribed motion
            let planned = if self.controller.is_some() { self.step.min(self.resolution) } else { self.step };
            // what is left is taken at once, or halved rather than leave a sliver
            let step = if left <= planned * (1.0 + 1e-9) {
                left
            } else if left < 2.0 * planned && self.controller.is_some() {
                0.5 * left
            } else {
                planned
            };
            let floor = 16.0 * f64::EPSILON * time.abs().max(stop.abs());
            if step < floor && step < left {
                let place = fastest_place(self.chart);
                if passage.is_near() && self.chart.base.is_finite() {
                    return Err(RunFailure::ChangePoint { time, cut: self.has_cut(), source: None });
                }
                return Err(if self.sampled.is_finite() && self.sampled.time > time {
                    RunFailure::StepUnderflow { time, step, place }
                } else {
                    RunFailure::NotFinite { time, place, remedy: "look at the loads and springs that act there" }
                });
            }
            self.chart.nearest_rank_loss = [f64::INFINITY; 2];
            let attempted = stepper.attempt(self.chart, step);
            let Some(controller) = &mut self.controller else {
                let diverged = match attempted {
                    Ok(_) => {
                        stepper.interpolate(self.chart, 1.0, &mut self.sampled);
                        !self.sampled.is_finite()
                    }
                    Err(source) if source.is_breakdown() || is_torn_apart(self.chart) => true,
                    Err(source) => return Err(RunFailure::Dynamics { time, source }),
                };
                if diverged {
                    let place = fastest_place(self.chart);
                    return Err(RunFailure::NotFinite {
                        time,
                        place,
                        remedy: "take a smaller step, fewer modes or an error-controlled integrator",
                    });
                }
                return Ok(step);
            };
            let allowed = passage.allowed_error(self.chart.nearest_rank_loss, self.relative);
            match attempted {
                Ok(Some(error)) if error <= allowed => {
                    self.local_error = self.local_error.max(error * self.relative);
                    let proposed = step * controller.accepted(error.min(1.0));
                    self.accepted = step;
                    // a step cut short by a stop says nothing against the one that was planned
                    self.step = if step < self.step { proposed.max(self.step) } else { proposed }.min(self.largest);
                    return Ok(step);
                }
                Ok(error) => {
                    self.rejected += 1;
                    self.step = step * controller.rejected(error.unwrap_or(f64::NAN));
                    stepper.interpolate(self.chart, 1.0, &mut self.sampled);
                }
                Err(source) => {
                    self.rejected += 1;
                    self.step = 0.1 * step;
                    if self.step < floor {
                        let cut = self.has_cut();
                        return Err(if passage.is_near() {
                            RunFailure::ChangePoint { time, cut, source: Some(source) }
                        } else if matches!(source, DynamicsError::NotFinite { .. }) {
                            let place = fastest_place(self.chart);
                            RunFailure::NotFinite { time, place, remedy: "look at the loads and springs that act there" }
                        } else {
                            RunFailure::Dynamics { time, source }
                        });
                    }
                }
            }
            if let Some(share) = passage.leap() {
                self.step = (self.accepted * share).min(self.largest);
            }
        }
    }

    /// Shows the output times within the attempted step of length `taken` to the observers.
    fn emit(&mut self, stepper: &dyn Stepper, taken: f64, observers: &mut [&mut dyn Observer]) -> Result<Flow, RunFailure> {
        let begin = self.chart.base.time;
        let mut flow = Flow::Continue;
        while let Some(at) = self.outputs.due(begin + taken + 4.0 * f64::EPSILON * self.outputs.end.abs()) {
            if observers.is_empty() {
                continue;
            }
            let work = if taken > 0.0 {
                let theta = ((at - begin) / taken).clamp(0.0, 1.0);
                stepper.interpolate(self.chart, theta, &mut self.sampled);
                stepper.interpolate_work(theta)
            } else {
                self.sampled.clone_from(&self.chart.base);
                self.chart.work
            };
            self.sampled.time = at;
            self.sampled.apply_prescribed(self.chart.system);
            self.evaluations += 1;
            if taken > 0.0 && !self.chart.system.closures.is_empty() {
                // the interpolant leaves the closures as the step does
                drift::project(self.chart.system, &mut self.sampled, &mut self.output)
                    .map_err(|source| RunFailure::Dynamics { time: at, source })?;
            }
            let evaluated = forward_dynamics(self.chart.system, &self.sampled, &mut self.output);
            let finite = !matches!(evaluated, Err(DynamicsError::NotFinite { .. })) && is_finite(&self.output);
            if finite {
                evaluated.map_err(|source| RunFailure::Dynamics { time: at, source })?;
            } else {
                let place = fastest_place(self.chart);
                return Err(RunFailure::NotFinite {
                    time: at,
                    place,
                    remedy: "take a smaller step, fewer modes or an error-controlled integrator",
                });
            }
            let sample = Sample { system: self.chart.system, state: &self.sampled, workspace: &self.output, work, steps: self.steps };
            for observer in observers.iter_mut() {
                if observer.observe(&sample) == Flow::Stop {
                    flow = Flow::Stop;
                }
            }
        }
        Ok(flow)
    }
}

/// Share of the duration below which steps creep, and how many of them in a row end a run.
const CREEPING: f64 = 1e-10;
const CREEPING_STEPS: u32 = 1000;

/// Violation (m or rad) that no projection should leave: the motion of such a system is not the system's.
const OPEN: f64 = 1e-6;

/// The closure that is furthest open at the poses in `workspace`.
fn opened(system: &System, workspace: &Workspace, time: f64) -> RunFailure {
    let residual = |i: usize| workspace.pose.closure_residual(system, i);
    let worst = (0..system.closures.len()).max_by(|&i, &j| residual(i).total_cmp(&residual(j))).unwrap_or(0);
    RunFailure::Opened { time, closure: system.closures[worst].name.clone(), residual: residual(worst) }
}

/// True if the last evaluation saw a body deformed to a thousand times its size (a million in inertia): only a diverging motion does that.
fn is_torn_apart(chart: &Chart<'_>) -> bool {
    chart.system.bodies.iter().enumerate().any(|(k, body)| {
        let undeformed = body.flexible().map_or(f64::INFINITY, |f| 2.0 * f.integrals.second_moment.trace());
        chart.workspace.inertia_trace(k).is_some_and(|trace| trace.abs() > 1e6 * undeformed)
    })
}

/// True if the accelerations of an evaluation, and so its loads, are finite.
fn is_finite(workspace: &Workspace) -> bool {
    let acceleration = &workspace.acceleration;
    let numbers = acceleration.hinge.iter().chain(&acceleration.modal);
    numbers.chain(acceleration.alpha_plus.iter().flatten()).all(|x| x.is_finite())
}

/// Spread of axes below which rates of a gimbal, which grow with its inverse, are what ended a run.
const NEAR_LOCK: f64 = 1e-2;

/// The hinge whose axes were about to become dependent when a run ended.
fn gimbal_lock(chart: &Chart<'_>) -> Option<RunFailure> {
    let mut pose = HingePose::default();
    let mut spread_of = |body: &Body| {
        if body.hinge.is_prescribed() || !matches!(body.hinge.kind, HingeKind::Universal { .. } | HingeKind::Gimbal { .. }) {
            return 1.0;
        }
        body.hinge.kind.pose(&chart.base.position[body.position_range()], &mut pose);
        body.hinge.kind.axis_spread(&pose.map)
    };
    let spreads = chart.system.bodies.iter().map(|b| (spread_of(b), b));
    let (spread, body) = spreads.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(spread, _)| *spread < NEAR_LOCK)?;
    Some(RunFailure::GimbalLock { time: chart.base.time, hinge: body.hinge.name.clone(), child: body.name.clone(), spread })
}

/// The hinge or mode that moves fastest, for messages.
fn fastest_place(chart: &Chart<'_>) -> String {
    let state = &chart.base;
    let fastest = |x: &[f64]| x.iter().enumerate().fold((0, -1.0), |best, (i, x)| if x.abs() > best.1 { (i, x.abs()) } else { best });
    let mut places = Vec::new();
    for body in &chart.system.bodies {
        let (rate, speed) = fastest(&state.velocity[body.velocity_range()]);
        places.push((speed, format!("rate {} of hinge \"{}\"", rate + 1, body.hinge.name)));
        if let Some(flexible) = body.flexible() {
            let (mode, speed) = fastest(&state.modal_velocity[body.modal_range()]);
            if let Some(name) = flexible.mode_names.get(mode) {
                places.push((speed, format!("{name} of body \"{}\"", body.name)));
            }
        }
    }
    places.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(|| "no coordinate".into(), |p| p.1)
}
