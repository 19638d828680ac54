"""What the readers of other codes refuse: each message names file, object, what was found, what was expected and what to do."""
import subprocess
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
import scipy.sparse
from convert import assemble, exudyn, mesh, nastran
from convert.choices import Choices
from convert.errors import InputError
from convert.foreign import Foreign
from foreign_files import mbdyn_file, save_hdf5
from test_convert import refused

CHOICES = Choices(root="1-4", interfaces={}, boundary="cantilever", damping_ratio=[0.0], length_unit=1.0, mass_unit=1.0)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """OP2 files with one mode of nodes 1 and 2, by the code of its table: 7 of eigenvectors, 1 of displacements."""
    folder = tmp_path_factory.mktemp("op2")
    script = ("import sys, numpy as np\nfrom pyNastran.op2.op2 import OP2\n"
              "from pyNastran.op2.tables.oug.oug_eigenvectors import RealEigenvectorArray as R\n"
              "for code in (1, 7):\n"
              "    r = OP2(debug=False); r.set_as_msc(); r.is_msc, r.is_nx, r.is_optistruct = True, False, False\n"
              "    kinds = np.array([[1, 1], [2, 1]], dtype='int32')\n"
              "    t = R.add_modal_case('OUGV1', kinds, np.ones((1, 2, 6), dtype='float32'), 1, np.array([1]), np.array([4.0]), np.array([0.3]))\n"
              "    t.table_code = t.data_code['table_code'] = code\n"
              "    (r.eigenvectors if code == 7 else r.displacements)[1] = t\n"
              "    r.write_op2(f'{sys.argv[1]}/{code}.op2', post=-1, endian=b'<', nastran_format='msc')\n")
    done = subprocess.run([nastran.python(), "-c", script, folder], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return {code: folder / f"{code}.op2" for code in (1, 7)}


def deck(folder, lines, modes):
    """The message of the reader of Nastran on a deck."""
    model = folder / "model.bdf"
    model.write_text("\n".join(["SOL 103", "CEND", "BEGIN BULK", *lines, "ENDDATA", ""]))
    with pytest.raises(InputError) as refusal:
        nastran.read(model, modes)
    return str(refusal.value)


GRIDS = ["GRID,1,,0.,0.,0.", "GRID,2,,1.,0.,0."]


@pytest.mark.parametrize("lines, message", [
    ([*GRIDS, "CORD2S,5,,0.,0.,0.,0.,0.,1.", ",1.,0.,0.", "GRID,3,,2.,0.,0."], "7.op2: eigenvectors, GRID 3: found nothing for 1 GRIDs, expected every GRID of the model; ask for VECTOR=ALL in the case control"),
    ([GRIDS[0]], "model.bdf: GRID 2: found nothing for 1 nodes of "),
    (["GRID,1,,0.,0.,0.", "GRID,2,,1.,0.,0.,5", "CORD2S,5,,0.,0.,0.,0.,0.,1.", ",1.,0.,0."], "model.bdf: GRID 2: found displacement axes of the kind CORD2S, expected rectangular or cylindrical ones; give the nodes other displacement axes"),
    ([*GRIDS, "CMASS2,9,1.0,1,1"], "model.bdf: CMASS2 9: found a mass that is not carried, expected CONM2; write it as CONM2"),
    ([*GRIDS, "CORD2R,5,,0.,0.,0.,0.,0.,1.", ",0.,1.,0.", "CONM2,9,1,5,1.0"], "model.bdf: CONM2 9: found axes 5, expected basic axes (0); give its inertia in basic axes"),
    ([*GRIDS, "CBEND,9,1,1,2,0.,1.,0.,1", "PBEND,1,1,1.,1.,1.,1.", "MAT1,1,1.+9,,.3"], "model.bdf: CBEND 9: found an element of 2 nodes that is not carried, expected solids, shells, bars and rods; replace it, or condense the model to GRIDs with CONM2"),
])
def test_what_a_deck_cannot_say_in_a_modal_file_is_refused_by_the_card(lines, message, tables, tmp_path):
    assert message in deck(tmp_path, lines, tables[7])


def test_an_op2_without_eigenvectors_is_refused_with_the_request_that_makes_them(tables, tmp_path):
    assert deck(tmp_path, GRIDS, tables[1]) == (
        f"{tables[1]}: eigenvectors (OUGV1): found none, expected those of a normal modes analysis (SOL 103); "
        "ask for DISPLACEMENT(PLOT)=ALL or VECTOR=ALL and PARAM,POST,-1")


def test_a_missing_environment_is_named_with_the_script_that_makes_it(tmp_path, monkeypatch):
    for name in ("a.bdf", "a.op2"):
        (tmp_path / name).write_text("")
    monkeypatch.setattr(nastran, "python", lambda: tmp_path / "absent")
    with pytest.raises(InputError, match="pyNastran: found no such interpreter, expected the environment that holds pyNastran; run scripts/setup.sh"):
        nastran.read(tmp_path / "a.bdf", tmp_path / "a.op2")


def test_what_pynastran_cannot_read_is_said_in_its_own_words(tmp_path, monkeypatch):
    for name in ("a.bdf", "a.op2"):
        (tmp_path / name).write_text("")
    interpreter = tmp_path / "python"
    interpreter.write_text("#!/bin/sh\necho 'RuntimeError: CARD 7 is odd' >&2\nexit 1\n")
    interpreter.chmod(0o755)
    monkeypatch.setattr(nastran, "python", lambda: interpreter)
    with pytest.raises(InputError) as refusal:
        nastran.read(tmp_path / "a.bdf", tmp_path / "a.op2")
    assert str(refusal.value) == f"{tmp_path / 'a.bdf'}: pyNastran: found RuntimeError: CARD 7 is odd, expected a model that it reads; look at the cards it names"


def square(**change):
    """Four nodes at the root, four outboard, one mode."""
    points = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 0.1)])
    displacement = np.zeros((1, 8, 3))
    displacement[0, 4:, 2] = 1.0
    fields = {"file": Path("model.npz"), "code": "test", "labels": np.arange(1, 9), "points": points, "cells": [("hexahedron", np.array([[0, 4, 6, 2, 1, 5, 7, 3]]))],
              "displacement": displacement, "frequency": np.array([2.0]), "node_mass": np.ones(8)}
    return Foreign(**{**fields, **change})


@pytest.mark.parametrize("change, message", [
    ({"node_mass": np.zeros(8)}, "model.npz: nodal masses: found a sum of 0, expected a positive mass; check densities and masses in the model"),
    ({"node_inertia": np.ones((8, 6))}, "model.npz: rotations: found none, but nodes with inertia of their own, expected rotations of every node; export all six components of the modes"),
    ({"displacement": np.zeros((0, 8, 3)), "frequency": np.zeros(0)}, "model.npz: modes: found none, expected at least one; export the modes from the code; a body without them is rigid"),
    ({"node_mass": np.array([1, 1, 1, 1, 0, 0, 0, 0.0])}, "model.npz: modes and masses: found modes that are not orthogonal, expected those of one model; mode 1: no mass moves in it; check the nodal masses and the node numbers"),
])
def test_masses_and_modes_that_do_not_make_a_body_are_refused(change, message):
    with pytest.raises(InputError) as refusal:
        assemble.compute(square(**change), CHOICES)
    assert message in str(refusal.value)


def test_an_interface_of_nodes_in_line_is_refused():
    choices = Choices("1-4", {"edge": "5-6"}, "cantilever", [0.0], 1.0, 1.0)
    with pytest.raises(InputError) as refusal:
        assemble.compute(square(), choices)
    assert "found 2 nodes, expected a face; " in str(refusal.value)


def test_modes_of_rigid_motion_alone_are_refused():
    foreign = square(displacement=np.ones((1, 8, 3)))
    with pytest.raises(InputError, match="model.npz: modes: found rigid-body modes only, expected elastic modes; export more modes"):
        assemble.compute(foreign, Choices("1-4", {}, "free-free", [0.0], 1.0, 1.0))


def test_a_conversion_that_breaks_a_rule_leaves_no_file(tmp_path):
    # a negative mass passes as a sum, not as a body
    foreign = square(node_mass=np.array([4.0, 4, 4, 4, 4, 4, -1, 1]))
    with pytest.raises(InputError, match="model.npz: the converted modes: found rules of the schema that do not hold:") as refusal:
        assemble.write(foreign, Choices("1-4", {}, "cantilever", [-0.5], 1.0, 1.0), tmp_path / "body.h5")
    assert "damping not negative" in str(refusal.value) and "look at units, node masses and --boundary" in str(refusal.value)
    assert list(tmp_path.iterdir()) == []


def test_meshes_without_volume_have_no_density(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    meshio.write(tmp_path / "shell.vtu", meshio.Mesh(points, [("triangle", np.array([[0, 1, 2]]))]))
    np.savez(tmp_path / "modes.npz", frequency=[1.0], displacement=np.zeros((1, 3, 3)))
    with pytest.raises(InputError, match="shell.vtu: cells of type triangle: found no volume, expected solids where --density is given; give node_mass in the .npz"):
        mesh.read(tmp_path / "shell.vtu", tmp_path / "modes.npz", 1.0)
    meshio.write(tmp_path / "odd.vtu", meshio.Mesh(points, [("polygon", np.array([[0, 1, 2]]))]))
    with pytest.raises(InputError, match="odd.vtu: cells: found the type polygon"):
        mesh.read(tmp_path / "odd.vtu", tmp_path / "modes.npz")


@pytest.mark.parametrize("change, message", [
    (lambda data: {"massMatrix": data["massMatrix"][:6, :6]}, "massMatrix: found shape (6, 6), expected (6273, 6273), three for each node; write the file again"),
    (lambda data: {"massMatrix": data["massMatrix"] + scipy.sparse.eye(6273, k=1, format="csr")}, "massMatrix: found directions coupled or unequal by 1, expected the same mass in x, y and z; use nodes of the kind Position"),
    (lambda data: {"modeBasis": {"matrix": np.ones((5, 2))}}, "modeBasis/matrix: found shape (5, 2), expected (6273, modes); write the file again"),
    (lambda data: {"modeBasis": {"matrix": np.zeros((6273, 2))}}, "modeBasis/matrix: found modes that depend on each other, expected independent modes; compute fewer modes"),
    (lambda data: {"nodes": np.zeros(3)}, "nodes: found ndarray, expected a dictionary with Position; write the file with FEMinterface.SaveToFile"),
])
def test_matrices_of_exudyn_that_do_not_fit_are_refused(change, message, fem, tmp_path):
    path = save_hdf5(tmp_path / "fem.hdf5", {**fem, **change(fem)})
    with pytest.raises(InputError) as refusal:
        exudyn.read(path)
    assert str(refusal.value) == f"{path}: {message}"


def test_matrices_of_mbdyn_that_do_not_fit_are_refused(panel, tmp_path, capsys):
    path = tmp_path / "panel.fem"
    options = ["--root", "1", "--boundary", "general", "--damping-ratio", "0"]
    text = lambda matrix: "\n".join(" ".join(map(repr, row.tolist())) for row in matrix)
    mbdyn_file(panel, path, r9=text(-np.eye(10)))
    assert refused(["mbdyn", path, *options], capsys) == (
        f"{path}: record group 9 (modal mass): found a matrix that is not positive definite, expected the modal mass of independent modes; write the file again")
    mbdyn_file(panel, path, r13=text(np.eye(10) + 0.1))
    assert refused(["mbdyn", path, *options], capsys) == (
        f"{path}: record group 13 (modal damping): found coupling of modes by 0.1, expected damping of each mode alone; remove the group and give --damping-ratio")
    assert "absent.fem: file: found nothing to read (No such file or directory)" in refused(["mbdyn", "absent.fem", *options], capsys)


def test_a_node_mass_file_must_be_an_array(panel, tmp_path, capsys):
    path = mbdyn_file(panel, tmp_path / "panel.fem")
    (tmp_path / "mass.npy").write_text("1 2 3")
    message = refused(["mbdyn", path, "--root", "1", "--boundary", "general", "--damping-ratio", "0", "--node-mass", tmp_path / "mass.npy"], capsys)
    assert message.startswith(f"{tmp_path / 'mass.npy'}: --node-mass: found a file that numpy cannot read") and message.endswith("write it with numpy.save")
