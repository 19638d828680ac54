"""XDMF sidecars that let meshio and VTK open a modal file as it is.

NAME.xdmf is one grid with every mode and its stress as attributes; NAME.modes.xdmf is a series with one step per mode and the
frequency as its time. Both point into NAME.h5 and hold no numbers themselves besides frequencies.
"""
from pathlib import Path
from xml.sax.saxutils import quoteattr

import h5py

_TOPOLOGY = {"vertex": "Polyvertex", "line": "Polyline", "triangle": "Triangle", "triangle6": "Triangle_6", "quad": "Quadrilateral",
             "quad8": "Quadrilateral_8", "quad9": "Quadrilateral_9", "tetra": "Tetrahedron", "tetra10": "Tetrahedron_10",
             "pyramid": "Pyramid", "pyramid13": "Pyramid_13", "wedge": "Wedge", "wedge15": "Wedge_15", "hexahedron": "Hexahedron",
             "hexahedron20": "Hexahedron_20", "hexahedron27": "Hexahedron_27"}
_NUMBER = {"f": "Float", "i": "Int", "u": "UInt"}
_ATTRIBUTE = {3: "Vector", 6: "Tensor6"}
_MESH_OF_FIRST_GRID = ('<xi:include xpointer="xpointer(//Grid[@Name=&quot;mesh&quot;]/*[self::Topology or self::Geometry])"/>')


def write(path):
    """Writes both sidecars next to the modal file `path`; returns their paths."""
    path = Path(path)
    with h5py.File(path) as file:
        mesh = _mesh(path.name, file)
        shapes, stresses = file["modes/displacement"], file.get("modes/stress")
        center = "Node" if stresses is None or stresses.attrs["location"] == b"node" else "Cell"
        fields = [_attribute(path.name, "node_mass", file["mesh/node_mass"], "Node")]
        steps = []
        for mode, frequency in zip(shapes, file["modes/frequency"][()]):
            fields.append(_attribute(path.name, f"mode_{mode}", shapes[mode], "Node"))
            lines = [_attribute(path.name, "displacement", shapes[mode], "Node")]
            if stresses is not None:
                fields.append(_attribute(path.name, f"stress_{mode}", stresses[mode], center))
                lines.append(_attribute(path.name, "stress", stresses[mode], center))
            lines = "\n".join(lines)
            steps.append(f'<Grid Name="mode_{mode}">\n{_MESH_OF_FIRST_GRID}\n<Time Value="{frequency:.9g}"/>\n'
                         f'{lines}\n</Grid>')
    single, series = path.with_suffix(".xdmf"), path.with_suffix(".modes.xdmf")
    lines = "\n".join(fields)
    single.write_text(f'<Xdmf Version="3.0"><Domain><Grid Name="modes">\n{mesh}\n{lines}\n</Grid></Domain></Xdmf>\n')
    lines = "\n".join(steps)
    series.write_text('<Xdmf xmlns:xi="http://www.w3.org/2003/XInclude" Version="3.0"><Domain>\n'
                      f'<Grid Name="mesh" GridType="Uniform">\n{mesh}\n</Grid>\n'
                      f'<Grid Name="modes" GridType="Collection" CollectionType="Temporal">\n{lines}\n</Grid></Domain></Xdmf>\n')
    return single, series


def _mesh(name, file):
    cells = file["mesh/cells"]
    topology = _TOPOLOGY[cells.attrs["cell_type"].decode()]
    return (f'<Topology TopologyType="{topology}" NumberOfElements="{cells.shape[0]}" NodesPerElement="{cells.shape[1]}">'
            f'{_item(name, cells)}</Topology>\n<Geometry GeometryType="XYZ">{_item(name, file["mesh/points"])}</Geometry>')


def _attribute(name, label, dataset, center):
    kind = "Scalar" if dataset.ndim == 1 else _ATTRIBUTE[dataset.shape[1]]
    return f'<Attribute Name={quoteattr(label)} AttributeType="{kind}" Center="{center}">{_item(name, dataset)}</Attribute>'


def _item(name, dataset):
    shape = " ".join(map(str, dataset.shape))
    return (f'<DataItem DataType="{_NUMBER[dataset.dtype.kind]}" Precision="{dataset.dtype.itemsize}" Dimensions="{shape}" '
            f'Format="HDF">{name}:{dataset.name}</DataItem>')
