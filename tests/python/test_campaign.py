"""Campaigns: the results file in h5py, a load known from elsewhere, and the recipes that run shards on Slurm and Dask."""
import json
import os
import pathlib
import subprocess

import h5py
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target" / "release" / "pliant"
RECIPES = ROOT / "scripts" / "campaign"
EXAMPLE = ROOT / "examples" / "12_campaign"
DASK = ROOT / ".venv" / "dask" / "bin" / "python"

pytestmark = pytest.mark.skipif(not PROGRAM.exists(), reason="target/release/pliant is not built")


def sweep(*arguments):
    done = subprocess.run([PROGRAM, "sweep", *map(str, arguments), "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The example's campaign with two samples at each sun angle, in one piece: plan and results."""
    folder = tmp_path_factory.mktemp("campaign")
    plan = folder / "plan.toml"
    plan.write_text((EXAMPLE / "plan.toml").read_text().replace("samples = 40", "samples = 2"))
    out = folder / "whole.h5"
    return plan, out, sweep(EXAMPLE / "scene.toml", plan, "--out", out)


def test_wings_turned_edge_on_load_their_drives_as_rigid_bodies(whole):
    # a torque T about x turns hub and wings; wings of 5 kg/m from 0.5 m to 4.5 m, 1 m wide, do not bend in their plane:
    # each drive carries its wing's moment of inertia about the drive and x, times T over the whole moment of inertia
    per_length, start, length, width = 5.0, 0.5, 4.0, 1.0
    across = per_length * length * width**2 / 12
    about_hub = per_length * ((start + length) ** 3 - start**3) / 3 + across
    about_drive = per_length * (length**3 / 3 + start * length**2 / 2) + across
    share = about_drive / (120.0 + 2 * about_hub)
    assert abs(share - 0.30078) < 5e-6
    with h5py.File(whole[1]) as file:
        edge_on = np.isclose(file["parameters/sun angle"][:], np.pi / 2)
        torque, frequency = file["parameters/torque"][:], file["parameters/frequency"][:]
        for drive in ("left_drive", "right_drive"):
            moment = np.maximum(file[f"hinges/{drive}/max"][:, 2], -file[f"hinges/{drive}/min"][:, 2])
            # a peak between steps of at most 10 ms is missed by (pi f h)^2 / 2; a quarter of a period must pass
            allowed = (np.pi * frequency * 0.01) ** 2 / 2 + 1e-5
            seen = edge_on & (frequency * 8.0 > 0.25)
            assert seen.sum() == 2
            assert (np.abs(moment / (share * torque) - 1)[seen] < allowed[seen]).all()


def test_a_results_file_gives_the_envelope_and_the_case_behind_it(whole):
    _, out, report = whole
    with h5py.File(out) as file:
        drive = file["envelope/hinges/left_drive"]
        worst, case, load = drive["max"][1], drive["max_case"][1], drive["load_at_max"][1]
        of_case = {name: values[case - 1] for name, values in file["parameters"].items()}
        attributes = {key: value.decode() if isinstance(value, bytes) else value for key, value in drive["max"].attrs.items()}
        assert load[1] == worst == file["hinges/left_drive/max"][:, 1].max()
        assert (file["hinges/left_drive/load_at_max"][case - 1, 1] == load).all()
        assert file["cases/completed"][:].all() and set(file["cases/message"].asstr()[:]) == {""}
        assert bytes(file["scene/toml"][:]).decode() == (EXAMPLE / "scene.toml").read_text()
    assert attributes["unit"] == "N m, N m, N m, N, N, N" and attributes["side"] == "by hub on left_inner"
    row = report["hinges"]["left_drive"]["rows"][1]
    assert (row["value"], row["case"], row["load"]) == (worst, case, list(load))
    assert row["parameters"] == [of_case[name] for name in report["parameters"]]


def merged_is(folder, name, whole):
    assert (folder / name).read_bytes() == whole[1].read_bytes()


def test_a_slurm_array_merges_to_the_same_file(whole, tmp_path):
    script = RECIPES / "slurm_array.sh"
    for task in (1, 2, 3):
        environment = {**os.environ, "PLIANT": str(PROGRAM), "SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": "3", "SLURM_CPUS_PER_TASK": "2"}
        done = subprocess.run([script, EXAMPLE / "scene.toml", whole[0], tmp_path / "out.h5"], env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    parts = sorted(tmp_path.glob("out.*-of-3.state.jsonl"))
    done = subprocess.run([PROGRAM, "merge", *parts, "--out", tmp_path / "out.h5"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    merged_is(tmp_path, "out.h5", whole)
    assert subprocess.run([script], capture_output=True).returncode == 2


def test_dask_runs_the_shards_on_a_local_cluster_and_merges_them(whole, tmp_path):
    assert DASK.exists(), "scripts/setup.sh makes .venv/dask"
    command = [DASK, RECIPES / "dask_shards.py", EXAMPLE / "scene.toml", whole[0], "--out", tmp_path / "out.h5", "--shards", "3",
               "--workers", "2", "--pliant", PROGRAM]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert all(f"shard {shard} of 3 is complete" in done.stderr for shard in (1, 2, 3))
    merged_is(tmp_path, "out.h5", whole)
    # a shard that fails is named, with what it says, and nothing is merged
    (tmp_path / "out.h5").unlink()
    done = subprocess.run([*command, "--integrator", "euler"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 1 and "shards 1, 2, 3 are not complete" in done.stderr and '"euler" is not an integrator' in done.stderr
    assert not (tmp_path / "out.h5").exists()
