"""Boom, panel and sandwich: mesh, material and interfaces of a body, and the theory its frequencies are held against."""
import numpy as np
from skfem import MeshHex

from . import theory
from .interfaces import make_interface
from .solid import ELEMENTS, Solid, honeycomb_stiffness, isotropic_stiffness

# A mode belongs to an axis when this share of its kinetic energy moves along it.
_DOMINANT_SHARE = 0.9


def build(body):
    """Solid, root interface and tuple of the other interfaces of a `Body`. The root is the whole face x = 0."""
    heights = _layer_heights(body)
    station = np.linspace(0, 1, body.mesh[0] + 1)
    station -= body.end_refinement * np.sin(2 * np.pi * station) / (2 * np.pi)
    mesh = MeshHex.init_tensor(body.length * station,
                               np.linspace(-body.width / 2, body.width / 2, body.mesh[1] + 1), heights)
    stiffness = np.broadcast_to(isotropic_stiffness(body.material.young_modulus, body.material.poisson_ratio)[..., None],
                                (3, 3, 3, 3, mesh.nelements))
    density = np.full(mesh.nelements, body.material.density)
    if body.core is not None:
        in_core = np.abs(mesh.p[2, mesh.t].mean(0)) < body.thickness / 2 - body.skin_thickness
        stiffness = np.where(in_core, honeycomb_stiffness(body.core)[..., None], stiffness)
        density = np.where(in_core, body.core.density, density)
    solid = Solid(mesh, stiffness, density, ELEMENTS[body.element])
    margin = 1e-6 * body.length
    root = make_interface(solid, "root", lambda x: x[0] < margin)
    others = tuple(
        make_interface(solid, patch.name, lambda x, patch=patch: (x[0] > body.length - margin)
                       & (np.abs(x[1] - patch.center_y) < patch.width / 2))
        for patch in body.interfaces)
    return solid, root, others


def _layer_heights(body):
    half = body.thickness / 2
    if body.core is None:
        return np.linspace(-half, half, body.mesh[2] + 1)
    return np.array([-half, body.skin_thickness - half, half - body.skin_thickness, half])


def stress_is_nodal(body):
    """Whether stress is continuous enough to average at nodes: within one material."""
    return body.core is None


def reference_name(body):
    """What the frequencies are compared with, for tables."""
    if body.kind == "boom":
        return "Timoshenko beam and uniform rods"
    edge = "rigid root edge" if body.boundary == "free-free" else "clamped root edge"
    return f"{'sandwich Mindlin' if body.core is not None else 'Mindlin'} plate, {edge}"


def families(body, energy_share):
    """(n,) names of mode families from energy_share (n,3), the part of the kinetic energy along x, y and z."""
    names = ("axial", "lag", "flap") if body.kind == "boom" else ("in-plane", "in-plane", "bending")
    mixed = "torsion" if body.kind == "boom" else "in-plane"
    dominant = energy_share.argmax(1)
    return [names[axis] if share[axis] > _DOMINANT_SHARE else mixed for axis, share in zip(dominant, energy_share)]


def reference_frequencies(body, count):
    """Theory by family: name -> (count,) in Hz. Families without a theory are absent."""
    held = body.boundary != "free-free"
    if body.kind == "boom":
        return _boom_reference(body, count, held)
    edge = "clamped" if held else "rigid"
    return {"bending": theory.mindlin_frequencies(plate_section(body), body.length, body.width, count, edge)}


def _boom_reference(body, count, held):
    material, area = body.material, body.width * body.thickness
    shear_modulus = material.young_modulus / (2 * (1 + material.poisson_ratio))
    polar = area * (body.width ** 2 + body.thickness ** 2) / 12
    torsion_constant = theory.rectangle_torsion_constant(body.width, body.thickness)
    twist_speed = np.sqrt(shear_modulus * torsion_constant / (material.density * polar))
    axial_speed = np.sqrt(material.young_modulus / material.density)
    return {
        "flap": theory.timoshenko_frequencies(beam_section(body, body.thickness), body.length, count, held),
        "lag": theory.timoshenko_frequencies(beam_section(body, body.width), body.length, count, held),
        "torsion": theory.rod_frequencies(twist_speed, body.length, count, held),
        "axial": theory.rod_frequencies(axial_speed, body.length, count, held),
    }


def beam_section(body, depth):
    """Section of a boom that bends over `depth`, its width or its thickness (m)."""
    material, area = body.material, body.width * body.thickness
    second_moment = area * depth ** 2 / 12
    shear_modulus = material.young_modulus / (2 * (1 + material.poisson_ratio))
    return theory.BeamSection(material.young_modulus * second_moment,
                              theory.rectangle_shear_factor(material.poisson_ratio) * shear_modulus * area,
                              material.density * area, material.density * second_moment)


def plate_section(body):
    """Section of a panel; for a sandwich the skins bend and the core shears."""
    material = body.material
    plane = material.young_modulus / (1 - material.poisson_ratio ** 2)
    if body.core is None:
        shear_modulus = material.young_modulus / (2 * (1 + material.poisson_ratio))
        return theory.PlateSection(plane * body.thickness ** 3 / 12, 5 / 6 * shear_modulus * body.thickness,
                                   material.poisson_ratio, material.density * body.thickness,
                                   material.density * body.thickness ** 3 / 12)
    skin, core = body.skin_thickness, body.thickness - 2 * body.skin_thickness
    arm = (core + skin) / 2
    return theory.PlateSection(2 * plane * (skin * arm ** 2 + skin ** 3 / 12),
                               body.core.shear_modulus_xz * (core + skin) ** 2 / core, material.poisson_ratio,
                               2 * material.density * skin + body.core.density * core,
                               2 * material.density * skin * arm ** 2 + body.core.density * core ** 3 / 12)
