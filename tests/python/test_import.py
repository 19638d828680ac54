"""Bodies of the project, written as meshio, the MED library and h5py write them, come back through `pliant import` as they were."""
import json
import re
import subprocess

import h5py
import meshio
import numpy as np
import pytest

import import_samples
from conftest import MODES, ROOT

PROGRAM = ROOT / "target" / "release" / "pliant"
SCENE = ROOT / "examples" / "02_hub_two_panels" / "scene.toml"
#: file, and the names of its fields of displacement and stress
WRITERS = {
    "meshio XDMF": ("panel.xdmf", lambda path, body: import_samples.write_xdmf(path, body), "displacement", "stress"),
    "meshio XDMF inline": ("panel_inline.xdmf", lambda path, body: import_samples.write_xdmf(path, body, "XML"), "displacement", "stress"),
    "MED library": ("panel.med", lambda path, body: import_samples.write_med(path, body, order=[3, 1, 0, 2, 9, 8, 7, 6, 5, 4]),
                    "MODES___DEPL", "MODES___SIGM_NOEU"),
    "h5py MED, i4": ("panel_i4.med", lambda path, body: import_samples.write_med_h5py(path, body), "MODES___DEPL", None),
    "h5py MED, i8, other sense": ("panel_i8.med", lambda path, body: import_samples.write_med_h5py(path, body, "i8", "MED"),
                                  "MODES___DEPL", None),
}


def _pliant(*arguments, cwd=None):
    if not PROGRAM.is_file():
        pytest.skip("target/release/pliant is not built")
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=120)


def _import(path, out, *arguments):
    done = _pliant("import", path, "--out", out, "--damping-ratio", "0.005", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def panel():
    """The panel of the default example."""
    return import_samples.of_modal_file(MODES / "panel_cantilever.h5")


@pytest.fixture(scope="module")
def loads(tmp_path_factory):
    """A function from a body's lines in the scene to the loads at the drives, at a tolerance that leaves lumping alone to be seen."""
    folder = tmp_path_factory.mktemp("loads")

    def run(name, body):
        scene = SCENE.read_text().replace('modal_file = "../../modes/panel_cantilever.h5"', body)
        scene = scene.replace("duration = 30.0", "duration = 12.0\nrelative_tolerance = 1e-8\nabsolute_tolerance = 1e-11")
        # not every writer of this file carries stress
        scene = re.sub(r'\[\[monitor\]\]\nbody[^[]*', "", scene)
        path = folder / f"{name}.toml"
        path.write_text(scene)
        done = _pliant("run", path, "--out", folder / f"{name}.h5", cwd=folder)
        assert done.returncode == 0, done.stderr
        with h5py.File(folder / f"{name}.h5") as file:
            return {f"{hinge} {load}": file[f"hinges/{hinge}/{load}"][()]
                    for hinge in ("drive_left", "drive_right") for load in ("load_moment", "load_force")}
    return run


@pytest.fixture(scope="module")
def reference(loads):
    return loads("reference", f"modal_file = {json.dumps(str(MODES / 'panel_cantilever.h5'))}")


@pytest.mark.parametrize("writer", WRITERS)
def test_the_panel_of_the_default_example_gives_the_same_hinge_loads(writer, panel, loads, reference, tmp_path):
    name, write, displacement, stress = WRITERS[writer]
    write(tmp_path / name, panel)
    fields = ["--displacement", displacement] + (["--stress", stress] if stress else [])
    report = _import(tmp_path / name, tmp_path / "body.h5", *fields, "--density", 250,
                     "--interface", "root=root", "--interface", "outboard=outboard")
    assert 1e-5 < report["departure"] < 1e-3
    imported = loads(re.sub(r"\W", "_", writer), f"modal_file = {json.dumps(str(tmp_path / 'body.h5'))}")
    for load, values in reference.items():
        # measured: 9e-6, and 7e-8 about the drive axis
        assert np.abs(imported[load] - values).max() <= report["departure"] * np.abs(values).max(), load


def test_a_scene_that_names_the_file_gives_the_same_loads_as_its_modal_file(panel, loads, tmp_path):
    import_samples.write_med(tmp_path / "panel.med", panel)
    _import(tmp_path / "panel.med", tmp_path / "body.h5", "--displacement", "MODES___DEPL", "--density", 250, "--interface", "root=root")
    keys = 'displacement = "MODES___DEPL", density = 250.0, damping_ratio = 0.005, interface = { root = { group = "root" } }'
    direct = loads("direct", f"import = {{ file = {json.dumps(str(tmp_path / 'panel.med'))}, {keys} }}")
    through = loads("through", f"modal_file = {json.dumps(str(tmp_path / 'body.h5'))}")
    assert all(np.array_equal(direct[load], through[load]) for load in direct)


@pytest.mark.parametrize("writer", WRITERS)
def test_rigid_properties_interfaces_and_modes_are_those_of_the_panel(writer, panel, tmp_path):
    name, write, displacement, stress = WRITERS[writer]
    write(tmp_path / name, panel)
    fields = ["--displacement", displacement] + (["--stress", stress] if stress else [])
    report = _import(tmp_path / name, tmp_path / "out.h5", *fields, "--density", 250,
                     "--interface", "root=root", "--interface", "outboard=outboard")
    with h5py.File(tmp_path / "out.h5") as new, h5py.File(MODES / "panel_cantilever.h5") as old:
        assert np.allclose(new["body/inertia"], old["body/inertia"], rtol=0, atol=1e-12 * 10)
        assert np.allclose(new["body/center_of_mass"], old["body/center_of_mass"], rtol=0, atol=1e-13)
        assert np.array_equal(new["modes/frequency"], old["modes/frequency"])
        assert new.attrs["boundary"] == b"cantilever" and len(new["mesh/surface_triangles"]) == len(old["mesh/surface_triangles"])
        assert np.allclose(new["interfaces/outboard/weights"][()].sum(), 1)
        six = [file["interfaces/outboard/displacement"][()] for file in (new, old)]
        momentum = [file["inertia/momentum"][()] for file in (new, old)]
        for one, other in (six, momentum):
            assert np.abs(one - other).max() <= report["departure"] * np.abs(other).max()
        # same nodes first: the order of the panel's own file
        for mode in ("0000", "0007"):
            shapes = [file[f"modes/displacement/{mode}"][()] for file in (new, old)]
            assert np.abs(shapes[0] - shapes[1]).max() <= report["departure"] * np.abs(shapes[1]).max()
            if stress:
                stresses = [file[f"modes/stress/{mode}"][()] for file in (new, old)]
                # stress of a high mode enters a low one in proportion to its stiffness
                assert np.abs(stresses[0] - stresses[1]).max() <= 30 * report["departure"] * np.abs(stresses[1]).max()


@pytest.mark.parametrize("stem", ["boom_cantilever", "panel_craig_bampton", "panel_free_free", "panel_sandwich"])
def test_other_bodies_of_the_project_import_through_their_own_sidecars(stem, tmp_path):
    body = import_samples.of_modal_file(MODES / f"{stem}.h5")
    keys = ['displacement = "displacement"', 'damping_ratio = 0.005', f"node_mass = {body['node_mass'].tolist()}"]
    keys += [f"interface.{group}.nodes = {nodes.tolist()}" for group, nodes in body["node_groups"].items()]
    (tmp_path / "keys.toml").write_text("\n".join(keys))
    done = _pliant("import", MODES / f"{stem}.modes.xdmf", "--keys", tmp_path / "keys.toml", "--out", tmp_path / "body.h5", "--json")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "body.h5") as new, h5py.File(MODES / f"{stem}.h5") as old:
        assert np.allclose(new["body/mass"], old["body/mass"], rtol=1e-12)
        assert np.abs(new["body/inertia"][()] - old["body/inertia"][()]).max() <= 1e-4 * np.abs(old["body/inertia"]).max()
        assert len(new["modes/frequency"]) == len(old["modes/frequency"])


def test_meshio_med_files_need_frequencies_and_take_them(tmp_path):
    body = import_samples.beam()
    import_samples.write_uniform_xdmf(tmp_path / "beam.med.xdmf", body)
    mesh = meshio.read(tmp_path / "beam.med.xdmf")
    mesh.write(tmp_path / "beam.med")
    fields = ["--displacement", "mode_*", "--density", "250", "--interface", "root=box:1,-1,-1,1,1,1"]
    done = _pliant("import", tmp_path / "beam.med", "--out", tmp_path / "beam.h5", "--damping-ratio", "0", *fields)
    assert done.returncode == 2 and "frequency_hz is needed: found the same time in all steps" in done.stderr
    report = _import(tmp_path / "beam.med", tmp_path / "beam.h5", *fields, "--frequencies", "2.5,10")
    assert report["format"] == "MED" and abs(report["mass"] - 10) < 1e-12


@pytest.mark.parametrize("cell_type", ["tetra10", "hexahedron20"])
def test_quadratic_cells_of_meshio_keep_mass_and_inertia_to_rounding(cell_type, tmp_path):
    x, y, z = np.meshgrid(*[np.linspace(0, length, 2 * count + 1) for length, count in ((2.0, 4), (0.2, 1), (0.1, 1))], indexing="ij")
    points, node = np.stack([x, y, z], -1).reshape(-1, 3), np.arange(x.size).reshape(x.shape)
    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    middle = lambda a, b: tuple((np.array(a) + b) // 2)
    cells = []
    for i in range(0, 8, 2):
        at = lambda offset: node[i + offset[0], offset[1], offset[2]]
        if cell_type == "hexahedron20":
            cells.append([at(c) for c in corners] + [at(middle(corners[a], corners[b])) for a, b in edges])
            continue
        for tetra in ([0, 1, 3, 4], [1, 2, 3, 6], [1, 4, 5, 6], [3, 4, 6, 7], [1, 3, 4, 6]):
            c = [corners[k] for k in tetra]
            pairs = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
            cells.append([at(p) for p in c] + [at(middle(c[a], c[b])) for a, b in pairs])
    used = np.unique(cells)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    s = points[used, 0] / 2
    body = {"points": points[used], "cells": number[np.array(cells)], "cell_type": cell_type, "frequency": np.array([3.0]),
            "displacement": np.array([np.stack([0 * s, 0 * s, s ** 2], 1)])}
    exact = 10 * np.diag([0.05 / 12, 4 / 3 + 0.01 / 12, 4 / 3 + 0.04 / 12])
    for write, name, field in ((import_samples.write_xdmf, "b.xdmf", "displacement"), (import_samples.write_med, "b.med", "MODES___DEPL")):
        write(tmp_path / name, body)
        _import(tmp_path / name, tmp_path / "body.h5", "--displacement", field, "--density", 250, "--interface", "root=box:0,0,0,0,1,1")
        with h5py.File(tmp_path / "body.h5") as file:
            assert file["mesh/node_mass"].attrs["kind"] == b"row_sum_signed" and "mesh/node_inertia" not in file
            # about the middle of the root face, which became the origin
            assert np.abs(file["body/inertia"][()] - exact).max() < 1e-11
