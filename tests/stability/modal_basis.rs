//! Any basis of the same modes gives the same motion (S14).

use crate::row::{EPS, Row, assert_rows};
use crate::support::scenes::difference;
use crate::support::trees::{Recipe, random_tree};
use nalgebra::{DMatrix, Vector6};
use pliant::dynamics::hinge_load::hinge_load;
use pliant::dynamics::{Workspace, dense, forward_dynamics};
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition};
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::modal_body::{Boundary, ModalBody};
use std::f64::consts::TAU;
use std::sync::Arc;

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

/// S14: hinge accelerations and loads do not know the basis of the modes. The modes of a body are orthonormal, so that T is orthogonal.
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
        worst = worst.max(difference(&b, &a).max(difference(&g, &f)) / condition);
    }
    assert_rows(&[Row::at_most(
        "S14",
        "12 trees in turned modal bases: accelerations and loads over the condition of M",
        worst,
        20.0 * EPS,
        "20 eps",
    )]);
}

/// Files of other codes hold modes of any scale, and may hold any combination of them.
#[cfg(feature = "hdf5")]
mod imported {
    use super::orthogonal;
    use crate::row::{EPS, Row, assert_rows};
    use crate::support::scenes::{Z, difference, flexible, hinge, rigid};
    use nalgebra::DMatrix;
    use pliant::dynamics::hinge_load::hinge_load;
    use pliant::dynamics::{Workspace, forward_dynamics};
    use pliant::io::import::import_to;
    use pliant::model::build::{Definition, HingeDefinition, WORLD};
    use pliant::scene::import_spec::ImportSpec;
    use std::fmt::Write as _;

    const CELLS: usize = 6;
    const MODES: usize = 4;

    /// Corners of a bar of 3 x 0.2 x 0.1 m along x, four to a section.
    fn points() -> Vec<[f64; 3]> {
        let section = [[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]];
        (0..=CELLS).flat_map(|i| section.map(|[y, z]| [0.5 * i as f64, y, z])).collect()
    }

    /// Two bending shapes, one twist and one stretch, none of which moves the root, all of one size.
    fn shapes() -> Vec<Vec<f64>> {
        let of = |shape: fn([f64; 3]) -> [f64; 3]| {
            let shape: Vec<f64> = points().into_iter().flat_map(shape).collect();
            let size = shape.iter().map(|u| u * u).sum::<f64>().sqrt();
            shape.into_iter().map(|u| u / size).collect()
        };
        vec![
            of(|[x, _, z]| [-2.0 * x * z, 0.0, x * x]),
            of(|[x, y, _]| [-3.0 * x * x * y, x * x * x, 0.0]),
            of(|[x, y, z]| [0.0, -x * z, x * y]),
            of(|[x, ..]| [x, 0.0, 0.2 * x * x]),
        ]
    }

    /// The bar with the modes `Phi T` as a file of XDMF, in numbers that keep every bit.
    fn file(t: &DMatrix<f64>) -> String {
        let item = |kind: &str, dimensions: &str, values: &[f64]| {
            let numbers: Vec<String> = values.iter().map(|x| format!("{x:e}")).collect();
            format!(r#"<DataItem DataType="{kind}" Dimensions="{dimensions}" Format="XML" Precision="8">{}</DataItem>"#, numbers.join(" "))
        };
        let (points, shapes) = (points(), shapes());
        let n = points.len();
        let cells: Vec<String> = (0..CELLS).map(|i| (0..8).map(|k| (4 * i + k).to_string()).collect::<Vec<_>>().join(" ")).collect();
        let geometry = item("Float", &format!("{n} 3"), points.as_flattened());
        let mut text = format!(
            r#"<Xdmf Version="3.0"><Domain><Grid Name="bar" GridType="Uniform"><Geometry GeometryType="XYZ">{geometry}</Geometry>
<Topology TopologyType="Hexahedron" NumberOfElements="{CELLS}"><DataItem DataType="Int" Dimensions="{CELLS} 8" Format="XML" Precision="8">{}</DataItem></Topology>"#,
            cells.join(" ")
        );
        for mode in 0..MODES {
            let shape: Vec<f64> = (0..3 * n).map(|i| (0..MODES).map(|k| shapes[k][i] * t[(k, mode)]).sum()).collect();
            let values = item("Float", &format!("{n} 3"), &shape);
            let _ = write!(text, r#"<Attribute Name="mode_{}" AttributeType="Vector" Center="Node">{values}</Attribute>"#, mode + 1);
        }
        text + "</Grid></Domain></Xdmf>"
    }

    const KEYS: &str = r#"
displacement = "mode_*"
frequency_hz = [1.0, 2.0, 3.0, 4.0]
density = 100.0
damping_ratio = 0.0
interface = { root = { nodes = [0, 1, 2, 3] }, tip = { nodes = [24, 25, 26, 27] } }
"#;

    /// Hinge accelerations and loads of a hub, the bar and a body on its tip, all turning; what the import says if it refuses.
    fn answers(t: &DMatrix<f64>) -> Result<(Vec<f64>, Vec<f64>), String> {
        let folder = tempfile::tempdir().unwrap();
        let source = folder.path().join("bar.xdmf");
        std::fs::write(&source, file(t)).unwrap();
        let spec: ImportSpec = toml::from_str(KEYS).unwrap();
        let imported = import_to(&source, &spec.options().unwrap(), &folder.path().join("bar.h5")).map_err(|e| e.to_string())?;
        let (_, bar) = imported.examination.into_accepted().unwrap();
        let mut base = hinge("base", "free", &[], WORLD, "hub", [0.0; 3]);
        base.velocity = vec![0.3, -0.2, 0.4, 0.0, 0.1, 0.0];
        let mut drive = hinge("drive", "revolute", &[Z], "hub", "bar", [0.2, 0.1, 0.0]);
        (drive.velocity, drive.stiffness, drive.position) = (vec![0.5], vec![30.0], vec![0.2]);
        let joint = hinge("joint", "spherical", &[], "bar", "dish", [0.0; 3]);
        let joint = HingeDefinition { parent_node: Some("tip".into()), velocity: vec![0.1, 0.6, -0.4], ..joint };
        let bodies =
            vec![rigid("hub", 40.0, [0.0; 3], [9.0, 8.0, 7.0]), flexible("bar", bar), rigid("dish", 3.0, [0.2, 0.1, 0.0], [0.5; 3])];
        let gravity = nalgebra::Vector3::new(0.3, 0.1, -9.81);
        let (system, state) = Definition { gravity, bodies, hinges: vec![base, drive, joint], ..Definition::default() }.build().unwrap();
        let mut workspace = Workspace::new(&system);
        forward_dynamics(&system, &state, &mut workspace).unwrap();
        let loads = (0..3).flat_map(|k| hinge_load(&workspace, k).as_slice().to_vec()).collect();
        Ok((workspace.acceleration.hinge, loads))
    }

    /// Singular values from 1 down to `1 / condition`.
    fn graded(condition: f64) -> DMatrix<f64> {
        DMatrix::from_fn(MODES, MODES, |i, j| if i == j { condition.powf(-(i as f64) / (MODES as f64 - 1.0)) } else { 0.0 })
    }

    /// S14, undeformed and at rest in the modes, where nothing but the motions that they span can matter.
    #[test]
    fn imported_modes_may_come_in_any_basis_that_tells_them_apart() {
        let (a, f) = answers(&DMatrix::identity(MODES, MODES)).unwrap();
        let off = |t: &DMatrix<f64>| answers(t).map(|(b, g)| difference(&b, &a).max(difference(&g, &f)));
        let mut rows = Vec::new();
        for condition in [1e2, 1e4, 1e6, 1e8] {
            let what = format!("imported modes, each in a scale of its own, 1 to {:.0e}: accelerations and loads", 1.0 / condition);
            rows.push(Row::at_most(
                "S14",
                what,
                off(&graded(condition)).unwrap(),
                40.0 * EPS,
                "20 eps on either side: scales cost nothing",
            ));
        }
        let turn = orthogonal(MODES);
        let mixed = |condition: f64| turn.transpose() * graded(condition) * &turn;
        for condition in [1.0, 10.0, 100.0, 300.0] {
            let what = format!("imported modes, all mixed by a matrix of condition {condition:.0e}: accelerations and loads");
            rows.push(Row::at_most(
                "S14",
                what,
                off(&mixed(condition)).unwrap(),
                20.0 * EPS * (1.0 + condition),
                "20 eps cond T, and 20 eps of the modes as they are",
            ));
        }
        for condition in [1e4, 1e6, 1e8] {
            let what = format!("the same of condition {condition:.0e}, shapes that differ by less than a thousandth");
            rows.push(Row::says("S14", what, off(&mixed(condition)).err(), &["bar.xdmf", "modes", "depend on one another"]));
        }
        assert_rows(&rows);
    }
}
