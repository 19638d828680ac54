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
    example_by("auto", name)
}

/// The example with its closures held by `method`.
fn example_by(method: &str, name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name);
    assemble::load(&path, &Overrides { closure_method: Some(method.to_owned()), ..Overrides::default() }).unwrap()
}

/// Both methods for closures.
const METHODS: [&str; 2] = ["tree_augmented", "constraint_embedding"];

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
    for method in METHODS {
        let scene = example_by(method, "06_four_bar/scene.toml");
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
}

#[test]
fn bricard_linkage_falls_to_where_the_independent_program_has_it() {
    for method in METHODS {
        let scene = example_by(method, "07_bricard/scene.toml");
        let record = run(&scene);
        // P3 is the origin of rod_3; reference problem C04, whose energy holds to 1e-10
        let found = record.frames[scene.system.body_index("rod_3").unwrap()].position;
        for (f, e) in found.iter().zip([0.510_501_46, -1.649_167_60, 0.140_123_11]) {
            assert!((f - e).abs() < 1e-6, "{found:?}");
        }
    }
}

#[test]
fn squeezing_mechanism_ends_at_the_angles_of_the_ivp_test_set() {
    for method in METHODS {
        let scene = example_by(method, "08_squeezing_mechanism/scene.toml");
        let record = run(&scene);
        let at = |name: &str| record.position[scene.system.bodies[scene.system.hinge_index(name).unwrap()].position];
        let gamma = at("spring_foot") + at("spring_head");
        let found = [at("beta"), at("Theta"), gamma, at("Phi"), at("delta"), at("Omega"), at("epsilon")];
        // reference problem C02, 14 digits of which agree between two runs of a program of higher precision
        let expected = [
            15.810_771_195_153_707,
            -15.756_371_058_411_839,
            0.040_822_240_119_645_8,
            -0.534_730_116_342_079_6,
            0.524_409_965_879_954_1,
            0.534_730_116_342_079_6,
            1.048_080_741_041_938,
        ];
        for (f, e) in found.iter().zip(expected) {
            // eight digits of each are the test set's measure of a good run; local errors of 1e-10 leave more
            assert!((f / e - 1.0).abs() < 1e-8, "{found:?}");
        }
    }
}

#[test]
fn flexible_slider_crank_turns_the_pull_of_its_slider_into_torque_by_statics() {
    for method in METHODS {
        let scene = example_by(method, "09_slider_crank_flexible/scene.toml");
        let record = run(&scene);
        let (crank, pin) = (scene.system.hinge_index("crank").unwrap(), scene.system.hinge_index("crank_pin").unwrap());
        let (pull, radius, length): (f64, f64, f64) = (5000.0, 1.0, 3.0);
        // the crank stands upright and moves the slider by its own length per radian, whatever the rod's length: torque is force times radius
        let torque = record.loads[crank][1];
        println!("torque {torque}");
        // the quarter turn takes fifty periods of the rod held by two pins (10 Hz): what it leaves vibrating is below 1e-4
        assert!((-torque / (pull * radius) - 1.0).abs() < 1e-4, "{torque}");
        let slope = (radius / length).asin();
        let along = record.loads[pin].fixed_rows::<3>(3).norm();
        assert!((along / (pull / slope.cos()) - 1.0).abs() < 1e-4, "{along}");
        // the rod stretches by N L / E A of the boom, 70 GPa, 60 x 40 mm; the clamped root's restraint of contraction takes 0.1 %
        let stretch = pull / slope.cos() * length / (70e9 * 0.06 * 0.04);
        let rigid = (length * length - radius * radius).sqrt();
        let slider = record.frames[scene.system.body_index("slider").unwrap()].position.x;
        let expected = stretch / slope.cos();
        println!("slider {} beyond the rigid one, expected {expected}", slider - rigid);
        assert!(((slider - rigid) / expected - 1.0).abs() < 5e-3, "{} {expected}", slider - rigid);
    }
}

#[test]
fn synchronised_panels_share_the_moment_of_the_force_at_their_end_by_statics() {
    for method in METHODS {
        let scene = example_by(method, "10_synchronised_panels/scene.toml");
        let record = run(&scene);
        let load = |name: &str| record.loads[scene.system.hinge_index(name).unwrap()];
        // 1 N at the end of 1 m of yoke and 2 m each of panels; the rod's line passes 0.12 m above the hinge lines
        let (force, yoke, panel, lever) = (1.0, 1.0, 2.0, 0.12);
        let rod = force * panel / lever;
        let expected = [
            (load("drive")[1], force * (yoke + 2.0 * panel), "drive"),
            (load("rod_foot")[3], rod, "rod"),
            // what the cable adds to the hinge of the first panel: the rod has taken its part
            (load("panel_1_line")[1], force * 2.0 * panel - rod * lever, "cable"),
            (load("panel_1_line")[3], -rod, "hinge line of the first panel"),
        ];
        for (found, expected, what) in expected {
            println!("{what}: {found} of {expected}");
            // the wing (some 4 s per period) still swings by the cube of period over rise, and is bent by 1e-3 rad
            assert!((found / expected - 1.0).abs() < 3e-3, "{what}: {found}, expected {expected}");
        }
        // the parallelogram keeps the second panel parallel to the yoke, but for what bending shortens the first panel's chord
        let turned = record.frames[scene.system.body_index("panel_2").unwrap()].rotation.column(0).z;
        println!("panel_2 turned by {turned}");
        assert!(turned.abs() < 1e-4, "{turned}");
    }
}

#[test]
fn scenes_of_the_readme_are_accepted_and_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let block = |i: usize| readme.split("```toml\n").nth(i).and_then(|t| t.split("```").next()).unwrap().to_owned();
    // alone, and with the rod that closes a loop; the gear is one of the synchronised panels
    for text in [block(1), format!("{}\n{}", block(1), block(2))] {
        let scene = assemble::assemble(Source { path: root.join("README.toml"), text }, &Overrides::default()).unwrap();
        let record = run(&scene);
        assert!(record.position.iter().all(|x| x.is_finite()));
    }
    let panels = std::fs::read_to_string(root.join("examples/10_synchronised_panels/scene.toml")).unwrap();
    for line in ["hinge_a = \"drive\"", "hinge_b = \"panel_1_line\"", "ratio = -2.0"] {
        assert!(block(3).contains(line) && panels.contains(line), "{line}");
    }
}
