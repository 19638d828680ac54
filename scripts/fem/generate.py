"""One body from parameters to a checked modal file with its sidecars."""
import os
from pathlib import Path

import numpy as np
import skfem

from . import inertia, modal_file, reduction, sidecars, structures, validate
from .errors import ModelError
from .geometric import LOADS, modal_geometric_stiffness
from .modes import RootHeld
from .stress import StressRecovery

_GENERATOR = f"scripts/make_modes.py, scikit-fem {skfem.__version__}"


def step_count(body):
    """How many times `compute` and `write` call their `advance` for a body."""
    return 3 + mode_count(body) + len(LOADS)


def mode_count(body):
    """Modes in the file of a body."""
    added = {"cantilever": 0, "craig-bampton": len(body.interfaces), "free-free": 1 + len(body.interfaces)}
    return body.modes + 6 * added[body.boundary]


def compute(body, advance=lambda: None):
    """ModalData of a `Body`; advance() is called after each step."""
    solid, root, others = structures.build(body)
    advance()
    held = RootHeld(solid, root)
    modes = _mode_set(body, solid, held, root, others)
    advance()
    count = len(modes.kind)
    displacement = modes.shapes.reshape(-1, 3, count).transpose(2, 0, 1)
    node_mass = inertia.row_sum_masses(solid)
    interfaces = {"root": (root, "rbe2", (root.measure @ modes.shapes).T)}
    if body.boundary != "free-free":
        interfaces["root"] = (root, "fixed", np.zeros((count, 6)))
    interfaces |= {item.name: (item, "rbe3", (item.measure @ modes.shapes).T) for item in others}
    return modal_file.ModalData(
        title=body.title, generator=_GENERATOR, boundary=body.boundary, solid=solid, node_mass=node_mass,
        integrals=inertia.integrals(solid.points, displacement, lambda values: solid.scalar_mass @ values),
        frequency=modes.frequency, damping_ratio=np.full(count, body.damping_ratio), kind=modes.kind,
        displacement=displacement, displacement_precision=body.displacement_precision,
        stress=_stresses(body, solid, modes.shapes, advance),
        stress_location="node" if structures.stress_is_nodal(body) else "cell", interfaces=interfaces,
        geometric_stiffness=modal_geometric_stiffness(solid, held, modes.shapes, advance))


def write(body, folder, advance=lambda: None):
    """Computes, writes and validates NAME.h5 in `folder`, then its sidecars. Returns (path, rules).

    The file takes its name only once it has passed every rule, so that a failed run leaves an older file as it was.
    """
    path = Path(folder) / f"{body.name}.h5"
    partial = path.with_suffix(".h5.partial")
    try:
        modal_file.write(partial, compute(body, advance))
        rules = validate.validate(partial)
        broken = [str(rule) for rule in rules if not rule.holds]
        if broken:
            raise ModelError(f"{body.name}: the modal file breaks rules of its schema; a finer mesh, "
                             "shorter elements at the ends (end_refinement) or fewer modes may help:\n  "
                             + "\n  ".join(broken))
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    sidecars.write(path)
    advance()
    return path, rules


def _mode_set(body, solid, held, root, others):
    if body.boundary == "cantilever":
        return reduction.cantilever(solid, held, body.modes)
    if body.boundary == "craig-bampton":
        return reduction.craig_bampton(solid, held, others, body.modes)
    return reduction.free_free(solid, held, root, others, body.modes)


def _stresses(body, solid, shapes, advance):
    recovery = StressRecovery(solid)
    recover = recovery.at_nodes if structures.stress_is_nodal(body) else recovery.in_cells
    stresses = []
    for shape in shapes.T:
        stresses.append(recover(shape))
        advance()
    return np.array(stresses)
