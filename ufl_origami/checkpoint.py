"""Restart of an interrupted run from its last accepted step, on any number of ranks.

A checkpoint is a folder: each rank's own part (unknowns and branches of angles, as NumPy archives)
and a manifest, which is replaced last and in one operation. A run killed at any moment therefore
leaves either the state before or the state after. Values are keyed by the input's vertices, edges
(pairs of vertices) and cells, so that no partition matters.
"""

import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from mpi4py import MPI

import numpy as np

from ufl_origami.collective import on_rank0
from ufl_origami.errors import InputError
from ufl_origami.identity import declaration, sheet_digest
from ufl_origami.model import Model
from ufl_origami.shares import Finder, Shares
from ufl_origami.solvers.static import Step
from ufl_origami.terms.base import Keyed

FORMAT = 1
MANIFEST = "manifest.json"
ENERGY_TOLERANCE = 1e-9
"""Relative to the largest energy: a restored state differs by the order of summation alone."""


@dataclass(frozen=True)
class Progress:
    """How far a run has come, and what its solver remembers.

    Attributes:
        time: load factor or time of the state.
        steps: accepted steps.
        size: size of the next step, None: the first one of the settings.
        shift: diagonal shift of the solver's guard.
    """

    time: float
    steps: list[Step]
    size: float | None
    shift: float


class Checkpoint:
    """The checkpoint folder of one model's run.

    Args:
        model: the model, whose current state is written or set.
        folder: made when the first checkpoint is written.
    """

    def __init__(self, model: Model, folder: str | Path):
        self.model, self.folder = model, Path(folder)
        self.comm = model.sheet.comm
        self._shares = Shares(model)
        self._identity = {"sheet": sheet_digest(model.sheet)} | declaration(model.scene)

    def clear(self) -> None:
        """Make the folder and forget what an earlier run left in it; collective."""

        def forget() -> None:
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.folder / MANIFEST).unlink(missing_ok=True)

        on_rank0(self.comm, forget)

    def write(self, progress: Progress) -> None:
        """Write the model's current state; collective.

        Raises:
            OSError: a file could not be written; the checkpoint before stays valid.
        """
        shares = self._shares.get()
        number = len(progress.steps)
        energies = self.model.energies()
        _everywhere(self.comm, lambda: _write_part(self._part(number, self.comm.rank), shares))
        manifest = asdict(progress) | {
            "format": FORMAT,
            "scene": self._identity,
            "energies": energies,
            "parts": [self._part(number, rank).name for rank in range(self.comm.size)],
        }
        on_rank0(self.comm, lambda: self._publish(manifest))

    def _part(self, number: int, rank: int) -> Path:
        return self.folder / f"step{number:06d}-rank{rank:04d}.npz"

    def _publish(self, manifest: dict) -> None:
        """Make a complete checkpoint the valid one, then delete the parts of all others."""
        replace(self.folder / MANIFEST, json.dumps(manifest, indent=1).encode())
        for path in self.folder.glob("step*-rank*.npz*"):
            if path.name not in manifest["parts"]:
                path.unlink()

    def read(self) -> Progress:
        """Put the model into the stored state; collective.

        Raises:
            InputError: no checkpoint, one of another scene, or an incomplete one.
        """
        manifest = self.comm.bcast(on_rank0(self.comm, self._read_manifest), root=0)
        self._require_same_scene(manifest["scene"])
        self.model.problem.set_time(manifest["time"])
        _everywhere(self.comm, lambda: self._take([self.folder / p for p in manifest["parts"]]))
        self.model.x.assemble()
        progress = Progress(
            manifest["time"],
            [Step(**step) for step in manifest["steps"]],
            manifest["size"],
            manifest["shift"],
        )
        if progress.steps:
            self._require_same_energies(manifest["energies"])
        return progress

    def _read_manifest(self) -> dict:
        path = self.folder / MANIFEST
        if not path.exists():
            raise InputError(f"{self.folder} holds no checkpoint: there is no run to resume")
        manifest = json.loads(path.read_text())
        if manifest.get("format") != FORMAT:
            raise InputError(f"{path} has format {manifest.get('format')}, not {FORMAT}")
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

    def _take(self, parts: list[Path]) -> None:
        """Find this rank's values in all parts and set them."""
        finders = {label: Finder(share) for label, share in self._shares.get().items()}
        for path in parts:
            with np.load(path, allow_pickle=False) as archive:
                for label in finders.keys() & {name.removesuffix(".keys") for name in archive}:
                    finders[label].look(Keyed(archive[f"{label}.keys"], archive[f"{label}.values"]))
        for label, finder in finders.items():
            if finder.missing:
                raise InputError(f"{self.folder} lacks {finder.missing} values of {label!r}")
        self._shares.set({label: finder.values for label, finder in finders.items()})


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
