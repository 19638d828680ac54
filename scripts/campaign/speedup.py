#!/usr/bin/env python3
"""Measures how a campaign gains by cores: cases per second on one thread and on all, in turn, so that the noise of the machine meets both.

A round in which other processes took more than a twentieth of a core is not counted: cores that are not there cannot be gained.
"""
import argparse
import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target" / "release" / "pliant"


# cores that others may take
QUIET = 0.05
# how long a quiet moment is waited for before a sweep, and how long all rounds may take (s)
PATIENCE, LONGEST = 120.0, 360.0


def machine_seconds():
    """Core seconds that the whole machine has worked, those taken by other guests of the host included."""
    user, nice, system, _idle, _wait, irq, softirq, steal = map(int, pathlib.Path("/proc/stat").read_text().split()[1:9])
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def own_seconds():
    """Core seconds of the sweeps so far and of this script."""
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_CHILDREN, resource.RUSAGE_SELF)]
    return sum(u.ru_utime + u.ru_stime for u in usage)


def wait_for_quiet():
    """Returns when the machine does nothing else, or when patience is at its end."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        before = machine_seconds()
        time.sleep(0.5)
        if machine_seconds() - before < 0.5 * QUIET:
            return


def rate(scene, plan, threads, options):
    """Cases per second of one sweep, and the cores that others took meanwhile."""
    before = machine_seconds(), own_seconds(), time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        command = [PROGRAM, "sweep", scene, plan, "--out", f"{scratch}/out.h5", "--threads", str(threads), "--json", *options]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"pliant sweep: {done.stderr}")
    after = machine_seconds(), own_seconds(), time.monotonic()
    machine, own, wall = (b - a for a, b in zip(before, after))
    report = json.loads(done.stdout)
    return report["completed"] / report["wall_s"], (machine - own) / wall


def measure(scene, plan, threads, rounds, options=()):
    """Median rates on one thread and on all, and the speed-up per core: the median over the rounds of rate(all) / (threads rate(1))."""
    pairs, end, number = [], time.monotonic() + LONGEST, 0
    while len(pairs) < rounds and time.monotonic() < end:
        number += 1
        order = (1, threads) if number % 2 else (threads, 1)
        wait_for_quiet()
        found = {count: rate(scene, plan, count, options) for count in order}
        others = max(taken for _, taken in found.values())
        counts = others <= QUIET
        print(f"{found[1][0]:.1f} and {found[threads][0]:.1f} cases/s" + ("" if counts else f", not counted: others took {others:.2f} cores"), file=sys.stderr)
        if counts:
            pairs.append((found[1][0], found[threads][0]))
    if not pairs:
        sys.exit("the machine was never quiet; end what else runs and try again")
    return {
        "threads": threads,
        "rounds": len(pairs),
        "rate_one": statistics.median(one for one, _ in pairs),
        "rate_all": statistics.median(many for _, many in pairs),
        "per_core": statistics.median(many / (threads * one) for one, many in pairs),
        "per_core_least": min(many / (threads * one) for one, many in pairs),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    example = ROOT / "examples" / "12_campaign"
    parser.add_argument("scene", nargs="?", type=pathlib.Path, default=example / "scene.toml")
    parser.add_argument("plan", nargs="?", type=pathlib.Path, default=example / "plan.toml")
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)), help="[default: one for each core]")
    parser.add_argument("--rounds", type=int, default=9)
    arguments, options = parser.parse_known_args()
    print(json.dumps(measure(arguments.scene, arguments.plan, arguments.threads, arguments.rounds, options), indent=2))


if __name__ == "__main__":
    main()
