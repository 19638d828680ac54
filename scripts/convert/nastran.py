"""Nastran: BDF for the model, OP2 for the modes, through pyNastran.

pyNastran needs an older numpy than the rest, so it lives in an environment of its own (`scripts/setup.sh` makes it) and hands over
plain arrays.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from .errors import InputError
from .foreign import Foreign


def python():
    """The interpreter that has pyNastran."""
    return Path(sys.prefix) / "nastran" / "bin" / "python"


def read(model, modes, subcase=0):
    """Foreign of a BDF and an OP2."""
    for file in (model, modes):
        if not Path(file).is_file():
            raise InputError(file, "file", "nothing", "a Nastran file", "check the path")
    if not python().is_file():
        raise InputError(python(), "pyNastran", "no such interpreter", "the environment that holds pyNastran", "run scripts/setup.sh")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "arrays.npz"
        command = [python(), Path(__file__).with_name("nastran_tables.py"), model, modes, str(subcase), target]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
        if done.returncode == 2:
            raise RefusedByReader(done.stderr.strip().splitlines()[-1])
        if done.returncode:
            raise InputError(model, "pyNastran", done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no reason given",
                             "a model that it reads", "look at the cards it names")
        with np.load(target) as arrays:
            return _foreign(Path(modes), dict(arrays))


class RefusedByReader(InputError):
    """A message that the reader has made already."""

    def __init__(self, message):
        ValueError.__init__(self, message)


def _foreign(file, arrays):
    labels, shapes = arrays["labels"], arrays["shapes"]
    place = {label: index for index, label in enumerate(labels.tolist())}
    sets = {name[4:]: (np.array([place[node] for node in nodes.tolist() if node in place], int), None)
            for name, nodes in arrays.items() if name.startswith("set_")}
    stated = None
    if "stated_mass" in arrays and np.ndim(arrays["stated_inertia"]) == 2:
        stated = (float(arrays["stated_mass"]), arrays["stated_center"], arrays["stated_inertia"])
    turning = np.any(shapes[:, :, 3:])
    notes = []
    if arrays["quadratic"]:
        notes.append(f"{int(arrays['quadratic'])} quadratic elements: their mass in equal parts on corner nodes")
    return Foreign(
        file=file, code="Nastran (BDF and OP2)", labels=labels, points=arrays["points"],
        cells=[(name[6:], block) for name, block in arrays.items() if name.startswith("cells_")],
        displacement=shapes[:, :, :3], rotation=shapes[:, :, 3:] if turning else None, frequency=arrays["frequency"],
        node_mass=arrays["mass"], node_inertia=arrays["inertia"], sets={name: item for name, item in sets.items() if len(item[0])},
        scaled=False, stated=stated, notes=notes)
