"""What the benchmark rests on: its models are the same by formula and from files, and a run at default settings has the loads it should."""
import h5py
import numpy as np
import pytest

from peers import engines, flexible, models, panel, rigid

# what sizing asks of hinge forces
LOADS = 0.02


@pytest.fixture(scope="module", autouse=True)
def program():
    """pliant's driver, which `cargo test` has built."""
    engines.build_pliant()


@pytest.fixture(scope="module")
def panels(tmp_path_factory):
    """Folder with the panel of 12 modes."""
    folder = tmp_path_factory.mktemp("panels")
    panel.write(folder, [flexible.CASE[1]])
    return folder


@pytest.mark.parametrize("model, n", [("chain", 16), ("tree", 8)])
def test_models_by_formula_are_those_of_the_files(tmp_path, model, n):
    path = tmp_path / "model"
    {"chain": models.chain, "tree": models.tree}[model](n).write(path)
    driver = engines.Driver("pliant", [engines.PLIANT, "rigid"])
    by_formula, by_file = (driver.numbers(name, n, "accelerations", 0) for name in (model, path))
    condition = driver.numbers(path, n, "condition", 0)[0]
    driver.close()
    assert np.abs(np.subtract(by_formula, by_file)).max() <= rigid.SOLVE * condition * np.abs(by_formula).max()


def test_unknown_requests_are_skipped_and_do_not_end_the_program():
    driver = engines.Driver("pliant", [engines.PLIANT, "rigid"])
    assert driver.numbers("chain", 4, "integrate", 0.01) is None
    least, median, check = driver.numbers("chain", 4, "fdf", 0.01)
    driver.close()
    assert 0 < least <= median and check == pytest.approx(33.3591563, abs=5e-8)


def test_a_random_tree_has_moments_of_inertia_that_a_body_can_have():
    for link in models.random_tree(3, 50).links:
        xx, yy, zz, xy, xz, yz = link.inertia
        values = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert values[0] > 0 and values[2] <= values[0] + values[1] + 1e-12 * values[2]


def test_the_panel_has_the_mass_and_the_frequencies_of_the_case(panels):
    with h5py.File(panels / f"panel_{flexible.CASE[1]}.h5") as file:
        frequency, mass = file["modes/frequency"][()], file["body/mass"][()]
    # half of the last digit given: 8 kg, 5.3 Hz to 660 Hz
    assert abs(mass - 8) < 0.5e-6
    assert abs(frequency[0] - 5.3) < 0.05 and abs(frequency[-1] - 660) < 0.5


def test_default_settings_keep_every_hinge_force_within_what_sizing_asks(panels):
    count, modes, duration = flexible.CASE
    driver = engines.Driver("pliant", [engines.PLIANT, "flexible", panels])
    reference = driver.object(count, modes, "dormand_prince", 1e-9, duration, "history")
    run = flexible.Run("pliant", "auto", [], driver.object(count, modes, "auto", 1e-6, duration, "history"))
    driver.close()
    error = run.largest_error(reference)
    print(f"largest error of a hinge force {100 * error:.2g} %, {run.answer['cpu'] / duration:.3f} s of CPU time per simulated second")
    assert len(run.answer["forces"]) == 31
    assert error <= LOADS
