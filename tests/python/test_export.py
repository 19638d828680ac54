"""pliant export: meshio and VTK read the XDMF, pyarrow the Parquet, with the numbers of the results file and of the modal file."""
import csv
import subprocess
from pathlib import Path

import h5py
import meshio
import numpy as np
import pyarrow.parquet
import pytest
import vtk
from vtk.util.numpy_support import vtk_to_numpy

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target" / "release" / "pliant"
SINGLE = float(np.finfo(np.float32).eps)


def run_of(scene, folder, duration):
    """Runs a scene and exports it; the results file and the folder of the XDMF files."""
    assert PROGRAM.exists(), "build the program first: cargo build --release"
    path = folder / "run.h5"
    for arguments in (["run", ROOT / "examples" / scene / "scene.toml", "--duration", str(duration), "--out", path],
                      ["export", path, "--format", "xdmf"]):
        done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    return path, folder / "run_xdmf"


@pytest.fixture(scope="module")
def panels(tmp_path_factory):
    """The default example: two panels with stress at nodes."""
    return run_of("02_hub_two_panels", tmp_path_factory.mktemp("panels"), 3)


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """A loop with a closure."""
    return run_of("06_four_bar", tmp_path_factory.mktemp("loop"), 0.5)


def rotation(q):
    """Matrices (k,3,3) of quaternions (k,4) w x y z."""
    w, x, y, z = np.asarray(q).T
    return np.stack([np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
                     np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
                     np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1)], -2)


@pytest.fixture(scope="module")
def expected(panels):
    """Positions, displacements and von Mises stress of a panel at every output time, from the results file and the modal file alone."""
    with h5py.File(panels[0]) as run, h5py.File(ROOT / "modes" / "panel_cantilever.h5") as modal:
        surface = modal["mesh/points"].attrs["surface_nodes"]
        shapes = np.array([item[:surface] for _, item in sorted(modal["modes/displacement"].items())], float)
        stress = np.array([item[:surface] for _, item in sorted(modal["modes/stress"].items())], float)
        body = run["bodies/panel_left"]
        eta, points = body["modal_position"][()], modal["mesh/points"][:surface]
        modes = [int(name.removeprefix("mode ")) - 1 for name in body["modal_position"].attrs["components"].decode().split(", ")]
        moved = np.einsum("tj,jna->tna", eta, shapes[modes])
        world = body["position"][()][:, None] + np.einsum("tab,tnb->tna", rotation(body["quaternion"][()]), points + moved)
        xx, yy, zz, xy, yz, xz = np.moveaxis(np.einsum("tj,jns->tns", eta, stress[modes]), -1, 0)
        mises = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (xy ** 2 + yz ** 2 + xz ** 2))
        return {"time": run["time"][()], "world": world, "moved": moved, "mises": mises, "peak": body["von_mises_peak"][()],
                "triangles": modal["mesh/surface_triangles"][()]}


def test_meshio_reads_a_body_over_time_with_the_numbers_of_the_results_file(panels, expected):
    with meshio.xdmf.TimeSeriesReader(panels[1] / "panel_left.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert cells[0].type == "triangle" and np.array_equal(cells[0].data, expected["triangles"])
        assert reader.num_steps == len(expected["time"]) == 91
        size, largest = np.abs(expected["world"]).max(), np.abs(expected["moved"]).max()
        assert np.allclose(points, expected["world"][0], atol=1e-14 * size)
        for step in range(reader.num_steps):
            time, fields, _ = reader.read_data(step)
            assert time == expected["time"][step]
            assert np.allclose(fields["position_world"], expected["world"][step], rtol=0, atol=1e-13 * size)
            assert np.allclose(fields["displacement_body"], expected["moved"][step], rtol=0, atol=SINGLE * largest)
            assert np.allclose(fields["von_mises"], expected["mises"][step], rtol=0, atol=4 * SINGLE * expected["mises"].max())
            # the results file has the largest of them
            assert fields["von_mises"].max() == pytest.approx(expected["peak"][step], rel=2 * SINGLE)


def steps_of(path):
    """(time, grid) of every step, by VTK."""
    reader = vtk.vtkXdmfReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for time in reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()):
        reader.UpdateTimeStep(time)
        yield time, reader.GetOutputDataObject(0)


def test_vtk_moves_the_body_as_the_results_file_says(panels, expected):
    count = 0
    for step, (time, grid) in enumerate(steps_of(panels[1] / "panel_left.xdmf")):
        assert time == expected["time"][step] and grid.GetNumberOfCells() == len(expected["triangles"])
        points, data = vtk_to_numpy(grid.GetPoints().GetData()), grid.GetPointData()
        size = np.abs(expected["world"]).max()
        # VTK keeps coordinates in single precision or double, by its reader
        assert np.allclose(points, expected["world"][step], rtol=0, atol=2 * SINGLE * size)
        assert np.allclose(vtk_to_numpy(data.GetArray("position_world")), expected["world"][step], rtol=0, atol=1e-13 * size)
        assert np.allclose(vtk_to_numpy(data.GetArray("von_mises")), expected["mises"][step], rtol=0, atol=4 * SINGLE * expected["mises"].max())
        count += 1
    assert count == len(expected["time"])


@pytest.mark.parametrize("which", ["panels", "loop"])
def test_loads_are_vectors_at_their_points_in_both_readers(which, request):
    run, folder = request.getfixturevalue(which)
    text = (folder / "loads.xdmf").read_text()
    names = text.split('Name="index" Value="')[1].split('"')[0].split("; ")
    with h5py.File(run) as file:
        groups = [file[f"{kind}/{name}"] for name in names for kind in ("hinges", "closures") if f"{kind}/{name}" in file]
        assert len(groups) == len(names)
        turn = [rotation(group["load_quaternion"][()]) for group in groups]
        expected = {"position": [group["load_point"][()] for group in groups]}
        for part in ("moment", "force"):
            expected[f"{part}_world"] = [np.einsum("tab,tb->ta", r, group[f"load_{part}"][()]) for r, group in zip(turn, groups)]
        expected = {key: np.array(value).transpose(1, 0, 2) for key, value in expected.items()}
        time = file["time"][()]
    close = lambda found, key, step: np.allclose(found, expected[key][step], rtol=0, atol=1e-13 * max(np.abs(expected[key]).max(), 1))
    with meshio.xdmf.TimeSeriesReader(folder / "loads.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert cells[0].type == "vertex" and close(points, "position", 0) and reader.num_steps == len(time)
        for step in range(reader.num_steps):
            found, fields, _ = reader.read_data(step)
            assert found == time[step] and np.array_equal(fields["index"], np.arange(len(names)))
            assert all(close(fields[key], key, step) for key in ("moment_world", "force_world"))
    for step, (found, grid) in enumerate(steps_of(folder / "loads.xdmf")):
        assert found == time[step] and grid.GetNumberOfPoints() == len(names)
        assert all(close(vtk_to_numpy(grid.GetPointData().GetArray(key)), key, step) for key in ("moment_world", "force_world"))
        assert np.allclose(vtk_to_numpy(grid.GetPoints().GetData()), expected["position"][step], rtol=0, atol=2 * SINGLE * np.abs(expected["position"]).max())


def test_a_load_moves_with_its_body(panels):
    """The drive's O sits on the hub at 0.5 m, so that its point follows from the hub's pose alone."""
    with h5py.File(panels[0]) as file:
        hub = file["bodies/hub"]
        point = hub["position"][()] + rotation(hub["quaternion"][()]) @ [0.0, 0.5, 0.0]
        assert np.allclose(file["hinges/drive_left/load_point"][()], point, rtol=0, atol=1e-14)
        attributes = {key: value.decode() for key, value in file["hinges/drive_left/load_point"].attrs.items()}
    assert attributes["unit"] == "m" and attributes["frame"] == "world" and attributes["point"] == "O"


def test_stress_in_cells_is_drawn_at_nodes_by_the_largest_around(tmp_path):
    """As the viewer does it: a node shows the largest of the triangles that meet in it."""
    scene = tmp_path / "scene.toml"
    scene.write_text('[[body]]\nname = "panel"\nmodal_file = "%s"\n[[hinge]]\nname = "root"\nkind = "fixed"\nparent = "world"\nchild = "panel"\n'
                     '[[load]]\nbody = "panel"\nnode = "outboard"\nforce = { constant = [0.0, 0.0, 1.0] }\n'
                     '[simulation]\nduration = 0.2\n[output]\nstress = ["panel"]\n' % (ROOT / "modes" / "panel_sandwich.h5"))
    run = tmp_path / "run.h5"
    for arguments in (["run", scene, "--out", run], ["export", run, "--format", "xdmf"]):
        done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    with h5py.File(run) as file, meshio.xdmf.TimeSeriesReader(tmp_path / "run_xdmf" / "panel.xdmf") as reader:
        reader.read_points_cells()
        peak = file["bodies/panel/von_mises_peak"][()]
        assert peak.max() > 0
        for step in range(reader.num_steps):
            assert reader.read_data(step)[1]["von_mises"].max() == pytest.approx(peak[step], rel=2 * SINGLE)


@pytest.mark.parametrize("every", [1, 7])
def test_tables_hold_every_number_of_the_results_file(every, panels, tmp_path):
    for extension in ("csv", "parquet"):
        done = subprocess.run([PROGRAM, "export", panels[0], "--format", extension, "--every", str(every), "--out", tmp_path / f"table.{extension}"],
                              capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    with open(tmp_path / "table.csv", newline="") as stream:
        rows = list(csv.reader(stream))
    table = pyarrow.parquet.read_table(tmp_path / "table.parquet")
    assert table.column_names == rows[0] and table.schema.metadata[b"scene_name"] == b"hub with two panels"
    text = np.array(rows[1:], float)
    columns = np.array([column.to_numpy() for column in table.columns]).T
    assert np.array_equal(text, columns)
    with h5py.File(panels[0]) as file:
        moment = file["hinges/drive_left/load_moment"][()][::every]
        width = 0

        def count(path, item):
            nonlocal width
            if isinstance(item, h5py.Dataset) and not path.startswith("scene/"):
                width += item.shape[1] if item.ndim == 2 else 1
        file.visititems(count)
        assert columns.shape == (len(moment), width)
        assert np.array_equal(columns[:, 0], file["time"][()][::every])
    for axis, name in enumerate("xyz"):
        assert np.array_equal(columns[:, rows[0].index(f"hinges/drive_left/load_moment/{name} (N m)")], moment[:, axis])


@pytest.mark.parametrize("body", ["panel_cantilever", "panel_sandwich", "boom_craig_bampton"])
def test_modes_exported_by_the_program_open_in_both_readers(body, modes_folder, stored, tmp_path):
    path, file = tmp_path / f"{body}.h5", stored(body)
    path.write_bytes((modes_folder / path.name).read_bytes())
    done = subprocess.run([PROGRAM, "modes", path, "--export", "xdmf"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    mesh = meshio.read(path.with_suffix(".xdmf"))
    assert np.array_equal(mesh.points, file["mesh/points"]) and np.array_equal(mesh.cells[0].data, file["mesh/cells"])
    fields = {**mesh.point_data, **{key: blocks[0] for key, blocks in mesh.cell_data.items()}}
    with meshio.xdmf.TimeSeriesReader(path.with_suffix(".modes.xdmf")) as reader:
        reader.read_points_cells()
        for mode, frequency in enumerate(file["modes/frequency"]):
            time, shapes, cells = reader.read_data(mode)
            # written with as many digits as read back to the same number
            assert time == frequency
            shape, stress = file[f"modes/displacement/{mode:04d}"], file[f"modes/stress/{mode:04d}"]
            assert np.array_equal(shapes["displacement"], shape) and np.array_equal(fields[f"mode_{mode:04d}"], shape)
            assert np.array_equal(shapes["stress"] if "stress" in shapes else cells["stress"][0], stress)
            assert np.array_equal(fields[f"stress_{mode:04d}"], stress)
    for mode, (time, grid) in enumerate(steps_of(path.with_suffix(".modes.xdmf"))):
        assert time == file["modes/frequency"][mode] and grid.GetNumberOfCells() == len(file["mesh/cells"])
        assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray("displacement")), file[f"modes/displacement/{mode:04d}"])
