"""Restart of an interrupted run from its last accepted step, on any number of ranks.

A checkpoint is a folder: each rank's own part (unknowns and branches of angles, as NumPy archives)
and a manifest, which is replaced last and in one operation. A run killed at any moment therefore
leaves either the state before or the state after. Values are keyed by the input's vertices, edges
(pairs of vertices) and cells, so that no partition matters.
"""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from ufl_origami.collective import on_rank0
from ufl_origami.errors import InputError
from ufl_origami.identity import declaration, sheet_digest
from ufl_origami.model import Model
from ufl_origami.shares import Finder, Shares
from ufl_origami.terms.base import Keyed, Term

FORMAT = 3
MANIFEST = "manifest.json"
ENERGY_TOLERANCE = 1e-9
"""Relative to the largest energy: a restored state differs by the order of summation alone."""


Memory = dict[str, Any]
"""Values of a run that JSON can hold."""


class Checkpoint:
    """The checkpoint folder of one model's run.

    Args:
        model: the model, whose current state is written or set.
        folder: made when the first checkpoint is written.
        terms: terms whose memories belong to the state.
        solver: name of the function whose run it is.
    """

    def __init__(self, model: Model, folder: str | Path, terms: Sequence[Term], solver: str):
        self.model, self.folder, self.solver = model, Path(folder), solver
        self.comm = model.sheet.comm
        self._shares = Shares(model, terms)
        self._identity = {"sheet": sheet_digest(model.sheet)} | declaration(model.scene)

    def clear(self) -> None:
        """Make the folder and forget what an earlier run left in it; collective."""

        def forget() -> None:
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.folder / MANIFEST).unlink(missing_ok=True)

        on_rank0(self.comm, forget)

    def write(self, number: int, memory: Memory, vectors: Mapping[str, PETSc.Vec]) -> None:
        """Write the model's current state; collective.

        Args:
            number: of the step.
            memory: what the run needs to go on.
            vectors: further vectors of unknowns by name.

        Raises:
            OSError: a file could not be written; the checkpoint before stays valid.
        """
        shares = self._shares.get(vectors)
        energies = self.model.energies()
        _everywhere(self.comm, lambda: _write_part(self._part(number, self.comm.rank), shares))
        manifest = memory | {
            "format": FORMAT,
            "solver": self.solver,
            "scene": self._identity,
            "time": self.model.problem.time,
            "number": number,
            "energies": energies,
            "parts": [self._part(number, rank).name for rank in range(self.comm.size)],
        }
        on_rank0(self.comm, lambda: self._publish(manifest))

    def _part(self, number: int, rank: int) -> Path:
        return self.folder / f"step{number:06d}-rank{rank:04d}.npz"

    def _publish(self, manifest: dict) -> None:
        """Make a complete checkpoint the valid one, then delete the parts of all others."""
        replace(self.folder / MANIFEST, json.dumps(manifest).encode())
        for path in self.folder.glob("step*-rank*.npz*"):
            if path.name not in manifest["parts"]:
                path.unlink()

    def read(self, vectors: Mapping[str, PETSc.Vec]) -> Memory:
        """Put the model into the stored state; collective.

        Args:
            vectors: those that were written with it, to be set.

        Raises:
            InputError: no checkpoint, one of another solver or scene, or an incomplete one.
        """
        manifest = self.comm.bcast(on_rank0(self.comm, self._read_manifest), root=0)
        self._require_same_scene(manifest["scene"])
        self.model.problem.set_time(manifest["time"])
        parts = [self.folder / part for part in manifest["parts"]]
        _everywhere(self.comm, lambda: self._take(parts, vectors))
        for vector in (self.model.x, *vectors.values()):
            vector.assemble()
        if manifest["number"]:
            self._require_same_energies(manifest["energies"])
        return manifest

    def _read_manifest(self) -> dict:
        path = self.folder / MANIFEST
        if not path.exists():
            raise InputError(f"{self.folder} holds no checkpoint: there is no run to resume")
        manifest = json.loads(path.read_text())
        if manifest.get("format") != FORMAT:
            raise InputError(f"{path} has format {manifest.get('format')}, not {FORMAT}")
        if manifest["solver"] != self.solver:
            raise InputError(f"{path} is of a run of {manifest['solver']}, not {self.solver}")
        return manifest

    def _require_same_scene(self, stored: dict[str, str]) -> None:
        for part, now in self._identity.items():
            if stored.get(part) != now:
                raise InputError(
                    f"the checkpoint in {self.folder} is of another scene: its {part} was "
                    f"{stored.get(part)}, now it is {now}"
                )

    def _require_same_energies(self, stored: dict[str, float]) -> None:
        """Functions in a scene cannot be compared; what they do to the energy can."""
        now = self.model.energies()
        scale = max(map(abs, stored.values()), default=0.0)
        for kind in stored.keys() | now.keys():
            before, after = stored.get(kind, 0.0), now.get(kind, 0.0)
            if not abs(after - before) <= ENERGY_TOLERANCE * scale:
                raise InputError(
                    f"the checkpoint in {self.folder} is of another scene: its {kind} energy was "
                    f"{before!r}, now it is {after!r}"
                )

    def _take(self, parts: list[Path], vectors: Mapping[str, PETSc.Vec]) -> None:
        """Find this rank's values in all parts and set them."""
        finders = {label: Finder(share) for label, share in self._shares.get(vectors).items()}
        for path in parts:
            with np.load(path, allow_pickle=False) as archive:
                for label in finders.keys() & {name.removesuffix(".keys") for name in archive}:
                    finders[label].look(Keyed(archive[f"{label}.keys"], archive[f"{label}.values"]))
        for label, finder in finders.items():
            if finder.missing:
                raise InputError(f"{self.folder} lacks {finder.missing} values of {label!r}")
        values = {label: finder.values for label, finder in finders.items()}
        self._shares.set(values, vectors)


def _write_part(path: Path, shares: dict[str, Keyed]) -> None:
    arrays: dict[str, np.ndarray] = {}
    for label, share in shares.items():
        arrays |= {f"{label}.keys": share.keys, f"{label}.values": share.values}
    temporary = path.with_name(path.name + ".tmp")
    with temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def replace(path: Path, content: bytes) -> None:
    """Write a file in one operation: it is never seen half-written."""
    temporary = path.with_name(path.name + ".tmp")
    with temporary.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def _everywhere(comm: MPI.Comm, action: Callable[[], None]) -> None:
    """Do something on each rank; what one of them could not do is raised on all.

    Raises:
        OSError: or InputError, whichever an action raised.
    """
    error: OSError | InputError | None = None
    try:
        action()
    except (OSError, InputError) as caught:
        error = caught
    told = comm.allgather(None if error is None else (type(error), str(error)))
    if error is not None:
        raise error
    for rank, message in enumerate(told):
        if message is not None:
            raise message[0](f"rank {rank}: {message[1]}")
