"""Integrals of density over the body and its modes, and nodal masses.

With x = r + sum_j q_j phi_j these few tensors give every inertia term of the floating frame exactly. They come from
the consistent mass matrix; nodal masses serve validation and loads on nodes.
"""
import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class InertiaIntegrals:
    """mass () kg; static_moment (3,) kg m; squared_moment (3,3) = int rho r r' kg m2; momentum (n,3) = int rho phi_ja;
    first_moment (n,3,3) = int rho r_a phi_jb; second_moment (n,n,3,3) = int rho phi_ja phi_kb."""
    mass: float
    static_moment: np.ndarray
    squared_moment: np.ndarray
    momentum: np.ndarray
    first_moment: np.ndarray
    second_moment: np.ndarray

    @property
    def center_of_mass(self):
        """(3,) in m."""
        return self.static_moment / self.mass

    @property
    def inertia(self):
        """Rotational inertia about the origin (3,3) in kg m2."""
        return np.trace(self.squared_moment) * np.eye(3) - self.squared_moment


def integrals(points, displacements, apply_mass):
    """Integrals of points (N,3) with displacements (n,N,3); apply_mass maps (N,m) to the mass matrix times it."""
    count, nodes = displacements.shape[:2]
    fields = displacements.transpose(1, 2, 0).reshape(nodes, 3 * count)
    positions = np.column_stack([np.ones(nodes), points])
    weighted_fields = apply_mass(fields)
    body = positions.T @ apply_mass(positions)
    mixed = (positions.T @ weighted_fields).reshape(4, 3, count)
    second = (fields.T @ weighted_fields).reshape(3, count, 3, count).transpose(1, 3, 0, 2)
    second = (second + second.transpose(1, 0, 3, 2)) / 2
    return InertiaIntegrals(float(body[0, 0]), body[0, 1:], (body[1:, 1:] + body[1:, 1:].T) / 2,
                            mixed[0].T, mixed[1:].transpose(2, 0, 1), second)


def row_sum_masses(solid):
    """(N,) in kg: row sums of the consistent mass matrix. Total, static moment and every modal momentum are exact; for
    hex27 on bricks this is Simpson's rule, for hex20 corner values are negative: quadrature weights, not particles."""
    return np.asarray(solid.scalar_mass.sum(1)).ravel()
