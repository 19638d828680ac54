//! Refusals held to their last word: what was found, what was expected and what to do.

use super::{data, keys, med, refusal, xdmf};
use hdf5::File;

/// The text of a refusal begins with the file and ends with these words.
fn assert_ends(message: &str, words: &str) {
    assert!(message.ends_with(words), "{words}\nis not the end of\n{message}");
}

/// One mutation of an XDMF sample by line: text, what replaces it, the end of the message.
#[test]
fn xdmf_files() {
    const FULL: &str = "Dimensions=\"14 3\" Format=\"XML\"";
    let cases: [(&str, &str, &str, &str); 27] = [
        (
            "beam.xdmf",
            "CollectionType=\"Temporal\"",
            "CollectionType=\"Spatial\"",
            "Grid: found a grid of type collection Spatial, expected a uniform grid or a temporal collection; export one mesh with one step per mode",
        ),
        (
            "mixed.xdmf",
            "<Domain>",
            "<Domain><Grid/>",
            "Domain: found 2 grids in the domain, expected one uniform grid, or one temporal collection; export one mesh per file",
        ),
        (
            "mixed.xdmf",
            "<Domain>",
            "<Domain><Grid GridType=\"Collection\" CollectionType=\"Temporal\"></Grid>",
            "Grid: found a collection without grids, expected one grid per mode; export the modes as steps",
        ),
        (
            "beam.xdmf",
            "<Grid><",
            "<Time TimeType=\"HyperSlab\"/><Grid><",
            "Time: found the time type HyperSlab, expected a list, or a Time in each grid; export the times one by one",
        ),
        (
            "beam.xdmf",
            "include xpointer",
            "include href=\"x.xdmf\" xpointer",
            "include: found a reference to another file, expected one to a grid of this file; export the mesh into the same file",
        ),
        (
            "beam.xdmf",
            "Name=\"mesh\"",
            "Name=\"other\"",
            "[@Name=\"mesh\"]/*[self::Topology or self::Geometry])\", expected xpointer(//Grid[@Name=\"...\"]...) to a grid with its own Topology and Geometry; export the file again, for example with meshio",
        ),
        (
            "beam.xdmf",
            "GeometryType=\"XYZ\"",
            "GeometryType=\"XY\"",
            "Geometry: found the type XY, expected XYZ; export three coordinates per node in one array (N, 3)",
        ),
        (
            "mixed.xdmf",
            "Dimensions=\"14 3\"",
            "Dimensions=\"21 2\"",
            "Geometry: found an array of extents [21, 2], expected extents [N, 3] with N from 1 to 50 million; export three coordinates per node",
        ),
        ("mixed.xdmf", "1.0000000000000000e+00", "nan", "Geometry: found NaN at node 1, expected finite coordinates; repair the export"),
        (
            "beam.xdmf",
            "<Topology ",
            "<Topology Order=\"1\" ",
            "Topology: found an order or offset of its own, expected nodes counted from 0 in VTK order; export it again without them",
        ),
        (
            "beam.xdmf",
            "TopologyType=\"Hexahedron\"",
            "TopologyType=\"Hexahedron_64\"",
            "Topology: found the type \"Hexahedron_64\", expected Triangle, Quadrilateral, Tetrahedron, Pyramid, Wedge, Hexahedron, their quadratic forms, or Mixed; export cells of a known type",
        ),
        (
            "beam.xdmf",
            "TopologyType=\"Hexahedron\"",
            "TopologyType=\"Wedge\"",
            "Topology: found an array of extents [4, 8], expected extents [E, 6] of wedge; export the connectivity in two dimensions, as meshio does",
        ),
        (
            "mixed.xdmf",
            "\n9\n0\n",
            "\n99\n0\n",
            "Topology: found the type number 99 at position 0, expected a known cell type; export cells of types that VTK and XDMF share",
        ),
        (
            "mixed.xdmf",
            "\n9\n0\n",
            "\n2\n8\n",
            "Topology: found a polyline of other than two nodes, expected lines of two nodes; export lines one by one",
        ),
        ("mixed.xdmf", FULL, "Dimensions=\"14 65\" Format=\"XML\"", "; export three coordinates per node"),
        (
            "beam.xdmf",
            "<DataItem ",
            "<DataItem ItemType=\"HyperSlab\" ",
            "found a DataItem of type HyperSlab, expected a uniform one; export whole arrays, not slices or functions",
        ),
        (
            "beam.xdmf",
            "<DataItem ",
            "<DataItem Reference=\"/Xdmf\" ",
            "found a DataItem that refers to another, expected one with its own data; write the HDF5 path into each DataItem",
        ),
        (
            "beam.xdmf",
            "Dimensions=\"20 3\"",
            "Dimensions=\"20 x\"",
            "found Dimensions \"20 x\", expected one to three extents that fit into memory; export the file again",
        ),
        (
            "beam.xdmf",
            "Format=\"HDF\"",
            "Format=\"Binary\"",
            "found data in the format Binary, expected HDF or XML; export with HDF5 or XML data (in meshio data_format=\"HDF\")",
        ),
        (
            "mixed.xdmf",
            "Name=\"mode_1\"",
            "Name=\"mode_0\"",
            "Attribute \"mode_0\": found the name twice in one grid, expected each name once; give every field a name of its own",
        ),
        (
            "mixed.xdmf",
            "<Domain>",
            "<!DOCTYPE x [<!ENTITY a \"b\">]><Domain>",
            "found a document type with declarations, expected none, or only a name; remove the declarations; entities are not expanded",
        ),
        (
            "mixed.xdmf",
            "</Xdmf>",
            "",
            "the file: found the end of the file inside \"Xdmf\", expected a closed element; export the file again; it was cut short",
        ),
        ("mixed.xdmf", "<Domain>", "<Domain a>", "expected attributes NAME=\"VALUE\"; export the file again"),
        (
            "mixed.xdmf",
            "\n6\n10\n13\n11\n12",
            "\n6\n10\n13\n11\n11",
            "tetra number 1: found a measure of 0.0e0, expected a length, area or volume above zero; repair the mesh, or leave the cell out",
        ),
        (
            "mixed.xdmf",
            "\n9\n0\n4\n6\n2\n1\n5\n7\n3",
            "\n9\n0\n4\n6\n2\n1\n5\n3\n7",
            "hexahedron number 1: found a Jacobian that changes its sign, expected a cell that is not folded; repair the mesh, or give node_mass",
        ),
        (
            "beam.xdmf",
            "Value=\"2.5\"",
            "Value=\"soon\"",
            "Time: found the value \"soon\", expected a number; write the frequency as Time Value",
        ),
        (
            "beam.xdmf",
            "Dimensions=\"20 3\"",
            "Dimensions=\"21 3\"",
            "found 60 values, expected 63 as its Dimensions [21, 3] say; export the XDMF file and its HDF5 file together",
        ),
    ];
    let outcomes = cases.map(|(sample, from, to, end)| (xdmf(sample, from, to, &keys(sample)), end));
    let wrong: Vec<_> = outcomes.iter().filter(|(message, end)| !message.ends_with(end)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn fields_of_xdmf_files() {
    let beam = |from: &str, to: &str| xdmf("beam.xdmf", from, to, &keys("beam.xdmf"));
    let field = "Center=\"Node\"><DataItem DataType=\"Float\" Dimensions=\"20 3\"";
    assert_ends(
        &beam(field, "Center=\"Node\"><DataItem DataType=\"Float\" Dimensions=\"30 2\""),
        "Attribute \"displacement\": found 3 components, expected 2 as in the steps before; export all steps alike",
    );
    assert_ends(
        &beam(field, "Center=\"Node\"><DataItem DataType=\"Float\" Dimensions=\"1 66\""),
        "Attribute \"displacement\": found 66 components, expected 1 to 64; export the field again",
    );
    let one_by_one = keys("mixed.xdmf");
    let mixed = |from: &str, to: &str| xdmf("mixed.xdmf", from, to, &one_by_one);
    let inline = |width: usize, rows: usize| {
        format!(
            "Name=\"mode_1\"><DataItem Dimensions=\"{rows} {width}\">{}</DataItem></Attribute><Attribute Name=\"left\"",
            vec!["0.5"; width * rows].join(" ")
        )
    };
    assert_ends(
        &mixed("Name=\"mode_1\"", &inline(3, 13)),
        "field \"mode_1\", step 1: found 39 numbers, expected 42: 14 nodes of 3 components; export the field on the whole mesh",
    );
    assert_ends(
        &mixed("Name=\"mode_1\"", &inline(4, 14)),
        "field \"mode_1\": found 4 components \"\", \"\", \"\", \"\", expected 3 as in the first mode; export all modes alike",
    );
    assert_ends(
        &mixed("Name=\"mode_1\"", &inline(3, 14).replacen("0.5", "1e101", 1)),
        "field \"mode_1\", step 1: found 1e101 at flat index 0, expected finite numbers of magnitude up to 1e100; repair the export of this field",
    );
    assert_ends(
        &mixed("Name=\"mode_1\"", &inline(3, 14).replace("0.5", "0.0")),
        "mode 2: found a modal mass of 0.000e0, expected more than zero; leave the mode out (modes = [...]), or check the nodal masses",
    );
}

#[test]
fn a_pattern_over_a_series_and_the_same_time_in_all_steps() {
    let pattern = keys("beam.xdmf").replace("\"displacement\"", "\"m*\"");
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(data("beam.xdmf")).unwrap().replace("Name=\"displacement\"", "Name=\"m1\"");
    std::fs::copy(data("beam.h5"), folder.path().join("beam.h5")).unwrap();
    let file = folder.path().join("beam.xdmf");
    std::fs::write(&file, text).unwrap();
    assert_ends(
        &refusal(&file, &pattern),
        "field \"m1\": found 2 steps, expected one step, as the pattern counts modes by names; name the field without a pattern",
    );
    let second = std::fs::read_to_string(data("beam.xdmf")).unwrap();
    let times: Vec<&str> =
        second.match_indices("<Time Value=\"").map(|(at, _)| &second[at..at + second[at..].find('>').unwrap()]).collect();
    assert_eq!(times.len(), 2);
    std::fs::write(&file, second.replace(times[1], times[0])).unwrap();
    assert_ends(
        &refusal(&file, &keys("beam.xdmf")),
        "frequency_hz is needed: found the same time in all steps; give the frequency of every retained mode (Hz)",
    );
}

#[test]
fn more_than_64_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let step = |i: usize| {
        std::fs::copy(data("beam.h5"), folder.path().join(format!("{i}.h5"))).unwrap();
        format!(
            "<Grid><Time Value=\"{}\"/><Attribute Name=\"displacement\"><DataItem Dimensions=\"20 3\" Format=\"HDF\">{i}.h5:/data2</DataItem></Attribute></Grid>",
            i + 20
        )
    };
    let many: String = (0..64).map(step).collect();
    let text = std::fs::read_to_string(data("beam.xdmf")).unwrap().replacen(
        "</Grid><Grid Name=\"mesh\"",
        &format!("{many}</Grid><Grid Name=\"mesh\""),
        1,
    );
    std::fs::copy(data("beam.h5"), folder.path().join("beam.h5")).unwrap();
    let file = folder.path().join("beam.xdmf");
    std::fs::write(&file, text).unwrap();
    let keys = keys("beam.xdmf").replace("stress = \"stress\"\n", "");
    assert_ends(
        &refusal(&file, &keys),
        "Attribute \"displacement\": found more than 64 HDF5 files, expected one, or a few; export all steps into one HDF5 file",
    );
}

/// One change of the keys by line: sample, text, what replaces it, the end of the message.
#[test]
fn what_is_asked() {
    let all_on_one_node = format!("node_mass = [{}1.0]\nboundary = \"free-free\"", "0.0, ".repeat(19));
    let cases: [(&str, &str, &str, &str); 17] = [
        (
            "beam.med",
            "root = { group",
            "base = { group",
            "; say which group or box of nodes carries the inboard hinge, or name another interface as root",
        ),
        ("beam.xdmf", "tip =", "\"a/b\" =", "expected a printable name without slash; rename the interface"),
        (
            "beam.xdmf",
            "{ group = \"TIP\" }",
            "{ nodes = [16, 17] }",
            "expected nodes that are not in line, or a file with nodal rotations; select a face, or export nodal rotations",
        ),
        ("beam.xdmf", "{ group = \"TIP\" }", "{ nodes = [20] }", "found node 20, expected 0 to 19; count the nodes of the file from 0"),
        (
            "beam.xdmf",
            "density = 250.0",
            &all_on_one_node,
            "the nodes: found all on one line, expected a body with inertia about every axis; state boundary = \"general\"",
        ),
        (
            "beam.xdmf",
            "interface = {",
            "boundary = \"cantilever\"\nroot = \"tip\"\ninterface = {",
            "expected at most 1e-6: a clamped root; name the clamped nodes as the root, or state boundary = \"general\"",
        ),
        (
            "beam.xdmf",
            "density",
            "boundary = \"free-free\"\ndensity",
            "of a mode's norm in rigid motion, expected at most 0.1: modes of the free body; state how the modes were held, or leave the key out",
        ),
        (
            "beam.xdmf",
            "density = 250.0",
            "node_mass = [1.0, 2.0]",
            "expected 20: one per node in the order of the file; give one mass per node",
        ),
        (
            "beam.xdmf",
            "density = 250.0",
            "node_mass = \"displacement\"",
            "expected a nodal field of one component and one step; name such a field, or give a density",
        ),
        (
            "beam.xdmf",
            "density = 250.0",
            "areal_density = 5.0",
            "areal_density: found a mesh with volume cells, expected a mesh of surface cells; give density (kg/m^3) instead",
        ),
        (
            "plate.med",
            "areal_density = 5.0",
            "density = 5.0",
            "expected volume cells; give areal_density (kg/m^2): thickness times density, skins and equipment included",
        ),
        ("beam.med", "INNER = 200.0", "CORE = 200.0", "expected one of \"INNER\", \"OUTER\"; name groups of volume cells"),
        ("mixed.xdmf", "[3.0, 5.0]", "[3.0]", "expected 2: one per retained mode; give one frequency per mode"),
        ("mixed.xdmf", "[0.01, 0.02]", "[0.01, 0.02, 0.03]", "expected one, or 2: one per retained mode; give one damping ratio per mode"),
        ("beam.xdmf", "density", "modes = [3]\ndensity", "expected numbers from 1 to 2, each once; name steps of the displacement field"),
        ("beam.med", "damping", "mesh = \"plate\"\ndamping", "expected one of \"body\"; correct the key mesh"),
        ("beam.xdmf", "{ group = \"TIP\" }", "{ group = \"NOSE\" }", "; name a group or nodal field of the file, or give a box"),
    ];
    for (sample, from, to, end) in cases {
        let folder = tempfile::tempdir().unwrap();
        for name in [sample, "beam.h5"] {
            std::fs::copy(data(name), folder.path().join(name)).unwrap();
        }
        assert!(keys(sample).contains(from), "{from} in {sample}.toml");
        assert_ends(&refusal(&folder.path().join(sample), &keys(sample).replacen(from, to, 1)), end);
    }
}

#[test]
fn med_files() {
    let sample = "beam_h5py.med";
    let said = |change: &dyn Fn(&File), end: &str| assert_ends(&med(sample, change, &keys(sample)), end);
    const STATE: &str = "ENS_MAA/body/-0000000000000000001-0000000000000000001";
    const STEP: &str = "CHA/MODES___DEPL/0000000000000000000200000000000000000000";
    let set = |f: &File, group: &str, name: &str, value: i32| f.group(group).unwrap().attr(name).unwrap().write_scalar(&value).unwrap();
    let replace = |f: &File, group: &str, name: &str| {
        let group = f.group(group).unwrap();
        group.delete_attr(name).unwrap();
        group
    };
    said(
        &|f| f.unlink("INFOS_GENERALES").unwrap(),
        ", expected INFOS_GENERALES and ENS_MAA; name a MED file; a modal file needs no import",
    );
    said(&|f| set(f, "ENS_MAA/body", "ESP", 2), "found 2 coordinates per node, expected 3; export the mesh in three dimensions");
    said(&|f| f.unlink("ENS_MAA/body").unwrap(), "ENS_MAA: found no mesh, expected a mesh; export the mesh with the modes");
    said(&|f| f.create_group("ENS_MAA/other").map(drop).unwrap(), "; name the one that carries the modes");
    said(
        &|f| f.create_group("ENS_MAA/body/later").map(drop).unwrap(),
        "found 2 mesh steps, expected one state of the mesh; export a mesh that does not change in time",
    );
    said(
        &|f| f.dataset(&format!("{STATE}/NOE/COO")).unwrap().attr("NBR").unwrap().write_scalar(&7_i32).unwrap(),
        "found 60 numbers for 7 nodes, expected three per node, for 1 to 50 million nodes; export the file again",
    );
    said(
        &|f| f.relink(&format!("{STATE}/MAI/HE8"), &format!("{STATE}/MAI/OC12")).unwrap(),
        "expected SE2 SE3 TR3 TR6 QU4 QU8 QU9 TE4 T10 PY5 P13 PE6 P15 HE8 H20 H27; export cells of a known type",
    );
    let families = |f: &File, path: &str| {
        if f.link_exists(path) {
            f.unlink(path).unwrap();
        }
        f.new_dataset::<i64>().shape(3).create(path).unwrap().write_raw(&[0_i64; 3]).unwrap();
    };
    said(
        &|f| families(f, &format!("{STATE}/MAI/HE8/FAM")),
        "MAI/HE8/FAM: found 3 numbers, expected 4: one family each; export the file again",
    );
    said(&|f| families(f, &format!("{STATE}/NOE/FAM")), "NOE/FAM: found 3 numbers, expected 20: one family each; export the file again");
    said(
        &|f| f.create_group(&format!("{STEP}/NOE/second")).map(drop).unwrap(),
        "NOE: found 2 parts, expected one for all nodes; export the file again",
    );
    said(
        &|f| f.relink(&format!("{STEP}/NOE/MED_NO_PROFILE_INTERNAL"), &format!("{STEP}/NOE/TIP")).unwrap(),
        "found 20 nodes of the profile TIP, expected all 20 nodes; export the field on the whole mesh",
    );
    said(&|f| set(f, STEP, "NDT", 1), "found step 1 twice, expected one state per step; export one state per mode");
    // types
    let remedy = "; write it as a plain little-endian array or, for texts, as fixed-length bytes (numpy.bytes_ in h5py)";
    let nodes = format!("{STATE}/NOE/FAM");
    let retyped = |f: &File| {
        f.unlink(&nodes).unwrap();
        f.new_dataset::<f64>().shape(4).create(nodes.as_str()).unwrap().write_raw(&[0.0; 4]).unwrap();
    };
    said(&retyped, &format!("found real numbers, expected integers{remedy}"));
    let named = |f: &File| {
        f.unlink(&nodes).unwrap();
        f.new_dataset::<[i8; 80]>().shape(4).create(nodes.as_str()).unwrap().write_raw(&[[65_i8; 80]; 4]).unwrap();
    };
    said(&named, &format!("found names, expected integers{remedy}"));
    let logical = |f: &File| {
        f.unlink(&nodes).unwrap();
        f.new_dataset::<bool>().shape(4).create(nodes.as_str()).unwrap().write_raw(&[true; 4]).unwrap();
    };
    said(
        &logical,
        &format!("found a boolean (an enumeration), expected little-endian real numbers, integers or names of 80 bytes{remedy}"),
    );
    let coordinates = format!("{STATE}/NOE/COO");
    let lettered = |f: &File| {
        f.unlink(&coordinates).unwrap();
        f.new_dataset::<[i8; 80]>().shape(4).create(coordinates.as_str()).unwrap().write_raw(&[[65_i8; 80]; 4]).unwrap();
    };
    said(&lettered, &format!("found names, expected numbers{remedy}"));
    // attributes
    let real = |f: &File| replace(f, STEP, "NDT").new_attr::<f64>().create("NDT").unwrap().write_scalar(&1.0).unwrap();
    said(&real, &format!("@NDT: found f8, expected an integer{remedy}"));
    let whole = |f: &File| replace(f, STEP, "PDT").new_attr::<i32>().create("PDT").unwrap().write_scalar(&1).unwrap();
    said(&whole, &format!("@PDT: found i4, expected a real number (f8){remedy}"));
    let endless = |f: &File| f.group(STEP).unwrap().attr("PDT").unwrap().write_scalar(&f64::NAN).unwrap();
    said(&endless, &format!("@PDT: found NaN, expected a finite number{remedy}"));
    let two = |f: &File| replace(f, STEP, "NDT").new_attr::<i32>().shape(2).create("NDT").unwrap().write_raw(&[1, 2]).unwrap();
    said(&two, "@NDT: found shape (2), expected a single value; export the file again");
    let controls = |f: &File| {
        let text = hdf5::types::FixedAscii::<16>::from_ascii(b"bo\x1bdy").unwrap();
        replace(f, "CHA/MODES___DEPL", "MAI").new_attr::<hdf5::types::FixedAscii<16>>().create("MAI").unwrap().write_scalar(&text).unwrap();
    };
    said(&controls, &format!("@MAI: found a text with control characters, expected a printable text{remedy}"));
    said(
        &|f| f.create_group("CHA/be\u{7}ll").map(drop).unwrap(),
        "CHA: found an object named \"be\\u{7}ll\", expected printable names; rename the object",
    );
    said(
        &|f| f.group(STATE).unwrap().group("MAI/HE8").unwrap().relink("NOD", "OLD").unwrap(),
        "HE8/NOD: found nothing, expected a dataset; export the file again from a current tool",
    );
    let group = |f: &File| {
        f.unlink(&nodes).unwrap();
        f.create_group(&nodes).unwrap();
    };
    said(&group, &format!("found a group, expected a dataset{remedy}"));
}

#[test]
fn a_cell_in_two_groups() {
    let change = |f: &File| {
        let family = "FAS/body/ELEME/Family_-5/GRO/NOM";
        let names = |path: &str| f.dataset(path).unwrap().read_raw::<[i8; 80]>().unwrap();
        let both = [names(family), names("FAS/body/ELEME/Family_-6/GRO/NOM")].concat();
        f.unlink(family).unwrap();
        f.new_dataset::<[i8; 80]>().shape(2).create(family).unwrap().write_raw(&both).unwrap();
    };
    assert_ends(
        &med("beam.med", change, &keys("beam.med")),
        "\" and another group, expected each cell in one group; leave one of the groups out",
    );
}

#[test]
fn a_file_without_extension() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("modes");
    std::fs::write(&file, "").unwrap();
    assert_ends(
        &refusal(&file, ""),
        "modes: the file: found no extension, expected XDMF (.xdmf, .xmf) or MED (.med, .rmed); rename the file, or convert it, for example with meshio; a modal file (.h5) needs no import",
    );
}
