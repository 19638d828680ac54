//! Small systems put together by hand, and runs of them that are looked at while they last.

use nalgebra::{Matrix3, Vector3};
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, Summary, simulate};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, FlexibleDefinition, Frame, HingeDefinition, WORLD};
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::modal_body::{Boundary, Interface, ModalBody};
use pliant::model::{InertiaOrder, State, System};
use std::sync::Arc;

pub const G: f64 = 9.81;
pub const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// Rigid body with principal inertia about its centre of mass.
pub fn rigid(name: &str, mass: f64, center: [f64; 3], inertia: [f64; 3]) -> BodyDefinition {
    let kind =
        BodyDefinitionKind::Rigid { mass, center_of_mass: Vector3::from(center), inertia: Matrix3::from_diagonal(&Vector3::from(inertia)) };
    BodyDefinition { name: name.into(), kind }
}

/// All modes of `modal`, undeformed and at rest.
pub fn flexible(name: &str, modal: ModalBody) -> BodyDefinition {
    let n = modal.mode_count();
    let kind = BodyDefinitionKind::Flexible(FlexibleDefinition {
        integrals: Arc::new(ModalIntegrals::of(&modal)),
        mode_numbers: (1..=n).collect(),
        damping_ratio: modal.damping_ratio.clone(),
        order: InertiaOrder::Second,
        modal_position: vec![],
        modal_velocity: vec![],
        modal: Arc::new(modal),
    });
    BodyDefinition { name: name.into(), kind }
}

/// Hinge with O+ at `at` on the parent and O at the child's origin (or root interface).
pub fn hinge(name: &str, kind: &str, axes: &[[f64; 3]], parent: &str, child: &str, at: [f64; 3]) -> HingeDefinition {
    HingeDefinition {
        name: name.into(),
        kind: kind.into(),
        axes: axes.iter().map(|a| Vector3::from(*a)).collect(),
        parent: parent.into(),
        child: child.into(),
        parent_frame: Frame { position: Vector3::from(at), ..Frame::default() },
        ..HingeDefinition::default()
    }
}

/// Links joined by revolute hinges about z, each hinged at the point `end` of the one before; gravity along -y.
pub fn chain(links: Vec<BodyDefinition>, ends: &[[f64; 3]]) -> Definition {
    let name = |i: usize| links[i].name.clone();
    let hinges = (0..links.len())
        .map(|i| {
            let (parent, at) = if i == 0 { (WORLD.into(), [0.0; 3]) } else { (name(i - 1), ends[i - 1]) };
            hinge(&format!("h{}", i + 1), "revolute", &[Z], &parent, &name(i), at)
        })
        .collect();
    Definition { gravity: Vector3::new(0.0, -G, 0.0), hinges, bodies: links, loads: vec![], closures: vec![] }
}

/// Uniform rods along x: mass and length of each.
pub fn rods(sizes: &[(f64, f64)]) -> Definition {
    let links = sizes.iter().enumerate().map(|(i, (m, l))| {
        let j = m * l * l / 12.0;
        rigid(&format!("rod{}", i + 1), *m, [0.5 * l, 0.0, 0.0], [0.0, j, j])
    });
    let ends: Vec<_> = sizes.iter().map(|s| [s.1, 0.0, 0.0]).collect();
    chain(links.collect(), &ends)
}

/// Unit point masses, each at `end` of its massless link.
pub fn beads(count: usize, end: [f64; 3]) -> Definition {
    chain((0..count).map(|i| rigid(&format!("bead{}", i + 1), 1.0, end, [0.0; 3])).collect(), &vec![end; count])
}

/// Roots beta L of the uniform cantilever, `1 + cos cosh = 0`, by Newton's method.
fn cantilever_root(j: usize) -> f64 {
    let mut x = (j as f64 + 0.5) * std::f64::consts::PI;
    for _ in 0..50 {
        let f = x.cos() + 1.0 / x.cosh();
        x -= f / (-x.sin() - x.sinh() / x.cosh().powi(2));
    }
    x
}

/// Uniform cantilever (rho A = E I = L = 1) along x that bends in y, by its exact Euler-Bernoulli modes.
pub fn exact_beam(modes: usize) -> ModalBody {
    let beta: Vec<f64> = (0..modes).map(cantilever_root).collect();
    let sigma = |b: f64| (b.sinh() - b.sin()) / (b.cosh() + b.cos());
    let sign = |j: usize| if j.is_multiple_of(2) { 1.0 } else { -1.0 };
    let in_plane = |a: usize, b: usize, x: f64| Matrix3::from_fn(|i, j| if (i, j) == (a, b) { x } else { 0.0 });
    let tip =
        beta.iter().enumerate().map(|(j, &b)| nalgebra::Vector6::new(0.0, 0.0, 2.0 * sign(j) * b * sigma(b), 0.0, 2.0 * sign(j), 0.0));
    let interface = |name: &str, x: f64, mode_shape| Interface {
        name: name.into(),
        position: Vector3::new(x, 0.0, 0.0),
        orientation: Matrix3::identity(),
        mode_shape,
    };
    ModalBody {
        mass: 1.0,
        center_of_mass: Vector3::new(0.5, 0.0, 0.0),
        inertia: Matrix3::from_diagonal(&Vector3::new(0.0, 1.0 / 3.0, 1.0 / 3.0)),
        boundary: Boundary::Cantilever,
        root_interface: "root".into(),
        frequency_hz: beta.iter().map(|b| b * b / std::f64::consts::TAU).collect(),
        damping_ratio: vec![0.0; modes],
        stiffness: None,
        momentum: beta.iter().map(|&b| Vector3::new(0.0, 2.0 * sigma(b) / b, 0.0)).collect(),
        first_moment: beta.iter().map(|&b| in_plane(0, 1, 2.0 / (b * b))).collect(),
        second_moment: (0..modes * modes).map(|i| in_plane(1, 1, if i / modes == i % modes { 1.0 } else { 0.0 })).collect(),
        angular_momentum: None,
        geometric_stiffness: None,
        interfaces: vec![interface("root", 0.0, vec![nalgebra::Vector6::zeros(); modes]), interface("tip", 1.0, tip.collect())],
    }
}

/// An observer made of a closure.
pub struct Watch<F>(pub F);

impl<F: FnMut(&Sample<'_>)> Observer for Watch<F> {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        (self.0)(sample);
        Flow::Continue
    }
}

pub const fn rk4(step: f64) -> Method {
    Method::RungeKutta4 { step }
}

pub const fn dormand_prince(tolerance: f64) -> Method {
    Method::DormandPrince { tolerance: Tolerance { relative: tolerance, absolute: tolerance }, largest_step: f64::INFINITY }
}

/// Runs to `duration` with `watch` at every output time.
#[track_caller]
pub fn run(system: &System, start: &State, method: Method, duration: f64, rate_hz: f64, watch: impl FnMut(&Sample<'_>)) -> Summary {
    let mut observer = Watch(watch);
    let summary = simulate(system, start, &Settings { duration, method, rate_hz }, &mut [&mut observer]);
    assert_eq!(summary.outcome, Outcome::Completed);
    summary
}

/// Runs to `duration` and returns the last state.
#[track_caller]
pub fn end_of(system: &System, start: &State, method: Method, duration: f64) -> State {
    let summary = simulate(system, start, &Settings { duration, method, rate_hz: 1.0 }, &mut []);
    assert_eq!(summary.outcome, Outcome::Completed);
    summary.end
}

/// All numbers of a state.
pub fn numbers(state: &State) -> Vec<f64> {
    [&state.position, &state.velocity, &state.modal_position, &state.modal_velocity].into_iter().flatten().copied().collect()
}

/// Largest difference of two lists over the largest entry of the second.
pub fn difference(found: &[f64], expected: &[f64]) -> f64 {
    let size = expected.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    found.iter().zip(expected).fold(0.0_f64, |a, (f, e)| a.max((f - e).abs())) / size
}

/// Binary logarithms of the ratios of successive errors: the observed orders when steps are halved.
pub fn slopes(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect()
}
