#!/usr/bin/env python3
"""Plot a results file of `pliant run`: loads at hinges and closures, stress, modal coordinates and the energy balance.

Example: scripts/plot_results.py run.h5 --hinge drive --out run.png
"""

import argparse
import sys
from urllib.parse import unquote

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402


def text(attributes, name, default=""):
    """Text of an attribute, which h5py gives as bytes."""
    value = attributes.get(name, default)
    return value.decode() if isinstance(value, bytes) else str(value)


def plot_load(axes, time, dataset, owner):
    """Components and magnitude of one load, with unit, frame and side."""
    values = dataset[:]
    for component, label in zip(values.T, "xyz"):
        axes.plot(time, component, label=label, linewidth=1)
    axes.plot(time, np.linalg.norm(values, axis=1), "k", label="magnitude", linewidth=1)
    quantity = dataset.name.rsplit("_", 1)[-1]
    about = f" about {text(dataset.attrs, 'point')}" if quantity == "moment" else ""
    axes.set_title(f"{owner}: {quantity}{about}, {text(dataset.attrs, 'side')}\nin {text(dataset.attrs, 'frame')}", fontsize=8)
    axes.set_ylabel(text(dataset.attrs, "unit"))


def plot_gear(axes, time, dataset, owner):
    """What a gear exerts on coordinate b, with unit and side."""
    axes.plot(time, dataset[:], label="on b", linewidth=1)
    quantity = "moment" if text(dataset.attrs, "unit") == "N m" else "force"
    axes.set_title(f"{owner}: {quantity} of the gear,\n{text(dataset.attrs, 'side')}", fontsize=8)
    axes.set_ylabel(text(dataset.attrs, "unit"))


def plot_residuals(axes, time, closures):
    """How far closures are from closed."""
    for name, group in closures.items():
        axes.plot(time, group["residual"][:], label=name, linewidth=1)
    axes.set_title("closures: residual", fontsize=8)
    axes.set_ylabel("m or rad")


def named(file, kind, names):
    """Groups of a kind by name, those asked for or all."""
    known = {unquote(name): group for name, group in file.get(f"{kind}s", {}).items()}
    missing = [name for name in names or [] if name not in known]
    if missing:
        sys.exit(f"no loads of {kind} {missing[0]} in the file; it has {', '.join(known) or 'none'}")
    return known if names is None else {name: known[name] for name in names}


def plot_balance(axes, time, energy):
    """Energies, and what the balance leaves over."""
    kinetic, strain, potential, work = (energy[name][:] for name in ("kinetic", "strain", "potential", "work"))
    total = kinetic + strain + potential
    for values, label in [(kinetic, "kinetic"), (strain, "strain"), (potential, "potential"), (work, "work")]:
        axes.plot(time, values, label=label, linewidth=1)
    error = np.abs(total - total[0] - (work - work[0])).max()
    axes.set_title(f"energy; largest imbalance {error:.2e} J", fontsize=8)
    axes.set_ylabel("J")


def plot(file, hinges, closures):
    """One figure of everything in the file, or of the loads named."""
    time = file["time"][:]
    if hinges or closures:
        hinges, closures = hinges or [], closures or []
    hinges, closures = named(file, "hinge", hinges), named(file, "closure", closures)
    panels = []
    for name, group in [*hinges.items(), *closures.items()]:
        for quantity, draw in (("load_moment", plot_load), ("load_force", plot_load), ("coordinate_force", plot_gear)):
            if quantity in group:
                panels.append(lambda axes, draw=draw, dataset=group[quantity], name=name: draw(axes, time, dataset, name))
    if closures:
        panels.append(lambda axes: plot_residuals(axes, time, closures))
    bodies = {unquote(name): group for name, group in file["bodies"].items()}
    stressed = {name: group["von_mises_peak"] for name, group in bodies.items() if "von_mises_peak" in group}

    def stress(axes):
        for name, dataset in stressed.items():
            axes.plot(time, dataset[:] * 1e-6, label=name, linewidth=1)
        axes.set_title("largest von Mises stress", fontsize=8)
        axes.set_ylabel("MPa")

    def modes(axes, name, dataset):
        axes.plot(time, dataset[:], linewidth=1, label=text(dataset.attrs, "components").split(", "))
        axes.set_title(f"{name}: modal coordinates", fontsize=8)
        axes.set_ylabel(text(dataset.attrs, "unit"))

    if stressed:
        panels.append(stress)
    for name, group in bodies.items():
        if "modal_position" in group:
            panels.append(lambda axes, name=name, group=group: modes(axes, name, group["modal_position"]))
    panels.append(lambda axes: plot_balance(axes, time, file["energy"]))

    rows = (len(panels) + 1) // 2
    figure, grid = plt.subplots(rows, 2, figsize=(12, 2.6 * rows), squeeze=False, layout="constrained", sharex=True)
    for axes, draw in zip(grid.flat, panels):
        draw(axes)
        axes.legend(fontsize=6, loc="upper right")
        axes.grid(alpha=0.3)
    for axes in grid.flat[len(panels):]:
        axes.axis("off")
    for axes in grid[-1]:
        axes.set_xlabel("s")
    ended = "" if file.attrs.get("completed", 0) else " (the run ended early)"
    figure.suptitle(text(file.attrs, "scene_name") + ended)
    return figure


def main():
    """Read the arguments, draw and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", help="results file (.h5)")
    parser.add_argument("--out", help="picture to write; default: the file's name with .png")
    parser.add_argument("--hinge", action="append", help="hinge to show; may be repeated; default: all")
    parser.add_argument("--closure", action="append", help="closure to show; may be repeated; default: all")
    arguments = parser.parse_args()
    try:
        with h5py.File(arguments.file) as file:
            if text(file.attrs, "format") != "pliant-results":
                sys.exit(f"{arguments.file}: no results file of pliant")
            figure = plot(file, arguments.hinge, arguments.closure)
    except OSError as error:
        sys.exit(f"{arguments.file}: {error}")
    out = arguments.out or arguments.file.removesuffix(".h5") + ".png"
    figure.savefig(out, dpi=120)
    print(out)


if __name__ == "__main__":
    main()
