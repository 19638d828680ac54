//! What a run is asked to put out. Everything not named here is not evaluated.

pub use crate::scene::Monitor;

use crate::model::left_out::LeftOutModes;
use crate::model::surface::StressModes;
use crate::model::{Surface, System};
use nalgebra::DMatrix;
use std::sync::Arc;
use thiserror::Error;

/// A modal file that a scene uses, as the results file keeps it.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalFileRecord {
    /// Name of the body.
    pub body: String,
    /// Path as the scene gives it.
    pub path: String,
    /// Digest of the file's data, lower-case hexadecimal.
    pub content_sha256: String,
    /// Residual modes over all modes of the file, one column each; none without.
    pub residual_modes: Option<DMatrix<f64>>,
}

/// The surface of a flexible body.
#[derive(Debug, Clone)]
pub struct BodySurface {
    /// Index of the body.
    pub body: usize,
    /// Mesh with one shape per retained mode; share it between bodies of one file and one choice of modes.
    pub surface: Arc<Surface>,
    /// True if stress is evaluated at every output time.
    pub stress: bool,
}

/// The box that stands for a rigid body in pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyBox {
    /// Index of the body.
    pub body: usize,
    /// Edge lengths along the body axes (m).
    pub size: [f64; 3],
    /// Centre in body axes (m).
    pub center: [f64; 3],
}

/// Modes that a scene leaves out.
#[derive(Debug, Clone)]
pub struct TruncationPlan {
    /// The system with all modes beside them.
    pub modes: Arc<LeftOutModes>,
    /// For each surface of the plan whose stress is evaluated and whose body leaves modes out: the stress of those, and the body's place
    /// among those that leave modes out.
    pub stress: Vec<Option<(Arc<StressModes>, usize)>>,
}

/// Everything that a run puts out.
#[derive(Debug, Clone)]
pub struct OutputPlan {
    /// Name of the scene.
    pub scene_name: String,
    /// Text of the scene file, kept in the results file.
    pub scene_text: String,
    /// Modal files of the scene.
    pub modal_files: Vec<ModalFileRecord>,
    /// Bodies at whose inboard hinge the load is an output, in the order of the outputs.
    pub hinges: Vec<usize>,
    /// Closures whose load is an output, in the order of the outputs.
    pub closures: Vec<usize>,
    /// Flexible bodies that are drawn or searched for stress.
    pub surfaces: Vec<BodySurface>,
    /// Boxes of rigid bodies; a rigid body without one is drawn as the cuboid of equal mass and inertia.
    pub boxes: Vec<BodyBox>,
    /// Limits.
    pub monitors: Vec<Monitor>,
    /// Factor on the deformation in pictures; never on numbers.
    pub deformation_scale: f64,
    /// Modes that the scene leaves out, whose effect is estimated; none if none are or nobody asks.
    pub truncation: Option<TruncationPlan>,
    /// True if an independent Newton-Euler sweep checks the loads at every output time.
    pub audit: bool,
    /// What is known to be worth a warning before the run.
    pub warnings: Vec<String>,
}

impl Default for OutputPlan {
    fn default() -> Self {
        Self {
            scene_name: String::new(),
            scene_text: String::new(),
            modal_files: Vec::new(),
            hinges: Vec::new(),
            closures: Vec::new(),
            surfaces: Vec::new(),
            boxes: Vec::new(),
            monitors: Vec::new(),
            deformation_scale: 1.0,
            truncation: None,
            audit: false,
            warnings: Vec::new(),
        }
    }
}

/// Why a plan does not fit its system.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum PlanError {
    /// An index without a body.
    #[error("output of body {body}, but the system has {count} bodies; name a body or hinge of the scene")]
    NoBody {
        /// Index asked for.
        body: usize,
        /// Number of bodies.
        count: usize,
    },
    /// An index without a closure.
    #[error("output of closure {closure}, but the system has {count} closures; name a closure of the scene")]
    NoClosure {
        /// Index asked for.
        closure: usize,
        /// Number of closures.
        count: usize,
    },
    /// A surface that does not fit its body.
    #[error(
        "surface of body \"{body}\" with {found} modes, but the body retains {expected}; read the surface with the same choice of modes"
    )]
    Modes {
        /// Name of the body.
        body: String,
        /// Shapes of the surface.
        found: usize,
        /// Retained modes.
        expected: usize,
    },
    /// Stress of a body without stress modes.
    #[error("stress of body \"{body}\" is asked for, but {reason}; drop the stress monitor or write the modal file with stress modes")]
    NoStress {
        /// Name of the body.
        body: String,
        /// What is missing.
        reason: &'static str,
    },
    /// A limit or scale that is no positive number.
    #[error("{what} is {value}; give a positive number")]
    NotPositive {
        /// What it limits.
        what: String,
        /// The value found.
        value: f64,
    },
}

impl OutputPlan {
    /// Holds the plan against `system`.
    ///
    /// # Errors
    /// [`PlanError`] with the first thing that does not fit.
    pub fn check(&self, system: &System) -> Result<(), PlanError> {
        let count = system.bodies.len();
        let name = |body: usize| system.bodies.get(body).map(|b| b.name.clone()).ok_or(PlanError::NoBody { body, count });
        let positive = |what: String, value: Option<f64>| match value {
            Some(value) if !(value > 0.0 && value.is_finite()) => Err(PlanError::NotPositive { what, value }),
            _ => Ok(()),
        };
        positive("deformation_scale".into(), Some(self.deformation_scale))?;
        for &body in self.hinges.iter().chain(self.boxes.iter().map(|b| &b.body)) {
            name(body)?;
        }
        let closure_name = |closure: usize| {
            let count = system.closures.len();
            system.closures.get(closure).map(|c| c.name.as_str()).ok_or(PlanError::NoClosure { closure, count })
        };
        for &closure in &self.closures {
            closure_name(closure)?;
        }
        for surface in &self.surfaces {
            let (body, expected) = (name(surface.body)?, system.bodies[surface.body].mode_count());
            let found = surface.surface.displacement.len();
            if found != expected {
                return Err(PlanError::Modes { body, found, expected });
            }
            if surface.stress && surface.surface.stress.is_none() {
                return Err(PlanError::NoStress { body, reason: "its modal file has no stress modes" });
            }
        }
        for monitor in &self.monitors {
            match *monitor {
                Monitor::Hinge { body, moment_limit, force_limit } => {
                    name(body)?;
                    let hinge = &system.bodies[body].hinge.name;
                    positive(format!("the moment limit of hinge \"{hinge}\""), moment_limit)?;
                    positive(format!("the force limit of hinge \"{hinge}\""), force_limit)?;
                }
                Monitor::Closure { closure, moment_limit, force_limit } => {
                    let name = closure_name(closure)?;
                    positive(format!("the moment limit of closure \"{name}\""), moment_limit)?;
                    positive(format!("the force limit of closure \"{name}\""), force_limit)?;
                }
                Monitor::Body { body, stress_limit } => {
                    let name = name(body)?;
                    positive(format!("the stress limit of body \"{name}\""), stress_limit)?;
                    if !self.surfaces.iter().any(|s| s.body == body && s.stress) {
                        return Err(PlanError::NoStress { body: name, reason: "no surface with stress is given for it" });
                    }
                }
            }
        }
        Ok(())
    }

    /// Bodies at whose hinge a load is evaluated: outputs first, then those that only a monitor asks for.
    #[must_use]
    pub fn loaded_hinges(&self) -> Vec<usize> {
        let monitored = self.monitors.iter().filter_map(|m| match *m {
            Monitor::Hinge { body, .. } => Some(body),
            Monitor::Closure { .. } | Monitor::Body { .. } => None,
        });
        each_once(self.hinges.iter().copied().chain(monitored))
    }

    /// Closures whose load is evaluated: outputs first, then those that only a monitor asks for.
    #[must_use]
    pub fn loaded_closures(&self) -> Vec<usize> {
        let monitored = self.monitors.iter().filter_map(|m| match *m {
            Monitor::Closure { closure, .. } => Some(closure),
            Monitor::Hinge { .. } | Monitor::Body { .. } => None,
        });
        each_once(self.closures.iter().copied().chain(monitored))
    }

    /// Limits of moment (N m) and force (N) at the hinge of `body`, the tightest of each.
    #[must_use]
    pub fn hinge_limits(&self, body: usize) -> (Option<f64>, Option<f64>) {
        self.tightest(|monitor| match *monitor {
            Monitor::Hinge { body: b, moment_limit, force_limit } if b == body => Some((moment_limit, force_limit)),
            _ => None,
        })
    }

    /// Limits of moment (N m) and force (N) of a closure, the tightest of each.
    #[must_use]
    pub fn closure_limits(&self, closure: usize) -> (Option<f64>, Option<f64>) {
        self.tightest(|monitor| match *monitor {
            Monitor::Closure { closure: c, moment_limit, force_limit } if c == closure => Some((moment_limit, force_limit)),
            _ => None,
        })
    }

    fn tightest(&self, limits: impl Fn(&Monitor) -> Option<(Option<f64>, Option<f64>)>) -> (Option<f64>, Option<f64>) {
        let found = self.monitors.iter().filter_map(limits);
        found.fold((None, None), |(moment, force), (m, f)| (tighter(moment, m), tighter(force, f)))
    }

    /// Limit of the stress of `body` (Pa), the tightest.
    #[must_use]
    pub fn stress_limit(&self, body: usize) -> Option<f64> {
        self.monitors.iter().fold(None, |limit, monitor| match *monitor {
            Monitor::Body { body: b, stress_limit } if b == body => tighter(limit, stress_limit),
            _ => limit,
        })
    }
}

fn each_once(indices: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut found = Vec::new();
    for index in indices {
        if !found.contains(&index) {
            found.push(index);
        }
    }
    found
}

fn tighter(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}
