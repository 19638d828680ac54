//! Rigid trees with known answers. The labels (R01, ...) are those of the project's list of reference problems; "closed form" values
//! were evaluated there in 30 digits, "computed" ones by an independent program in high precision.

use crate::support::assert_close;
use crate::support::scenes::{G, Z, beads, dormand_prince, end_of, hinge, rigid, rk4, rods, slopes};
use nalgebra::{DMatrix, Vector3};
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::inverse::NewtonEuler;
use pliant::dynamics::sweep::{force_inward, pose_outward};
use pliant::dynamics::world::{WorldFrame, world_frames};
use pliant::dynamics::{Workspace, dense, forward_dynamics};
use pliant::model::build::{Definition, WORLD};
use pliant::model::{State, System, TimeFunction};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

fn evaluated(system: &System, state: &State) -> Workspace {
    let mut workspace = Workspace::new(system);
    forward_dynamics(system, state, &mut workspace).unwrap();
    workspace
}

/// R01: point mass on a massless link, released horizontal; closed form by elliptic functions.
#[test]
fn published_pendulum_has_its_period_positions_and_tension() {
    let (system, start) = beads(1, [1.0, 0.0, 0.0]).build().unwrap();
    // the period 4 K(1/2) / sqrt(g/l); the rate is zero there and grows with g per second off it
    let period = 2.367_841_947_576_237_449_3;
    let end = end_of(&system, &start, dormand_prince(1e-12), period);
    // the controller keeps the local error at the tolerance, some 1e2 steps add up
    let off = end.velocity[0] / G / period;
    println!("period off by {off:e}");
    assert!(off.abs() < 1e-10, "period off by {off:e}");

    let end = end_of(&system, &start, dormand_prince(1e-13), 10.0);
    let (sine, cosine) = end.position[0].sin_cos();
    println!("{:e} {:e}", cosine - 0.275_087_462_575_616_876, sine + 0.961_419_205_099_125_06);
    assert_close(&[cosine, sine], &[0.275_087_462_576_116_88, -0.961_419_205_099_125_06], 1e-9, "x, y at t = 10 s");
    let pull = -hinge_load(&evaluated(&system, &end), 0)[3];
    assert_close(&[end.velocity[0], pull], &[-4.343_160_692_864_683_1, 28.294_567_206_067_251], 1e-9, "rate and tension at t = 10 s");
}

/// R02: uniform rods in a horizontal line at rest; closed form from `V_(i-1) + 4 V_i + V_(i+1) = 0`.
#[test]
fn published_chain_of_ten_rods_has_its_hinge_forces_and_accelerations() {
    let (system, state) = rods(&[(1.0, 1.0); 10]).build().unwrap();
    let workspace = evaluated(&system, &state);
    let up: Vec<f64> = (0..3).map(|k| hinge_load(&workspace, k)[4]).collect();
    assert_close(&up, &[2.831_903_070_354_500_6, -0.758_806_140_709_001_21, 0.203_321_492_481_504_23], 1e-13, "hinge forces");
    let expected = [-12.438_581_577_872_996, 15.771_489_467_237_978, -4.225_957_868_951_912_9];
    assert_close(&workspace.acceleration.hinge[..3], &expected, 1e-13, "accelerations");
}

/// R03: computed, 29 digits agree between two programs.
#[test]
fn published_double_and_triple_pendulums_end_where_they_should() {
    let (system, start) = beads(2, [1.0, 0.0, 0.0]).build().unwrap();
    let end = end_of(&system, &start, dormand_prince(1e-13), 2.0);
    let (q, v) = (&end.position, &end.velocity);
    // theta from the downward vertical, of each link
    let found = [q[0] + FRAC_PI_2, q[0] + q[1] + FRAC_PI_2, v[0], v[0] + v[1]];
    let expected = [-0.482_971_534_251_754_377, -1.324_048_712_302_362_55, 3.065_288_192_073_401_32, 2.949_271_547_571_618_98];
    assert_close(&found, &expected, 1e-10, "double pendulum at t = 2 s");

    let (system, start) = rods(&[(1.0, 1.0); 3]).build().unwrap();
    let end = end_of(&system, &start, dormand_prince(1e-13), 1.0);
    let angles = end.position.iter().scan(FRAC_PI_2, |sum, q| {
        *sum += q;
        Some(*sum)
    });
    let expected = [-0.235_346_902_273_893_257, -0.777_152_856_470_527_32, -0.909_372_065_598_692_634];
    assert_close(&angles.collect::<Vec<_>>(), &expected, 1e-10, "triple pendulum at t = 1 s");
}

/// Generalised forces less bias at a state at rest with zero accelerations.
fn static_force(system: &System, state: &State, workspace: &mut Workspace, sweep: &mut NewtonEuler) -> Vec<f64> {
    pose_outward::pose_outward(system, state, &mut workspace.pose);
    force_inward::gather_applied(system, state, &workspace.pose, &mut workspace.force);
    let mut hinge = vec![0.0; system.velocity_count];
    sweep.sweep(system, state, &hinge.clone(), &[], &workspace.pose, &workspace.force);
    sweep.generalised_force(system, state, &workspace.pose, &mut hinge, &mut []);
    hinge.iter().map(|f| -f).collect()
}

/// R04: lowest root of the Laguerre polynomial L_N times g (closed form).
#[test]
fn published_hanging_chains_have_laguerre_frequencies() {
    for (count, root) in [(10, 0.137_793_470_540_492_430_83), (100, 0.014_386_146_995_419_669_464)] {
        let (system, rest) = beads(count, [0.0, -1.0, 0.0]).build().unwrap();
        let mass = dense::equations(&system, &rest).mass;
        let (mut workspace, mut sweep) = (Workspace::new(&system), NewtonEuler::new(&system));
        // order 4, forces are sines of the angles: h^4 / 30 = 3e-10 truncation
        let h = 1e-2;
        let mut stiffness = DMatrix::zeros(count, count);
        for j in 0..count {
            for (steps, weight) in [(1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0)] {
                for side in [1.0, -1.0] {
                    let mut moved = rest.clone();
                    moved.position[j] += side * steps * h;
                    for (i, f) in static_force(&system, &moved, &mut workspace, &mut sweep).iter().enumerate() {
                        stiffness[(i, j)] -= side * weight * f / h;
                    }
                }
            }
        }
        let stiffness = (&stiffness + stiffness.transpose()) * 0.5;
        // the largest eigenvalue of K^-1/2 M K^-1/2 is the inverse of the lowest
        let lower = stiffness.cholesky().unwrap().l();
        let half = lower.solve_lower_triangular(&mass).unwrap();
        let scaled = lower.solve_lower_triangular(&half.transpose()).unwrap();
        let lowest = 1.0 / scaled.symmetric_eigenvalues().max();
        println!("N = {count}: {:e}", lowest / (G * root) - 1.0);
        assert_close(&[lowest], &[G * root], 1e-8, &format!("squared frequency, N = {count}"));
    }
}

/// R04: closed form.
#[test]
fn published_chains_hang_and_spin_with_exact_tensions() {
    let count = 100;
    let (system, state) = beads(count, [0.0, -1.0, 0.0]).build().unwrap();
    let workspace = evaluated(&system, &state);
    for k in 0..count {
        assert_close(&[hinge_load(&workspace, k)[4]], &[(count - k) as f64 * G], 1e-14, "tension of the hanging chain");
    }
    assert!(workspace.acceleration.hinge.iter().all(|a| *a == 0.0), "a chain at rest stays at rest");

    let mut definition = beads(count, [1.0, 0.0, 0.0]);
    definition.gravity = Vector3::zeros();
    definition.hinges[0].velocity = vec![1.0];
    let (system, state) = definition.build().unwrap();
    let workspace = evaluated(&system, &state);
    for i in 0..count {
        let expected = ((count - i) * (count + i + 1)) as f64 / 2.0;
        // sums of whole numbers: no rounding
        assert_close(&[-hinge_load(&workspace, i)[3]], &[expected], 1e-14, "tension of the spinning chain");
    }
}

fn top(inertia: [f64; 3], omega: [f64; 3]) -> (System, State) {
    let mut spherical = hinge("pivot", "spherical", &[], WORLD, "top", [0.0; 3]);
    spherical.velocity = omega.to_vec();
    Definition { bodies: vec![rigid("top", 1.0, [0.0; 3], inertia)], hinges: vec![spherical], ..Definition::default() }.build().unwrap()
}

/// R05: Euler's top near its intermediate axis; closed form by elliptic functions.
#[test]
fn published_euler_top_flips() {
    let (system, start) = top([1.0, 2.0, 3.0], [0.01, 1.0, 0.01]);
    let half = 19.552_867_098_634_360_427;
    let end = end_of(&system, &start, dormand_prince(1e-13), half);
    println!("flip: {:?}", end.velocity);
    // the passage along the unstable axis multiplies what the first steps leave by 1 / 0.01
    assert_close(&end.velocity, &[-0.01, -1.0, 0.01], 1e-9, "angular velocity after half a period");
    let end = end_of(&system, &start, dormand_prince(1e-13), 50.0);
    let expected = [-0.999_964_488_599_380_366, 0.013_077_520_413_042_319_8, 0.577_387_500_863_391_946];
    assert_close(&end.velocity, &expected, 1e-9, "angular velocity at t = 50 s");
}

/// R06: heavy top of Bruls, Cardona and Arnold (parameters as in Exudyn's heavyTop); position computed, 25 digits.
#[test]
fn published_heavy_top_precesses() {
    let mut pivot = hinge("pivot", "spherical", &[], WORLD, "top", [0.0; 3]);
    pivot.velocity = vec![0.0, 150.0, -4.61538];
    let bodies = vec![rigid("top", 15.0, [0.0, 1.0, 0.0], [0.234_375, 0.468_75, 0.234_375])];
    let (system, start) =
        Definition { gravity: Vector3::new(0.0, 0.0, -G), bodies, hinges: vec![pivot], loads: vec![], closures: vec![] }.build().unwrap();
    let center = |end: &State| {
        let mut frame = [WorldFrame::default()];
        world_frames(&system, &evaluated(&system, end).pose, &mut frame);
        frame[0].rotation * Vector3::y()
    };
    let expected = Vector3::new(0.173_343_964_098_386_043, 0.640_088_592_070_568_783, -0.748_490_791_133_581_309);
    let end = end_of(&system, &start, dormand_prince(1e-11), 1.0);
    println!("heavy top: {:e}", (center(&end) - expected).norm());
    assert_close(center(&end).as_slice(), expected.as_slice(), 1e-7, "centre of mass at t = 1 s");
    // within 0.1 of the order once a step turns the top by less than 0.1 rad
    let error = |n: f64| (center(&end_of(&system, &start, rk4(1.0 / n), 1.0)) - expected).norm();
    let errors: Vec<_> = [2e3, 4e3, 8e3, 16e3].into_iter().map(error).collect();
    println!("heavy top: orders {:?}", slopes(&errors));
    assert!(slopes(&errors).iter().all(|s| (s - 4.0).abs() < 0.1), "orders {:?} of {errors:?}", slopes(&errors));
}

fn base_and_arm(motion: TimeFunction) -> (System, State) {
    let bodies = vec![rigid("base", 100.0, [0.0; 3], [20.0; 3]), rigid("arm", 10.0, [1.0, 0.0, 0.0], [2.0; 3])];
    let mut arm = hinge("shoulder", "revolute", &[Z], "base", "arm", [0.5, 0.0, 0.0]);
    arm.motion = Some(motion);
    let base = hinge("ground", "planar", &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], WORLD, "base", [0.0; 3]);
    Definition { bodies, hinges: vec![base, arm], ..Definition::default() }.build().unwrap()
}

/// R07: closed form, from conservation of angular momentum.
#[test]
fn published_free_base_turns_back_under_a_prescribed_arm() {
    let step = TimeFunction::SmoothStep { from: vec![0.0], to: vec![TAU], start: 0.0, end: 2.0 };
    let (system, start) = base_and_arm(step);
    let end = end_of(&system, &start, dormand_prince(1e-12), 2.0);
    assert_close(&[end.position[2]], &[-2.047_281_279_655_548_494_8], 1e-10, "net rotation of the base");

    let torques = [5.331_905_781_584_582_4, 7.404_012_880_852_117_9, 9.325_842_696_629_213_5];
    for (angle, torque) in [0.0, FRAC_PI_2, PI].into_iter().zip(torques) {
        // angle + 1 - cos t: no rate and a unit acceleration at t = 0
        let cosine = TimeFunction::Sine { amplitude: vec![-1.0], frequency_hz: 1.0 / TAU, phase: FRAC_PI_2 };
        let (system, mut state) = base_and_arm(TimeFunction::Sum(vec![TimeFunction::Constant(vec![angle + 1.0]), cosine]));
        state.velocity[3] = 0.0;
        let load = hinge_load(&evaluated(&system, &state), 1);
        assert_close(&[load[2]], &[torque], 1e-13, &format!("torque at {angle} rad"));
    }
}
