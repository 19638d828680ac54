//! Every example runs, and one number of it is known from elsewhere.
#![cfg(feature = "hdf5")]

use nalgebra::Vector6;
use pliant::dynamics::energy::balance;
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::world::{WorldFrame, world_frames};
use pliant::integrate::{Flow, Observer, Outcome, Sample, Settings, simulate};
use pliant::output::Evaluation;
use pliant::scene::error::Source;
use pliant::scene::{Overrides, Scene, assemble};
use std::path::Path;

fn example(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name);
    assemble::load(&path, &Overrides::default()).unwrap()
}

/// Last sample and the largest loads, by body index.
#[derive(Default)]
struct Record {
    loads: Vec<Vector6<f64>>,
    peak_moment: Vec<f64>,
    history: Vec<Vector6<f64>>,
    watched: usize,
    frames: Vec<WorldFrame>,
    strain: f64,
    position: Vec<f64>,
}

impl Observer for Record {
    fn observe(&mut self, sample: &Sample<'_>) -> Flow {
        let count = sample.system.bodies.len();
        self.loads = (0..count).map(|k| hinge_load(sample.workspace, k)).collect();
        self.peak_moment.resize(count, 0.0);
        for (peak, load) in self.peak_moment.iter_mut().zip(&self.loads) {
            *peak = peak.max(load.fixed_rows::<3>(0).norm());
        }
        self.history.push(self.loads[self.watched]);
        self.frames = vec![WorldFrame::default(); count];
        world_frames(sample.system, &sample.workspace.pose, &mut self.frames);
        self.strain = balance(sample.system, sample.state, sample.workspace, &mut self.frames.clone()).0.strain;
        self.position.clone_from(&sample.state.position);
        Flow::Continue
    }
}

fn run(scene: &Scene) -> Record {
    let mut record = Record::default();
    let settings = Settings { duration: scene.duration.unwrap(), method: scene.method, rate_hz: scene.rate_hz };
    let summary = simulate(&scene.system, &scene.state, &settings, &mut [&mut record]);
    assert_eq!(summary.outcome, Outcome::Completed);
    record
}

#[test]
fn double_pendulum_stands_where_the_high_precision_solution_does() {
    let record = run(&example("01_double_pendulum/scene.toml"));
    // angles from straight down at t = 2 s, integrated with 29 digits (reference problem R03)
    let expected = [-0.482_971_534_251_754_4, -1.324_048_712_302_362_6];
    let quarter = std::f64::consts::FRAC_PI_2;
    let found = [record.position[0] + quarter, record.position[0] + record.position[1] + quarter];
    for (f, e) in found.iter().zip(expected) {
        // relative tolerance 1e-12 per step over some hundred steps
        assert!((f - e).abs() < 1e-9, "{found:?}");
    }
}

#[test]
fn hub_settles_where_the_centre_of_mass_demands() {
    let scene = example("02_hub_two_panels/scene.toml");
    let record = run(&scene);
    let hub = scene.system.body_index("hub").unwrap();
    // the panels' centres, 1 m from their drives, rise by sin 60 deg; nothing outside acts, so the hub sinks
    let (panels, hub_mass) = (2.0 * 10.0, 400.0);
    let expected = -panels * 1.0 * (60.0_f64.to_radians()).sin() / (hub_mass + panels);
    // what still vibrates moves the hub by at most sqrt(2 E / (m_p omega_1^2)) m_p / M
    let omega = std::f64::consts::TAU * 1.8;
    let still_moving = (2.0 * record.strain / (panels * omega * omega)).sqrt() * panels / (hub_mass + panels);
    let found = record.frames[hub].position.z;
    assert!((found - expected).abs() < 2.0 * still_moving + 1e-6 * expected.abs(), "{found} {expected} {still_moving:e}");
    assert!(still_moving < 1e-3 * expected.abs());
    let drive = scene.system.hinge_index("drive_left").unwrap();
    // rigid panel: J alpha = 10 kg (4/3 m^2 + ...) x 60 deg x 5.77 / (8 s)^2, and the modes add to it
    let rigid = 10.0 * 4.0 / 3.0 * 60.0_f64.to_radians() * 5.7735 / 64.0;
    assert!(record.peak_moment[drive] > 0.9 * rigid && record.peak_moment[drive] < 1.5 * rigid, "{} {rigid}", record.peak_moment[drive]);
}

#[test]
fn boom_root_carries_the_moment_of_the_tip_force() {
    let scene = example("03_boom_tip_mass/scene.toml");
    let record = run(&scene);
    let root = scene.system.hinge_index("root").unwrap();
    // statics: 10 N at 3 m; what still vibrates is below 1e-4 after 18 s at zeta = 0.05 and 2 Hz
    assert!((record.loads[root][1] - 30.0).abs() < 30.0 * 1e-4, "{}", record.loads[root]);
    assert!((record.loads[root][5] + 10.0).abs() < 10.0 * 1e-4, "{}", record.loads[root]);
    // tip deflection F L^3 / 3 E I of the beam: 70 GPa, 60 x 40 mm; modal file is within 0.4 % of beam theory
    let expected = 10.0 * 27.0 / (3.0 * 70e9 * 0.06 * 0.04_f64.powi(3) / 12.0);
    let tip = scene.system.body_index("instrument").unwrap();
    assert!((record.frames[tip].position.z / expected - 1.0).abs() < 5e-3, "{} {expected}", record.frames[tip].position.z);
}

#[test]
fn wing_root_carries_the_moment_of_the_force_at_its_end() {
    let scene = example("04_three_panels/scene.toml");
    let record = run(&scene);
    let root = scene.system.hinge_index("root").unwrap();
    // statics: 0.1 N at 6 m; the load grows over some six periods of the wing (about 5 s), twice differentiable, so what it leaves
    // vibrating is of the order (period / rise)^3
    let allowed = (5.0_f64 / 30.0).powi(3);
    assert!((record.loads[root][1] - 0.6).abs() < allowed * 0.6, "{}", record.loads[root]);
    assert!((record.loads[root][5] + 0.1).abs() < allowed * 0.1, "{}", record.loads[root]);
}

#[test]
fn free_free_and_cantilever_modes_give_the_same_root_loads() {
    let histories: Vec<_> = ["cantilever", "free_free"].map(|v| run(&example(&format!("05_free_free/{v}.toml"))).history).into();
    let size = histories[0].iter().fold(0.0_f64, |m, l| m.max(l.amax()));
    let difference = histories[0].iter().zip(&histories[1]).fold(0.0_f64, |m, (a, b)| m.max((a - b).amax()));
    // frequencies of the held free-free set are within 3e-7 of the cantilever's for the modes that move here; what is left is the
    // quasi-static share of the modes above the tenth, which the two sets truncate differently
    if difference >= 1e-3 * size {
        for (i, (a, b)) in histories[0].iter().zip(&histories[1]).enumerate().step_by(20) {
            eprintln!("{i} {:?} {:?}", a.as_slice(), b.as_slice());
        }
    }
    assert!(difference < 1e-3 * size, "{:e} of {size}", difference / size);
}

#[test]
fn four_bar_starts_with_the_accelerations_of_the_closed_solution_and_stays_closed() {
    let scene = example("06_four_bar/scene.toml");
    let evaluation = Evaluation::of(&scene.system, &scene.state).unwrap();
    // angular accelerations of crank, coupler and rocker, solved with 30 digits (reference problem C09)
    let rate = |name: &str| evaluation.hinges.get(name).unwrap().acceleration[0];
    let found = [rate("crank_foot"), rate("crank_foot") + rate("crank_pin"), rate("rocker_foot")];
    for (f, e) in found.iter().zip([-9.856_158_991_543_052, 2.990_203_058_289_293, 0.062_798_651_029_610_68]) {
        assert!((f - e).abs() < 1e-11, "{found:?}");
    }
    let end = run(&scene);
    assert!(end.position.iter().all(|x| x.is_finite()));
}

#[test]
fn the_scene_of_the_readme_is_accepted_and_runs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let text = readme.split("```toml\n").nth(1).and_then(|t| t.split("```").next()).unwrap().to_owned();
    let scene = assemble::assemble(Source { path: root.join("README.toml"), text }, &Overrides::default()).unwrap();
    let record = run(&scene);
    assert!(record.position.iter().all(|x| x.is_finite()));
}
