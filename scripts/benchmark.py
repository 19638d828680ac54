#!/usr/bin/env python3
"""Times pliant beside Pinocchio, MuJoCo, Drake and Exudyn on the same systems, and writes the tables and figures of README.md.

Installs the peers into .venv/benchmark, builds their drivers, checks that all compute the same accelerations and loads on random systems,
and only then times them: every round asks every program for the same case in turn, so that noise falls on all alike. Times are CPU time of
one thread. A peer that does not install, compile or agree is left out, with the reason.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if Path(sys.prefix).resolve() != (ROOT / ".venv").resolve():
    subprocess.run([ROOT / "scripts" / "setup.sh"], check=True)
    python = str(ROOT / ".venv" / "bin" / "python")
    os.execv(python, [python, *sys.argv])

import matplotlib  # noqa: E402

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from peers import engines, flexible, panel, rigid  # noqa: E402
from readme_tables import put_tables  # noqa: E402

RIGID_PEERS = ("pinocchio", "mujoco", "drake")
EPILOG = """\
--kernel adds a program of your own to the rigid part: it reads requests "chain 64 fd 0.05" (system, links, fd or fdf,
seconds) and answers "<least ns per call> <median ns> <sum of absolute hinge accelerations>", or "skip". It is printed, never written to README.md.

Takes about three minutes, the first time some more and 4 GB of memory for compiling. Needs what scripts/setup.sh needs, and g++.
"""


def rigid_part(options, folder, pliant, results):
    """Agreement, ratios, and time over the number of bodies."""
    drivers = engines.start(RIGID_PEERS)
    kernels = engines.kernels(options.kernel)
    cases = rigid.CASES[:2] if options.quick else rigid.CASES
    found = rigid.agreement(pliant, drivers, folder, cases)
    worst = {}
    for a in found:
        key = (a.peer, a.quantity)
        worst[key] = max(worst.get(key, 0.0), a.difference / a.allowed)
    for (peer, quantity), share in worst.items():
        engines.say(f"{peer}: {quantity} of {len([a for a in found if (a.peer, a.quantity) == (peer, quantity)])} systems differ by at most "
                    f"{share:.1e} of what is allowed")
    everyone = {"pliant": pliant, **drivers, **kernels}
    log = rigid.time_cases(everyone, folder, cases, options.rounds, options.seconds)
    refused = rigid.disagreeing(log, found)
    for name, reason in refused.items():
        engines.say(f"{name} computes something else and is not shown: {reason}")
    names = [name for name in everyone if name != "pliant" and name not in refused]
    overhead = None
    if "drake" in drivers:
        answer = drivers["drake"].numbers(folder / "{}_{}".format(*cases[1]), 0, "overhead", options.seconds)
        overhead = answer and answer[0]
    print(rigid.table(log, names), end="\n\n")
    results["rigid"] = [{"model": m, "n": n, "program": p, "op": op, "ns": t.ns} for (m, n), rows in log.items() for (p, op), t in rows.items()]

    bodies = [("chain", n) for n in (rigid.BODIES[:3] if options.quick else rigid.BODIES)]
    alone = {"pliant": pliant, **{name: kernels[name] for name in kernels if name not in refused}}
    over_bodies = rigid.time_cases(alone, folder, bodies, max(3, options.rounds // 3), options.seconds)
    results["bodies"] = [{"n": n, "program": p, "op": op, "ns": t.ns} for (_, n), rows in over_bodies.items() for (p, op), t in rows.items()]
    bodies_figure(over_bodies, log, [name for name in names if name in drivers])
    lines = ["| chain of rigid links | accelerations (ns per body) | and all hinge loads |", "| --- | --- | --- |"]
    lines += [f"| {n:,} | " + " | ".join(f"{min(rows['pliant', op].ns) / n:.0f}" for op in ("fd", "fdf")) + " |" for (_, n), rows in over_bodies.items()]
    shown = [name for name in names if name in drivers]
    return {"peers": rigid.table(log, shown) + note(overhead if "drake" in shown else None), "bodies": "\n".join(lines)}


def note(overhead):
    """Machine and caveats below the table."""
    lines = [f"One core of: {engines.machine()}."]
    if overhead is not None:
        lines.append(f"Drake is called from Python, which takes about {overhead / 1000:.0f} us of each call.")
    return "\n\n" + " ".join(lines)


def bodies_figure(over_bodies, log, peers):
    """ns per body against the number of bodies."""
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    for op, label, style in (("fd", "pliant", "o-"), ("fdf", "pliant, with all hinge loads", "s-")):
        axes.loglog([n for _, n in over_bodies], [min(rows["pliant", op].ns) / n for (_, n), rows in over_bodies.items()], style, label=label)
    for name in peers:
        points = [(n, min(rows[name, "fd"].ns) / n) for (model, n), rows in log.items() if model == "chain" and (name, "fd") in rows]
        axes.loglog(*zip(*points), ".--", linewidth=0.9, label=name)
    axes.set(xlabel="rigid links in a chain", ylabel="ns per link and evaluation")
    axes.legend()
    figure.savefig(ROOT / "scripts/peers/bodies.svg", metadata={"Date": None})
    plt.close(figure)


def modes_part(options, folder, results):
    """Time of an evaluation over the number of modes."""
    driver = engines.Driver("pliant", [engines.PLIANT, "modes", folder])
    log = flexible.evaluations(driver, max(3, options.rounds // 3), options.seconds)
    driver.close()
    results["modes"] = [{"modes": m, "order": o, "ns_per_body": ns} for (m, o), ns in log.items()]
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    for order, style in ((0, "o-"), (2, "s-")):
        axes.loglog(flexible.MODES, [min(log[m, order]) for m in flexible.MODES], style, label=f"inertia order {order}")
    axes.set(xlabel="modes per body", ylabel="ns per body and evaluation", title=f"chain of {flexible.CHAIN} panels")
    axes.legend()
    figure.savefig(ROOT / "scripts/peers/modes.svg", metadata={"Date": None})
    plt.close(figure)
    table = flexible.evaluation_table(log)
    print(table, end="\n\n")
    return {"modes": table}


def flexible_part(options, folder, results):
    """Error against CPU time of runs with flexible panels."""
    pliant = engines.Driver("pliant", [engines.PLIANT, "flexible", folder])
    exudyn = engines.start(("exudyn",), folder).get("exudyn")
    comparison = flexible.compare(pliant, exudyn, 1 if options.quick else max(3, options.rounds // 3))
    for quantity, error in comparison.reference_error.items():
        engines.say(f"error of the reference run, {quantity}: below {error:.1e}")
    for quantity, off in comparison.difference.items():
        engines.say(f"exudyn's finest run differs by {off:.1e} in {quantity}, its error and its model explain {comparison.explained[quantity]:.1e}")
    if exudyn and not comparison.agrees:
        engines.say("exudyn computes something else and is not shown")
    results["flexible"] = [{"program": r.engine, "setting": r.words, "cpu_s_per_s": r.cpu,
                            **{q: r.error(comparison.reference, q) for q in flexible.QUANTITIES},
                            "all_forces": r.largest_error(comparison.reference)} for r in comparison.runs]
    table = flexible.table(comparison) + "\n\n" + flexible.cheapest(comparison)
    print(table, end="\n\n")
    return {"flexible": table}


def main():
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help="rigid, modes, flexible; all if none")
    parser.add_argument("--rounds", type=int, default=9, help="rounds of the rigid part; the others take a third of them, at least three (default 9)")
    parser.add_argument("--seconds", type=float, default=0.05, help="CPU time of one measurement (default 0.05)")
    parser.add_argument("--quick", action="store_true", help="small cases only, nothing is written to README.md")
    parser.add_argument("--kernel", action="append", default=[], metavar="NAME=COMMAND", help="another program for the rigid part, see below")
    parser.add_argument("--no-readme", action="store_true", help="leave README.md as it is")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every measured time")
    options = parser.parse_args()
    known = ("rigid", "modes", "flexible")
    if unknown := set(options.parts) - set(known):
        parser.error(f"unknown part {unknown.pop()}; known: {', '.join(known)}")
    parts = options.parts or known
    engines.build_pliant()
    panels, tables, results = engines.BUILD / "panels", {}, {"machine": engines.machine()}
    if set(parts) & {"modes", "flexible"}:
        panel.write(panels, flexible.MODES)
    with tempfile.TemporaryDirectory() as scratch:
        if "rigid" in parts:
            tables |= rigid_part(options, Path(scratch), engines.Driver("pliant", [engines.PLIANT, "rigid"]), results)
    if "modes" in parts:
        tables |= modes_part(options, panels, results)
    if "flexible" in parts:
        tables |= flexible_part(options, panels, results)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")
    if not (options.quick or options.no_readme):
        put_tables(tables, "scripts/benchmark.py")


if __name__ == "__main__":
    sys.exit(main())
