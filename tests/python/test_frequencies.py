"""Frequencies and effective masses against beam and plate theory.

Bounds are the errors known for these elements and mesh sizes: boom of 40 x 2 x 2 hex27, flap 1 to 3, 0.27, 0.28, 0.31 %; panel of
hex27 of 1/8 m, six bending modes, 2.1 % clamped and 1.0 % free; sandwich of hex20R 0.06 %. They are what the discretisation and the
fully clamped face cost. Solids are stiffer than theory, so errors of hex27 are positive.
"""
import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

from fem import parameters, reduction, report, structures, theory
from fem.modes import RootHeld


@pytest.fixture
def summary(bodies, modes_folder):
    return lambda name: report.summarise(bodies[name], modes_folder / f"{name}.h5")


def errors(summary, family):
    """Percent above theory of the modes of one family that have a theory."""
    chosen = [mode for mode, own in enumerate(summary.families) if own == family and np.isfinite(summary.theory[mode])]
    return summary.error[chosen]


def test_boom_flap_frequencies_are_within_the_error_of_their_mesh(summary):
    # The bounds are quoted to two digits: half a unit of the last one is added.
    assert (np.abs(errors(summary("boom_cantilever"), "flap")[:3]) <= np.array([0.27, 0.28, 0.31]) + 0.005).all()


def test_boom_lag_frequencies_are_no_worse_than_flap(summary):
    # Two elements across the wider side bend over the same lengths, with less shear locking.
    item = summary("boom_cantilever")
    assert (errors(item, "lag")[:3] < errors(item, "flap")[:3]).all()


def test_craig_bampton_boom_adds_at_most_a_third_of_a_percent_to_eight_cantilever_modes(stored):
    # Six fixed-interface and six constraint modes: +0.002 to 0.33 % is the truncation measured for eight modes.
    excess = stored("boom_craig_bampton")["modes/frequency"][:8] / stored("boom_cantilever")["modes/frequency"][:8] - 1
    assert (excess > 0).all(), "a reduction of the same structure can only stiffen it"
    assert excess.max() <= 0.335e-2


def test_clamped_panel_bending_frequencies_are_within_the_error_of_their_mesh(summary):
    error = errors(summary("panel_cantilever"), "bending")
    assert len(error) >= 6
    assert 0 < error[:6].min() and error[:6].max() <= 2.1


def test_free_panel_bending_frequencies_are_within_the_error_of_their_mesh(summary):
    error = errors(summary("panel_free_free"), "bending")
    assert len(error) >= 6
    assert 0 < error[:6].min() and error[:6].max() <= 1.0


def test_sandwich_bending_frequencies_are_within_the_error_of_their_mesh(summary):
    error = errors(summary("panel_sandwich"), "bending")
    assert len(error) >= 6
    assert np.abs(error[:6]).max() <= 0.06


def test_panel_is_a_light_appendage_of_low_frequency(stored):
    panel = stored("panel_cantilever")
    assert 8.0 <= panel["body/mass"] <= 12.0
    assert 1.0 <= panel["modes/frequency"][0] <= 3.0


def test_effective_masses_of_boom_flap_modes_are_those_of_a_cantilever(summary):
    item = summary("boom_cantilever")
    flap = [mode for mode, family in enumerate(item.families) if family == "flap"][:3]
    # Euler-Bernoulli values; shear and the clamped face change them by up to 0.08 percentage points (61.23, 18.81, 6.47 measured).
    assert np.abs(item.effective[flap, 2] - [61.31, 18.83, 6.47]).max() <= 0.085


def test_mass_properties_are_those_of_bricks(bodies, stored, name):
    body, file = bodies[name], stored(name)

    def brick(density, thickness):
        mass = density * body.length * body.width * thickness
        along, across, through = body.length ** 2 / 3, body.width ** 2 / 12, thickness ** 2 / 12
        return np.array([mass, *(mass * np.array([across + through, along + through, along + across]))])

    expected = brick(body.material.density, body.thickness)
    if body.core is not None:
        # A sandwich is a brick of skin with a brick of core in place of its inside.
        inside = body.thickness - 2 * body.skin_thickness
        expected += brick(body.core.density, inside) - brick(body.material.density, inside)
    # Quadratic elements integrate these polynomials exactly; sums of some thousand terms leave rounding.
    assert file["body/mass"] == pytest.approx(expected[0], rel=1e-12)
    assert file["body/center_of_mass"] == pytest.approx([body.length / 2, 0, 0], abs=1e-12 * body.length)
    assert file["body/inertia"] == pytest.approx(np.diag(expected[1:]), abs=1e-12 * expected.max())


def test_thin_mindlin_plate_tends_to_the_converged_kirchhoff_value():
    # Clamped square cantilever, w a^2 sqrt(m / D) = 3.4710 converged (Leissa's 3.4917 is an upper bound); printed to five digits,
    # plus the shear of a plate of thickness a / 500, which lowers the frequency by about 1e-4.
    thickness, shear_modulus = 1 / 500, 1 / 2.6
    section = theory.PlateSection(thickness ** 3 / 12 / 0.91, 5 / 6 * shear_modulus * thickness, 0.3, thickness, thickness ** 3 / 12)
    frequency = theory.mindlin_frequencies(section, 1.0, 1.0, 1, "clamped")[0]
    value = 2 * np.pi * frequency * np.sqrt(section.mass / section.bending)
    assert value == pytest.approx(3.4710, rel=1e-3)


def test_slender_timoshenko_beam_tends_to_the_euler_bernoulli_roots():
    section = theory.BeamSection(bending=1.0, shear=1e5, mass=1.0, rotary=1e-6)
    for held, roots in ((True, [1.8751040687, 4.6940911330]), (False, [4.7300407449, 7.8532046241])):
        squares = np.square(roots)
        ratio = 2 * np.pi * theory.timoshenko_frequencies(section, 1.0, 2, held) / squares
        # Shear and rotary inertia lower a frequency by a share of the order of root^2 (EI / shear + rotary inertia / mass).
        assert (ratio < 1).all() and (1 - ratio <= 2 * squares * (1 / section.shear + section.rotary)).all()


def test_a_rigid_edge_leaves_the_plate_three_rigid_motions_and_lies_between_free_and_clamped():
    section = theory.PlateSection(1.0, 1e4, 0.3, 1.0, 1e-4)
    free, rigid = (theory.mindlin_frequencies(section, 2.0, 1.0, 4, edge) for edge in ("free", "rigid"))
    clamped = theory.mindlin_frequencies(section, 2.0, 1.0, 7, "clamped")
    # Interlacing: a rigid edge only constrains the free plate, and a clamp takes three further freedoms of bending.
    assert (rigid >= free * (1 - 1e-9)).all()
    assert (rigid >= clamped[:4]).all() and (rigid <= clamped[3:] * (1 + 1e-9)).all()


TABLE_PANEL = {"length": 1.5, "material": {"young_modulus": 70e9, "poisson_ratio": 0.3, "density": 2700.0}, "end_refinement": 0.0,
               "interfaces": {"outboard": {}}}


@pytest.mark.parametrize("base, change, family, bounds", [
    ("boom_cantilever", {"mesh": [20, 2, 2]}, "flap", [0.52, 0.64, 0.87]),
    ("boom_cantilever", {"mesh": [20, 2, 2], "element": "hex20R"}, "flap", [0.29, 0.29, 0.30]),
    ("panel_cantilever", {**TABLE_PANEL, "mesh": [12, 8, 1]}, "bending", [2.1] * 6),
    ("panel_cantilever", {**TABLE_PANEL, "mesh": [24, 16, 1]}, "bending", [0.45] * 6),
    ("panel_free_free", {**TABLE_PANEL, "mesh": [24, 16, 1]}, "bending", [0.45] * 6),
    ("panel_sandwich", {"length": 1.5, "mesh": [12, 8, 3], "interfaces": {"outboard": {}}}, "bending", [0.06] * 6),
])
def test_other_meshes_reach_the_errors_known_for_them(base, change, family, bounds, tables):
    # A free panel with a rigid edge is restrained along it like a clamped one and has the clamped bound.
    body = parameters.parse_body(base, {**tables[base], **change, "modes": 8})
    solid, root, others = structures.build(body)
    held = RootHeld(solid, root)
    if body.boundary == "free-free":
        modes = reduction.free_free(solid, held, root, others, body.modes)
    else:
        modes = reduction.cantilever(solid, held, body.modes)
    frequency = in_family(body, solid, modes.squared_frequency, modes.shapes, family)[:len(bounds)]
    reference = structures.reference_frequencies(body, len(bounds))[family]
    # Bounds are quoted to two digits: half a unit of the last one is added.
    margin = np.where(np.array(bounds) > 1, 0.05, 0.005)
    assert (100 * np.abs(frequency / reference - 1) <= bounds + margin).all()


@pytest.mark.parametrize("mesh, bound", [([12, 8, 1], 1.0 + 0.05), ([24, 16, 1], 0.20 + 0.005)])
def test_a_panel_without_any_support_has_six_rigid_motions_and_the_error_known_for_its_mesh(mesh, bound, tables):
    # The solid alone, by a shifted eigenproblem that shares nothing with the reductions; the shift is that of the first elastic mode.
    body = parameters.parse_body("panel_free_free", {**tables["panel_free_free"], **TABLE_PANEL, "mesh": mesh})
    solid, _, _ = structures.build(body)
    reference = theory.mindlin_frequencies(structures.plate_section(body), body.length, body.width, 6, "free")
    shift = (2 * np.pi * reference[0]) ** 2
    squared, shapes = eigsh(solid.stiffness_matrix, k=14, M=solid.mass_matrix, sigma=-shift, v0=np.ones(3 * solid.node_count))
    order = np.argsort(squared)
    squared, shapes = squared[order], shapes[:, order]
    assert np.abs(squared[:6]).max() < 1e-6 * shift < squared[6]
    frequency = in_family(body, solid, squared[6:], shapes[:, 6:], "bending")[:6]
    assert 100 * np.abs(frequency / reference - 1).max() <= bound


def in_family(body, solid, squared, shapes, family):
    """Frequencies in Hz of the modes of one family."""
    fields = shapes.reshape(-1, 3, len(squared))
    energy = np.einsum("iaj,iaj->ja", fields, (solid.mass_matrix @ shapes).reshape(fields.shape))
    return np.sqrt(squared[[own == family for own in structures.families(body, energy)]]) / (2 * np.pi)
