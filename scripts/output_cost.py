#!/usr/bin/env python3
"""What streaming and results cost: runs of the default example at 60 output times per second, bare and with each output, in turn.

Two ratios to the bare run of the same round: of the run itself, as the report has it, and of the whole process from start to exit, which
waits until everything is on disk. Median over the rounds with its standard error (from the median deviation, as for a normal scatter), least
and largest. Every other round goes through the variants backwards, so that a machine that gets slower favours none. Writes nothing but its own
scratch folder.
"""
import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "examples" / "02_hub_two_panels" / "scene.toml"
RATE = 60
VARIANTS = {"bare": (), "results": ("--out", "run.h5"), "recording": ("--rrd", "run.rrd"), "both": ("--out", "run.h5", "--rrd", "run.rrd")}


def scene(folder, duration):
    """The default example at RATE in `folder`."""
    text = SCENE.read_text().replace("../../modes", str(ROOT / "modes"))
    for key, value in (("rate_hz", RATE), ("duration", duration)):
        if value is None:
            continue
        text, count = re.subn(rf"^{key} = .*$", f"{key} = {value}.0", text, flags=re.MULTILINE)
        if count != 1:
            sys.exit(f"{SCENE}: expected one line {key}")
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def run(program, path, arguments):
    """Wall-clock time of the run and of the process (s), and CPU time of the process."""
    before, start = os.times(), time.perf_counter()
    command = [program, "run", path, "--viewer", "none", "--json"] if "--rrd" not in arguments else [program, "run", path, "--json"]
    done = subprocess.run([*command, *arguments], cwd=path.parent, capture_output=True, text=True)
    whole, after = time.perf_counter() - start, os.times()
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}: {done.stderr}")
    report = json.loads(done.stdout)
    if problems := [f["problem"] for f in report["files"] if f.get("problem")]:
        sys.exit(f"the run lost something: {problems[0]}")
    return report["wall_s"], whole, after.children_user + after.children_system - before.children_user - before.children_system


def summary(extra):
    """Median of percentages with its standard error, and their range."""
    median = statistics.median(extra)
    deviation = 1.4826 * statistics.median(abs(x - median) for x in extra)
    return f"{median:+.1f} ± {1.2533 * deviation / len(extra) ** 0.5:.1f} % ({min(extra):+.1f} to {max(extra):+.1f})"


def main():
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--duration", type=int, help="simulated time (s); default that of the example")
    parser.add_argument("--program", type=Path, default=ROOT / "target" / "release" / "pliant", help="default target/release/pliant")
    options = parser.parse_args()
    log = {name: [] for name in VARIANTS}
    with tempfile.TemporaryDirectory() as scratch:
        path = scene(Path(scratch), options.duration)
        for number in range(options.rounds):
            for name in list(VARIANTS)[:: -1 if number % 2 else 1]:
                log[name].append(run(options.program, path, VARIANTS[name]))
    medians = [statistics.median(values) for values in zip(*log["bare"])]
    print("bare: {:.4f} s of run, {:.4f} s of process, {:.4f} s of CPU time".format(*medians))
    for name in list(VARIANTS)[1:]:
        words = []
        for part, what in enumerate(("run", "process", "CPU time")):
            extra = [100 * (with_output[part] / bare[part] - 1) for with_output, bare in zip(log[name], log["bare"])]
            words.append(f"{what} {summary(extra)}")
        print(f"{name}: {'; '.join(words)}")


if __name__ == "__main__":
    sys.exit(main())
