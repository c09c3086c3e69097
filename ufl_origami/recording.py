"""What runs have in common: history in memory, files on disk, a progress bar.

In the output folder:

* history.csv: one row an accepted step (see history.py);
* fields.*: the state at the start and after accepted steps (see output.py); a resumed run writes
  fields_from_STEP.* beside them;
* checkpoint/: the last accepted step (see checkpoint.py).
"""

import sys
import time as clock
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from math import floor
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

from petsc4py import PETSc

from tqdm import tqdm

from ufl_origami.checkpoint import Checkpoint, Memory
from ufl_origami.collective import on_rank0
from ufl_origami.errors import InputError, SolveError
from ufl_origami.history import CsvFile, History, Record, Recorder, Row, read_history
from ufl_origami.interrupt import InterruptRequest
from ufl_origami.model import Model
from ufl_origami.output import FieldWriter
from ufl_origami.solvers.dynamics import TimeStep
from ufl_origami.solvers.static import Step
from ufl_origami.terms.base import Term

HISTORY_FILE = "history.csv"
CHECKPOINT_FOLDER = "checkpoint"
COLLECTIVE_ERRORS = (SolveError, InputError, KeyboardInterrupt, OSError)


class Run(Protocol):
    """A run that can be written down after each row of its history.

    Attributes:
        solver: name of the function whose run it is.
    """

    solver: ClassVar[str]

    @property
    def rows(self) -> int:
        """Rows of the history so far."""

    @property
    def terms(self) -> Sequence[Term]:
        """Terms that may remember something."""

    def columns(self) -> Row:
        """The run's own columns of the last row."""

    def vectors(self) -> dict[str, PETSc.Vec]:
        """What it needs to go on beside the model's state: vectors of unknowns by name."""

    def memory(self) -> Memory:
        """What else it needs: values that JSON can hold."""

    def recall(self, memory: Memory, vectors: dict[str, PETSc.Vec]) -> None:
        """Go on from there; the model is in its state."""


class Log:
    """History in memory, the same on all ranks.

    Args:
        model: the model.
        record: what is recorded.
        run: the run, whose own columns come first.
    """

    def __init__(self, model: Model, record: Record, run: Run):
        self.model, self.record, self.run, self.history = model, record, run, History()
        self._recorder = Recorder(model, record)

    def row(self) -> Row:
        """Columns of the state that model and run are in; collective."""
        return self.run.columns() | self._recorder.measure()

    def observe(self) -> None:
        """Add a row, that of rank 0 (whose clock counts), under names that all rows share."""
        row = self.row()
        values = self.model.sheet.comm.bcast(list(row.values()), root=0)
        names = self.history.columns or tuple(row)
        self.history.rows.append(dict(zip(names, values, strict=True)))


class Disk:
    """History file, fields and checkpoint of one run, written in this order at each step.

    A run killed in between has rows and fields beyond its checkpoint; resuming drops such rows.
    """

    def __init__(self, log: Log, folder: Path):
        self.log, self.run, self.folder = log, log.run, folder
        self.comm = log.model.sheet.comm
        self._checkpoint = Checkpoint(
            log.model, folder / CHECKPOINT_FOLDER, log.run.terms, log.run.solver
        )
        self._csv: CsvFile | None = None
        self._fields: FieldWriter | None = None
        self._written = self._saved = 0.0
        self._unsaved: int | None = None  # rows on disk, where the checkpoint has fewer

    def begin(self) -> None:
        """Start afresh: an earlier run's history, fields and checkpoint are replaced."""
        self._checkpoint.clear()
        self._open("fields")
        if self._fields:
            self._fields.write()
        self._save()

    def resume(self) -> None:
        """Take up model, run and history where the checkpoint left them.

        Raises:
            InputError: no checkpoint of this scene, or a history that does not fit it.
        """
        vectors = {name: vector.duplicate() for name, vector in self.run.vectors().items()}
        self.run.recall(self._checkpoint.read(vectors), vectors)
        count, file = self.run.rows, self.folder / HISTORY_FILE
        rows = on_rank0(self.comm, lambda: read_history(file, count).rows if count else [])
        self.log.history.rows[:] = self.comm.bcast(rows, root=0)
        self._require_history(count)
        self._open(f"fields_from_{count}")

    def _require_history(self, count: int) -> None:
        history, file = self.log.history, self.folder / HISTORY_FILE
        if len(history) != count:
            raise InputError(f"{file} has {len(history)} of the checkpoint's {count} steps")
        columns = tuple(self.log.row()) if count else ()
        if columns != history.columns:
            other = sorted(set(columns) ^ set(history.columns))
            raise InputError(f"{file} was recorded with other columns: {other}")

    def _open(self, fields: str) -> None:
        """Open history and fields."""
        file = self.folder / HISTORY_FILE
        self._csv = on_rank0(self.comm, lambda: CsvFile(file, self.log.history.rows))
        self._written = self.log.model.problem.time
        if self.log.record.fields != "none":
            path = self.folder / fields
            self._fields = FieldWriter(self.log.model, path, self.log.record.fields)

    def observe(self) -> None:
        """Write the state of an accepted step."""
        file, row = self._csv, self.log.history.rows[-1]
        self._unsaved = None
        on_rank0(self.comm, lambda: file.write(row) if file else None)
        if self._fields and self._due():
            self._fields.write()
        self._unsaved = self.run.rows
        late = clock.monotonic() - self._saved >= self.log.record.checkpoint
        if self.comm.bcast(late, root=0):
            self._save()

    def _due(self) -> bool:
        """Whether fields are to be written: each time a multiple of `Record.every` is passed."""
        every, now = self.log.record.every, self.log.model.problem.time
        before, self._written = self._written, now
        return not every or floor(now / every + 1e-9) > floor(before / every + 1e-9)

    def _save(self) -> None:
        self._checkpoint.write(self.run.rows, self.run.memory(), self.run.vectors())
        self._saved, self._unsaved = clock.monotonic(), None

    def __enter__(self) -> "Disk":
        """Files are opened by `begin` or `resume`."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Write the last checkpoint, unless a step has no row, and close the files.

        Fields are closed by all ranks together: not after an error that one rank may have alone,
        which waiting for the others would hide.
        """
        if self._csv:
            self._csv.close()
        together = kind is None or issubclass(kind, COLLECTIVE_ERRORS) or self.comm.size == 1
        if self._unsaved == self.run.rows and together:
            self._save()
        if self._fields and together:
            self._fields.close()


class ProgressBar:
    """Time, step, Newton iterations and step size on the error stream of rank 0.

    Args:
        model: the model.
        stops: where the run will stop.
        shown: whether to show it; None: where the error stream is a terminal.
        label: what time is called.
    """

    def __init__(self, model: Model, stops: Sequence[float], shown: bool | None, label: str):
        start, self._bar = model.problem.time, None
        if model.sheet.comm.rank == 0 and (sys.stderr.isatty() if shown is None else shown):
            self._bar = tqdm(
                total=max([start, *stops]), initial=start, desc=label,
                bar_format="{desc} {n:.4g}/{total:.4g} |{bar}| {elapsed}{postfix}",
            )  # fmt: skip

    def observe(self, step: Step | TimeStep) -> None:
        """Show an accepted step."""
        if self._bar is not None:
            values = {"step": step.number, "newton": step.iterations, "size": f"{step.size:.3g}"}
            self._bar.set_postfix(values, refresh=False)
            self._bar.update(step.time - self._bar.n)

    def close(self) -> None:
        """Leave the last line standing."""
        if self._bar is not None:
            self._bar.close()


class Recording(NamedTuple):
    """How a run is to be recorded and shown.

    Attributes:
        output: folder of history, fields and checkpoint; None: history in memory only.
        resume: whether the run in the folder goes on.
        progress: whether to show a progress bar; None: where the error stream is a terminal.
        on_accept: called with each accepted step and the model, after all is written.
    """

    output: str | Path | None
    resume: bool
    progress: bool | None
    on_accept: Callable[[Any, Model], None] | None

    def require_folder(self) -> None:
        """Refuse to resume a run that is nowhere.

        Raises:
            InputError: no folder is named.
        """
        if self.resume and self.output is None:
            raise InputError("resume: name the output folder of the run to resume")


@contextmanager
def recorded(
    log: Log, how: Recording, stops: Sequence[float], label: str
) -> Iterator[Callable[[Step | TimeStep], None]]:
    """Record a run: gives the function that takes each accepted step, the model in its state.

    Args:
        log: history; a run that has a row for its start gets it here.
        how: folder, progress, callback.
        stops: where the run will stop, for the progress bar.
        label: what time is called.

    Raises:
        KeyboardInterrupt: by the function given, after Ctrl-C, on all ranks.
        InputError: there is no such run to resume.
        OSError: a file could not be written.
    """
    with ExitStack() as stack:
        disk = stack.enter_context(Disk(log, Path(how.output))) if how.output is not None else None
        if disk and how.resume:
            disk.resume()
        else:
            if log.run.rows:
                log.observe()
            if disk:
                disk.begin()
        bar = stack.enter_context(closing(ProgressBar(log.model, stops, how.progress, label)))
        request = stack.enter_context(InterruptRequest())

        def accept(step: Step | TimeStep) -> None:
            log.observe()
            if disk:
                disk.observe()
            bar.observe(step)
            if how.on_accept:
                how.on_accept(step, log.model)
            if request.agreed(log.model.sheet.comm):
                raise KeyboardInterrupt(f"stopped after the step to {step.time:g} was accepted")

        yield accept
