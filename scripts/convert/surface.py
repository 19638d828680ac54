"""The skin of a mesh: triangles that face outward, and the one block of cells that a modal file can hold."""
import numpy as np

# Corner nodes of the faces of solid cells, by meshio type; quadratic cells share the corners of the linear ones.
_HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
_WEDGE = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_PYRAMID = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
SOLIDS = {"hexahedron": (8, _HEXAHEDRON), "hexahedron20": (8, _HEXAHEDRON), "hexahedron27": (8, _HEXAHEDRON),
          "tetra": (4, _TETRAHEDRON), "tetra10": (4, _TETRAHEDRON), "wedge": (6, _WEDGE), "wedge15": (6, _WEDGE),
          "pyramid": (5, _PYRAMID), "pyramid13": (5, _PYRAMID)}
SHELLS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}
LINES = ("line", "line3", "vertex")


def skin(points, cells):
    """(T,3) triangles: outer faces of solids, turned outward, and all shells."""
    faces, inner = [], []
    for kind, block in cells:
        if kind in SOLIDS:
            corners, table = SOLIDS[kind]
            middle = points[block[:, :corners]].mean(1)
            for face in table:
                for element, nodes in enumerate(block[:, list(face)]):
                    faces.append(nodes)
                    inner.append(middle[element])
    count = {}
    for nodes in faces:
        key = tuple(sorted(nodes))
        count[key] = count.get(key, 0) + 1
    triangles = []
    for nodes, middle in zip(faces, inner):
        if count[tuple(sorted(nodes))] > 1:
            continue
        corner = points[nodes]
        outward = np.cross(corner[1] - corner[0], corner[2] - corner[0]) @ (corner.mean(0) - middle) >= 0
        nodes = nodes if outward else nodes[::-1]
        triangles += [(nodes[0], nodes[i], nodes[i + 1]) for i in range(1, len(nodes) - 1)]
    for kind, block in cells:
        if kind in SHELLS:
            triangles += [(nodes[0], nodes[i], nodes[i + 1]) for nodes in block for i in range(1, SHELLS[kind] - 1)]
    return np.array(triangles, int).reshape(-1, 3)


def one_block(cells, triangles):
    """(meshio type, cells) that a modal file holds, and whether that is less than the mesh: of several types only the skin is kept."""
    drawn = [(kind, block) for kind, block in cells if kind not in LINES]
    if len(drawn) == 1:
        return drawn[0], len(cells) > 1
    if drawn:
        return ("triangle", triangles), True
    return (cells[0] if len(cells) == 1 else None), len(cells) > 1
