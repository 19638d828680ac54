//! What of a tree stays the same, in the order and the size in which the passes want it.

use crate::dynamics::sweep::graded::GradedInertia;
use crate::model::{Body, BodyKind, HingeKind, State, System, TimeFunction};
use nalgebra::{Matrix3, Vector3};
use std::collections::HashMap;
use std::ops::RangeInclusive;

/// No index.
pub const NONE: u32 = u32::MAX;

/// Masses (kg) and inertias (kg m^2), besides none, and lengths (m), besides none, of which the inertias felt at a hinge are made.
const MASSES: RangeInclusive<f64> = 1e-60..=1e60;
const LENGTHS: RangeInclusive<f64> = 1e-12..=1e20;

/// True if products of two inertias neither vanish nor overflow: one that passes for regular is at least a rounding of the least length
/// squared, on the least mass, times the threshold of singular ones, some 1e-130.
fn bears_products(body: &Body) -> bool {
    let within = |range: &RangeInclusive<f64>, x: f64| x == 0.0 || range.contains(&x);
    let inertia = match &body.kind {
        BodyKind::Rigid(inertia) => inertia.rotational.trace(),
        BodyKind::Flexible(_) => 0.0,
    };
    let (side, masses) = (&body.parent_side, [body.mass(), inertia]);
    masses.iter().all(|&m| within(&MASSES, m)) && [side.position.norm(), side.offset.norm()].iter().all(|&l| within(&LENGTHS, l))
}

/// Geometry and inertia of a body, shared by all that are alike to the last bit.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// Columns: link axes with the hinge at zero to link axes of the parent.
    pub fixed: [f64; 9],
    /// O+ in link axes of the parent (m).
    pub offset: [f64; 3],
    /// First moment in link axes (kg m).
    pub first_moment: [f64; 3],
    /// kg.
    pub mass: f64,
    /// Rotational inertia about O in link axes (kg m^2), symmetric.
    pub inertia: [f64; 9],
    /// Link axes to O axes.
    pub turn: Matrix3<f64>,
    /// Turn (rad) and travel (m) along the third axis per unit of the coordinate of a hinge of one rate.
    pub turn_rate: f64,
    pub travel_rate: f64,
}

/// How the passes take a hinge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passage {
    /// One angle.
    Revolute,
    /// One coordinate that travels, and turns or not.
    Slide,
    /// No rate.
    Fixed,
    /// Anything else, and prescribed hinges.
    General,
}

/// One body with its hinge.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    /// Body index of the parent, [`NONE`] for the world.
    pub parent: u32,
    /// Index of its [`Shape`].
    pub shape: u32,
    /// Index in `TreeKernel::branches`, or [`NONE`].
    pub branch: u32,
    /// Rigid, without external load, joined to the body before it and to no other but the one after it: most bodies of long chains, which need
    /// none of the questions that the others are asked.
    pub is_plain: bool,
    /// What its hinge is.
    pub passage: Passage,
    /// Index in `TreeKernel::general`, [`NONE`] for the other passages.
    pub general: u32,
    /// Index in [`Layout::drives`], or [`NONE`] for a hinge with nothing but a constant force.
    pub drive: u32,
    /// Index in [`Layout::loaded`], or [`NONE`].
    pub load: u32,
    /// Index in `TreeKernel::flexible`, [`NONE`] for a rigid body.
    pub flexible: u32,
    /// Index in [`Layout::tips`] if modes of the parent move the hinge, or [`NONE`].
    pub tip: u32,
    /// First coordinate.
    pub q: u32,
    /// First rate.
    pub v: u32,
    /// Constant force on the one rate (N m or N).
    pub force: f64,
}

/// Spring, damper and motor of a hinge of one rate.
#[derive(Debug, Clone, Copy)]
pub struct Drive {
    /// N m/rad or N/m.
    pub stiffness: f64,
    /// N m s/rad or N s/m.
    pub damping: f64,
    /// Coordinate at which the spring is at rest (rad or m).
    pub rest: f64,
    /// Body whose hinge has a force that varies, or [`NONE`].
    pub motor: u32,
}

/// All of it.
#[derive(Debug, Clone)]
pub struct Layout {
    /// One per body.
    pub links: Vec<Link>,
    /// Every distinct shape.
    pub shapes: Vec<Shape>,
    /// Those of hinges that have more than a constant force.
    pub drives: Vec<Drive>,
    /// Bodies with a hinge of any other kind.
    pub general: Vec<usize>,
    /// Rigid bodies with external loads.
    pub loaded: Vec<usize>,
    /// Flexible bodies, each with the children that its modes move.
    pub flexible: Vec<(usize, Vec<usize>)>,
    /// Moved hinges: index of the parent in `flexible`, place among its children.
    pub tips: Vec<(u32, u32)>,
    /// Number of bodies with a child that does not follow them.
    pub branches: usize,
}

impl Layout {
    /// Of `system`, if it is a tree whose modes hold the inboard hinges, whose masses the plain recursion and products of them bear, and small
    /// enough for its indices.
    pub fn new(system: &System) -> Option<Self> {
        let held = system.bodies.iter().all(|b| b.flexible().is_none_or(|f| !f.inboard.moves()));
        let largest = system.position_count.max(system.velocity_count).max(system.bodies.len());
        if !held
            || !system.bodies.iter().all(bears_products)
            || !system.closures.is_empty()
            || largest >= NONE as usize
            || GradedInertia::new(system).is_some()
        {
            return None;
        }
        let mut layout = Self {
            links: Vec::with_capacity(system.bodies.len()),
            shapes: vec![],
            drives: vec![],
            general: vec![],
            loaded: vec![],
            flexible: vec![],
            tips: vec![],
            branches: 0,
        };
        let mut known: HashMap<[u64; 36], u32> = HashMap::new();
        for (k, body) in system.bodies.iter().enumerate() {
            let parent_turn = body.parent.map_or_else(Matrix3::identity, |p| layout.shapes[layout.links[p].shape as usize].turn);
            let shape = Shape::new(body, body.parent.map(|p| &system.bodies[p]), &parent_turn);
            let shape = *known.entry(shape.bits()).or_insert_with(|| {
                layout.shapes.push(shape);
                index(layout.shapes.len() - 1)
            });
            let is_rigid = body.flexible().is_none();
            let load = if is_rigid && !system.loads_of(k).is_empty() { push(&mut layout.loaded, k) } else { NONE };
            let mut link = Link {
                parent: body.parent.map_or(NONE, index),
                shape,
                branch: NONE,
                is_plain: false,
                passage: passage_of(body),
                general: NONE,
                drive: NONE,
                load,
                flexible: if is_rigid { NONE } else { push(&mut layout.flexible, (k, vec![])) },
                tip: NONE,
                q: index(body.position),
                v: index(body.velocity),
                force: 0.0,
            };
            match link.passage {
                Passage::General => link.general = push(&mut layout.general, k),
                Passage::Fixed => {}
                Passage::Revolute | Passage::Slide => {
                    let (drive, force) = drive_of(k, body);
                    link.force = force;
                    link.drive = drive.map_or(NONE, |d| push(&mut layout.drives, d));
                }
            }
            if let Some(parent) = body.parent.filter(|_| body.parent_side.moves()) {
                let at = layout.links[parent].flexible;
                let children = &mut layout.flexible[at as usize].1;
                children.push(k);
                link.tip = push(&mut layout.tips, (at, index(children.len() - 1)));
            }
            layout.links.push(link);
            if let Some(parent) = body.parent.filter(|p| p + 1 != k && !body.parent_side.moves()) {
                let slot = &mut layout.links[parent].branch;
                if *slot == NONE {
                    *slot = index(layout.branches);
                    layout.branches += 1;
                }
            }
        }
        for (k, link) in layout.links.iter_mut().enumerate() {
            let follows = k.checked_sub(1).is_some_and(|before| link.parent as usize == before);
            link.is_plain = follows && [link.branch, link.load, link.flexible, link.tip].iter().all(|&i| i == NONE);
        }
        Some(layout)
    }
}

/// Callers have made sure that it fits.
fn index(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(NONE)
}

fn push<T>(list: &mut Vec<T>, item: T) -> u32 {
    list.push(item);
    index(list.len() - 1)
}

fn passage_of(body: &Body) -> Passage {
    match &body.hinge.kind {
        _ if body.hinge.is_prescribed() => Passage::General,
        HingeKind::Fixed => Passage::Fixed,
        HingeKind::Revolute { .. } => Passage::Revolute,
        HingeKind::Prismatic { .. } | HingeKind::Screw { .. } => Passage::Slide,
        _ => Passage::General,
    }
}

/// Axis of a hinge of one rate that no function prescribes, and its turn and travel per unit of the coordinate.
fn single_axis(body: &Body) -> Option<(&Vector3<f64>, f64, f64)> {
    match &body.hinge.kind {
        _ if body.hinge.is_prescribed() => None,
        HingeKind::Revolute { axis } => Some((axis, 1.0, 0.0)),
        HingeKind::Prismatic { axis } => Some((axis, 0.0, 1.0)),
        HingeKind::Screw { axis, pitch } => Some((axis, 1.0, *pitch)),
        _ => None,
    }
}

/// What acts on the hinge of one rate of body `k`, and its constant force.
fn drive_of(k: usize, body: &Body) -> (Option<Drive>, f64) {
    let first = |list: &[f64]| list.first().copied().unwrap_or(0.0);
    let hinge = &body.hinge;
    let torque = match &hinge.torque {
        Some(TimeFunction::Constant(values)) => Some(first(values)),
        Some(_) => None,
        None => Some(0.0),
    };
    let drive = Drive {
        stiffness: first(&hinge.stiffness),
        damping: first(&hinge.damping),
        rest: first(&hinge.rest),
        motor: if torque.is_some() { NONE } else { index(k) },
    };
    let needed = drive.stiffness != 0.0 || drive.damping != 0.0 || drive.motor != NONE;
    (needed.then_some(drive), torque.unwrap_or(0.0))
}

/// A rotation that takes the third axis to `axis`; one that only changes places if `axis` is a coordinate axis.
fn turn_to(axis: &Vector3<f64>) -> Matrix3<f64> {
    for first in 0..3 {
        let (a, b, c) = (Vector3::ith(first, 1.0), Vector3::ith((first + 1) % 3, 1.0), Vector3::ith((first + 2) % 3, 1.0));
        if *axis == c {
            return Matrix3::from_columns(&[a, b, c]);
        }
    }
    // the coordinate axis that is furthest from it is the first to be made normal to it
    let other = match axis.iamin() {
        0 => Vector3::x(),
        1 => Vector3::y(),
        _ => Vector3::z(),
    };
    let first = other - axis * axis.dot(&other);
    let first = first / first.norm();
    Matrix3::from_columns(&[first, axis.cross(&first), *axis])
}

impl Shape {
    /// Of `body` on `parent`, whose link axes are `parent_turn` in its O axes.
    fn new(body: &Body, parent: Option<&Body>, parent_turn: &Matrix3<f64>) -> Self {
        let single = single_axis(body);
        let turn = single.map_or_else(Matrix3::identity, |(axis, ..)| turn_to(axis));
        let side = &body.parent_side;
        let (mut outer, mut position) = (side.rotation * side.offset_rotation, side.position + side.rotation * side.offset);
        if side.moves() {
            // the frame of the moved interface stands in for the parent
            (outer, position) = (*parent_turn, Vector3::zeros());
        } else if let Some(flexible) = parent.and_then(Body::flexible) {
            // from the frame of the modal file to O
            let back = flexible.inboard.rotation.transpose();
            (outer, position) = (back * outer, back * (position - flexible.inboard.position));
        }
        let column = |m: Matrix3<f64>| -> [f64; 9] { std::array::from_fn(|i| m[i]) };
        let (rotational, first_moment) = match &body.kind {
            BodyKind::Rigid(inertia) => (turn.transpose() * inertia.rotational * turn, turn.tr_mul(&inertia.first_moment())),
            BodyKind::Flexible(_) => (Matrix3::zeros(), Vector3::zeros()),
        };
        Self {
            fixed: column(parent_turn.transpose() * outer * turn),
            offset: parent_turn.tr_mul(&position).into(),
            first_moment: first_moment.into(),
            mass: if body.flexible().is_some() { 0.0 } else { body.mass() },
            inertia: column((rotational + rotational.transpose()) * 0.5),
            turn,
            turn_rate: single.map_or(0.0, |s| s.1),
            travel_rate: single.map_or(0.0, |s| s.2),
        }
    }

    fn bits(&self) -> [u64; 36] {
        let numbers = self.fixed.iter().chain(&self.offset).chain(&self.first_moment).chain(&self.inertia);
        let mut bits = [0; 36];
        for (bit, number) in bits.iter_mut().zip(numbers.chain([&self.mass, &self.turn_rate, &self.travel_rate]).chain(self.turn.iter())) {
            *bit = number.to_bits();
        }
        bits
    }
}

impl Link {
    /// Force of the motor of a hinge of one rate (N m or N).
    #[inline]
    pub fn motor(&self, system: &System, state: &State, layout: &Layout) -> f64 {
        let varying = layout.drives.get(self.drive as usize).and_then(|d| system.bodies.get(d.motor as usize));
        self.force + varying.and_then(|b| b.hinge.torque.as_ref()).map_or(0.0, |f| f.value(state.time, 0))
    }

    /// Force of motor, spring and damper on the one rate (N m or N).
    #[inline(always)]
    pub fn applied(&self, system: &System, state: &State, layout: &Layout) -> f64 {
        match layout.drives.get(self.drive as usize) {
            None => self.force,
            Some(d) => {
                let (q, v) = (state.position[self.q as usize], state.velocity[self.v as usize]);
                let spring = if d.stiffness == 0.0 { 0.0 } else { d.stiffness * (q - d.rest) };
                (self.motor(system, state, layout) - spring) - d.damping * v
            }
        }
    }
}
