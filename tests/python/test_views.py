"""Other programs read the files: meshio through the sidecars, VTK through the sidecars and the VTKHDF view."""
import meshio
import numpy as np
import pytest


def test_meshio_reads_points_cells_modes_and_stress_of_the_uniform_sidecar(name, stored, modes_folder):
    mesh, file = meshio.read(modes_folder / f"{name}.xdmf"), stored(name)
    assert np.array_equal(mesh.points, file["mesh/points"])
    assert np.array_equal(mesh.cells[0].data, file["mesh/cells"])
    fields = {**mesh.point_data, **{key: blocks[0] for key, blocks in mesh.cell_data.items()}}
    for mode in range(len(file["modes/frequency"])):
        assert np.array_equal(fields[f"mode_{mode:04d}"], file[f"modes/displacement/{mode:04d}"])
        assert np.array_equal(fields[f"stress_{mode:04d}"], file[f"modes/stress/{mode:04d}"])


def test_meshio_steps_through_the_modes_by_frequency(name, stored, modes_folder):
    file = stored(name)
    with meshio.xdmf.TimeSeriesReader(modes_folder / f"{name}.modes.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert np.array_equal(points, file["mesh/points"])
        assert np.array_equal(cells[0].data, file["mesh/cells"])
        assert reader.num_steps == len(file["modes/frequency"])
        for mode, frequency in enumerate(file["modes/frequency"]):
            time, point_data, _ = reader.read_data(mode)
            # The sidecar prints nine digits.
            assert time == pytest.approx(frequency, rel=1e-8)
            assert np.array_equal(point_data["displacement"], file[f"modes/displacement/{mode:04d}"])


def _grid_volume(vtk, grid):
    sizes = vtk.vtkCellSizeFilter()
    sizes.SetInputData(grid)
    sizes.Update()
    return sum(sizes.GetOutput().GetCellData().GetArray("Volume").GetValue(cell) for cell in range(grid.GetNumberOfCells()))


@pytest.mark.parametrize("reader_name", ["vtkXdmfReader", "vtkHDFReader"])
def test_vtk_opens_the_file_and_finds_its_volume(name, reader_name, stored, bodies, modes_folder):
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import vtk_to_numpy
    reader = getattr(vtk, reader_name)()
    reader.SetFileName(str(modes_folder / (f"{name}.xdmf" if reader_name == "vtkXdmfReader" else f"{name}.h5")))
    reader.Update()
    grid, body = reader.GetOutputDataObject(0), bodies[name]
    assert grid.GetNumberOfCells() == np.prod(body.mesh)
    # A wrong order of nodes or a mirrored cell changes the volume by far more than rounding.
    assert _grid_volume(vtk, grid) == pytest.approx(body.length * body.width * body.thickness, rel=1e-9)
    assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray("mode_0001")), stored(name)["modes/displacement/0001"])


def test_vtk_steps_through_the_modes_by_frequency(name, stored, modes_folder):
    vtk = pytest.importorskip("vtk")
    reader = vtk.vtkXdmfReader()
    reader.SetFileName(str(modes_folder / f"{name}.modes.xdmf"))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert times == pytest.approx(stored(name)["modes/frequency"], rel=1e-8)
