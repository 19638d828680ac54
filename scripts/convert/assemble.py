"""Foreign data and choices to a checked modal file with its sidecars, and what was carried and approximated on the way."""
import dataclasses
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from fem import modal_file, sidecars, validate
from fem.errors import ModelError
from fem.inertia import integrals
from fem.lumped import LumpedMass, orthonormalise, rotary_matrices, without_rigid_motion

from . import choices as chosen
from .errors import InputError
from .surface import one_block, skin

VTK_TYPES = {"vertex": 1, "line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12, "wedge": 13, "pyramid": 14, "triangle6": 22,
             "quad8": 23, "tetra10": 24, "hexahedron20": 25, "wedge15": 26, "pyramid13": 27, "quad9": 28, "hexahedron27": 29}
# Share of a free mode in rigid-body motion from which on it is a rigid-body mode.
_RIGID = 0.999


@dataclasses.dataclass(frozen=True)
class Approximations:
    """Figures of the integrals: relative defect of mass and inertia against what the code states (None: it states none) and the
    largest departure from orthonormality that was taken out. The largest predicts the relative error of a load."""
    source: str
    mass_defect: float | None
    inertia_defect: float | None
    orthonormality_change: float
    notes: tuple

    @property
    def load_error(self):
        """Predicted relative error of hinge loads by the approximation of mass."""
        return max(self.orthonormality_change, self.mass_defect or 0.0, self.inertia_defect or 0.0)

    def text(self):
        """One line, as the health report shows it."""
        defects = [f"{name} defect {value:.2g}" for name, value in (("mass", self.mass_defect), ("inertia", self.inertia_defect)) if value is not None]
        if not defects:
            defects = ["mass and inertia not stated by the code"]
        return f"{self.source}; {', '.join(defects)}, orthonormality change {self.orthonormality_change:.2g}"


def write(foreign, choices, path):
    """Writes NAME.h5 and its sidecars; returns (Approximations, rules). The file takes its name only once it has passed every rule."""
    path = Path(path)
    data, approximations = compute(foreign, choices)
    partial = path.with_name(path.name + ".partial")
    try:
        modal_file.write(partial, data)
        rules = validate.validate(partial)
        broken = [str(rule) for rule in rules if not rule.holds]
        if broken:
            raise InputError(foreign.file, "the converted modes", "\n  ".join(["rules of the schema that do not hold:", *broken]) + "\n ",
                             "a file that keeps all", "look at units, node masses and --boundary")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    sidecars.write(path)
    return approximations, rules


def compute(foreign, choices):
    """ModalData and Approximations."""
    _complete(foreign)
    notes = list(foreign.notes)
    masses, apply_mass, source = _masses(foreign, choices)
    points = foreign.points * choices.length_unit
    displacement = foreign.displacement * choices.length_unit
    rotation, frequency, stress = foreign.rotation, foreign.frequency, foreign.stress
    damping = chosen.damping(foreign, choices)
    basis = masses if foreign.scalar_mass is None else _Consistent(apply_mass)
    if choices.boundary not in chosen.BOUNDARIES:
        raise InputError(foreign.file, "--boundary", f"\"{choices.boundary}\"", f"one of: {', '.join(chosen.BOUNDARIES)}", "state how the modes were held")
    nodes, weights = chosen.nodes_of(foreign, "--root", choices.root)
    origin = np.average(points[nodes], axis=0, weights=weights)
    points = points - origin
    if choices.boundary == "free-free":
        displacement, rotation, share = without_rigid_motion(basis, points, displacement, rotation)
        elastic = share < _RIGID
        if not elastic.all():
            notes.append(f"{(~elastic).sum()} rigid-body modes left out")
        displacement, frequency, damping = displacement[elastic], frequency[elastic], damping[elastic]
        rotation, stress = (None if item is None else item[elastic] for item in (rotation, stress))
        if elastic.any() and share[elastic].max() > 1e-9:
            notes.append(f"rigid-body motion taken out of the elastic modes, at most {share[elastic].max():.2g} of a mode")
    _elastic(foreign, frequency)
    order = np.argsort(frequency, kind="stable")
    displacement, frequency, damping = displacement[order], frequency[order], damping[order]
    rotation, stress = (None if item is None else item[order] for item in (rotation, stress))

    # shapes in the code's own unit of modal mass, so that its scaling can be judged; what comes out has unit modal mass in SI
    unit = choices.length_unit ** 2 * choices.mass_unit
    try:
        modes = orthonormalise(basis, displacement / np.sqrt(unit), None if rotation is None else rotation / np.sqrt(unit), foreign.scaled)
    except ModelError as error:
        raise InputError(foreign.file, "modes and masses", "modes that are not orthogonal", "those of one model", str(error)) from error
    displacement, rotation = modes.displacement, modes.rotation
    if stress is not None:
        scale = choices.mass_unit / choices.length_unit / np.sqrt(unit)
        stress = np.tensordot(modes.transform.T, stress * scale, 1)
    tensors = integrals(points, displacement, apply_mass)
    places = {"root": chosen.place(foreign, "--root", choices.root, points, displacement, rotation, choices.boundary in ("cantilever", "craig-bampton"))}
    for name, rule in choices.interfaces.items():
        places[name] = chosen.place(foreign, f"--interface {name}", rule, points, displacement, rotation, False)
    notes += [f"interface {name}: rigid fit with equal weights" for name, item in places.items() if item.coupling == "rbe3" and np.ptp(item.weights) == 0]

    triangles = skin(points, foreign.cells)
    block, less = one_block(foreign.cells, triangles)
    if block is None:
        block, less = ("vertex", np.arange(len(points))[:, None]), bool(foreign.cells)
        notes.append("no surface: bodies of this file are not drawn and carry no stress")
    elif less:
        notes.append(f"cells of {len(foreign.cells)} types: the file keeps {block[0]}s")
    kind = "solver" if foreign.scalar_mass is None else ("row_sum" if (masses.mass > 0).all() else "row_sum_signed")
    solid = SimpleNamespace(points=points, cells=block[1], node_count=len(points),
                            element=SimpleNamespace(cell_type=block[0], vtk_type=VTK_TYPES[block[0]], node_mass_kind=kind))
    rotary = masses.rotary is not None
    stated = _defects(foreign, choices, tensors, masses.rotary_inertia, origin)
    approximations = Approximations(source, *stated, modes.change, tuple(notes))
    return modal_file.ModalData(
        title=choices.title or f"{foreign.file.stem}, from {foreign.code}", generator=f"scripts/convert_modes.py, from {foreign.code}",
        boundary=choices.boundary, solid=solid, node_mass=masses.mass, integrals=tensors, frequency=frequency, damping_ratio=damping,
        kind=np.full(len(frequency), 1 if foreign.craig_bampton else 0), displacement=displacement, displacement_precision="f8", stress=stress,
        stress_location="node", interfaces={name: (item, item.coupling, item.six_vectors) for name, item in places.items()},
        geometric_stiffness=None, triangles=triangles, rotation=rotation, node_inertia=masses.rotary_components,
        rotary_inertia=masses.rotary_inertia if rotary else None,
        angular_momentum=masses.angular_momentum(tensors, rotation) if rotary else None, inertia_source=approximations.text()), approximations


class _Consistent:
    """A mass matrix in the place of nodal masses."""

    rotary = None

    def __init__(self, apply_mass):
        self._apply = apply_mass

    def modal_mass(self, displacement, rotation):
        count, nodes = displacement.shape[:2]
        weighted = self._apply(displacement.transpose(1, 0, 2).reshape(nodes, -1)).reshape(nodes, count, 3).transpose(1, 0, 2)
        gram = weighted.reshape(count, -1) @ displacement.reshape(count, -1).T
        return (gram + gram.T) / 2


def _complete(foreign):
    """Shapes and finite numbers; a reader's file may lie."""
    count, nodes = len(foreign.frequency), len(foreign.points)
    shapes = {"displacement": (count, nodes, 3), "rotation": (count, nodes, 3), "node_mass": (nodes,), "node_inertia": (nodes, 6), "stress": (count, nodes, 6)}
    for name, shape in shapes.items():
        value = getattr(foreign, name)
        if value is not None and np.shape(value) != shape:
            raise InputError(foreign.file, name, f"shape {np.shape(value)}", f"{shape}: {count} modes, {nodes} nodes", "write the file again")
    for name in ("points", "frequency", *shapes):
        value = getattr(foreign, name)
        if value is not None and not np.isfinite(value).all():
            raise InputError(foreign.file, name, "a number that is not finite", "finite numbers", "repair the tool that wrote the file")
    if not count:
        raise InputError(foreign.file, "modes", "none", "at least one", "export the modes from the code; a body without them is rigid")
    if foreign.node_inertia is not None and not np.any(foreign.node_inertia):
        foreign.node_inertia = None
    if foreign.node_inertia is not None and foreign.rotation is None:
        raise InputError(foreign.file, "rotations", "none, but nodes with inertia of their own", "rotations of every node", "export all six components of the modes")


def _masses(foreign, choices):
    """LumpedMass, what applies the mass matrix to fields (N,m), and where integrals come from."""
    if foreign.scalar_mass is not None:
        matrix = foreign.scalar_mass * choices.mass_unit
        return LumpedMass(np.asarray(matrix.sum(1)).ravel()), (lambda values: matrix @ values), "integrals from the code's consistent mass matrix"
    if foreign.node_mass is None:
        raise InputError(foreign.file, "nodal masses", "none", "a mass for every node", "give --node-mass FILE.npy (one number per node, in the order of the file)")
    mass = np.asarray(foreign.node_mass, float) * choices.mass_unit
    if not mass.sum() > 0:
        raise InputError(foreign.file, "nodal masses", f"a sum of {mass.sum():.3g}", "a positive mass", "check densities and masses in the model")
    rotary = None if foreign.node_inertia is None else rotary_matrices(foreign.node_inertia) * choices.mass_unit * choices.length_unit ** 2
    return LumpedMass(mass, rotary), (lambda values: mass[:, None] * values), "integrals are lumped sums over nodal masses"


def _elastic(foreign, frequency):
    if not len(frequency):
        raise InputError(foreign.file, "modes", "rigid-body modes only", "elastic modes", "export more modes")
    if frequency.min() <= 1e-4 * frequency.max() and frequency.min() <= 1e-3:
        raise InputError(foreign.file, f"mode {int(frequency.argmin()) + 1}", f"{frequency.min():.3g} Hz, a rigid-body mode", "elastic modes",
                         "give --boundary free-free, which leaves them out, or export elastic modes only")


def _defects(foreign, choices, tensors, rotary, origin):
    """Relative defects of mass and of inertia about the centre of mass, against what the code states."""
    if foreign.stated is None:
        return None, None
    mass, center, inertia = foreign.stated
    mass, inertia = mass * choices.mass_unit, np.asarray(inertia) * choices.mass_unit * choices.length_unit ** 2
    center = np.asarray(center) * choices.length_unit - origin
    about_origin = inertia + mass * (center @ center * np.eye(3) - np.outer(center, center))
    ours = tensors.inertia + rotary
    return float(abs(tensors.mass / mass - 1)), float(np.abs(ours - about_origin).max() / np.abs(about_origin).max())
