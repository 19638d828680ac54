"""Faces where hinges sit: their nodes, area weights, and the six-component motion measured on them.

The motion of a face is the area-weighted least-squares rigid motion of its nodes about its centroid (RBE3). It loads the
structure by the transpose, adds no stiffness, and equals the motion of the face wherever the face moves rigidly.
"""
import dataclasses

import numpy as np
import scipy.sparse as sparse
from skfem import BilinearForm, FacetBasis, asm

from .errors import ModelError
from .solid import rigid_motions


@dataclasses.dataclass(frozen=True)
class Interface:
    """nodes (k,), weights (k,) of sum 1, position (3,) in m, measure (6,3N) sparse: nodal displacement to ux uy uz rx ry rz."""
    name: str
    nodes: np.ndarray
    weights: np.ndarray
    position: np.ndarray
    measure: sparse.csr_matrix


def make_interface(solid, name, on_face):
    """Interface on the boundary facets whose midpoints (3,facets) satisfy `on_face`."""
    facets = solid.mesh.facets_satisfying(on_face, boundaries_only=True)
    if not len(facets):
        raise ModelError(f"interface {name}: no element face lies on it")
    basis = FacetBasis(solid.mesh, solid.shape_element, facets=facets, intorder=5)
    nodes = np.unique(basis.get_dofs(facets).all())
    area_matrix = asm(BilinearForm(lambda u, v, w: u * v), basis).tocsr()[nodes][:, nodes]
    node_areas = np.asarray(area_matrix.sum(0)).ravel()
    weights = node_areas / node_areas.sum()
    position = weights @ solid.points[nodes]
    position[np.abs(position) < 1e-12 * np.abs(solid.points).max()] = 0.0       # rounding; the root sits at the origin
    rigid = rigid_motions(solid.points[nodes] - position)
    weighted = sparse.kron(area_matrix, sparse.eye(3)) @ rigid
    fit = np.linalg.solve(rigid.T @ weighted, weighted.T)
    columns = degrees_of_freedom(nodes)
    measure = sparse.csr_matrix((fit.ravel(), (np.repeat(np.arange(6), len(columns)), np.tile(columns, 6))),
                                (6, 3 * solid.node_count))
    return Interface(name, nodes, weights, position, measure)


def degrees_of_freedom(nodes):
    """(3k,) indices of the displacements of nodes (k,)."""
    return (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()
