"""Stress tensors of displacement fields, at nodes or in cells, from the 2 x 2 x 2 Gauss points where they are most accurate.

Tensors are linear in the modal coordinates; von Mises stress is not and must be taken of the summed tensor.
"""
import numpy as np
from skfem import Basis, ElementHex1

from .solid import TENSOR_COMPONENTS


class StressRecovery:
    """Recovers tensors with components xx yy zz xy yz xz in Pa."""

    def __init__(self, solid):
        gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)
        points = np.array(np.meshgrid(gauss, gauss, gauss, indexing="ij")).reshape(3, -1)
        self.solid = solid
        self.basis = Basis(solid.mesh, solid.shape_element, quadrature=(points, np.full(8, 1 / 8)))
        self.extrapolate = _trilinear(np.asarray(solid.shape_element.doflocs).T) @ np.linalg.inv(_trilinear(points))
        self.volumes = solid.cell_volumes
        self.node_volumes = np.zeros(solid.node_count)
        np.add.at(self.node_volumes, self.basis.element_dofs, np.tile(self.volumes, (len(self.extrapolate), 1)))

    def at_nodes(self, displacement):
        """(N,6): extrapolated to the nodes of each cell, then averaged by volume. For bodies of one material only:
        across a layer boundary the in-plane stress jumps, and an average would belong to neither layer."""
        stress = self.solid.stress_at_quadrature(displacement, self.basis)
        nodal = np.zeros((self.solid.node_count, 6))
        for component, (i, j) in enumerate(TENSOR_COMPONENTS):
            np.add.at(nodal[:, component], self.basis.element_dofs, (self.extrapolate @ stress[i, j].T) * self.volumes)
        return nodal / self.node_volumes[:, None]

    def in_cells(self, displacement):
        """(E,6): mean over each cell."""
        stress = self.solid.stress_at_quadrature(displacement, self.basis)
        return np.stack([stress[i, j].mean(1) for i, j in TENSOR_COMPONENTS], axis=1)


def _trilinear(points):
    """(k,8): linear hexahedron shape functions at reference points (3,k)."""
    element = ElementHex1()
    return np.array([element.lbasis(points, node)[0] for node in range(8)]).T
