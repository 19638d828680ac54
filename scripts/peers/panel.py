"""The flexible panel of the benchmark: one finite-element model, as a modal file for pliant and as matrices for Exudyn.

2 m x 1 m x 40 mm, 8 kg, of triquadratic bricks; Craig-Bampton modes: root and tip faces move as rigid bodies, the root is held, and
n - 6 fixed-interface modes go with the six static modes of the tip, all orthonormal in the mass matrix.
"""
import sys
from pathlib import Path

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from fem import inertia, modal_file, parameters, reduction, structures  # noqa: E402
from fem.interfaces import degrees_of_freedom  # noqa: E402
from fem.modes import with_fixed_sign  # noqa: E402
from fem.solid import rigid_motions  # noqa: E402

LENGTH, WIDTH, THICKNESS = 2.0, 1.0, 0.04
TABLE = {
    "title": "Panel of the benchmark, 2 m x 1 m x 40 mm, 8 kg", "kind": "panel", "length": LENGTH, "width": WIDTH, "thickness": THICKNESS,
    "material": {"young_modulus": 1e9, "poisson_ratio": 0.3, "density": 100.0}, "mesh": [12, 6, 1], "element": "hex27",
    "boundary": "craig-bampton", "modes": 6, "damping_ratio": 0.0, "displacement_precision": "f8", "interfaces": {"tip": {}},
}


def build():
    """Solid, root interface, tip interface."""
    solid, root, (tip,) = structures.build(parameters.parse_body("panel", TABLE))
    return solid, root, tip


def modes(solid, root, tip, count):
    """`count` orthonormal modes (3N,n) and their squared angular frequencies (n,)."""
    ends = np.concatenate([degrees_of_freedom(root.nodes), degrees_of_freedom(tip.nodes)])
    inner = np.setdiff1d(np.arange(3 * solid.node_count), ends)
    stiffness, mass = solid.stiffness_matrix.tocsr(), solid.mass_matrix.tocsr()
    basis = np.zeros((3 * solid.node_count, count))
    moved = degrees_of_freedom(tip.nodes)
    basis[moved, :6] = rigid_motions(solid.points[tip.nodes] - tip.position)
    held = stiffness[inner][:, inner].tocsc()
    basis[inner, :6] = -scipy.sparse.linalg.splu(held).solve((stiffness[inner][:, moved] @ basis[moved, :6]))
    if count > 6:
        start = np.random.default_rng(0).standard_normal(len(inner))
        _, basis[inner, 6:] = scipy.sparse.linalg.eigsh(held, count - 6, mass[inner][:, inner], sigma=0, v0=start)
    squared, coordinates = scipy.linalg.eigh(basis.T @ (stiffness @ basis), basis.T @ (mass @ basis))
    return with_fixed_sign(basis @ coordinates), squared


def write(folder, counts):
    """Writes panel_N.h5 and panel_N.npz for every N of `counts` and panel.npz with the matrices, unless they are there."""
    if all((folder / f"panel_{count}.h5").is_file() for count in counts):
        return
    folder.mkdir(parents=True, exist_ok=True)
    solid, root, tip = build()
    for name, matrix in (("mass", solid.mass_matrix), ("stiffness", solid.stiffness_matrix)):
        scipy.sparse.save_npz(folder / f"{name}.npz", matrix.tocsr())
    np.savez(folder / "nodes.npz", points=solid.points, root=root.nodes, tip=tip.nodes)
    for count in counts:
        shapes, squared = modes(solid, root, tip, count)
        np.savez(folder / f"panel_{count}.npz", shapes=shapes, squared=squared)
        displacement = shapes.reshape(-1, 3, count).transpose(2, 0, 1)
        data = modal_file.ModalData(
            title=TABLE["title"], generator="scripts/peers/panel.py", boundary="craig-bampton", solid=solid,
            node_mass=inertia.row_sum_masses(solid),
            integrals=inertia.integrals(solid.points, displacement, lambda values: solid.scalar_mass @ values),
            frequency=np.sqrt(squared) / (2 * np.pi), damping_ratio=np.zeros(count), kind=np.full(count, reduction.CRAIG_BAMPTON),
            displacement=displacement, displacement_precision="f8", stress=None, stress_location="node",
            interfaces={"root": (root, "fixed", np.zeros((count, 6))), "tip": (tip, "rbe2", (tip.measure @ shapes).T)},
            geometric_stiffness=None)
        # the name comes last, so that a run that was stopped leaves nothing half done
        partial = folder / f"panel_{count}.h5.partial"
        modal_file.write(partial, data)
        partial.replace(folder / f"panel_{count}.h5")


if __name__ == "__main__":
    write(Path(sys.argv[1]), [int(count) for count in sys.argv[2:]])
