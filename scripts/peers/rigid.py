"""Rigid models: the same systems in every program, held to agree in accelerations and loads, then timed in turn."""
import dataclasses
import statistics
import sys

import numpy as np

from . import models
from .engines import LARGEST, say

# model, links per arm, bodies
CASES = [("chain", 4), ("chain", 16), ("chain", 64), ("chain", 256), ("chain", 1024), ("tree", 8), ("tree", 32)]
SEEDS = range(1, 7)
RANDOM_LINKS = 24
BODIES = (16, 64, 256, 1_000, 10_000, 100_000)
# The condition of the mass matrix is that of a dense matrix; beyond this many rates its eigenvalues take minutes
MOST_CONDITION = 300
# A solution of M a = f with backward error of a few eps is off by 2 condition eps; loads follow accelerations
SOLVE = 2 * np.finfo(float).eps
# Longer chains are only held to this, in the sum of their accelerations
COARSE = 1e-6
# Ops that do the same, of which the quicker counts
SAME = {"fd": ("fd", "fd_world"), "fdf": ("fdf",)}


def bodies(model, n):
    """Number of bodies of a case."""
    return n if model == "chain" else 4 * n + 1


def _file(folder, model, n):
    path = folder / f"{model}_{n}"
    if not path.exists():
        {"chain": models.chain, "tree": models.tree}[model](n).write(path)
    return path


@dataclasses.dataclass
class Agreement:
    """How far a peer is from pliant on one system, relative to the largest entry, and what is allowed."""
    peer: str
    system: str
    quantity: str
    difference: float
    allowed: float

    @property
    def holds(self):
        """Whether the peer computes the same."""
        return self.difference <= self.allowed


def _difference(found, expected):
    found, expected = np.asarray(found), np.asarray(expected)
    return float("inf") if found.shape != expected.shape else np.abs(found - expected).max() / np.abs(expected).max()


def agreement(pliant, drivers, folder, cases):
    """Every peer on every random system and every case, in accelerations and, where it gives them, in loads."""
    found = []
    systems = [(f"random {seed}", folder / f"random_{seed}", RANDOM_LINKS) for seed in SEEDS]
    for seed, (_, path, _) in zip(SEEDS, systems):
        models.random_tree(seed, RANDOM_LINKS).write(path)
    systems += [(f"{model} {n}", _file(folder, model, n), bodies(model, n)) for model, n in cases if bodies(model, n) <= MOST_CONDITION]
    for name, path, count in systems:
        # a free body has no reaction: rounding there says nothing
        held = np.array([not link.free for link in models.read(path).links])
        condition = pliant.numbers(path, count, "condition", 0)[0]
        for quantity in ("accelerations", "loads"):
            ours = np.array(pliant.numbers(path, count, quantity, 0))
            for peer, driver in drivers.items():
                theirs = driver.numbers(path, count, quantity, 0) if driver.by_file and count <= LARGEST.get(peer, sys.maxsize) else None
                if theirs is None:
                    continue
                pair = (np.array(theirs), ours)
                if quantity == "loads" and pair[0].shape == ours.shape:
                    pair = tuple(x.reshape(-1, 6)[held] for x in pair)
                found.append(Agreement(peer, name, quantity, _difference(*pair), SOLVE * condition))
    return found


@dataclasses.dataclass
class Times:
    """Least times per call (ns) of one program on one case and op, one per round."""
    ns: list
    check: float


def time_cases(drivers, folder, cases, rounds, seconds, ops=("fd", "fdf")):
    """{(model, n): {(driver, op): Times}}: every round starts every compiled program anew and asks it for a case in turn, so that noise and the
    luck of where things lie in memory fall on all alike."""
    log = {}
    for model, n in cases:
        rows = log.setdefault((model, n), {})
        for _ in range(rounds):
            for name, driver in drivers.items():
                if bodies(model, n) > LARGEST.get(name, sys.maxsize):
                    continue
                driver.restart()
                request = _file(folder, model, n) if driver.by_file else model
                for op in ops:
                    answers = [a for a in (driver.numbers(request, n, same, seconds) for same in SAME[op]) if a is not None]
                    if answers:
                        best = min(answers)
                        rows.setdefault((name, op), Times([], best[2])).ns.append(best[0])
        say(f"{model} {n}: " + ", ".join(f"{name} {op} {min(t.ns) / bodies(model, n):.0f}" for (name, op), t in rows.items()) + " ns per body")
    return log


def disagreeing(log, found):
    """Names of peers whose times must not be shown, with the reason."""
    reasons = {a.peer: f"{a.quantity} of {a.system} differ by {a.difference:.1e}, allowed {a.allowed:.1e}" for a in found if not a.holds}
    for (model, n), rows in log.items():
        ours = rows["pliant", "fd"].check
        for (name, op), times in rows.items():
            off = abs(times.check - ours) / ours
            if not off <= COARSE:
                reasons.setdefault(name, f"the accelerations of {model} {n} ({op}) differ by {off:.1e} in sum, allowed {COARSE:.0e}")
    return reasons


def ratio(ours, theirs):
    """Our time over theirs: median over rounds, least, largest."""
    ratios = [a / b for a, b in zip(ours.ns, theirs.ns)]
    return statistics.median(ratios), min(ratios), max(ratios)


def table(log, names):
    """Markdown: ns per body of pliant, its time with loads over that without, and its time over that of each of `names`."""
    head = ["system", "bodies", "op", "pliant (ns per body)", "with loads / without", *(f"pliant / {name}" for name in names)]
    lines = [head, ["---"] * len(head)]
    for (model, n), rows in log.items():
        for op, what in (("fd", "accelerations"), ("fdf", "and all hinge loads")):
            ours = rows["pliant", op]
            row = [f"{model} of {n}" if model == "chain" else f"hub and 4 arms of {n}", f"{bodies(model, n):,}", what,
                   f"{min(ours.ns) / bodies(model, n):.0f}", "{:.3f} ({:.3f} to {:.3f})".format(*ratio(ours, rows["pliant", "fd"])) if op == "fdf" else ""]
            for name in names:
                theirs = rows.get((name, op))
                row.append("{:.2f} ({:.2f} to {:.2f})".format(*ratio(ours, theirs)) if theirs else "")
            lines.append(row)
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
