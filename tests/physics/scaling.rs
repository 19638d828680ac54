//! Cost of an evaluation against the number of bodies.

use crate::support::scenes::rods;
use pliant::dynamics::{Workspace, forward_dynamics};
use std::time::Instant;

/// Best time per body (s) of an evaluation of a chain; the best of several is the one that other processes disturbed least.
fn time_per_body(count: usize, repeats: usize) -> f64 {
    let (system, state) = rods(&vec![(1.0, 1.0); count]).build().unwrap();
    let mut workspace = Workspace::new(&system);
    forward_dynamics(&system, &state, &mut workspace).unwrap();
    let once = || {
        let start = Instant::now();
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        start.elapsed().as_secs_f64() / count as f64
    };
    std::iter::repeat_with(once).take(repeats).fold(f64::INFINITY, f64::min)
}

#[test]
fn cost_of_an_evaluation_grows_linearly_with_the_bodies() {
    // the longer chain leaves the caches, which costs up to a factor of two, and a busy machine another; quadratic growth would be ten
    let ratios = (0..5).map(|_| (time_per_body(1_000, 30), time_per_body(10_000, 10)));
    let (short, long) = ratios.min_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0))).unwrap();
    println!("{:.0} ns per body of 1e3, {:.0} ns per body of 1e4", short * 1e9, long * 1e9);
    assert!(long / short < 4.0, "{short:e} s per body of 1e3, {long:e} s of 1e4");
}
