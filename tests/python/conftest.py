"""Puts the scripts on the path; the bodies of modes/bodies.toml, their committed files, and one fresh computation of each."""
import functools
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from fem import generate, parameters  # noqa: E402

MODES = ROOT / "modes"
TABLES = parameters.read_tables(MODES / "bodies.toml")
BODIES = {name: parameters.parse_body(name, table) for name, table in TABLES.items()}


def pytest_generate_tests(metafunc):
    """A test with an argument `name` runs for every body."""
    if "name" in metafunc.fixturenames:
        metafunc.parametrize("name", BODIES)


@functools.cache
def _stored(name):
    with h5py.File(MODES / f"{name}.h5") as file:
        arrays = {}
        file.visititems(lambda path, item: arrays.update({path: item[()]}) if isinstance(item, h5py.Dataset) else None)
        # A visitor shows hard-linked fields only under /VTKHDF, whichever name it meets first; the schema's own names are wanted.
        for group in ("modes/displacement", "modes/stress", "mesh"):
            arrays |= {f"{group}/{key}": item[()] for key, item in file[group].items()}
        arrays["displacement"] = np.array([file[f"modes/displacement/{key}"][()] for key in sorted(file["modes/displacement"])], float)
        return arrays


@functools.cache
def _computed(name):
    return generate.compute(BODIES[name])


@pytest.fixture
def stored():
    """name -> arrays of the committed file by path, and all shapes (n,N,3) under `displacement`."""
    return _stored


@pytest.fixture
def computed():
    """name -> ModalData computed anew, once for all tests."""
    return _computed


@pytest.fixture
def bodies():
    """name -> parameters."""
    return BODIES


@pytest.fixture
def tables():
    """name -> raw parameter table."""
    return TABLES


@pytest.fixture
def modes_folder():
    """Folder of the committed files."""
    return MODES


@pytest.fixture(scope="session")
def panel():
    """Arrays of the committed panel as other codes hold them: about another origin."""
    from foreign_files import panel_arrays
    return panel_arrays()


@pytest.fixture(scope="session")
def fem():
    """The dictionary of an Exudyn FEM file of the panel."""
    from foreign_files import fem_dictionary
    return fem_dictionary(_computed("panel_cantilever"))
