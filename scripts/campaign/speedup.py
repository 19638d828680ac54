#!/usr/bin/env python3
"""Measures how a campaign gains by cores: cases per second on one thread and on all, in turn, so that the noise of the machine meets both."""
import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target" / "release" / "pliant"


def rate(scene, plan, threads, options):
    """Cases per second of one sweep."""
    with tempfile.TemporaryDirectory() as scratch:
        command = [PROGRAM, "sweep", scene, plan, "--out", f"{scratch}/out.h5", "--threads", str(threads), "--json", *options]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"pliant sweep: {done.stderr}")
    report = json.loads(done.stdout)
    return report["completed"] / report["wall_s"]


def measure(scene, plan, threads, rounds, options=()):
    """Median rates on one thread and on all, and the speed-up per core: the median over the rounds of rate(all) / (threads rate(1))."""
    pairs = []
    for number in range(rounds):
        order = (1, threads) if number % 2 else (threads, 1)
        found = {count: rate(scene, plan, count, options) for count in order}
        pairs.append((found[1], found[threads]))
        print(f"round {number + 1}: {found[1]:.1f} and {found[threads]:.1f} cases/s", file=sys.stderr)
    return {
        "threads": threads,
        "rounds": rounds,
        "rate_one": statistics.median(one for one, _ in pairs),
        "rate_all": statistics.median(many for _, many in pairs),
        "per_core": statistics.median(many / (threads * one) for one, many in pairs),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    example = ROOT / "examples" / "12_campaign"
    parser.add_argument("scene", nargs="?", type=pathlib.Path, default=example / "scene.toml")
    parser.add_argument("plan", nargs="?", type=pathlib.Path, default=example / "plan.toml")
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)), help="[default: one for each core]")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    print(json.dumps(measure(arguments.scene, arguments.plan, arguments.threads, arguments.rounds), indent=2))


if __name__ == "__main__":
    main()
