#!/usr/bin/env python3
"""Converts modal data of other codes to modal files, and says what was carried and what was approximated."""
import argparse
import sys
from pathlib import Path

import numpy as np

from convert import assemble, exudyn, mbdyn, mesh, nastran
from convert.choices import BOUNDARIES, Choices
from convert.errors import InputError

_EPILOG = """\
Nothing is filled in: what a file does not hold is asked for by name. The origin of the modal file is the mean of the root's nodes.

examples:
  convert_modes.py nastran panel.bdf panel.op2 --root set:1 --boundary cantilever --damping-ratio 0.005 --out panel.h5
  convert_modes.py mbdyn panel.fem --mesh panel.vtu --root 1-51 --boundary cantilever --damping-ratio 0.005 --out panel.h5
  convert_modes.py exudyn panel.hdf5 --root set:root --interface tip=set:tip --boundary craig-bampton --damping-ratio 0 --out panel.h5
  convert_modes.py mesh panel.msh modes.npz --density 250 --root 1-51 --boundary cantilever --damping-ratio 0.005 --out panel.h5

exit status: 0 done; 2 an input cannot be used, the message says which and what to do
"""


def _arguments(argv):
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--out", metavar="FILE.h5", type=Path, required=True, help="modal file to write; its sidecars follow its name")
    common.add_argument("--root", metavar="NODES", required=True, help="nodes of the inboard hinge: 101,102,110-120 or set:NAME")
    common.add_argument("--interface", metavar="NAME=NODES", action="append", default=[], help="a further interface (may be given several times)")
    common.add_argument("--boundary", choices=BOUNDARIES, required=True, help="how the modes were held")
    common.add_argument("--damping-ratio", metavar="ZETA", type=float, nargs="+", help="one, or one per mode; needed unless the file has them")
    common.add_argument("--node-mass", metavar="FILE.npy", type=Path, help="one mass per node, in the order of the file, instead of the file's")
    common.add_argument("--length-unit", metavar="M", type=float, default=1.0, help="the file's unit of length in m (default 1)")
    common.add_argument("--mass-unit", metavar="KG", type=float, default=1.0, help="the file's unit of mass in kg (default 1); time is in s")
    common.add_argument("--title", help="title of the body (default: the file's name)")
    parser = argparse.ArgumentParser(prog="convert_modes.py", description=__doc__, epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    codes = parser.add_subparsers(dest="code", required=True, metavar="CODE")
    code = codes.add_parser("nastran", parents=[common], help="BDF for the model and OP2 for its modes")
    code.add_argument("model", metavar="MODEL.bdf", type=Path)
    code.add_argument("modes", metavar="MODES.op2", type=Path)
    code.add_argument("--subcase", metavar="N", type=int, default=0, help="subcase of the modes, where the OP2 has several")
    code = codes.add_parser("mbdyn", parents=[common], help="MBDyn's .fem")
    code.add_argument("modes", metavar="MODES.fem", type=Path)
    code.add_argument("--mesh", metavar="FILE", type=Path, help="mesh of the same nodes, for the surface")
    code = codes.add_parser("exudyn", parents=[common], help="FEM file of FEMinterface.SaveToFile")
    code.add_argument("modes", metavar="FEM.hdf5|FEM.npz", type=Path)
    code = codes.add_parser("mesh", parents=[common], help="any mesh of meshio, modes as .npz")
    code.add_argument("model", metavar="MESH", type=Path)
    code.add_argument("modes", metavar="MODES.npz", type=Path)
    code.add_argument("--density", metavar="RHO", type=float, help="lump solids of this density, where the .npz has no node_mass (file's units)")
    return parser.parse_args(argv)


def _read(arguments):
    if arguments.code == "nastran":
        return nastran.read(arguments.model, arguments.modes, arguments.subcase)
    if arguments.code == "mbdyn":
        return mbdyn.read(arguments.modes, arguments.mesh)
    if arguments.code == "exudyn":
        return exudyn.read(arguments.modes)
    return mesh.read(arguments.model, arguments.modes, arguments.density)


def _choices(arguments):
    interfaces = {}
    for text in arguments.interface:
        name, sign, rule = text.partition("=")
        if not sign or not name or name in interfaces or name == "root" or "/" in name or name.startswith("."):
            raise InputError("--interface", text, "no new name with its nodes", "NAME=NODES, each name once, without / and not root", "correct the option")
        interfaces[name] = rule
    for option in ("length_unit", "mass_unit"):
        if not 0 < getattr(arguments, option) < np.inf:
            raise InputError("--" + option.replace("_", "-"), "value", getattr(arguments, option), "a positive number", "correct the option")
    return Choices(arguments.root, interfaces, arguments.boundary, arguments.damping_ratio, arguments.length_unit, arguments.mass_unit, arguments.title)


def _targets(arguments):
    """Refuses to write over an input."""
    inputs = [path.resolve() for path in (getattr(arguments, name, None) for name in ("model", "modes", "mesh", "node_mass")) if path is not None]
    if arguments.out.suffix != ".h5":
        raise InputError("--out", arguments.out, f"the ending \"{arguments.out.suffix}\"", ".h5", "name the modal file NAME.h5")
    for target in (arguments.out, arguments.out.with_suffix(".xdmf"), arguments.out.with_suffix(".modes.xdmf")):
        if target.resolve() in inputs:
            raise InputError("--out", target, "an input of this conversion", "another file", "write elsewhere")


def _node_mass(file, foreign):
    try:
        values = np.load(file, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise InputError(file, "--node-mass", f"a file that numpy cannot read ({str(error).splitlines()[0]})", "a .npy array", "write it with numpy.save") from error
    foreign.node_mass, foreign.node_inertia, foreign.scalar_mass = values, None, None


def main(argv=None):
    """Runs the command; returns its exit status."""
    arguments = _arguments(argv)
    try:
        choices = _choices(arguments)
        _targets(arguments)
        foreign = _read(arguments)
        if arguments.node_mass is not None:
            _node_mass(arguments.node_mass, foreign)
        approximations, rules = assemble.write(foreign, choices, arguments.out)
    except InputError as error:
        print(f"convert_modes.py: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"convert_modes.py: {arguments.out}: cannot be written: {error}; name a folder that exists and may be written", file=sys.stderr)
        return 2
    print(f"{arguments.out}: {len(rules)} rules hold")
    print(f"  {approximations.text()}")
    print(f"  predicted relative error of hinge loads by these: {approximations.load_error:.2g}")
    for note in approximations.notes:
        print(f"  {note}")
    for rule in rules:
        if rule.doubtful:
            print(f"  look at: {rule}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
