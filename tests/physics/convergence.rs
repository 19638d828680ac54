//! Orders of the integrators and of their dense output, exact repetition, and an orderly end when a run blows up.

use crate::support::scenes::{Z, difference, dormand_prince, end_of, exact_beam, flexible, hinge, numbers, rigid, rk4, run, slopes};
use nalgebra::Vector3;
use pliant::integrate::simulate::Method;
use pliant::integrate::stability::stable_step;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::tableau::RK4;
use pliant::integrate::{Outcome, RunFailure, Settings, simulate};
use pliant::model::build::{BodyDefinitionKind, Definition, WORLD};
use pliant::model::time_function::Table;
use pliant::model::{State, System, TimeFunction};

/// A free hub with a beam of one mode on a hinge and a spherical tip body: every sort of coordinate, fastest vibration about 1 Hz.
fn craft(torque: Option<TimeFunction>) -> (System, State) {
    let mut beam = flexible("beam", exact_beam(1));
    if let BodyDefinitionKind::Flexible(f) = &mut beam.kind {
        (f.modal_position, f.modal_velocity) = (vec![0.1], vec![0.3]);
        f.damping_ratio = vec![0.02];
    }
    let mut base = hinge("base", "free", &[], WORLD, "hub", [0.0; 3]);
    base.velocity = vec![0.8, -0.5, 1.1, 0.2, 0.1, -0.3];
    let mut root = hinge("root", "revolute", &[Z], "hub", "beam", [0.3, 0.1, 0.0]);
    (root.position, root.velocity, root.stiffness) = (vec![0.4], vec![-0.6], vec![3.0]);
    root.torque = torque;
    let mut tip = hinge("tip", "spherical", &[], "beam", "dish", [0.1, 0.0, 0.0]);
    (tip.parent_node, tip.velocity) = (Some("tip".into()), vec![0.5, 1.5, -0.7]);
    let bodies = vec![rigid("hub", 4.0, [0.1, 0.0, 0.2], [1.0, 1.5, 1.2]), beam, rigid("dish", 0.5, [0.2, 0.1, 0.0], [0.05, 0.08, 0.1])];
    Definition { gravity: Vector3::new(0.0, 0.0, -1.0), bodies, hinges: vec![base, root, tip], loads: vec![], closures: vec![] }
        .build()
        .unwrap()
}

/// Dormand-Prince steps of one length after a short start: a tolerance that nothing exceeds.
const fn fixed_dormand_prince(step: f64) -> Method {
    Method::DormandPrince { tolerance: Tolerance { relative: 1e6, absolute: 1e6 }, largest_step: step }
}

/// Three halvings (s) from where the fastest vibration, the mode against the light dish, is well resolved.
const STEPS: [f64; 4] = [0.002, 0.001, 0.0005, 0.00025];

/// Root mean square, over ten times, of the errors against a run at the tightest tolerance.
fn end_errors(system: &System, start: &State, methods: &[Method], duration: f64) -> Vec<f64> {
    let samples = |method: Method| {
        let mut seen = Vec::new();
        run(system, start, method, duration, 10.0 / duration, |s| seen.push(numbers(s.state)));
        seen
    };
    let exact = samples(dormand_prince(1e-14));
    let error = |m: &Method| samples(*m).iter().zip(&exact).map(|(s, e)| difference(s, e).powi(2)).sum::<f64>().sqrt();
    methods.iter().map(error).collect()
}

#[test]
fn runge_kutta_4_has_order_4() {
    let (system, start) = craft(None);
    let errors = end_errors(&system, &start, &STEPS.map(rk4), 1.0);
    println!("rk4: {errors:?}, orders {:.3?}", slopes(&errors));
    assert!(slopes(&errors).iter().all(|s| (s - 4.0).abs() < 0.1), "orders {:?} of {errors:?}", slopes(&errors));
}

#[test]
fn dormand_prince_has_order_5_at_fixed_steps() {
    let (system, start) = craft(None);
    let errors = end_errors(&system, &start, &[0.008, 0.004, 0.002, 0.001].map(fixed_dormand_prince), 1.0);
    println!("dormand_prince: {errors:?}, orders {:.3?}", slopes(&errors));
    // the coefficients of h^5 are small by construction, so that h^6 shows first and slopes approach 5 from above
    assert!(slopes(&errors).iter().all(|s| *s > 4.8), "orders {:?} of {errors:?}", slopes(&errors));
}

#[test]
fn error_of_dormand_prince_is_proportional_to_the_tolerance() {
    let (system, start) = craft(None);
    let tolerances: Vec<f64> = (5..12).map(|k| 10.0_f64.powi(-k)).collect();
    let methods: Vec<_> = tolerances.iter().map(|t| dormand_prince(*t)).collect();
    let errors = end_errors(&system, &start, &methods, 2.0);
    println!("error over tolerance: {:.2?}", errors.iter().zip(&tolerances).map(|(e, t)| e / t).collect::<Vec<_>>());
    let slope = (errors[0] / errors[6]).log10() / 6.0;
    // local errors of order 5 are held, the kept solution is of that order too: global errors go as tolerance^(4/5..1)
    assert!((0.8..1.1).contains(&slope), "slope {slope} of {errors:?}");
}

/// Largest error over samples that fall between the steps.
fn sampled_errors(methods: &[Method]) -> Vec<f64> {
    let (system, start) = craft(None);
    let samples = |method: Method| {
        let mut seen = Vec::new();
        // 37 samples a second meet no step but the first and last
        run(&system, &start, method, 1.0, 37.0, |s| seen.push(numbers(s.state)));
        seen
    };
    // the reference's own dense output is exact because its steps end at the samples
    let mut exact = vec![numbers(&start)];
    exact.extend((1..=37).map(|i| numbers(&end_of(&system, &start, rk4(1.0 / 37.0 / 200.0), f64::from(i) / 37.0))));
    methods.iter().map(|m| samples(*m).iter().zip(&exact).map(|(s, e)| difference(s, e)).fold(0.0, f64::max)).collect()
}

#[test]
fn samples_between_steps_keep_the_order_of_the_dense_output() {
    // samples fall on other fractions of a step at each halving: single slopes scatter, their mean does not
    let mean = |errors: &[f64]| slopes(errors).iter().sum::<f64>() / 3.0;
    let errors = sampled_errors(&STEPS.map(rk4));
    println!("rk4, cubic Hermite: {errors:?}, orders {:.2?}", slopes(&errors));
    // the cubic's own error is of order 4, like the method's
    assert!((mean(&errors) - 4.0).abs() < 0.2, "orders {:?} of {errors:?}", slopes(&errors));
    let errors = sampled_errors(&[0.016, 0.008, 0.004, 0.002].map(fixed_dormand_prince));
    println!("dormand_prince, order 4: {errors:?}, orders {:.2?}", slopes(&errors));
    // an interpolant of order 4 errs by h^5 within a step
    assert!(mean(&errors) > 4.8, "orders {:?} of {errors:?}", slopes(&errors));
}

#[test]
fn a_kink_of_a_table_costs_no_order_because_steps_end_there() {
    let rows = [(0.0, vec![0.0]), (0.371_7, vec![2.0]), (0.611_3, vec![-1.0]), (2.0, vec![0.5])];
    let (system, start) = craft(Some(TimeFunction::Table(Table::new(&rows).unwrap())));
    let errors = end_errors(&system, &start, &STEPS.map(rk4), 1.0);
    println!("with kinks {errors:?}, orders {:.2?}", slopes(&errors));
    assert!(slopes(&errors).iter().all(|s| (s - 4.0).abs() < 0.1), "orders {:?} of {errors:?}", slopes(&errors));
    let mut times = Vec::new();
    run(&system, &start, rk4(0.01), 1.0, 1e3, |s| times.push(s.state.time));
    assert!(times.windows(2).all(|t| t[1] > t[0]) && times.len() == 1001, "every output time once, in order");
}

#[test]
fn quaternions_stay_of_unit_length_over_1e5_steps() {
    let (system, start) = craft(None);
    let end = end_of(&system, &start, rk4(1e-3), 100.0);
    for q in [&end.position[3..7], &end.position[8..12]] {
        let off = q.iter().map(|x| x * x).sum::<f64>().sqrt() - 1.0;
        // normalised in every step: one rounding of each entry
        assert!(off.abs() <= 4.0 * f64::EPSILON, "{off:e}");
    }
}

#[test]
fn the_same_run_twice_is_equal_to_the_bit() {
    let (system, start) = craft(None);
    for method in [rk4(0.01), dormand_prince(1e-6)] {
        let once = || {
            let mut seen = Vec::new();
            run(&system, &start, method, 2.0, 30.0, |s| {
                seen.extend(numbers(s.state).iter().chain(&s.workspace.acceleration.hinge).map(|x| x.to_bits()));
            });
            seen
        };
        assert!(once() == once());
    }
}

/// Hub on a hinge with a beam whose first mode has 100 Hz.
fn stiff(kind: &str) -> (System, State) {
    let mut modal = exact_beam(1);
    modal.frequency_hz = vec![100.0];
    let mut beam = flexible("boom", modal);
    if let BodyDefinitionKind::Flexible(f) = &mut beam.kind {
        f.modal_position = vec![0.01];
    }
    let axes: &[[f64; 3]] = if kind == "revolute" { &[Z] } else { &[] };
    let hinges = vec![hinge("base", kind, axes, WORLD, "bus", [0.0; 3]), hinge("root", "fixed", &[], "bus", "boom", [0.0; 3])];
    Definition { bodies: vec![rigid("bus", 5.0, [0.0; 3], [3.0; 3]), beam], hinges, ..Definition::default() }.build().unwrap()
}

#[test]
fn a_run_beyond_the_stable_step_ends_with_the_mode_that_blew_up() {
    for kind in ["fixed", "revolute", "free"] {
        let (system, start) = stiff(kind);
        for factor in [1.05, 3.0] {
            let method = rk4(factor * stable_step(&RK4, 100.0, 0.0));
            let summary = simulate(&system, &start, &Settings { duration: 1000.0, method, rate_hz: 1.0 }, &mut []);
            let Outcome::Failed(RunFailure::NotFinite { time, place, remedy }) = &summary.outcome else {
                panic!("{kind} base, {factor} x the stable step: {:?}", summary.outcome);
            };
            // a free bus without a hold is thrown about by the reaction, and may by then move faster than the mode
            let named = place == "mode 1 of body \"boom\"" || (kind == "free" && place.contains("hinge \"base\""));
            assert!(named, "{kind} base: {place}");
            assert!(*time > 0.0 && remedy.contains("smaller step"), "{kind} base: {remedy}");
        }
    }
}
