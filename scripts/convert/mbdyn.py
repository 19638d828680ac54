"""MBDyn's `.fem`: text in record groups, with modal mass and stiffness, lumped masses and, in some files, the rigid-body inertia.

The file has no elements; a mesh of the same nodes, in any format of meshio, gives the surface.
"""
import re
from pathlib import Path

import numpy as np
import scipy.linalg

from .errors import InputError
from .foreign import Foreign
from .mesh import cells_on


def read(file, mesh=None):
    """Foreign of a `.fem` file."""
    file = Path(file)
    groups = _groups(file)
    header = _group(groups, file, 1, "the header")
    words = header.split()
    if len(words) < 6 or not all(word.isdigit() for word in words[1:6]):
        raise InputError(file, "record group 1 (header)", f"\"{' '.join(words[:6])}\"", "a revision and five counts", "write the file again")
    nodes, normal, attachment, constraint, rejected = map(int, words[1:6])
    count = normal + attachment + constraint - rejected
    labels = _numbers(_group(groups, file, 2, "node numbers"), file, "record group 2 (node numbers)", nodes).astype(int)
    points = np.stack([_numbers(_group(groups, file, number, f"{axis} coordinates"), file, f"record group {number} ({axis} coordinates)", nodes)
                       for number, axis in ((5, "X"), (6, "Y"), (7, "Z"))], axis=1)
    shapes = _numbers(_group(groups, file, 8, "mode shapes"), file, "record group 8 (mode shapes)", count * nodes * 6).reshape(count, nodes, 6)
    mass = _numbers(_group(groups, file, 9, "modal mass"), file, "record group 9 (modal mass)", count ** 2).reshape(count, count)
    stiffness = _numbers(_group(groups, file, 10, "modal stiffness"), file, "record group 10 (modal stiffness)", count ** 2).reshape(count, count)
    try:
        squared, basis = scipy.linalg.eigh((stiffness + stiffness.T) / 2, (mass + mass.T) / 2)
    except np.linalg.LinAlgError as error:
        raise InputError(file, "record group 9 (modal mass)", "a matrix that is not positive definite", "the modal mass of independent modes", "write the file again") from error
    turned = np.tensordot(basis.T, shapes, 1)
    damping, notes = _damping(groups, file, count, basis, squared), []
    if np.abs(basis - np.diag(np.diag(basis))).max() > 1e-9 * np.abs(basis).max():
        notes.append("modes combined to those of the modal mass and stiffness of the file")
    lumped, inertia = _lumped(groups, file, nodes, labels)
    return Foreign(
        file=file, code="MBDyn .fem", labels=labels, points=points, cells=[] if mesh is None else cells_on(mesh, points, file),
        displacement=turned[:, :, :3], rotation=turned[:, :, 3:], frequency=np.sqrt(np.maximum(squared, 0.0)) / (2 * np.pi),
        damping_ratio=damping, node_mass=lumped, node_inertia=inertia, scaled=True, stated=_stated(groups, file),
        craig_bampton=attachment + constraint > 0, notes=notes)


def _groups(file):
    """Text of every record group by number, comment lines left out."""
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError(file, "file", f"nothing to read ({error.strerror})", "an MBDyn .fem file", "check the path") from error
    groups, number = {}, None
    for line in lines:
        found = re.match(r"\s*\*\*\s*RECORD GROUP\s+(\d+)", line, re.IGNORECASE)
        if found:
            number = int(found[1])
            groups[number] = []
        elif number is not None and not line.lstrip().startswith("**"):
            groups[number].append(line)
    if not groups:
        raise InputError(file, "record groups", "none", "lines as ** RECORD GROUP 1, HEADER", "name an MBDyn .fem file")
    return {number: "\n".join(lines) for number, lines in groups.items()}


def _group(groups, file, number, meaning):
    if number not in groups:
        raise InputError(file, f"record group {number} ({meaning})", "nothing", "the group", "write the file with it")
    return groups[number]


def _numbers(text, file, place, count):
    try:
        values = np.array([float(word.replace("D", "E").replace("d", "e")) for word in text.split()])
    except ValueError as error:
        raise InputError(file, place, str(error).replace("could not convert string to float: ", "the word "), "numbers", "repair the file") from error
    if len(values) != count:
        raise InputError(file, place, f"{len(values)} numbers", f"{count} by the header", "write the file again")
    return values


def _lumped(groups, file, nodes, labels):
    if 11 not in groups:
        return None, None
    diagonal = _numbers(groups[11], file, "record group 11 (lumped masses)", 6 * nodes).reshape(nodes, 6)
    uneven = np.ptp(diagonal[:, :3], axis=1) > 1e-6 * np.abs(diagonal[:, :3]).max()
    if uneven.any():
        worst = int(np.argmax(uneven))
        raise InputError(file, f"record group 11 (lumped masses), node {labels[worst]}", f"masses {diagonal[worst, :3].tolist()} in x, y, z",
                         "one mass in all three", "lump the mass equally in all directions, or give --node-mass")
    return diagonal[:, 0], np.hstack([diagonal[:, 3:], np.zeros((nodes, 3))])


def _stated(groups, file):
    if 12 not in groups:
        return None
    values = _numbers(groups[12], file, "record group 12 (rigid-body inertia)", 13)
    return float(values[0]), values[1:4], values[4:].reshape(3, 3)


def _damping(groups, file, count, basis, squared):
    """Ratios where the file's modal damping is diagonal in the modes, else None."""
    if 13 not in groups:
        return None
    matrix = basis.T @ _numbers(groups[13], file, "record group 13 (modal damping)", count ** 2).reshape(count, count) @ basis
    off = np.abs(matrix - np.diag(np.diag(matrix))).max()
    if off > 1e-6 * np.abs(matrix).max():
        raise InputError(file, "record group 13 (modal damping)", f"coupling of modes by {off:.3g}", "damping of each mode alone",
                         "remove the group and give --damping-ratio")
    return np.diag(matrix) / (2 * np.sqrt(np.maximum(squared, np.finfo(float).tiny)))
