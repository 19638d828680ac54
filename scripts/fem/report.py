"""Tables about modal files: for the terminal, and modes/README.md. Every figure is read from the file or computed by theory."""
import dataclasses
from pathlib import Path

import h5py
import numpy as np

from . import reduction, structures

_AXES = ("x", "y", "z", "rx", "ry", "rz")
_KIND = {reduction.NORMAL: "normal", reduction.CRAIG_BAMPTON: "Craig-Bampton", reduction.ATTACHMENT: "attachment"}


@dataclasses.dataclass(frozen=True)
class Summary:
    """A modal file next to the theory of its body.

    frequency and theory (n,) in Hz, theory nan where there is none; effective (n,6) in percent of the mass (x, y, z) and of the
    inertia about the root (rx, ry, rz); interfaces: name -> (coupling, position (3,)).
    """
    name: str
    title: str
    boundary: str
    reference: str
    node_count: int
    bytes: int
    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray
    frequency: np.ndarray
    kind: np.ndarray
    families: list
    theory: np.ndarray
    effective: np.ndarray
    interfaces: dict

    @property
    def error(self):
        """(n,) percent by which a frequency is above theory."""
        return (self.frequency / self.theory - 1) * 100


def summarise(body, path):
    """Summary of the file `path` that was made from `body`."""
    path = Path(path)
    with h5py.File(path) as file:
        frequency, kind = file["modes/frequency"][()], file["modes/kind"][()]
        mass, inertia = file["body/mass"][()], file["body/inertia"][()]
        first, second = file["inertia/first_moment"][()], file["inertia/second_moment"][()]
        angular = np.stack([first[:, a, b] - first[:, b, a] for a, b in ((1, 2), (2, 0), (0, 1))], axis=1)
        effective = 100 * np.hstack([file["inertia/momentum"][()] ** 2 / mass, angular ** 2 / np.diag(inertia)])
        families = structures.families(body, np.einsum("jjaa->ja", second))
        return Summary(
            name=body.name, title=file.attrs["title"].decode(), boundary=file.attrs["boundary"].decode(),
            reference=structures.reference_name(body), node_count=int(file.attrs["node_count"]), bytes=path.stat().st_size,
            mass=float(mass), center_of_mass=file["body/center_of_mass"][()], inertia=inertia, frequency=frequency, kind=kind,
            families=families, theory=_theory(body, families, len(frequency)), effective=effective,
            interfaces={name: (group.attrs["coupling"].decode(), group["position"][()])
                        for name, group in file["interfaces"].items()})


def _theory(body, families, count):
    """Theory for the modes that are eigenmodes of the body: attachment modes are not, and of a Craig-Bampton set only as many of the
    lowest as there are fixed-interface modes come close."""
    reference = structures.reference_frequencies(body, count)
    seen, values = {}, np.full(count, np.nan)
    for mode, family in enumerate(families[:body.modes]):
        order = seen.get(family, 0)
        seen[family] = order + 1
        if family in reference:
            values[mode] = reference[family][order]
    return values


def terminal(summary, rules):
    """Text of a generated file: mass properties, frequencies against theory, effective masses, checks, size."""
    moments = ", ".join(f"{value:.6g}" for value in np.diag(summary.inertia))
    center = ", ".join(f"{value:.6g}" for value in np.round(summary.center_of_mass, 12) + 0.0)
    lines = [f"{summary.name}.h5: {summary.title}",
             f"  {summary.boundary}, {len(summary.frequency)} modes, {summary.node_count} nodes, {summary.bytes / 1024:.0f} KiB",
             f"  mass {summary.mass:.9g} kg, centre of mass ({center}) m, inertia about the root ({moments}) kg m2"]
    lines += [f"  interface {name}: {coupling} at ({', '.join(f'{value:g}' for value in position)}) m"
              for name, (coupling, position) in summary.interfaces.items()]
    lines += [f"  theory: {summary.reference}; effective mass and inertia in percent, the sum so far in brackets",
              "  mode kind          family     f / Hz   theory  error/% " + "".join(f"{axis:>15}" for axis in _AXES)]
    sums = np.cumsum(summary.effective, axis=0)
    for mode, frequency in enumerate(summary.frequency):
        against = "       -       -"
        if np.isfinite(summary.theory[mode]):
            against = f"{summary.theory[mode]:8.3f}{summary.error[mode]:+8.3f}"
        shares = "".join(f"{own:7.2f} ({total:5.1f})" for own, total in zip(summary.effective[mode], sums[mode]))
        lines.append(f"  {mode + 1:4d} {_KIND[summary.kind[mode]]:13s} {summary.families[mode]:8s} {frequency:8.3f} {against}  {shares}")
    lines.append(f"  {len(rules)} rules hold; nearest to their limits:")
    graded = sorted((rule for rule in rules if 0 < rule.limit < 1), key=lambda rule: -rule.value / rule.limit)
    lines += [f"    {rule}{', above the level of warning' if rule.doubtful else ''}" for rule in graded[:4]]
    return "\n".join(lines)


def readme(summaries):
    """Text of modes/README.md."""
    lines = ["# Modal files", "",
             "Written by `scripts/make_modes.py --readme` from the files and `bodies.toml`; schema `flexible-body-modes` 1.0.",
             "`scripts/make_modes.py NAME` makes one of them, without NAME all. `NAME.xdmf` (one grid) and `NAME.modes.xdmf` (one step per",
             "mode) open it in meshio, VTK and ParaView.", "",
             "| file | structure | mode set | mass kg | first to last Hz | interfaces | made by |", "|---|---|---|---|---|---|---|"]
    for item in summaries:
        places = "; ".join(f"{name} ({coupling}) at x = {position[0]:g} m" for name, (coupling, position) in item.interfaces.items())
        lines.append(f"| `{item.name}.h5` | {item.title} | {item.boundary}: {_mode_set(item)} | {item.mass:.6g} | "
                     f"{item.frequency[0]:.4g} to {item.frequency[-1]:.4g} | {places} | `make_modes.py {item.name}` |")
    lines += ["", "## Frequencies against theory", "",
              "Theory is independent of the solid model: Legendre-Ritz for beams and plates, closed form for rods, Saint-Venant torsion.",
              "Errors of clamped bodies contain the clamped face's restraint of lateral contraction and of warping, which beam and plate",
              "theory do not have. Modes without theory are not listed: in-plane modes of panels, attachment modes, and the upper modes of",
              "Craig-Bampton sets. Effective masses are relative to the mass, effective inertias to the inertia about the root; both are",
              "zero for free bodies, whose modes carry no momentum.", ""]
    for item in summaries:
        listed = np.flatnonzero(np.isfinite(item.theory))
        lines += [f"### {item.name}", "", f"Theory: {item.reference}.", "",
                  "| mode | family | Hz | theory Hz | error % | effective mass % x, y, z | effective inertia % rx, ry, rz |",
                  "|---|---|---|---|---|---|---|"]
        for mode in listed:
            shares = [f"{value:.2f}" for value in item.effective[mode]]
            lines.append(f"| {mode + 1} | {item.families[mode]} | {item.frequency[mode]:.4f} | {item.theory[mode]:.4f} | "
                         f"{item.error[mode]:+.3f} | {', '.join(shares[:3])} | {', '.join(shares[3:])} |")
        total = [f"{value:.2f}" for value in item.effective.sum(0)]
        lines += [f"| all {len(item.frequency)} | | | | | {', '.join(total[:3])} | {', '.join(total[3:])} |", ""]
    return "\n".join(lines).rstrip() + "\n"


def _mode_set(item):
    counts = [(np.count_nonzero(item.kind == kind), name) for kind, name in _KIND.items()]
    return " + ".join(f"{count} {name}" for count, name in counts if count)
