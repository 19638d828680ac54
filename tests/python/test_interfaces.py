"""What a hinge at an interface feels: flexibility, and agreement between the mode sets of one structure."""
import numpy as np
import pytest
from scipy.linalg import eigh

from fem import theory


def flexibility(displacement, frequency):
    """Static flexibility (6,6) of an interface with six-vectors (n,6) of modes with `frequency` (n,) in Hz."""
    return (displacement / ((2 * np.pi * frequency) ** 2)[:, None]).T @ displacement


def cross(vector):
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def rigid_mass(file):
    """Mass matrix (6,6) of the undeformed body about the origin, translations first."""
    mass, center = file["body/mass"], file["body/center_of_mass"]
    return np.block([[mass * np.eye(3), -mass * cross(center)], [mass * cross(center), file["body/inertia"]]])


def test_craig_bampton_boom_has_the_tip_flexibility_of_a_beam(bodies, stored):
    body, file = bodies["boom_craig_bampton"], stored("boom_craig_bampton")
    material, length, area = body.material, body.length, body.width * body.thickness
    shear_modulus = material.young_modulus / (2 * (1 + material.poisson_ratio))
    flap, lag = (material.young_modulus * area * depth ** 2 / 12 for depth in (body.thickness, body.width))
    shear = length / (theory.rectangle_shear_factor(material.poisson_ratio) * shear_modulus * area)
    twist = shear_modulus * theory.rectangle_torsion_constant(body.width, body.thickness)
    expected = [length / (material.young_modulus * area), length ** 3 / (3 * lag) + shear, length ** 3 / (3 * flap) + shear,
                length / twist, length / flap, length / lag]
    ratio = np.diag(flexibility(file["interfaces/tip/displacement"], file["modes/frequency"])) / expected - 1
    # The clamped face stiffens bending by 0.265 % in frequency, so 0.53 % in flexibility, and the mesh adds to neither sign of it;
    # it also holds warping, over a length of about the width: width / length = 2 % in torsion.
    limits = np.array([0.53, 0.53, 0.53, 2.0, 0.53, 0.53]) * 1e-2
    assert (-limits <= ratio).all() and (ratio <= 0).all()


def test_free_panel_held_at_its_root_has_the_cantilever_frequencies(stored):
    free, cantilever = stored("panel_free_free"), stored("panel_cantilever")
    root = free["interfaces/root/displacement"]
    # Held: the rigid motion undoes that of the root, u = sum q_j (phi_j - rigid motion of phi_j's root).
    mass = np.eye(len(root)) + root @ rigid_mass(free) @ root.T
    squared = eigh(np.diag((2 * np.pi * free["modes/frequency"]) ** 2), mass, eigvals_only=True)
    excess = np.sqrt(squared)[:8] / (2 * np.pi) / cantilever["modes/frequency"][:8] - 1
    # Both sets keep the root face rigid, so only truncation differs: 0.0001 % with attachment modes, for modes well below the last normal
    # mode; near it (63 Hz here) attachment modes cannot stand in for the missing normal ones, 0.05 % measured.
    assert (excess >= -1e-9).all(), "a reduced set of the same structure can only be stiffer"
    assert (excess[:3] <= 1e-6).all() and (excess <= 5e-4).all()


def test_free_panel_without_attachment_modes_is_far_too_stiff_when_held(stored):
    free, cantilever = stored("panel_free_free"), stored("panel_cantilever")
    normal = free["modes/kind"] == 0
    root = free["interfaces/root/displacement"][normal]
    mass = np.eye(len(root)) + root @ rigid_mass(free) @ root.T
    squared = eigh(np.diag((2 * np.pi * free["modes/frequency"][normal]) ** 2), mass, eigvals_only=True)
    # 25 % is the known figure for six modes, 13 % for twelve: this is why attachment modes are in the file.
    assert np.sqrt(squared[0]) / (2 * np.pi) / cantilever["modes/frequency"][0] - 1 > 0.13


def test_free_and_craig_bampton_panels_have_the_same_flexibility_from_hinge_to_hinge(stored):
    free, clamped = stored("panel_free_free"), stored("panel_craig_bampton")
    carry = np.eye(6)
    carry[:3, 3:] = -cross(free["interfaces/outboard/position"])
    relative = free["interfaces/outboard/displacement"] - free["interfaces/root/displacement"] @ carry.T
    own = flexibility(relative, free["modes/frequency"])
    other = flexibility(clamped["interfaces/outboard/displacement"], clamped["modes/frequency"])
    # Attachment and constraint modes are both complete for static interface loads, so only rounding is left.
    assert np.abs(own - other).max() <= 1e-9 * np.abs(other).max()


def test_mode_counts_and_kinds_are_those_of_the_set(bodies, stored, name):
    body, kinds = bodies[name], list(stored(name)["modes/kind"])
    expected = {"cantilever": [0] * body.modes, "craig-bampton": [1] * (body.modes + 6), "free-free": [0] * body.modes + [2] * 12}
    assert kinds == expected[body.boundary]


def test_a_face_that_moves_rigidly_measures_its_own_motion(computed):
    data = computed("panel_free_free")
    for interface, _, _ in data.interfaces.values():
        motions = interface.measure @ data.solid.rigid_motions
        carry = np.eye(6)
        carry[:3, 3:] = -cross(interface.position)
        # A least-squares fit of a motion it can represent leaves rounding times the size of the lever arms.
        assert motions == pytest.approx(carry, abs=1e-11)


def test_the_root_face_of_every_set_moves_as_a_rigid_body(stored, name):
    file = stored(name)
    nodes, motion = file["interfaces/root/nodes"], file["interfaces/root/displacement"]
    expected = motion[:, None, :3] + np.cross(motion[:, None, 3:], file["mesh/points"][nodes][None])
    # Shapes are stored in single precision.
    assert np.abs(file["displacement"][:, nodes] - expected).max() <= 2.0 ** -23 * np.abs(file["displacement"]).max()
