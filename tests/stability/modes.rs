//! Sets of modes: duplicates, nearly dependent ones, all that a mesh has, and any basis of the same motion (S13, S14).

use crate::row::{EPS, Row, assert_rows, componentwise};
use crate::support::lumped::lumped_body_of;
use crate::support::scenes::{Z, difference, exact_beam, flexible, hinge, rigid};
use crate::support::trees::{Recipe, random_tree};
use nalgebra::{DMatrix, Matrix6, Vector6};
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, dense, forward_dynamics};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, WORLD};
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::modal_body::{Boundary, ModalBody};
use pliant::spatial::SpatialInertia;
use rand::SeedableRng;
use rand::rngs::StdRng;
use std::f64::consts::TAU;
use std::sync::Arc;

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

/// The same body in modal coordinates zeta with eta = T zeta, T orthogonal: full stiffness `T' K T`.
fn turned(modal: &ModalBody, t: &DMatrix<f64>) -> ModalBody {
    let n = modal.mode_count();
    let stiffness = modal
        .stiffness
        .clone()
        .unwrap_or_else(|| DMatrix::from_fn(n, n, |i, j| if i == j { (TAU * modal.frequency_hz[i]).powi(2) } else { 0.0 }));
    let mut out = modal.clone();
    for k in 0..n {
        out.momentum[k] = (0..n).map(|j| modal.momentum[j] * t[(j, k)]).sum();
        out.first_moment[k] = (0..n).map(|j| modal.first_moment[j] * t[(j, k)]).sum();
        for l in 0..n {
            out.second_moment[k * n + l] = (0..n * n).map(|i| modal.second_moment[i] * (t[(i / n, k)] * t[(i % n, l)])).sum();
        }
        for (new, old) in out.interfaces.iter_mut().zip(&modal.interfaces) {
            new.mode_shape[k] = (0..n).map(|j| old.mode_shape[j] * t[(j, k)]).sum::<Vector6<f64>>();
        }
    }
    out.stiffness = Some(t.transpose() * stiffness * t);
    out
}

/// Q of a QR decomposition of fixed numbers.
fn orthogonal(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| ((i * 7 + j * 5 + i * j) as f64 * 0.83).sin()).qr().q()
}

fn in_turned_basis(definition: &Definition) -> Definition {
    let mut out = definition.clone();
    for BodyDefinition { kind, .. } in &mut out.bodies {
        if let BodyDefinitionKind::Flexible(f) = kind {
            let t = orthogonal(f.modal.mode_count());
            let back = |x: &[f64]| t.tr_mul(&nalgebra::DVector::from_column_slice(x)).as_slice().to_vec();
            (f.modal_position, f.modal_velocity) = (back(&f.modal_position), back(&f.modal_velocity));
            f.modal = Arc::new(turned(&f.modal, &t));
            f.integrals = Arc::new(ModalIntegrals::of(&f.modal));
        }
    }
    out
}

/// S14: hinge accelerations and loads do not know the basis of the modes. The files that hold modes must be orthonormal, so that T is
/// orthogonal: another one is refused with the file.
#[test]
fn hinge_accelerations_and_loads_do_not_depend_on_the_modal_basis() {
    let mut worst = 0.0_f64;
    for (seed, boundary) in [Boundary::Cantilever, Boundary::FreeFree, Boundary::General].into_iter().cycle().take(12).enumerate() {
        // dampers of the modes would be of the old basis
        let recipe = Recipe { flexible: 0.7, boundary: Some(boundary), dampers: false, ..Recipe::default() };
        let definition = random_tree(seed as u64 + 300, &recipe);
        let solve = |definition: &Definition| {
            let (system, state) = definition.build().unwrap();
            let mut workspace = Workspace::new(&system);
            forward_dynamics(&system, &state, &mut workspace).unwrap();
            let loads: Vec<f64> = (0..system.bodies.len()).flat_map(|k| hinge_load(&workspace, k).as_slice().to_vec()).collect();
            (workspace.acceleration.hinge, loads, dense::equations(&system, &state).condition())
        };
        let ((a, f, condition), (b, g, _)) = (solve(&definition), solve(&in_turned_basis(&definition)));
        // T itself has condition 1; the integrals are rounded anew, and the solve multiplies that by the condition of M
        worst = worst.max(difference(&b, &a).max(difference(&g, &f)) / condition.max(10.0));
    }
    assert_rows(&[Row::at_most(
        "S14",
        "12 trees in turned modal bases: accelerations and loads over the condition of M",
        worst,
        200.0 * EPS,
        "200 eps: ten sums of twenty terms",
    )]);
}
