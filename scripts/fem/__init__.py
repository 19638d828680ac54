"""Finite-element bodies of `pliant`: from a table of parameters to a modal file.

Layers, each using only those before it:

    errors        what can go wrong, in words
    parameters    TOML tables -> checked parameters
    solid         hexahedral solid: stiffness, mass, connectivity
    interfaces    faces where hinges sit: averaged motion (RBE3), rigid motion
    modes         static flexibility with the root held, elastic eigenmodes
    reduction     cantilever, Craig-Bampton and free-free mode sets
    inertia       integrals of the body with modes, nodal masses
    lumped        nodal masses alone: their integrals, orthonormalisation, rigid fits (used by `convert`)
    geometric     stiffness of prestress by unit inertial loads
    stress        modal stress tensors
    theory        Ritz references: Timoshenko beam, Mindlin plate
    structures    boom, panel and sandwich: mesh, material, reference
    modal_file    writer and digest; sidecars: XDMF; validate: the rules of the schema
    generate      one body from parameters to a checked file
    report        tables for the terminal and for modes/README.md

Everything is in SI units and radians. A displacement vector has the entry 3 * node + axis; N is the number of
nodes, n the number of modes, E the number of cells. The origin is the reference point of the root interface.
"""
