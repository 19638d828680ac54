//! Seeded random trees: every hinge kind, branching, any share of flexible bodies of every boundary.

use super::lumped::{inertia, lumped_body, stiffness, vector, with_second_order};
use nalgebra::Vector3;
use pliant::model::build::{
    BodyDefinition, BodyDefinitionKind, Definition, FlexibleDefinition, Frame, HingeDefinition, LoadDefinition, PointDefinition, WORLD,
};
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::modal_body::Boundary;
use pliant::model::{InertiaOrder, LoadAxes, TimeFunction};
use pliant::spatial::rotation;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use std::sync::Arc;

/// Kinds with their number of axes, rates and coordinates.
pub const KINDS: [(&str, usize, usize); 10] = [
    ("fixed", 0, 0),
    ("revolute", 1, 1),
    ("prismatic", 1, 1),
    ("screw", 1, 1),
    ("cylindrical", 1, 2),
    ("universal", 2, 2),
    ("gimbal", 3, 3),
    ("planar", 2, 3),
    ("spherical", 0, 3),
    ("free", 0, 6),
];

/// What a random tree holds.
#[derive(Clone, Copy)]
pub struct Recipe {
    pub bodies: usize,
    /// Share of flexible bodies.
    pub flexible: f64,
    /// Boundary of the flexible bodies; any if none.
    pub boundary: Option<Boundary>,
    /// Share of prescribed hinges.
    pub prescribed: f64,
    pub springs: bool,
    pub dampers: bool,
    pub loads: bool,
    pub gravity: bool,
    /// The base hinge; any kind if none.
    pub base: Option<&'static str>,
    pub order: InertiaOrder,
    /// Geometric stiffness of every flexible body, by random second-order displacements of this size.
    pub second_order: Option<f64>,
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            bodies: 6,
            flexible: 0.5,
            boundary: None,
            prescribed: 0.0,
            springs: true,
            dampers: true,
            loads: true,
            gravity: true,
            base: None,
            order: InertiaOrder::Second,
            second_order: None,
        }
    }
}

fn frame(rng: &mut StdRng) -> Frame {
    let q = rotation::quaternion_of_vector(&vector(rng, 1.5));
    Frame { position: vector(rng, 0.6), quaternion: q }
}

fn numbers(rng: &mut StdRng, count: usize, size: f64) -> Vec<f64> {
    (0..count).map(|_| rng.random_range(-size..size)).collect()
}

/// A random tree; the same for the same seed.
pub fn random_tree(seed: u64, recipe: &Recipe) -> Definition {
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut definition = Definition { gravity: if recipe.gravity { vector(rng, 9.0) } else { Vector3::zeros() }, ..Definition::default() };
    for i in 0..recipe.bodies {
        let flexible = rng.random_bool(recipe.flexible);
        let kind = if flexible { flexible_kind(rng, recipe) } else { rigid_kind(rng) };
        definition.bodies.push(BodyDefinition { name: format!("b{i}"), kind });
        let hinge = random_hinge(rng, i, &definition, recipe);
        definition.hinges.push(hinge);
    }
    if recipe.loads {
        for i in 0..recipe.bodies {
            let load = random_load(rng, &definition.bodies[i]);
            definition.loads.push(load);
        }
    }
    definition
}

fn rigid_kind(rng: &mut StdRng) -> BodyDefinitionKind {
    BodyDefinitionKind::Rigid { mass: rng.random_range(0.5..20.0), center_of_mass: vector(rng, 0.5), inertia: inertia(rng, 1.0) }
}

fn flexible_kind(rng: &mut StdRng, recipe: &Recipe) -> BodyDefinitionKind {
    let any = [Boundary::Cantilever, Boundary::FreeFree, Boundary::General][rng.random_range(0..3)];
    let n = rng.random_range(1..7);
    let body = lumped_body(rng, recipe.boundary.unwrap_or(any), n);
    let mut modal = match recipe.second_order {
        // numbers of its own: the tree stays that of the seed
        Some(size) => with_second_order(&mut StdRng::seed_from_u64(n as u64), &body, size).1,
        None => body.modal,
    };
    if rng.random_bool(0.3) {
        modal.stiffness = Some(stiffness(rng, n));
    }
    BodyDefinitionKind::Flexible(FlexibleDefinition {
        integrals: Arc::new(ModalIntegrals::with_geometric_stiffness(&modal)),
        modal: Arc::new(modal),
        mode_names: (1..=n).map(|i| format!("mode {i}")).collect(),
        damping_ratio: vec![if recipe.dampers { 0.02 } else { 0.0 }; n],
        order: recipe.order,
        modal_position: numbers(rng, n, 0.15),
        modal_velocity: numbers(rng, n, 1.0),
    })
}

fn random_hinge(rng: &mut StdRng, i: usize, definition: &Definition, recipe: &Recipe) -> HingeDefinition {
    // trees, not only chains: any earlier body may be the parent
    let parent = if i == 0 { None } else { Some(rng.random_range(i.saturating_sub(3)..i)) };
    let (mut kind, mut axes, mut rates) = KINDS[rng.random_range(0..KINDS.len())];
    if let (0, Some(base)) = (i, recipe.base) {
        (kind, axes, rates) = *KINDS.iter().find(|k| k.0 == base).unwrap();
    }
    let prescribed = rng.random_bool(recipe.prescribed) && !matches!(kind, "fixed" | "spherical" | "free");
    let is_flexible = |b: usize| matches!(definition.bodies[b].kind, BodyDefinitionKind::Flexible(_));
    let mut axes: Vec<_> = (0..axes).map(|_| vector(rng, 1.0)).collect();
    if kind == "planar" {
        axes[1] = axes[0].cross(&axes[1]);
    }
    let turn = rotation::quaternion_of_vector(&vector(rng, 1.5)).to_vec();
    let position = match kind {
        "spherical" => turn,
        "free" => [numbers(rng, 3, 0.5), turn].concat(),
        _ => numbers(rng, rates, 0.8),
    };
    let springs = recipe.springs && rng.random_bool(0.5);
    let waves = |rng: &mut StdRng, rates: usize| TimeFunction::Sine {
        amplitude: numbers(rng, rates, 0.6),
        frequency_hz: rng.random_range(0.1..0.8),
        phase: rng.random_range(0.0..6.0),
    };
    HingeDefinition {
        name: format!("h{i}"),
        kind: kind.into(),
        axes,
        pitch: (kind == "screw").then_some(0.4),
        parent: parent.map_or(WORLD.into(), |p| format!("b{p}")),
        parent_node: parent.filter(|&p| is_flexible(p)).map(|_| ["mid", "tip", "root"][rng.random_range(0..3)].into()),
        parent_frame: frame(rng),
        child: format!("b{i}"),
        child_node: is_flexible(i).then(|| ["root", "root", "tip"][rng.random_range(0..3)].into()),
        child_frame: frame(rng),
        position: if prescribed { vec![] } else { position },
        velocity: if prescribed { vec![] } else { numbers(rng, rates, 1.5) },
        stiffness: if springs && rates > 0 { numbers(rng, rates, 30.0).iter().map(|x| x.abs()).collect() } else { vec![] },
        damping: if springs && recipe.dampers && rates > 0 { vec![0.7] } else { vec![] },
        rest: if springs && rates > 0 { vec![0.1] } else { vec![] },
        torque: (recipe.loads && rates > 0 && !prescribed && rng.random_bool(0.5)).then(|| waves(rng, rates)),
        motion: prescribed.then(|| waves(rng, rates)),
        held: false,
    }
}

fn random_load(rng: &mut StdRng, body: &BodyDefinition) -> LoadDefinition {
    let flexible = matches!(body.kind, BodyDefinitionKind::Flexible(_));
    LoadDefinition {
        body: body.name.clone(),
        point: if flexible { PointDefinition::Interface("tip".into()) } else { PointDefinition::Point(vector(rng, 0.4)) },
        force: Some(TimeFunction::Constant(numbers(rng, 3, 8.0))),
        moment: Some(TimeFunction::Constant(numbers(rng, 3, 3.0))),
        axes: if rng.random_bool(0.5) { LoadAxes::World } else { LoadAxes::Body },
    }
}
