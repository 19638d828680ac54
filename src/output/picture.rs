//! What pictures need besides the data: boxes of rigid bodies, the extent and aspect of the scene, and one output time as a small message.
//! Nothing here knows of a viewer.

use super::channels::{closure_side, load_frame, load_side, residual_unit};
use super::closure_load::{ClosureLoad, ClosureRecord};
use super::frame::OutputFrame;
use super::load_pose::{closure_pose, hinge_pose};
use super::plan::{BodyBox, OutputPlan};
use super::tracker::Event;
use crate::dynamics::Workspace;
use crate::dynamics::sweep::pose_outward::pose_outward;
use crate::dynamics::world::{WorldFrame, world_frames};
use crate::integrate::Sample;
use crate::model::Surface;
use crate::model::{Body, BodyKind, HingeKind, State, System};
use crate::scene::closures::gear_unit;
use crate::spatial::rotation::quaternion_of_matrix;
use crate::spatial::shift::{angular, linear};
use nalgebra::{Matrix3, SymmetricEigen, Vector3, Vector6};
use std::ops::Range;
use std::sync::Arc;

/// How far the eye is, in radii of the scene and lengths of its direction: close enough to fill a view of 4 to 3.
const DISTANCE: f64 = 1.1;

/// A box on a body, in axes of its frame B.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxShape {
    /// m.
    pub center: [f32; 3],
    /// m.
    pub half_size: [f32; 3],
    /// `[w, x, y, z]`.
    pub quaternion: [f64; 4],
}

/// A body as pictures show it.
#[derive(Debug, Clone)]
pub struct BodyPicture {
    /// Name of the body.
    pub name: String,
    /// Of a rigid body.
    pub shape: Option<BoxShape>,
    /// Of a flexible body, if the plan has its surface.
    pub surface: Option<SurfacePicture>,
    /// Modal coordinates in the state.
    pub modes: Range<usize>,
    /// Names of the modes, with frequencies.
    pub mode_names: Vec<String>,
}

/// A surface as pictures show it.
#[derive(Debug, Clone)]
pub struct SurfacePicture {
    /// Mesh and shapes.
    pub surface: Arc<Surface>,
    /// True if coloured by stress.
    pub stress: bool,
    /// Pa.
    pub stress_limit: Option<f64>,
}

/// A hinge whose load pictures show.
#[derive(Debug, Clone, PartialEq)]
pub struct HingePicture {
    /// Name of the hinge.
    pub name: String,
    /// Index of the body it carries.
    pub body: usize,
    /// Who acts on whom.
    pub side: String,
    /// Axes of the components.
    pub frame: String,
    /// N m.
    pub moment_limit: Option<f64>,
    /// N.
    pub force_limit: Option<f64>,
    /// False for a free hinge on which nothing acts: its load is zero by definition and needs no plot.
    pub carries: bool,
}

/// A closure whose load pictures show.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosurePicture {
    /// Name of the closure.
    pub name: String,
    /// Who acts on whom.
    pub side: String,
    /// Of a gear: the unit of what it exerts on coordinate b.
    pub gear_unit: Option<&'static str>,
    /// Unit of the residual.
    pub residual_unit: &'static str,
    /// N m.
    pub moment_limit: Option<f64>,
    /// N.
    pub force_limit: Option<f64>,
}

impl ClosurePicture {
    /// Limit of what a gear exerts: only the one in its unit can be given.
    #[must_use]
    pub fn gear_limit(&self) -> Option<f64> {
        self.moment_limit.or(self.force_limit)
    }
}

/// All that stays the same over a run.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Name of the scene.
    pub scene: String,
    /// In the order of the system.
    pub bodies: Vec<BodyPicture>,
    /// In the order of the plan's loaded hinges.
    pub hinges: Vec<HingePicture>,
    /// In the order of the plan's loaded closures.
    pub closures: Vec<ClosurePicture>,
    /// Factor on the deformation.
    pub deformation_scale: f64,
    /// Centre (m, inertial axes) of everything at the start.
    pub center: [f64; 3],
    /// Radius (m) around it.
    pub radius: f64,
    /// Where to look at the centre from: away from the longest horizontal edge, so that it is seen at full length (m, inertial axes).
    pub eye: [f64; 3],
}

impl Picture {
    /// The picture of `plan`, framed at `start`.
    #[must_use]
    pub fn new(system: &System, plan: &OutputPlan, start: &State) -> Self {
        let bodies: Vec<_> = system.bodies.iter().enumerate().map(|(k, body)| body_picture(plan, k, body)).collect();
        let hinge = |body: usize| {
            let (moment_limit, force_limit) = plan.hinge_limits(body);
            let owner = &system.bodies[body];
            let (side, frame) = (load_side(system, owner), load_frame(owner));
            let hinge = &owner.hinge;
            let carries =
                hinge.kind != HingeKind::Free || hinge.torque.is_some() || !hinge.stiffness.is_empty() || !hinge.damping.is_empty();
            HingePicture { name: hinge.name.clone(), body, side, frame, moment_limit, force_limit, carries }
        };
        let closure = |index: usize| {
            let (moment_limit, force_limit) = plan.closure_limits(index);
            let closure = &system.closures[index];
            ClosurePicture {
                name: closure.name.clone(),
                side: closure_side(system, closure),
                gear_unit: gear_unit(system, closure),
                residual_unit: residual_unit(system, closure),
                moment_limit,
                force_limit,
            }
        };
        let (low, high) = extent(system, &bodies, start);
        let (center, radius) = ((low + high) * 0.5, (0.5 * (high - low).norm()).max(1e-3));
        let edge = high - low;
        let away = if edge.y > edge.x { Vector3::new(1.05, -0.8, 0.7) } else { Vector3::new(0.8, -1.05, 0.7) };
        Self {
            scene: plan.scene_name.clone(),
            hinges: plan.loaded_hinges().into_iter().map(hinge).collect(),
            closures: plan.loaded_closures().into_iter().map(closure).collect(),
            bodies,
            deformation_scale: plan.deformation_scale,
            center: center.into(),
            radius,
            eye: (center + away * (DISTANCE * radius)).into(),
        }
    }
}

impl Picture {
    /// Memory (bytes) of a snapshot without events.
    #[must_use]
    pub fn snapshot_bytes(&self) -> usize {
        let modes = self.bodies.last().map_or(0, |b| b.modes.end);
        size_of::<Snapshot>()
            + self.bodies.len() * size_of::<([f64; 3], [f64; 4])>()
            + self.hinges.len() * size_of::<LoadSnapshot>()
            + self.closures.len() * size_of::<ClosureSnapshot>()
            + modes * size_of::<f64>()
    }
}

fn body_picture(plan: &OutputPlan, k: usize, body: &Body) -> BodyPicture {
    let shape = match &body.kind {
        BodyKind::Flexible(_) => None,
        BodyKind::Rigid(_) => plan.boxes.iter().find(|b| b.body == k).map(explicit_box).or_else(|| equivalent_box(body)),
    };
    let surface = plan.surfaces.iter().find(|s| s.body == k).map(|s| SurfacePicture {
        surface: Arc::clone(&s.surface),
        stress: s.stress,
        stress_limit: plan.stress_limit(k),
    });
    let mode_names = body.flexible().map_or_else(Vec::new, |flexible| {
        let frequency = flexible.stiffness.iter().map(|k| k.max(0.0).sqrt() / std::f64::consts::TAU);
        flexible.mode_names.iter().zip(frequency).map(|(n, f)| format!("{n}, {f:.3} Hz ({})", super::channels::MODAL_UNIT)).collect()
    });
    BodyPicture { name: body.name.clone(), shape, surface, modes: body.modal_range(), mode_names }
}

fn explicit_box(size: &BodyBox) -> BoxShape {
    let half_size = size.size.map(|x| (0.5 * x) as f32);
    BoxShape { center: size.center.map(|x| x as f32), half_size, quaternion: [1.0, 0.0, 0.0, 0.0] }
}

/// The homogeneous cuboid of the same mass and inertia; none for a body without mass. Edges below 2 % of the longest are drawn as that.
fn equivalent_box(body: &Body) -> Option<BoxShape> {
    let BodyKind::Rigid(inertia) = &body.kind else { return None };
    let mass = inertia.translational[(0, 0)];
    if mass <= 0.0 {
        return None;
    }
    let c = inertia.first_moment() / mass;
    let about_center = inertia.rotational - (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * mass;
    // to the axes of B, so that a body with principal axes there gets a box along them
    let to_b = body.frame_rotation.transpose();
    let eigen = SymmetricEigen::new(to_b * about_center * body.frame_rotation);
    let (mut axes, moments) = (eigen.eigenvectors, eigen.eigenvalues);
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let edges = moments.map(|moment| (6.0 * (moments.sum() - 2.0 * moment) / mass).max(0.0).sqrt());
    let smallest = (0.02 * edges.max()).max(1e-3);
    let center = to_b * (c - body.frame_position);
    Some(BoxShape {
        center: [center.x as f32, center.y as f32, center.z as f32],
        half_size: [0, 1, 2].map(|i| (0.5 * edges[i].max(smallest)) as f32),
        quaternion: quaternion_of_matrix(&axes),
    })
}

/// Lowest and highest corner (m, inertial axes) of all surfaces, boxes and body frames.
fn extent(system: &System, bodies: &[BodyPicture], start: &State) -> (Vector3<f64>, Vector3<f64>) {
    let mut workspace = Workspace::new(system);
    let mut frames = vec![WorldFrame::default(); system.bodies.len()];
    pose_outward(system, start, &mut workspace.pose);
    world_frames(system, &workspace.pose, &mut frames);
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for (k, (body, picture)) in system.bodies.iter().zip(bodies).enumerate() {
        let frame = frames[k].body_frame(body);
        let mut take = |x: Vector3<f64>| {
            let x = frame.position + frame.rotation * x;
            (low, high) = (low.inf(&x), high.sup(&x));
        };
        take(Vector3::zeros());
        if let Some(shape) = &picture.shape {
            let rotation = crate::spatial::rotation::matrix_of_quaternion(&shape.quaternion);
            let (center, half) = (Vector3::from(shape.center.map(f64::from)), shape.half_size.map(f64::from));
            for corner in 0..8 {
                let side = |i: usize| if corner >> i & 1 == 0 { half[i] } else { -half[i] };
                take(center + rotation * Vector3::new(side(0), side(1), side(2)));
            }
        }
        picture.surface.iter().flat_map(|s| &s.surface.points).for_each(|point| take(Vector3::from(*point)));
    }
    if (high - low).norm().is_finite() { (low, high) } else { (Vector3::repeat(-1.0), Vector3::repeat(1.0)) }
}

/// A load in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadSnapshot {
    /// O, or b's point of a closure, in inertial axes (m).
    pub point: [f64; 3],
    /// Inertial axes (N m).
    pub moment_world: [f64; 3],
    /// Inertial axes (N).
    pub force_world: [f64; 3],
    /// (moment; force) in O axes, or in the axes of frame a of a closure.
    pub load: Vector6<f64>,
}

/// A closure in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosureSnapshot {
    /// Of a joint between frames: its load on b.
    pub joint: Option<LoadSnapshot>,
    /// Of a gear: what it exerts on coordinate b (N m or N).
    pub gear: Option<f64>,
    /// m or rad.
    pub residual: f64,
}

/// One output time, small enough to be handed to another thread.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Snapshot {
    /// s.
    pub time: f64,
    /// Position (m) and quaternion of every body frame B in inertial axes.
    pub poses: Vec<([f64; 3], [f64; 4])>,
    /// Loads at the picture's hinges.
    pub loads: Vec<LoadSnapshot>,
    /// The picture's closures.
    pub closures: Vec<ClosureSnapshot>,
    /// Modal coordinates of all bodies.
    pub modal_position: Vec<f64>,
    /// What became known.
    pub events: Vec<(bool, String)>,
}

impl Snapshot {
    /// The snapshot of `sample` for hinges, by the bodies that they carry, and closures.
    #[must_use]
    pub fn of(hinges: &[usize], closures: &[usize], sample: &Sample<'_>, frame: &OutputFrame, events: &[Event]) -> Self {
        let Sample { system, state, .. } = *sample;
        let pose = |(body, frame): (&Body, &WorldFrame)| {
            let frame = frame.body_frame(body);
            (frame.position.into(), quaternion_of_matrix(&frame.rotation))
        };
        let load = |(&k, load): (&usize, &Vector6<f64>)| load_snapshot(&hinge_pose(sample, k, &frame.frames), load);
        Self {
            time: state.time,
            poses: system.bodies.iter().zip(&frame.frames).map(pose).collect(),
            loads: hinges.iter().zip(&frame.loads).map(load).collect(),
            closures: closures.iter().zip(&frame.closures).map(|(&i, record)| closure_snapshot(i, record, sample, &frame.frames)).collect(),
            modal_position: state.modal_position.clone(),
            events: events.iter().map(|e| (matches!(e, Event::Exceeded(_)), e.text())).collect(),
        }
    }
}

fn load_snapshot(at: &WorldFrame, load: &Vector6<f64>) -> LoadSnapshot {
    let turned = |x: Vector3<f64>| (at.rotation * x).into();
    LoadSnapshot { point: at.position.into(), moment_world: turned(angular(load)), force_world: turned(linear(load)), load: *load }
}

fn closure_snapshot(index: usize, record: &ClosureRecord, sample: &Sample<'_>, frames: &[WorldFrame]) -> ClosureSnapshot {
    let joint = match (&record.load, closure_pose(sample, index, frames)) {
        (ClosureLoad::Joint(load), Some(at)) => Some(load_snapshot(&at, load)),
        _ => None,
    };
    ClosureSnapshot { joint, gear: record.load.coordinate_force(), residual: record.residual }
}
