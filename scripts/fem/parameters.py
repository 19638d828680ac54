"""Parameters of bodies: TOML tables to checked, frozen records.

Every complaint names the body and the key, says what was found and what is expected, so that a table can be
mended without reading this file. Unknown keys are refused: a misspelt one would otherwise change nothing.
"""
import dataclasses
import math
import re
import tomllib
from pathlib import Path

from .errors import ParameterError

KINDS = ("boom", "panel", "sandwich")
BOUNDARIES = ("cantilever", "craig-bampton", "free-free")
ELEMENTS = ("hex27", "hex20R")
PRECISIONS = ("f4", "f8")


@dataclasses.dataclass(frozen=True)
class Isotropic:
    """Isotropic material: Pa, 1, kg/m3."""
    young_modulus: float
    poisson_ratio: float
    density: float


@dataclasses.dataclass(frozen=True)
class HoneycombCore:
    """Core of a sandwich: transverse shear carries the load, in-plane stiffness is next to nothing. Pa, kg/m3."""
    shear_modulus_xz: float
    shear_modulus_yz: float
    thickness_modulus: float
    in_plane_modulus: float
    density: float


@dataclasses.dataclass(frozen=True)
class InterfacePatch:
    """A hinge interface on the face x = length: the strip |y - center_y| <= width / 2 over the whole thickness (m)."""
    name: str
    width: float
    center_y: float


@dataclasses.dataclass(frozen=True)
class Body:
    """One modal file. Lengths in m; x along the body from the root, y across, z through the thickness.

    `mesh` counts elements along x, y, z; the elements at both ends in x are shorter than the mean by the fraction
    `end_refinement`, since clamps and hinges bend a body over a short length. `modes` counts normal (fixed-interface)
    modes; Craig-Bampton adds six constraint modes for every interface, free-free six attachment modes for every
    interface including the root.
    """
    name: str
    title: str
    kind: str
    length: float
    width: float
    thickness: float
    skin_thickness: float
    material: Isotropic
    core: HoneycombCore | None
    element: str
    mesh: tuple[int, int, int]
    end_refinement: float
    boundary: str
    modes: int
    damping_ratio: float
    displacement_precision: str
    interfaces: tuple[InterfacePatch, ...]


class _Table:
    """A TOML table that knows its dotted path and which of its keys have been asked for."""

    def __init__(self, path, values):
        if not isinstance(values, dict):
            raise ParameterError(f"{path}: expected a table, found {values!r}")
        self.path, self.values, self.asked = path, values, set()

    def get(self, key, default=None):
        self.asked.add(key)
        if key not in self.values:
            if default is None:
                raise ParameterError(f"{self.path}.{key}: missing")
            return default
        return self.values[key]

    def refuse(self, key, expected):
        raise ParameterError(f"{self.path}.{key}: expected {expected}, found {self.values.get(key)!r}")

    def number(self, key, expected, accept, default=None):
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or not accept(value):
            self.refuse(key, expected)
        return float(value)

    def positive(self, key, default=None):
        return self.number(key, "a positive number", lambda value: value > 0, default)

    def integer(self, key, minimum):
        value = self.get(key)
        if isinstance(value, bool) or not isinstance(value, int) or value < minimum:
            self.refuse(key, f"an integer of at least {minimum}")
        return value

    def text(self, key):
        value = self.get(key)
        if not isinstance(value, str) or not value.strip():
            self.refuse(key, "a text")
        return value

    def choice(self, key, choices, default=None):
        value = self.get(key, default)
        if value not in choices:
            self.refuse(key, "one of " + ", ".join(choices))
        return value

    def table(self, key):
        return _Table(f"{self.path}.{key}", self.get(key))

    def close(self):
        unknown = sorted(set(self.values) - self.asked)
        if unknown:
            raise ParameterError(f"{self.path}.{unknown[0]}: unknown key; known here: {', '.join(sorted(self.asked))}")


def read_tables(path):
    """Raw tables by body name, each with the keys of the body that its `like` names filled in."""
    path = Path(path)
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read ({error.strerror})") from error
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"{path}: not TOML: {error}") from error
    return {name: _inherit(name, tables) for name in tables}


def _inherit(name, tables, below=()):
    table = tables[name]
    if not isinstance(table, dict):
        raise ParameterError(f"{name}: expected a table, found {table!r}")
    if "like" not in table:
        return dict(table)
    parent = table["like"]
    if parent not in tables or parent in (name, *below):
        raise ParameterError(f"{name}.like: expected the name of another body, found {parent!r}")
    own = {key: value for key, value in table.items() if key != "like"}
    return {**_inherit(parent, tables, (name, *below)), **own}


def parse_body(name, values):
    """A checked `Body` from one raw table; raises ParameterError."""
    if not re.fullmatch(r"[A-Za-z0-9_]+", name):
        raise ParameterError(f"{name}: a body name may hold letters, digits and underscores, since it names files")
    table = _Table(name, values)
    kind = table.choice("kind", KINDS)
    sandwich = kind == "sandwich"
    if sandwich:
        skin_thickness = table.positive("skin_thickness")
        thickness = table.positive("core_thickness") + 2 * skin_thickness
        core = _parse_core(table.table("core"))
    else:
        skin_thickness, thickness, core = 0.0, table.positive("thickness"), None
    length, width = table.positive("length"), table.positive("width")
    element = table.choice("element", ELEMENTS, "hex20R" if sandwich else "hex27")
    mesh = _parse_mesh(table, kind, element)
    body = Body(
        name=name, title=table.text("title"), kind=kind, length=length, width=width, thickness=thickness,
        skin_thickness=skin_thickness, material=_parse_isotropic(table.table("material")), core=core, element=element,
        mesh=mesh, end_refinement=table.number("end_refinement", "a number from 0 to below 1", lambda value: 0 <= value < 1, 0.0),
        boundary=table.choice("boundary", BOUNDARIES), modes=table.integer("modes", 1),
        damping_ratio=table.number("damping_ratio", "a number from 0 to below 1", lambda value: 0 <= value < 1),
        displacement_precision=table.choice("displacement_precision", PRECISIONS, "f4"),
        interfaces=_parse_interfaces(table.table("interfaces"), width, mesh))
    table.close()
    # Beyond three modes per element a mode is a property of the mesh rather than of the body.
    limit = 3 * math.prod(mesh)
    if body.modes > limit:
        table.refuse("modes", f"at most {limit} for this mesh")
    return body


def _parse_mesh(table, kind, element):
    mesh = table.get("mesh")
    if (not isinstance(mesh, (list, tuple)) or len(mesh) != 3
            or any(isinstance(count, bool) or not isinstance(count, int) or count < 1 for count in mesh)):
        table.refuse("mesh", "three positive element counts [along x, y, z]")
    if kind == "sandwich" and mesh[2] != 3:
        table.refuse("mesh", "three elements along z for a sandwich: skin, core, skin")
    if element == "hex20R" and mesh[1] < 2:
        table.refuse("mesh", "at least two hex20R elements along y: a single row has zero-energy modes of its own")
    return tuple(mesh)


def _parse_isotropic(table):
    material = Isotropic(table.positive("young_modulus"),
                         table.number("poisson_ratio", "a number from 0 to below 0.5", lambda value: 0 <= value < 0.5),
                         table.positive("density"))
    table.close()
    return material


def _parse_core(table):
    core = HoneycombCore(**{field.name: table.positive(field.name) for field in dataclasses.fields(HoneycombCore)})
    table.close()
    return core


def _parse_interfaces(tables, width, mesh):
    if not tables.values:
        raise ParameterError(f"{tables.path}: expected at least one interface besides root")
    patches, pitch = [], width / mesh[1]
    for name in tables.values:
        table = tables.table(name)
        if name == "root" or not re.fullmatch(r"[A-Za-z0-9_]+", name):
            raise ParameterError(f"{table.path}: not a usable name; letters, digits and underscores, and root is taken")
        patch = InterfacePatch(name, table.positive("width", width),
                               table.number("center_y", "a number", lambda value: True, 0.0))
        for edge in (patch.center_y - patch.width / 2, patch.center_y + patch.width / 2):
            elements = (edge + width / 2) / pitch
            if not -1e-9 <= elements <= mesh[1] + 1e-9 or abs(elements - round(elements)) > 1e-9:
                raise ParameterError(f"{table.path}.width: the strip must end on element edges, multiples of {pitch:g} m "
                                     f"from y = {-width / 2:g} m; it ends at {edge:g} m")
        table.close()
        patches.append(patch)
    return tuple(patches)
