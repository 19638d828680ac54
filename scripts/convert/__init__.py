"""Modal data of other codes: from their files to a modal file of schema `flexible-body-modes` 1.0.

    errors     what can be wrong with an input, in words
    foreign    what every reader delivers: mesh, modes, masses, sets of nodes
    choices    what no file says and a user must: root, interfaces, boundary, damping, units
    nastran, mbdyn, exudyn, mesh   one reader per code
    surface    the skin of a mesh of any cells
    assemble   foreign data and choices to a checked modal file, with what was approximated

Readers fill in nothing. What a file does not hold is None, and `assemble` asks for it by name.
"""
