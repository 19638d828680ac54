"""Flexible systems: a hub with a chain of panels against Exudyn, error against CPU time; an evaluation over the number of modes."""
import dataclasses
import statistics

import numpy as np

from . import panel
from .engines import say

# panels, modes of each, time simulated (s)
CASE = (4, 12, 0.5)
# relative tolerance of the run that all errors are measured against, and of one that says how far it is from the truth
FINE, LESS_FINE = 1e-10, 1e-8
EXUDYN_STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
# solver, h of examples/peer and words for the table
PLIANT = [("auto", 1e-6, "auto, as scenes have it"), *(("rosenbrock_w", h, f"rosenbrock_w at {h:.0e}") for h in (1e-2, 1e-3, 1e-4, 5e-5, 1e-5)),
          *(("dormand_prince", h, f"dormand_prince at {h:.0e}") for h in (1e-2, 1e-4)), ("rk4", 4e-4, "rk4 in steps of 4e-4 s"),
          ("rosenbrock_w@0", 5e-5, "rosenbrock_w at 5e-05, inertia order 0"), ("rk4@0", 4e-4, "rk4 in steps of 4e-4 s, inertia order 0")]
MODES = (6, 12, 24, 48, 96)
CHAIN = 8
ORDERS = (0, 1, 2)
QUANTITIES = ("tip", "force")


@dataclasses.dataclass
class Run:
    """One setting: CPU time per simulated second of every round (s), and the last answer."""
    engine: str
    words: str
    cpu: list
    answer: dict

    def largest_error(self, reference):
        """Of a hinge force at any hinge and output time, relative to the largest force at that hinge; none without a history."""
        if not self.answer.get("forces"):
            return None
        found, expected = (np.reshape(a["forces"], (-1, a["m"], 3)) for a in (self.answer, reference))
        return (np.linalg.norm(found - expected, axis=2).max(0) / np.linalg.norm(expected, axis=2).max(0)).max()

    def error(self, reference, quantity):
        """Of `tip` (m) absolute, of `force` relative; at the end."""
        off = np.linalg.norm(np.subtract(self.answer[quantity], reference[quantity]))
        return off / (np.linalg.norm(reference["force"]) if quantity == "force" else 1.0)


@dataclasses.dataclass
class Comparison:
    """All settings; error of the reference itself; difference of Exudyn's finest run and what its error and its model explain."""
    runs: list
    reference: dict
    reference_error: dict
    difference: dict
    explained: dict

    @property
    def agrees(self):
        """Whether both programs integrate the same system."""
        return all(self.difference[q] <= self.explained[q] for q in self.difference)


def compare(pliant, exudyn, rounds):
    """Runs all settings in turn, round after round."""
    panels, modes, duration = CASE
    reference = pliant.object(panels, modes, "rosenbrock_w", FINE, duration, "history")
    near = Run("", "", [], pliant.object(panels, modes, "rosenbrock_w", LESS_FINE, duration, "history"))
    settings = [("pliant", pliant, solver, h, words) for solver, h, words in PLIANT]
    if exudyn:
        settings += [("exudyn", exudyn, "implicit", h, f"implicit in steps of {h:.3g} s") for h in EXUDYN_STEPS]
    runs = {}
    for number in range(rounds):
        for engine, driver, solver, h, words in settings:
            answer = driver.object(panels, modes, solver, h, duration, *(["history"] if engine == "pliant" else []))
            if answer is None or "error" in answer:
                if number == 0:
                    say(f"{engine} {words}: {answer and answer['error']}")
                continue
            run = runs.setdefault((engine, words), Run(engine, words, [], answer))
            run.cpu.append(answer["cpu"] / duration)
    runs = list(runs.values())
    difference, explained = {}, {}
    theirs = [run for run in runs if run.engine == "exudyn"]
    if len(theirs) >= 2:
        fine, finer = theirs[-2:]
        for quantity in QUANTITIES:
            difference[quantity] = finer.error(reference, quantity)
            # of second order: what is left is a third of what halving the step changed; doubled, as it is an estimate. And Exudyn turns
            # interfaces linearly, which is off by the square of their rotation
            size = panel.LENGTH * panels if quantity == "tip" else 1.0
            explained[quantity] = 2 / 3 * finer.error(fine.answer, quantity) + size * reference["rotation"] ** 2
    return Comparison(runs, reference, {q: near.error(reference, q) for q in QUANTITIES}, difference, explained)


def table(comparison):
    """Markdown: error against CPU time."""
    lines = [["program and setting", "CPU s per simulated s", "error of the tip (m)", "of the hinge force", "of all hinge forces, all the time"], ["---"] * 5]
    for run in comparison.runs:
        if run.engine == "exudyn" and not comparison.agrees:
            continue
        cpu = f"{statistics.median(run.cpu):.4f} ({min(run.cpu):.4f} to {max(run.cpu):.4f})"
        tip, force = (run.error(comparison.reference, q) for q in QUANTITIES)
        largest = run.largest_error(comparison.reference)
        lines.append([f"{run.engine}, {run.words}", cpu, f"{tip:.0e}", f"{100 * force:.2g} %", "" if largest is None else f"{100 * largest:.2g} %"])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


# what loads are wanted to
BUDGET = 0.02


def cheapest(comparison):
    """The setting of pliant with the least time of those that keep all hinge forces within BUDGET, in words."""
    within = [run for run in comparison.runs if (run.largest_error(comparison.reference) or 1.0) <= BUDGET]
    if not within:
        return f"No setting keeps all hinge forces within {100 * BUDGET:g} %."
    best = min(within, key=lambda run: statistics.median(run.cpu))
    return (f"Cheapest with all hinge forces within {100 * BUDGET:g} % all the time: {best.words}, {statistics.median(best.cpu):.3f} s of CPU time "
            "per simulated second.")


def evaluations(driver, rounds, seconds):
    """{(modes, order): least ns per body of every round} of a chain of panels."""
    log = {}
    for _ in range(rounds):
        for modes in MODES:
            for order in ORDERS:
                answer = driver.numbers(CHAIN, modes, f"order{order}", seconds)
                log.setdefault((modes, order), []).append(answer[0] / CHAIN)
    return log


def evaluation_table(log):
    """Markdown: ns per body over modes."""
    lines = [["modes per body", *(f"inertia order {order} (ns per body)" for order in ORDERS)], ["---"] * (1 + len(ORDERS))]
    for modes in MODES:
        lines.append([str(modes), *(f"{min(log[modes, order]):.0f}" for order in ORDERS)])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
