"""Installs the peers, builds their drivers, and keeps each as a process that answers one line per request."""
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv" / "benchmark"
REQUIREMENTS = ROOT / "scripts" / "requirements-benchmark.txt"
BUILD = ROOT / "target" / "benchmark"
PLIANT = ROOT / "target" / "release" / "examples" / "peer"
# Packages of each peer; each is installed by itself, so that one that does not install leaves the others
PACKAGES = {"pinocchio": ("pin", "libpinocchio", "cmeel-eigen"), "mujoco": ("mujoco",), "drake": ("drake",), "exudyn": ("exudyn", "scipy")}
# Pinocchio keeps four tensors of (rates)^3: 9 GB for a chain of 1,024
LARGEST = {"pinocchio": 300}
# GB of free memory that the compiler takes for one driver
COMPILER_MEMORY = {"pinocchio": 4.0, "mujoco": 0.5}


def say(*words):
    """A line on standard error."""
    print("benchmark:", *words, file=sys.stderr, flush=True)


class Unavailable(Exception):
    """A peer that is left out, and why."""


def install(peer):
    """Installs the packages of a peer into the environment; nothing happens if they are there."""
    python = ENVIRONMENT / "bin" / "python"
    if not python.exists():
        say(f"making the environment {ENVIRONMENT.relative_to(ROOT)}")
        subprocess.run([sys.executable, "-m", "venv", ENVIRONMENT], check=True)
    pinned = dict(line.split("==") for line in REQUIREMENTS.read_text().splitlines() if "==" in line)
    wanted = [f"{name}=={pinned[name]}" for name in (*PACKAGES[peer], "numpy")]
    mark = ENVIRONMENT / f"{peer}.installed"
    if not mark.exists() or mark.read_text() != " ".join(wanted):
        say(f"installing {' '.join(wanted)}")
        done = subprocess.run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-c", REQUIREMENTS, *wanted],
                              capture_output=True, text=True)
        if done.returncode:
            reasons = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
            raise Unavailable(f"does not install: {reasons[0] if reasons else 'pip failed'}")
        mark.write_text(" ".join(wanted))
    return python


def _free_memory():
    """GB, or none where the system does not say."""
    try:
        found = re.search(r"MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text())
    except OSError:
        return None
    return int(found[1]) / 1e6 if found else None


def _compile(peer, flags, libraries=()):
    """Builds the driver of a peer with the flags of a release for this machine; nothing happens if it is newer than its sources."""
    source, program = HERE / f"{peer}.cpp", BUILD / peer
    if program.exists() and program.stat().st_mtime > max(source.stat().st_mtime, (HERE / "protocol.hpp").stat().st_mtime):
        return program
    compiler = os.environ.get("CXX") or shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        raise Unavailable("no C++ compiler; install g++")
    free = _free_memory()
    if free is not None and free < COMPILER_MEMORY[peer]:
        raise Unavailable(f"its driver takes {COMPILER_MEMORY[peer]} GB of memory to compile, and {free:.1f} GB are free")
    say(f"compiling the driver of {peer}")
    BUILD.mkdir(parents=True, exist_ok=True)
    command = [compiler, "-std=c++17", "-O3", "-march=native", "-DNDEBUG", "-w", *flags, source, *libraries, "-o", program]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise Unavailable(f"its driver does not compile: {done.stderr.strip().splitlines()[0] if done.stderr.strip() else 'compiler failed'}")
    return program


def _package_folder(python, module):
    """Folder of an installed module."""
    code = f"import importlib.util as u; print(u.find_spec({module!r}).origin)"
    return Path(subprocess.run([python, "-c", code], check=True, capture_output=True, text=True).stdout.strip()).parent


def command(peer, *arguments):
    """Installs and builds what a peer needs and gives the command of its driver. Raises Unavailable."""
    python = install(peer)
    if peer == "pinocchio":
        prefix = _package_folder(python, "cmeel").parent / "cmeel.prefix" / "include"
        # the list of joint types is longer than Boost's default
        limits = ["-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
                  "-DBOOST_FUSION_INVOKE_MAX_ARITY=12"]
        return [_compile(peer, [*limits, "-isystem", prefix, "-isystem", prefix / "eigen3"])]
    if peer == "mujoco":
        folder = _package_folder(python, "mujoco")
        library = next(folder.glob("libmujoco.so.*"), None)
        if library is None:
            raise Unavailable("its package holds no library to link with")
        return [_compile(peer, [f"-I{folder / 'include'}"], [library, f"-Wl,-rpath,{folder}"])]
    return [python, HERE / f"{peer}_peer.py", *arguments]


class Driver:
    """One program under the line protocol. `by_file`: whether it reads model files; else it knows models by name."""

    def __init__(self, name, arguments, by_file=True):
        self.name, self.by_file = name, by_file
        self.arguments = [str(a) for a in arguments]
        self._start()

    def _start(self):
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "HDF5_USE_FILE_LOCKING": "FALSE"}
        self.process = subprocess.Popen(self.arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)

    def restart(self):
        """Starts a compiled program anew: where its stack and its arrays come to lie in memory moves short times by some per cent."""
        if self.process is not None and not Path(self.arguments[0]).name.startswith("python"):
            self.close()
            self._start()

    def ask(self, *request):
        """Words of the answer; none if the program does not know the request or has ended."""
        if self.process is None:
            return None
        try:
            print(*request, file=self.process.stdin, flush=True)
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            say(f"{self.name} ended at the request \"{' '.join(map(str, request))}\"; left out from here on")
            self.process = None
            return None
        words = line.split()
        return None if words == ["skip"] else words

    def numbers(self, *request):
        """The answer as numbers, or none."""
        words = self.ask(*request)
        return None if words is None else [float(word) for word in words]

    def object(self, *request):
        """The answer as a JSON object; lines before it, such as greetings, are skipped."""
        words = self.ask(*request)
        while words is not None and not words[0].startswith("{"):
            words = self.process.stdout.readline().split() or None
        return None if words is None else json.loads(" ".join(words))

    def close(self):
        """Ends the program."""
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait()


def build_pliant():
    """Builds pliant's own driver."""
    say("building pliant's driver, examples/peer")
    subprocess.run(["cargo", "build", "--release", "--locked", "--example", "peer"], cwd=ROOT, check=True)


def start(peers, *arguments):
    """Drivers of pliant's peers of those names; those that cannot be had are named with the reason."""
    drivers = {}
    for peer in peers:
        try:
            drivers[peer] = Driver(peer, command(peer, *arguments))
        except Unavailable as reason:
            say(f"{peer} is left out: {reason}")
    return drivers


def kernels(given):
    """Drivers of programs that are named on the command line as NAME=COMMAND."""
    found = {}
    for text in given:
        name, _, line = text.partition("=")
        if not line:
            sys.exit(f"--kernel {text}: write NAME=COMMAND, for example kernel=\"path/to/program argument\"")
        found[name] = Driver(name, shlex.split(line), by_file=False)
    return found


def machine():
    """The processor in words: model and widest vector unit."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return "an unnamed processor"
    name = re.search(r"model name\s*:\s*(.*)", text)
    flags = set((re.search(r"flags\s*:\s*(.*)", text) or [None, ""])[1].split())
    vectors = "AVX-512" if "avx512f" in flags else "AVX2" if "avx2" in flags else "SSE2"
    return f"{name[1] if name else 'an unnamed processor'}, {vectors}"
