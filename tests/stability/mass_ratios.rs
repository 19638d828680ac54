//! Mass ratios from 1e-12 to 1e12 (S01, S02): no digits are lost, whatever carries what.

use crate::row::{EPS, Row, assert_rows, componentwise};
use crate::support::scenes::{difference, rods};
use nalgebra::Vector3;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::model::build::Frame;
use pliant::spatial::rotation;

/// Accelerations of rods at angles `q` and rates `v`, repeated along the chain.
fn accelerations(sizes: &[(f64, f64)], q: &[f64], v: &[f64]) -> Vec<f64> {
    let mut definition = rods(sizes);
    for (h, (q, v)) in definition.hinges.iter_mut().zip(q.iter().cycle().zip(v.iter().cycle())) {
        (h.position, h.velocity) = (vec![*q], vec![*v]);
    }
    let (system, state) = definition.build().unwrap();
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &state, &mut workspace).unwrap();
    workspace.acceleration.hinge
}

/// S01: computed in high precision.
#[test]
fn mass_ratios_of_two_rods_cost_no_digits() {
    let published = [
        (1e-12, [-14.057_776_437_478_253, 21.993_617_092_110_259]),
        (1.0, [-12.179_740_920_479_657, 17.960_980_386_182_921]),
        (1e12, [-11.064_376_829_362_934, 15.566_000_028_463_763]),
    ];
    let row = |(ratio, expected): (f64, [f64; 2])| {
        let found = accelerations(&[(1.0, 1.0), (ratio, 1.0)], &[0.3, 0.7], &[0.5, -0.2]);
        let quantity = format!("two rods of mass ratio {ratio:.0e}: accelerations, each");
        Row::at_most("S01", quantity, componentwise(&found, &expected), 50.0 * EPS, "50 eps")
    };
    assert_rows(&published.map(row));
}

/// S02: ten rods whose dense mass matrix has condition 1e14, at angles of 0, 0.1, ... 0.9 rad and rates of 0.05, 0.1, ... 0.5 rad/s. The first
/// acceleration at 1e-12 is the list's, whose pose this is; the others are computed in 60 digits by elimination of the planar equations of
/// motion in absolute angles.
#[test]
fn alternating_masses_cost_no_digits() {
    let computed = [
        (1e-12, [-14.062_209_548_982_524, 18.856_480_305_225_623, -4.121_021_241_662_933_4]),
        (1e12, [-9.811_226_065_796_383_1, 10.786_086_703_001_498, -1.372_988_415_920_437]),
    ];
    let (q, v): (Vec<_>, Vec<_>) = (0..10).map(|i| (0.1 * f64::from(i), 0.05 * f64::from(i + 1))).unzip();
    let row = |(ratio, expected): (f64, [f64; 3])| {
        let sizes: Vec<_> = (0..10).map(|i| (if i % 2 == 0 { 1.0 } else { ratio }, 1.0)).collect();
        let found = accelerations(&sizes, &q, &v);
        let quantity = format!("ten rods of masses 1, {ratio:.0e}, 1, ...: accelerations");
        Row::at_most("S02", quantity, difference(&found[..3], &expected), 1e-12, "")
    };
    assert_rows(&computed.map(row));
}

/// S02: twelve rods, each `s` times longer and s^3 times heavier than the one before, at rest; computed in 60 and 120 digits. The problem
/// itself is well conditioned, and Cholesky's method on its mass matrix fails.
#[test]
fn links_that_grow_outward_cost_no_digits() {
    let computed = [
        (2.0, 0.2, vec![-18.582_605_826_515_044]),
        (10.0, 0.2, vec![-19.224_095_854_360_822]),
        (2.0, 0.0, vec![-10.369_165_407_304_377, 10.664_684_194_173_991]),
        (10.0, 0.0, vec![-9.814_901_323_089_144_5, 9.815_391_700_280_505_7]),
        (2.0, 0.3, vec![-18.122_297_355_857_493, 22.487_453_214_773_831]),
        (10.0, 0.3, vec![-18.739_013_399_970_525, 19.719_118_291_874_28]),
    ];
    let row = |(s, angle, expected): (f64, f64, Vec<f64>)| {
        let sizes: Vec<_> = (0..12).map(|i| s.powi(i)).map(|l| (l.powi(3), l)).collect();
        let found = accelerations(&sizes, &[angle], &[0.0]);
        let quantity = format!("twelve rods, each {s} times longer and {} times heavier, at {angle} rad: accelerations", s.powi(3));
        Row::at_most("S02", quantity, difference(&found[..expected.len()], &expected), 1e-12, "")
    };
    assert_rows(&computed.map(row));
}

/// The same chain with hinge frames turned at random, so that no axis of any frame is one of the plane.
#[test]
fn growing_links_cost_no_digits_in_frames_of_any_attitude() {
    let mut definition = rods(&(0..12).map(|i| 2.0_f64.powi(i)).map(|l| (l.powi(3), l)).collect::<Vec<_>>());
    for (i, h) in definition.hinges.iter_mut().enumerate() {
        let turn = rotation::quaternion_of_vector(&Vector3::new((i as f64).sin(), 0.7 - 0.1 * i as f64, (2.0 * i as f64).cos()));
        // the same turn on both sides, with the axis seen from there
        let axes = rotation::matrix_of_quaternion(&turn);
        h.position = vec![0.2];
        h.axes = vec![axes.tr_mul(&Vector3::z())];
        h.parent_frame = Frame { quaternion: turn, ..h.parent_frame };
        h.child_frame = Frame { quaternion: turn, ..h.child_frame };
    }
    let (system, state) = definition.build().unwrap();
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &state, &mut workspace).unwrap();
    let off = difference(&workspace.acceleration.hinge[..1], &[-18.582_605_826_515_044]);
    assert!(hinge_load(&workspace, 0).iter().all(|x| x.is_finite()));
    assert_rows(&[Row::at_most("S02", "the same of ratio 2, frames turned at random: accelerations", off, 1e-12, "")]);
}
