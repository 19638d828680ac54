//! Inertia and velocity terms from modal integrals against sums over the nodes they were integrated from.

use crate::support::lumped::{LumpedBody, SecondOrder, lumped_body, vector, with_second_order};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};
use pliant::dynamics::flexible_inertia::FlexibleInertia;
use pliant::model::InertiaOrder;
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::modal_body::Boundary;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

/// Everything the recursion takes from a flexible body, in one list per kind.
struct Terms {
    first_moment: Vector3<f64>,
    inertia: Matrix3<f64>,
    row: Vec<Vector6<f64>>,
    bias: Vector6<f64>,
    bias_modal: Vec<f64>,
}

impl Terms {
    fn lists(&self) -> [(&'static str, Vec<f64>); 5] {
        [
            ("first moment", self.first_moment.as_slice().to_vec()),
            ("inertia", self.inertia.as_slice().to_vec()),
            ("mass rows", self.row.iter().flat_map(|r| r.as_slice().to_vec()).collect()),
            ("rigid velocity terms", self.bias.as_slice().to_vec()),
            ("modal velocity terms", self.bias_modal.clone()),
        ]
    }
}

struct Motion {
    eta: Vec<f64>,
    eta_dot: Vec<f64>,
    omega: Vector3<f64>,
}

impl Motion {
    fn random(rng: &mut StdRng, modes: usize, size: f64) -> Self {
        let mut list = |size: f64| (0..modes).map(|_| rng.random_range(-size..size)).collect();
        Self { eta: list(size), eta_dot: list(2.0), omega: vector(rng, 3.0) }
    }
}

/// Sums over nodes: m, m x, m (x.x - x x'), m x × phi, and the same of the node accelerations that rates alone cause.
fn nodal(body: &LumpedBody, motion: &Motion) -> Terms {
    let n = motion.eta.len();
    let mut terms = Terms {
        first_moment: Vector3::zeros(),
        inertia: Matrix3::zeros(),
        row: vec![Vector6::zeros(); n],
        bias: Vector6::zeros(),
        bias_modal: vec![0.0; n],
    };
    for (i, m) in body.masses.iter().enumerate() {
        let shaped = |weights: &[f64]| body.shapes.iter().zip(weights).map(|(s, w)| s[i] * *w).sum::<Vector3<f64>>();
        let (x, u_dot, w) = (body.points[i] + shaped(&motion.eta), shaped(&motion.eta_dot), motion.omega);
        let force = (w.cross(&w.cross(&x)) + w.cross(&u_dot) * 2.0) * *m;
        let joined = |a: Vector3<f64>, b: Vector3<f64>| Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z);
        terms.first_moment += x * *m;
        terms.inertia += (Matrix3::from_diagonal_element(x.norm_squared()) - x * x.transpose()) * *m;
        terms.bias += joined(x.cross(&force), force);
        for j in 0..n {
            let phi = body.shapes[j][i];
            terms.row[j] += joined(x.cross(&phi), phi) * *m;
            terms.bias_modal[j] += phi.dot(&force);
        }
    }
    terms
}

fn integrated(body: &LumpedBody, motion: &Motion, order: InertiaOrder) -> Terms {
    integrated_of(&ModalIntegrals::of(&body.modal), motion, order)
}

fn integrated_of(integrals: &ModalIntegrals, motion: &Motion, order: InertiaOrder) -> Terms {
    let n = motion.eta.len();
    let mut inertia = FlexibleInertia::new(n);
    inertia.evaluate(integrals, order, &motion.eta, &motion.eta_dot);
    let mut bias_modal = vec![0.0; n];
    let bias = inertia.velocity_terms(integrals, order, &motion.omega, &motion.eta_dot, &mut bias_modal);
    Terms { first_moment: inertia.first_moment, inertia: inertia.inertia, row: inertia.row.clone(), bias, bias_modal }
}

/// Adds what the displacements `s = 1/2 eta' Gamma eta` of the nodes make with the motion of the undeformed body.
fn add_second_order(terms: &mut Terms, body: &LumpedBody, field: &SecondOrder, motion: &Motion) {
    let n = motion.eta.len();
    let w = motion.omega;
    for ((m, r), at) in body.masses.iter().zip(&body.points).zip(field) {
        let along = |j: usize, rates: &[f64]| (0..n).map(|k| at[j + n * k] * rates[k]).sum::<Vector3<f64>>();
        let twice = |a: &[f64], b: &[f64]| (0..n).map(|j| along(j, b) * a[j]).sum::<Vector3<f64>>();
        let (eta, rate) = (&motion.eta, &motion.eta_dot);
        let (s, s_dot, s_ddot) = (twice(eta, eta) * 0.5, twice(eta, rate), twice(rate, rate));
        let frame = w.cross(&w.cross(r));
        let force = (s_ddot + w.cross(&s_dot) * 2.0 + w.cross(&w.cross(&s))) * *m;
        let joined = |a: Vector3<f64>, b: Vector3<f64>| Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z);
        terms.first_moment += s * *m;
        terms.inertia += (Matrix3::from_diagonal_element(2.0 * r.dot(&s)) - r * s.transpose() - s * r.transpose()) * *m;
        terms.bias += joined(r.cross(&force) + s.cross(&frame) * *m, force);
        for j in 0..n {
            let phi = along(j, eta);
            terms.row[j] += joined(r.cross(&phi), phi) * *m;
            terms.bias_modal[j] += phi.dot(&frame) * m;
        }
    }
}

fn bodies() -> impl Iterator<Item = (u64, StdRng, LumpedBody)> {
    (0..12).map(|seed| {
        let mut rng = StdRng::seed_from_u64(seed);
        let boundary = [Boundary::Cantilever, Boundary::FreeFree, Boundary::General][seed as usize % 3];
        let modes = rng.random_range(1..9);
        let body = lumped_body(&mut rng, boundary, modes);
        (seed, rng, body)
    })
}

/// Largest difference over the largest expected entry, which is not below `floor`.
fn error(found: &[f64], expected: &[f64], floor: f64) -> f64 {
    let size = expected.iter().fold(floor, |a, x| a.max(x.abs()));
    found.iter().zip(expected).fold(0.0_f64, |a, (f, e)| a.max((f - e).abs())) / size
}

#[test]
fn modal_integrals_give_the_same_terms_as_sums_over_nodes() {
    let mut worst = 0.0_f64;
    for (seed, mut rng, body) in bodies() {
        for size in [0.1, 1.0, 10.0] {
            let motion = Motion::random(&mut rng, body.shapes.len(), size);
            let (found, expected) = (integrated(&body, &motion, InertiaOrder::Second), nodal(&body, &motion));
            for ((what, found), (_, expected)) in found.lists().into_iter().zip(expected.lists()) {
                // sums of nodes x modes^2 terms, each below the square of the largest point times its mass
                let n = body.shapes.len() as f64;
                let allowed = 4.0 * body.masses.len() as f64 * n * n * f64::EPSILON;
                let error = error(&found, &expected, body.modal.mass * 1e-3);
                worst = worst.max(error / allowed);
                assert!(error <= allowed, "seed {seed}, eta {size}: {what} differ by {error:e}, allowed {allowed:e}");
            }
        }
    }
    println!("largest error over allowed: {worst:.3}");
}

#[test]
fn inertia_orders_zero_and_one_are_the_taylor_truncations() {
    for (seed, mut rng, body) in bodies() {
        let direction = Motion::random(&mut rng, body.shapes.len(), 1.0);
        for (order, power) in [(InertiaOrder::Zeroth, 1), (InertiaOrder::First, 2)] {
            let at = |size: f64| {
                let motion = Motion {
                    eta: direction.eta.iter().map(|e| e * size).collect(),
                    // order zero also leaves out the coupling of modal rates, which are of the size of eta in a vibration
                    eta_dot: direction.eta_dot.iter().map(|e| e * size).collect(),
                    omega: direction.omega,
                };
                let (found, expected) = (integrated(&body, &motion, order), nodal(&body, &motion));
                found.lists().into_iter().zip(expected.lists()).map(|((what, f), (_, e))| (what, error(&f, &e, 1.0))).collect::<Vec<_>>()
            };
            for ((what, coarse), (_, fine)) in at(2e-3).into_iter().zip(at(1e-3)) {
                let ratio = coarse / fine;
                // exact terms have no error; the others' next power of eta changes the ratio by 1e-3 of their cubic share
                let exact = fine < 1e3 * f64::EPSILON;
                let slope = ratio.log2();
                assert!(
                    exact || slope > f64::from(power) - 0.1,
                    "seed {seed}, {order:?}: {what} shrink as eta^{slope:.3}, expected {power}"
                );
            }
            let undeformed = at(0.0);
            // at eta = 0 every order is exact but for rounding, and for modal rates, which are zero here
            assert!(undeformed.iter().all(|(_, e)| *e < 1e3 * f64::EPSILON), "seed {seed}, {order:?}: {undeformed:?}");
        }
    }
}

#[test]
fn geometric_stiffness_gives_the_terms_of_the_second_order_displacements_of_nodes() {
    for (seed, mut rng, body) in bodies() {
        let (field, modal) = with_second_order(&mut rng, &body, 0.5);
        let integrals = ModalIntegrals::with_geometric_stiffness(&modal);
        for size in [0.1, 1.0, 10.0] {
            let motion = Motion::random(&mut rng, body.shapes.len(), size);
            let found = integrated_of(&integrals, &motion, InertiaOrder::Second);
            let mut expected = nodal(&body, &motion);
            add_second_order(&mut expected, &body, &field, &motion);
            for ((what, found), (_, expected)) in found.lists().into_iter().zip(expected.lists()) {
                // as without, with the tensors taken apart into 12 matrices and put together again
                let n = body.shapes.len() as f64;
                let allowed = 16.0 * body.masses.len() as f64 * n * n * f64::EPSILON;
                let error = error(&found, &expected, body.modal.mass * 1e-3);
                assert!(error <= allowed, "seed {seed}, eta {size}: {what} differ by {error:e}, allowed {allowed:e}");
            }
        }
    }
}

/// Mass matrix of (omega, v of the origin, eta_dot) at `eta`.
fn mass(integrals: &ModalIntegrals, eta: &[f64]) -> DMatrix<f64> {
    let n = eta.len();
    let mut inertia = FlexibleInertia::new(n);
    inertia.evaluate(integrals, InertiaOrder::Second, eta, &vec![0.0; eta.len()]);
    let mut mass = DMatrix::identity(6 + n, 6 + n);
    mass.view_mut((0, 0), (6, 6)).copy_from(&inertia.rigid.matrix());
    for (j, row) in inertia.row.iter().enumerate() {
        mass.view_mut((0, 6 + j), (6, 1)).copy_from(row);
        mass.view_mut((6 + j, 0), (1, 6)).copy_from(&row.transpose());
    }
    mass
}

/// Lagrange's equations in the axes of the body: `M_dot u + (omega x angular, omega x linear momentum)`, less `1/2 u' dM/d eta u`.
#[test]
fn velocity_terms_are_those_of_the_mass_matrix() {
    for (seed, mut rng, body) in bodies() {
        let (_, modal) = with_second_order(&mut rng, &body, 0.5);
        for integrals in [ModalIntegrals::of(&modal), ModalIntegrals::with_geometric_stiffness(&modal)] {
            let n = body.shapes.len();
            let motion = Motion::random(&mut rng, n, 1.0);
            let found = integrated_of(&integrals, &motion, InertiaOrder::Second);
            let mut rates = DVector::zeros(6 + n);
            rates.rows_mut(0, 3).copy_from(&motion.omega);
            rates.rows_mut(6, n).copy_from_slice(&motion.eta_dot);
            let shifted = |by: &dyn Fn(usize) -> f64| mass(&integrals, &(0..n).map(|j| motion.eta[j] + by(j)).collect::<Vec<_>>());
            // M is of second order in eta: differences over a step of one are exact but for rounding
            let along = |by: &dyn Fn(usize) -> f64| (shifted(by) - shifted(&|j| -by(j))) * 0.5;
            let mut expected = along(&|j| motion.eta_dot[j]) * &rates;
            let momentum = mass(&integrals, &motion.eta) * &rates;
            for part in [0, 3] {
                let turned = motion.omega.cross(&Vector3::from_iterator(momentum.rows(part, 3).iter().copied()));
                expected.rows_mut(part, 3).iter_mut().zip(turned.iter()).for_each(|(e, t)| *e += t);
            }
            for k in 0..n {
                let change = along(&|j| if j == k { 1.0 } else { 0.0 });
                expected[6 + k] -= 0.5 * rates.dot(&(change * &rates));
            }
            let found = [found.bias.as_slice(), &found.bias_modal].concat();
            // differences of masses that are up to (1 + eta)^2 of the body's, over n modes
            let allowed = 64.0 * (6 + n) as f64 * body.masses.len() as f64 * f64::EPSILON;
            let error = error(&found, expected.as_slice(), body.modal.mass);
            assert!(error <= allowed, "seed {seed}: velocity terms differ by {error:e}, allowed {allowed:e}");
        }
    }
}
