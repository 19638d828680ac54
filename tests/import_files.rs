//! Files of meshio, the MED library and h5py become sound modal files: mass, inertia, modes, interfaces and stress are those of the model.
//!
//! The samples are beams of 2.0 x 0.2 x 0.1 m and 10 kg along x whose root sits at x = 1, bent as w = s^2, s^3, ... with s from 0 to 1.
#![cfg(feature = "hdf5")]

use nalgebra::{Matrix3, Vector3};
use pliant::io::import::{ImportReport, import_to};
use pliant::io::{ModalFile, NodeMassKind, Rule, Verdict, examine};
use pliant::model::modal_body::{Boundary, ModalBody};
use pliant::scene::assemble::{Overrides, assemble};
use pliant::scene::error::Source;
use pliant::scene::import_spec::ImportSpec;
use std::path::{Path, PathBuf};

/// Sums of some dozen products of order ten.
const ROUND_OFF: f64 = 1e-12;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name)
}

fn keys(sample: &str) -> String {
    std::fs::read_to_string(data(&format!("{sample}.toml"))).unwrap()
}

/// Imports a file with keys; the folder keeps what was written.
fn import_file(file: &Path, keys: &str) -> (tempfile::TempDir, ImportReport, ModalFile, ModalBody) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("body.h5");
    let spec: ImportSpec = toml::from_str(keys).unwrap();
    let imported = import_to(file, &spec.options().unwrap(), &out).unwrap();
    let (file, body) = imported.examination.into_accepted().unwrap();
    (folder, imported.report, file, body)
}

fn import(sample: &str) -> (tempfile::TempDir, ImportReport, ModalFile, ModalBody) {
    import_file(&data(sample), &keys(sample))
}

/// Inertia of the beam about the middle of its root face.
fn beam_inertia() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(0.05 / 12.0, 4.0 / 3.0 + 0.01 / 12.0, 4.0 / 3.0 + 0.04 / 12.0)) * 10.0
}

#[test]
fn mass_and_inertia_from_density_are_those_of_the_geometry() {
    for sample in ["beam.xdmf", "beam_inline.xdmf", "beam_h5py.med"] {
        let (_folder, _, file, body) = import(sample);
        assert!((body.mass - 10.0).abs() < ROUND_OFF, "{sample}");
        assert!((body.center_of_mass - Vector3::new(1.0, 0.0, 0.0)).amax() < ROUND_OFF, "{sample} {}", body.center_of_mass);
        assert!((body.inertia - beam_inertia()).amax() < 10.0 * ROUND_OFF, "{sample} {}", body.inertia - beam_inertia());
        assert_eq!((body.boundary, file.header().node_mass_kind), (Boundary::Cantilever, NodeMassKind::RowSum));
    }
}

#[test]
fn densities_of_groups_add_up() {
    let (_folder, _, _, body) = import("beam.med");
    assert!((body.mass - 10.0).abs() < ROUND_OFF);
    // 4 kg in the inner half, 6 kg in the outer
    assert!((body.center_of_mass.x - 1.1).abs() < ROUND_OFF, "{}", body.center_of_mass);
}

#[test]
fn writers_of_one_model_give_one_body() {
    let (_a, _, first, one) = import("beam.xdmf");
    let (_b, _, second, other) = import("beam_h5py.med");
    assert!((one.momentum[1] - other.momentum[1]).amax() < ROUND_OFF && (one.first_moment[0] - other.first_moment[0]).amax() < ROUND_OFF);
    assert_eq!((&one.frequency_hz, one.interfaces.len()), (&other.frequency_hz, other.interfaces.len()));
    let tip = |body: &ModalBody| body.interface("tip").unwrap().mode_shape[0];
    assert!((tip(&one) - tip(&other)).amax() < ROUND_OFF);
    assert_eq!(first.header().node_count, second.header().node_count);
}

#[test]
fn steps_that_come_in_no_order_are_sorted_by_number_and_frequency() {
    let (_folder, report, _, body) = import("beam.med");
    assert_eq!((body.frequency_hz.as_slice(), report.sizes), ([2.5, 10.0, 22.5].as_slice(), (20, 3)));
    let reversed = keys("beam.med") + "frequency_hz = [9.0, 4.0, 6.0]\n";
    let (_folder, report, _, body) = import_file(&data("beam.med"), &reversed);
    assert_eq!(body.frequency_hz, [4.0, 6.0, 9.0]);
    assert!(report.carried.iter().any(|line| line.contains("sorted by frequency")), "{report:?}");
}

#[test]
fn cells_of_the_other_sense_are_turned_so_that_the_surface_points_outward() {
    for (sample, turned) in [("beam.med", true), ("beam_h5py.med", false)] {
        let (_folder, report, file, _) = import(sample);
        assert_eq!(report.approximated.iter().any(|line| line.contains("counted in the other sense")), turned, "{sample} {report:?}");
        let surface = file.read_surface(&[]).unwrap();
        let corner = |node: u32| Vector3::from(surface.points[node as usize]);
        let volume: f64 = surface.triangles.iter().map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c))) / 6.0).sum();
        assert!((volume - 0.04).abs() < ROUND_OFF, "{sample} {volume}");
    }
}

#[test]
fn an_interface_moves_with_its_face_and_stress_keeps_its_components() {
    for sample in ["beam.xdmf", "beam_inline.xdmf", "beam.med"] {
        // one mode alone is only scaled
        let (_folder, _, file, body) = import_file(&data(sample), &(keys(sample) + "modes = [1]\n"));
        let tip = body.interface("tip").unwrap();
        let scale = tip.mode_shape[0][5];
        // w = s^2 with s = x / 2: at the tip w = 1 and dw/dx = 1, a rotation of -1 about y
        assert!((tip.position - Vector3::new(2.0, 0.0, 0.0)).amax() < ROUND_OFF && scale > 0.1, "{sample}");
        assert!((tip.mode_shape[0] / scale - nalgebra::Vector6::new(0.0, -1.0, 0.0, 0.0, 0.0, 1.0)).amax() < ROUND_OFF, "{sample}");
        let surface = file.read_surface(&[0]).unwrap();
        let stress = surface.stress.unwrap();
        for (point, tensor) in surface.points.iter().zip(&stress.values[0]) {
            for (component, value) in tensor.iter().enumerate() {
                let expected = 1e5 * scale * (1.0 + point[0] / 2.0) * (component + 1) as f64;
                // stored in single precision
                assert!((f64::from(*value) / expected - 1.0).abs() < 2.0 * f64::from(f32::EPSILON), "{sample}");
            }
        }
    }
}

#[test]
fn shells_keep_their_rotations_and_hold_on_edges() {
    let (_folder, report, file, body) = import("plate.med");
    assert!((body.mass - 10.0).abs() < ROUND_OFF && file.has_rotation() && body.boundary == Boundary::Cantilever);
    assert!(report.carried.iter().any(|line| line.contains("\"tip\": 3 nodes, length weights")), "{report:?}");
    let tip = &body.interface("tip").unwrap();
    let (bend, twist) = (tip.mode_shape[0], tip.mode_shape[1]);
    // along the edge only nodal rotations tell the rotation about y and z
    assert!((bend / bend[5] - nalgebra::Vector6::new(0.0, -1.0, 0.0, 0.0, 0.0, 1.0)).amax() < ROUND_OFF, "{bend}");
    assert!(twist[0].abs() > 0.1 && twist[5].abs() < ROUND_OFF, "{twist}");
}

#[test]
fn cells_of_several_kinds_are_kept_by_their_corners() {
    let (_folder, report, file, body) = import("mixed.xdmf");
    // a cube, two halves of one, a third and a sixth, of 100 kg/m^3
    assert!((body.mass - 250.0).abs() < 100.0 * ROUND_OFF && report.approximated.iter().any(|line| line.contains("several kinds")));
    assert_eq!((body.damping_ratio.as_slice(), file.header().node_count), ([0.01, 0.02].as_slice(), 14));
}

#[test]
fn the_health_report_says_by_how_much_modes_departed() {
    let (_folder, report, file, _) = import("beam.xdmf");
    let health = examine(file.path()).report;
    let row = health.rows.iter().find(|row| row.rule == Rule::LumpedOrthonormality).unwrap();
    assert_eq!((row.figure, row.verdict), (Some(report.departure), Verdict::Warn));
    assert!(
        row.note.as_ref().is_some_and(|note| note.contains("sums over nodes") && note.contains("depart from orthonormality")),
        "{row:?}"
    );
    // bent as s^2 and s^3: far from orthogonal
    assert!(report.departure > 0.5);
}

/// A bar of five nodes on each of four lines with one mode in z, as XDMF with the numbers inside.
fn bar(shape: impl Fn(f64) -> f64) -> String {
    let mut points = String::new();
    let mut mode = String::new();
    for i in 0..5 {
        let x = f64::from(i) / 2.0 - 1.0;
        for (y, z) in [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)] {
            points += &format!("{x} {y} {z} ");
            mode += &format!("0 0 {} ", shape(x));
        }
    }
    let cells: Vec<String> = (0..4).map(|i| [0, 4, 5, 1, 3, 7, 6, 2].map(|n| (4 * i + n).to_string()).join(" ")).collect();
    let mass = vec!["0.5"; 20].join(" ");
    format!(
        "<Xdmf Version=\"3.0\"><Domain><Grid><Geometry GeometryType=\"XYZ\"><DataItem Dimensions=\"20 3\">{points}</DataItem></Geometry>\
         <Topology TopologyType=\"Hexahedron\"><DataItem Dimensions=\"4 8\">{}</DataItem></Topology>\
         <Attribute Name=\"u\" Center=\"Node\"><DataItem Dimensions=\"20 3\">{mode}</DataItem></Attribute>\
         <Attribute Name=\"s\" Center=\"Cell\"><DataItem Dimensions=\"4 6\">{}</DataItem></Attribute>\
         <Attribute Name=\"mass\" Center=\"Node\"><DataItem Dimensions=\"20\">{mass}</DataItem></Attribute></Grid></Domain></Xdmf>",
        cells.join(" "),
        (1..=4).flat_map(|cell| (1..=6).map(move |c| (10 * cell * c).to_string())).collect::<Vec<_>>().join(" ")
    )
}

const BAR: &str =
    "displacement = \"u\"\nfrequency_hz = [5.0]\ndamping_ratio = 0.0\ninterface.root.box = [[-1.0, -0.1, -0.1], [-1.0, 0.1, 0.1]]\n";

fn import_bar(shape: impl Fn(f64) -> f64, more: &str) -> (tempfile::TempDir, ImportReport, ModalFile, ModalBody) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bar.xdmf");
    std::fs::write(&file, bar(shape)).unwrap();
    import_file(&file, &format!("{BAR}{more}"))
}

#[test]
fn stress_of_cells_stays_with_its_cells() {
    let (_folder, _, file, body) =
        import_bar(|x| x + 1.0, "density = 100.0\nstress = \"s\"\ninterface.tip.box = [[1.0, -0.1, -0.1], [1.0, 0.1, 0.1]]\n");
    // the tip moves by 2 in the mode of the file
    let scale = body.interface("tip").unwrap().mode_shape[0][5] / 2.0;
    let surface = file.read_surface(&[0]).unwrap();
    let stress = surface.stress.unwrap();
    assert_eq!(stress.place, pliant::model::surface::StressPlace::Triangle);
    for (triangle, tensor) in surface.triangles.iter().zip(&stress.values[0]) {
        let middle = triangle.iter().map(|&node| surface.points[node as usize][0]).sum::<f64>() / 3.0;
        let cell = 1.0 + (middle / 0.5).floor().clamp(0.0, 3.0);
        assert!((f64::from(tensor[1]) / (20.0 * cell * scale) - 1.0).abs() < 2.0 * f64::from(f32::EPSILON), "{middle} {tensor:?}");
    }
}

#[test]
fn times_may_be_listed_once_for_all_steps() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(data("beam.xdmf")).unwrap();
    let text = text.replace("<Time Value=\"2.5\" />", "").replace("<Time Value=\"10.0\" />", "");
    let list = "CollectionType=\"Temporal\"><Time TimeType=\"List\"><DataItem Dimensions=\"2\">7 8</DataItem></Time>";
    std::fs::write(folder.path().join("beam.xdmf"), text.replace("CollectionType=\"Temporal\">", list)).unwrap();
    std::fs::copy(data("beam.h5"), folder.path().join("beam.h5")).unwrap();
    let (_folder, _, _, body) = import_file(&folder.path().join("beam.xdmf"), &keys("beam.xdmf"));
    assert_eq!(body.frequency_hz, [7.0, 8.0]);
}

#[test]
fn free_modes_lose_their_rigid_motion() {
    let (_folder, report, _, body) = import_bar(|x| x * x - 0.33 + 0.01 * x, "density = 100.0\nboundary = \"free-free\"\n");
    assert!((body.mass - 8.0).abs() < ROUND_OFF && body.boundary == Boundary::FreeFree && body.momentum[0].amax() < ROUND_OFF);
    assert!(report.approximated.iter().any(|line| line.contains("taken out of the free modes")), "{report:?}");
    assert!(body.interface("root").unwrap().mode_shape[0][5] > 0.1);
}

#[test]
fn a_root_that_moves_makes_a_general_body_and_one_at_rest_to_rounding_a_cantilever() {
    let (_folder, report, _, body) = import_bar(|x| x * x, "density = 100.0\n");
    assert!(
        body.boundary == Boundary::General && report.approximated.iter().any(|line| line.contains("the root moves by 1.0e0")),
        "{report:?}"
    );
    let (_folder, report, _, body) = import_bar(|x| (x + 1.0) * (x + 1.0) + 1e-9, "density = 100.0\nboundary = \"cantilever\"\n");
    assert!(body.boundary == Boundary::Cantilever && report.approximated.iter().any(|line| line.contains("set to zero")), "{report:?}");
}

#[test]
fn masses_of_the_file_or_of_a_list_are_taken_as_they_are() {
    let list = format!("node_mass = {:?}\n", vec![0.5; 20]);
    for source in ["node_mass = \"mass\"\n", list.as_str()] {
        let (_folder, _, file, body) = import_bar(|x| x + 1.0, source);
        assert!((body.mass - 10.0).abs() < ROUND_OFF && file.header().node_mass_kind == NodeMassKind::Solver);
        let shape = body.interface("root").unwrap();
        assert!(shape.mode_shape[0].amax() == 0.0 && body.momentum[0].z > 1.0);
    }
}

#[test]
fn a_scene_imports_by_the_same_keys() {
    let (folder, _, file, _) = import("beam.xdmf");
    let scene = |body: &str| {
        let text = format!(
            "gravity = [0.0, 0.0, -9.81]\n[[body]]\nname = \"beam\"\n{body}\n[[hinge]]\nname = \"root\"\nkind = \"revolute\"\naxis = [0.0, 1.0, 0.0]\nparent = \"world\"\nchild = \"beam\"\n"
        );
        assemble(Source { path: data("scene.toml"), text }, &Overrides::default())
    };
    let direct = format!("modal_file = {:?}", file.path());
    let inline = format!("[body.import]\nfile = \"beam.xdmf\"\n{}", keys("beam.xdmf"));
    let (one, other) = (scene(&direct).unwrap(), scene(&inline).unwrap());
    assert_eq!(one.flexible[0].1.content_sha256, other.flexible[0].1.content_sha256);
    assert!(other.flexible[0].1.file.path().ends_with("beam.xdmf"));
    let error = scene("[body.import]\nfile = \"beam.xdmf\"\ndisplacement = \"displacement\"\n").unwrap_err();
    let text = format!("{error}: {}", std::error::Error::source(&error).unwrap());
    assert!(
        text.contains("scene.toml:") && text.contains("body[1].import.file") && text.contains("interface \"root\" is needed"),
        "{text}"
    );
    let text = scene(&format!("{direct}\n{inline}")).unwrap_err().to_string();
    assert!(text.contains("body \"beam\" has a modal_file too; give one of both"), "{text}");
    let text = scene("[body.import]\ndisplacement = \"u\"\n").unwrap_err().to_string();
    assert!(text.contains("name the XDMF or MED file to import"), "{text}");
    drop(folder);
}
