"""Writes complete.h5: a random body with every optional part of the schema, and its own nodes as the truth.

Run in this folder with h5py 3.16 and NumPy 2: python make_complete.py
"""
import hashlib

import h5py
import numpy as np

LOADS = "omega_xx omega_yy omega_zz omega_xy omega_yz omega_xz acc_x acc_y acc_z alpha_x alpha_y alpha_z"
EPS = np.zeros((3, 3, 3))
EPS[[0, 1, 2], [1, 2, 0], [2, 0, 1]], EPS[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = 1, -1
rng = np.random.default_rng(7)


def grid():
    """A block of 7 x 5 x 6 nodes, root face at x = 0; nodes of the surface first."""
    shape = (7, 5, 6)
    i, j, k = np.meshgrid(*(np.arange(s) for s in shape), indexing="ij")
    points = np.stack([i * 0.3, (j - 2) * 0.1, (k - 2.5) * 0.1], -1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(shape)
    cut = [tuple(slice(d, d + s - 1) for d, s in zip(o, shape)) for o in
           [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]]
    cells = np.stack([number[c].ravel() for c in cut], 1)
    faces = np.concatenate([cells[:, q] for q in [(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)]])
    _, inverse, count = np.unique(np.sort(faces, 1), axis=0, return_inverse=True, return_counts=True)
    faces = faces[count[inverse.ravel()] == 1]
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    surface = np.unique(triangles)
    order = np.concatenate([surface, np.setdiff1d(np.arange(len(points)), surface)])
    new = np.empty(len(points), int)
    new[order] = np.arange(len(points))
    return points[order], new[cells], new[triangles], len(surface)


def put(group, name, values, dtype="f8", **attributes):
    values = np.asarray(values, dtype)
    large = values.nbytes > 4096
    options = dict(chunks=True, shuffle=True, compression="gzip", compression_opts=4, fletcher32=True) if large else {}
    dataset = group.create_dataset(name, data=values, **options)
    for key, value in attributes.items():
        dataset.attrs[key] = np.bytes_(value) if isinstance(value, str) else value


def walk(group, path=""):
    for key in group:
        if path or key != "VTKHDF":
            yield from walk(group[key], path + key + "/") if isinstance(group[key], h5py.Group) else [(path + key, group[key])]


def digest(file):
    total = hashlib.sha256()
    for path, dataset in sorted(walk(file), key=lambda item: item[0]):
        total.update(f"{path}\0{dataset.dtype.str}\0{','.join(map(str, dataset.shape))}\0".encode() + np.ascontiguousarray(dataset[()]).tobytes())
    return total.hexdigest()


points, cells, triangles, surface = grid()
nodes, modes = len(points), 4
mass = rng.uniform(0.5, 1.5, nodes) * 0.2
factor = rng.standard_normal((nodes, 3, 3)) * 0.02
rotary = factor @ factor.transpose(0, 2, 1)
root = np.flatnonzero(points[:, 0] == 0)
tip = np.flatnonzero(points[:, 0] == points[:, 0].max())

# random fields, at rest at the root, orthonormal with nodal masses and nodal inertias
field = rng.standard_normal((modes, nodes, 6))
field[:, root] = 0
inner = lambda a, b: np.einsum("n,jna,kna->jk", mass, a[..., :3], b[..., :3]) + np.einsum("jna,nab,knb->jk", a[..., 3:], rotary, b[..., 3:])
field = np.einsum("ij,jna->ina", np.linalg.inv(np.linalg.cholesky(inner(field, field))), field)
shape, turn = field[..., :3], field[..., 3:]

inertia = np.einsum("n,nc,nc,ab->ab", mass, points, points, np.eye(3)) - np.einsum("n,na,nb->ab", mass, points, points) + rotary.sum(0)
first = np.einsum("n,na,jnb->jab", mass, points, shape)
spin = np.einsum("abc,jbc->ja", EPS, first) + np.einsum("nab,jnb->ja", rotary, turn)
spd = rng.standard_normal((modes, modes))
spd = spd @ spd.T + 100 * np.eye(modes)
symmetric = lambda count: (lambda g: g + g.transpose(0, 2, 1))(rng.standard_normal((count, modes, modes)))

with h5py.File("complete.h5", "w") as file:
    texts = dict(format="flexible-body-modes", version="1.0", units="m kg s rad Pa Hz", title="random body with every optional part",
                 generator="make_complete.py", boundary="cantilever", root_interface="root")
    file.attrs.update({key: np.bytes_(value) for key, value in texts.items()}, mode_count=np.int64(modes), node_count=np.int64(nodes))
    put(file, "mesh/points", points, surface_nodes=np.int64(surface))
    put(file, "mesh/cells", cells, "i8", cell_type="hexahedron", vtk_type=np.int64(12))
    put(file, "mesh/surface_triangles", triangles, "i8")
    put(file, "mesh/node_mass", mass, kind="row_sum")
    put(file, "mesh/node_inertia", rotary[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]])
    put(file, "mesh/cell_material", np.arange(len(cells)) % 2, "u1")
    put(file, "body/mass", mass.sum())
    put(file, "body/center_of_mass", mass @ points / mass.sum())
    put(file, "body/inertia", inertia)
    put(file, "modes/frequency", np.sqrt(np.diag(spd)).cumsum() / (2 * np.pi))
    put(file, "modes/damping_ratio", np.full(modes, 0.01))
    put(file, "modes/kind", [0, 1, 2, 0], "u1")
    put(file, "modes/stiffness", spd)
    stress = file.create_group("modes/stress")
    stress.attrs["location"] = np.bytes_("cell")
    for j in range(modes):
        put(file, f"modes/displacement/{j:04d}", shape[j], "f4")
        put(file, f"modes/rotation/{j:04d}", turn[j], "f4")
        put(stress, f"{j:04d}", np.outer(np.arange(len(cells)), np.arange(1, 7)) + 1000 * j, "f4")
    put(file, "inertia/momentum", np.einsum("n,jna->ja", mass, shape))
    put(file, "inertia/first_moment", first)
    put(file, "inertia/second_moment", np.einsum("n,jna,knb->jkab", mass, shape, shape))
    put(file, "inertia/modal_mass", np.eye(modes))
    put(file, "inertia/angular_momentum", spin)
    for name, held, coupling in [("root", root, "fixed"), ("tip", tip, "rbe3")]:
        group = file.create_group("interfaces/" + name)
        group.attrs["coupling"] = np.bytes_(coupling)
        weights = np.full(len(held), 1 / len(held))
        put(group, "nodes", held, "i8")
        put(group, "weights", weights)
        put(group, "position", weights @ points[held])
        put(group, "orientation", np.eye(3) if name == "root" else [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
        put(group, "displacement", np.einsum("n,jna->ja", weights, field[:, held]))
    put(file, "geometric/stiffness", symmetric(12), loads=LOADS)
    put(file, "geometric/tip", symmetric(6))
    view = file.create_group("VTKHDF")
    view["Points"] = file["mesh/points"]
    file.attrs["content_sha256"] = np.bytes_(digest(file))
