#!/usr/bin/env python3
"""Makes modal files of booms and panels with scikit-fem, and says how far they are from theory."""
import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from fem import generate, parameters, report
from fem.errors import ModelError, ParameterError

_MODES_FOLDER = Path(__file__).resolve().parent.parent / "modes"
_EPILOG = """\
Each body becomes NAME.h5, NAME.xdmf and NAME.modes.xdmf. The same parameters give the same file; a file is written only
if it passes every rule of its schema. A body of your own: copy a table of modes/bodies.toml and give it with --parameters.

examples:
  make_modes.py                                     every body of modes/bodies.toml
  make_modes.py boom_cantilever --modes 20 --out .  one body, more modes, elsewhere
  make_modes.py panel_cantilever --mesh 40 20 1     a finer mesh
  make_modes.py --readme                            modes/README.md anew from the files

exit status: 0 done; 1 a body could not be solved, breaks a rule or cannot be written; 2 a parameter cannot be used
"""


def _arguments(argv):
    parser = argparse.ArgumentParser(prog="make_modes.py", description=__doc__, epilog=_EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", metavar="NAME", nargs="*", help="bodies to make; all of the parameter file if none is named")
    parser.add_argument("--list", action="store_true", help="list the bodies of the parameter file and stop")
    parser.add_argument("--readme", action="store_true", help="write README.md of the output folder from its files, make nothing")
    parser.add_argument("--out", metavar="DIR", type=Path, default=_MODES_FOLDER, help="folder for the files (default: the project's modes/)")
    parser.add_argument("--parameters", metavar="FILE", type=Path, default=_MODES_FOLDER / "bodies.toml",
                        help="TOML file with one table per body (default: modes/bodies.toml)")
    override = parser.add_argument_group("overrides, for every body that is made")
    override.add_argument("--modes", metavar="N", type=int, help="normal or fixed-interface modes")
    override.add_argument("--mesh", metavar=("NX", "NY", "NZ"), nargs=3, type=int, help="elements along, across and through the body")
    override.add_argument("--end-refinement", metavar="FRACTION", type=float, help="how much shorter elements are at the ends (0: even)")
    override.add_argument("--element", choices=parameters.ELEMENTS, help="hex27: 27 nodes; hex20R: 20 nodes, reduced stiffness")
    override.add_argument("--boundary", choices=parameters.BOUNDARIES, help="mode set")
    override.add_argument("--damping-ratio", metavar="ZETA", type=float, help="damping ratio of every mode")
    override.add_argument("--displacement-precision", choices=parameters.PRECISIONS, help="type of stored mode shapes (default f4)")
    return parser.parse_args(argv)


def _bodies(arguments):
    tables = parameters.read_tables(arguments.parameters)
    unknown = [name for name in arguments.names if name not in tables]
    if unknown:
        raise ParameterError(f"{unknown[0]}: no such body in {arguments.parameters}; it has {', '.join(tables)}")
    keys = ("modes", "mesh", "end_refinement", "element", "boundary", "damping_ratio", "displacement_precision")
    overrides = {key: getattr(arguments, key) for key in keys if getattr(arguments, key) is not None}
    return [parameters.parse_body(name, {**tables[name], **overrides}) for name in dict.fromkeys(arguments.names or tables)]


def _make(bodies, folder):
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"--out {folder}: cannot be made a folder ({error.strerror})") from error
    for body in bodies:
        with tqdm(total=generate.step_count(body), desc=body.name, unit="step", file=sys.stderr, leave=False) as progress:
            path, rules = generate.write(body, folder, progress.update)
        print(report.terminal(report.summarise(body, path), rules), end="\n\n", flush=True)


def _write_readme(bodies, folder):
    """README.md of every body of the parameter file, so that the page never covers only some of the files."""
    missing = [body.name for body in bodies if not (folder / f"{body.name}.h5").is_file()]
    if missing:
        raise ParameterError(f"{folder / missing[0]}.h5: missing; make it first")
    text = report.readme([report.summarise(body, folder / f"{body.name}.h5") for body in bodies])
    (folder / "README.md").write_text(text, encoding="utf-8")


def main(argv=None):
    """Runs the command; returns its exit status."""
    arguments = _arguments(argv)
    try:
        if arguments.readme and arguments.names:
            raise ParameterError(f"--readme covers every body of {arguments.parameters}; name none")
        bodies = _bodies(arguments)
        if arguments.list:
            print("\n".join(f"{body.name:24s} {body.title}" for body in bodies))
        elif arguments.readme:
            _write_readme(bodies, arguments.out)
        else:
            _make(bodies, arguments.out)
    except ParameterError as error:
        print(f"make_modes.py: {error}", file=sys.stderr)
        return 2
    except (ModelError, OSError) as error:
        print(f"make_modes.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
