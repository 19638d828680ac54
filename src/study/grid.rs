//! What is run: every integrator at every accuracy with every variant of the system.

use super::history::History;
use super::stress::{StressError, StressGauge, StressGauges};
use crate::integrate::simulate::Method;
use crate::integrate::stability::fastest_mode;
use crate::model::ClosureMethod;
use crate::scene::error::Source;
use crate::scene::settings::INTEGRATORS;
use crate::scene::{Accuracy, Overrides, Scene, SceneError, assemble};
use serde::Serialize;
use thiserror::Error;

/// What the user asks for; an empty list stands for what makes sense for the scene.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Integrators by name.
    pub integrators: Vec<String>,
    /// Relative tolerances of the error-controlled ones.
    pub tolerances: Vec<f64>,
    /// Steps of rk4 (s).
    pub steps: Vec<f64>,
    /// Retain the lowest N modes of every flexible body.
    pub modes: Vec<usize>,
    /// Without residual modes for those left out, with them, or both.
    pub residual_modes: Vec<bool>,
    /// Without the geometric stiffness of the modal files, with it, or both.
    pub geometric_stiffness: Vec<bool>,
    /// Orders of the inertia in the modal coordinates.
    pub orders: Vec<u8>,
    /// Methods for all closures.
    pub closure_methods: Vec<String>,
    /// Simulated time (s) instead of the scene's.
    pub duration: Option<f64>,
}

/// What a study cannot be asked for.
#[derive(Debug, Error)]
pub enum RequestError {
    /// A list that names what does not exist or cannot be.
    #[error("{option}: {message}")]
    List {
        /// The option.
        option: &'static str,
        /// What is wrong and what is possible.
        message: String,
    },
    /// A scene that cannot be assembled.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Stress that cannot be compared.
    #[error("{path}: the study cannot compare stress")]
    Stress {
        /// The scene.
        path: String,
        /// What is in the way.
        source: StressError,
    },
    /// A scene that a study can do nothing with.
    #[error("{path}: {message}")]
    Unfit {
        /// The scene.
        path: String,
        /// Why, and what to write.
        message: String,
    },
}

/// What is changed in the scene's system; what is none stays as the scene has it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Variant {
    /// Lowest modes retained of every flexible body.
    pub modes: Option<usize>,
    /// Residual modes for those left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual_modes: Option<bool>,
    /// Geometric stiffness where the modal files have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geometric_stiffness: Option<bool>,
    /// Order of the inertia.
    pub inertia_order: Option<u8>,
    /// Method for all closures.
    pub closure_method: Option<String>,
}

impl Variant {
    /// The scene so changed.
    ///
    /// # Errors
    /// If it cannot be assembled.
    pub fn assemble(&self, source: &Source, duration: Option<f64>) -> Result<Scene, SceneError> {
        let Self { modes, residual_modes, geometric_stiffness, inertia_order, closure_method } = self.clone();
        let changed = Overrides { modes, residual_modes, geometric_stiffness, inertia_order, closure_method, ..Overrides::default() };
        assemble::assemble(source.clone(), &Overrides { duration, ..changed })
    }

    /// What is changed, in words; empty if nothing is.
    #[must_use]
    pub fn words(&self) -> String {
        let switched = |on: bool, what: &str| if on { format!("with {what}") } else { format!("without {what}") };
        let words = [
            self.modes.map(|n| format!("{n} modes")),
            self.residual_modes.map(|on| switched(on, "residual modes")),
            self.geometric_stiffness.map(|on| switched(on, "geometric stiffness")),
            self.inertia_order.map(|o| format!("order {o}")),
            self.closure_method.clone(),
        ];
        words.into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}

/// One setting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// Integrator by name.
    pub integrator: String,
    /// Relative tolerance; none for rk4.
    pub tolerance: Option<f64>,
    /// Step (s) of rk4.
    pub step: Option<f64>,
    /// What is changed in the system.
    #[serde(flatten)]
    pub variant: Variant,
    /// Number of the variant.
    #[serde(skip)]
    pub scene: usize,
}

impl Point {
    /// How closely it follows the motion.
    #[must_use]
    pub fn accuracy(&self) -> Accuracy {
        match (self.tolerance, self.step) {
            (Some(tolerance), _) => Accuracy::Tolerance(tolerance),
            (None, step) => Accuracy::Step(step.unwrap_or(f64::NAN)),
        }
    }

    /// All that decides its result, beside the scene.
    #[must_use]
    pub fn identity(&self) -> String {
        let Self { integrator, tolerance, step, variant, .. } = self;
        format!("{integrator} {tolerance:?} {step:?} {variant:?}")
    }

    /// Name of its curve in a plot: all but the accuracy.
    #[must_use]
    pub fn curve(&self) -> String {
        let words = self.variant.words();
        if words.is_empty() { self.integrator.clone() } else { format!("{}, {words}", self.integrator) }
    }

    /// All of it in words.
    #[must_use]
    pub fn words(&self) -> String {
        match self.accuracy() {
            Accuracy::Tolerance(tolerance) => format!("{} at {tolerance:e}", self.curve()),
            Accuracy::Step(step) => format!("{} with steps of {step:e} s", self.curve()),
        }
    }
}

/// One system that is run, and what tells the stress of its bodies.
#[derive(Debug)]
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// Of the bodies whose stress is compared.
    pub stress: Vec<StressGauge>,
}

/// Everything that is run.
#[derive(Debug)]
pub struct Grid {
    /// The scene as it is, with the duration of the study.
    pub base: Scene,
    /// The variants of the system; there is at least one.
    pub variants: Vec<(Variant, Subject)>,
    /// All points; those of one curve follow each other, from coarse to fine.
    pub points: Vec<Point>,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// Default tolerances.
const TOLERANCES: [f64; 6] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Tightest tolerance that is run: a reference a hundred times tighter must still be above rounding.
const TIGHTEST: f64 = 1e-11;
/// Number of default steps, each half of the one before.
const STEPS: i32 = 6;
/// Largest default step as a share of the stable one.
const STABLE_SHARE: f64 = 0.5;
/// Fewest default steps in a run.
const FEWEST_STEPS: f64 = 20.0;
/// Steps above which an integrator is not run unless it is named.
pub const MOST_STEPS: f64 = 1e6;

impl Grid {
    /// The grid that `request` asks of the scene at `source`.
    ///
    /// # Errors
    /// If a list cannot be, or the scene cannot be assembled or has no loads or duration.
    pub fn new(source: &Source, request: &Request) -> Result<Self, RequestError> {
        let base = Variant::default().assemble(source, request.duration)?;
        check(&base, request)?;
        let unfit = |message: &str| RequestError::Unfit { path: source.path.display().to_string(), message: message.to_owned() };
        let Some(duration) = base.duration else {
            return Err(unfit("the scene has no [simulation] duration; add one (s) or give --duration"));
        };
        check_modes(source, request)?;
        let mut all = vec![Variant::default()];
        each(&mut all, &request.modes, |v, modes| v.modes = Some(modes));
        each(&mut all, &request.residual_modes, |v, on| v.residual_modes = Some(on));
        each(&mut all, &request.geometric_stiffness, |v, on| v.geometric_stiffness = Some(on));
        each(&mut all, &request.orders, |v, order| v.inertia_order = Some(order));
        each(&mut all, &request.closure_methods, |v, method| v.closure_method = Some(method));
        let mut gauges = StressGauges::default();
        let mut assemble = |variant: Variant| {
            let scene = variant.assemble(source, request.duration)?;
            let path = || source.path.display().to_string();
            let stress = gauges.of(&scene).map_err(|source| RequestError::Stress { path: path(), source })?;
            Ok((variant, Subject { scene, stress }))
        };
        let variants = all.into_iter().map(&mut assemble).collect::<Result<_, RequestError>>()?;
        let mut grid = Self { base, variants, points: Vec::new(), notes: Vec::new() };
        if grid.history().channels.is_empty() {
            return Err(unfit("a study compares loads, and output.hinges and output.closures name none; name some or drop the keys"));
        }
        let named = !request.integrators.is_empty();
        let integrators: Vec<&str> = match request.integrators.as_slice() {
            [] => INTEGRATORS.iter().map(|i| i.0).filter(|n| *n != "auto").collect(),
            list => list.iter().map(String::as_str).collect(),
        };
        for integrator in integrators {
            for index in 0..grid.variants.len() {
                grid.add_curve(integrator, index, request, named, duration);
            }
        }
        if grid.points.is_empty() {
            return Err(unfit(&format!("nothing is left to run: {}", grid.notes.join("; "))));
        }
        Ok(grid)
    }

    /// Of the bodies whose stress is compared; their modes are those of some variant.
    #[must_use]
    pub fn stress(&self) -> &[StressGauge] {
        self.variants.first().map_or(&[], |(_, subject)| &subject.stress)
    }

    /// An empty history of all that is compared.
    #[must_use]
    pub fn history(&self) -> History {
        History::of(&self.base, self.stress())
    }

    /// Most numbers that a run keeps per output time.
    #[must_use]
    pub fn width(&self) -> usize {
        let channels: usize = self.history().channels.iter().map(|c| c.width).sum();
        channels + self.stress().iter().map(|gauge| gauge.available).sum::<usize>()
    }

    /// Adds the points of one integrator with one variant; one that is not named and would take too long is noted instead.
    fn add_curve(&mut self, integrator: &str, index: usize, request: &Request, named: bool, duration: f64) {
        let (variant, Subject { scene, .. }) = &self.variants[index];
        let accuracies: Vec<Accuracy> = if integrator == "rk4" {
            let steps = if request.steps.is_empty() { default_steps(scene, duration) } else { descending(&request.steps) };
            steps.into_iter().map(Accuracy::Step).collect()
        } else {
            let tolerances = if request.tolerances.is_empty() { TOLERANCES.to_vec() } else { descending(&request.tolerances) };
            tolerances.into_iter().map(Accuracy::Tolerance).collect()
        };
        let steps = accuracies.iter().map(|&a| least_steps(scene, integrator, a, duration)).fold(0.0, f64::max);
        let given = integrator == "rk4" && !request.steps.is_empty();
        if steps > MOST_STEPS && !named && !given {
            let what = if variant.words().is_empty() { String::new() } else { format!(" with {}", variant.words()) };
            let note =
                format!("{integrator}{what} is left out: stability would ask for {steps:.1e} steps; name it in --integrators to run it");
            self.notes.push(note);
            return;
        }
        for accuracy in accuracies {
            let (tolerance, step) = match accuracy {
                Accuracy::Tolerance(tolerance) => (Some(tolerance), None),
                Accuracy::Step(step) => (None, Some(step)),
            };
            let point = Point { integrator: integrator.to_owned(), tolerance, step, variant: variant.clone(), scene: index };
            self.points.push(point);
        }
    }
}

/// Every variant with every value of `list` set; an empty list leaves them as they are.
fn each<T: Clone>(variants: &mut Vec<Variant>, list: &[T], set: impl Fn(&mut Variant, T)) {
    if list.is_empty() {
        return;
    }
    let with = |variant: &Variant, value: &T| {
        let mut changed = variant.clone();
        set(&mut changed, value.clone());
        changed
    };
    *variants = variants.iter().flat_map(|v| list.iter().map(move |value| (v, value))).map(|(v, value)| with(v, value)).collect();
}

fn descending(list: &[f64]) -> Vec<f64> {
    let mut sorted = list.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    sorted
}

/// Steps of rk4 from half the stable step, or from an output interval, halved five times.
fn default_steps(scene: &Scene, duration: f64) -> Vec<f64> {
    let rk4 = Method::RungeKutta4 { step: 1.0 };
    let stable = fastest_mode(&scene.system).map_or(f64::INFINITY, |m| rk4.stable_step(m.frequency_hz, m.damping_ratio));
    let largest = (STABLE_SHARE * stable).min(1.0 / scene.rate_hz).min(duration / FEWEST_STEPS);
    (0..STEPS).map(|i| largest / f64::from(1 << i)).collect()
}

/// Fewest steps that stability, or the fixed step, allows an integrator.
pub(super) fn least_steps(scene: &Scene, integrator: &str, accuracy: Accuracy, duration: f64) -> f64 {
    let step = match scene.method_at(integrator, accuracy) {
        Some(Method::RungeKutta4 { step }) => step,
        Some(method) => fastest_mode(&scene.system).map_or(f64::INFINITY, |m| method.stable_step(m.frequency_hz, m.damping_ratio)),
        None => f64::INFINITY,
    };
    duration / step
}

fn check(base: &Scene, request: &Request) -> Result<(), RequestError> {
    let fault = |option, message: String| Err(RequestError::List { option, message });
    let known = INTEGRATORS.map(|i| i.0);
    if let Some(name) = request.integrators.iter().find(|n| !known.contains(&n.as_str())) {
        return fault("--integrators", format!("\"{name}\" is not an integrator; known: {}", known.join(", ")));
    }
    if let Some(x) = request.tolerances.iter().find(|x| !(**x >= TIGHTEST && **x < 1.0)) {
        return fault("--tolerances", format!("{x} must lie between {TIGHTEST:e} and 1"));
    }
    if let Some(x) = request.steps.iter().find(|x| !(**x > 0.0 && x.is_finite())) {
        return fault("--steps", format!("{x} s must be positive"));
    }
    if !request.steps.is_empty() && !request.integrators.is_empty() && !request.integrators.iter().any(|n| n == "rk4") {
        return fault("--steps", "steps belong to rk4, which --integrators leaves out; add it or drop --steps".into());
    }
    if !request.tolerances.is_empty() && request.integrators.iter().all(|n| n == "rk4") && !request.integrators.is_empty() {
        return fault("--tolerances", "rk4 takes fixed steps; give --steps, or add another integrator".into());
    }
    if let Some(x) = request.orders.iter().find(|x| **x > 2) {
        return fault("--orders", format!("{x} must be 0, 1 or 2"));
    }
    let flexible = base.system.bodies.iter().any(|b| b.flexible().is_some());
    let of_modes = [
        ("--modes", !request.modes.is_empty()),
        ("--residual-modes", !request.residual_modes.is_empty()),
        ("--geometric-stiffness", !request.geometric_stiffness.is_empty()),
        ("--orders", !request.orders.is_empty()),
    ];
    for (option, given) in of_modes {
        if given && !flexible {
            return fault(option, "the scene has no flexible body; leave it out".into());
        }
    }
    if let Some(method) = request.closure_methods.iter().find(|m| !ClosureMethod::is_known(m)) {
        return fault("--closure-method", format!("\"{method}\" is not a closure method; known: {}", ClosureMethod::NAMES.join(", ")));
    }
    if !request.closure_methods.is_empty() && base.system.closures.is_empty() {
        return fault("--closure-method", "the scene has no closures; leave it out".into());
    }
    twice("--integrators", &request.integrators)?;
    twice("--tolerances", &request.tolerances)?;
    twice("--steps", &request.steps)?;
    twice("--modes", &request.modes)?;
    twice("--residual-modes", &request.residual_modes)?;
    twice("--geometric-stiffness", &request.geometric_stiffness)?;
    twice("--orders", &request.orders)?;
    twice("--closure-method", &request.closure_methods)
}

/// Refuses a number of modes that no modal file has: two such numbers would stand for the same system.
fn check_modes(source: &Source, request: &Request) -> Result<(), RequestError> {
    if request.modes.is_empty() {
        return Ok(());
    }
    let full = Variant { modes: Some(usize::MAX), ..Variant::default() };
    // a scene whose lists do not hold for all modes is not at fault here
    let Ok(scene) = full.assemble(source, request.duration) else { return Ok(()) };
    let most = scene.system.bodies.iter().filter_map(|b| b.flexible()).map(crate::model::FlexibleBody::mode_count).max().unwrap_or(0);
    match request.modes.iter().find(|n| **n > most) {
        None => Ok(()),
        Some(n) => Err(RequestError::List {
            option: "--modes",
            message: format!("{n}, but no modal file of the scene has more than {most} modes"),
        }),
    }
}

fn twice<T: PartialEq + std::fmt::Display>(option: &'static str, list: &[T]) -> Result<(), RequestError> {
    match list.iter().enumerate().find(|(i, x)| list[..*i].contains(x)) {
        None => Ok(()),
        Some((_, x)) => Err(RequestError::List { option, message: format!("{x} is named twice; name it once") }),
    }
}
