//! Numbers that no body has, and numbers that are none (S18, S19).

use crate::row::{Row, assert_rows};
use crate::support::scenes::{G, beads, hinge, rigid};
use nalgebra::Matrix3;
use pliant::model::build::{BodyDefinitionKind, Definition, WORLD};

fn refusal(mass: f64, center: f64, inertia: Matrix3<f64>) -> Option<String> {
    let mut bus = rigid("bus", mass, [center, 0.0, 0.0], [1.0; 3]);
    if let BodyDefinitionKind::Rigid { inertia: own, .. } = &mut bus.kind {
        *own = inertia;
    }
    let hinges = vec![hinge("joint", "free", &[], WORLD, "bus", [0.0; 3])];
    Definition { bodies: vec![bus], hinges, ..Definition::default() }.build().err().map(|e| e.to_string())
}

/// S19.
#[test]
fn impossible_masses_and_inertias_are_refused_by_name() {
    let diagonal = |a: f64, b: f64, c: f64| Matrix3::from_diagonal(&nalgebra::Vector3::new(a, b, c));
    let lopsided = Matrix3::new(1.0, 0.2, 0.0, -0.2, 1.0, 0.0, 0.0, 0.0, 1.0);
    let words = ["\"bus\"", "inertia", "principal values"];
    let mut rows: Vec<Row> = [
        ("inertia (1, 1, 3), beyond the triangle inequality", diagonal(1.0, 1.0, 3.0)),
        ("inertia (-1, 1, 1)", diagonal(-1.0, 1.0, 1.0)),
        ("inertia that is not symmetric", lopsided),
        ("inertia of NaN", diagonal(f64::NAN, 1.0, 1.0)),
        ("infinite inertia", diagonal(f64::INFINITY, 1.0, 1.0)),
    ]
    .into_iter()
    .map(|(what, inertia)| Row::says("S19", what, refusal(1.0, 0.0, inertia), &words))
    .collect();
    for mass in [-1.0, f64::NAN, f64::INFINITY] {
        rows.push(Row::says("S19", format!("mass of {mass}"), refusal(mass, 0.0, Matrix3::identity()), &["\"bus\"", "mass"]));
    }
    for center in [f64::NAN, f64::INFINITY] {
        let found = refusal(1.0, center, Matrix3::identity());
        rows.push(Row::says("S18", format!("centre of mass at {center}"), found, &["\"bus\"", "center_of_mass"]));
    }
    assert_rows(&rows);
}

/// S18: what is not finite is refused where it is given.
#[test]
fn numbers_that_are_not_finite_are_refused_at_the_definition() {
    type Break = fn(&mut Definition, f64);
    let breaks: [(&str, Break); 9] = [
        ("gravity", |d, x| d.gravity.x = x),
        ("position", |d, x| d.hinges[0].position = vec![x]),
        ("velocity", |d, x| d.hinges[0].velocity = vec![x]),
        ("stiffness", |d, x| d.hinges[0].stiffness = vec![x]),
        ("damping", |d, x| d.hinges[0].damping = vec![x]),
        ("rest", |d, x| d.hinges[0].rest = vec![x]),
        ("parent_frame", |d, x| d.hinges[0].parent_frame.position.x = x),
        ("child_frame", |d, x| d.hinges[0].child_frame.position.x = x),
        ("axis", |d, x| d.hinges[0].axes[0].x = x),
    ];
    let rows = breaks.map(|(key, set)| {
        let refusal = |x: f64| {
            let mut definition = beads(1, [G, 0.0, 0.0]);
            set(&mut definition, x);
            definition.build().err().map_or_else(String::new, |e| e.to_string())
        };
        let messages = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(refusal);
        let named = messages.iter().all(|m| m.contains(key));
        Row::holds(
            "S18",
            format!("{key} of NaN, inf, -inf"),
            "refused, key named",
            if named { "so".into() } else { format!("{messages:?}") },
            named,
        )
    });
    assert_rows(&rows);
}
