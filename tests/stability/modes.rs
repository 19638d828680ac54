//! Sets of modes: duplicates, nearly dependent ones, and all that a mesh has (S13).

use crate::row::{EPS, Row, assert_rows, componentwise};
use crate::support::lumped::lumped_body_of;
use crate::support::scenes::{Z, exact_beam, flexible, hinge, rigid};
use nalgebra::{Matrix6, Vector6};
use pliant::dynamics::{Workspace, forward_dynamics};
use pliant::model::build::{Definition, WORLD};
use pliant::model::modal_body::{Boundary, ModalBody};
use pliant::spatial::SpatialInertia;
use rand::SeedableRng;
use rand::rngs::StdRng;

/// The beam of `modes` on a revolute hinge at its root.
fn pinned(beam: ModalBody) -> Definition {
    let pin = hinge("pin", "revolute", &[Z], WORLD, "beam", [0.0; 3]);
    Definition { bodies: vec![flexible("beam", beam)], hinges: vec![pin], ..Definition::default() }
}

/// S13: what `modes` cantilever modes leave of the beam's inertia about its root; closed forms.
#[test]
fn good_modes_leave_the_inertia_that_they_should() {
    let published = [
        0.009_770_606_626_200_273_48,
        0.001_531_997_024_521_484_51,
        0.000_481_175_697_242_060_635,
        0.000_207_526_849_299_999_405,
        0.000_107_386_231_289_684_348,
    ];
    let rows: Vec<Row> = published
        .into_iter()
        .enumerate()
        .map(|(i, expected)| {
            let (system, state) = pinned(exact_beam(i + 1)).build().unwrap();
            let mut workspace = Workspace::new(&system);
            forward_dynamics(&system, &state, &mut workspace).unwrap();
            let off = componentwise(&[workspace.inertia.bodies[0].D[0][0]], &[expected]);
            let bound = 4.0 * EPS / 3.0 / expected;
            Row::at_most("S13", format!("cantilever of {} modes: inertia left at its root", i + 1), off, bound, "4 eps J / J_left")
        })
        .collect();
    assert_rows(&rows);
}

/// S13: mode 1 twice carries more than the beam has.
#[test]
fn a_mode_listed_twice_is_an_error_with_the_inertia_that_it_leaves() {
    let beam = exact_beam(1);
    let mut double = exact_beam(2);
    double.frequency_hz[1] = double.frequency_hz[0];
    double.momentum[1] = beam.momentum[0];
    double.first_moment[1] = beam.first_moment[0];
    for interface in &mut double.interfaces {
        interface.mode_shape[1] = interface.mode_shape[0];
    }
    let (system, state) = pinned(double).build().unwrap();
    let error = forward_dynamics(&system, &state, &mut Workspace::new(&system)).err();
    let found = match &error {
        Some(pliant::dynamics::DynamicsError::SingularHinge { inertia, .. }) => *inertia,
        _ => f64::NAN,
    };
    assert_rows(&[
        Row::says("S13", "cantilever mode 1 twice", error.map(|e| e.to_string()), &["\"pin\"", "\"beam\"", "rate 1"]),
        Row::at_most(
            "S13",
            "the same: the inertia in the message",
            componentwise(&[found], &[-0.313_792_120_080_932_786]),
            16.0 * EPS,
            "16 eps",
        ),
    ]);
}

/// A free beam whose modes move its hinge and that has no inertia about its own line.
#[test]
fn a_body_without_inertia_about_an_axis_is_told_so_where_its_modes_move_the_hinge() {
    let mut beam = exact_beam(2);
    beam.boundary = Boundary::General;
    let mut definition = pinned(beam);
    definition.hinges[0].child_node = Some("tip".into());
    let (system, state) = definition.build().unwrap();
    let error = forward_dynamics(&system, &state, &mut Workspace::new(&system)).err().map(|e| e.to_string());
    let words = ["\"beam\"", "no inertia along some direction", "give it inertia there"];
    assert_rows(&[Row::says("P+", "beam without inertia about its line, modes that move its hinge", error, &words)]);
}

/// Least eigenvalue angular rows measured in metres of `arm`.
fn least_eigenvalue(inertia: &SpatialInertia, arm: f64) -> f64 {
    let scale = Vector6::from_fn(|i, _| if i < 3 { 1.0 / arm } else { 1.0 });
    let m = inertia.matrix();
    let scaled = Matrix6::from_fn(|i, j| m[(i, j)] * scale[i] * scale[j]);
    scaled.symmetric_eigenvalues().min()
}

/// P+ with all modes of a mesh retained: only the root's node is left, the rest is rounding.
#[test]
fn all_modes_of_a_mesh_leave_the_root_node_and_a_positive_semidefinite_inertia() {
    let mut rows = Vec::new();
    for root_mass in [1.0, 1e-3, 1e-6] {
        let (mut least, mut off, mut loads) = (0.0_f64, 0.0_f64, 0.0_f64);
        for seed in 0..20 {
            let rng = &mut StdRng::seed_from_u64(seed);
            let count = 8;
            let masses = (0..count).map(|i| if i == 0 { root_mass } else { 0.5 + 0.1 * f64::from(i) }).collect::<Vec<_>>();
            let total: f64 = masses.iter().sum();
            let modes = 3 * (count as usize - 1);
            let body = lumped_body_of(rng, Boundary::Cantilever, modes, masses);
            let slide = hinge("slide", "prismatic", &[[0.3, 0.4, 0.5]], WORLD, "mesh", [0.0; 3]);
            let clamp = hinge("clamp", "fixed", &[], "mesh", "tip", [0.0; 3]);
            let clamp = pliant::model::build::HingeDefinition { parent_node: Some("tip".into()), ..clamp };
            for tip in [false, true] {
                let mut bodies = vec![flexible("mesh", body.modal.clone())];
                let mut hinges = vec![slide.clone()];
                if tip {
                    bodies.push(rigid("tip", 3.0, [0.1, 0.2, 0.0], [0.5; 3]));
                    hinges.push(clamp.clone());
                }
                let gravity = nalgebra::Vector3::new(0.0, 0.0, -9.81);
                let (system, state) = Definition { gravity, bodies, hinges, ..Definition::default() }.build().unwrap();
                let mut workspace = Workspace::new(&system);
                forward_dynamics(&system, &state, &mut workspace).unwrap();
                let own = &workspace.inertia.bodies[0];
                least = [&own.P_hinge, &own.P_plus].into_iter().fold(least, |a, p| a.min(least_eigenvalue(p, 1.0) / total));
                if !tip {
                    off = off.max((own.D[0][0] - root_mass).abs() / total);
                }
                let audit = pliant::dynamics::inverse::NewtonEuler::new(&system).audit(&system, &state, &workspace).load;
                loads = loads.max(audit);
            }
        }
        let what = |of: &str| format!("all 21 modes of 8 nodes, root of {root_mass:.0e} kg: {of}");
        rows.push(Row::at_most("P+", what("negative eigenvalue of P, P+ over the mass"), -least, 21.0 * 16.0 * EPS, "modes x 16 eps"));
        rows.push(Row::at_most("P+", what("error of what is left, over the mass"), off, 21.0 * 16.0 * EPS, "modes x 16 eps"));
        rows.push(Row::at_most(
            "P+",
            what("hinge loads against the audit"),
            loads,
            21.0 * 16.0 * EPS * 8.0 / root_mass.min(1.0),
            "the same over the share left",
        ));
    }
    assert_rows(&rows);
}
