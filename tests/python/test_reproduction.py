"""A body computed again gives the committed file."""
import numpy as np

from fem import generate, modal_file

# Between processors, linear-algebra kernels and numbers of threads tensors differ by the rounding that the correction in extended
# precision leaves: the condition of a thin body's stiffness, up to 1e12, times 5e-20. Of the sandwich panel 4e-9 was seen, of the others
# 3e-10. Prestress takes differences of displacements of neighbouring nodes, which costs one more digit. On one machine the bytes are the same.
ROUNDING = 1e12 * 5e-20
PRESTRESS_ROUNDING = 10 * ROUNDING


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
    stiffness = data.solid.stiffness_matrix
    quotient = np.einsum("in,in->n", shapes, stiffness @ shapes)
    # the product loses digits: 1e-5, and of thin skins what the rounding of terms up to 1e13 times their sum leaves
    uncancelled = np.einsum("in,in->n", abs(shapes), abs(stiffness) @ abs(shapes))
    allowed = np.maximum(1e-5 * quotient, np.finfo(float).eps * uncancelled)
    assert (abs(quotient - (2 * np.pi * data.frequency) ** 2) <= allowed).all()
    assert (allowed < 2e-3 * quotient).all()


def test_nodes_on_the_surface_corners_and_interfaces_are_numbered_first(name, stored):
    file = stored(name)
    corners = np.unique(file["mesh/surface_triangles"])
    interface_nodes = [file[path] for path in file if path.startswith("interfaces/") and path.endswith("/nodes")]
    leading = np.union1d(corners, np.concatenate(interface_nodes))
    assert np.array_equal(leading, np.arange(len(leading)))
