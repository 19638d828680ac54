#!/usr/bin/env python3
"""Counts the instructions of the hot paths and holds them against instruction_counts.json: times are noisy, counts are not.

Runs examples/peer under valgrind's callgrind, which counts only what happens in its function `measured`. Valgrind has no AVX-512, so the
counts are those of the path for AVX2. Without valgrind nothing is counted, and that is said.
"""
import argparse
import concurrent.futures
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = ROOT / "target" / "release" / "examples" / "peer"
BASELINE = ROOT / "scripts" / "instruction_counts.json"
# Repetitions of each case: enough for a count per repetition, few enough for seconds
CASES = {"rigid_chain": 50, "rigid_chain_loads": 50, "rigid_tree": 50, "flexible_order_0": 50, "flexible_order_2": 20, "loop_cut": 50,
         "loop_embedded": 50, "step_explicit": 20, "step_implicit": 20}
# A change below this is not looked at: another version of a library, or a branch taken by rounding
TOLERANCE = 0.03


def valgrind():
    """Path of valgrind: the machine's own, or Debian's package unpacked into .venv, where nothing needs to be installed. None if neither."""
    if found := shutil.which("valgrind"):
        return found, {}
    folder = ROOT / ".venv" / "valgrind"
    program = folder / "usr" / "bin" / "valgrind"
    if not program.exists() and shutil.which("apt-get") and shutil.which("dpkg-deb"):
        with tempfile.TemporaryDirectory() as scratch:
            subprocess.run(["apt-get", "download", "valgrind"], cwd=scratch, capture_output=True, text=True)
            for package in Path(scratch).glob("valgrind_*.deb"):
                subprocess.run(["dpkg-deb", "-x", package, folder], check=True)
    library = next(folder.glob("usr/libexec/valgrind"), None) or next(folder.glob("usr/lib/*/valgrind"), None)
    return (str(program), {"VALGRIND_LIB": str(library)}) if program.exists() and library else None


def count(tool, case):
    """Instructions of one repetition of a case."""
    program, environment = tool
    with tempfile.TemporaryDirectory() as scratch:
        command = [program, "--tool=callgrind", "--collect-atstart=no", "--toggle-collect=*count*measured*",
                   f"--callgrind-out-file={scratch}/callgrind", PROGRAM, "count", case, str(CASES[case])]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, **environment, "HDF5_USE_FILE_LOCKING": "FALSE"})
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or not found or found[1] == "0":
        sys.exit(f"{case}: {' '.join(map(str, command))} counted nothing:\n{done.stderr}")
    return round(int(found[1]) / CASES[case])


def versions():
    """What the counts depend on besides the code."""
    rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    return {"rustc": rustc, "machine": platform.machine()}


def main():
    """The command; exit status 1 if a count has grown, or shrunk without the file saying so."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", help=f"write the counts to {BASELINE.relative_to(ROOT)}, in place of holding them against it")
    options = parser.parse_args()
    if platform.machine() != "x86_64":
        print(f"instruction counts: left out, the stored ones are of x86_64 and this machine is {platform.machine()}")
        return 0
    tool = valgrind()
    if tool is None:
        print("instruction counts: left out, valgrind is not installed and cannot be downloaded (Debian: apt-get install valgrind)")
        return 0
    subprocess.run(["cargo", "build", "--release", "--locked", "--quiet", "--example", "peer"], cwd=ROOT, check=True)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        counts = dict(zip(CASES, pool.map(lambda case: count(tool, case), CASES)))
    if options.update:
        BASELINE.write_text(json.dumps({"versions": versions(), "per_repetition": counts}, indent=2) + "\n")
        print(f"instruction counts: written to {BASELINE.relative_to(ROOT)}")
        return 0
    stored = json.loads(BASELINE.read_text())
    failed = []
    for case, found in counts.items():
        expected = stored["per_repetition"].get(case)
        change = found / expected - 1 if expected else float("inf")
        failed += [case] if abs(change) > TOLERANCE else []
        print(f"{case:20s} {found:>10,} instructions, stored {expected or 0:>10,}: {100 * change:+.2f} %")
    if not failed:
        return 0
    if stored["versions"] != versions():
        print(f"the stored counts are of {stored['versions']['rustc']}, this is {versions()['rustc']}")
    print(f"instruction counts of {', '.join(failed)} changed by more than {100 * TOLERANCE:g} %; if that is meant, run scripts/count_instructions.py "
          "--update and commit the file")
    return 1


if __name__ == "__main__":
    sys.exit(main())
