"""Checks a modal file against the rules of schema `flexible-body-modes` 1.0, from the file alone.

Nothing here is shared with what computes a file: inertia is recomputed from nodal masses and displacements. Rust's reader
applies the same rules; this one tells a generator before a file is used.
"""
import dataclasses

import h5py
import numpy as np

from .geometric import LOADS
from .lumped import rotary_matrices
from .modal_file import COMPRESS_ABOVE, FORMAT, VERSION, datasets, digest

BOUNDARIES = ("cantilever", "free-free", "craig-bampton", "general")
NODE_MASS_KINDS = ("row_sum", "row_sum_signed", "hrz", "solver")
COUPLINGS = ("fixed", "rbe3", "rbe2")
CELL_NODES = {"tetra": 4, "tetra10": 10, "hexahedron": 8, "hexahedron20": 20, "hexahedron27": 27, "wedge": 6, "wedge15": 15,
              "pyramid": 5, "pyramid13": 13, "triangle": 3, "triangle6": 6, "quad": 4, "quad8": 8, "quad9": 9, "line": 2, "vertex": 1}
_OPEN = ("triangle", "triangle6", "quad", "quad8", "quad9", "line", "vertex")      # cells whose surface need not be closed
_TYPES = ("<f8", "<f4", "<i8", "|u1")
_ROUNDING = 1e-12       # sums of a few thousand terms
_PERMUTATION = np.zeros((3, 3, 3))
_PERMUTATION[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_PERMUTATION[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0


@dataclasses.dataclass(frozen=True)
class Rule:
    """One rule: it holds when value <= limit, and deserves a look when value > warning."""
    name: str
    value: float
    limit: float
    warning: float = np.inf

    @property
    def holds(self):
        """Whether the rule is kept; a value that is not a number keeps none."""
        return bool(self.value <= self.limit)

    @property
    def doubtful(self):
        """Whether the rule is kept but above its warning level."""
        return self.holds and self.value > self.warning

    def __str__(self):
        return f"{self.name}: {self.value:.3g} (limit {self.limit:.3g})"


def validate(path):
    """List of Rules of the file `path`. Later rules are left out where the structure they need is broken."""
    try:
        with h5py.File(path) as file:
            rules = _structure(file)
            if all(rule.holds for rule in rules):
                rules += _Contents(file).rules()
            return rules
    except OSError as error:
        return [_truth(f"the file can be read ({error})", False)]
    except (KeyError, ValueError, UnicodeDecodeError) as error:
        return [_truth(f"the layout is that of the schema ({error})", False)]


def _truth(name, holds):
    return Rule(name, 0.0 if holds else 1.0, 0.0)


def _text(target, name):
    value = target.attrs[name]
    if not isinstance(value, bytes):
        raise ValueError(f"attribute {name} of {target.name} must be fixed-length text, found {type(value).__name__}")
    return value.decode("utf-8")


def _structure(file):
    """Format, types, shapes, index ranges, digest."""
    rules = [_truth("format and major version", _text(file, "format") == FORMAT
                    and _text(file, "version").split(".")[0] == VERSION.split(".")[0])]
    arrays = dict(datasets(file))
    rules.append(_truth("plain little-endian types only", all(item.dtype.str in _TYPES for item in arrays.values())))
    rules.append(_truth("large arrays are chunked with checksums",
                        all(item.fletcher32 and item.shuffle and item.compression == "gzip"
                            for item in arrays.values() if item.size * item.dtype.itemsize > COMPRESS_ABOVE)))
    rules.append(_truth("content_sha256", _text(file, "content_sha256") == digest(file)))
    rules.append(_truth("all numbers finite", all(np.isfinite(item[()]).all() for item in arrays.values())))
    nodes, modes = int(file.attrs["node_count"]), int(file.attrs["mode_count"])
    cells = file["mesh/cells"]
    shapes = {"mesh/points": (nodes, 3), "mesh/node_mass": (nodes,), "body/mass": (), "body/center_of_mass": (3,),
              "body/inertia": (3, 3), "modes/frequency": (modes,), "modes/damping_ratio": (modes,), "modes/kind": (modes,),
              "inertia/momentum": (modes, 3), "inertia/first_moment": (modes, 3, 3), "inertia/second_moment": (modes, modes, 3, 3)}
    shapes |= {f"modes/displacement/{mode:04d}": (nodes, 3) for mode in range(modes)}
    if "modes/stress" in file:
        rows = {"node": nodes, "cell": len(cells)}[_text(file["modes/stress"], "location")]
        shapes |= {f"modes/stress/{mode:04d}": (rows, 6) for mode in range(modes)}
    if "modes/rotation" in file:
        shapes |= {f"modes/rotation/{mode:04d}": (nodes, 3) for mode in range(modes)}
    if "mesh/node_inertia" in file:
        shapes |= {"mesh/node_inertia": (nodes, 6), "inertia/angular_momentum": (modes, 3), "inertia/modal_mass": (modes, modes)}
    if "geometric" in file:
        shapes["geometric/stiffness"] = (len(LOADS), modes, modes)
        rules.append(_truth("geometric loads named", _text(file["geometric/stiffness"], "loads").split() == list(LOADS)))
    for name, group in file["interfaces"].items():
        count = group["nodes"].shape
        shapes |= {f"interfaces/{name}/position": (3,), f"interfaces/{name}/weights": count,
                   f"interfaces/{name}/displacement": (modes, 6)}
        rules.append(_truth(f"interface {name}: coupling known", _text(group, "coupling") in COUPLINGS))
        rules.append(_truth(f"interface {name}: node numbers in range", _in_range(group["nodes"], nodes)))
    for path, shape in shapes.items():
        if path not in arrays or arrays[path].shape != shape:
            rules.append(_truth(f"{path} has shape {shape}", False))
    rules.append(_truth("cells: type and node numbers",
                        cells.shape[1] == CELL_NODES[_text(cells, "cell_type")] and _in_range(cells, nodes)))
    rules.append(_truth("surface triangles use leading nodes",
                        not len(file["mesh/surface_triangles"]) or _in_range(file["mesh/surface_triangles"], int(file["mesh/points"].attrs["surface_nodes"]))))
    rules.append(_truth("boundary, node mass kind and root known", _text(file, "boundary") in BOUNDARIES
                        and _text(file["mesh/node_mass"], "kind") in NODE_MASS_KINDS
                        and _text(file, "root_interface") in file["interfaces"]))
    return rules


def _in_range(dataset, end):
    numbers = dataset[()]
    return numbers.size > 0 and numbers.min() >= 0 and numbers.max() < end


class _Contents:
    """The numbers of a file whose structure is sound, and the rules between them."""

    def __init__(self, file):
        self.boundary = _text(file, "boundary")
        self.points, self.node_mass = file["mesh/points"][()], file["mesh/node_mass"][()]
        self.triangles = file["mesh/surface_triangles"][()]
        self.exact_masses = _text(file["mesh/node_mass"], "kind") == "row_sum"
        self.frequency, self.damping = file["modes/frequency"][()], file["modes/damping_ratio"][()]
        self.displacement = np.array([file[f"modes/displacement/{mode:04d}"][()] for mode in range(len(self.frequency))], float)
        self.single_precision = file["modes/displacement/0000"].dtype.itemsize == 4
        self.mass, self.center, self.inertia = (file[f"body/{name}"][()] for name in ("mass", "center_of_mass", "inertia"))
        self.momentum, self.first, self.second = (file[f"inertia/{name}"][()] for name in ("momentum", "first_moment", "second_moment"))
        self.closed = _text(file["mesh/cells"], "cell_type") not in _OPEN
        self.angular, self.modal_mass = np.einsum("abc,jbc->ja", _PERMUTATION, self.first), np.einsum("jkaa->jk", self.second)
        self.rotary, self.rotation = None, None
        if "mesh/node_inertia" in file:
            self.angular, self.modal_mass = file["inertia/angular_momentum"][()], file["inertia/modal_mass"][()]
            self.rotary = rotary_matrices(file["mesh/node_inertia"][()])
            self.rotation = np.array([file[f"modes/rotation/{mode:04d}"][()] for mode in range(len(self.frequency))], float)
        self.interfaces = {name: {key: item[()] for key, item in group.items()} for name, group in file["interfaces"].items()}
        self.root = self.interfaces[_text(file, "root_interface")]
        self.geometric = file["geometric/stiffness"][()] if "geometric" in file else None
        self.size = np.abs(self.points).max()
        self.largest_inertia = np.abs(np.linalg.eigvalsh(self.inertia)).max()

    def rules(self):
        """All rules on numbers."""
        return [*self._body(), *self._modes(), *self._nodes(), *self._surface(), *self._interfaces(), *self._boundary()]

    def _body(self):
        low, high = self.points.min(0), self.points.max(0)
        yield _truth("mass positive", self.mass > 0)
        yield _truth("centre of mass inside the bounding box", (self.center >= low).all() and (self.center <= high).all())
        yield Rule("inertia symmetric", np.abs(self.inertia - self.inertia.T).max() / self.largest_inertia, _ROUNDING)
        offset = self.center @ self.center * np.eye(3) - np.outer(self.center, self.center)
        central = np.linalg.eigvalsh(self.inertia - self.mass * offset)
        yield _truth("central inertia positive definite", central[0] > 0)
        yield Rule("central inertia: triangle inequality", central[2] / (central[0] + central[1]), 1 + _ROUNDING)

    def _modes(self):
        count = len(self.frequency)
        yield _truth("frequencies positive and ascending", (self.frequency > 0).all() and (np.diff(self.frequency) >= 0).all())
        yield _truth("damping not negative", (self.damping >= 0).all())
        yield Rule("modes orthonormal", np.abs(self.modal_mass - np.eye(count)).max(), 1e-6)
        yield Rule("second moment symmetric", np.abs(self.second - self.second.transpose(1, 0, 3, 2)).max(), _ROUNDING)
        yield Rule("effective masses within the mass", ((self.momentum ** 2).sum(0) / self.mass).max(), 1 + 1e-9)
        yield Rule("effective inertias within the inertia", ((self.angular ** 2).sum(0) / np.diag(self.inertia)).max(), 1 + 1e-9)
        if self.geometric is not None:
            scale = max(np.abs(self.geometric).max(), np.finfo(float).tiny)
            yield Rule("geometric stiffness symmetric", np.abs(self.geometric - self.geometric.transpose(0, 2, 1)).max() / scale, 1e-9)

    def _nodes(self):
        """Lumped integrals against the stored ones. Row sums are exact where a field is linear in the shape functions."""
        exact = (1e-6 if self.single_precision else 1e-9) if self.exact_masses else 1e-2
        mass, points = self.node_mass, self.points
        squared = np.einsum("n,na,nb->ab", mass, points, points)
        lumped_inertia = np.trace(squared) * np.eye(3) - squared + (0.0 if self.rotary is None else self.rotary.sum(0))
        momentum = np.einsum("n,jna->ja", mass, self.displacement)
        first = np.einsum("n,na,jnb->jab", mass, points, self.displacement, optimize=True)
        weighted = (self.displacement * mass[:, None]).reshape(len(self.frequency), -1)
        gram = weighted @ self.displacement.reshape(len(self.frequency), -1).T
        if self.rotary is not None:
            turning = np.einsum("nab,jnb->jna", self.rotary, self.rotation).reshape(len(gram), -1)
            gram = gram + turning @ self.rotation.reshape(len(gram), -1).T
        yield Rule("node masses sum to the mass", abs(mass.sum() / self.mass - 1), 1e-9)
        yield Rule("node masses balance about the centre of mass",
                   np.abs(mass @ points - self.mass * self.center).max() / (self.mass * self.size), 1e-9 if self.exact_masses else 1e-2)
        yield Rule("lumped inertia", np.abs(lumped_inertia - self.inertia).max() / self.largest_inertia,
                   1e-4 if self.exact_masses else 1e-2)
        yield Rule("lumped momentum", np.abs(momentum - self.momentum).max() / np.sqrt(self.mass), exact)
        yield Rule("lumped orthonormality", np.abs(gram - np.eye(len(gram))).max(), 1e-2, 1e-3)
        yield Rule("lumped first moment", np.abs(first - self.first).max() / np.sqrt(self.largest_inertia), 1e-2, 1e-3)

    def _surface(self):
        if not self.closed:
            return
        a, b, c = (self.points[self.triangles[:, corner]] for corner in range(3))
        yield _truth("surface triangles face outward", np.einsum("ta,ta->", a, np.cross(b, c)) > 0)

    def _interfaces(self):
        largest = np.abs(self.displacement).max()
        for name, item in self.interfaces.items():
            nodes, weights = item["nodes"], item["weights"]
            mean = np.einsum("k,jka->ja", weights, self.displacement[:, nodes])
            yield Rule(f"interface {name}: weights sum to one", abs(weights.sum() - 1), _ROUNDING)
            yield Rule(f"interface {name}: position is the weighted mean of its nodes",
                       np.abs(weights @ self.points[nodes] - item["position"]).max() / self.size, 1e-9)
            yield Rule(f"interface {name}: translation is the weighted mean of its nodes",
                       np.abs(mean - item["displacement"][:, :3]).max() / largest, 1e-6)
        yield Rule("root at the origin", np.abs(self.root["position"]).max() / self.size, 1e-9)

    def _boundary(self):
        if self.boundary in ("cantilever", "craig-bampton"):
            yield Rule("root nodes do not move", np.abs(self.displacement[:, self.root["nodes"]]).max(), 0.0)
            yield Rule("root interface does not move", np.abs(self.root["displacement"]).max(), 0.0)
        if self.boundary == "free-free":
            yield Rule("free modes carry no momentum", np.abs(self.momentum).max() / np.sqrt(self.mass), 1e-6)
            yield Rule("free modes carry no angular momentum", np.abs(self.angular).max() / np.sqrt(self.largest_inertia), 1e-6)
