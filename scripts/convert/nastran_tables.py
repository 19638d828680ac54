"""Reads a Nastran model and its modes with pyNastran and leaves them as plain arrays. Run by `nastran`, in pyNastran's own environment.

    nastran_tables.py MODEL.bdf MODES.op2 SUBCASE OUT.npz      (SUBCASE 0: the only one)

Everything is in basic axes. A message for the user goes to standard error, with exit status 2.
"""
import sys

import numpy as np
from pyNastran.bdf.bdf import BDF
from pyNastran.op2.op2 import OP2

# Nastran's types as meshio names them, corner nodes, and the order of nodes in VTK.
_CELLS = {
    ("CTETRA", 4): ("tetra", 4, None), ("CTETRA", 10): ("tetra10", 4, None),
    ("CPYRAM", 5): ("pyramid", 5, None), ("CPENTA", 6): ("wedge", 6, None),
    ("CPENTA", 15): ("wedge15", 6, [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11]),
    ("CHEXA", 8): ("hexahedron", 8, None),
    ("CHEXA", 20): ("hexahedron20", 8, [*range(12), *range(16, 20), *range(12, 16)]),
    ("CTRIA3", 3): ("triangle", 3, None), ("CTRIAR", 3): ("triangle", 3, None), ("CTRIA6", 6): ("triangle6", 3, None),
    ("CQUAD4", 4): ("quad", 4, None), ("CQUADR", 4): ("quad", 4, None), ("CSHEAR", 4): ("quad", 4, None), ("CQUAD8", 8): ("quad8", 4, None),
    ("CBAR", 2): ("line", 2, None), ("CBEAM", 2): ("line", 2, None), ("CROD", 2): ("line", 2, None), ("CONROD", 2): ("line", 2, None),
    ("CTUBE", 2): ("line", 2, None),
}
_MASSLESS = ("CELAS1", "CELAS2", "CELAS3", "CELAS4", "CBUSH", "CBUSH1D", "CDAMP1", "CDAMP2", "CDAMP3", "CDAMP4", "CVISC", "CGAP", "CFAST", "PLOTEL")


class Refusal(Exception):
    """A message of the form file: place: found, expected; remedy."""


def refuse(file, place, found, expected, remedy):
    raise Refusal(f"{file}: {place}: found {found}, expected {expected}; {remedy}")


def read_model(path):
    """The model with its cross references."""
    model = BDF(debug=False, log=None, mode="msc")
    with open(path, encoding="latin-1") as deck:
        bulk_only = not any(line.upper().lstrip().startswith("BEGIN") for line in deck)
    try:
        model.read_bdf(path, xref=True, punch=bulk_only)
    except (Exception, SystemExit) as error:      # pyNastran raises what the card's reader met
        refuse(path, "bulk data", f"a deck that pyNastran cannot read ({type(error).__name__}: {str(error).strip().splitlines()[0] if str(error).strip() else ''})",
               "a BDF with GRIDs, elements, properties and materials", "write the deck without includes of other programs, or repair the card")
    return model


def read_modes(path, subcase):
    """Eigenvectors of one subcase."""
    results = OP2(debug=False, log=None)
    try:
        results.read_op2(path, build_dataframe=False, skip_undefined_matrices=True)
    except (Exception, SystemExit) as error:
        refuse(path, "OP2", f"a file that pyNastran cannot read ({type(error).__name__})", "an OP2 with eigenvectors", "write it with PARAM,POST,-1")
    tables = {int(key if np.isscalar(key) else key[0]): table for key, table in results.eigenvectors.items()}
    if not tables:
        refuse(path, "eigenvectors (OUGV1)", "none", "those of a normal modes analysis (SOL 103)", "ask for DISPLACEMENT(PLOT)=ALL or VECTOR=ALL and PARAM,POST,-1")
    if subcase == 0 and len(tables) > 1:
        refuse(path, "eigenvectors", f"subcases {', '.join(map(str, sorted(tables)))}", "one subcase", "choose with --subcase")
    if subcase and subcase not in tables:
        refuse(path, "eigenvectors", f"no subcase {subcase}", f"one of: {', '.join(map(str, sorted(tables)))}", "correct --subcase")
    return tables[subcase or next(iter(tables))], results


def to_basic(node, shapes, file):
    """Translations and rotations (n,6) of a node from its displacement axes to basic axes."""
    frame = node.cd_ref
    if frame is None or frame.cid == 0:
        return shapes
    axes = frame.beta().T            # columns: axes of the frame in basic
    if frame.type in ("CORD1C", "CORD2C"):
        x, y = (frame.beta() @ (node.get_position() - frame.origin))[:2]
        angle = np.arctan2(y, x)
        axes = axes @ np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    elif frame.type not in ("CORD1R", "CORD2R"):
        refuse(file, f"GRID {node.nid}", f"displacement axes of the kind {frame.type}", "rectangular or cylindrical ones", "give the nodes other displacement axes")
    return np.concatenate([shapes[:, :3] @ axes.T, shapes[:, 3:] @ axes.T], axis=1)


def masses(model, place, file):
    """Nodal masses, nodal inertias and cells: an element's mass in equal parts on its corners, concentrated masses where they are."""
    mass, inertia, cells, quadratic = np.zeros(len(place)), np.zeros((len(place), 6)), {}, 0
    for element in model.elements.values():
        nodes = [node for node in element.node_ids if node is not None and node != 0]
        known = _CELLS.get((element.type, len(nodes)))
        if known is None:
            if element.type in _MASSLESS:
                continue
            refuse(file, f"{element.type} {element.eid}", f"an element of {len(nodes)} nodes that is not carried", "solids, shells, bars and rods",
                   "replace it, or condense the model to GRIDs with CONM2")
        kind, corners, order = known
        indices = np.array([place[node] for node in nodes])
        cells.setdefault(kind, []).append(indices if order is None else indices[order])
        share = element.Mass() / corners
        quadratic += share > 0 and len(nodes) > corners
        np.add.at(mass, indices[:corners], share)
    for element in model.masses.values():
        if element.type != "CONM2":
            refuse(file, f"{element.type} {element.eid}", "a mass that is not carried", "CONM2", "write it as CONM2")
        if np.any(np.asarray(element.X)):
            refuse(file, f"CONM2 {element.eid}", f"an offset {list(map(float, element.X))}", "none", "put it on a GRID at its place, held by RBE2")
        if element.cid not in (0, None):
            refuse(file, f"CONM2 {element.eid}", f"axes {element.cid}", "basic axes (0)", "give its inertia in basic axes")
        at = place[element.node_ids[0] if hasattr(element, "node_ids") else element.nid]
        mass[at] += element.Mass()
        i11, i21, i22, i31, i32, i33 = element.I
        # products are stored with the sign of an inertia matrix's off-diagonal
        inertia[at] += [i11, i22, i33, -i21, -i32, -i31]
    factor = mass_factor(model)
    return mass * factor, inertia * factor, cells, quadratic


def stated(model, weight, place):
    """Mass, centre and inertia about it by the grid point weight generator: from its rigid-body mass matrix, which is in basic axes about
    the reference point and, other than the tables printed below it, leaves no question of sign."""
    matrix = np.asarray(weight.MO, float) * mass_factor(model)
    mass = matrix[0, 0]
    center = np.array([matrix[1, 5], matrix[2, 3], matrix[0, 4]]) / mass
    inertia = matrix[3:, 3:] - mass * (center @ center * np.eye(3) - np.outer(center, center))
    reference = model.nodes[weight.reference_point].get_position() if weight.reference_point in place else np.zeros(3)
    return {"stated_mass": mass, "stated_center": reference + center, "stated_inertia": inertia}


def mass_factor(model):
    """PARAM,WTMASS: what turns the masses of the deck into those of the equations."""
    return float(model.params["WTMASS"].values[0]) if "WTMASS" in model.params else 1.0


def main(model_file, modes_file, subcase, target):
    """Reads both files and writes the arrays."""
    model = read_model(model_file)
    table, results = read_modes(modes_file, int(subcase))
    labels = np.array(sorted(model.nodes))
    place = {label: index for index, label in enumerate(labels)}
    grids = table.node_gridtype[:, 1] == 1
    moved = {int(label): row for row, label in enumerate(table.node_gridtype[:, 0]) if grids[row]}
    missing = [label for label in labels if int(label) not in moved]
    if missing:
        refuse(modes_file, f"eigenvectors, GRID {missing[0]}", f"nothing for {len(missing)} GRIDs", "every GRID of the model", "ask for VECTOR=ALL in the case control")
    foreign = [label for label in moved if label not in place]
    if foreign:
        refuse(model_file, f"GRID {foreign[0]}", f"nothing for {len(foreign)} nodes of {modes_file}", "the GRIDs of the modes", "give the deck that the modes were computed from")
    shapes = np.empty((len(table.data), len(labels), 6))
    for label, index in place.items():
        shapes[:, index] = to_basic(model.nodes[label], table.data[:, moved[int(label)]].astype(float), model_file)
    eigenvalues = np.asarray(getattr(table, "eigns"), float)
    mass, inertia, cells, quadratic = masses(model, place, model_file)
    arrays = {"labels": labels, "points": np.array([model.nodes[label].get_position() for label in labels]), "shapes": shapes,
              "frequency": np.sqrt(np.maximum(eigenvalues, 0.0)) / (2 * np.pi), "mass": mass, "inertia": inertia, "quadratic": quadratic}
    arrays |= {f"cells_{kind}": np.array(block) for kind, block in cells.items()}
    for number, group in model.sets.items():
        arrays[f"set_{number}"] = np.array([node for node in group.ids if isinstance(node, (int, np.integer))])
    weight = next(iter(getattr(results, "grid_point_weight", {}).values()), None)
    if weight is not None:
        arrays |= stated(model, weight, place)
    np.savez(target, **arrays)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except Refusal as refusal:
        print(refusal, file=sys.stderr)
        sys.exit(2)
