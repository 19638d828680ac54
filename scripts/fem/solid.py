"""Linear-elastic solid of hexahedra: stiffness, mass, rigid-body vectors, connectivity in VTK order.

Matrices are assembled from scalar blocks, K_ab = int C_aibj dN/dx_i dN/dx_j and M = M_scalar (x) I3. They are the
matrices of a vector element, come eight times faster, and take any orthotropic material per cell.
"""
import numpy as np
import scipy.sparse as sparse
from skfem import Basis, BilinearForm, ElementHex2, ElementHexS2, asm

# Order of six-component tensors, as VTK stores them: xx yy zz xy yz xz.
TENSOR_COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))

_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
# Corners of the six faces, counter-clockwise seen from outside, in VTK's order of face nodes.
HEXAHEDRON_FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))

# Gauss points per direction: three integrate the mass of quadratic hexahedra on bricks exactly; two for the stiffness
# of the twenty-node element ("20R"), which is what keeps thin layers from locking.
_FULL_ORDER, _REDUCED_ORDER = 5, 3


class Element:
    """One element type: its scikit-fem element, quadrature order of the stiffness, and names in other programs."""

    def __init__(self, make, stiffness_order, cell_type, vtk_type, node_mass_kind):
        self.make, self.stiffness_order = make, stiffness_order
        self.cell_type, self.vtk_type, self.node_mass_kind = cell_type, vtk_type, node_mass_kind


ELEMENTS = {
    "hex27": Element(ElementHex2, _FULL_ORDER, "hexahedron27", 29, "row_sum"),
    "hex20R": Element(ElementHexS2, _REDUCED_ORDER, "hexahedron20", 25, "row_sum_signed"),
}


def isotropic_stiffness(young_modulus, poisson_ratio):
    """Elasticity tensor C_ijkl (3,3,3,3) in Pa."""
    shear = young_modulus / (2 * (1 + poisson_ratio))
    lame = 2 * shear * poisson_ratio / (1 - 2 * poisson_ratio)
    delta = np.eye(3)
    return (lame * np.einsum("ij,kl->ijkl", delta, delta)
            + shear * (np.einsum("ik,jl->ijkl", delta, delta) + np.einsum("il,jk->ijkl", delta, delta)))


def honeycomb_stiffness(core):
    """Elasticity tensor (3,3,3,3) in Pa of a honeycomb core: uncoupled normal stiffnesses and three shear moduli."""
    stiffness = np.zeros((3, 3, 3, 3))
    for axis, modulus in enumerate((core.in_plane_modulus, core.in_plane_modulus, core.thickness_modulus)):
        stiffness[axis, axis, axis, axis] = modulus
    shear = {(0, 1): core.in_plane_modulus / 2, (0, 2): core.shear_modulus_xz, (1, 2): core.shear_modulus_yz}
    for (i, j), modulus in shear.items():
        for indices in ((i, j, i, j), (i, j, j, i), (j, i, i, j), (j, i, j, i)):
            stiffness[indices] = modulus
    return stiffness


class Solid:
    """A meshed solid.

    mesh: skfem.MeshHex in m. stiffness: elasticity tensors (3,3,3,3,E) in Pa. density: (E,) in kg/m3.
    Attributes: points (N,3); stiffness_matrix (3N,3N); scalar_mass (N,N) and mass_matrix (3N,3N), consistent;
    rigid_motions (3N,6), three translations and three rotations about the origin; cells (E,k) in VTK order.
    """

    def __init__(self, mesh, stiffness, density, element):
        self.mesh, self.element = mesh, element
        self.stiffness, self.density = stiffness, density
        self.shape_element = element.make()
        self.basis = Basis(mesh, self.shape_element, intorder=_FULL_ORDER)
        self.stiffness_basis = Basis(mesh, self.shape_element, intorder=element.stiffness_order)
        self.points = np.ascontiguousarray(self.basis.doflocs.T)
        self.node_count = len(self.points)
        self.stiffness_matrix = self._assemble_stiffness()
        density_at_quadrature = density[:, None]
        self.scalar_mass = asm(BilinearForm(lambda u, v, w: density_at_quadrature * u * v), self.basis).tocsr()
        self.mass_matrix = sparse.kron(self.scalar_mass, sparse.eye(3), "csr")
        self.rigid_motions = rigid_motions(self.points)
        self.cells = self._cells_in_vtk_order()

    def _assemble_stiffness(self):
        blocks = [[None] * 3 for _ in range(3)]
        for row in range(3):
            for column in range(row, 3):
                blocks[row][column] = self._stiffness_block(row, column)
                blocks[column][row] = blocks[row][column].T
        node_major = np.arange(3 * self.node_count).reshape(3, -1).T.ravel()
        matrix = sparse.bmat(blocks, "csr")[node_major][:, node_major]
        return ((matrix + matrix.T) * 0.5).tocsr()

    def _stiffness_block(self, row, column):
        tensor = self.stiffness[row, :, column, :]
        present = [(i, j) for i in range(3) for j in range(3) if np.any(tensor[i, j])]

        @BilinearForm
        def form(u, v, w):
            return sum(tensor[i, j][:, None] * v.grad[i] * u.grad[j] for i, j in present)
        return asm(form, self.stiffness_basis)

    def _cells_in_vtk_order(self):
        """(E,k) node numbers. Cells of negative volume are mirrored, so that every reader sees positive volumes."""
        reference = np.array([*_CORNERS, *(_CORNERS[list(edge)].mean(0) for edge in _EDGES),
                              *(_CORNERS[list(face)].mean(0) for face in HEXAHEDRON_FACES), [0.5, 0.5, 0.5]])
        local = np.asarray(self.shape_element.doflocs)
        reference = reference[:len(local)]
        cells = self.basis.element_dofs[_nearest(reference, local)].T.copy()
        corners = self.points[cells[:, [0, 1, 3, 4]]]
        along = corners[:, 1:] - corners[:, :1]
        mirrored = np.einsum("ei,ei->e", np.cross(along[:, 0], along[:, 1]), along[:, 2]) < 0
        reflection = _nearest(reference * [1, 1, -1] + [0, 0, 1], reference)
        cells[mirrored] = cells[mirrored][:, reflection]
        return cells

    @property
    def cell_volumes(self):
        """(E,) in m3."""
        return np.abs(self.basis.dx).sum(1)

    def displacement_gradient(self, displacement, basis):
        """du_a/dx_i (3,3,E,quadrature points) of a displacement vector (3N,)."""
        return np.array([basis.interpolate(np.ascontiguousarray(displacement[axis::3])).grad for axis in range(3)])

    def stress_at_quadrature(self, displacement, basis):
        """Cauchy stress (3,3,E,quadrature points) in Pa of a displacement vector (3N,)."""
        return np.einsum("aibje,bjeq->aieq", self.stiffness, self.displacement_gradient(displacement, basis))


def _nearest(wanted, available):
    """Index in `available` of every point in `wanted`; the two sets hold the same points."""
    distance = np.linalg.norm(wanted[:, None] - available[None], axis=2)
    assert distance.min(1).max() < 1e-12, "element nodes are not where VTK expects them"
    return distance.argmin(1)


def rigid_motions(points):
    """(3k,6): displacements of points (k,3) by unit translations and unit small rotations about the origin."""
    motions = np.zeros((len(points), 3, 6))
    motions[:, range(3), range(3)] = 1.0
    for axis, direction in enumerate(np.eye(3)):
        motions[:, :, 3 + axis] = np.cross(direction, points)
    return motions.reshape(-1, 6)
