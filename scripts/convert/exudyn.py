"""Exudyn's FEM file (`FEMinterface.SaveToFile`, .hdf5 or .npz): mesh, sparse mass and stiffness, mode basis, node sets, stress modes.

The .npz holds pickles, which can run any code. They are read by an unpickler that makes numpy arrays and scipy matrices and nothing else.
"""
import io
import pickle
import zipfile
from pathlib import Path

import h5py
import numpy as np
import scipy.linalg
import scipy.sparse

from .errors import InputError
from .foreign import Foreign

_CELLS = {"Tet4": "tetra", "Tet10": "tetra10", "Hex8": "hexahedron", "Hex20": "hexahedron20", "Wedge6": "wedge"}
# Exudyn's order of stress components is xx yy zz yz xz xy.
_STRESS = [0, 1, 2, 5, 3, 4]
_HARMLESS = {("numpy", "ndarray"), ("numpy", "dtype"), ("numpy.core.multiarray", "_reconstruct"), ("numpy._core.multiarray", "_reconstruct"),
             ("numpy.core.multiarray", "scalar"), ("numpy._core.multiarray", "scalar"), ("numpy._core.numeric", "_frombuffer"),
             ("numpy.core.numeric", "_frombuffer"), ("scipy.sparse._csr", "csr_matrix"), ("scipy.sparse.csr", "csr_matrix")}


def read(file):
    """Foreign of a FEM file."""
    file = Path(file)
    data = _hdf5(file) if file.suffix.lower() in (".hdf5", ".h5") else _npz(file)
    nodes = _need(data, file, "nodes", dict, "a dictionary with Position")
    if "Position" not in nodes:
        raise InputError(file, "nodes", f"nodes of the kinds {', '.join(nodes) or 'none'}", "Position (solids)", "export a solid mesh")
    points = np.asarray(nodes["Position"], float)
    mass = _matrix(data, file, "massMatrix", len(points))
    scalar = _scalar(mass, file)
    basis = _need(data, file, "modeBasis", dict, "a dictionary with matrix")
    if "matrix" not in basis:
        raise InputError(file, "modeBasis", "no matrix", "the modes", "call ComputeEigenmodes or ComputeHurtyCraigBamptonModes before SaveToFile")
    shapes = np.asarray(basis["matrix"], float)
    if shapes.ndim != 2 or shapes.shape[0] != 3 * len(points):
        raise InputError(file, "modeBasis/matrix", f"shape {shapes.shape}", f"({3 * len(points)}, modes)", "write the file again")
    stiffness = _matrix(data, file, "stiffnessMatrix", len(points))
    reduced = [shapes.T @ (matrix @ shapes) for matrix in (stiffness, mass)]
    try:
        squared, turn = scipy.linalg.eigh(*[(matrix + matrix.T) / 2 for matrix in reduced])
    except np.linalg.LinAlgError as error:
        raise InputError(file, "modeBasis/matrix", "modes that depend on each other", "independent modes", "compute fewer modes") from error
    displacement = (shapes @ turn).T.reshape(len(squared), len(points), 3)
    post = data.get("postProcessingModes") or {}
    stress = None
    if "matrix" in post and "Stress" in str(post.get("outputVariableType", "")):
        values = np.asarray(post["matrix"], float).reshape(len(points), len(turn), 6)
        stress = np.tensordot(turn.T, values.transpose(1, 0, 2), 1)[:, :, _STRESS]
    kind = str(basis.get("type", ""))
    return Foreign(
        file=file, code="Exudyn FEM file", labels=np.arange(len(points)), points=points, cells=_cells(data, file),
        displacement=displacement, frequency=np.sqrt(np.maximum(squared, 0.0)) / (2 * np.pi), scalar_mass=scalar, stress=stress,
        sets=_sets(data), scaled=False, craig_bampton="HCB" in kind,
        notes=["modes combined to those of the reduced mass and stiffness"] if "HCB" in kind else [])


def _need(data, file, key, kind, meaning):
    if not isinstance(data.get(key), kind):
        raise InputError(file, key, f"{type(data.get(key)).__name__}" if key in data else "nothing", meaning, "write the file with FEMinterface.SaveToFile")
    return data[key]


def _matrix(data, file, key, nodes):
    matrix = data.get(key)
    if matrix is None or not scipy.sparse.issparse(matrix):
        raise InputError(file, key, "nothing" if matrix is None else type(matrix).__name__, "a sparse matrix", "assemble it before SaveToFile")
    if matrix.shape != (3 * nodes, 3 * nodes):
        raise InputError(file, key, f"shape {matrix.shape}", f"({3 * nodes}, {3 * nodes}), three for each node", "write the file again")
    return scipy.sparse.csr_matrix(matrix, dtype=float)


def _scalar(mass, file):
    """The one matrix of all directions; densities have no direction, so a mass matrix that couples them is none of a solid."""
    scalar = mass[0::3, 0::3]
    expected = scipy.sparse.kron(scalar, scipy.sparse.eye(3), "csr")
    off = abs(mass - expected).max()
    if off > 1e-9 * abs(mass).max():
        raise InputError(file, "massMatrix", f"directions coupled or unequal by {off:.3g}", "the same mass in x, y and z", "use nodes of the kind Position")
    return scalar


def _cells(data, file):
    cells = {}
    for element in data.get("elements") or []:
        for kind, block in element.items():
            if kind in _CELLS:
                cells.setdefault(_CELLS[kind], []).append(np.asarray(block, int))
            elif kind != "Name":
                raise InputError(file, "elements", f"the type {kind}", f"some of: {', '.join(_CELLS)}", "export these elements")
    return [(kind, np.concatenate(blocks)) for kind, blocks in cells.items()]


def _sets(data):
    sets = {}
    for item in data.get("nodeSets") or []:
        nodes = np.asarray(item["NodeNumbers"], int)
        weights = np.asarray(item.get("NodeWeights", np.ones(len(nodes))), float)
        if len(nodes):
            sets[str(item["Name"])] = (nodes, weights if weights.sum() > 0 else None)
    return sets


def _hdf5(file):
    def value(item):
        kind = item.attrs.get("datatype", "")
        kind = kind.decode() if isinstance(kind, bytes) else kind
        if kind == "csr_matrix":
            return scipy.sparse.csr_matrix((item["data"][()], item["indices"][()], item["indptr"][()]), shape=tuple(item["shape"][()]))
        if kind == "list":
            return [value(item[f"item_{i}"]) for i in range(len(item))]
        if isinstance(item, h5py.Group):
            return {key: value(below) for key, below in item.items()}
        if kind == "NoneType":
            return None
        content = item[()]
        return content.decode() if isinstance(content, bytes) else content
    try:
        with h5py.File(file) as content:
            return {key: value(item) for key, item in content.items()}
    except (OSError, KeyError, RuntimeError) as error:
        raise InputError(file, "file", f"no FEM file ({str(error).splitlines()[0]})", "a file of FEMinterface.SaveToFile", "check the path and the format") from error


class _Unpickler(pickle.Unpickler):
    def find_class(self, module, name):
        if (module, name) not in _HARMLESS:
            raise pickle.UnpicklingError(f"the object {module}.{name}")
        return super().find_class(module, name)


def _npz(file):
    data = {}
    try:
        with zipfile.ZipFile(file) as archive:
            for member in archive.namelist():
                with archive.open(member) as stream:
                    data[member.removesuffix(".npy")] = _array(io.BytesIO(stream.read()))
    except (OSError, zipfile.BadZipFile, ValueError, EOFError, pickle.UnpicklingError) as error:
        raise InputError(file, "file", f"no FEM file ({str(error).splitlines()[0]})", "arrays, dictionaries and sparse matrices of FEMinterface.SaveToFile",
                         "save it as .hdf5 instead") from error
    return data


def _array(stream):
    version = np.lib.format.read_magic(stream)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = header(stream)
    if dtype.hasobject:
        value = _Unpickler(stream).load()
        return value.item() if shape == () else value.tolist()
    stream.seek(0)
    return np.lib.format.read_array(stream, allow_pickle=False)
