"""A results file is read by h5py in three lines and plotted by the script; its loads are those of the closing report."""
import json
import pathlib
import re
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target" / "release" / "pliant"
SCENE = ROOT / "examples" / "02_hub_two_panels" / "scene.toml"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    if not PROGRAM.exists():
        pytest.skip("target/release/pliant is not built")
    path = tmp_path_factory.mktemp("results") / "run.h5"
    done = subprocess.run([PROGRAM, "run", SCENE, "--out", path, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return path, json.loads(done.stdout)


def test_a_results_file_holds_histories_with_unit_frame_point_and_side(run):
    with h5py.File(run[0]) as file:
        time, moment = file["time"][:], file["hinges/drive_left/load_moment"][:]
        attributes = {key: value.decode() if isinstance(value, bytes) else value for key, value in file["hinges/drive_left/load_moment"].attrs.items()}
    assert moment.shape == (len(time), 3) and time[0] == 0 and time[-1] == 30
    assert attributes["unit"] == "N m" and attributes["point"] == "O" and "hub on panel_left" in attributes["side"]
    assert "drive_left" in attributes["frame"]


def test_peaks_of_the_report_bound_those_of_the_histories(run):
    path, report = run
    with h5py.File(path) as file:
        for hinge in ("drive_left", "drive_right"):
            peak = np.linalg.norm(file[f"hinges/{hinge}/load_moment"][:], axis=1).max()
            reported = report["peaks"]["hinges"][hinge]["moment"]
            # the report also looks at every step: between 30 output times a second the fastest ripple, 1.8 Hz of a tenth of the
            # load, hides at most a tenth of (pi 1.8 / 30)^2 / 2
            assert peak <= reported * (1 + 4 * np.finfo(float).eps) and reported < peak * 1.002


def test_a_results_file_holds_its_scene_and_the_digests_of_its_modal_files(run):
    with h5py.File(run[0]) as file:
        assert bytes(file["scene/toml"][:]).decode() == SCENE.read_text()
        stored = file["scene/modal_files/panel_left"].attrs["content_sha256"]
    with h5py.File(ROOT / "modes" / "panel_cantilever.h5") as modal:
        expected = modal.attrs["content_sha256"]
    text = lambda x: x.decode() if isinstance(x, bytes) else str(x)  # noqa: E731
    assert text(stored) == text(expected)


def test_the_plot_script_draws_a_results_file(run, tmp_path):
    picture = tmp_path / "plot.png"
    done = subprocess.run([sys.executable, ROOT / "scripts" / "plot_results.py", run[0], "--out", picture], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 20_000


def test_loads_at_closures_are_read_and_drawn(tmp_path):
    if not PROGRAM.exists():
        pytest.skip("target/release/pliant is not built")
    results, picture = tmp_path / "run.h5", tmp_path / "plot.png"
    scene = ROOT / "examples" / "06_four_bar" / "scene.toml"
    done = subprocess.run([PROGRAM, "run", scene, "--duration", "1", "--out", results, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    with h5py.File(results) as file:
        force = file["closures/rocker_pin/load_force"][:]
    end = report["final"]["closures"]["rocker_pin"]["load"]["force"]
    # the last row is evaluated at the interpolant of the last step, projected onto the closures
    assert np.linalg.norm(force[-1] - end) < 1e-9 * np.linalg.norm(end)
    peak = np.linalg.norm(force, axis=1).max()
    assert peak <= report["peaks"]["closures"]["rocker_pin"]["force"] * (1 + 4 * np.finfo(float).eps)

    draw = [sys.executable, ROOT / "scripts" / "plot_results.py", results, "--out", picture]
    done = subprocess.run(draw, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 20_000
    done = subprocess.run([*draw, "--closure", "pin"], capture_output=True, text=True)
    assert done.returncode != 0 and "no loads of closure pin in the file; it has rocker_pin" in done.stderr


def largest_memory(*arguments):
    """Largest resident memory (MB) of a command, from its process while it lives."""
    largest = 0
    with subprocess.Popen([PROGRAM, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        while process.poll() is None:
            status = re.search(r"VmHWM:\s*(\d+) kB", pathlib.Path(f"/proc/{process.pid}/status").read_text())
            largest = max(largest, int(status[1]) / 1e3 if status else 0)
            time.sleep(0.01)
        assert process.returncode == 0, process.stderr.read()
    return largest


@pytest.mark.skipif(not pathlib.Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_memory_does_not_grow_with_the_run(run, tmp_path):
    """Ten times the output times, 44 MB more in the file: a run may add its room for blocks on their way, 32 MB, and a little for their use; an export
    reads block by block and adds nothing but the list of chunks."""
    text = SCENE.read_text().replace("../../modes", str(ROOT / "modes"))
    used = []
    for duration in (2, 20):
        scene, results = tmp_path / f"scene_{duration}.toml", tmp_path / f"run_{duration}.h5"
        scene.write_text(re.sub(r"^duration = .*$", f"duration = {duration}.0", re.sub(r"^rate_hz = .*$", "rate_hz = 2000.0", text, flags=re.M), flags=re.M))
        written = largest_memory("run", scene, "--viewer", "none", "--out", results)
        used.append((written, largest_memory("export", results, "--format", "csv", "--out", tmp_path / "run.csv")))
    with h5py.File(results) as file:
        assert len(file["time"]) == 40_001
    assert used[1][0] - used[0][0] < 40 and used[1][1] - used[0][1] < 8, used
