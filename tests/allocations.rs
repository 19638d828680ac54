//! An evaluation and a step allocate nothing: counted by the allocator itself, in a binary of its own so that nothing else counts.

mod support;

use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::integrate::chart::Chart;
use pliant::integrate::step_control::Tolerance;
use pliant::integrate::w_tableau::ROS34PW2;
use pliant::integrate::{RosenbrockW, Stepper};
use pliant::model::modal_body::Boundary;
use std::alloc::{GlobalAlloc, Layout, System as SystemAllocator};
use std::cell::Cell;
use support::loops::{METHODS, held_by, random_loops};
use support::trees::{KINDS, Recipe, random_tree};

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on unchanged; the counter is a plain cell without a destructor
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { SystemAllocator.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { SystemAllocator.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { SystemAllocator.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count(work: impl FnOnce()) -> usize {
    let before = COUNT.with(Cell::get);
    work();
    COUNT.with(Cell::get) - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(count(|| drop(std::hint::black_box(vec![1.0; 100]))), 1);
}

#[test]
fn evaluations_and_hinge_loads_allocate_nothing() {
    let boundaries = [None, Some(Boundary::Cantilever), Some(Boundary::FreeFree), Some(Boundary::General)];
    for (i, (base, _, _)) in KINDS.iter().enumerate() {
        for (j, boundary) in boundaries.into_iter().enumerate() {
            let second_order = (i % 2 == 0).then_some(0.05);
            let recipe = Recipe { bodies: 12, base: Some(base), boundary, prescribed: 0.2, second_order, ..Recipe::default() };
            let (system, mut state) = random_tree((i * 10 + j) as u64, &recipe).build().unwrap();
            let mut workspace = Workspace::new(&system);
            let mut evaluate = || {
                state.time += 0.01;
                state.apply_prescribed(&system);
                forward_dynamics(&system, &state, &mut workspace).unwrap();
                (0..system.bodies.len()).for_each(|k| assert!(hinge_load(&workspace, k)[0].is_finite()));
            };
            evaluate();
            let allocations = count(|| (0..3).for_each(|_| evaluate()));
            assert_eq!(allocations, 0, "base {base}, boundary {boundary:?}");
        }
    }
}

#[test]
fn steps_of_the_linearly_implicit_method_allocate_nothing() {
    let recipe = Recipe { bodies: 12, prescribed: 0.2, ..Recipe::default() };
    let by_kernel = Recipe { flexible: 0.0, ..recipe };
    for (seed, recipe) in (0..5).flat_map(|seed| [(seed, &recipe), (seed, &by_kernel)]) {
        let (system, mut start) = random_tree(seed, recipe).build().unwrap();
        start.apply_prescribed(&system);
        let mut chart = Chart::new(&system, &start);
        let mut stepper = RosenbrockW::new(ROS34PW2, Tolerance { relative: 1e-3, absolute: 1e-3 }, &chart);
        stepper.restart(&mut chart).unwrap();
        let mut step = || {
            stepper.attempt(&mut chart, 1e-4).unwrap();
            stepper.accept(&mut chart);
        };
        step();
        // a move of the base to the next chart keeps its vectors
        let allocations = count(|| (0..3).for_each(|_| step()));
        assert_eq!(allocations, 0, "seed {seed}");
    }
}

#[test]
fn evaluations_with_closures_allocate_nothing() {
    for (seed, method) in (0..20).flat_map(|seed| METHODS.map(|method| (seed, method))) {
        let definition = held_by(method, random_loops(seed, &Recipe { bodies: 12, ..Recipe::default() }, 2));
        let (system, mut state) = definition.build().unwrap();
        let mut workspace = Workspace::new(&system);
        // closures that contradict one another are refused, and by a message that allocates
        if forward_dynamics(&system, &state, &mut workspace).is_err() {
            continue;
        }
        let mut evaluate = || {
            state.modal_position.iter_mut().for_each(|eta| *eta += 1e-6);
            workspace.close_aggregates(&system, &mut state).unwrap();
            forward_dynamics(&system, &state, &mut workspace).unwrap();
        };
        let allocations = count(|| (0..3).for_each(|_| evaluate()));
        assert_eq!(allocations, 0, "{method}, seed {seed}");
    }
}
