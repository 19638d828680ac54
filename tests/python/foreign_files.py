"""The panel of the default example in the layouts of other codes: BDF and OP2, .fem, Exudyn's FEM file, a mesh."""
import functools
import subprocess
from pathlib import Path

import h5py
import meshio
import numpy as np
import scipy.sparse
from convert import nastran

ROOT = Path(__file__).resolve().parents[2]
# The reference point of the panel in the foreign files: converters find it from the root's nodes.
OFFSET = np.array([3.0, -1.0, 0.5])


@functools.cache
def panel_arrays():
    """Arrays of the committed panel, its nodes moved to another origin."""
    with h5py.File(ROOT / "modes" / "panel_cantilever.h5") as file:
        shapes = np.array([item[()] for _, item in sorted(file["modes/displacement"].items())], float)
        stress = np.array([item[()] for _, item in sorted(file["modes/stress"].items())], float)
        return {"points": file["mesh/points"][()] + OFFSET, "cells": file["mesh/cells"][()], "mass": file["mesh/node_mass"][()],
                "frequency": file["modes/frequency"][()], "shapes": shapes, "stress": stress, "root": file["interfaces/root/nodes"][()],
                "outboard": file["interfaces/outboard/nodes"][()], "six": file["interfaces/outboard/displacement"][()],
                "total": float(file["body/mass"][()]), "inertia": file["body/inertia"][()], "center": file["body/center_of_mass"][()]}


def nastran_files(panel, folder, corners_only=False, **extra):
    """BDF and OP2 of the panel; node numbers start at 101 and are in no order of place."""
    labels = 101 + np.random.default_rng(1).permutation(len(panel["points"]))
    order = [*range(12), *range(16, 20), *range(12, 16)]
    kept = np.arange(len(labels))
    cells = panel["cells"][:, :20][:, order]
    arrays = {"density": 0.0, "node_mass": panel["mass"]}
    if corners_only:
        cells = panel["cells"][:, :8]
        kept = np.unique(cells)
        arrays = {"density": panel["total"] / (2.0 * 1.0 * 0.02)}
    kept = kept[np.argsort(labels[kept])]
    shapes = np.concatenate([panel["shapes"], np.zeros_like(panel["shapes"])], axis=2)
    arrays |= {"labels": labels[kept], "points": panel["points"][kept], "cells": labels[cells], "frequency": panel["frequency"],
               "shapes": shapes[:, kept], "root": labels[np.intersect1d(panel["root"], kept)]}
    if "node_mass" in arrays:
        arrays["node_mass"] = panel["mass"][kept]
    arrays |= {name: value for name, value in extra.items() if value is not None}
    source, model, modes = folder / "arrays.npz", folder / "panel.bdf", folder / "panel.op2"
    np.savez(source, **arrays)
    assert nastran.python().is_file(), "run scripts/setup.sh: it makes the environment of pyNastran"
    done = subprocess.run([nastran.python(), Path(__file__).with_name("write_nastran.py"), source, model, modes], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return model, modes, labels


def mbdyn_file(panel, path, **change):
    """A .fem of the panel; `change` replaces or removes (None) record groups by their number as r11=..."""
    count, nodes = len(panel["frequency"]), len(panel["points"])
    lines = lambda values: "\n".join(" ".join(f"{x:.17e}" for x in row) for row in np.atleast_2d(values))
    shapes = np.concatenate([panel["shapes"], np.zeros_like(panel["shapes"])], axis=2)
    center = panel["center"] + OFFSET
    central = panel["inertia"] - panel["total"] * (panel["center"] @ panel["center"] * np.eye(3) - np.outer(panel["center"], panel["center"]))
    groups = {
        1: f"** REVISION, NODE, NORMAL, ATTACHMENT, CONSTRAINT, REJECTED MODES.\nREV0 {nodes} {count} 0 0 0", 2: " ".join(map(str, range(1, nodes + 1))),
        3: lines(np.zeros(count)), 4: lines(np.zeros(count)), 5: lines(panel["points"][:, 0]), 6: lines(panel["points"][:, 1]), 7: lines(panel["points"][:, 2]),
        8: "\n".join(f"** NORMAL MODE SHAPE # {mode + 1}\n{lines(shape)}" for mode, shape in enumerate(shapes)), 9: lines(np.eye(count)),
        10: lines(np.diag((2 * np.pi * panel["frequency"]) ** 2)), 11: lines(np.hstack([np.repeat(panel["mass"][:, None], 3, 1), np.zeros((nodes, 3))])),
        12: lines(panel["total"]) + "\n" + lines(center) + "\n" + lines(central)}
    for name, value in change.items():
        groups[int(name[1:])] = value
    path.write_text("".join(f"** RECORD GROUP {number}, OF A TEST\n{text}\n**\n" for number, text in sorted(groups.items()) if text is not None))
    return path


def vtu(panel, path):
    """The panel's mesh for meshio, which knows no hex27 in all formats."""
    meshio.write(path, meshio.Mesh(panel["points"], [("hexahedron20", panel["cells"][:, :20])]))
    return path


def fem_dictionary(data):
    """The dictionary of an Exudyn FEM file: mass and stiffness of the panel's solid, its modes, its sets of nodes, its stress."""
    solid, count = data.solid, len(data.frequency)
    stress = data.stress[:, :, [0, 1, 2, 4, 5, 3]].transpose(1, 0, 2).reshape(solid.node_count, 6 * count)
    return {"metaData": {"source": "test"}, "nodes": {"Position": solid.points + OFFSET}, "elements": [{"Name": "all", "Hex20": solid.cells[:, :20]}],
            "massMatrix": scipy.sparse.csr_matrix(solid.mass_matrix), "stiffnessMatrix": scipy.sparse.csr_matrix(solid.stiffness_matrix), "surface": [],
            "nodeSets": [{"Name": name, "NodeNumbers": item[0].nodes, "NodeWeights": item[0].weights} for name, item in data.interfaces.items()],
            "elementSets": [], "modeBasis": {"matrix": 2.0 * data.displacement.transpose(1, 2, 0).reshape(-1, count), "type": "NormalModes"},
            "eigenValues": (2 * np.pi * data.frequency) ** 2, "postProcessingModes": {"matrix": 2.0 * stress, "outputVariableType": "OutputVariableType.StressLocal"},
            "fileVersion": 4, "type": "FEMinterface"}


def save_hdf5(path, data):
    """As Exudyn's SaveDictToHDF5 lays a dictionary out."""
    def put(group, key, value):
        if isinstance(value, (dict, list)):
            below = group.create_group(key)
            below.attrs["datatype"] = type(value).__name__
            for name, item in value.items() if isinstance(value, dict) else ((f"item_{i}", item) for i, item in enumerate(value)):
                put(below, name, item)
        elif scipy.sparse.issparse(value):
            below = group.create_group(key)
            below.attrs["datatype"] = "csr_matrix"
            for name in ("data", "indices", "indptr", "shape"):
                below.create_dataset(name, data=getattr(value, name))
        else:
            group.create_dataset(key, data=value).attrs["datatype"] = type(value).__name__
    with h5py.File(path, "w") as file:
        for key, value in data.items():
            put(file, key, value)
    return path


def save_npz(path, data):
    """As Exudyn's numpy.savez lays a dictionary out: objects are pickled."""
    np.savez(path, **{key: value if isinstance(value, np.ndarray) else np.array(value, dtype=object) if scipy.sparse.issparse(value) else value for key, value in data.items()})
    return path
