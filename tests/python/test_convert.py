"""convert_modes.py: modes of other codes give the hinge loads of the original within the error that the report predicts.

The panel of the default example is written in the layout of each code, converted, and run in that example.
"""
import json
import re
import subprocess
import sys
from pathlib import Path

import convert_modes
import h5py
import meshio
import numpy as np
import pytest
from fem import validate
from foreign_files import OFFSET, mbdyn_file, nastran_files, save_hdf5, save_npz, vtu

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target" / "release" / "pliant"
COMMON = ["--root", "set:root", "--boundary", "cantilever", "--damping-ratio", "0.005", "--interface", "outboard=set:outboard"]


def peaks(modal_file, folder):
    """Peak moment and force of both drives of the default example with this panel."""
    text = (ROOT / "examples" / "02_hub_two_panels" / "scene.toml").read_text()
    scene = folder / "scene.toml"
    scene.write_text(re.sub(r'modal_file = "[^"]*"', f'modal_file = "{modal_file}"', re.sub(r"(?s)\[\[monitor\]\].*?(?=\n\[)", "", text)))
    done = subprocess.run([PROGRAM, "run", scene, "--duration", "8", "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    hinges = json.loads(done.stdout)["peaks"]["hinges"]
    return np.array([hinges[name][part] for name in ("drive_left", "drive_right") for part in ("moment", "force")])


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Loads with the committed file."""
    assert PROGRAM.exists(), "build the program first: cargo build --release"
    return peaks(ROOT / "modes" / "panel_cantilever.h5", tmp_path_factory.mktemp("original"))


def converted(arguments, out, capsys):
    """Converts, and returns what the report predicts as relative error of loads."""
    status = convert_modes.main([*map(str, arguments), "--out", str(out)])
    captured = capsys.readouterr()
    assert status == 0, captured.err
    assert all(rule.holds for rule in validate.validate(out))
    return float(re.search(r"predicted relative error of hinge loads by these: (\S+)", captured.out)[1]), captured.out


def refused(arguments, capsys, out="out.h5"):
    """The message of a conversion that must fail for its input."""
    status = convert_modes.main([*map(str, arguments), "--out", str(out)])
    captured = capsys.readouterr()
    assert status == 2 and captured.out == "", captured.out
    return captured.err.removeprefix("convert_modes.py: ").rstrip("\n")


def held(modal_file, original, predicted, tmp_path):
    """Loads differ by no more than predicted; the floor is what the integrator's tolerance of 1e-6 leaves in a peak when steps fall elsewhere."""
    difference = np.abs(peaks(modal_file, tmp_path) / original - 1).max()
    print(f"loads differ by {difference:.1e}, predicted {predicted:.1e}")
    assert difference <= predicted + 3e-5, (difference, predicted)
    return difference


def health(modal_file):
    """Rows of pliant check by rule."""
    done = subprocess.run([PROGRAM, "check", "--json", modal_file], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return {row["rule"]: row for row in json.loads(done.stdout)["files"][0]["rules"]}


# Nastran

NASTRAN = ["--root", "set:1", "--boundary", "cantilever", "--damping-ratio", "0.005"]


def test_a_nastran_model_of_concentrated_masses_gives_the_loads_of_the_original(panel, original, tmp_path, capsys):
    model, modes, labels = nastran_files(panel, tmp_path, turned=101 + np.arange(0, 2000, 7))
    outboard = "outboard=" + ",".join(map(str, labels[panel["outboard"]]))
    out = tmp_path / "panel.h5"
    predicted, said = converted(["nastran", model, modes, *NASTRAN, "--interface", outboard], out, capsys)
    assert 1e-5 < predicted < 5e-3
    assert "integrals are lumped sums over nodal masses; mass and inertia not stated by the code, orthonormality change" in said
    held(out, original, predicted, tmp_path)
    row = health(out)["modes mass-orthonormal"]
    assert row["note"].startswith("integrals are lumped sums over nodal masses; ") and "orthonormality change" in row["note"]
    with h5py.File(out) as file:
        assert file["mesh/cells"].attrs["cell_type"] == b"hexahedron20"
        # frequencies are those of the solver, not of the lumped masses
        assert np.allclose(file["modes/frequency"][()], panel["frequency"], rtol=1e-6)
        assert np.allclose(file["body/inertia"][()], panel["inertia"], rtol=1e-6, atol=1e-9)
        position = file["interfaces/outboard/position"][()]
    assert np.allclose(position, [2.0, 0.0, 0.0], atol=1e-9)


def test_a_nastran_model_whose_elements_have_the_mass_is_as_wrong_as_predicted(panel, original, tmp_path, capsys):
    # the grid point weight generator states the mass matrix of rigid motions, here that of the consistent mass
    place = panel["center"] + OFFSET
    arm = panel["total"] * np.array([[0, place[2], -place[1]], [-place[2], 0, place[0]], [place[1], -place[0], 0]])
    about = lambda c: c @ c * np.eye(3) - np.outer(c, c)
    inertia = panel["inertia"] + panel["total"] * (about(place) - about(panel["center"]))
    rigid = np.block([[panel["total"] * np.eye(3), arm], [arm.T, inertia]])
    model, modes, _ = nastran_files(panel, tmp_path, corners_only=True, rigid_mass=rigid)
    out = tmp_path / "panel.h5"
    predicted, said = converted(["nastran", model, modes, *NASTRAN], out, capsys)
    difference = held(out, original, predicted, tmp_path)
    assert predicted > 10 * 1e-4 and difference > 1e-5, "linear lumping on corners is worth a figure"
    defect = float(re.search(r"inertia defect (\S+),", said)[1])
    with h5py.File(out) as file:
        found = np.abs(file["body/inertia"][()] - panel["inertia"]).max() / np.abs(panel["inertia"]).max()
    assert defect == pytest.approx(found, rel=0.05) and "mass defect" in said
    with h5py.File(out) as file:
        assert file["body/mass"][()] == pytest.approx(panel["total"], rel=1e-9)


def test_nastran_units_are_those_that_the_command_says(panel, original, tmp_path, capsys):
    # mm, tonnes: modes of unit modal mass are in 1 / sqrt(tonne)
    scaled = {**panel, "points": panel["points"] * 1e3, "mass": panel["mass"] / 1e3, "shapes": panel["shapes"] * np.sqrt(1e3)}
    model, modes, _ = nastran_files(scaled, tmp_path)
    out = tmp_path / "panel.h5"
    predicted, _ = converted(["nastran", model, modes, *NASTRAN, "--length-unit", "0.001", "--mass-unit", "1000"], out, capsys)
    held(out, original, predicted, tmp_path)


def test_what_nastran_files_lack_is_refused_by_name(panel, tmp_path, capsys):
    model, modes, labels = nastran_files(panel, tmp_path, subcases=2)
    assert refused(["nastran", model, modes, *NASTRAN], capsys) == (
        f"{modes}: eigenvectors: found subcases 1, 2, expected one subcase; choose with --subcase")
    assert refused(["nastran", model, modes, *NASTRAN, "--subcase", "4"], capsys).startswith(f"{modes}: eigenvectors: found no subcase 4, expected one of: 1, 2")
    model, modes, labels = nastran_files(panel, tmp_path, drop_node=1)
    assert refused(["nastran", model, modes, *NASTRAN], capsys) == (
        f"{modes}: eigenvectors, GRID {labels.max()}: found nothing for 1 GRIDs, expected every GRID of the model; ask for VECTOR=ALL in the case control")
    model, modes, _ = nastran_files(panel, tmp_path, offset_mass=1)
    assert refused(["nastran", model, modes, *NASTRAN], capsys) == (
        f"{model}: CONM2 9000000: found an offset [0.1, 0.0, 0.0], expected none; put it on a GRID at its place, held by RBE2")
    assert "absent.op2: file: found nothing, expected a Nastran file; check the path" in refused(["nastran", model, "absent.op2", *NASTRAN], capsys)
    junk = tmp_path / "junk.op2"
    junk.write_bytes(b"no op2 at all" * 9)
    assert refused(["nastran", model, junk, *NASTRAN], capsys).startswith(f"{junk}: OP2: found a file that pyNastran cannot read")
    model.write_text("SOL 103\nCEND\nBEGIN BULK\nCHEXA,1,1,1,2,3\nENDDATA\n")
    assert refused(["nastran", model, modes, *NASTRAN], capsys).startswith(f"{model}: bulk data: found a deck that pyNastran cannot read")


# MBDyn

def listed(nodes, first):
    return ",".join(str(node + first) for node in sorted(nodes))


def test_an_mbdyn_file_gives_the_loads_of_the_original(panel, original, tmp_path, capsys):
    file, mesh, out = mbdyn_file(panel, tmp_path / "panel.fem"), vtu(panel, tmp_path / "mesh.vtu"), tmp_path / "panel.h5"
    options = ["--root", listed(panel["root"], 1), "--boundary", "cantilever", "--damping-ratio", "0.005"]
    predicted, said = converted(["mbdyn", file, "--mesh", mesh, *options], out, capsys)
    # the file states mass and inertia, so that the report has their defects
    assert "mass defect" in said and "inertia defect" in said
    held(out, original, predicted, tmp_path)
    with h5py.File(out) as file:
        assert file["mesh/surface_triangles"].shape[0] == 752
    # without a mesh there is no surface, and the report says so
    predicted, said = converted(["mbdyn", tmp_path / "panel.fem", *options], out, capsys)
    assert "no surface: bodies of this file are not drawn and carry no stress" in said
    held(out, original, predicted, tmp_path)


def test_modes_of_an_mbdyn_file_may_be_combinations(panel, original, tmp_path, capsys):
    # Craig-Bampton modes as a code writes them: not orthogonal, full modal matrices
    mix = np.eye(len(panel["frequency"])) + 0.3 * np.random.default_rng(2).standard_normal((len(panel["frequency"]),) * 2)
    stiffness = mix.T @ np.diag((2 * np.pi * panel["frequency"]) ** 2) @ mix
    text = lambda matrix: "\n".join(" ".join(f"{x:.17e}" for x in row) for row in matrix)
    mixed = {**panel, "shapes": np.tensordot(mix.T, panel["shapes"], 1)}
    file = mbdyn_file(mixed, tmp_path / "panel.fem", r9=text(mix.T @ mix), r10=text(stiffness))
    out = tmp_path / "panel.h5"
    predicted, said = converted(["mbdyn", file, "--root", listed(panel["root"], 1), "--boundary", "cantilever", "--damping-ratio", "0.005"], out, capsys)
    assert "modes combined to those of the modal mass and stiffness of the file" in said
    held(out, original, predicted, tmp_path)


def test_what_an_mbdyn_file_lacks_is_refused_by_name(panel, tmp_path, capsys):
    options = ["--root", listed(panel["root"], 1), "--boundary", "cantilever", "--damping-ratio", "0.005"]
    path = tmp_path / "panel.fem"
    mbdyn_file(panel, path, r11=None)
    assert refused(["mbdyn", path, *options], capsys) == (
        f"{path}: nodal masses: found none, expected a mass for every node; give --node-mass FILE.npy (one number per node, in the order of the file)")
    np.save(tmp_path / "mass.npy", panel["mass"][:-1])
    assert "node_mass: found shape (2090,), expected (2091,)" in refused(["mbdyn", path, *options, "--node-mass", tmp_path / "mass.npy"], capsys)
    mbdyn_file(panel, path, r10=None)
    assert refused(["mbdyn", path, *options], capsys) == f"{path}: record group 10 (modal stiffness): found nothing, expected the group; write the file with it"
    mbdyn_file(panel, path, r9="1 2 3")
    assert refused(["mbdyn", path, *options], capsys) == f"{path}: record group 9 (modal mass): found 3 numbers, expected 100 by the header; write the file again"
    mbdyn_file(panel, path, r5="x")
    assert "record group 5 (X coordinates): found the word 'x', expected numbers; repair the file" in refused(["mbdyn", path, *options], capsys)
    mbdyn_file(panel, path, r1="REV0 many")
    assert "record group 1 (header): found \"REV0 many\", expected a revision and five counts" in refused(["mbdyn", path, *options], capsys)
    uneven = np.hstack([np.repeat(panel["mass"][:, None], 3, 1), np.zeros((len(panel["mass"]), 3))])
    uneven[4, 1] *= 2
    mbdyn_file(panel, path, r11="\n".join(" ".join(map(repr, row.tolist())) for row in uneven))
    assert "record group 11 (lumped masses), node 5: found masses" in refused(["mbdyn", path, *options], capsys)
    path.write_text("nothing of the kind")
    assert f"{path}: record groups: found none, expected lines as ** RECORD GROUP 1, HEADER" in refused(["mbdyn", path, *options], capsys)
    mbdyn_file(panel, path)
    meshio.write(tmp_path / "other.vtu", meshio.Mesh(panel["points"] + 1.0, [("hexahedron", panel["cells"][:, :8])]))
    assert "give the mesh that the modes were computed on, in the same units and axes" in refused(["mbdyn", path, *options, "--mesh", tmp_path / "other.vtu"], capsys)


# Exudyn

@pytest.mark.parametrize("suffix, save", [("hdf5", save_hdf5), ("npz", save_npz)])
def test_an_exudyn_file_gives_the_loads_and_stress_of_the_original(suffix, save, fem, original, tmp_path, capsys):
    file, out = save(tmp_path / f"fem.{suffix}", fem), tmp_path / "panel.h5"
    predicted, said = converted(["exudyn", file, *COMMON], out, capsys)
    # the mass matrix is carried, so that nothing is lumped
    assert "integrals from the code's consistent mass matrix" in said and predicted < 1e-9
    held(out, original, predicted, tmp_path)
    with h5py.File(out) as file, h5py.File(ROOT / "modes" / "panel_cantilever.h5") as first:
        assert np.allclose(np.abs(file["inertia/momentum"][()]), np.abs(first["inertia/momentum"][()]), atol=1e-6)
        assert np.allclose(np.abs(file["interfaces/outboard/displacement"][()]), np.abs(first["interfaces/outboard/displacement"][()]), atol=2e-3)
        # the order of nodes may differ, the largest of each component does not
        for component in range(6):
            a, b = (np.abs(f["modes/stress/0000"][:, component]).max() for f in (file, first))
            assert a == pytest.approx(b, rel=1e-3)


def test_what_an_exudyn_file_lacks_is_refused_by_name(fem, tmp_path, capsys):
    path = tmp_path / "fem.hdf5"
    for change, message in (({"massMatrix": None}, "massMatrix: found nothing, expected a sparse matrix; assemble it before SaveToFile"),
                            ({"modeBasis": {}}, "modeBasis: found no matrix, expected the modes; call ComputeEigenmodes or ComputeHurtyCraigBamptonModes before SaveToFile"),
                            ({"nodes": {"RigidBodyRxyz": np.zeros((2, 6))}}, "nodes: found nodes of the kinds RigidBodyRxyz, expected Position (solids); export a solid mesh"),
                            ({"elements": [{"Name": "a", "Quad4": np.zeros((1, 4))}]}, "elements: found the type Quad4, expected some of: Tet4, Tet10, Hex8, Hex20, Wedge6; export these elements")):
        save_hdf5(path, {key: value for key, value in {**fem, **change}.items() if value is not None})
        assert refused(["exudyn", path, *COMMON], capsys) == f"{path}: {message}"
    path.write_text("no hdf5")
    assert refused(["exudyn", path, *COMMON], capsys).startswith(f"{path}: file: found no FEM file")
    save_hdf5(path, fem)
    options = [word if word != "set:root" else "set:base" for word in COMMON]
    assert refused(["exudyn", path, *options], capsys) == f"{path}: --root: found no set of nodes \"base\", expected one of: outboard, root; correct the name, or list node numbers"


def test_a_pickle_that_would_run_code_is_not_loaded(fem, tmp_path, capsys):
    class Trap:
        def __reduce__(self):
            return print, ("trapped",)
    path = save_npz(tmp_path / "fem.npz", {**fem, "metaData": {"trap": Trap()}})
    message = refused(["exudyn", path, *COMMON], capsys)
    assert message.startswith(f"{path}: file: found no FEM file (the object builtins.print)") and message.endswith("save it as .hdf5 instead")


# any mesh with modes as .npz

def test_a_mesh_with_modes_gives_the_loads_of_the_original(panel, original, tmp_path, capsys):
    mesh, modes, out = vtu(panel, tmp_path / "mesh.vtu"), tmp_path / "modes.npz", tmp_path / "panel.h5"
    # scaled to a largest entry of one, as many codes do
    scale = np.abs(panel["shapes"]).max(axis=(1, 2))
    np.savez(modes, frequency=panel["frequency"], displacement=panel["shapes"] / scale[:, None, None], node_mass=panel["mass"],
             stress=panel["stress"] / scale[:, None, None])
    options = ["--root", listed(panel["root"], 1), "--boundary", "cantilever", "--damping-ratio", "0.005"]
    predicted, _ = converted(["mesh", mesh, modes, *options], out, capsys)
    held(out, original, predicted, tmp_path)
    with h5py.File(out) as file:
        assert np.abs(file["modes/stress/0000"][()]).max() == pytest.approx(np.abs(panel["stress"][0]).max(), rel=1e-3)


def test_a_mesh_of_corners_with_a_density_is_as_wrong_as_predicted(panel, original, tmp_path, capsys):
    corners, cells = np.unique(panel["cells"][:, :8], return_inverse=True)
    meshio.write(tmp_path / "mesh.vtu", meshio.Mesh(panel["points"][corners], [("hexahedron", cells.reshape(-1, 8))]))
    np.savez(tmp_path / "modes.npz", frequency=panel["frequency"], displacement=panel["shapes"][:, corners])
    out, root = tmp_path / "panel.h5", np.flatnonzero(np.isin(corners, panel["root"]))
    options = ["--root", listed(root, 1), "--boundary", "cantilever", "--damping-ratio", "0.005", "--density", "250"]
    predicted, said = converted(["mesh", tmp_path / "mesh.vtu", tmp_path / "modes.npz", *options], out, capsys)
    assert "mass of cells in equal parts on their corners" in said
    held(out, original, predicted, tmp_path)


def test_what_a_mesh_or_its_modes_lack_is_refused_by_name(panel, tmp_path, capsys):
    mesh, modes = vtu(panel, tmp_path / "mesh.vtu"), tmp_path / "modes.npz"
    options = ["--root", listed(panel["root"], 1), "--boundary", "cantilever", "--damping-ratio", "0.005"]
    arrays = {"frequency": panel["frequency"], "displacement": panel["shapes"], "node_mass": panel["mass"]}

    def says(change, *further, replaced=options):
        np.savez(modes, **{name: value for name, value in {**arrays, **change}.items() if value is not None})
        return refused(["mesh", mesh, modes, *replaced, *further], capsys)
    assert says({"frequency": None}) == f"{modes}: frequency: found nothing, expected an array of that name; add it to the .npz"
    assert says({"frequencies": panel["frequency"]}).startswith(f"{modes}: frequencies: found an unknown array, expected some of: frequency, displacement")
    assert "nodal masses: found none, expected a mass for every node; give --node-mass" in says({"node_mass": None})
    assert "displacement: found shape (10, 2090, 3), expected (10, 2091, 3): 10 modes, 2091 nodes" in says({"displacement": panel["shapes"][:, 1:]})
    assert "frequency: found a number that is not finite" in says({"frequency": panel["frequency"] * np.nan})
    assert "damping: found none, expected a ratio for every mode; give --damping-ratio" in says({}, replaced=options[:-2])
    assert "--damping-ratio: found 2 numbers, expected one, or one for each of 10 modes" in says({}, "--damping-ratio", "0", "0.1")
    assert "--root: found no node 9999, expected a node from 1 to 2091" in says({}, "--root", "9999")
    assert "--root: found \"a-b\", expected node numbers as 101,102,110-120, or set:NAME" in says({}, "--root", "a-b")
    moving = says({}, "--root", listed(panel["outboard"], 1))
    assert "expected a root at rest in every mode; name the clamped nodes, or give --boundary general" in moving
    assert "--interface tip: found one node, and no nodal rotations in the file" in says({}, "--interface", "tip=17")
    assert "nodes lie on one line" in says({}, "--interface", "tip=" + listed(panel["outboard"][:2], 1))
    assert "these masses are not those of the modes" in says({"node_mass": np.roll(panel["mass"], 900) * (1 + panel["points"][:, 0] ** 4)})
    assert "mode 1: found 0 Hz, a rigid-body mode, expected elastic modes" in says({"frequency": np.concatenate([[0.0], panel["frequency"][1:]])})
    assert says({}, "--interface", "tip").startswith("--interface: tip: found no new name with its nodes")
    assert says({}, "--mass-unit", "0") == "--mass-unit: value: found 0.0, expected a positive number; correct the option"
    modes.write_bytes(b"no zip")
    assert refused(["mesh", mesh, modes, *options], capsys).startswith(f"{modes}: file: found a file that numpy cannot read")
    np.savez(modes, **arrays)
    assert "absent.vtu: file: found nothing, expected a mesh" in refused(["mesh", "absent.vtu", modes, *options], capsys)
    (tmp_path / "bad.vtu").write_text("<VTK")
    assert "bad.vtu: mesh: found a file that meshio cannot read" in refused(["mesh", tmp_path / "bad.vtu", modes, *options], capsys)
    assert refused(["mesh", mesh, modes, *options], capsys, out="panel.hdf") == '--out: panel.hdf: found the ending ".hdf", expected .h5; name the modal file NAME.h5'
    own = tmp_path / "panel.xdmf"
    meshio.write(own, meshio.Mesh(panel["points"], [("hexahedron20", panel["cells"][:, :20])]))
    message = refused(["mesh", own, modes, *options], capsys, out=tmp_path / "panel.h5")
    assert message == f"--out: {own}: found an input of this conversion, expected another file; write elsewhere"
    message = refused(["mesh", mesh, modes, *options], capsys, out=tmp_path / "absent" / "panel.h5")
    assert "cannot be written" in message and "name a folder that exists" in message


def test_free_modes_lose_their_rigid_body_part_and_rigid_modes_are_left_out(tmp_path, capsys):
    with h5py.File(ROOT / "modes" / "panel_free_free.h5") as file:
        points, cells, mass = file["mesh/points"][()], file["mesh/cells"][()], file["mesh/node_mass"][()]
        shapes = np.array([item[()] for _, item in sorted(file["modes/displacement"].items())], float)
        frequency, root = file["modes/frequency"][()], file["interfaces/root/nodes"][()]
    rigid = np.array([np.broadcast_to(axis, points.shape) for axis in np.eye(3)] + [np.cross(axis, points) for axis in np.eye(3)])
    meshio.write(tmp_path / "mesh.vtu", meshio.Mesh(points, [("hexahedron20", cells[:, :20])]))
    np.savez(tmp_path / "modes.npz", frequency=np.concatenate([np.full(6, 1e-4), frequency]), displacement=np.concatenate([rigid, shapes]), node_mass=mass)
    out = tmp_path / "panel.h5"
    _, said = converted(["mesh", tmp_path / "mesh.vtu", tmp_path / "modes.npz", "--root", listed(root, 1), "--boundary", "free-free", "--damping-ratio", "0"], out, capsys)
    assert "6 rigid-body modes left out" in said
    with h5py.File(out) as file:
        assert np.allclose(file["modes/frequency"][()], frequency)


def test_nodes_with_inertia_of_their_own_are_carried(tmp_path, capsys):
    """A beam of point masses with rotary inertia: what a shell or beam code brings."""
    points = np.array([[x, y, 0.0] for x in np.linspace(0, 2, 6) for y in (-0.2, 0.2)])
    rng, x = np.random.default_rng(3), points[:, 0]
    displacement, rotation = np.zeros((2, 12, 3)), np.zeros((2, 12, 3))
    for mode, power in enumerate((2, 3)):
        displacement[mode, :, 2], rotation[mode, :, 1] = x ** power, -power * x ** (power - 1)
    mass, inertia = rng.uniform(0.5, 1.0, 12), np.tile([0.02, 0.03, 0.01, 0.0, 0.0, 0.0], (12, 1))
    # make the two shapes orthogonal in these masses
    inner = lambda a, b: np.sum(mass[:, None] * displacement[a] * displacement[b]) + np.sum(inertia[:, :3] * rotation[a] * rotation[b])
    share = inner(0, 1) / inner(0, 0)
    displacement[1], rotation[1] = displacement[1] - share * displacement[0], rotation[1] - share * rotation[0]
    quads = np.array([[2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1] for i in range(5)])
    meshio.write(tmp_path / "mesh.vtu", meshio.Mesh(points, [("quad", quads)]))
    np.savez(tmp_path / "modes.npz", frequency=[1.0, 4.0], displacement=displacement, rotation=rotation, node_mass=mass, node_inertia=inertia, labels=np.arange(12) + 50)
    out = tmp_path / "plate.h5"
    options = ["--root", "50,51", "--interface", "tip=60", "--boundary", "cantilever", "--damping-ratio", "0"]
    converted(["mesh", tmp_path / "mesh.vtu", tmp_path / "modes.npz", *options], out, capsys)
    assert health(out)["modes mass-orthonormal"]["object"] == "inertia/modal_mass"
    with h5py.File(out) as file:
        assert file["interfaces/tip"].attrs["coupling"] == b"rbe2"
        expected = np.sum(mass * (points[:, 1] ** 2)) + 12 * 0.02
        assert file["body/inertia"][0, 0] == pytest.approx(expected, rel=1e-12)
        six = file["interfaces/tip/displacement"][0]
    assert six[4] / six[2] == pytest.approx(-1.0, rel=1e-9), "slope over deflection of x^2 at x = 2"


def test_every_subcommand_explains_itself():
    for code in ("nastran", "mbdyn", "exudyn", "mesh"):
        done = subprocess.run([sys.executable, ROOT / "scripts" / "convert_modes.py", code, "--help"], capture_output=True, text=True)
        assert done.returncode == 0 and "--root" in done.stdout and "--damping-ratio" in done.stdout
