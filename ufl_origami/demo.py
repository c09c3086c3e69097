"""What all demos share: the same options, the same way to fail, the same summary file.

A demo names the options it takes by their default values; `--output` and `--quick` are always
there. Under mpirun rank 0 reads the command line, prints and writes; the others follow.
"""

import argparse
import json
import math
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from mpi4py import MPI

from ufl_origami.errors import InputError
from ufl_origami.meshing import STRUCTURES
from ufl_origami.scene import MODELS
from ufl_origami.solvers.schemes import SCHEMES
from ufl_origami.stencils import BENDING_FORMS

Defaults = Mapping[str, Any]
_HEAD_START = 1.0  # seconds


def number(above: float = -math.inf, *, least: float = -math.inf) -> Callable[[str], float]:
    """Reader of a finite number > above and >= least, for argparse."""

    def read(text: str) -> float:
        value = float(text)
        if not (math.isfinite(value) and value > above and value >= least):
            bound = f"> {above:g}" if above > -math.inf else f">= {least:g}"
            raise argparse.ArgumentTypeError(f"{text} is not a finite number {bound}")
        return value

    read.__name__ = "number"
    return read


OPTIONS: dict[str, dict[str, Any]] = {
    "model": {"choices": MODELS, "help": "discretisation of the sheet"},
    "bending": {"choices": BENDING_FORMS, "help": "bending form of the ddg model"},
    "eta": {
        "type": number(least=0.0),
        "nargs": "+",
        "help": "crease stiffness K_r W / (E h^3), one or several values",
    },
    "d1": {"type": number(0.0), "nargs": "+", "help": "openings, one or several values"},
    "d2": {"type": number(0.0), "nargs": "+", "help": "shears, one or several values"},
    "nu": {"type": number(-1.0), "nargs": "+", "help": "Poisson's ratio, one or several values"},
    "h": {"type": number(0.0), "help": "thickness over panel width"},
    "size": {"type": number(0.0), "help": "length of the triangles' sides over panel width"},
    "mesh": {"choices": STRUCTURES, "help": "kind of mesh"},
    "turns": {"type": number(0.0), "help": "turns of the field"},
    "problem": {"nargs": "+", "help": "problems to solve, one or several"},
    "method": {"nargs": "+", "help": "discretisations to compare, one or several"},
    "scene": {"nargs": "+", "metavar": "NAME", "help": "scenes by name, one or several"},
    "tighten": {"type": number(0.0), "help": "number by which all tolerances are divided"},
    "scheme": {"choices": tuple(SCHEMES), "help": "time integrator"},
    "dt": {"type": number(0.0), "help": "fixed time step in seconds; None: steps adapt"},
}


def read_options(
    name: str,
    description: str,
    defaults: Defaults,
    *,
    quick: Defaults,
    argv: Sequence[str] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> argparse.Namespace:
    """Read the command line of a demo on rank 0 for all ranks; collective.

    Args:
        name: name of the demo; results go to output/NAME by default.
        description: text of `--help`.
        defaults: value by name of each option (out of `OPTIONS`) that the demo takes; a tuple
            makes the option's value a tuple, also where the user gives one value.
        quick: the defaults that `--quick` replaces.
        argv: arguments, default those of the process.
        comm: communicator.

    Returns:
        Options by name, with `output` (Path), `quick` (bool) and `given`, the names of those that
        stood on the command line.

    Raises:
        SystemExit: on all ranks: wrong arguments (code 2) or `--help` (code 0).
    """
    options, code = None, None
    if comm.rank == 0:
        try:
            options = _parse(name, description, defaults, quick, argv)
        except SystemExit as stop:
            code = stop.code
    options, code = comm.bcast((options, code))
    if options is None:
        raise SystemExit(code)
    return options


def _parse(name, description, defaults, quick, argv) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        f"./run demo {name}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )
    for key, value in defaults.items():
        text = f"{OPTIONS[key]['help']} (default: {_words(value)})"
        parser.add_argument(f"--{key}", **{**OPTIONS[key], "help": text})
    folder = Path("output") / name
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help=f"folder of results (default: {folder})"
    )
    replaced = ", ".join(f"{key} {_words(value)}" for key, value in quick.items())
    text = f"a short run: {replaced}" if replaced else "a short run"
    parser.add_argument("--quick", action="store_true", help=text)
    given = vars(parser.parse_args(argv))
    base = {"output": folder, "quick": False, **defaults, **(quick if "quick" in given else {})}
    chosen = {key: _like(value, base[key]) for key, value in given.items()}
    return argparse.Namespace(**base | chosen, given=frozenset(given))


def _words(value: Any) -> str:
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _like(value: Any, default: Any) -> Any:
    """The value as a tuple where the default is one."""
    if not isinstance(default, tuple):
        return value
    return tuple(value) if isinstance(value, list) else (value,)


def fail_together(comm: MPI.Comm = MPI.COMM_WORLD) -> None:
    """Let an exception that no one catches end the whole run, with one line for wrong input.

    Without this a rank that fails alone leaves the others waiting for ever. What all ranks raise
    is printed by rank 0 only: the others wait a moment, in which rank 0 ends them.
    """

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if comm.rank > 0:
            time.sleep(_HEAD_START)
        if issubclass(kind, InputError):
            print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        else:
            traceback.print_exception(kind, error, trace)
        sys.stdout.flush()
        sys.stderr.flush()
        if comm.size > 1:
            comm.Abort(1)

    sys.excepthook = hook


def write_summary(folder: Path, runs: Iterable[Mapping[str, Any]]) -> Path:
    """Write summary.json, `{"runs": [...]}` with one object a case; call on rank 0.

    Raises:
        ValueError: a number that is not finite (JSON has none).
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "summary.json"
    text = json.dumps({"runs": [dict(run) for run in runs]}, indent=1, allow_nan=False)
    file.write_text(text + "\n")
    return file


def print_table(rows: Sequence[Mapping[str, Any]], formats: Mapping[str, str]) -> None:
    """Print a table: columns by name with their format; "-" where a row lacks the value."""
    cells = [
        [
            format(row[key], form) if row.get(key) is not None else "-"
            for key, form in formats.items()
        ]
        for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(formats, *cells, strict=True)]
    for line in [list(formats), *cells]:
        print("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)))
