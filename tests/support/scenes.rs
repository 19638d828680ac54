//! Small systems put together by hand, and runs of them that are looked at while they last.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use pliant::integrate::simulate::Method;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, Summary, simulate};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, FlexibleDefinition, Frame, HingeDefinition, WORLD};
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::modal_body::{Boundary, Interface, ModalBody};
use pliant::model::{InertiaOrder, State, System, TimeFunction};
use std::sync::Arc;

pub const G: f64 = 9.81;
pub const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// Rigid body with principal inertia about its centre of mass.
pub fn rigid(name: &str, mass: f64, center: [f64; 3], inertia: [f64; 3]) -> BodyDefinition {
    let kind =
        BodyDefinitionKind::Rigid { mass, center_of_mass: Vector3::from(center), inertia: Matrix3::from_diagonal(&Vector3::from(inertia)) };
    BodyDefinition { name: name.into(), kind }
}

/// The same with the geometric stiffness of `modal` in use.
pub fn stiffened(name: &str, modal: ModalBody) -> BodyDefinition {
    let mut body = flexible(name, modal);
    if let BodyDefinitionKind::Flexible(f) = &mut body.kind {
        f.integrals = Arc::new(ModalIntegrals::with_geometric_stiffness(&f.modal));
    }
    body
}

/// All modes of `modal`, undeformed and at rest.
pub fn flexible(name: &str, modal: ModalBody) -> BodyDefinition {
    let n = modal.mode_count();
    let kind = BodyDefinitionKind::Flexible(FlexibleDefinition {
        integrals: Arc::new(ModalIntegrals::of(&modal)),
        mode_names: (1..=n).map(|i| format!("mode {i}")).collect(),
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

/// Abscissas in (0, 1) and weights of Gauss' rule of three points on `panels` equal panels.
fn gauss(panels: usize) -> impl Iterator<Item = (f64, f64)> {
    let offset = 0.6_f64.sqrt();
    (0..panels).flat_map(move |i| {
        [(-offset, 5.0), (0.0, 8.0), (offset, 5.0)].map(|(x, w)| ((i as f64 + 0.5 * (1.0 + x)) / panels as f64, w / (18.0 * panels as f64)))
    })
}

/// Slope `phi'` of mode j of the uniform cantilever, of unit modal mass; free of the cancellation of hyperbolic functions.
pub fn cantilever_slope(j: usize, x: f64) -> f64 {
    let b = cantilever_root(j);
    let decay = (-b).exp();
    let sigma = (b.sinh() - b.sin()) / (b.cosh() + b.cos());
    // (1 - sigma) e^(b x)
    let rise = 2.0 * (decay + b.cos() + b.sin()) / (1.0 + decay * decay + 2.0 * b.cos() * decay) * (b * (x - 1.0)).exp();
    b * (0.5 * (rise - (1.0 + sigma) * (-b * x).exp()) + (b * x).sin() + sigma * (b * x).cos())
}

/// [`exact_beam`] with the geometric stiffness of a beam that does not stretch: `Gamma_x = -int_0^x phi_i' phi_j' ds`, so that
/// `int Gamma_x = -int phi_i' phi_j' (1 - s) ds` and `int x Gamma_x = -int phi_i' phi_j' (1 - s^2) / 2 ds`.
pub fn stiffened_beam(modes: usize) -> ModalBody {
    let (mut pull, mut spin) = (DMatrix::zeros(modes, modes), DMatrix::zeros(modes, modes));
    // degree 5 per panel; the highest mode turns by 30 rad, so by 0.015 per panel
    for (s, weight) in gauss(2000) {
        let slope = DVector::from_fn(modes, |j, _| cantilever_slope(j, s));
        let product = &slope * slope.transpose();
        pull -= &product * (weight * (1.0 - s));
        spin += product * (weight * 0.5 * (1.0 - s * s));
    }
    let mut matrices = vec![DMatrix::zeros(modes, modes); 12];
    // acc_x; omega_yy and omega_zz
    matrices[0] = pull;
    matrices[7] = spin.clone();
    matrices[8] = spin;
    ModalBody { geometric_stiffness: Some(matrices), ..exact_beam(modes) }
}

/// The uniform beam by Ritz modes of the polynomials `x^2` to `x^(modes + 1)`, with geometric stiffness: they resolve what a tension does
/// at the clamped end, for which cantilever modes converge slowly.
pub fn polynomial_beam(modes: usize) -> ModalBody {
    // x^2 times Legendre's polynomials of 2 x - 1, as coefficients of powers of x
    let mut shapes: Vec<Vec<f64>> = vec![vec![1.0], vec![-1.0, 2.0]];
    for k in 2..modes {
        let (n, previous, older) = (k as f64, shapes[k - 1].clone(), shapes[k - 2].clone());
        let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(0.0);
        let next = |i: usize| {
            let shifted = if i == 0 { 0.0 } else { 2.0 * at(&previous, i - 1) };
            ((2.0 * n - 1.0) * (shifted - at(&previous, i)) - (n - 1.0) * at(&older, i)) / n
        };
        shapes.push((0..=k).map(next).collect());
    }
    // value, slope and curvature
    let sample = |x: f64| {
        let all =
            |f: &dyn Fn(i32) -> f64| DVector::from_fn(modes, |j, _| shapes[j].iter().enumerate().map(|(i, c)| c * f(i as i32 + 2)).sum());
        let (value, slope) = (all(&|p| x.powi(p)), all(&|p| f64::from(p) * x.powi(p - 1)));
        (value, slope, all(&|p| f64::from(p * (p - 1)) * x.powi(p - 2)))
    };
    let zero = || DMatrix::zeros(modes, modes);
    let (mut mass, mut stiffness, mut pull, mut spin) = (zero(), zero(), zero(), zero());
    let (mut momentum, mut moment) = (DVector::zeros(modes), DVector::zeros(modes));
    for (x, weight) in gauss(2000) {
        let (value, slope, curvature) = sample(x);
        mass += &value * value.transpose() * weight;
        stiffness += &curvature * curvature.transpose() * weight;
        pull -= &slope * slope.transpose() * (weight * (1.0 - x));
        spin += &slope * slope.transpose() * (weight * 0.5 * (1.0 - x * x));
        momentum += &value * weight;
        moment += &value * (weight * x);
    }
    let factor = mass.cholesky().unwrap().l();
    let inverse = factor.solve_lower_triangular(&DMatrix::identity(modes, modes)).unwrap();
    let eigen = (&inverse * stiffness * inverse.transpose()).symmetric_eigen();
    let mut order: Vec<usize> = (0..modes).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
    let basis = inverse.transpose() * DMatrix::from_fn(modes, modes, |i, j| eigen.eigenvectors[(i, order[j])]);
    let project = |m: &DMatrix<f64>| basis.transpose() * m * &basis;
    let (momentum, moment) = (basis.tr_mul(&momentum), basis.tr_mul(&moment));
    let mut body = stiffened_beam(modes);
    body.frequency_hz = order.iter().map(|&i| eigen.eigenvalues[i].sqrt() / std::f64::consts::TAU).collect();
    for j in 0..modes {
        body.momentum[j].y = momentum[j];
        body.first_moment[j][(0, 1)] = moment[j];
    }
    let (value, slope, _) = sample(1.0);
    let (tip, turn) = (basis.tr_mul(&value), basis.tr_mul(&slope));
    for (j, shape) in body.interfaces[1].mode_shape.iter_mut().enumerate() {
        *shape = nalgebra::Vector6::new(0.0, 0.0, turn[j], 0.0, tip[j], 0.0);
    }
    if let Some(matrices) = &mut body.geometric_stiffness {
        matrices[0] = project(&pull);
        matrices[7] = project(&spin);
        matrices[8] = matrices[7].clone();
    }
    body
}

/// A hub that turns about `axis` by `motion`, with `beam` clamped at the distance `radius` along x.
pub fn spinning(beam: BodyDefinition, axis: [f64; 3], radius: f64, motion: TimeFunction) -> (System, State) {
    let mut spin = hinge("spin", "revolute", &[axis], WORLD, "hub", [0.0; 3]);
    spin.motion = Some(motion);
    let clamp = hinge("clamp", "fixed", &[], "hub", "beam", [radius, 0.0, 0.0]);
    let bodies = vec![rigid("hub", 1.0, [0.0; 3], [1.0; 3]), beam];
    Definition { bodies, hinges: vec![spin, clamp], ..Definition::default() }.build().unwrap()
}

/// At t = 0: no angle, the rate `rate` and no acceleration.
pub fn rate_at_start(rate: f64) -> TimeFunction {
    TimeFunction::Sine { amplitude: vec![rate], frequency_hz: 1.0 / std::f64::consts::TAU, phase: 0.0 }
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
