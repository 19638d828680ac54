//! Spinning beams: stiffening by geometric stiffness, and the exact motion without it (F03, F04). Labels are those of the project's list
//! of reference problems; spin beyond softening is in the stability suite.

use crate::support::assert_close;
use crate::support::scenes::{
    Watch, Z, dormand_prince, exact_beam, flexible, hinge, polynomial_beam, rate_at_start, rigid, run, slopes, spinning, stiffened,
    stiffened_beam,
};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};
use pliant::dynamics::energy::balance;
use pliant::dynamics::world::WorldFrame;
use pliant::dynamics::{DynamicsError, Workspace, forward_dynamics};
use pliant::integrate::{Observer, Settings, simulate};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, WORLD};
use pliant::model::modal_body::ModalBody;
use pliant::model::time_function::Table;
use pliant::model::{InertiaOrder, TimeFunction};
use pliant::output::stiffening::StiffeningGauge;
use std::f64::consts::TAU;

const Y: [f64; 3] = [0.0, 1.0, 0.0];

/// Stiffness of the modes at a steady spin, from their accelerations: linear in the deflection where the hub's motion is prescribed.
fn spin_stiffness(beam: &BodyDefinition, axis: [f64; 3], radius: f64, rate: f64) -> DMatrix<f64> {
    let (system, mut state) = spinning(beam.clone(), axis, radius, rate_at_start(rate));
    state.apply_prescribed(&system);
    let mut workspace = Workspace::new(&system);
    let n = state.modal_position.len();
    let mut acceleration = |eta: &dyn Fn(usize) -> f64| {
        (0..n).for_each(|j| state.modal_position[j] = eta(j));
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        workspace.acceleration.modal.clone()
    };
    let rest = acceleration(&|_| 0.0);
    let columns: Vec<Vec<f64>> = (0..n).map(|k| acceleration(&|j| if j == k { 1.0 } else { 0.0 })).collect();
    DMatrix::from_fn(n, n, |j, k| rest[j] - columns[k][j])
}

/// F03: Southwell's coefficients of one cantilever mode; flap is bending along the axis of spin, chord across it.
#[test]
fn published_southwell_coefficients_of_one_mode() {
    let beam = stiffened("beam", stiffened_beam(1));
    for (radius, flap) in [(0.0, 1.193_336_374_108_255_903_2), (0.7, 1.193_336_374_108_255_903_2 + 0.7 * 1.570_878_189_994_250_160_3)] {
        for (axis, expected) in [(Y, flap), (Z, flap - 1.0)] {
            let at = |rate| spin_stiffness(&beam, axis, radius, rate)[(0, 0)];
            // at a spin of 100 the stiffness of the beam, 12, is no longer what rounding is measured against
            let found = (at(100.0) - at(0.0)) / 1e4;
            // the bound of the list: a quadrature of degree 5 on 2000 panels, and a difference of sums of some ten terms
            assert_close(&[found], &[expected], 1e-12, &format!("axis {axis:?}, radius {radius}"));
        }
    }
}

/// F03: frequencies of a beam clamped at the axis, spinning at 12 sqrt(EI / rho A L^4).
#[test]
fn published_frequencies_of_a_rotating_beam() {
    let frequencies = |beam: &BodyDefinition, axis| {
        let stiffness = spin_stiffness(beam, axis, 0.0, 12.0);
        let mut found: Vec<f64> = stiffness.symmetric_eigenvalues().iter().map(|x| x.sqrt()).collect();
        found.sort_by(f64::total_cmp);
        found
    };
    let flap = [13.170_150_487_506_2, 37.603_112_331_191_9, 79.614_478_489_457_2];
    let chord = [5.427_049_277_789_84, 35.636_975_979_903_7];
    let error = |beam: ModalBody| {
        let beam = stiffened("beam", beam);
        let (f, c) = (frequencies(&beam, Y), frequencies(&beam, Z));
        // Ritz: from above; eigenvalues are rounded to the largest, which is below 1e6 of the first for 20 modes
        assert!(f.iter().zip(&flap).all(|(f, e)| *f > e * (1.0 - 1e-9)), "{f:?}");
        let over = |found: &[f64], exact: &[f64]| found.iter().zip(exact).map(|(f, e)| (f / e - 1.0).abs()).fold(0.0_f64, f64::max);
        over(&f, &flap).max(over(&c, &chord))
    };
    // the bound of the list; eight polynomials miss it by a factor of 1.8
    for (modes, bound) in [(8, 2e-6), (9, 1e-6), (10, 1e-6)] {
        let found = error(polynomial_beam(modes));
        println!("{modes} polynomials: {found:.1e}");
        assert!(found < bound, "{modes} polynomials: {found:e}");
    }
    // cantilever modes do not bend at the root as a tension makes the beam do: they converge with a power of their number only
    let found = [8, 16, 32].map(|modes| error(stiffened_beam(modes)));
    let orders = slopes(&found);
    println!("8, 16, 32 cantilever modes: {found:?}, orders {orders:.2?}");
    // modal forces of the tension fall with the square of the mode's number, stiffness rises with its fourth power, and both
    // enter an eigenvalue's error squared or once: n^-4 for the sum over the modes left out
    assert!(orders.iter().all(|o| *o > 3.5), "{orders:?} of {found:?}");
}

/// A beam in the units of the uniform beam of the tests, `rho A = E I = L = 1`.
struct Units {
    length: f64,
    second: f64,
}

impl Units {
    /// Of a beam of the given length (m) and `E I / rho A` (m^4 / s^2).
    fn new(length: f64, stiffness: f64) -> Self {
        Self { length, second: stiffness.sqrt() / (length * length) }
    }

    /// Beam of Simo and Vu-Quoc.
    fn simo_vu_quoc() -> Self {
        Self::new(10.0, 1.4e4 / 1.2)
    }

    /// Beam of Wu and Haug: E = 6.8952e10 Pa, I = 8.2189e-9 m^4, density 2766.7 kg/m^3, A = 7.2968e-5 m^2.
    fn wu_haug() -> Self {
        Self::new(8.0, 6.8952e10 * 8.2189e-9 / (2.7667e3 * 7.2968e-5))
    }

    /// Tip deflection (m) of cantilever modes.
    fn tip(&self, eta: &[f64]) -> f64 {
        self.length * eta.iter().enumerate().map(|(j, e)| if j % 2 == 0 { 2.0 * e } else { -2.0 * e }).sum::<f64>()
    }
}

/// The angle of the spin-up `omega = W (t / T - sin(2 pi t / T) / 2 pi)`, W from T = 15 s on, in the units of the beam.
fn spin_up(units: &Units, rate: f64) -> TimeFunction {
    let (w, t_end) = (rate / units.second, 15.0 * units.second);
    let angle = |t: f64| {
        if t < t_end { w * (0.5 * t * t / t_end + t_end / (TAU * TAU) * ((TAU * t / t_end).cos() - 1.0)) } else { w * (t - 0.5 * t_end) }
    };
    // a spline's second derivative is off by h^2 / 12 times the fourth: 3e-8 of it; what its end does is past the run
    let rows: Vec<_> = (0..=17_000).map(|i| f64::from(i) * 1.5e-3).map(|t| (t, vec![angle(t)])).collect();
    TimeFunction::Table(Table::new(&rows).unwrap().splined())
}

/// Tip deflection (m) at the output times (s).
fn tip_history(units: &Units, beam: BodyDefinition, rate: f64, duration: f64, rate_hz: f64) -> Vec<(f64, f64)> {
    let (system, start) = spinning(beam, Z, 0.0, spin_up(units, rate));
    let mut history = Vec::new();
    run(&system, &start, dormand_prince(1e-11), duration * units.second, rate_hz / units.second, |s| {
        history.push((s.state.time / units.second, units.tip(&s.state.modal_position)));
    });
    history
}

/// Lowest point of a history, by the parabola through the three lowest samples.
fn lowest(history: &[(f64, f64)]) -> (f64, f64) {
    let i = (1..history.len() - 1).min_by(|&a, &b| history[a].1.total_cmp(&history[b].1)).unwrap();
    let [(_, a), (t, b), (u, c)] = [history[i - 1], history[i], history[i + 1]];
    let (slope, bend) = (0.5 * (c - a), a - 2.0 * b + c);
    (t - (u - t) * slope / bend, b - 0.5 * slope * slope / bend)
}

/// F04: spin-up past the first natural frequency with stiffening.
#[test]
fn published_spin_up_with_stiffening() {
    let expected = [(1, -0.578_260_374_3), (2, -0.573_549_386_1), (3, -0.574_442_751_3), (5, -0.574_379_798_6), (8, -0.574_371_527_0)];
    for (modes, expected) in expected {
        let history = tip_history(&Units::simo_vu_quoc(), stiffened("beam", stiffened_beam(modes)), 6.0, 10.0, 200.0);
        let (time, tip) = lowest(&history);
        println!("{modes} modes: {tip:.10} m at {time:.4} s, {:.1e} off", tip / expected - 1.0);
        // the bound of the list
        assert_close(&[tip], &[expected], 1e-6, &format!("{modes} modes"));
        assert!((time - 6.762).abs() < 0.02, "{time}");
    }
}

/// F04: without stiffening the same beam leaves, as its own equations say.
#[test]
fn published_spin_up_without_stiffening() {
    let history = tip_history(&Units::simo_vu_quoc(), flexible("beam", exact_beam(1)), 6.0, 20.0, 1.0);
    for (time, expected) in [(15, -8.079_705e10), (20, -9.866_524e20)] {
        // the list's bound: growth by 1e20 multiplies every early error
        assert_close(&[history[time].1], &[expected], 1e-4, &format!("tip at {time} s"));
    }
}

/// Uniform bar (rho A = E A = L = 1) along x that stretches, by Ritz modes of the shapes x, x^3, x^5: the first two hold the stretch of a spin.
fn stretching_bar() -> ModalBody {
    let power = |i: usize| 2.0 * i as f64 + 1.0;
    let mass = DMatrix::from_fn(3, 3, |i, j| 1.0 / (power(i) + power(j) + 1.0));
    let stiffness = DMatrix::from_fn(3, 3, |i, j| power(i) * power(j) / (power(i) + power(j) - 1.0));
    let factor = mass.cholesky().unwrap().l();
    let inverse = factor.solve_lower_triangular(&DMatrix::identity(3, 3)).unwrap();
    let eigen = (&inverse * stiffness * inverse.transpose()).symmetric_eigen();
    let basis = inverse.transpose() * &eigen.eigenvectors;
    let integral = |weight: f64| basis.tr_mul(&DVector::from_fn(3, |i, _| 1.0 / (power(i) + 1.0 + weight)));
    let (momentum, moment, tip) = (integral(0.0), integral(1.0), basis.tr_mul(&DVector::repeat(3, 1.0)));
    let mut bar = exact_beam(3);
    bar.frequency_hz = eigen.eigenvalues.iter().map(|x| x.sqrt() / TAU).collect();
    for j in 0..3 {
        bar.momentum[j] = Vector3::new(momentum[j], 0.0, 0.0);
        bar.first_moment[j] = Matrix3::from_diagonal(&Vector3::new(moment[j], 0.0, 0.0));
        bar.second_moment[4 * j] = Matrix3::from_diagonal(&Vector3::x());
        bar.interfaces[1].mode_shape[j] = Vector6::ith(3, tip[j]);
    }
    bar
}

/// F04: stretch of the tip at the full spin of 6 rad/s, `rho A W^2 L^3 / 3 E A` where the load is that of the undeformed bar. With exact inertia
/// the bar is pulled where it stands, `u'' + k^2 (x + u) = 0`, and gives `tan k - k` over k L.
#[test]
fn published_stretch_of_a_spinning_bar() {
    let second = (1.2 * 10.0_f64.powi(2) / 2.8e7).sqrt();
    let rate = 6.0 * second;
    let stretch = |order: InertiaOrder| {
        let mut beam = flexible("beam", stretching_bar());
        let BodyDefinitionKind::Flexible(definition) = &mut beam.kind else { unreachable!() };
        definition.order = order;
        let stiffness = spin_stiffness(&beam, Z, 0.0, rate);
        let (system, mut state) = spinning(beam, Z, 0.0, rate_at_start(rate));
        state.apply_prescribed(&system);
        let mut workspace = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        let eta = stiffness.cholesky().unwrap().solve(&DVector::from_column_slice(&workspace.acceleration.modal));
        10.0 * stretching_bar().interfaces[1].mode_shape.iter().zip(eta.iter()).map(|(shape, e)| shape[3] * e).sum::<f64>()
    };
    // the list's digits, 5.142857e-4 m, stand for 1.2 * 36 * 1000 / (3 * 2.8e7)
    let published = 1.2 * 36.0 * 1e3 / (3.0 * 2.8e7);
    // masses of x, x^3, x^5 have condition 2e3; stiffness and load are rounded in as many sums
    assert_close(&[stretch(InertiaOrder::Zeroth)], &[published], 1e-11, "load of the undeformed bar");
    // a fourth shape, x^7, would add 17 k^4 / 105 of it
    assert_close(&[stretch(InertiaOrder::Second)], &[10.0 * (rate.tan() / rate - 1.0)], 17.0 / 105.0 * rate.powi(4), "exact inertia");
}

/// F04: a spin that stays below the first natural frequency leaves both models bounded. The list's values are those of its second set of
/// parameters, Wu's and Haug's beam: stiffened and plain they give the same `E I / rho A`, 2807.1528 m^4/s^2, to 5e-9.
#[test]
fn published_slow_spin_up_with_and_without_stiffening() {
    let modal = stiffened_beam(8);
    let expected = [(stiffened("beam", modal.clone()), -0.280_244_877_9), (flexible("beam", modal), -0.343_159_962_2)];
    for (beam, expected) in expected {
        let (time, tip) = lowest(&tip_history(&Units::wu_haug(), beam, 2.0, 15.0, 200.0));
        println!("{tip:.10} m at {time:.4} s, {:.1e} off", tip / expected - 1.0);
        // the bound of the list
        assert_close(&[tip], &[expected], 1e-6, "slow spin-up");
    }
}

#[test]
fn motion_that_asks_for_unused_geometric_stiffness_is_told() {
    let told = |beam: BodyDefinition, rate: f64| {
        let (system, start) = spinning(beam, Y, 0.0, rate_at_start(rate));
        let mut gauge = StiffeningGauge::new(&system);
        run(&system, &start, dormand_prince(1e-6), 0.1, 10.0, |s| gauge.follow(s));
        gauge.warnings(&system)
    };
    // spin along the bending does not soften; 1.1933 rate^2 of 12.362 is 9.65 % at rate 1, and 0.1 % at a tenth of that
    let warnings = told(flexible("beam", stiffened_beam(1)), 1.0);
    assert!(warnings.len() == 1 && warnings[0].contains("mode 1 by 9.65"), "{warnings:?}");
    assert!(warnings[0].contains("set geometric_stiffness = true") && !warnings[0].contains("spin takes"), "{warnings:?}");
    assert!(told(flexible("beam", stiffened_beam(1)), 0.1).is_empty());
    assert!(told(stiffened("beam", stiffened_beam(1)), 1.0).is_empty());
}

/// A tumbling hub and boom with stiffening: energy and angular momentum of the whole.
#[test]
fn spinning_boom_on_a_free_hub_keeps_its_energy() {
    let bodies = vec![rigid("hub", 3.0, [0.1, 0.0, 0.2], [2.0, 1.5, 1.0]), stiffened("beam", stiffened_beam(4))];
    let hinges = vec![hinge("base", "free", &[], WORLD, "hub", [0.0; 3]), hinge("clamp", "fixed", &[], "hub", "beam", [0.3, 0.1, 0.0])];
    let (system, mut start) = Definition { bodies, hinges, ..Definition::default() }.build().unwrap();
    start.velocity = vec![0.5, 1.0, 5.0, 0.3, 0.2, -0.1];
    start.modal_position[0] = 0.02;
    let mut frames = vec![WorldFrame::default(); 2];
    let mut energies = Vec::new();
    let mut watch = Watch(|s: &pliant::integrate::Sample<'_>| {
        let (energy, momentum) = balance(s.system, s.state, s.workspace, &mut frames);
        energies.push((energy.total(), momentum.angular));
    });
    let settings = Settings { duration: 5.0, method: dormand_prince(1e-11), rate_hz: 10.0 };
    let mut observers: [&mut dyn Observer; 1] = [&mut watch];
    simulate(&system, &start, &settings, &mut observers);
    assert_eq!(energies.len(), 51);
    let (energy, momentum) = energies[0];
    // some thousand steps of 1e-11, whose errors add up at random
    for (e, h) in &energies {
        assert!((e / energy - 1.0).abs() < 1e-9 && (h - momentum).norm() < 1e-9 * momentum.norm(), "{e} of {energy}, {h} of {momentum}");
    }
}

/// Where modes carry nearly all inertia about a hinge, an energy of second order ends at small deflections: said, not divided by.
#[test]
fn deflection_beyond_geometric_stiffness_names_the_hinge() {
    let pin = hinge("pin", "revolute", &[Z], WORLD, "beam", [0.0; 3]);
    let (system, mut state) =
        Definition { bodies: vec![stiffened("beam", stiffened_beam(4))], hinges: vec![pin], ..Definition::default() }.build().unwrap();
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &state, &mut workspace).unwrap();
    state.modal_position[0] = 0.2;
    let error = forward_dynamics(&system, &state, &mut workspace).unwrap_err();
    assert!(matches!(error, DynamicsError::OverDeformed { .. }), "{error}");
    for word in ["\"pin\"", "\"beam\"", "rate 1", "geometric_stiffness"] {
        assert!(error.to_string().contains(word), "{error}");
    }
}

/// The aluminium boom of the modal files: its own matrices against the beam without depth.
#[cfg(feature = "hdf5")]
#[test]
fn boom_of_the_modal_files_stiffens_by_southwells_coefficients() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("modes/boom_cantilever.h5");
    let (_, boom) = pliant::io::ModalFile::load_body(&path).unwrap();
    let boom = stiffened("beam", boom);
    for (axis, family, coefficient) in [(Z, 0, 1.193_336), (Z, 1, 0.193_336), (Y, 0, 0.193_336), (Y, 1, 1.193_336)] {
        let squares = |rate| {
            let mut found: Vec<f64> = spin_stiffness(&boom, axis, 0.0, rate).symmetric_eigenvalues().iter().copied().collect();
            found.sort_by(f64::total_cmp);
            found
        };
        // first flap (along z) and first lag (along y): the two lowest; a spin of 2 rad/s shifts 23 and 34.5 rad/s in proportion to its
        // square within the square of what it adds, (0.1 / 2)^2
        let found = (squares(2.0)[family] - squares(0.0)[family]) / 4.0;
        println!("axis {axis:?}, family {family}: {found:.4}");
        // depth, shear and the clamped face: 1.195 and 0.195 where the beam has 1.1933 and 0.1933
        assert!((found - coefficient).abs() < 2.5e-3, "axis {axis:?}, family {family}: {found}");
    }
}
