//! The hot paths, for counting their instructions (`scripts/count_instructions.py`): only what happens inside [`measured`] counts.

use crate::panels::{Chain, Panel};
use crate::protocol::Case;
use crate::rigid::Rigid;
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use pliant::scene::{Overrides, Scene, assemble};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Links of the rigid chain and tree.
const LINKS: usize = 64;
/// Panels of the flexible chain.
const PANELS: usize = 4;

/// What is counted: its name is known to the script.
#[inline(never)]
fn measured(work: &mut dyn FnMut() -> Result<(), Box<dyn Error>>) -> Result<(), Box<dyn Error>> {
    work()?;
    // without it the call could become a jump out of this function
    std::hint::black_box(());
    Ok(())
}

/// Does the work of `case` that many times: evaluations, or steps of a run.
///
/// # Errors
/// If there is no such case, or its work fails.
pub fn run(case: &str, times: u32) -> Result<(), Box<dyn Error>> {
    let panel = || Panel::read(&root().join("modes/panel_craig_bampton.h5"), "outboard");
    match case {
        "rigid_chain" => evaluations(Rigid::build("chain", LINKS)?.ok_or("no chain")?, "fd", times),
        "rigid_chain_loads" => evaluations(Rigid::build("chain", LINKS)?.ok_or("no chain")?, "fdf", times),
        "rigid_tree" => evaluations(Rigid::build("tree", LINKS / 4)?.ok_or("no tree")?, "fd", times),
        "flexible_order_0" => evaluations(Chain::of(&panel()?, PANELS)?, "order0", times),
        "flexible_order_2" => evaluations(Chain::of(&panel()?, PANELS)?, "order2", times),
        "loop_cut" => loop_evaluations("tree_augmented", times),
        "loop_embedded" => loop_evaluations("constraint_embedding", times),
        "step_explicit" => steps("dormand_prince", times),
        "step_implicit" => steps("rosenbrock_w", times),
        _ => Err(format!("no case \"{case}\"").into()),
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

fn evaluations(mut case: impl Case, op: &str, times: u32) -> Result<(), Box<dyn Error>> {
    // the first evaluation may set things up
    case.call(op, 0)?;
    measured(&mut || (0..times).try_for_each(|call| case.call(op, call & 7).map(|_| ())))
}

fn example(name: &str, overrides: Overrides) -> Result<Scene, Box<dyn Error>> {
    Ok(assemble::load(&root().join("examples").join(name).join("scene.toml"), &overrides)?)
}

fn loop_evaluations(closure_method: &str, times: u32) -> Result<(), Box<dyn Error>> {
    let scene = example("06_four_bar", Overrides { closure_method: Some(closure_method.into()), ..Overrides::default() })?;
    let mut workspace = Workspace::new(&scene.system);
    forward_dynamics(&scene.system, &scene.state, &mut workspace)?;
    measured(&mut || (0..times).try_for_each(|_| Ok(forward_dynamics(&scene.system, &scene.state, &mut workspace)?)))
}

/// Ends a run after a number of steps.
struct Steps(u64);

impl Observer for Steps {
    fn observe(&mut self, _sample: &Sample<'_>) -> Flow {
        Flow::Continue
    }

    fn step(&mut self, step: &Sample<'_>) -> Flow {
        if step.steps >= self.0 { Flow::Stop } else { Flow::Continue }
    }
}

/// Steps of the default example with the evaluations of its output times; nothing is written.
fn steps(integrator: &str, times: u32) -> Result<(), Box<dyn Error>> {
    let scene = example("02_hub_two_panels", Overrides { integrator: Some(integrator.into()), ..Overrides::default() })?;
    let settings = Settings { duration: scene.duration.ok_or("a scene without duration")?, method: scene.method, rate_hz: scene.rate_hz };
    measured(&mut || {
        let summary = simulate(&scene.system, &scene.state, &settings, &mut [&mut Steps(u64::from(times))]);
        if summary.outcome == Outcome::Stopped { Ok(()) } else { Err(format!("the run did not take {times} steps").into()) }
    })
}
