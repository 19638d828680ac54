"""Writer of modal files, schema `flexible-body-modes` 1.0, and their digest.

Plain little-endian arrays and fixed-length text only, nothing of variable length; 0-based indices. Nodes on the surface corners
and on interfaces are numbered first, so that a viewer reads the head of each array. No times are stored: the same
numbers give the same bytes.
"""
import dataclasses
import hashlib

import h5py
import numpy as np

from .geometric import LOADS
from .solid import HEXAHEDRON_FACES

FORMAT, VERSION = "flexible-body-modes", "1.0"
UNITS = "m kg s rad Pa Hz"
COMPRESS_ABOVE = 4096                                # bytes; smaller arrays stay contiguous
_CHUNK = 1 << 18                                     # bytes
# Single-precision fields are kept to this fraction of each mode's largest entry: shapes to what single precision gives that entry,
# stress to 1.5e-5, a hundredth of its discretisation error. What lies below is noise that would not compress.
_DISPLACEMENT_RESOLUTION = 2.0 ** -24
_STRESS_RESOLUTION = 2.0 ** -16
# Version of the VTKHDF layout whose unstructured grids are written.
_VTKHDF_VERSION = (2, 0)


@dataclasses.dataclass(frozen=True)
class ModalData:
    """What a modal file holds, in the node order of the solid.

    solid: points (N,3), cells (E,k), node_count and element (cell_type, vtk_type, node_mass_kind). interfaces: name -> (with nodes,
    weights and position; coupling; six-vectors (n,6)). stress (n,N,6) or (n,E,6) by stress_location.
    What other codes bring, or do not: triangles (T,3) instead of the faces of hexahedra; rotation (n,N,3); node_inertia (N,6) with
    rotary_inertia (3,3), their sum, and angular_momentum (n,3); inertia_source, where integrals come from and what they miss.
    """
    title: str
    generator: str
    boundary: str
    solid: object
    node_mass: np.ndarray
    integrals: object
    frequency: np.ndarray
    damping_ratio: np.ndarray
    kind: np.ndarray
    displacement: np.ndarray
    displacement_precision: str
    stress: np.ndarray | None
    stress_location: str
    interfaces: dict
    geometric_stiffness: np.ndarray | None
    triangles: np.ndarray | None = None
    rotation: np.ndarray | None = None
    node_inertia: np.ndarray | None = None
    rotary_inertia: np.ndarray | None = None
    angular_momentum: np.ndarray | None = None
    inertia_source: str | None = None


def write(path, data):
    """Writes one modal file without sidecars."""
    solid, count = data.solid, len(data.frequency)
    triangles = surface_triangles(solid.cells) if data.triangles is None else data.triangles
    order, number = _surface_first(solid.node_count, [triangles.ravel(), *(item[0].nodes for item in data.interfaces.values())])
    with h5py.File(path, "w", track_order=False) as file:
        _set_text(file, format=FORMAT, version=VERSION, units=UNITS, title=data.title, generator=data.generator,
                  boundary=data.boundary, root_interface="root")
        file.attrs["mode_count"], file.attrs["node_count"] = np.int64(count), np.int64(solid.node_count)
        _write_mesh(file, data, triangles, order, number)
        _write_modes(file, data, order)
        for name, (interface, coupling, six_vectors) in data.interfaces.items():
            group = file.create_group(f"interfaces/{name}")
            _set_text(group, coupling=coupling)
            put(group, "position", interface.position, "f8")
            put(group, "nodes", number[interface.nodes], "i8")
            put(group, "weights", interface.weights, "f8")
            put(group, "displacement", six_vectors, "f8", components="ux uy uz rx ry rz")
        if data.geometric_stiffness is not None:
            put(file, "geometric/stiffness", data.geometric_stiffness, "f8", loads=" ".join(LOADS))
        _write_vtkhdf(file)
        _set_text(file, content_sha256=digest(file))


def _write_mesh(file, data, triangles, order, number):
    solid, integrals, element = data.solid, data.integrals, data.solid.element
    surface = put(file, "mesh/points", solid.points[order], "f8")
    surface.attrs["surface_nodes"] = np.int64(_surface_count(triangles, data.interfaces.values()))
    cells = put(file, "mesh/cells", number[solid.cells], "i8", cell_type=element.cell_type)
    cells.attrs["vtk_type"] = np.int64(element.vtk_type)
    put(file, "mesh/surface_triangles", number[triangles], "i8")
    put(file, "mesh/node_mass", data.node_mass[order], "f8", kind=element.node_mass_kind)
    put(file, "body/mass", integrals.mass, "f8")
    put(file, "body/center_of_mass", integrals.center_of_mass, "f8")
    rotary = 0.0 if data.rotary_inertia is None else data.rotary_inertia
    put(file, "body/inertia", integrals.inertia + rotary, "f8", about="origin of mesh/points")
    put(file, "inertia/momentum", integrals.momentum, "f8", meaning="p[j,a] = int rho phi_ja dV")
    put(file, "inertia/first_moment", integrals.first_moment, "f8", meaning="Q[j,a,b] = int rho r_a phi_jb dV")
    put(file, "inertia/second_moment", integrals.second_moment, "f8", meaning="P[j,k,a,b] = int rho phi_ja phi_kb dV")
    if data.node_inertia is not None:
        put(file, "mesh/node_inertia", data.node_inertia[order], "f8", components="xx yy zz xy yz xz")
        put(file, "inertia/angular_momentum", data.angular_momentum, "f8", meaning="eps : Q and the nodes' own part")
        put(file, "inertia/modal_mass", np.eye(len(data.frequency)), "f8", meaning="tr P and the nodes' own part")
    if data.inertia_source is not None:
        _set_text(file["inertia"], source=data.inertia_source)


def _write_modes(file, data, order):
    put(file, "modes/frequency", data.frequency, "f8", unit="Hz")
    put(file, "modes/damping_ratio", data.damping_ratio, "f8")
    put(file, "modes/kind", data.kind, "u1", meaning="0 normal, 1 orthonormalised Craig-Bampton, 2 attachment")
    _set_text(file.create_group("modes/displacement"), unit="m per unit modal coordinate (kg^0.5 m)")
    if data.rotation is not None:
        _set_text(file.create_group("modes/rotation"), unit="rad per unit modal coordinate (kg^0.5 m)")
    if data.stress is not None:
        _set_text(file.create_group("modes/stress"), location=data.stress_location, components="xx yy zz xy yz xz",
                  unit="Pa per unit modal coordinate (kg^0.5 m)")
    for mode in range(len(data.frequency)):
        shape = data.displacement[mode][order]
        if data.displacement_precision == "f4":
            shape = _rounded(shape, _DISPLACEMENT_RESOLUTION)
        put(file, f"modes/displacement/{mode:04d}", shape, data.displacement_precision)
        if data.rotation is not None:
            put(file, f"modes/rotation/{mode:04d}", data.rotation[mode][order], "f8")
        if data.stress is None:
            continue
        stress = data.stress[mode][order] if data.stress_location == "node" else data.stress[mode]
        put(file, f"modes/stress/{mode:04d}", _rounded(stress, _STRESS_RESOLUTION), "f4")


def _rounded(values, resolution):
    # A step that is a power of two keeps the rounded values exact in binary.
    largest = np.abs(values).max()
    if largest == 0:
        return values
    step = 2.0 ** np.floor(np.log2(largest * resolution))
    return np.round(values / step) * step + 0.0


def _write_vtkhdf(file):
    """A view of the file for VTK's own HDF reader: hard links, only the connectivity is stored a second time."""
    cells = file["mesh/cells"]
    group = file.create_group("VTKHDF")
    group.attrs["Version"] = np.array(_VTKHDF_VERSION, "<i8")
    _set_text(group, Type="UnstructuredGrid")
    put(group, "NumberOfPoints", [len(file["mesh/points"])], "i8")
    put(group, "NumberOfCells", [len(cells)], "i8")
    put(group, "NumberOfConnectivityIds", [cells.size], "i8")
    put(group, "Connectivity", cells[()].ravel(), "i8")
    put(group, "Offsets", np.arange(len(cells) + 1) * cells.shape[1], "i8")
    put(group, "Types", np.full(len(cells), cells.attrs["vtk_type"]), "u1")
    group["Points"] = file["mesh/points"]
    point_data, cell_data = group.create_group("PointData"), group.create_group("CellData")
    for mode, shape in file["modes/displacement"].items():
        point_data[f"mode_{mode}"] = shape
    if "modes/stress" not in file:
        return
    stress_data = point_data if file["modes/stress"].attrs["location"] == b"node" else cell_data
    for mode, stress in file["modes/stress"].items():
        stress_data[f"stress_{mode}"] = stress


def put(group, name, values, dtype, **text):
    """Writes one dataset, compressed and with a checksum where it is large, and its text attributes."""
    values = np.asarray(values, np.dtype(dtype).newbyteorder("<"))
    options = {}
    if values.nbytes > COMPRESS_ABOVE:
        row = values.nbytes // len(values)
        options = {"chunks": (min(len(values), max(1, _CHUNK // row)), *values.shape[1:]),
                   "shuffle": True, "compression": "gzip", "compression_opts": 4, "fletcher32": True}
    dataset = group.create_dataset(name, data=values, track_times=False, **options)
    _set_text(dataset, **text)
    return dataset


def _set_text(target, **text):
    for key, value in text.items():
        target.attrs[key] = np.bytes_(value.encode("utf-8"))


def surface_triangles(cells):
    """(T,3) corner triangles of the boundary of hexahedra (E,k) in VTK order, counter-clockwise seen from outside."""
    faces = np.concatenate([cells[:, list(face)] for face in HEXAHEDRON_FACES])
    _, group, size = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    outer = faces[size[group.ravel()] == 1]
    return np.concatenate([outer[:, [0, 1, 2]], outer[:, [0, 2, 3]]])


def _surface_first(node_count, groups):
    """order (N,): old number of each new node; number (N,): new number of each old node."""
    leading = np.unique(np.concatenate(groups))
    order = np.concatenate([leading, np.setdiff1d(np.arange(node_count), leading)])
    number = np.empty(node_count, int)
    number[order] = np.arange(node_count)
    return order, number


def _surface_count(triangles, interfaces):
    return len(np.unique(np.concatenate([triangles.ravel(), *(item[0].nodes for item in interfaces)])))


def digest(file):
    """SHA-256 over all datasets outside /VTKHDF, sorted by path: path, NUL, type, NUL, shape, NUL, little-endian bytes.

    Groups are walked by name: a visitor would show a hard-linked dataset only once, under the name found first.
    """
    result = hashlib.sha256()
    for path, dataset in sorted(datasets(file)):
        kind = dataset.dtype.newbyteorder("<")
        shape = ",".join(map(str, dataset.shape))
        result.update(b"\0".join([path.encode(), kind.str.encode(), shape.encode(), np.ascontiguousarray(dataset[()], kind).tobytes()]))
    return result.hexdigest()


def datasets(group, prefix=""):
    """Yields (path, dataset) below a group, /VTKHDF left out."""
    for name, item in group.items():
        if prefix + name == "VTKHDF":
            continue
        if isinstance(item, h5py.Group):
            yield from datasets(item, f"{prefix}{name}/")
        else:
            yield prefix + name, item
