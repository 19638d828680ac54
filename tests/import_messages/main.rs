//! Every refusal of an import names the file, the object, what was found, what was expected and what to do; exit code 2.
#![cfg(feature = "hdf5")]

mod whole_texts;

use hdf5::File;
use pliant::io::import::import_to;
use pliant::scene::import_spec::ImportSpec;
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name)
}

fn keys(sample: &str) -> String {
    std::fs::read_to_string(data(&format!("{sample}.toml"))).unwrap()
}

/// The message about `file`.
fn refusal(file: &Path, keys: &str) -> String {
    let spec: ImportSpec = toml::from_str(keys).unwrap();
    let out = file.with_file_name("out.h5");
    let error = import_to(file, &spec.options().unwrap(), &out).map(|_| ()).expect_err("must be refused");
    assert!(!out.exists(), "a refused import leaves no file");
    error.to_string()
}

/// The message holds all these words.
fn assert_said(message: &str, sample: &str, words: &[&str]) {
    assert!([sample].iter().chain(words).all(|word| message.contains(word)), "{words:?} in:\n{message}");
}

/// A copy of an XDMF sample with one text exchanged for another; the HDF5 file lies beside it.
fn xdmf(sample: &str, from: &str, to: &str, keys: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(data(sample)).unwrap();
    assert!(text.contains(from), "{from} in {sample}");
    std::fs::write(folder.path().join(sample), text.replacen(from, to, 1)).unwrap();
    std::fs::copy(data("beam.h5"), folder.path().join("beam.h5")).unwrap();
    refusal(&folder.path().join(sample), keys)
}

/// A copy of a MED sample with one thing changed.
fn med(sample: &str, change: impl FnOnce(&File), keys: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(sample);
    std::fs::copy(data(sample), &path).unwrap();
    let file = File::open_rw(&path).unwrap();
    change(&file);
    file.close().unwrap();
    refusal(&path, keys)
}

/// `name: sample, from, to, words` of the message.
macro_rules! xdmf_refused {
    ($($name:ident: $sample:expr, $from:expr, $to:expr, $words:expr;)*) => {$(
        #[test]
        fn $name() {
            assert_said(&xdmf($sample, $from, $to, &keys($sample)), $sample, &$words);
        }
    )*};
}

xdmf_refused! {
    two_domains: "mixed.xdmf", "<Domain>", "<Domain/><Domain>", ["Xdmf: found 2 domains, expected one Domain"];
    no_mesh: "beam.xdmf", "ns0:include", "ns0:exclude", ["Grid: found no Topology and Geometry, expected both, or an include", "with the modes"];
    a_time_of_another_kind: "beam.xdmf", "<Grid><", "<Time TimeType=\"HyperSlab\"/><Grid><", ["Time: found the time type HyperSlab, expected a list, or a Time in each grid"];
    two_items: "mixed.xdmf", "</DataItem></Geometry>", "</DataItem><DataItem/></Geometry>", ["Geometry: found 2 data items, expected one"];
    an_offset: "beam.xdmf", "<Topology ", "<Topology BaseOffset=\"1\" ", ["Topology: found an order or offset of its own, expected nodes counted from 0"];
    four_extents: "beam.xdmf", "Dimensions=\"20 3\"", "Dimensions=\"20 1 1 3\"", ["Attribute \"displacement\": found 4 extents, expected one to three"];
    control_characters_in_a_path: "beam.xdmf", "beam.h5:/data0", "be\u{7}am.h5:/data0", ["Geometry: found \"be\u{fffd}am.h5:/data0\", expected FILE.h5:/path/of/dataset"];
    no_path: "beam.xdmf", "beam.h5:/data0", "data0", ["Geometry: found \"data0\", expected FILE.h5:/path/of/dataset"];
    a_real_node: "mixed.xdmf", "\n9\n0\n", "\n9\n0.5\n", ["Topology: found \"0.5\", expected integers"];
    reals_as_nodes: "beam.xdmf", "beam.h5:/data1", "beam.h5:/data0", ["Topology: found 60 values, expected 32"];
    a_stream_cut_short: "mixed.xdmf", "\n6\n10\n13\n11\n12", "\n9\n10\n13\n11\n12", ["Topology: found 4 numbers after the last hexahedron, expected 8", "cut short"];
    a_long_line: "mixed.xdmf", "\n9\n0\n", "\n2\n8\n", ["Topology: found a polyline of other than two nodes, expected lines of two nodes"];
    a_field_without_name: "mixed.xdmf", "Name=\"mode_0\"", "", ["Attribute: found no name, expected a Name; name every field"];
    a_name_twice_in_one_grid: "mixed.xdmf", "Name=\"mode_1\"", "Name=\"mode_0\"", ["Attribute \"mode_0\": found the name twice in one grid"];
    too_wide_a_field: "mixed.xdmf", "Center=\"Node\"><DataItem DataType=\"Float\" Dimensions=\"14 3\"", "Center=\"Node\"><DataItem DataType=\"Float\" Dimensions=\"14 65\"", ["Attribute \"mode_0\": found 65 components, expected 1 to 64"];
    a_field_of_other_nodes: "beam.xdmf", "Center=\"Node\"><DataItem DataType=\"Float\" Dimensions=\"20 3\"", "Center=\"Node\"><DataItem DataType=\"Float\" Dimensions=\"30 2\"", ["Attribute \"displacement\": found 3 components, expected 2 as in the steps before"];
    another_root_element: "mixed.xdmf", "<Xdmf Version=\"3.0\">", "<Xdmf Version=\"3.0\"></Xdmf><X>", ["a second root element", "one Xdmf element", "export"];
    two_grids: "mixed.xdmf", "<Domain>", "<Domain><Grid/>", ["Domain: found 2 grids", "one uniform grid, or one temporal collection", "one mesh per file"];
    a_spatial_collection: "beam.xdmf", "CollectionType=\"Temporal\"", "CollectionType=\"Spatial\"", ["a grid of type collection Spatial", "temporal collection", "one step per mode"];
    a_pointer_to_nothing: "beam.xdmf", "Name=\"mesh\"", "Name=\"other\"", ["include: found the pointer", "a grid", "with its own Topology and Geometry"];
    a_pointer_to_itself: "beam.xdmf", "@Name=&quot;mesh&quot;", "@Name=&quot;TimeSeries_meshio&quot;", ["include: found the pointer", "its own Topology and Geometry"];
    a_pointer_to_another_file: "beam.xdmf", "include xpointer", "include href=\"x.xdmf\" xpointer", ["include: found a reference to another file", "a grid of this file"];
    a_file_outside_the_folder: "beam.xdmf", "beam.h5:/data0", "../beam.h5:/data0", ["the file \"../beam.h5\"", "in the folder of this one", "copy the HDF5 file"];
    an_absolute_path: "beam.xdmf", "beam.h5:/data0", "/tmp/beam.h5:/data0", ["the file \"/tmp/beam.h5\"", "in the folder of this one"];
    another_dimension_than_the_data: "beam.xdmf", "Dimensions=\"20 3\"", "Dimensions=\"21 3\"", ["found 60 values, expected 63 as its Dimensions [21, 3] say", "together"];
    dimensions_that_overflow: "beam.xdmf", "Dimensions=\"20 3\"", "Dimensions=\"9999999999999 9999999999999\"", ["found Dimensions", "fit into memory", "export"];
    dimensions_beyond_the_file: "beam.xdmf", "Dimensions=\"20 3\"", "Dimensions=\"9000000 3\"", ["216000000 bytes", "bytes from files of this size", "damaged"];
    no_dimensions: "beam.xdmf", "Dimensions=\"20 3\"", "Dims=\"20 3\"", ["a DataItem without Dimensions", "its extents"];
    a_binary_item: "beam.xdmf", "Format=\"HDF\"", "Format=\"Binary\"", ["data in the format Binary", "HDF or XML", "data_format"];
    a_slice: "beam.xdmf", "<DataItem ", "<DataItem ItemType=\"HyperSlab\" ", ["a DataItem of type HyperSlab", "uniform", "whole arrays"];
    a_referring_item: "beam.xdmf", "<DataItem ", "<DataItem Reference=\"/Xdmf\" ", ["a DataItem that refers to another", "its own data", "HDF5 path"];
    two_coordinates: "beam.xdmf", "GeometryType=\"XYZ\"", "GeometryType=\"XY\"", ["Geometry: found the type XY, expected XYZ", "three coordinates"];
    an_unknown_cell: "beam.xdmf", "TopologyType=\"Hexahedron\"", "TopologyType=\"Hexahedron_64\"", ["Topology: found the type \"Hexahedron_64\"", "Tetrahedron", "known type"];
    another_cell: "beam.xdmf", "TopologyType=\"Hexahedron\"", "TopologyType=\"Wedge\"", ["extents [4, 8]", "[E, 6] of wedge", "two dimensions"];
    another_number_of_cells: "beam.xdmf", "NumberOfElements=\"4\"", "NumberOfElements=\"5\"", ["found 4 cells, expected 5 as NumberOfElements says"];
    a_time_that_is_none: "beam.xdmf", "Value=\"2.5\"", "Value=\"soon\"", ["Time: found the value \"soon\", expected a number", "frequency"];
    a_name_twice: "beam.xdmf", "Name=\"stress\"", "Name=\"displacement\"", ["Attribute \"displacement\": found 6 components, expected 3"];
    a_rigid_mode: "beam.xdmf", "Value=\"2.5\"", "Value=\"0.0\"", ["the frequency of mode 1: found 0 Hz, expected more than zero", "leave rigid-body modes out"];
    no_number: "mixed.xdmf", "0.0000000000000000e+00", "zero", ["Geometry: found \"zero\", expected numbers", "export"];
    not_finite: "mixed.xdmf", "1.0000000000000000e+00", "nan", ["Geometry: found NaN at node 1, expected finite coordinates", "repair"];
    a_node_beyond_the_mesh: "mixed.xdmf", "\n13\n", "\n14\n", ["Topology: found node 14, expected 0 to 13", "count nodes from 0"];
    an_unknown_number_in_a_stream: "mixed.xdmf", "\n9\n0\n", "\n99\n0\n", ["the type number 99 at position 0", "a known cell type"];
    flat_cells: "mixed.xdmf", "\n6\n10\n13\n11\n12", "\n6\n10\n13\n11\n11", ["tetra number 1: found a measure of 0.0e0", "above zero", "repair the mesh"];
}

#[test]
fn a_dataset_that_is_not_there() {
    let text = xdmf("beam.xdmf", "beam.h5:/data0", "beam.h5:/data99", &keys("beam.xdmf"));
    // the file in which it is missing
    assert_said(&text, "beam.h5", &["data99: found nothing, expected a dataset; export the file again"]);
}

#[test]
fn more_modes_than_their_sums_allow_are_refused() {
    let grid = |i: usize| {
        format!(
            "<Grid><Time Value=\"{}\"/><Attribute Name=\"displacement\"><DataItem Dimensions=\"20 3\" Format=\"HDF\">beam.h5:/data2</DataItem></Attribute></Grid>",
            i + 20
        )
    };
    let many: String = (0..501).map(grid).collect();
    let text = xdmf("beam.xdmf", "</Grid><Grid Name=\"mesh\"", &format!("{many}</Grid><Grid Name=\"mesh\""), &keys("beam.xdmf"));
    assert_said(&text, "beam.xdmf", &["displacement: found 503 modes, expected at most 500; retain those that matter"]);
}

#[test]
fn fields_on_cells_and_modes_of_several_widths_are_refused() {
    let mode = "Name=\"mode_0\" AttributeType=\"Vector\" Center=\"Node\"";
    let text = xdmf("mixed.xdmf", mode, &mode.replace("Node", "Cell"), &keys("mixed.xdmf"));
    assert_said(
        &text,
        "mixed.xdmf",
        &["field \"mode_0\": found a field on cells, expected a nodal field for displacement; export it at the nodes"],
    );
    let text = xdmf(
        "mixed.xdmf",
        "Dimensions=\"14 3\" Format=\"XML\" Precision=\"8\">\n0.0000000000000000e+00 0.0000000000000000e+00 0.0000000000000000e+00\n",
        "Dimensions=\"14 2\">",
        &keys("mixed.xdmf"),
    );
    assert_said(&text, "mixed.xdmf", &["expected extents [N, 3]"]);
}

#[test]
fn later_steps_with_another_mesh_are_refused() {
    let grid = "<Grid><Topology TopologyType=\"Hexahedron\"><DataItem Dimensions=\"1 8\">0 1 2 3 4 5 6 7</DataItem></Topology>\
                <Geometry><DataItem Dimensions=\"1 3\">0 0 0</DataItem></Geometry></Grid></Grid><Grid Name=\"mesh\"";
    let text = xdmf("beam.xdmf", "</Grid><Grid Name=\"mesh\"", grid, &keys("beam.xdmf"));
    assert_said(&text, "beam.xdmf", &["Topology: found another mesh in a later step, expected one mesh for all modes"]);
}

/// `name: sample, key to leave out or exchange, its line, words` of the message.
macro_rules! keys_refused {
    ($($name:ident: $sample:expr, $from:expr, $to:expr, $words:expr;)*) => {$(
        #[test]
        fn $name() {
            let folder = tempfile::tempdir().unwrap();
            for name in [$sample, "beam.h5"] {
                std::fs::copy(data(name), folder.path().join(name)).unwrap();
            }
            let keys = keys($sample);
            assert!(keys.contains($from), "{} in {keys}", $from);
            assert_said(&refusal(&folder.path().join($sample), &keys.replacen($from, $to, 1)), $sample, &$words);
        }
    )*};
}

keys_refused! {
    no_displacement: "beam.xdmf", "displacement = \"displacement\"", "", ["displacement is needed: found the fields \"displacement\", \"stress\"", "mode_*"];
    another_displacement: "beam.xdmf", "\"displacement\"", "\"shape\"", ["displacement = \"shape\": found no field of that name, expected one of \"displacement\"", "name a field"];
    a_pattern_over_series: "beam.xdmf", "\"displacement\"", "\"mode_*\"", ["displacement = \"mode_*\": found no field"];
    a_tensor_as_displacement: "beam.xdmf", "\"displacement\"", "\"stress\"", ["field \"stress\": found 6 components", "three components, named DX DY DZ or not at all", "vectors of their own"];
    a_vector_as_stress: "beam.xdmf", "stress = \"stress\"", "stress = \"displacement\"", ["field \"displacement\": found 3 components", "end in xx yy zz xy yz xz", "stress_components"];
    a_mark_as_stress: "beam.xdmf", "stress = \"stress\"", "stress = \"ROOT\"", ["stress = \"ROOT\": found 1 steps, expected 2, as many as mode shapes", "same modes"];
    no_mass: "beam.xdmf", "density = 250.0", "", ["density, areal_density or node_mass is needed: found the fields", "give the density (kg/m^3)"];
    an_area_for_a_volume: "beam.xdmf", "density = 250.0", "areal_density = 5.0", ["areal_density: found a mesh with volume cells", "give density"];
    a_volume_for_an_area: "plate.med", "areal_density = 5.0", "density = 5.0", ["density: found a mesh without volume cells", "thickness times density"];
    masses_of_another_mesh: "beam.xdmf", "density = 250.0", "node_mass = [1.0, 2.0]", ["node_mass: found 2 numbers, expected 20: one per node"];
    masses_from_a_vector: "beam.xdmf", "density = 250.0", "node_mass = \"displacement\"", ["node_mass = \"displacement\": found the fields", "one component and one step"];
    masses_that_cancel: "beam_h5py.med", "density = 250.0", "node_mass = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]", ["the sum of the nodal masses: found 0 kg, expected more than zero", "sign and unit"];
    an_unknown_group_of_cells: "beam.med", "INNER = 200.0", "CORE = 200.0", ["density: found no group of cells \"CORE\", expected one of \"INNER\", \"OUTER\""];
    cells_without_density: "beam.med", "INNER = 200.0, ", "", ["density is needed: found 2 volume cells in none of the groups \"OUTER\"", "a density for every group"];
    no_damping: "beam.xdmf", "damping_ratio = 0.005", "", ["damping_ratio is needed: found none", "0.0 if none is wanted"];
    damping_of_other_modes: "mixed.xdmf", "[0.01, 0.02]", "[0.01, 0.02, 0.03]", ["damping_ratio: found 3 numbers, expected one, or 2"];
    frequencies_of_other_modes: "mixed.xdmf", "[3.0, 5.0]", "[3.0]", ["frequency_hz: found 1 numbers, expected 2: one per retained mode"];
    no_frequencies: "mixed.xdmf", "frequency_hz = [3.0, 5.0]", "", ["frequency_hz is needed: found steps without time", "every retained mode"];
    a_mode_that_is_not_there: "beam.xdmf", "density", "modes = [3]\ndensity", ["modes: found mode 3, expected numbers from 1 to 2, each once"];
    a_mode_twice: "beam.xdmf", "density", "modes = [1, 1]\ndensity", ["modes: found mode 1 twice"];
    no_modes: "beam.xdmf", "density", "modes = []\ndensity", ["modes: found none"];
    no_root: "beam.med", "root = { group", "base = { group", ["interface \"root\" is needed: found the groups \"ROOT\", \"TIP\", \"INNER\", \"OUTER\"", "inboard hinge"];
    an_unknown_group: "beam.xdmf", "\"TIP\"", "\"NOSE\"", ["interface \"tip\": found no group \"NOSE\", expected one of", "\"TIP\"", "or give a box"];
    an_empty_box: "mixed.xdmf", "[0.0, 1.0, 1.0]]", "[0.0, 0.0, 0.0]]\ninterface.far.box = [[9.0, 9.0, 9.0], [10.0, 10.0, 10.0]]", ["interface \"far\": found no node, expected at least one of the mesh from [0.0, 0.0, 0.0] to [3.0", "correct the box"];
    a_node_that_is_not_there: "beam.xdmf", "{ group = \"TIP\" }", "{ nodes = [20] }", ["interface \"tip\": found node 20, expected 0 to 19"];
    nodes_in_line: "beam.xdmf", "{ group = \"TIP\" }", "{ nodes = [16, 17] }", ["interface \"tip\": found 2 nodes on a point or a line", "not in line", "select a face"];
    a_name_with_a_slash: "beam.xdmf", "tip =", "\"a/b\" =", ["interface: found the name \"a/b\", expected a printable name without slash"];
    a_clamp_that_moves: "beam.xdmf", "interface = {", "boundary = \"cantilever\"\nroot = \"tip\"\ninterface = {", ["boundary = \"cantilever\": found a root that moves by 1.0e0 of the largest motion, expected at most 1e-6", "name the clamped nodes"];
    a_free_body_that_is_held: "beam.xdmf", "density", "boundary = \"free-free\"\ndensity", ["boundary = \"free-free\": found ", "of a mode's norm in rigid motion", "how the modes were held"];
    cells_in_two_groups: "beam.med", "OUTER = 300.0", "body = 1.0, OUTER = 300.0", ["density: found no group of cells \"body\""];
    a_scale_that_no_body_has: "beam_h5py.med", "density = 250.0", "node_mass = [1.0, 1.0, 1.0, 1.0, -9.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 9.0, 1.0, 1.0, 1.0]", ["beam_h5py.med: the body made of it breaks a rule of modal files: "];
    an_order_that_is_none: "beam.xdmf", "density", "stress_components = [\"xx\", \"yy\"]\ndensity", ["field \"stress\": found 6 components", "for xx yy", "each once; give their order"];
    another_mesh_name: "beam.med", "damping", "mesh = \"plate\"\ndamping", ["ENS_MAA: found no mesh \"plate\", expected one of \"body\"", "key mesh"];
}

#[test]
fn modes_that_repeat_are_named() {
    let text = xdmf(
        "mixed.xdmf",
        "Name=\"mode_1\"",
        "Name=\"mode_x\"",
        &keys("mixed.xdmf")
            .replace("mode_*", "mode_0")
            .replace("[3.0, 5.0]", "[3.0]")
            .replace("[0.01, 0.02]", "0.0")
            .replace("root.box", "tip.box"),
    );
    assert_said(&text, "mixed.xdmf", &["interface \"root\" is needed"]);
    let text = xdmf("beam.xdmf", "beam.h5:/data6", "beam.h5:/data2", &keys("beam.xdmf"));
    assert_said(
        &text,
        "beam.xdmf",
        &["modes 1 and 2: found shapes that depend on one another", "correlation 1.000000", "leave one of them out"],
    );
}

#[test]
fn med_files_are_refused_with_the_path_of_what_is_wrong() {
    let sample = "beam_h5py.med";
    let said = |change: &dyn Fn(&File), words: &[&str]| assert_said(&med(sample, change, &keys(sample)), sample, words);
    const STATE: &str = "ENS_MAA/body/-0000000000000000001-0000000000000000001";
    const STEP: &str = "CHA/MODES___DEPL/0000000000000000000200000000000000000000";
    let set = |f: &File, group: &str, name: &str, value: i32| f.group(group).unwrap().attr(name).unwrap().write_scalar(&value).unwrap();
    said(&|f| f.unlink("INFOS_GENERALES").unwrap(), &["the file: found the groups \"CHA\", \"ENS_MAA\", \"FAS\"", "name a MED file"]);
    said(&|f| set(f, "INFOS_GENERALES", "MAJ", 2), &["INFOS_GENERALES@MAJ: found 2, expected 3 or 4", "convert the file to MED 4"]);
    said(&|f| set(f, "ENS_MAA/body", "ESP", 2), &["ENS_MAA/body@ESP: found 2 coordinates per node, expected 3"]);
    said(&|f| f.unlink("ENS_MAA/body").unwrap(), &["ENS_MAA: found no mesh, expected a mesh"]);
    said(&|f| f.create_group("ENS_MAA/other").map(drop).unwrap(), &["mesh is needed: found the meshes \"body\", \"other\"; name the one"]);
    said(&|f| f.create_group("ENS_MAA/body/later").map(drop).unwrap(), &["ENS_MAA/body: found 2 mesh steps, expected one state"]);
    said(&|f| f.relink(&format!("{STATE}/MAI/HE8"), &format!("{STATE}/MAI/OC12")).unwrap(), &["found cells of type OC12", "HE8 H20 H27"]);
    said(
        &|f| f.relink(&format!("{STATE}/MAI/HE8"), &format!("{STATE}/MAI/T10")).unwrap(),
        &["MAI/T10/NOD: found 32 numbers for 4 cells, expected 10 per cell"],
    );
    said(&|f| f.unlink(&format!("{STATE}/MAI/HE8")).unwrap(), &["the mesh: found no cells, expected volume or surface cells"]);
    let nodes = format!("{STATE}/MAI/HE8/NOD");
    said(&|f| f.dataset(&nodes).unwrap().write_raw(&[0_i32; 32]).unwrap(), &["MAI/HE8/NOD: found node 0, expected 1 to 20"]);
    let coordinates = format!("{STATE}/NOE/COO");
    said(
        &|f| f.dataset(&coordinates).unwrap().write_raw(&[f64::NAN; 60]).unwrap(),
        &["NOE/COO: found NaN at node 1, expected finite coordinates"],
    );
    said(
        &|f| f.dataset(&coordinates).unwrap().attr("NBR").unwrap().write_scalar(&7_i32).unwrap(),
        &["NOE/COO: found 60 numbers for 7 nodes"],
    );
    said(
        &|f| f.relink(&format!("{STEP}/NOE/MED_NO_PROFILE_INTERNAL"), &format!("{STEP}/NOE/TIP")).unwrap(),
        &["found 20 nodes of the profile TIP, expected all 20 nodes"],
    );
    said(&|f| set(f, "CHA/MODES___DEPL", "NCO", 0), &["CHA/MODES___DEPL@NCO: found 0 components, expected 1 to 64"]);
    said(&|f| set(f, STEP, "NDT", 1), &["CHA/MODES___DEPL: found step 1 twice, expected one state per step"]);
    said(
        &|f| f.unlink(&format!("{STEP}/NOE/MED_NO_PROFILE_INTERNAL/CO")).unwrap(),
        &["CO: found nothing, expected a dataset; export the file again"],
    );
    said(
        &|f| f.dataset(&format!("{STEP}/NOE/MED_NO_PROFILE_INTERNAL/CO")).unwrap().write_raw(&[f64::INFINITY; 60]).unwrap(),
        &["field \"MODES___DEPL\", step 2: found inf at flat index 0", "repair the export"],
    );
    said(&|f| f.link_soft("/CHA", "CHA/loop").unwrap(), &["CHA/loop: found a soft link, expected data stored in the file itself"]);
    said(&|f| f.link_hard("/CHA", "CHA/MODES___DEPL/loop").unwrap(), &["8 levels deep", "linked in a circle"]);
}

#[test]
fn times_that_count_the_steps_are_no_frequencies() {
    let count = |f: &File| {
        for (step, time) in [("1", 1.0), ("2", 2.0)] {
            let group = f.group(&format!("CHA/MODES___DEPL/{step:0>20}{:020}", 0)).unwrap();
            group.attr("PDT").unwrap().write_scalar(&time).unwrap();
        }
    };
    let text = med("beam_h5py.med", count, &keys("beam_h5py.med"));
    assert_said(&text, "beam_h5py.med", &["frequency_hz is needed: found times that count the steps"]);
}

#[test]
fn a_folded_cell_cannot_be_lumped() {
    let text = xdmf("mixed.xdmf", "\n9\n0\n4\n6\n2\n1\n5\n7\n3", "\n9\n0\n4\n6\n2\n1\n5\n3\n7", &keys("mixed.xdmf"));
    assert_said(&text, "mixed.xdmf", &["hexahedron number 1: found a ", "repair the mesh"]);
}

#[test]
fn a_link_out_of_the_folder_is_not_followed() {
    let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    std::fs::copy(data("beam.xdmf"), folder.path().join("beam.xdmf")).unwrap();
    std::fs::copy(data("beam.h5"), outside.path().join("beam.h5")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(outside.path().join("beam.h5"), folder.path().join("beam.h5")).unwrap();
    #[cfg(unix)]
    assert_said(
        &refusal(&folder.path().join("beam.xdmf"), &keys("beam.xdmf")),
        "beam.xdmf",
        &["the file \"beam.h5\", expected a file in the folder"],
    );
}

#[test]
fn files_that_are_no_such_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        folder.path().join(name)
    };
    let said = |file: &Path, words: &[&str]| assert_said(&refusal(file, ""), &file.to_string_lossy(), words);
    said(&folder.path().join("absent.med"), &["cannot be opened", "expected an XDMF 3 file", "check the path"]);
    said(&folder.path().join("absent.xdmf"), &["cannot be opened"]);
    said(&write("text.med", b"no HDF5"), &["cannot be opened"]);
    said(&write("binary.xdmf", &[0xff, 0xfe, 0]), &["cannot be opened: not UTF-8 text at byte 0"]);
    said(&write("other.xdmf", b"<VTKFile/>"), &["found the element \"VTKFile\", expected Xdmf"]);
    said(&write("body.op2", b""), &["the file: found the extension .op2, expected XDMF (.xdmf, .xmf) or MED", "convert it"]);
    said(&write("lines.xdmf", b"<Xdmf><Domain><Grid><Geometry><DataItem Dimensions='2 3'>0 0 0 1 0 0</DataItem></Geometry><Topology TopologyType='Polyline'><DataItem Dimensions='1 2'>0 1</DataItem></Topology></Grid></Domain></Xdmf>"), &["the mesh: found lines only, expected volume or surface cells"]);
    let large = folder.path().join("large.xdmf");
    std::fs::File::create(&large).unwrap().set_len((64 << 20) + 1).unwrap();
    said(&large, &["found 67108865 bytes of XML, expected at most 67108864 bytes; store the numbers in HDF5"]);
}

#[test]
fn shapes_of_all_modes_together_are_bounded_by_the_files() {
    // one array that many steps share: a small file could otherwise ask for any memory
    let points = 3000;
    let inline = |width: usize| vec!["0.25"; points * width].join(" ");
    let step = |i: usize| {
        format!(
            "<Grid><Time Value=\"{}\"/><Attribute Name=\"u\"><DataItem Dimensions=\"{points} 3\" Format=\"HDF\">u.h5:/u</DataItem></Attribute></Grid>",
            i + 2
        )
    };
    let steps: String = (0..450).map(step).collect();
    let text = format!(
        "<Xdmf><Domain><Grid GridType=\"Collection\" CollectionType=\"Temporal\"><Grid><Topology TopologyType=\"Tetrahedron\"><DataItem Dimensions=\"1 4\">0 1 2 3</DataItem></Topology><Geometry><DataItem Dimensions=\"{points} 3\">0 0 0 1 0 0 0 1 0 0 0 1 {}</DataItem></Geometry><Time Value=\"1.5\"/><Attribute Name=\"u\"><DataItem Dimensions=\"{points} 3\" Format=\"HDF\">u.h5:/u</DataItem></Attribute></Grid>{steps}</Grid></Domain></Xdmf>",
        &inline(3)[60..]
    );
    let folder = tempfile::tempdir().unwrap();
    let file = File::create(folder.path().join("u.h5")).unwrap();
    file.new_dataset::<f64>()
        .shape((points, 3))
        .chunk((points, 3))
        .deflate(9)
        .create("u")
        .unwrap()
        .write_raw(&vec![0.5; 3 * points])
        .unwrap();
    file.close().unwrap();
    std::fs::write(folder.path().join("many.xdmf"), text).unwrap();
    let keys = "displacement = \"u\"\ndensity = 1.0\ndamping_ratio = 0.0\ninterface.root.nodes = [0, 1, 2]\n";
    assert_said(
        &refusal(&folder.path().join("many.xdmf"), keys),
        "many.xdmf",
        &["the shapes of all modes: found 32472000 bytes", "damaged"],
    );
}
