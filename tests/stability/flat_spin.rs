//! Explorer 1: a body that spins about its axis of least inertia, with damped whips, ends in a flat spin (S17).

use crate::row::{Row, assert_rows};
use crate::support::scenes::{dormand_prince, exact_beam, flexible, hinge, rigid, run};
use nalgebra::{Matrix3, Vector3, Vector6};
use pliant::dynamics::energy::balance;
use pliant::dynamics::world::WorldFrame;
use pliant::model::build::{Definition, WORLD};
use pliant::model::modal_body::ModalBody;
use pliant::model::{State, System};
use std::f64::consts::TAU;

/// Energies (J) after 0, 100, 400 and 1000 s with modal stiffness 200; by `tests/data/stability_references.py`, from the motion of bus and tips.
const ENERGIES: [(usize, f64); 4] = [(0, 5.370_25), (100, 5.283_755_199_1), (400, 5.002_376_584_6), (1000, 4.453_718_442_6)];
/// Angular momentum (N m s): that of the list's satellite, as is the energy at the start.
const MOMENTUM: f64 = 5.393_675_277_582_068;

/// Two whips along y with 0.5 kg at each tip, 1 m from the middle, where they are clamped. Mode 1 moves the tips along x, mode 2 along z, in
/// opposite senses and by 1, so that both have unit modal mass; critically damped, as a quarter of K with the damping sqrt K is.
fn whips(stiffness: f64) -> ModalBody {
    let component = |row: usize, column: usize, value: f64| Matrix3::from_fn(|i, j| if (i, j) == (row, column) { value } else { 0.0 });
    let mut body = exact_beam(2);
    body.center_of_mass = Vector3::zeros();
    body.inertia = Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 1.0));
    (body.frequency_hz, body.damping_ratio) = (vec![stiffness.sqrt() / TAU; 2], vec![1.0; 2]);
    // opposite tips: no momentum; sum of m y phi
    body.momentum = vec![Vector3::zeros(); 2];
    body.first_moment = vec![component(1, 0, 1.0), component(1, 2, 1.0)];
    body.second_moment = vec![component(0, 0, 1.0), component(0, 2, 1.0), component(2, 0, 1.0), component(2, 2, 1.0)];
    body.interfaces.truncate(1);
    body.interfaces[0].mode_shape = vec![Vector6::zeros(); 2];
    body
}

/// Bus and whips, of inertia (2.45, 4.26, 6.19) together, at (2, 0.3, 0.3) rad/s.
fn explorer(stiffness: f64) -> (System, State) {
    let mut base = hinge("base", "free", &[], WORLD, "bus", [0.0; 3]);
    base.velocity = vec![2.0, 0.3, 0.3, 0.0, 0.0, 0.0];
    let clamp = hinge("clamp", "fixed", &[], "bus", "whips", [0.0; 3]);
    let bodies = vec![rigid("bus", 10.0, [0.0; 3], [1.45, 4.26, 5.19]), flexible("whips", whips(stiffness))];
    Definition { bodies, hinges: vec![base, clamp], ..Definition::default() }.build().unwrap()
}

/// Energy at every second, largest relative change of the angular momentum, and the last state.
fn spun_down(stiffness: f64, duration: f64) -> (Vec<f64>, Vector3<f64>, f64, State) {
    let (system, start) = explorer(stiffness);
    let mut frames = vec![WorldFrame::default(); 2];
    let mut seen = Vec::new();
    let end = run(&system, &start, dormand_prince(1e-13), duration, 1.0, |s| {
        let (energy, momentum) = balance(s.system, s.state, s.workspace, &mut frames);
        seen.push((energy.total(), momentum.angular));
    })
    .end;
    let held = seen[0].1;
    let drift = seen.iter().map(|(_, h)| (h - held).norm() / held.norm()).fold(0.0, f64::max);
    (seen.into_iter().map(|s| s.0).collect(), held, drift, end)
}

/// Largest rise of energy (J) from one second to the next.
fn rise(energies: &[f64]) -> f64 {
    energies.windows(2).map(|e| e[1] - e[0]).fold(f64::NEG_INFINITY, f64::max)
}

/// S17 on a satellite with the inertia, the spin and so the energy and the momentum of the list's; its appendage is not given there.
#[test]
fn a_damped_appendage_takes_the_energy_that_it_should_from_a_spin() {
    let (energies, held, drift, _) = spun_down(200.0, 1000.0);
    let off = ENERGIES.iter().map(|&(t, e)| (energies[t] / e - 1.0).abs()).fold(0.0, f64::max);
    assert_rows(&[
        Row::at_most("S17", "spin about the least axis with damped whips, 1000 s: angular momentum", drift, 1e-10, ""),
        Row::at_most("S17", "the same: angular momentum at the start", (held.norm() / MOMENTUM - 1.0).abs(), 1e-14, "closed form"),
        Row::at_most(
            "S17",
            "the same: energy after 0, 100, 400 and 1000 s",
            off,
            1e-5,
            "of the motion of bus and tips, by another program",
        ),
        Row::at_most("S17", "the same: rise of energy in any second (J)", rise(&energies), 0.0, "falls"),
    ]);
}

/// The same with softer whips, until nothing is left to lose.
#[test]
fn a_spin_about_the_least_axis_ends_flat() {
    let (energies, held, drift, end) = spun_down(9.0, 12_000.0);
    let floor = held.norm_squared() / (2.0 * 6.19);
    let last = energies[energies.len() - 1];
    println!("{} J of {floor} J, rates {:?}", last, end.velocity);
    let tilt = end.velocity[0].hypot(end.velocity[1]).atan2(end.velocity[2].abs());
    assert_rows(&[
        Row::at_most(
            "S17",
            "the same with softer whips, 12,000 s: energy over that of a flat spin, less one",
            last / floor - 1.0,
            1e-5,
            "flat spin",
        ),
        Row::at_most("S17", "the same: angle of the spin to the axis of greatest inertia (rad)", tilt, 1e-2, "from 1.3"),
        Row::at_most("S17", "the same: angular momentum", drift, 1e-10, ""),
        Row::at_most("S17", "the same: rise of energy in any second (J)", rise(&energies), 1e-12, "falls, to rounding"),
    ]);
}
