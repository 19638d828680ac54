"""What no file says and a user must: root and interfaces, boundary, damping, units. Missing ones are asked for by name."""
import dataclasses
import re

import numpy as np

from fem.errors import ModelError
from fem.lumped import rigid_fit

from .errors import InputError

BOUNDARIES = ("cantilever", "free-free", "craig-bampton", "general")


@dataclasses.dataclass(frozen=True)
class Choices:
    """root and interfaces: rules "101,102,110-120" (node numbers of the code) or "set:NAME"."""
    root: str
    interfaces: dict
    boundary: str
    damping_ratio: list | None
    length_unit: float
    mass_unit: float
    title: str | None = None


@dataclasses.dataclass(frozen=True)
class Place:
    """An interface: nodes (k,) as indices, weights (k,), position (3,), six-vectors (n,6), coupling."""
    nodes: np.ndarray
    weights: np.ndarray
    position: np.ndarray
    six_vectors: np.ndarray
    coupling: str


def damping(foreign, choices):
    """(n,) damping ratios: as chosen, else those of the file."""
    count = len(foreign.frequency)
    given = choices.damping_ratio
    if given is None:
        if foreign.damping_ratio is None:
            raise InputError(foreign.file, "damping", "none", "a ratio for every mode", "give --damping-ratio (one, or one per mode; 0 says undamped)")
        return np.asarray(foreign.damping_ratio, float)
    if len(given) not in (1, count):
        raise InputError(foreign.file, "--damping-ratio", f"{len(given)} numbers", f"one, or one for each of {count} modes", "correct --damping-ratio")
    return np.broadcast_to(np.asarray(given, float), count).copy()


def nodes_of(foreign, option, rule):
    """Indices (k,) of the nodes of a rule, and their weights or None."""
    if rule.startswith("set:"):
        name = rule[4:]
        if name not in foreign.sets:
            known = ", ".join(sorted(foreign.sets)) or "none"
            raise InputError(foreign.file, option, f"no set of nodes \"{name}\"", f"one of: {known}", "correct the name, or list node numbers")
        return foreign.sets[name]
    wanted = []
    for part in filter(None, re.split(r"[,\s]+", rule)):
        span = re.fullmatch(r"(\d+)(?:-(\d+))?", part)
        if not span:
            raise InputError(foreign.file, option, f"\"{part}\"", "node numbers as 101,102,110-120, or set:NAME", "correct the option")
        first, last = int(span[1]), int(span[2] or span[1])
        within = foreign.labels[(foreign.labels >= first) & (foreign.labels <= last)]
        if span[2] is None and not len(within):
            raise InputError(foreign.file, option, f"no node {first}", f"a node from {foreign.labels.min()} to {foreign.labels.max()}", "correct the number")
        wanted += sorted(within.tolist())
    if not wanted:
        raise InputError(foreign.file, option, "no nodes", "at least one", "name nodes that are in the file")
    place = {label: index for index, label in enumerate(foreign.labels.tolist())}
    return np.array([place[label] for label in dict.fromkeys(wanted)]), None


def place(foreign, option, rule, points, displacement, rotation, fixed):
    """Place of a rule; a single node needs rotations of its own, several are fitted with equal weights unless the set has weights."""
    nodes, weights = nodes_of(foreign, option, rule)
    weights = np.full(len(nodes), 1.0) if weights is None else np.asarray(weights, float)
    weights = weights / weights.sum()
    position = weights @ points[nodes]
    moved = displacement[:, nodes]
    if fixed:
        largest = np.abs(moved).max(axis=(0, 2))
        if largest.max() > 0:
            worst = int(largest.argmax())
            raise InputError(foreign.file, option, f"node {foreign.labels[nodes[worst]]} moving by {largest[worst]:.3g} of unit modal coordinates",
                             "a root at rest in every mode", "name the clamped nodes, or give --boundary general")
        return Place(nodes, weights, position, np.zeros((len(displacement), 6)), "fixed")
    if len(nodes) == 1:
        if rotation is None:
            raise InputError(foreign.file, option, "one node, and no nodal rotations in the file", "three nodes that are not on one line",
                             "name the nodes around the interface")
        return Place(nodes, weights, position, np.concatenate([moved[:, 0], rotation[:, nodes[0]]], axis=1), "rbe2")
    try:
        return Place(nodes, weights, position, rigid_fit(points[nodes], position, weights, moved), "rbe3")
    except ModelError as error:
        raise InputError(foreign.file, option, f"{len(nodes)} nodes", "a face", str(error)) from error
