"""Writes bodies with modes as other codes would: XDMF by meshio, MED by the MED library (medcoupling), MED by h5py.

A body is a dict: points (N,3), cells (E,k) in VTK order, cell_type (meshio name), frequency (n,), displacement (n,N,3), and as
wanted rotation (n,N,3), stress (n,N,6: xx yy zz xy yz xz), node_mass (N,), node_groups {name: nodes}, cell_groups {name: cells}.
"""
import contextlib
from pathlib import Path

import h5py
import medcoupling as mc
import meshio
import numpy as np

#: (number of nodes, type in the MED library, type in a MED file)
MED_TYPES = {"tetra": (4, mc.NORM_TETRA4, "TE4"), "tetra10": (10, mc.NORM_TETRA10, "T10"), "wedge": (6, mc.NORM_PENTA6, "PE6"),
             "pyramid": (5, mc.NORM_PYRA5, "PY5"), "hexahedron": (8, mc.NORM_HEXA8, "HE8"), "hexahedron20": (20, mc.NORM_HEXA20, "H20"),
             "hexahedron27": (27, mc.NORM_HEXA27, "H27"), "quad": (4, mc.NORM_QUAD4, "QU4"), "quad8": (8, mc.NORM_QUAD8, "QU8")}
DISPLACEMENT, ROTATION = ["DX", "DY", "DZ"], ["DRX", "DRY", "DRZ"]
#: Code_Aster counts stresses in another order than VTK
STRESS = {"SIXX": 0, "SIYY": 1, "SIZZ": 2, "SIXY": 3, "SIXZ": 5, "SIYZ": 4}
#: VTK node of each node of a MED cell of the opposite sense: lower and upper faces change places
_HEXA = [4, 5, 6, 7, 0, 1, 2, 3]
_OTHER_SENSE = {
    "hexahedron": _HEXA,
    "hexahedron20": _HEXA + [12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19],
    # the MED library counts faces lower, four sides, upper; VTK -x +x -y +y -z +z
    "hexahedron27": _HEXA + [12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19] + [25, 22, 21, 23, 20, 24, 26],
    "tetra": [0, 2, 1, 3], "tetra10": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8], "wedge": [3, 4, 5, 0, 1, 2], "pyramid": [0, 3, 2, 1, 4],
    "quad": [0, 1, 2, 3], "quad8": [0, 1, 2, 3, 4, 5, 6, 7],
}


def of_modal_file(path):
    """The body of a modal file, with its interfaces as groups of nodes."""
    with h5py.File(path) as file:
        body = {"points": file["mesh/points"][()], "cells": file["mesh/cells"][()],
                "cell_type": file["mesh/cells"].attrs["cell_type"].decode(), "frequency": file["modes/frequency"][()],
                "node_mass": file["mesh/node_mass"][()],
                "node_groups": {name: item["nodes"][()] for name, item in file["interfaces"].items()}}
        for key in ("displacement", "rotation", "stress"):
            if f"modes/{key}" in file:
                body[key] = np.array([file[f"modes/{key}/{mode}"][()] for mode in sorted(file[f"modes/{key}"])], float)
        return body


def _steps(body):
    """(frequency, point data) of every mode."""
    for mode, frequency in enumerate(body["frequency"]):
        data = {key: body[key][mode] for key in ("displacement", "rotation", "stress") if key in body}
        # meshio writes no groups of nodes to XDMF: a field of zeros and ones names them
        marks = {name: np.isin(np.arange(len(body["points"])), nodes).astype(float) for name, nodes in body.get("node_groups", {}).items()}
        masses = {"node_mass": body["node_mass"]} if "node_mass" in body else {}
        yield frequency, data | (marks | masses if mode == 0 else {})


def write_xdmf(path, body, data_format="HDF"):
    """A temporal collection by meshio, one step per mode with the frequency as its time."""
    # meshio puts the HDF5 file of a series into the current folder
    with contextlib.chdir(Path(path).parent), meshio.xdmf.TimeSeriesWriter(Path(path).name, data_format=data_format) as writer:
        writer.write_points_cells(body["points"], [(body["cell_type"], body["cells"])])
        for frequency, data in _steps(body):
            writer.write_data(frequency, point_data=data)


def write_uniform_xdmf(path, body, data_format="HDF"):
    """One grid by meshio, modes as attributes mode_0, mode_1, ..."""
    data = {f"mode_{mode}": shape for mode, shape in enumerate(body["displacement"])}
    if "node_mass" in body:
        data["node_mass"] = body["node_mass"]
    cells = body["blocks"] if "blocks" in body else [(body["cell_type"], body["cells"])]
    meshio.Mesh(body["points"], cells, point_data=data).write(path, data_format=data_format)


def write_med(path, body, times=None, order=None):
    """A file of the MED library: groups, nodal fields with named components, steps numbered from 1 and written in any order."""
    count, kind, _ = MED_TYPES[body["cell_type"]]
    mesh = mc.MEDCouplingUMesh("body", 2 if body["cell_type"].startswith("quad") else 3)
    mesh.setCoords(mc.DataArrayDouble(np.ascontiguousarray(body["points"], float)))
    mesh.allocateCells(len(body["cells"]))
    for cell in body["cells"][:, _OTHER_SENSE[body["cell_type"]]]:
        mesh.insertNextCell(kind, count, [int(node) for node in cell])
    mesh.finishInsertingCells()
    file = mc.MEDFileUMesh()
    file.setMeshAtLevel(0, mesh)
    for level, groups in ((1, body.get("node_groups", {})), (0, body.get("cell_groups", {}))):
        arrays = []
        for name, members in groups.items():
            arrays.append(mc.DataArrayInt(sorted(int(i) for i in members)))
            arrays[-1].setName(name)
        if arrays:
            file.setGroupsAtLevel(level, arrays)
    file.write(str(path), 2)
    times = body["frequency"] if times is None else times

    def field(name, components, values, time, number):
        field = mc.MEDCouplingFieldDouble(mc.ON_NODES, mc.ONE_TIME)
        field.setName(name)
        field.setMesh(mesh)
        array = mc.DataArrayDouble(np.ascontiguousarray(values, float).reshape(len(body["points"]), -1))
        array.setInfoOnComponents(components)
        field.setArray(array)
        field.setTime(float(time), number, 0)
        mc.WriteFieldUsingAlreadyWrittenMesh(str(path), field)

    for mode in range(len(times)) if order is None else order:
        values, components = body["displacement"][mode], DISPLACEMENT
        if "rotation" in body:
            values, components = np.column_stack([values, body["rotation"][mode]]), DISPLACEMENT + ROTATION
        field("MODES___DEPL", components, values, times[mode], mode + 1)
        if "stress" in body:
            field("MODES___SIGM_NOEU", list(STRESS), body["stress"][mode][:, list(STRESS.values())], times[mode], mode + 1)
    if "node_mass" in body:
        field("MASS", ["M"], body["node_mass"], 0.0, -1)


def write_med_h5py(path, body, integers="i4", sense="VTK"):
    """The layout of MED 4 by hand: i4 or i8, steps that h5py lists in another order, a family without groups."""
    cell_type = body["cell_type"]
    cells = body["cells"] if sense == "VTK" else body["cells"][:, _OTHER_SENSE[cell_type]]
    nodes = len(body["points"])
    text = lambda names: np.bytes_("".join(f"{name:16s}" for name in names))
    with h5py.File(path, "w") as file:
        info = file.create_group("INFOS_GENERALES")
        for key, value in (("MAJ", 4), ("MIN", 1), ("REL", 0)):
            info.attrs[key] = np.dtype(integers).type(value)
        mesh = file.create_group("ENS_MAA/body")
        mesh.attrs.update({"DIM": np.int32(3), "ESP": np.int32(3), "NOM": text("XYZ")})
        state = mesh.create_group("-0000000000000000001-0000000000000000001")
        coordinates = state.create_dataset("NOE/COO", data=np.asarray(body["points"], float).T.ravel())
        coordinates.attrs["NBR"] = np.int32(nodes)
        connectivity = state.create_dataset(f"MAI/{MED_TYPES[cell_type][2]}/NOD", data=(cells.T.ravel() + 1).astype(integers))
        connectivity.attrs["NBR"] = np.int32(len(cells))
        families = np.zeros(nodes, integers)
        file.create_group("FAS/body/FAMILLE_ZERO").attrs["NUM"] = np.int32(0)
        file.create_group("FAS/body/NOEUD/empty").attrs["NUM"] = np.int32(99)
        for number, (name, members) in enumerate(body.get("node_groups", {}).items(), 1):
            families[members] = number
            family = file.create_group(f"FAS/body/NOEUD/FAM_{number}")
            family.attrs["NUM"] = np.int32(number)
            names = family.create_group("GRO").create_dataset("NOM", (1,), dtype=np.dtype(("i1", (80,))))
            names[0] = np.frombuffer(name.encode().ljust(80, b"\0"), "i1")
        state.create_dataset("NOE/FAM", data=families)
        field = file.create_group("CHA/MODES___DEPL")
        field.attrs.update({"NCO": np.int32(3), "NOM": text(DISPLACEMENT), "MAI": np.bytes_("body")})
        for mode in reversed(range(len(body["frequency"]))):
            step = field.create_group(f"{mode + 1:020d}{0:020d}")
            step.attrs.update({"NDT": np.int32(mode + 1), "NOR": np.int32(0), "PDT": float(body["frequency"][mode])})
            whole = step.create_group("NOE/MED_NO_PROFILE_INTERNAL")
            whole.attrs.update({"NBR": np.int32(nodes), "NGA": np.int32(1)})
            whole.create_dataset("CO", data=np.asarray(body["displacement"][mode], float).T.ravel())


def beam(cell_type="hexahedron", modes=2):
    """A beam of 4 x 1 x 1 blocks of 0.5 x 0.2 x 0.1 m along x, root at x = 1, with smooth shapes at rest at the root."""
    x, y, z = np.meshgrid(np.arange(5), np.arange(2), np.arange(2), indexing="ij")
    points = np.stack([1 + 0.5 * x, 0.2 * y - 0.1, 0.1 * z - 0.05], -1).reshape(-1, 3)
    node = np.arange(len(points)).reshape(x.shape)
    corner = lambda i, j, k: node[i:i + 4, j, k].ravel()
    cells = np.stack([corner(0, 0, 0), corner(1, 0, 0), corner(1, 1, 0), corner(0, 1, 0),
                      corner(0, 0, 1), corner(1, 0, 1), corner(1, 1, 1), corner(0, 1, 1)], 1)
    if cell_type == "tetra":
        cells = np.concatenate([cells[:, t] for t in ([0, 1, 3, 4], [1, 2, 3, 6], [1, 4, 5, 6], [3, 4, 6, 7], [1, 3, 4, 6])])
    s = (points[:, 0] - 1) / 2
    shapes = []
    for mode in range(modes):
        bend, slope = s ** (mode + 2), (mode + 2) * s ** (mode + 1)
        shapes.append(np.stack([-points[:, 2] * slope / 2, np.zeros(len(points)), bend], 1))
    stress = [np.outer(1 + s, np.arange(1, 7)) * 1e5 * (mode + 1) for mode in range(modes)]
    return {"points": points, "cells": cells, "cell_type": cell_type, "frequency": 2.5 * np.arange(1, modes + 1) ** 2,
            "displacement": np.array(shapes), "stress": np.array(stress),
            "node_groups": {"ROOT": np.flatnonzero(s == 0), "TIP": np.flatnonzero(s == 1)},
            "cell_groups": {"INNER": np.arange(len(cells))[: len(cells) // 2], "OUTER": np.arange(len(cells))[len(cells) // 2:]}}


def plate():
    """A shell of 4 x 2 quadrilaterals of 0.5 x 0.5 m in the plane z = 0, root edge at x = 0, with nodal rotations."""
    x, y = np.meshgrid(0.5 * np.arange(5), 0.5 * np.arange(3) - 0.5, indexing="ij")
    points = np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3)
    node = np.arange(15).reshape(5, 3)
    cells = np.stack([node[:-1, :-1].ravel(), node[1:, :-1].ravel(), node[1:, 1:].ravel(), node[:-1, 1:].ravel()], 1)
    s, t = points[:, 0] / 2, points[:, 1]
    zero = np.zeros(15)
    bend = np.stack([zero, zero, s ** 2], 1), np.stack([zero, -s, zero], 1)          # w' = s, rotation about y is -w'
    twist = np.stack([zero, zero, s ** 2 * t], 1), np.stack([s ** 2, -s * t, zero], 1)
    return {"points": points, "cells": cells, "cell_type": "quad", "frequency": np.array([1.5, 4.25]),
            "displacement": np.array([bend[0], twist[0]]), "rotation": np.array([bend[1], twist[1]]),
            "node_groups": {"ROOT": np.flatnonzero(s == 0), "TIP": np.flatnonzero(s == 1)}}


def mixed():
    """One hexahedron, two wedges, a pyramid and a tetrahedron along x, two modes at rest at x = 0."""
    points = np.array([[i, j, k] for i in range(3) for j in range(2) for k in range(2)] + [[3, 0.5, 0.5], [3, 1.5, 0.5]], float)
    blocks = [("hexahedron", np.array([[0, 4, 6, 2, 1, 5, 7, 3]])), ("wedge", np.array([[4, 8, 10, 5, 9, 11], [4, 10, 6, 5, 11, 7]])),
              ("pyramid", np.array([[8, 10, 11, 9, 12]])), ("tetra", np.array([[10, 13, 11, 12]]))]
    s = points[:, 0] / 3
    shapes = np.array([np.stack([0 * s, 0 * s, s ** 2], 1), np.stack([0 * s, s ** 2, 0 * s], 1)])
    return {"points": points, "blocks": blocks, "displacement": shapes, "frequency": np.array([3.0, 5.0])}


def write_committed(folder):
    """The samples of tests/data/import."""
    folder = Path(folder)
    write_xdmf(folder / "beam.xdmf", beam())
    write_xdmf(folder / "beam_inline.xdmf", beam("tetra"), "XML")
    write_uniform_xdmf(folder / "mixed.xdmf", mixed(), "XML")
    write_med(folder / "beam.med", beam(modes=3), order=[2, 0, 1])
    write_med_h5py(folder / "beam_h5py.med", beam())
    write_med(folder / "plate.med", plate())


if __name__ == "__main__":
    import sys
    write_committed(sys.argv[1])
