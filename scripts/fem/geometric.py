"""Geometric stiffness of a body under unit motions of its frame, projected on the modes.

A frame motion loads the body by -rho a(r); with the root held this prestresses it linearly, and the prestress stiffens
it in proportion. Softening by rotation is not part of it: that follows from the second moment of the modes.
"""
import numpy as np
from skfem import BilinearForm, asm

LOADS = ("acc_x", "acc_y", "acc_z", "alpha_x", "alpha_y", "alpha_z",
         "omega_xx", "omega_yy", "omega_zz", "omega_xy", "omega_yz", "omega_xz")


def unit_accelerations(points):
    """Yields (N,3) fields in the order of LOADS: unit acceleration, angular acceleration, and w x (w x r) for each
    product of angular-velocity components set to one."""
    for direction in np.eye(3):
        yield np.broadcast_to(direction, points.shape)
    for direction in np.eye(3):
        yield np.cross(direction, points)
    for first, second in ("xx", "yy", "zz", "xy", "yz", "xz"):
        i, j = "xyz".index(first), "xyz".index(second)
        field = np.zeros_like(points)
        field[:, i] += points[:, j]
        if i == j:
            field -= points
        else:
            field[:, j] += points[:, i]
        yield field


def modal_geometric_stiffness(solid, held, shapes, advance):
    """(12,n,n) for shapes (3N,n); advance() is called after each load."""
    matrices = []
    for field in unit_accelerations(solid.points):
        prestress = solid.stress_at_quadrature(held(-(solid.mass_matrix @ field.ravel())), solid.stiffness_basis)

        @BilinearForm
        def form(u, v, w, stress=prestress):
            return sum(stress[i, j] * v.grad[i] * u.grad[j] for i in range(3) for j in range(3))
        scalar = asm(form, solid.stiffness_basis).tocsr()
        matrix = sum(shapes[axis::3].T @ (scalar @ shapes[axis::3]) for axis in range(3))
        matrices.append((matrix + matrix.T) / 2)
        advance()
    return np.array(matrices)
