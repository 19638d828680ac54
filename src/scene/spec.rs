//! The scene file as serde reads it: one struct per table, one field per key, nothing interpreted.

use super::import_spec::ImportSpec;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt::{self, Formatter};
use std::path::PathBuf;

/// One number, or one per coordinate.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "a number or a list of numbers")]
pub enum Numbers {
    /// The same for all.
    One(f64),
    /// One each.
    Many(Vec<f64>),
}

impl Numbers {
    /// As a list.
    #[must_use]
    pub fn list(&self) -> Vec<f64> {
        match self {
            Self::One(x) => vec![*x],
            Self::Many(x) => x.clone(),
        }
    }
}

/// Rows of a table function, or the CSV file that holds them (time in the first column).
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "rows [[time, value], ...] or the path of a CSV file")]
pub enum TableSpec {
    /// `[[t, x], ...]`
    Rows(Vec<(f64, Numbers)>),
    /// `"file.csv"`
    File(PathBuf),
}

/// `sine = { amplitude, frequency_hz, phase }`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SineSpec {
    /// One per component.
    pub amplitude: Numbers,
    /// Hz.
    pub frequency_hz: f64,
    /// rad.
    #[serde(default)]
    pub phase: f64,
}

/// `smooth_step = { from, to, start, end }`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SmoothStepSpec {
    /// Value before.
    pub from: Numbers,
    /// Value after.
    pub to: Numbers,
    /// s.
    pub start: f64,
    /// s.
    pub end: f64,
}

/// A time function: exactly one of the keys.
#[derive(Debug, Clone, Default)]
pub struct FunctionSpec {
    /// Same value at all times.
    pub constant: Option<Numbers>,
    /// Values at times.
    pub table: Option<TableSpec>,
    /// Harmonic.
    pub sine: Option<SineSpec>,
    /// Twice differentiable step.
    pub smooth_step: Option<SmoothStepSpec>,
    /// Sum of functions.
    pub sum: Option<Vec<FunctionSpec>>,
}

/// Only a table of keys is one: a number, or a list, is met with what to write instead.
impl<'de> Deserialize<'de> for FunctionSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Keys;
        impl<'de> Visitor<'de> for Keys {
            type Value = FunctionSpec;

            fn expecting(&self, out: &mut Formatter<'_>) -> fmt::Result {
                out.write_str("a time function, as { constant = 0.5 } or { constant = [0.0, 0.0, 1.0] } (or table, sine, smooth_step, sum)")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<FunctionSpec, A::Error> {
                const KEYS: &[&str] = &["constant", "table", "sine", "smooth_step", "sum"];
                let mut spec = FunctionSpec::default();
                while let Some(key) = map.next_key::<String>()? {
                    match key.as_str() {
                        "constant" => spec.constant = Some(map.next_value()?),
                        "table" => spec.table = Some(map.next_value()?),
                        "sine" => spec.sine = Some(map.next_value()?),
                        "smooth_step" => spec.smooth_step = Some(map.next_value()?),
                        "sum" => spec.sum = Some(map.next_value()?),
                        other => return Err(A::Error::unknown_field(other, KEYS)),
                    }
                }
                Ok(spec)
            }
        }
        deserializer.deserialize_any(Keys)
    }
}

/// A frame.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameSpec {
    /// m.
    #[serde(default)]
    pub position: [f64; 3],
    /// `[w, x, y, z]`
    #[serde(default = "identity")]
    pub quaternion: [f64; 4],
}

const fn identity() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

impl Default for FrameSpec {
    fn default() -> Self {
        Self { position: [0.0; 3], quaternion: identity() }
    }
}

/// Which modes of a file to retain.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "a list of 1-based mode numbers, { count = N } or { max_frequency_hz = F }")]
pub enum ModesSpec {
    /// 1-based numbers.
    List(Vec<usize>),
    /// A rule.
    Rule(ModesRule),
}

/// A rule for the retained modes: exactly one of the keys.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModesRule {
    /// The lowest N.
    pub count: Option<usize>,
    /// All up to this frequency.
    pub max_frequency_hz: Option<f64>,
}

/// `[[body]]`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodySpec {
    /// Unique.
    pub name: String,
    /// kg.
    pub mass: Option<f64>,
    /// m, body axes.
    pub center_of_mass: Option<[f64; 3]>,
    /// kg m^2 about the centre of mass, body axes.
    pub inertia: Option<[[f64; 3]; 3]>,
    /// Edge lengths of the box that the viewer shows (m); from the inertia if none.
    #[serde(rename = "box")]
    pub box_size: Option<[f64; 3]>,
    /// Modal file, relative to the scene.
    pub modal_file: Option<PathBuf>,
    /// File of another code that is imported when the scene is loaded, in place of a modal file.
    pub import: Option<ImportSpec>,
    /// Retained modes; all if none.
    pub modes: Option<ModesSpec>,
    /// Add residual modes that answer loads for the modes left out; not if none.
    pub residual_modes: Option<bool>,
    /// Overrides the file.
    pub damping_ratio: Option<Numbers>,
    /// 0, 1 or 2.
    pub inertia_order: Option<u8>,
    /// Use the geometric stiffness of the modal file; not if none.
    pub geometric_stiffness: Option<bool>,
    /// Initial modal coordinates.
    #[serde(default)]
    pub modal_position: Vec<f64>,
    /// Initial modal rates.
    #[serde(default)]
    pub modal_velocity: Vec<f64>,
}

impl BodySpec {
    /// True if the body has modes, from a modal file or a file to import.
    #[must_use]
    pub fn is_flexible(&self) -> bool {
        self.modal_file.is_some() || self.import.is_some()
    }
}

/// `[[hinge]]`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HingeSpec {
    /// Unique.
    pub name: String,
    /// Kind.
    pub kind: String,
    /// One axis, in O+ axes.
    pub axis: Option<[f64; 3]>,
    /// Several axes, in O+ axes.
    pub axes: Option<Vec<[f64; 3]>>,
    /// m/rad.
    pub pitch: Option<f64>,
    /// Body or "world".
    pub parent: String,
    /// Interface of a flexible parent.
    pub parent_node: Option<String>,
    /// O+ on the parent.
    #[serde(default)]
    pub parent_frame: FrameSpec,
    /// Body.
    pub child: String,
    /// Interface of a flexible child.
    pub child_node: Option<String>,
    /// O on the child.
    #[serde(default)]
    pub child_frame: FrameSpec,
    /// Initial coordinates.
    #[serde(default)]
    pub position: Vec<f64>,
    /// Initial rates.
    #[serde(default)]
    pub velocity: Vec<f64>,
    /// Springs.
    pub stiffness: Option<Numbers>,
    /// Dampers.
    pub damping: Option<Numbers>,
    /// Rest displacements.
    pub rest: Option<Numbers>,
    /// Motor.
    pub torque: Option<FunctionSpec>,
    /// Prescribed motion.
    pub motion: Option<FunctionSpec>,
    /// Keep position and velocity as given when closures are assembled.
    #[serde(default)]
    pub held: bool,
}

/// `[[closure]]`: two frames and a kind, or `kind = "gear"` with two hinges and a ratio.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosureSpec {
    /// Unique.
    pub name: String,
    /// Kind.
    pub kind: String,
    /// One axis, in the axes of frame a.
    pub axis: Option<[f64; 3]>,
    /// Several axes, in the axes of frame a.
    pub axes: Option<Vec<[f64; 3]>>,
    /// Body or "world".
    pub body_a: Option<String>,
    /// Interface of a flexible body a.
    pub node_a: Option<String>,
    /// Frame on a.
    pub frame_a: Option<FrameSpec>,
    /// Body or "world".
    pub body_b: Option<String>,
    /// Interface of a flexible body b.
    pub node_b: Option<String>,
    /// Frame on b.
    pub frame_b: Option<FrameSpec>,
    /// Driving hinge of a gear.
    pub hinge_a: Option<String>,
    /// 1-based coordinate of it.
    pub coordinate_a: Option<usize>,
    /// Driven hinge of a gear.
    pub hinge_b: Option<String>,
    /// 1-based coordinate of it.
    pub coordinate_b: Option<usize>,
    /// `theta_b = ratio * theta_a + offset`
    pub ratio: Option<f64>,
    /// theta_b at theta_a = 0.
    pub offset: Option<f64>,
    /// "auto", "tree_augmented" or "constraint_embedding".
    pub method: Option<String>,
}

/// `[[load]]`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSpec {
    /// Loaded body.
    pub body: String,
    /// Interface.
    pub node: Option<String>,
    /// 0-based mesh node.
    pub mesh_node: Option<usize>,
    /// Point of a rigid body (m).
    pub point: Option<[f64; 3]>,
    /// N.
    pub force: Option<FunctionSpec>,
    /// N m.
    pub moment: Option<FunctionSpec>,
    /// "world" or "body".
    #[serde(default = "world")]
    pub axes: String,
}

fn world() -> String {
    "world".into()
}

/// `[[monitor]]`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MonitorSpec {
    /// Hinge to watch.
    pub hinge: Option<String>,
    /// Closure to watch.
    pub closure: Option<String>,
    /// Body to watch.
    pub body: Option<String>,
    /// Largest moment magnitude (N m).
    pub moment_limit: Option<f64>,
    /// Largest force magnitude (N).
    pub force_limit: Option<f64>,
    /// Largest von Mises stress (Pa).
    pub stress_limit: Option<f64>,
}

/// `[simulation]`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulationSpec {
    /// s.
    pub duration: Option<f64>,
    /// Name of the integrator.
    pub integrator: Option<String>,
    /// Of the local error.
    #[serde(default = "relative_tolerance")]
    pub relative_tolerance: f64,
    /// Of the local error, in the coordinates' units.
    #[serde(default = "absolute_tolerance")]
    pub absolute_tolerance: f64,
    /// Fixed step (s).
    pub step: Option<f64>,
    /// Largest step of an error-controlled integrator (s).
    pub largest_step: Option<f64>,
}

const fn relative_tolerance() -> f64 {
    1e-6
}

const fn absolute_tolerance() -> f64 {
    1e-9
}

impl Default for SimulationSpec {
    fn default() -> Self {
        Self {
            duration: None,
            integrator: None,
            relative_tolerance: relative_tolerance(),
            absolute_tolerance: absolute_tolerance(),
            step: None,
            largest_step: None,
        }
    }
}

/// `[output]`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSpec {
    /// Output times per second.
    #[serde(default = "rate_hz")]
    pub rate_hz: f64,
    /// Hinges whose loads are output; all if none.
    pub hinges: Option<Vec<String>>,
    /// Closures whose loads are output; all if none.
    pub closures: Option<Vec<String>>,
    /// Bodies whose stress is evaluated; all that have stress modes if none.
    pub stress: Option<Vec<String>>,
    /// Whether every output time is audited by the Newton-Euler sweep.
    #[serde(default = "yes")]
    pub audit: bool,
    /// Whether the effect of modes that are left out is estimated.
    #[serde(default = "yes")]
    pub truncation: bool,
}

const fn rate_hz() -> f64 {
    60.0
}

const fn yes() -> bool {
    true
}

impl Default for OutputSpec {
    fn default() -> Self {
        Self { rate_hz: rate_hz(), hinges: None, closures: None, stress: None, audit: true, truncation: true }
    }
}

/// `[viewer]`
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewerSpec {
    /// Factor on deformations in the picture.
    #[serde(default = "one")]
    pub deformation_scale: f64,
}

const fn one() -> f64 {
    1.0
}

impl Default for ViewerSpec {
    fn default() -> Self {
        Self { deformation_scale: one() }
    }
}

/// The whole file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// Title.
    pub name: Option<String>,
    /// m/s^2.
    #[serde(default)]
    pub gravity: [f64; 3],
    /// Bodies.
    #[serde(default)]
    pub body: Vec<BodySpec>,
    /// Hinges.
    #[serde(default)]
    pub hinge: Vec<HingeSpec>,
    /// Loops.
    #[serde(default)]
    pub closure: Vec<ClosureSpec>,
    /// External loads.
    #[serde(default)]
    pub load: Vec<LoadSpec>,
    /// Limits.
    #[serde(default)]
    pub monitor: Vec<MonitorSpec>,
    /// Time.
    #[serde(default)]
    pub simulation: SimulationSpec,
    /// What is written.
    #[serde(default)]
    pub output: OutputSpec,
    /// What is shown.
    #[serde(default)]
    pub viewer: ViewerSpec,
}
