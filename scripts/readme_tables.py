#!/usr/bin/env python3
"""Writes the measured tables of README.md between their markers; TABLES names them. Needs target/release/pliant."""
import argparse
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAM = ROOT / "target" / "release" / "pliant"


def pliant(*arguments):
    """Parsed JSON output of one command."""
    done = subprocess.run([PROGRAM, *map(str, arguments), "--json"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"pliant {' '.join(map(str, arguments))}: {done.stderr}")
    return json.loads(done.stdout)


METHODS = ("tree_augmented", "constraint_embedding")


def case_errors(path, *arguments):
    """Largest error of each quantity of a worked case, relative to its largest entry; moments of 1 m arms against forces where all vanish."""
    expected, found = json.loads(path.with_suffix(".json").read_text()), pliant("eval", path, *arguments)
    pairs = {"hinge acceleration": [], "moment": [], "force": [], "modal acceleration": []}
    for name, hinge in expected["hinges"].items():
        other = found["hinges"][name]
        pairs["hinge acceleration"] += zip(hinge["acceleration"], other["acceleration"])
        pairs["moment"] += zip(hinge["load"]["moment"], other["load"]["moment"])
        pairs["force"] += zip(hinge["load"]["force"], other["load"]["force"])
    for name, body in expected["bodies"].items():
        pairs["modal acceleration"] += zip(body["modal_acceleration"], found["bodies"][name]["modal_acceleration"])
    size = {key: max((abs(e) for e, _ in values), default=0.0) for key, values in pairs.items()}
    size["moment"] = max(size["moment"], 1e-3 * size["force"])
    return {key: max(abs(e - f) for e, f in values) / size[key] for key, values in pairs.items() if values}


def case_rows():
    """One row per family of worked cases."""
    families = {}
    for path in sorted((ROOT / "tests/data/cases").glob("*.toml")):
        family = path.stem.split("_")[0]
        if family != "loop":
            families.setdefault(family, []).append(case_errors(path))
            continue
        for method in METHODS:
            families.setdefault(method, []).append(case_errors(path, "--closure-method", method))
    titles = {"rigid": "rigid trees", "flexible": "cantilever bodies", "freefree": "free-free bodies", "tree": "rigid and flexible bodies, node loads",
              "prescribed": "prescribed hinges", "tree_augmented": "closed chains, cut", "constraint_embedding": "closed chains, embedded"}
    for family, errors in families.items():
        worst = max(max(e.values()) for e in errors)
        loads = max(max(e.get("moment", 0), e.get("force", 0)) for e in errors)
        yield (f"{len(errors)} random scenes: {titles[family]}", "accelerations; hinge loads", "first-principles program", f"{worst:.0e}; {loads:.0e}")


def example_rows():
    """Numbers of the examples that are known from elsewhere."""
    report = pliant("run", "examples/01_double_pendulum/scene.toml")
    first, second = (report["final"]["hinges"][h]["position"][0] for h in ("shoulder", "elbow"))
    error = max(abs(first + math.pi / 2 + 0.482971534251754377), abs(first + second + math.pi / 2 + 1.32404871230236255))
    yield ("double pendulum, both links at 2 s", "angle (rad)", "29-digit integration", f"{error:.0e}")
    report = pliant("run", "examples/02_hub_two_panels/scene.toml", "--viewer", "none")
    expected = -20 * math.sin(math.pi / 3) / 420
    sunk = report["final"]["hinges"]["attitude"]["position"][2]
    yield ("hub with two panels, settled", "hub displacement (m)", f"centre of mass stays: {expected:.5f}", f"{abs(sunk / expected - 1):.0e}")
    yield ("the same", "energy less work; momentum", "conserved", f"{report['errors']['energy']:.0e}; {report['errors']['momentum']:.0e}")
    yield ("the same", "hinge loads, whole run", "Newton-Euler audit", f"{report['errors']['audit']:.0e}")
    report = pliant("run", "examples/03_boom_tip_mass/scene.toml")
    moment = report["final"]["hinges"]["root"]["load"]["moment"][1]
    yield ("boom under a tip force, settled", "root moment (N m)", "statics: 30", f"{abs(moment / 30 - 1):.0e}")
    report = pliant("run", "examples/04_three_panels/scene.toml")
    moment = report["final"]["hinges"]["root"]["load"]["moment"][1]
    yield ("wing of three panels, slow force", "root moment (N m)", "statics: 0.6", f"{abs(moment / 0.6 - 1):.0e}")
    peaks = [pliant("run", f"examples/05_free_free/{name}.toml")["peaks"]["hinges"]["base"]["moment"] for name in ("cantilever", "free_free")]
    yield ("lifted panel, free-free against cantilever modes", "peak root moment", "each other", f"{abs(peaks[1] / peaks[0] - 1):.0e}")


def loop_rows():
    """Published loops and loops with known statics, by both methods."""
    def errors(example, error):
        runs = [pliant("run", f"examples/{example}/scene.toml", "--viewer", "none", "--closure-method", method) for method in METHODS]
        return "; ".join(f"{error(run):.0e}" for run in runs)

    def angle(run):
        at = {name: hinge["position"] for name, hinge in run["final"]["hinges"].items()}
        return abs(at["beta"][0] / 15.810771195153707 - 1)

    def load(run, hinge):
        return run["final"]["hinges"][hinge]["load"]

    yield ("Andrews' squeezing mechanism at 0.03 s", "angle beta (cut; embedded)", "IVP test set, high precision", errors("08_squeezing_mechanism", angle))
    torque = errors("09_slider_crank_flexible", lambda run: abs(-load(run, "crank")["moment"][1] / 5000 - 1))
    yield ("flexible slider-crank, upright", "crank torque (cut; embedded)", "statics: 5000 N m", torque)
    moment = errors("10_synchronised_panels", lambda run: abs(load(run, "drive")["moment"][1] / 5 - 1))
    yield ("synchronised panels, slow force", "drive moment (cut; embedded)", "statics: 5 N m", moment)


def validation_table():
    """The validation table as Markdown."""
    rows = [("problem", "quantity", "reference", "relative error"), ("---",) * 4, *case_rows(), *example_rows(), *loop_rows()]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def physics_test(name):
    """What one test of the physics prints."""
    command = ["cargo", "test", "--release", "--locked", "--test", "physics", name, "--", "--nocapture"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def stability_table():
    """The rows that the stability suite prints: case, quantity, bound, measured."""
    command = ["cargo", "test", "--release", "--locked", "--test", "stability", "--", "--nocapture", "--test-threads", "1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    rows = re.findall(r"stability \| (.*) \| (.*) \| (.*) \| (.*)$", done.stdout, re.MULTILINE)
    if done.returncode or not rows:
        sys.exit(f"the stability suite failed: {done.stdout}{done.stderr}")
    # numbered cases first; within a case as printed
    rows.sort(key=lambda row: (not re.fullmatch(r"S\d+", row[0]), row[0]))
    lines = ["| " + " | ".join(row) + " |" for row in [("case", "quantity", "bound", "measured"), ("---",) * 4, *rows]]
    return re.sub(r"(?<=\d)e0\b", "", "\n".join(lines))


def loops_table():
    """Cost of cut and embedded loops as their test prints it."""
    done = physics_test("embedding_costs")
    rows = re.findall(r"loop cost: (.*): ([\d.]+) us cut, ([\d.]+) us embedded", done.stdout)
    if not rows:
        sys.exit(f"the test of loop costs printed no figures: {done.stdout}{done.stderr}")
    lines = [f"| {what} | {float(cut):.0f} | {float(embedded):.0f} | {float(embedded) / float(cut):.2f} |" for what, cut, embedded in rows]
    head = ["| loops | tree_augmented (us per step) | constraint_embedding | ratio |", "| --- | --- | --- | --- |"]
    return "\n".join(head + lines)


STUDIES = {
    "01_double_pendulum": ("rigid chain",),
    "02_hub_two_panels": ("hub with two panels", "--modes", "3,6,10", "--integrators", "dormand_prince,rosenbrock_w"),
    "03_boom_tip_mass": ("boom with tip mass", "--modes", "4,8,12", "--integrators", "dormand_prince,rosenbrock_w"),
    "06_four_bar": ("four-bar loop", "--closure-method", ",".join(METHODS)),
}


def study_table():
    """The cheapest settings for two error budgets; draws examples/NAME/study.svg on the way."""
    def setting(study):
        if study["cheapest"] is None:
            return "none"
        point = study["points"][study["cheapest"]["point"]]
        at = f"{point['tolerance']:.0e}".replace("e-0", "e-") if point["tolerance"] else f"{point['step']:.1e} s".replace("e-0", "e-")
        changes = [f"{point['modes']} modes" if point["modes"] else "", point["closure_method"] or ""]
        what = ", ".join([f"{point['integrator']} at {at}", *filter(None, changes)])
        return f"{1e3 * point['run_time_s']['median']:.2g} ms: {what}"

    rows = [("scene", "simulated", "cheapest within 1 %", "within 0.01 %"), ("---",) * 4]
    for name, (title, *lists) in STUDIES.items():
        folder = f"examples/{name}"
        # the second budget takes all runs from the state file of the first
        with tempfile.TemporaryDirectory() as scratch:
            command = ["study", f"{folder}/scene.toml", *lists, "--state", f"{scratch}/state.jsonl"]
            fine = pliant(*command, "--error", "0.01%")
            coarse = pliant(*command, "--error", "1%", "--svg", f"{folder}/study.svg")
        rows.append((f"[{title}]({folder}/study.svg)", f"{coarse['duration_s']:g} s", setting(coarse), setting(fine)))
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def residual_table():
    """Errors on the panel slew over the number of modes, with and without residual modes; draws examples/11_panel_slew/modes.svg."""
    folder = "examples/11_panel_slew"
    counts = (1, 2, 4, 6, 8, 12, 16, 20, 30, 40)
    study = pliant("study", f"{folder}/scene.toml", "--integrators", "rosenbrock_w", "--tolerances", "1e-6", "--repeat", "1",
                   "--modes", ",".join(map(str, counts)), "--residual-modes", "off,on")
    points = {(p["modes"], p["residual_modes"]): p for p in study["points"]}
    rows = [("modes of 40", "error without residual modes", "with them", "modes in all (inner, outer)"), ("---",) * 4]
    for count in counts:
        plain, residual = points[count, False], points[count, True]
        errors = (f"{p['error']['peak']:.1e}".replace("e-0", "e-") for p in (plain, residual))
        rows.append((str(count), *errors, f"{plain['retained_modes']} and {residual['retained_modes']}"))
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    for on, label, marker in ((False, "without residual modes", "o-"), (True, "with residual modes", "s-")):
        axes.semilogy(counts, [points[count, on]["error"]["peak"] for count in counts], marker, label=label)
    axes.axhline(0.01, color="grey", linewidth=0.8, linestyle="--")
    axes.set(xlabel="modes of the file kept per panel", ylabel="largest error of a hinge load", title="panel slew")
    axes.legend()
    figure.savefig(ROOT / folder / "modes.svg", metadata={"Date": None})
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def campaign_table():
    """Cases per second on one thread and on all; a figure is cut, never rounded up."""
    def cut(value, digits):
        return f"{math.floor(value * 10**digits) / 10**digits:.{digits}f}"

    sys.path.insert(0, str(ROOT / "scripts" / "campaign"))
    from speedup import measure

    example = ROOT / "examples" / "12_campaign"
    found = measure(example / "scene.toml", example / "plan.toml", len(os.sched_getaffinity(0)), 9, ("--duration", "3"))
    return "\n".join([
        "| campaign of 120 cases of 3 s | cases a second |",
        "| --- | --- |",
        f"| 1 thread | {cut(found['rate_one'], 1)} |",
        f"| {found['threads']} threads on {found['threads']} cores | {cut(found['rate_all'], 1)} |",
        f"| speed-up per core, median and least of {found['rounds']} rounds | {cut(found['per_core'], 3)}, {cut(found['per_core_least'], 3)} |",
    ])


TABLES = {
    "validation": validation_table,
    "stability": stability_table,
    "loops": loops_table,
    "study": study_table,
    "residual": residual_table,
    "campaign": campaign_table,
}


def put_tables(tables, script="scripts/readme_tables.py"):
    """Puts Markdown tables, by name, between the markers of README.md that name the script."""
    readme = ROOT / "README.md"
    text = readme.read_text()
    for name, table in tables.items():
        begin, end = f"<!-- {name}: written by {script} -->", f"<!-- end of {name} -->"
        if begin not in text:
            sys.exit(f"README.md has no marker {begin}")
        head, rest = text.split(begin)
        text = head + begin + "\n" + table + "\n" + end + rest.split(end, 1)[1]
        readme.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"tables to write, of {', '.join(TABLES)}; all if none")
    names = parser.parse_args().tables or list(TABLES)
    if unknown := set(names) - set(TABLES):
        parser.error(f"unknown table {unknown.pop()}; known: {', '.join(TABLES)}")
    put_tables({name: TABLES[name]() for name in names})


if __name__ == "__main__":
    main()
