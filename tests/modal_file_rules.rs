//! Every rule of the schema refuses a file that breaks it, in words that name the file, the object, both figures and the remedy.
//!
//! Each test copies a sample, breaks one thing, writes the digest again so that it does not hide the rest, and reads the messages.
#![cfg(feature = "hdf5")]

use hdf5::types::{FixedAscii, IntSize, TypeDescriptor, VarLenUnicode};
use hdf5::{File, Location};
use pliant::io::{ModalFile, examine};
use std::path::{Path, PathBuf};

const CANTILEVER: &str = "cantilever.h5";
const FREE_FREE: &str = "free_free.h5";
const COMPLETE: &str = "complete.h5";

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// Writes a fixed-length text attribute anew.
fn text(location: &Location, name: &str, value: &str) {
    let _ = location.delete_attr(name);
    let attribute = location.new_attr::<FixedAscii<64>>().create(name).unwrap();
    attribute.write_scalar(&FixedAscii::<64>::from_ascii(value).unwrap()).unwrap();
}

/// Changes numbers in place.
fn numbers(file: &File, path: &str, change: impl FnOnce(&mut Vec<f64>)) {
    let dataset = file.dataset(path).unwrap();
    let mut values = dataset.read_raw::<f64>().unwrap();
    change(&mut values);
    dataset.write_raw(&values).unwrap();
}

/// Puts another dataset in the place of one.
fn replace<T: hdf5::H5Type>(file: &File, path: &str, shape: &[usize], values: &[T]) {
    file.unlink(path).unwrap();
    file.new_dataset::<T>().shape(shape).create(path).unwrap().write_raw(values).unwrap();
}

/// Messages about a broken copy of a sample; the copy keeps the sample's name.
fn messages(sample: &str, restamp: bool, damage: impl FnOnce(&File)) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(sample);
    std::fs::copy(data(sample), &path).unwrap();
    let file = File::open_rw(&path).unwrap();
    damage(&file);
    file.close().unwrap();
    if restamp && let Ok(sha256) = ModalFile::open(&path).and_then(|file| file.content_sha256()) {
        let file = File::open_rw(&path).unwrap();
        text(&file, "content_sha256", &sha256);
        file.close().unwrap();
    }
    let messages = examine(&path).messages();
    // loading refuses for the first of the same reasons
    let refusal = ModalFile::load(&path).map(drop).map_err(|error| error.to_string());
    let first = messages.first().expect("a broken file must be refused");
    assert!(refusal.as_ref().is_err_and(|text| text.starts_with(first.as_str())), "{refusal:?} against {first}");
    messages
}

/// One message names the file and holds all of these words.
fn assert_said(messages: &[String], sample: &str, words: &[&str]) {
    let fits = |message: &String| [sample, "found ", ", expected "].iter().chain(words).all(|word| message.contains(word));
    assert!(messages.iter().any(fits), "no message with {words:?} among:\n{}", messages.join("\n"));
}

/// `name: sample, what is broken, words of the message (object, found, expected, remedy)`.
macro_rules! refused {
    ($($name:ident: $sample:expr, $damage:expr, $words:expr;)*) => {$(
        #[test]
        fn $name() {
            assert_said(&messages($sample, true, $damage), $sample, &$words);
        }
    )*};
}

refused! {
    another_format_is_refused: CANTILEVER, |f| text(f, "format", "other"), ["@format", "\"other\"", "flexible-body-modes", "convert"];
    another_major_version_is_refused: CANTILEVER, |f| text(f, "version", "2.0"), ["@version", "\"2.0\"", "1.x", "schema 1.0"];
    units_outside_si_are_refused: CANTILEVER, |f| text(f, "units", "mm t s"), ["@units", "\"mm t s\"", "m kg s", "convert"];
    an_unknown_boundary_is_refused: CANTILEVER, |f| text(f, "boundary", "pinned"), ["@boundary", "\"pinned\"", "cantilever", "state how"];
    an_unknown_root_interface_is_refused: CANTILEVER, |f| text(f, "root_interface", "foot"), ["@root_interface", "\"foot\"", "add the interface"];
    an_unknown_kind_of_nodal_mass_is_refused: CANTILEVER, |f| text(&f.dataset("mesh/node_mass").unwrap(), "kind", "guess"), ["mesh/node_mass@kind", "\"guess\"", "row_sum"];
    an_unknown_coupling_is_refused: CANTILEVER, |f| text(&f.group("interfaces/tip").unwrap(), "coupling", "glue"), ["interfaces/tip@coupling", "\"glue\"", "rbe3"];
    an_unknown_mode_kind_is_refused: COMPLETE, |f| replace(f, "modes/kind", &[4], &[0_u8, 1, 2, 7]), ["modes/kind", "found 7", "attachment"];
    an_unknown_stress_location_is_refused: COMPLETE, |f| text(&f.group("modes/stress").unwrap(), "location", "edge"), ["modes/stress@location", "\"edge\"", "node or cell"];
    unknown_geometric_loads_are_refused: COMPLETE, |f| text(&f.dataset("geometric/stiffness").unwrap(), "loads", "acc_x acc_y"), ["geometric/stiffness@loads", "acc_x acc_y", "name the load"];
    a_geometric_matrix_of_no_interface_is_refused: COMPLETE, |f| f.relink("geometric/tip", "geometric/nose").unwrap(), ["geometric/nose", "name of an interface"];
    a_modal_mass_that_is_not_one_is_refused: COMPLETE, |f| numbers(f, "inertia/modal_mass", |v| v[0] = 1.5), ["inertia/modal_mass", "5.000e-1", "1e-6", "orthonormalise"];

    a_departure_that_is_no_number_is_refused: CANTILEVER, |f| {
        let group = f.group("inertia").unwrap();
        text(&group, "source", "lumped");
        text(&group, "departure", "soon");
    }, ["inertia@departure", "\"soon\"", "a number of zero or more", "import the body again"];
    a_missing_dataset_is_refused: CANTILEVER, |f| f.unlink("body/mass").unwrap(), ["body/mass", "found nothing", "a dataset"];
    a_missing_group_is_refused: CANTILEVER, |f| f.unlink("interfaces/mid").and(f.unlink("modes")).unwrap(), ["modes/displacement", "found nothing", "one dataset per mode"];
    a_missing_attribute_is_refused: CANTILEVER, |f| f.delete_attr("mode_count").unwrap(), ["@mode_count", "found nothing", "an integer"];
    a_missing_mode_is_refused: CANTILEVER, |f| f.unlink("modes/displacement/0001").unwrap(), ["modes/displacement", "2 datasets", "one dataset per mode"];
    single_precision_integrals_are_refused: CANTILEVER, |f| replace(f, "inertia/momentum", &[3, 3], &[0.0_f32; 9]), ["inertia/momentum", "<f4", "<f8"];
    narrow_integers_are_refused: CANTILEVER, |f| replace(f, "interfaces/tip/nodes", &[1], &[1_i32]), ["interfaces/tip/nodes", "found i4", "i8"];
    booleans_are_refused: CANTILEVER, |f| replace(f, "modes/kind", &[3], &[false; 3]), ["modes/kind", "a boolean", "plain little-endian"];
    variable_length_texts_are_refused: CANTILEVER, |f| {
        f.delete_attr("title").unwrap();
        f.new_attr::<VarLenUnicode>().create("title").unwrap().write_scalar(&"boom".parse::<VarLenUnicode>().unwrap()).unwrap();
    }, ["@title", "a variable-length text", "fixed-length", "numpy.bytes_"];
    a_variable_length_dataset_is_refused: CANTILEVER, |f| {
        f.new_dataset::<VarLenUnicode>().shape(2).create("notes").unwrap();
    }, ["notes", "a variable-length text", "little-endian f8"];
    a_type_nested_without_end_is_refused: CANTILEVER, |f| {
        let deep = (0..500).fold(TypeDescriptor::Integer(IntSize::U4), |inner, _| TypeDescriptor::VarLenArray(Box::new(inner)));
        f.new_dataset_builder().empty_as(&deep).shape(1).create("extra").unwrap();
    }, ["extra", "variable-length or odd", "plain little-endian"];
    control_characters_are_refused: CANTILEVER, |f| text(f, "title", "boom\u{1b}[2J"), ["@title", "control characters", "printable"];
    a_name_with_control_characters_is_refused: CANTILEVER, |f| f.relink("interfaces/mid", "interfaces/m\u{7}").unwrap(), ["interfaces", "\"m\\u{7}\"", "rename"];
    another_shape_is_refused: CANTILEVER, |f| replace(f, "body/center_of_mass", &[4], &[0.0; 4]), ["body/center_of_mass", "shape (4)", "(3)"];
    a_node_count_that_disagrees_is_refused: CANTILEVER, |f| f.attr("node_count").unwrap().write_scalar(&27_i64).unwrap(), ["(26, 3)", "(27, 3)", "node_count"];
    a_huge_declared_size_is_refused: CANTILEVER, |f| {
        f.new_dataset::<f64>().chunk((1000, 1000)).deflate(4).shape((1_000_000, 1_000_000)).create("extra").unwrap();
    }, ["extra", "(1000000, 1000000) elements of 8 bytes", "2147483648 bytes"];
    a_size_that_the_file_cannot_hold_is_refused: CANTILEVER, |f| {
        f.new_dataset::<f64>().shape(10_000_000).create("extra").unwrap();
    }, ["extra", "(10000000) elements", "damaged"];
    a_dataset_never_written_is_refused: CANTILEVER, |f| {
        f.unlink("modes/damping_ratio").unwrap();
        f.new_dataset::<f64>().shape(3).create("modes/damping_ratio").unwrap();
    }, ["modes/damping_ratio", "0 bytes", "24 bytes", "write it again"];
    a_missing_chunk_is_refused: CANTILEVER, |f| {
        f.unlink("modes/damping_ratio").unwrap();
        f.new_dataset::<f64>().chunk(2).shape(3).create("modes/damping_ratio").unwrap().write_slice(&[0.01, 0.01], 0..2).unwrap();
    }, ["modes/damping_ratio", "1 chunks", "2 chunks"];
    a_soft_link_is_refused: CANTILEVER, |f| f.link_soft("/body/mass", "alias").unwrap(), ["alias", "a soft link", "hard links"];
    an_external_link_is_refused: CANTILEVER, |f| f.link_external("other.h5", "/mass", "body/mass2").unwrap(), ["body/mass2", "an external link"];
    external_storage_is_refused: CANTILEVER, |f| {
        f.new_dataset::<f64>().external("raw.bin", 0, 24).shape(3).create("extra").unwrap();
    }, ["extra", "external storage", "in the file itself"];
    another_filter_is_refused: CANTILEVER, |f| {
        f.unlink("modes/damping_ratio").unwrap();
        f.new_dataset::<f64>().chunk(3).nbit().shape(3).create("modes/damping_ratio").unwrap().write(&[0.01; 3]).unwrap();
    }, ["modes/damping_ratio", "NBit", "fletcher32", "h5repack"];
    groups_in_a_circle_are_refused: CANTILEVER, |f| f.link_hard("/", "body/again").unwrap(), ["at most 100000 objects", "circle"];

    a_cell_on_no_node_is_refused: CANTILEVER, |f| f.dataset("mesh/cells").unwrap().write_raw(&vec![26_i64; 83 * 4]).unwrap(), ["mesh/cells", "index 26", "0 to 25", "count from 0"];
    a_triangle_off_the_surface_is_refused: COMPLETE, |f| f.dataset("mesh/surface_triangles").unwrap().write_slice(&[200_i64], (0..1, 0)).unwrap(), ["mesh/surface_triangles", "index 200", "0 to 149"];
    a_negative_node_is_refused: CANTILEVER, |f| f.dataset("interfaces/tip/nodes").unwrap().write_raw(&[-1_i64]).unwrap(), ["interfaces/tip/nodes", "index -1", "0 to 25"];
    a_displacement_that_is_not_a_number_is_refused: CANTILEVER, |f| numbers(f, "modes/displacement/0001", |v| v[5] = f64::NAN), ["modes/displacement/0001", "NaN at flat index 5", "finite"];
    an_infinite_stress_is_refused: COMPLETE, |f| f.dataset("modes/stress/0002").unwrap().write_slice(&[f32::INFINITY], (3..4, 0)).unwrap(), ["modes/stress/0002", "inf at flat index 18"];
    a_number_beyond_use_is_refused: CANTILEVER, |f| numbers(f, "body/inertia", |v| v[0] = 1e200), ["body/inertia", "1e100"];

    a_frequency_of_zero_is_refused: CANTILEVER, |f| numbers(f, "modes/frequency", |v| v[0] = 0.0), ["modes/frequency", "frequencies positive", "more than 0", "rigid-body"];
    unsorted_frequencies_are_refused: CANTILEVER, |f| numbers(f, "modes/frequency", |v| v.swap(0, 2)), ["modes/frequency", "ascending", "sort"];
    negative_damping_is_refused: CANTILEVER, |f| numbers(f, "modes/damping_ratio", |v| v[1] = -0.01), ["modes/damping_ratio", "-1.000e-2", "at least 0"];
    an_unsymmetric_stiffness_is_refused: COMPLETE, |f| numbers(f, "modes/stiffness", |v| v[1] += 1.0), ["modes/stiffness", "symmetric", "at most 1e-9"];
    a_negative_stiffness_is_refused: COMPLETE, |f| numbers(f, "modes/stiffness", |v| v[0] = -v[0]), ["modes/stiffness", "semidefinite"];
    a_negative_mass_is_refused: CANTILEVER, |f| numbers(f, "body/mass", |v| v[0] = -1.0), ["body/mass", "-1.000e0", "more than 0"];
    a_centre_of_mass_outside_the_mesh_is_refused: CANTILEVER, |f| numbers(f, "body/center_of_mass", |v| v[0] += 100.0), ["body/center_of_mass", "inside mesh", "from the origin"];
    an_unsymmetric_inertia_is_refused: CANTILEVER, |f| numbers(f, "body/inertia", |v| v[1] += 1e-6), ["body/inertia", "inertia symmetric", "1e-12"];
    an_inertia_below_that_of_the_centre_of_mass_is_refused: CANTILEVER, |f| numbers(f, "body/inertia", |v| v.iter_mut().for_each(|j| *j *= 1e-3)), ["body/inertia", "central inertia positive", "about the origin"];
    an_inertia_of_no_body_is_refused: CANTILEVER, |f| numbers(f, "body/inertia", |v| v[0] += 1e3), ["body/inertia", "triangle", "1e-12"];
    modes_that_are_not_orthonormal_are_refused: CANTILEVER, |f| numbers(f, "inertia/second_moment", |v| v.iter_mut().for_each(|p| *p *= 1.001)), ["inertia/second_moment", "orthonormal", "at most 1e-6", "scale"];
    an_unsymmetric_second_moment_is_refused: CANTILEVER, |f| numbers(f, "inertia/second_moment", |v| { v[9] += 1e-9; v[13] -= 1e-9; }), ["inertia/second_moment", "second moment symmetric", "1e-12"];
    more_effective_mass_than_mass_is_refused: CANTILEVER, |f| numbers(f, "inertia/momentum", |v| v.iter_mut().for_each(|p| *p *= 1e3)), ["inertia/momentum", "effective mass", "at most 1.000000001e0"];
    more_effective_inertia_than_inertia_is_refused: CANTILEVER, |f| numbers(f, "inertia/first_moment", |v| v.iter_mut().for_each(|q| *q *= 1e3)), ["inertia/first_moment", "effective inertia"];
    nodal_masses_that_miss_the_mass_are_refused: CANTILEVER, |f| numbers(f, "mesh/node_mass", |v| v[3] *= 1.001), ["mesh/node_mass", "adds up", "1e-9", "unit of mass"];
    exchanged_nodal_masses_are_refused: CANTILEVER, |f| numbers(f, "mesh/node_mass", |v| v.swap(3, 20)), ["mesh/node_mass", "gives centre of mass", "1e-9"];
    an_inertia_that_the_nodes_deny_is_refused: CANTILEVER, |f| numbers(f, "body/inertia", |v| v.iter_mut().for_each(|j| *j *= 1.001)), ["mesh/node_mass", "gives inertia", "1e-4"];
    a_momentum_that_the_nodes_deny_is_refused: CANTILEVER, |f| numbers(f, "inertia/momentum", |v| v[0] *= 1.0 + 1e-6), ["inertia/momentum", "gives momentum", "1e-9"];
    a_first_moment_that_the_nodes_deny_is_refused: CANTILEVER, |f| numbers(f, "inertia/first_moment", |v| v.iter_mut().for_each(|q| *q *= 0.5)), ["inertia/first_moment", "gives first moments", "1e-2"];
    a_mode_shape_of_another_scale_is_refused: CANTILEVER, |f| numbers(f, "modes/displacement/0000", |v| v.iter_mut().for_each(|u| *u *= 1.05)), ["modes/displacement", "gives modal mass", "1e-2"];
    a_root_node_that_moves_is_refused: CANTILEVER, |f| {
        let root = f.dataset("interfaces/root/nodes").unwrap().read_raw::<i64>().unwrap()[0] as usize;
        numbers(f, "modes/displacement/0000", |v| v[3 * root] = 1e-9);
    }, ["modes/displacement", "root nodes at rest", "at most 0", "clamp"];
    a_root_interface_that_turns_is_refused: CANTILEVER, |f| numbers(f, "interfaces/root/displacement", |v| v[4] = 1e-9), ["interfaces/root/displacement", "root interface at rest"];
    free_free_modes_with_momentum_are_refused: FREE_FREE, |f| numbers(f, "inertia/momentum", |v| v[0] += 1e-3), ["inertia/momentum", "free-free momentum zero", "1e-6", "rigid-body"];
    free_free_modes_with_angular_momentum_are_refused: FREE_FREE, |f| numbers(f, "inertia/first_moment", |v| v[1] += 1e-3), ["inertia/first_moment", "free-free angular momentum zero"];
    weights_that_miss_one_are_refused: COMPLETE, |f| numbers(f, "interfaces/tip/weights", |v| v[0] *= 1.1), ["interfaces/tip/weights", "weights add up", "1e-12", "divide"];
    an_interface_beside_its_nodes_is_refused: COMPLETE, |f| numbers(f, "interfaces/tip/position", |v| v[2] += 1e-3), ["interfaces/tip/position", "position from nodes", "1e-9"];
    an_interface_with_rotation_first_is_refused: COMPLETE, |f| numbers(f, "interfaces/tip/displacement", |v| v[..6].rotate_left(3)), ["interfaces/tip/displacement", "motion from nodes", "1e-6", "order"];
    interface_axes_that_mirror_are_refused: COMPLETE, |f| numbers(f, "interfaces/tip/orientation", |v| v[2] = -v[2]), ["interfaces/tip/orientation", "a rotation", "1e-9", "right-handed"];
    a_root_off_the_origin_is_refused: CANTILEVER, |f| numbers(f, "interfaces/root/position", |v| v[0] += 0.1), ["interfaces/root/position", "root interface at origin", "1e-9"];
    an_unsymmetric_geometric_stiffness_is_refused: COMPLETE, |f| numbers(f, "geometric/stiffness", |v| v[1] += 1.0), ["geometric/stiffness", "geometric stiffness symmetric", "1e-9"];
    an_unsymmetric_interface_stiffening_is_refused: COMPLETE, |f| numbers(f, "geometric/tip", |v| v[1] += 1.0), ["geometric/tip", "geometric stiffness symmetric"];
}

#[test]
fn an_edit_without_a_new_digest_is_refused() {
    let said = messages(CANTILEVER, false, |f| numbers(f, "modes/damping_ratio", |v| v[0] = 0.02));
    assert_said(&said, CANTILEVER, &["@content_sha256", "content digest", "from the data", "restore the file"]);
}

#[test]
fn a_flipped_bit_fails_its_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(COMPLETE);
    let mut bytes = std::fs::read(data(COMPLETE)).unwrap();
    let offset = File::open(data(COMPLETE)).unwrap().dataset("mesh/points").unwrap().chunk_info(0).unwrap().addr as usize;
    bytes[offset + 20] ^= 4;
    std::fs::write(&path, bytes).unwrap();
    assert_said(&examine(&path).messages(), COMPLETE, &["mesh/points", "unreadable data", "checksum", "copy or write it again"]);
}

#[test]
fn a_file_that_is_no_hdf5_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("text.h5");
    std::fs::write(&path, "mass 3").unwrap();
    for (path, word) in [
        (path, "cannot be opened"),
        (folder.path().join("absent.h5"), "cannot be opened"),
        (folder.path().to_owned(), "not a regular file"),
    ] {
        let message = ModalFile::load(&path).unwrap_err().to_string();
        assert!(message.contains(word) && message.contains("check the path"), "{message}");
    }
}
