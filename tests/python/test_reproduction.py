"""A body computed again gives the committed file."""
import numpy as np
import pytest

from fem import generate, modal_file

# Between linear-algebra kernels and numbers of threads tensors differ by up to 3e-10, the conditioning of thin bodies. Prestress takes
# differences of displacements of neighbouring nodes, which costs one more digit: 4e-9. On one machine the bytes are the same.
ROUNDING, PRESTRESS_ROUNDING = 1e-9, 1e-8


def test_a_body_computed_again_has_the_committed_tensors_signs_included(name, stored, computed):
    file, data = stored(name), computed(name)
    integrals = data.integrals
    root_mass, root_inertia = np.sqrt(integrals.mass), np.sqrt(np.linalg.eigvalsh(integrals.inertia).max())
    pairs = {
        "modes/frequency": (data.frequency, file["modes/frequency"]),
        "inertia/momentum": (integrals.momentum, root_mass),
        "inertia/first_moment": (integrals.first_moment, root_inertia),
        "inertia/second_moment": (integrals.second_moment, 1.0),
        "geometric/stiffness": (data.geometric_stiffness, np.abs(data.geometric_stiffness).max()),
    }
    for label, (interface, _, six_vectors) in data.interfaces.items():
        pairs[f"interfaces/{label}/displacement"] = (six_vectors, max(np.abs(six_vectors).max(), 1.0))
    for path, (values, scale) in pairs.items():
        limit = PRESTRESS_ROUNDING if path == "geometric/stiffness" else ROUNDING
        assert np.abs((file[path] - values) / scale).max() <= limit, path


def test_two_computations_give_the_same_bytes(bodies, computed, tmp_path):
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    modal_file.write(first, computed("panel_sandwich"))
    modal_file.write(second, generate.compute(bodies["panel_sandwich"]))
    assert first.read_bytes() == second.read_bytes()


def test_frequencies_are_the_rayleigh_quotients_of_their_shapes(name, computed):
    data = computed(name)
    shapes = data.displacement.transpose(1, 2, 0).reshape(-1, len(data.frequency))
    quotient = np.einsum("in,in->n", shapes, data.solid.stiffness_matrix @ shapes)
    # The product with the stiffness matrix loses digits: entries 1e4 times a row's sum for thin skins, hence 1e-5.
    assert quotient == pytest.approx((2 * np.pi * data.frequency) ** 2, rel=1e-5)


def test_nodes_on_the_surface_corners_and_interfaces_are_numbered_first(name, stored):
    file = stored(name)
    corners = np.unique(file["mesh/surface_triangles"])
    interface_nodes = [file[path] for path in file if path.startswith("interfaces/") and path.endswith("/nodes")]
    leading = np.union1d(corners, np.concatenate(interface_nodes))
    assert np.array_equal(leading, np.arange(len(leading)))
