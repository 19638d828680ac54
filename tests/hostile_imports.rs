//! Files made to cost time or memory out of proportion to their length: `pliant import` refuses them within 10 s and 1 GiB.
#![cfg(feature = "hdf5")]

#[path = "support/limits.rs"]
mod limits;

use hdf5::File;
use limits::run_within;
use std::path::{Path, PathBuf};

/// Address space in KiB.
const ADDRESS_SPACE_KIB: u64 = 1 << 20;
/// Keys that ask for a clamped triangle or tetrahedron.
const KEYS: &str = "displacement = \"u\"\ndensity = 1.0\ndamping_ratio = 0.0\ninterface.root.nodes = [0, 1, 2]\n";
/// A tetrahedron.
const MESH: &str = "<Topology TopologyType='Tetrahedron'><DataItem Dimensions='1 4'>0 1 2 3</DataItem></Topology>\
                    <Geometry><DataItem Dimensions='4 3'>0 0 0 1 0 0 0 1 0 0 0 1</DataItem></Geometry>";

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name)
}

/// What the program says about a file that it refuses.
fn refusal(file: &Path, keys: &str) -> String {
    let (keys_file, out) = (file.with_file_name("keys.toml"), file.with_file_name("out.h5"));
    std::fs::write(&keys_file, keys).unwrap();
    let arguments = ["import".as_ref(), file.as_os_str(), "--keys".as_ref(), keys_file.as_os_str(), "--out".as_ref(), out.as_os_str()];
    let output = run_within(&arguments, ADDRESS_SPACE_KIB).expect("ends by itself");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{}: {message}", output.status);
    message
}

/// A temporal collection of `grids` in an XDMF file of its own folder.
fn collection(folder: &Path, grids: &str) -> PathBuf {
    let file = folder.join("many.xdmf");
    let text = format!("<Xdmf><Domain><Grid Name='c' GridType='Collection' CollectionType='Temporal'>{grids}</Grid></Domain></Xdmf>");
    std::fs::write(&file, text).unwrap();
    file
}

#[test]
fn steps_that_point_at_the_last_of_many_grids_are_found_without_a_search_each() {
    let folder = tempfile::tempdir().unwrap();
    let count = 60_000;
    let by_name = "<Grid><include xpointer='xpointer(//Grid[@Name=\"last\"])'/></Grid>".repeat(count);
    let by_number = format!("<Grid><include xpointer='xpointer(//Grid[@Name=\"c\"]/Grid[{}])'/></Grid>", count + 1).repeat(count);
    for steps in [by_name, by_number] {
        let file = collection(folder.path(), &format!("{steps}<Grid Name='last'>{MESH}</Grid>"));
        assert!(
            refusal(&file, KEYS)
                .contains("displacement = \"u\": found no field of that name, expected one of none; name a field of the file")
        );
    }
}

#[test]
fn a_long_mesh_is_compared_once_for_all_steps_that_point_at_it() {
    let folder = tempfile::tempdir().unwrap();
    // blanks between numbers are as good as numbers here
    let long = MESH.replace("0 1 2 3<", &format!("0{}1 2 3<", " ".repeat(8 << 20)));
    let steps = "<Grid><include xpointer='xpointer(//Grid[@Name=\"same\"])'/></Grid>".repeat(60_000);
    let file = collection(folder.path(), &format!("<Grid>{long}</Grid><Grid Name='same'>{long}</Grid>{steps}"));
    assert!(refusal(&file, KEYS).contains("displacement = \"u\": found no field of that name"));
}

#[test]
fn a_mesh_behind_many_attributes_is_found_once() {
    let folder = tempfile::tempdir().unwrap();
    let steps = "<Grid><include xpointer='xpointer(//Grid[@Name=\"full\"])'/></Grid>".repeat(50_000);
    let file = collection(folder.path(), &format!("<Grid Name='full'>{}{MESH}</Grid>{steps}", "<X/>".repeat(90_000)));
    assert!(refusal(&file, KEYS).contains("displacement = \"u\": found no field of that name"));
}

#[test]
fn stress_of_all_modes_together_is_bounded_by_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let cells = 300_000;
    let file = File::create(folder.path().join("s.h5")).unwrap();
    let packed = |name: &str, shape: (usize, usize)| file.new_dataset::<f32>().shape(shape).chunk(shape).deflate(9).create(name).unwrap();
    packed("s", (cells, 6)).write_raw(&vec![0.0_f32; 6 * cells]).unwrap();
    let nodes: Vec<u8> = [0, 1, 2, 3].repeat(cells);
    let shape = (cells, 4);
    file.new_dataset::<u8>().shape(shape).chunk(shape).deflate(9).create("t").unwrap().write_raw(&nodes).unwrap();
    file.close().unwrap();
    let step = |i: usize| {
        format!(
            "<Time Value='{}'/><Attribute Name='u'><DataItem Dimensions='4 3'>0 0 0 0 0 0 0 0 0 1 0 0</DataItem></Attribute>\
             <Attribute Name='s' Center='Cell'><DataItem Dimensions='{cells} 6' Format='HDF'>s.h5:/s</DataItem></Attribute>",
            i + 2
        )
    };
    let mesh = MESH.replace("Dimensions='1 4'>0 1 2 3<", &format!("Dimensions='{cells} 4' Format='HDF'>s.h5:/t<"));
    let later: String = (1..400).map(|i| format!("<Grid>{}</Grid>", step(i))).collect();
    let file = collection(folder.path(), &format!("<Grid>{mesh}{}</Grid>{later}", step(0)));
    let message = refusal(&file, &format!("stress = \"s\"\n{KEYS}"));
    assert!(message.contains("the stress of all modes: found 5760000000 bytes, expected at most "), "{message}");
    assert!(message.contains("packed beyond what mode shapes need: write it again"), "{message}");
}

/// A copy of a MED sample with one thing changed.
fn med(folder: &Path, change: impl FnOnce(&File)) -> PathBuf {
    let path = folder.join("beam_h5py.med");
    std::fs::copy(data("beam_h5py.med"), &path).unwrap();
    let file = File::open_rw(&path).unwrap();
    change(&file);
    file.close().unwrap();
    path
}

const STATE: &str = "ENS_MAA/body/-0000000000000000001-0000000000000000001";

#[test]
fn few_cells_in_many_groups_each_are_bounded_by_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (cells, groups) = (100_000, 1000);
    let file = med(folder.path(), |file| {
        let packed = |path: &str, values: &[i32]| {
            let group = path.rsplit_once('/').unwrap().0;
            if !file.link_exists(group) {
                file.create_group(group).unwrap();
            }
            let dataset = file.new_dataset::<i32>().shape(values.len()).chunk(values.len()).deflate(9).create(path).unwrap();
            dataset.write_raw(values).unwrap();
            dataset
        };
        let nodes = packed(&format!("{STATE}/MAI/SE2/NOD"), &[vec![1; cells], vec![2; cells]].concat());
        nodes.new_attr::<i32>().create("NBR").unwrap().write_scalar(&(cells as i32)).unwrap();
        packed(&format!("{STATE}/MAI/SE2/FAM"), &vec![-77; cells]);
        let family = file.create_group("FAS/body/ELEME/many").unwrap();
        family.new_attr::<i32>().create("NUM").unwrap().write_scalar(&-77).unwrap();
        let name = |i: usize| -> [i8; 80] { std::array::from_fn(|k| format!("{i:<80}").as_bytes()[k] as i8) };
        let names: Vec<[i8; 80]> = (0..groups).map(name).collect();
        let dataset = family.create_group("GRO").unwrap().new_dataset::<[i8; 80]>().shape(groups).create("NOM").unwrap();
        dataset.write_raw(&names).unwrap();
    });
    let message = refusal(&file, &std::fs::read_to_string(data("beam_h5py.med.toml")).unwrap());
    assert!(message.contains("FAS/body/ELEME: found 16"), "{message}");
    assert!(message.contains(" bytes, expected at most "), "{message}");
}

#[test]
fn an_object_of_very_many_attributes_is_refused_as_each_is_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    let file = med(folder.path(), |file| {
        let group = file.group("ENS_MAA/body").unwrap();
        group.delete_attr("ESP").unwrap();
        (0..1001).for_each(|i| group.new_attr::<u8>().create(format!("A{i}").as_str()).unwrap().write_scalar(&0_u8).unwrap());
        group.new_attr::<i32>().create("ESP").unwrap().write_scalar(&3).unwrap();
    });
    let message = refusal(&file, &std::fs::read_to_string(data("beam_h5py.med.toml")).unwrap());
    assert!(message.contains("ENS_MAA/body@ESP: found unreadable data (more than 1000 attributes"), "{message}");
}

/// A file of 45^3 links to one group.
fn web_of_links(path: &Path) {
    let file = File::create(path).unwrap();
    let groups: Vec<_> = (0..4).map(|level| file.create_group(&format!("L{level}")).unwrap()).collect();
    for level in 1..4 {
        (0..45).for_each(|i| groups[level - 1].link_hard(&format!("/L{level}"), &format!("x{i}")).unwrap());
    }
    file.new_dataset::<f64>().shape(3).create("d").unwrap().write_raw(&[0.0, 0.0, 0.0]).unwrap();
    file.close().unwrap();
}

#[test]
fn objects_of_all_files_behind_one_xdmf_file_are_bounded_together() {
    let folder = tempfile::tempdir().unwrap();
    web_of_links(&folder.path().join("a.h5"));
    std::fs::copy(folder.path().join("a.h5"), folder.path().join("b.h5")).unwrap();
    let mesh = MESH.replace("4 3'>0 0 0 1 0 0 0 1 0 0 0 1", "1 3' Format='HDF'>b.h5:/d");
    let listed = format!("<Time TimeType='List'><DataItem Dimensions='3' Format='HDF'>a.h5:/d</DataItem></Time><Grid>{mesh}</Grid>");
    let message = refusal(&collection(folder.path(), &listed), KEYS);
    assert!(
        message.contains(" objects in the HDF5 files up to b.h5, expected at most 100000; leave what is no mode out of the HDF5 files"),
        "{message}"
    );
}

#[test]
fn one_file_under_several_names_counts_once() {
    let folder = tempfile::tempdir().unwrap();
    web_of_links(&folder.path().join("a.h5"));
    let listed = "<Time TimeType='List'><DataItem Dimensions='3' Format='HDF'>./a.h5:/d</DataItem></Time>\
                  <Grid><Topology TopologyType='Triangle'><DataItem Dimensions='1 3'>0 0 0</DataItem></Topology>\
                  <Geometry><DataItem Dimensions='1 3' Format='HDF'>a.h5:/d</DataItem></Geometry></Grid>";
    assert!(refusal(&collection(folder.path(), listed), KEYS).contains("triangle number 1: found a measure of 0.0e0"));
}
