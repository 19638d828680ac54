"""Mode sets of a body: cantilever, Craig-Bampton and free-free with attachment modes.

Every set is mass-orthonormal with diagonal stiffness: coordinates after reduction are those of the reduced eigenproblem.
Reduced stiffnesses are taken from the work of unit loads, f' G f, never from products with the stiffness matrix, whose
largest entries would swallow the digits of a thin panel's bending energy.
"""
import dataclasses

import numpy as np
import scipy.sparse as sparse
from scipy.linalg import eigh

from .errors import ModelError
from .modes import elastic_modes, with_fixed_sign

NORMAL, CRAIG_BAMPTON, ATTACHMENT = 0, 1, 2


@dataclasses.dataclass(frozen=True)
class ModeSet:
    """squared_frequency (n,) in rad2/s2 ascending, shapes (3N,n) mass-normalised, kind (n,) as in the modal file."""
    squared_frequency: np.ndarray
    shapes: np.ndarray
    kind: np.ndarray

    @property
    def frequency(self):
        """(n,) in Hz."""
        return np.sqrt(self.squared_frequency) / (2 * np.pi)


def cantilever(solid, held, count):
    """Normal modes with the root clamped."""
    squared, shapes = elastic_modes(held, solid, count)
    return ModeSet(squared, shapes, np.full(count, NORMAL))


def craig_bampton(solid, held, interfaces, count):
    """Fixed-interface modes and six constraint modes for each interface, root clamped, orthonormalised.

    Interfaces are held and moved on average: with C the measured motions and H the flexibility of the root-held body,
    constraint modes are H C' (C H C')^-1 and fixed-interface flexibility is H - H C' (C H C')^-1 C H.
    """
    measure = sparse.vstack([interface.measure for interface in interfaces], "csr")
    loaded = held(measure.T.toarray())
    interface_stiffness = np.linalg.inv(_symmetric(measure @ loaded))
    constraint = loaded @ interface_stiffness

    def fixed_interface(force):
        displacement = held(force)
        return displacement - constraint @ (measure @ displacement)

    squared, fixed = elastic_modes(fixed_interface, solid, count)
    basis = np.hstack([fixed, constraint])
    stiffness = np.zeros((basis.shape[1],) * 2)
    stiffness[range(count), range(count)] = squared
    stiffness[count:, count:] = _symmetric(interface_stiffness)
    # Fixed-interface and constraint modes are orthogonal in stiffness, so no cross terms have to be computed.
    squared, coordinates = eigh(stiffness, _symmetric(basis.T @ (solid.mass_matrix @ basis)))
    return ModeSet(squared, with_fixed_sign(basis @ coordinates), np.full(len(squared), CRAIG_BAMPTON))


def free_free(solid, held, root, interfaces, count):
    """Elastic modes of the free body and six attachment modes for the root and for each interface.

    The root face moves as a rigid body, as it does in the cantilever and Craig-Bampton sets, so that all sets describe
    the same structure. Attachment modes are the deformations by unit loads on an interface balanced by the body's
    inertia; without them a free-free set is much too stiff once it is held at that interface.
    """
    mass, rigid = solid.mass_matrix, solid.rigid_motions
    rigid_momentum = mass @ rigid
    rigid_inertia = rigid.T @ rigid_momentum

    def balanced(force):
        return force - rigid_momentum @ np.linalg.solve(rigid_inertia, rigid.T @ force)

    def mean_axis(displacement):
        return displacement - rigid @ np.linalg.solve(rigid_inertia, rigid_momentum.T @ displacement)

    def flexibility(force):
        # The balanced load needs no reaction, so the clamp only picks one of the solutions that differ by rigid motion.
        return mean_axis(held(balanced(force)))

    squared, normal = elastic_modes(flexibility, solid, count)
    normal = mean_axis(normal)
    unit_loads = np.hstack([interface.measure.T.toarray() for interface in (root, *interfaces)])
    loads = balanced(unit_loads)
    # The modes' share of the loads and responses is taken out, so that what remains is orthogonal to them in mass and stiffness.
    loads = loads - (mass @ normal) @ (normal.T @ loads)
    attachment = mean_axis(held(loads))
    attachment = attachment - normal @ (normal.T @ (mass @ attachment))
    size = np.sqrt(np.einsum("in,in->n", attachment, mass @ attachment))
    attachment, loads = attachment / size, loads / size
    gram = _symmetric(attachment.T @ (mass @ attachment))
    if np.linalg.eigvalsh(gram)[0] < 1e-12:
        raise ModelError("attachment modes depend on each other: interfaces too close together, or too many normal modes")
    residual_squared, coordinates = eigh(_symmetric(loads.T @ attachment), gram)
    residual = mean_axis(attachment @ coordinates)
    return ModeSet(np.concatenate([squared, residual_squared]), with_fixed_sign(np.hstack([normal, residual])),
                   np.concatenate([np.full(count, NORMAL), np.full(len(residual_squared), ATTACHMENT)]))


def _symmetric(matrix):
    return (matrix + matrix.T) / 2
