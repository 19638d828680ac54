//! Sound modal files are read whole: integrals, interfaces, stiffness matrices, surface, single nodes.
#![cfg(feature = "hdf5")]

use nalgebra::{Matrix3, Vector3};
use pliant::io::modal_check::angular_momentum;
use pliant::io::modal_file::GEOMETRIC_LOADS;
use pliant::io::{Bound, Coupling, ModalFile, ModeKind, Verdict, examine};
use pliant::model::modal_body::Boundary;
use pliant::model::surface::StressPlace;
use std::path::{Path, PathBuf};

/// Mode shapes of `complete.h5` are stored in single precision.
const SINGLE: f64 = f32::EPSILON as f64;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

#[test]
fn samples_hold_every_rule_to_round_off() {
    for sample in ["cantilever.h5", "free_free.h5", "complete.h5"] {
        let report = examine(&data(sample)).report;
        assert!(report.is_accepted() && report.with_verdict(Verdict::NotReached).next().is_none(), "{report:?}");
        for row in &report.rows {
            // relative figures with a small limit are sums over at most 210 nodes: far below the limits of the schema
            if let (Some(figure), Some(Bound::AtMost(limit))) = (row.figure, row.bound)
                && limit > 0.0
                && limit < 0.1
            {
                let round_off = if sample == "complete.h5" { 4.0 * SINGLE } else { 1e3 * f64::EPSILON };
                assert!(figure <= round_off.min(limit), "{sample}: {row:?}");
            }
        }
    }
}

#[test]
fn the_digest_of_another_program_is_reproduced() {
    let file = ModalFile::open(&data("complete.h5")).unwrap();
    assert_eq!(file.content_sha256().unwrap(), file.header().content_sha256);
}

#[test]
fn a_body_has_the_sizes_of_its_header() {
    let (file, body) = ModalFile::load_body(&data("free_free.h5")).unwrap();
    let n = file.header().mode_count;
    assert_eq!((n, body.mode_count(), body.boundary), (6, 6, Boundary::FreeFree));
    assert_eq!((body.momentum.len(), body.first_moment.len(), body.second_moment.len()), (n, n, n * n));
    assert!(body.stiffness.is_none() && body.geometric_stiffness.is_none() && body.angular_momentum.is_none());
    assert_eq!(body.interfaces.iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["mid", "root", "tip"]);
    assert!(body.interfaces.iter().all(|i| i.mode_shape.len() == n && i.orientation == Matrix3::identity()));
}

#[test]
fn integrals_keep_their_axes() {
    let (file, body) = ModalFile::load_body(&data("cantilever.h5")).unwrap();
    let points = file.read_points().unwrap();
    let mass = hdf5::File::open(data("cantilever.h5")).unwrap().dataset("mesh/node_mass").unwrap().read_raw::<f64>().unwrap();
    let shapes: Vec<Vec<Vector3<f64>>> = (0..points.len()).map(|node| file.node_displacement(node).unwrap()).collect();
    for mode in 0..body.mode_count() {
        let weighted = || mass.iter().zip(&points).zip(&shapes).map(|((m, r), u)| (*m, r, u[mode]));
        let first: Matrix3<f64> = weighted().map(|(m, r, u)| m * r * u.transpose()).sum();
        let turning: Vector3<f64> = weighted().map(|(m, r, u)| m * r.cross(&u)).sum();
        let second: Matrix3<f64> = mass.iter().zip(&shapes).map(|(m, u)| *m * u[0] * u[mode].transpose()).sum();
        // sums of 26 terms of order one
        let round_off = 1e3 * f64::EPSILON;
        assert!((first - body.first_moment[mode]).amax() < round_off);
        assert!((turning - angular_momentum(&body)[mode]).amax() < round_off);
        assert!((second - body.second_moment[mode]).amax() < round_off);
    }
}

#[test]
fn an_interface_has_rotation_before_translation() {
    let (file, body) = ModalFile::load_body(&data("cantilever.h5")).unwrap();
    let (tip, support) = (body.interface("tip").unwrap(), file.read_interface_supports().unwrap().remove(2));
    assert_eq!((support.name.as_str(), support.coupling, support.nodes.len()), ("tip", Coupling::Rbe2, 1));
    for (shape, node) in tip.mode_shape.iter().zip(file.node_displacement(support.nodes[0]).unwrap()) {
        assert_eq!(shape.fixed_rows::<3>(3), node);
    }
    let raw = hdf5::File::open(data("cantilever.h5")).unwrap().dataset("interfaces/tip/displacement").unwrap().read_raw::<f64>().unwrap();
    assert_eq!(tip.mode_shape[1].as_slice(), [raw[9], raw[10], raw[11], raw[6], raw[7], raw[8]]);
}

#[test]
fn geometric_loads_are_sorted_by_name() {
    let (file, body) = ModalFile::load_body(&data("complete.h5")).unwrap();
    let raw = hdf5::File::open(data("complete.h5")).unwrap().dataset("geometric/stiffness").unwrap().read_raw::<f64>().unwrap();
    // the file starts with the six products of omega
    let matrices = body.geometric_stiffness.unwrap();
    assert_eq!((GEOMETRIC_LOADS[0], matrices[0][(1, 2)]), ("acc_x", raw[6 * 16 + 6]));
    assert_eq!((GEOMETRIC_LOADS[6], matrices[6][(1, 2)]), ("omega_xx", raw[6]));
    assert_eq!(file.read_interface_geometric_stiffness("tip").unwrap().unwrap().len(), 6);
    assert!(file.read_interface_geometric_stiffness("root").unwrap().is_none());
}

#[test]
fn optional_parts_are_read() {
    let (file, body) = ModalFile::load_body(&data("complete.h5")).unwrap();
    assert!(body.stiffness.is_some_and(|s| s.nrows() == 4) && body.angular_momentum.is_some_and(|l| l.len() == 4));
    assert_eq!(file.read_mode_kinds().unwrap(), [ModeKind::Normal, ModeKind::CraigBampton, ModeKind::Attachment, ModeKind::Normal]);
    assert_eq!(file.node_rotation(7).unwrap().unwrap().len(), 4);
    assert!((body.interfaces[1].orientation - Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)).amax() == 0.0);
    let error = file.node_displacement(210).unwrap_err().to_string();
    assert!(error.contains("no node 210") && error.contains("0 to 209"), "{error}");
}

#[test]
fn a_surface_carries_the_stress_of_the_cell_behind_each_triangle() {
    let file = ModalFile::load(&data("complete.h5")).unwrap();
    let surface = file.read_surface(&[3, 0]).unwrap();
    assert_eq!((surface.points.len(), surface.displacement.len(), surface.displacement[0].len()), (150, 2, 150));
    assert_eq!(surface.displacement[1][9].map(f64::from), <[f64; 3]>::from(file.node_displacement(9).unwrap()[0]));
    let stress = surface.stress.unwrap();
    assert_eq!((stress.place, stress.values.len(), stress.values[0].len()), (StressPlace::Triangle, 2, surface.triangles.len()));
    // the stress of cell c in mode j is c (1 2 3 4 5 6) + 1000 j, so that xx of mode 0 names the cell
    let cells = hdf5::File::open(data("complete.h5")).unwrap().dataset("mesh/cells").unwrap().read_raw::<i64>().unwrap();
    for (triangle, (last, first)) in surface.triangles.iter().zip(stress.values[0].iter().zip(&stress.values[1])) {
        let cell = first[0] as usize;
        assert!(triangle.iter().all(|&node| cells[8 * cell..8 * cell + 8].contains(&i64::from(node))));
        assert_eq!(last[5], 3000.0 + 6.0 * first[0]);
    }
    assert!(file.read_surface(&[4]).unwrap_err().to_string().contains("no mode 5"));
}

#[test]
fn surface_triangles_point_outward() {
    let surface = ModalFile::load(&data("complete.h5")).unwrap().read_surface(&[]).unwrap();
    let corner = |node: u32| Vector3::from(surface.points[node as usize]);
    let volume: f64 = surface.triangles.iter().map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c))) / 6.0).sum();
    // the block is 1.8 x 0.4 x 0.5 m; sums of 300 products
    assert!((volume - 0.36).abs() < 1e3 * f64::EPSILON, "{volume}");
}
