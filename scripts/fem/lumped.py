"""Nodal masses of a model that comes without its mass matrix: integrals, orthonormalisation, rigid fits of interfaces.

What a lumped model cannot know is told in figures, so that a report can predict the error of a load: how far mass and
inertia are from those that the code states, and how far the modes are from orthonormal in these masses.
"""
import dataclasses

import numpy as np

from .errors import ModelError
from .inertia import integrals
from .solid import rigid_motions

# Off-diagonal modal mass, relative to the diagonal, above which modes and masses cannot belong to one model.
_FOREIGN = 0.1
# Order of the six stored components of a nodal inertia, as the modal file has them: xx yy zz xy yz xz.
_SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


@dataclasses.dataclass(frozen=True)
class LumpedMass:
    """mass (N,) in kg; rotary (N,3,3) in kg m2 about the nodes, or None."""
    mass: np.ndarray
    rotary: np.ndarray | None = None

    def modal_mass(self, displacement, rotation):
        """(n,n) of shapes (n,N,3) and, where masses have inertia of their own, of nodal rotations (n,N,3)."""
        count = len(displacement)
        flat = displacement.reshape(count, -1)
        result = (displacement * self.mass[:, None]).reshape(count, -1) @ flat.T
        if self.rotary is not None:
            turning = np.einsum("nab,jnb->jna", self.rotary, rotation).reshape(count, -1)
            result = result + turning @ rotation.reshape(count, -1).T
        return (result + result.T) / 2

    def integrals(self, points, displacement):
        """InertiaIntegrals of translations alone; what nodal inertias add is in `rotary_inertia` and `angular_momentum`."""
        return integrals(points, displacement, lambda values: self.mass[:, None] * values)

    @property
    def rotary_inertia(self):
        """(3,3): sum of the nodes' own inertias."""
        return np.zeros((3, 3)) if self.rotary is None else self.rotary.sum(0)

    def angular_momentum(self, integrals_of_translation, rotation):
        """(n,3): eps : Q and, where there is any, the nodes' own part."""
        first = integrals_of_translation.first_moment
        result = np.stack([first[:, 1, 2] - first[:, 2, 1], first[:, 2, 0] - first[:, 0, 2], first[:, 0, 1] - first[:, 1, 0]], axis=1)
        return result if self.rotary is None else result + np.einsum("nab,jnb->ja", self.rotary, rotation)

    @property
    def rotary_components(self):
        """(N,6) as stored, or None."""
        return None if self.rotary is None else np.stack([self.rotary[:, i, j] for i, j in _SIX], axis=1)


def rotary_matrices(components):
    """(N,3,3) of components (N,6) xx yy zz xy yz xz."""
    result = np.zeros((len(components), 3, 3))
    for value, (i, j) in zip(np.asarray(components, float).T, _SIX):
        result[:, i, j] = result[:, j, i] = value
    return result


@dataclasses.dataclass(frozen=True)
class Orthonormal:
    """Shapes of unit modal mass in the masses at hand; `change` is the largest departure that was taken out."""
    displacement: np.ndarray
    rotation: np.ndarray | None
    transform: np.ndarray
    change: float


def orthonormalise(masses, displacement, rotation, scaled):
    """Symmetric (Loewdin) orthonormalisation, the smallest change that does it; frequencies stay those of the solver.

    scaled: whether the code claims unit modal mass, so that the diagonal counts as a departure as well.
    """
    gram = masses.modal_mass(displacement, rotation)
    size = np.sqrt(np.diag(gram))
    if not (size > 0).all():
        raise ModelError(f"mode {int(np.argmin(size)) + 1}: no mass moves in it; check the nodal masses and the node numbers")
    correlation = gram / np.outer(size, size)
    off = np.abs(correlation - np.eye(len(gram)))
    if off.max() > _FOREIGN:
        first, second = np.unravel_index(off.argmax(), off.shape)
        raise ModelError(f"modes {first + 1} and {second + 1}: modal mass off the diagonal is {off.max():.2g} of the diagonal, expected below "
                         f"{_FOREIGN}; these masses are not those of the modes: check node numbers, units, and that no mass is left out")
    change = max(off.max(), np.abs(np.diag(gram) - 1).max()) if scaled else off.max()
    values, vectors = np.linalg.eigh(correlation)
    transform = (vectors / np.sqrt(values)) @ vectors.T / size[:, None]
    apply = lambda shapes: None if shapes is None else np.tensordot(transform.T, shapes, 1)
    return Orthonormal(apply(displacement), apply(rotation), transform, float(change))


def without_rigid_motion(masses, points, displacement, rotation):
    """Shapes less their rigid-body part in these masses, as free-free modes must be, and the largest part taken out (of the norm)."""
    rigid = rigid_motions(points).reshape(len(points), 3, 6).transpose(2, 0, 1)
    turned = np.zeros((6, len(points), 3))
    turned[3:] = np.eye(3)[:, None, :]
    whole = np.concatenate([rigid, displacement])
    spun = None if masses.rotary is None else np.concatenate([turned, rotation])
    gram = masses.modal_mass(whole, spun)
    part = np.linalg.solve(gram[:6, :6], gram[:6, 6:])
    share = np.sqrt(np.einsum("rj,rs,sj->j", part, gram[:6, :6], part) / np.diag(gram)[6:])
    clean = displacement - np.tensordot(part.T, rigid, 1)
    return clean, None if rotation is None else rotation - np.tensordot(part.T, turned, 1), share


def rigid_fit(points, position, weights, displacement):
    """(n,6): weighted least-squares rigid motion about `position` of nodes at points (k,3) that move by displacement (n,k,3)."""
    rigid = rigid_motions(points - position)
    weight = np.repeat(weights, 3)[:, None]
    normal = rigid.T @ (weight * rigid)
    if np.linalg.cond(normal) > 1e10:
        raise ModelError("nodes lie on one line or in one point, so that their rotation cannot be measured; add nodes, or name one node with rotations")
    return np.linalg.solve(normal, (weight * rigid).T @ displacement.reshape(len(displacement), -1).T).T
