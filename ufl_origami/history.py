"""History of a run: one row an accepted step, in memory and streamed to a CSV file.

The columns, in this fixed order (those that do not apply are left out):

| column | meaning |
|---|---|
| step | number from 1 |
| load_factor | load factor or time |
| step_size | size of the step |
| newton_iterations | linear solves, the predictor included |
| factorisations | factorisations, those of failed tries included |
| cuts | failed tries before the step |
| negative_pivots | inertia of the tangent at the state, empty where unknown |
| stability | stable, neutral (by `follow_path`), unstable or unknown |
| seconds | wall-clock time of the step |
| energy_KIND | energies: membrane, bending, crease, load |
| energy_total | their sum, the potential energy |
| reaction_NAME_x, _y, _z | force of the supports on a named place |
| fold_virtual_CREASE, fold_mesh_CREASE | mean signed fold angles, degrees, valley positive |
| included_virtual_CREASE, included_mesh_CREASE | included angles 180 - abs(mean), degrees |
| position_POINT_x, _y, _z | current position of a named point |
| then the user's own | `Record.extra` |

Numbers are written with all their digits; each row is flushed to the operating system.
"""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from ufl_origami.errors import InputError
from ufl_origami.model import Model
from ufl_origami.sheet import known_name
from ufl_origami.solvers.dynamics import TimeStep
from ufl_origami.solvers.static import Step

Value = float | int | str | None
Row = dict[str, Value]

STEP_COLUMNS = (
    "step", "load_factor", "step_size", "newton_iterations", "factorisations", "cuts",
    "negative_pivots", "stability", "seconds",
)  # fmt: skip
TIME_COLUMNS = (
    "step", "time", "step_size", "newton_iterations", "factorisations", "cuts",
    "negative_pivots", "local_error", "seconds",
)  # fmt: skip
INTEGERS = frozenset(("step", "newton_iterations", "factorisations", "cuts", "negative_pivots"))


@dataclass(frozen=True)
class Record:
    """What a run records besides the steps themselves.

    Attributes:
        energies: the energies by kind and their sum.
        reactions: named points, edge sets or panels; default those with prescribed motion.
        creases: creases whose mean fold angles are recorded; default all.
        points: named points whose positions are recorded; default all.
        extra: further columns: name -> function of the model (collective), giving a number.
        fields: "vtx", "xdmf", "auto" (VTX where dolfinx has it) or "none".
        every: time between written fields; 0: each accepted step.
        checkpoint: seconds between checkpoints, which short steps are not worth; the last step of a
            run has one however it ends, unless the process is killed.
    """

    energies: bool = True
    reactions: Sequence[str] | None = None
    creases: Sequence[str] | None = None
    points: Sequence[str] | None = None
    extra: Mapping[str, Callable[[Model], float]] = field(default_factory=dict)
    fields: str = "auto"
    every: float = 0.0
    checkpoint: float = 0.0

    def __post_init__(self) -> None:
        """Refuse times that are none."""
        for name in ("every", "checkpoint"):
            value = getattr(self, name)
            if not value >= 0:
                raise InputError(f"record: {name} = {value} is negative or no number")


def step_row(step: Step) -> Row:
    """Columns of the step itself."""
    values = (
        step.number, step.time, step.size, step.iterations, step.factorisations, step.cuts,
        step.negative_pivots, step.stability, step.seconds,
    )  # fmt: skip
    return dict(zip(STEP_COLUMNS, values, strict=True))


def energy_columns(energies: Mapping[str, float]) -> Row:
    """Columns of the energies by kind and of their sum."""
    columns: Row = {f"energy_{kind}": value for kind, value in energies.items()}
    return columns | {"energy_total": sum(energies.values())}


def time_row(step: TimeStep) -> Row:
    """Columns of a step in time."""
    values = (
        step.number, step.time, step.size, step.iterations, step.factorisations, step.cuts,
        step.negative_pivots, step.error, step.seconds,
    )  # fmt: skip
    return dict(zip(TIME_COLUMNS, values, strict=True))


class Recorder:
    """Measures a model's current state as a declaration asks, but for its energies.

    Args:
        model: the model; its state is read when `measure` is called.
        record: what to measure.

    Raises:
        InputError: a name that the sheet does not have.
    """

    def __init__(self, model: Model, record: Record):
        self.model, self.extra = model, dict(record.extra)
        sheet = model.sheet
        self.reactions = default_supports(model) if record.reactions is None else record.reactions
        self.creases = sheet.creases if record.creases is None else record.creases
        self.points = tuple(sheet.points) if record.points is None else record.points
        places = [*sheet.points, *sheet.panel_names, *sheet.edges]
        for name in self.reactions:
            known_name(name, places, "place")
        for name in self.creases:
            known_name(name, sheet.creases, "crease")
        for name in self.points:
            known_name(name, sheet.points, "point")

    def measure(self) -> Row:
        """Columns of the current state; collective."""
        row: Row = {}
        for name in self.reactions:
            row |= _vector(f"reaction_{name}", self.model.reaction(name))
        for name in self.creases:
            row |= fold_columns(self.model, name)
        for name in self.points:
            row |= _vector(f"position_{name}", self.model.position(name))
        return row | {name: float(measure(self.model)) for name, measure in self.extra.items()}


def _vector(label: str, values: np.ndarray) -> Row:
    return {f"{label}_{axis}": float(value) for axis, value in zip("xyz", values, strict=True)}


def default_supports(model: Model) -> list[str]:
    """Names with prescribed motion, in the order of the scene."""
    return list(dict.fromkeys(motion.name for motion in model.scene.motions))


def fold_columns(model: Model, crease: str) -> Row:
    """Length-weighted means of a crease's virtual and mesh fold angles (degrees); collective."""
    angles = model.fold_angles(crease)
    weights = angles.length
    virtual, mesh, total = model.configuration.sum(
        [(weights * angles.virtual).sum(), (weights * angles.mesh).sum(), weights.sum()]
    )
    means = {"virtual": np.degrees(virtual / total), "mesh": np.degrees(mesh / total)}
    folds: Row = {f"fold_{kind}_{crease}": float(a) for kind, a in means.items()}
    return folds | {f"included_{kind}_{crease}": 180.0 - abs(float(a)) for kind, a in means.items()}


@dataclass
class History:
    """Rows of a run, the same on all ranks.

    Attributes:
        rows: column -> value of each accepted step.
    """

    rows: list[Row] = field(default_factory=list)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order; empty before the first row."""
        return tuple(self.rows[0]) if self.rows else ()

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.rows)

    def __getitem__(self, column: str) -> np.ndarray:
        """Values (n,) of a column.

        Raises:
            InputError: no such column.
        """
        known_name(column, self.columns, "column")
        return np.array([row[column] for row in self.rows])


class CsvFile:
    """A CSV file that is flushed after every row; only rank 0 has one.

    Args:
        path: file to create, its folder too; an earlier file is replaced once `rows` are written.
        rows: rows to begin with.
    """

    def __init__(self, path: Path, rows: Sequence[Row] = ()):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(path.name + ".tmp")
        self._file: io.TextIOWrapper = temporary.open("w", newline="")
        self._writer: csv.DictWriter | None = None
        for row in rows:
            self.write(row)
        temporary.replace(path)

    def write(self, row: Row) -> None:
        """Append a row, the header before the first one."""
        if self._writer is None:
            self._writer = csv.DictWriter(self._file, list(row))
            self._writer.writeheader()
        self._writer.writerow({k: "" if v is None else v for k, v in row.items()})
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_history(path: str | Path, count: int | None = None) -> History:
    """Read a history back from its CSV file.

    Args:
        path: the file.
        count: rows to read; later ones, an unfinished last one too, are left out.

    Raises:
        InputError: the file is no history.
    """
    with Path(path).open(newline="") as file:
        reader = csv.DictReader(file)
        if tuple(reader.fieldnames or ())[:2] not in (STEP_COLUMNS[:2], TIME_COLUMNS[:2]):
            raise InputError(f"{path} is no history: its columns are {reader.fieldnames}")
        rows = list(islice(reader, count))
    return History([{name: _parse(name, text) for name, text in row.items()} for row in rows])


def _parse(column: str, text: str) -> Value:
    if column == "stability":
        return text
    if text == "":
        return None
    return int(text) if column in INTEGERS else float(text)
