"""Shared by the benchmarks: command line, timing, table and JSON file with the machine's data."""

import argparse
import json
import os
import platform
import resource
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import dolfinx
import numba
import numpy as np


@dataclass(frozen=True)
class Timing:
    """Best of several runs of one stage, slowest rank.

    Attributes:
        wall: elapsed seconds.
        cpu: processor seconds of one rank (less than wall on a loaded machine).
    """

    wall: float
    cpu: float

    def __add__(self, other: "Timing") -> "Timing":
        return Timing(self.wall + other.wall, self.cpu + other.cpu)


class Stopwatch:
    """Times of named stages that all ranks run together."""

    def __init__(self, comm: MPI.Comm):
        self.comm = comm
        self._runs: dict[str, list[tuple[float, float]]] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block as one run of a stage; collective."""
        self.comm.Barrier()
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        run = time.perf_counter() - wall, time.process_time() - cpu
        self._runs.setdefault(name, []).append(run)

    def best(self) -> dict[str, Timing]:
        """Best wall and best processor time of each stage, the first run left out; collective.

        The first run compiles, fills caches and analyses the matrix.
        """
        return {name: self._slowest(np.min(runs[1:], axis=0)) for name, runs in self._runs.items()}

    def first(self, name: str) -> Timing:
        """Times of the first run of a stage; collective."""
        return self._slowest(np.array(self._runs[name][0]))

    def _slowest(self, times: np.ndarray) -> Timing:
        return Timing(*(self.comm.allreduce(float(value), op=MPI.MAX) for value in times))


def peak_memory(comm: MPI.Comm) -> float:
    """Largest memory that the ranks have held together so far, GB."""
    return comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1e6


def machine(comm: MPI.Comm) -> dict[str, object]:
    """What a figure depends on besides the code."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "ranks": comm.size,
        "threads": os.environ.get("OMP_NUM_THREADS", "unset"),
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "dolfinx": dolfinx.__version__,
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def _positive(text: str) -> int:
    if int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is less than 1")
    return int(text)


def parser(description: str) -> argparse.ArgumentParser:
    """Command line with the options that all benchmarks have."""
    result = argparse.ArgumentParser(description=description)
    result.add_argument("--output", type=Path, help="JSON file for the figures")
    result.add_argument("--quick", action="store_true", help="small sizes only")
    result.add_argument(
        "--repeats",
        type=_positive,
        default=5,
        help="runs after the first, of which the best counts",
    )
    return result


class Table:
    """Rows of figures, printed as they come by rank 0 and kept for the file."""

    def __init__(
        self,
        comm: MPI.Comm,
        title: str,
        columns: Sequence[tuple[str, str]],
        widths: Mapping[str, int] | None = None,
    ):
        """Print the head; columns are (name, format) pairs, widths those of names wider than 9."""
        self.comm, self.title, self.columns, self.widths = comm, title, columns, widths or {}
        self.rows: list[dict[str, object]] = []
        self._print(f"{title}, {comm.size} rank(s)")
        self._print("  ".join(f"{name:>{self._width(name)}}" for name, _ in columns))

    def _width(self, name: str) -> int:
        return max(len(name), self.widths.get(name, 9))

    def _print(self, text: str) -> None:
        if self.comm.rank == 0:
            print(text, flush=True)

    def add(self, **row: object) -> None:
        """Print and keep a row; names without a column are kept only."""
        self.rows.append(row)
        cells = (f"{row[name]:>{self._width(name)}{form}}" for name, form in self.columns)
        self._print("  ".join(cells))

    def write(self, path: Path | None) -> None:
        """Write rows and machine as JSON, where a path is given; collective."""
        data = {"benchmark": self.title, "machine": machine(self.comm), "rows": self.rows}
        if path is not None and self.comm.rank == 0:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(data, indent=1) + "\n")
