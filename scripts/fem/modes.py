"""Static flexibility of a structure held at its root, and elastic eigenmodes from flexibility operators.

Cantilever, fixed-interface and free-free modes are all found from one factorisation, that of the stiffness with
the root face clamped: each is an eigenproblem u = w^2 G M u with its own flexibility operator G. No shift has to be
chosen, which for a free body would cost digits, and rigid-body motions are in the null space of G and never appear.
"""
import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from .errors import ModelError
from .interfaces import degrees_of_freedom


class RootHeld:
    """Displacements (3N,...) under nodal forces (3N,...) with the root nodes clamped.

    A thin body's stiffness is conditioned like 1e10 to 1e12, so a plain solution keeps four to six digits that depend on the
    linear-algebra library. One correction by the residual in extended precision makes the solution, and with it the
    modal file, the same wherever it is made.
    """

    def __init__(self, solid, root):
        self.free = np.setdiff1d(np.arange(3 * solid.node_count), degrees_of_freedom(root.nodes))
        self._matrix = solid.stiffness_matrix[self.free][:, self.free].tocsr()
        self._entries = self._matrix.data.astype(np.longdouble)
        try:
            self._factor = splu(self._matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                                options={"SymmetricMode": True})
        except RuntimeError as error:
            raise ModelError(f"the stiffness with the root held cannot be factorised: {error}") from error

    def __call__(self, force):
        displacement = np.zeros(force.shape)
        if force.ndim == 2:
            for column in range(force.shape[1]):
                displacement[:, column] = self(force[:, column])
            return displacement
        load = np.ascontiguousarray(force[self.free])
        solution = self._factor.solve(load)
        displacement[self.free] = solution + self._factor.solve(self._residual(load, solution))
        return displacement

    def _residual(self, load, solution):
        products = self._entries * solution[self._matrix.indices]
        return (load - np.add.reduceat(products, self._matrix.indptr[:-1])).astype(float)


def elastic_modes(flexibility, solid, count):
    """The `count` lowest modes of u = w^2 G M u: squared angular frequencies (n,) and mass-normalised shapes (3N,n).

    The start vector and the signs are fixed, so that a rerun gives the same modes.
    """
    mass = solid.mass_matrix
    operator = LinearOperator(mass.shape, matvec=flexibility, dtype=float)
    start = flexibility(mass @ np.random.default_rng(0).standard_normal(mass.shape[0]))
    squared, shapes = eigsh(solid.stiffness_matrix, k=count, M=mass, sigma=0.0, OPinv=operator, v0=start, tol=1e-14)
    order = np.argsort(squared)
    squared, shapes = squared[order], shapes[:, order]
    # A zero-energy pattern of the mesh would come out as a "mode" ten or more decades below the others.
    if squared[0] < 1e-9 * squared[-1]:
        raise ModelError(f"the mesh has zero-energy modes: squared frequencies {squared[0]:.3g} ... {squared[-1]:.3g}")
    return squared, with_fixed_sign(mass_normalised(shapes, mass))


def mass_normalised(shapes, mass):
    """Shapes (3N,n) scaled to unit modal mass."""
    return shapes / np.sqrt(np.einsum("in,in->n", shapes, mass @ shapes))


def with_fixed_sign(shapes):
    """Shapes (3N,n) whose largest entry is positive; among entries equal to rounding the first decides."""
    size = np.abs(shapes)
    first = np.argmax(size > (1 - 1e-6) * size.max(0), axis=0)
    return shapes * np.sign(shapes[first, np.arange(shapes.shape[1])])
