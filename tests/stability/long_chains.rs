//! Chains of 10,000 and 100,000 bodies (S07): no recursion on the call stack, linear time, accelerations to rounding.

use crate::row::{EPS, Row, assert_rows, componentwise};
use crate::support::scenes::{difference, rods};
use cpu_time::ThreadTime;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, accelerations, forward_dynamics};
use pliant::model::{State, System};

/// `m g / (2 sqrt 3)`: what the first hinge of a long chain of uniform rods carries, in a horizontal line at rest (R02).
const FIRST_FORCE: f64 = 2.831_903_070_375_114_374_9;

fn chain(count: usize) -> (System, State) {
    rods(&vec![(1.0, 1.0); count]).build().unwrap()
}

/// Relative accelerations of that chain. Hinge forces follow `V_(i-1) + 4 V_i + V_(i+1) = 0`, so each is `sqrt 3 - 2` times the one before,
/// and rod i turns by `-6 (V_i + V_(i+1)) / m l`; the far end is `(2 - sqrt 3)^N` away.
fn relative_accelerations(count: usize) -> Vec<f64> {
    let ratio = 3.0_f64.sqrt() - 2.0;
    let turns = std::iter::successors(Some(-6.0 * FIRST_FORCE * (1.0 + ratio)), |turn| Some(turn * ratio));
    let mut before = 0.0;
    let relative = turns.map(|turn| turn - std::mem::replace(&mut before, turn));
    relative.take(count).collect()
}

/// By the sweeps, which name what is wrong and leave everything, and by the kernel, which a run calls.
#[test]
fn chains_of_a_hundred_thousand_bodies_are_solved_to_rounding() {
    let (system, state) = chain(100_000);
    let expected = relative_accelerations(100_000);
    let mut rows = Vec::new();
    for (name, evaluate) in [("sweeps", forward_dynamics as fn(&_, &_, &mut _) -> _), ("kernel", accelerations)] {
        let mut workspace = Workspace::new(&system);
        evaluate(&system, &state, &mut workspace).unwrap();
        assert_eq!(workspace.is_by_kernel(), name == "kernel");
        let force = componentwise(&[hinge_load(&workspace, 0)[4]], &[FIRST_FORCE]);
        let off = difference(&workspace.acceleration.hinge, &expected);
        rows.push(Row::at_most("S07", format!("chain of 100,000 rods, {name}: force at the first hinge"), force, 1e-13, ""));
        rows.push(Row::at_most("S07", format!("the same, {name}: all accelerations"), off, 20.0 * 1e5 * EPS, "20 N eps"));
    }
    assert_rows(&rows);
}

/// CPU time (s) of this thread: what other processes do does not count, though they share the caches.
fn time(chain: &(System, State), workspace: &mut Workspace) -> f64 {
    let begin = ThreadTime::now();
    accelerations(&chain.0, &chain.1, workspace).unwrap();
    begin.elapsed().as_secs_f64()
}

#[test]
fn chains_of_a_hundred_thousand_bodies_are_solved_in_linear_time() {
    let (short, long) = (chain(10_000), chain(100_000));
    let mut rows = Vec::new();
    // the list's bound; with loads a body moves 2 kB, which 10,000 of them move inside the caches and 100,000 (58 MB of records) beyond
    let bounds = [(false, 13.0, "linear: 10"), (true, 16.0, "linear: 10, and records that leave the caches")];
    for (with_loads, bound, reason) in bounds {
        let what = if with_loads { "accelerations and hinge loads" } else { "accelerations" };
        let room = |c: &(System, State)| if with_loads { Workspace::new(&c.0) } else { Workspace::without_loads(&c.0) };
        let (mut of_short, mut of_long) = (room(&short), room(&long));
        // the least of several is the one that others disturbed least; in turns, so that both meet the same machine
        let (mut least_short, mut least_long) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..40 {
            least_short = (0..5).map(|_| time(&short, &mut of_short)).fold(least_short, f64::min);
            least_long = least_long.min(time(&long, &mut of_long));
        }
        println!("{what}: {:.1} ns per body of 1e4, {:.1} of 1e5", least_short * 1e5, least_long * 1e4);
        rows.push(Row::at_most("S07", format!("chain of 100,000 rods, {what}: one evaluation (s)"), least_long, 1.0, ""));
        rows.push(Row::at_most("S07", "the same: time over that of 10,000 rods", least_long / least_short, bound, reason));
    }
    assert_rows(&rows);
}
