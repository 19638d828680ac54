"""What every reader delivers, in the units and axes of its file."""
import dataclasses
from pathlib import Path

import numpy as np


@dataclasses.dataclass
class Foreign:
    """A model with N nodes and n modes; None where the file holds nothing.

    labels (N,): node numbers of the code. points (N,3). cells: list of (meshio type, (E,k) node indices).
    displacement (n,N,3), rotation (n,N,3): shapes. frequency (n,) in Hz. node_mass (N,); node_inertia (N,6) xx yy zz xy yz xz.
    scalar_mass: sparse (N,N), the consistent matrix of one direction. stress (n,N,6) xx yy zz xy yz xz.
    sets: name -> (indices, weights or None). scaled: whether the code states unit modal mass.
    stated: (mass, centre (3,), inertia about the centre (3,3)) as the code computed it.
    """
    file: Path
    code: str
    labels: np.ndarray
    points: np.ndarray
    cells: list
    displacement: np.ndarray
    frequency: np.ndarray
    rotation: np.ndarray | None = None
    damping_ratio: np.ndarray | None = None
    node_mass: np.ndarray | None = None
    node_inertia: np.ndarray | None = None
    scalar_mass: object = None
    stress: np.ndarray | None = None
    sets: dict = dataclasses.field(default_factory=dict)
    scaled: bool = False
    stated: tuple | None = None
    craig_bampton: bool = False
    notes: list = dataclasses.field(default_factory=list)
