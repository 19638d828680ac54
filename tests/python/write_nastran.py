"""Writes a BDF and an OP2 from plain arrays, run by the environment that has pyNastran: write_nastran.py ARRAYS.npz MODEL.bdf MODES.op2

Arrays: labels, points, cells (E,8 or 20) as node numbers in Nastran's order, density, frequency, shapes (n,N,6), and optionally
node_mass (one CONM2 per node), root (SET 1), turned (nodes whose displacement axes are turned by 90 degrees about z), rigid_mass (6,6) of
the grid point weight generator.
"""
import sys

import numpy as np
from pyNastran.bdf.bdf import BDF
from pyNastran.op2.op2 import OP2
from pyNastran.op2.result_objects.grid_point_weight import GridPointWeight
from pyNastran.op2.tables.oug.oug_eigenvectors import RealEigenvectorArray

arrays = dict(np.load(sys.argv[1]))
labels, shapes = arrays["labels"], arrays["shapes"].copy()
turned = set(arrays.get("turned", np.array([], int)).tolist())
model = BDF(debug=False)
model.punch = True      # bulk data alone
model.add_cord2r(7, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
for index, (label, point) in enumerate(zip(labels, arrays["points"])):
    model.add_grid(int(label), point, cd=7 if int(label) in turned else 0)
    if int(label) in turned:
        # axes of system 7 in basic: y, -x, z
        x, y, z, rx, ry, rz = shapes[:, index].T
        shapes[:, index] = np.stack([y, -x, z, ry, -rx, rz], axis=1)
model.add_mat1(1, 1.2e9, None, 0.3, rho=float(arrays["density"]))
model.add_psolid(1, 1)
for element, nodes in enumerate(arrays["cells"], 1):
    model.add_chexa(element, 1, nodes.tolist())
if "node_mass" in arrays:
    for label, mass in zip(labels, arrays["node_mass"]):
        model.add_conm2(int(label) + 1_000_000, int(label), float(mass))
if "offset_mass" in arrays:
    model.add_conm2(9_000_000, int(labels[0]), 1.0, X=[0.1, 0.0, 0.0])
if "root" in arrays:
    model.add_set1(1, arrays["root"].tolist())
model.write_bdf(sys.argv[2], size=16, is_double=True)

eigenvalues = (2 * np.pi * arrays["frequency"]) ** 2
results = OP2(debug=False)
results.set_as_msc()
results.is_msc, results.is_nx, results.is_optistruct = True, False, False
for subcase in range(1, 1 + int(arrays.get("subcases", 1))):
    kept = slice(None, -1) if "drop_node" in arrays else slice(None)
    kinds = np.stack([labels[kept], np.ones(len(labels[kept]), int)], axis=1).astype("int32")
    table = RealEigenvectorArray.add_modal_case("OUGV1", kinds, shapes[:, kept].astype("float32"), subcase,
                                                np.arange(1, len(shapes) + 1), eigenvalues, arrays["frequency"])
    # pyNastran gives displacements and eigenvectors one code; a solver gives eigenvectors 7
    table.table_code = table.data_code["table_code"] = 7
    results.eigenvectors[subcase] = table
if "rigid_mass" in arrays:
    unused = np.eye(3)
    results.grid_point_weight[""] = GridPointWeight(0, arrays["rigid_mass"], unused, np.ones(3), unused, unused, np.ones(3), unused)
results.write_op2(sys.argv[3], post=-1, endian=b"<", nastran_format="msc")
