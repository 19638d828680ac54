"""Any mesh that meshio reads, with its modes in a `.npz` of plain arrays; and meshes that give cells to files without elements.

Arrays of the .npz: frequency (n,) in Hz, displacement (n,N,3); optional rotation (n,N,3), node_mass (N,), node_inertia (N,6), stress (n,N,6),
damping_ratio (n,), labels (N,). Without node_mass, --density lumps linear and quadratic solids on their corners.
"""
import contextlib
import io
from pathlib import Path

import meshio
import numpy as np

from .errors import InputError
from .foreign import Foreign
from .surface import LINES, SHELLS, SOLIDS

_ARRAYS = ("frequency", "displacement", "rotation", "node_mass", "node_inertia", "stress", "damping_ratio", "labels")


def read(mesh_file, modes_file, density=None):
    """Foreign of a mesh and its modes."""
    mesh = _mesh(mesh_file)
    arrays = _modes(Path(modes_file))
    points = np.zeros((len(mesh.points), 3))
    points[:, :mesh.points.shape[1]] = mesh.points
    cells = _cells(mesh, mesh_file)
    sets = {name: (np.asarray(nodes, int), None) for name, nodes in (mesh.point_sets or {}).items() if len(nodes)}
    mass, notes = arrays.get("node_mass"), []
    if mass is None and density is not None:
        mass = _lumped_by_volume(points, cells, density, mesh_file)
        notes.append("mass of cells in equal parts on their corners")
    return Foreign(
        file=Path(modes_file), code=f"{Path(mesh_file).name} by meshio", labels=arrays.get("labels", np.arange(1, len(points) + 1)), points=points,
        cells=cells, displacement=arrays["displacement"], rotation=arrays.get("rotation"), frequency=arrays["frequency"],
        damping_ratio=arrays.get("damping_ratio"), node_mass=mass, node_inertia=arrays.get("node_inertia"), stress=arrays.get("stress"),
        sets=sets, scaled=False, notes=notes)


def cells_on(mesh_file, points, file):
    """Cells of a mesh whose nodes are those at `points`, found by place."""
    mesh = _mesh(mesh_file)
    own = np.zeros((len(mesh.points), 3))
    own[:, :mesh.points.shape[1]] = mesh.points
    from scipy.spatial import cKDTree
    distance, index = cKDTree(points).query(own)
    limit = 1e-6 * np.ptp(points, axis=0).max()
    if distance.max() > limit:
        worst = int(distance.argmax())
        raise InputError(mesh_file, f"node {worst} at {own[worst].tolist()}", f"no node of {file} within {limit:.2g}", "the nodes of the modes",
                         "give the mesh that the modes were computed on, in the same units and axes")
    return [(kind, index[block]) for kind, block in _cells(mesh, mesh_file)]


def _mesh(file):
    if not Path(file).is_file():
        raise InputError(file, "file", "nothing", "a mesh", "check the path")
    try:
        # meshio prints, and leaves by SystemExit, where it cannot read
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return meshio.read(file)
    except (Exception, SystemExit) as error:
        words = str(error).strip().splitlines()
        raise InputError(file, "mesh", f"a file that meshio cannot read ({words[0] if words else type(error).__name__})", "one of its formats",
                         "write it as .vtu, .msh, .inp or .xdmf") from error


def _modes(file):
    try:
        with np.load(file, allow_pickle=False) as content:
            unknown = sorted(set(content.files) - set(_ARRAYS))
            if unknown:
                raise InputError(file, unknown[0], "an unknown array", f"some of: {', '.join(_ARRAYS)}", "rename or remove it")
            for name in ("frequency", "displacement"):
                if name not in content.files:
                    raise InputError(file, name, "nothing", "an array of that name", "add it to the .npz")
            return {name: np.asarray(content[name], int if name == "labels" else float) for name in content.files}
    except InputError:
        raise
    except (OSError, ValueError, TypeError) as error:
        raise InputError(file, "file", f"a file that numpy cannot read ({str(error).splitlines()[0]})", "a .npz of plain arrays", "write it with numpy.savez") from error


def _cells(mesh, file):
    cells = {}
    for block in mesh.cells:
        if block.type not in SOLIDS and block.type not in SHELLS and block.type not in LINES:
            known = ", ".join([*SOLIDS, *SHELLS, *LINES])
            raise InputError(file, "cells", f"the type {block.type}", f"some of: {known}", "write the mesh with one of these")
        cells.setdefault(block.type, []).append(np.asarray(block.data, int))
    cells = {kind: np.concatenate(blocks) for kind, blocks in cells.items()}
    # faces and edges that only mark the boundary of solids are no cells of the body
    if any(kind in SOLIDS for kind in cells):
        cells = {kind: block for kind, block in cells.items() if kind in SOLIDS}
    return list(cells.items())


def _lumped_by_volume(points, cells, density, file):
    mass = np.zeros(len(points))
    for kind, block in cells:
        if kind not in SOLIDS:
            raise InputError(file, f"cells of type {kind}", "no volume", "solids where --density is given", "give node_mass in the .npz")
        corners, faces = SOLIDS[kind]
        middle = points[block[:, :corners]].mean(1)
        volume = np.zeros(len(block))
        for face in faces:
            for i in range(1, len(face) - 1):
                a, b, c = (points[block[:, face[k]]] - middle for k in (0, i, i + 1))
                volume += np.abs(np.einsum("ea,ea->e", a, np.cross(b, c))) / 6
        np.add.at(mass, block[:, :corners].ravel(), np.repeat(density * volume / corners, corners))
    return mass
