"""Failures that must reach every rank, and reductions over the ranks."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from mpi4py import MPI

import numpy as np

from ufl_origami.errors import InputError, SolveError

T = TypeVar("T")

ALIKE = (InputError, SolveError, OSError)
"""Classes that all ranks raise where one of them did; of others the rest raise a RuntimeError."""


def on_rank0(comm: MPI.Comm, function: Callable[[], T]) -> T | None:
    """Call the function on rank 0 and return its value there, None on the other ranks.

    Args:
        comm: communicator; the call is collective.
        function: takes no argument and does not communicate.

    Raises:
        Exception: on rank 0 whatever the function raised; on the other ranks the same class with
            the same message for the classes of `ALIKE`, else a RuntimeError.
    """
    value, error = None, None
    if comm.rank == 0:
        try:
            value = function()
        except Exception as caught:
            error = caught
    told = comm.bcast(None if error is None else (type(error), str(error)), root=0)
    if error is not None:
        raise error
    if told is not None:
        raise _told(*told)
    return value


@contextmanager
def together(comm: MPI.Comm) -> Iterator[None]:
    """Let an exception of any rank inside the block be raised on all ranks.

    Args:
        comm: communicator; all ranks must enter, and the block must not communicate.

    Raises:
        Exception: where the block raised it; on the other ranks the same class with the same
            message for the classes of `ALIKE`, else a RuntimeError.
    """
    error: Exception | None = None
    try:
        yield
    except Exception as caught:
        error = caught
    told = comm.allgather([] if error is None else [(type(error), str(error))])
    if error is not None:
        raise error
    for kind, message in (entry for entries in told for entry in entries):
        raise _told(kind, message)


def _told(kind: type[Exception], message: str) -> Exception:
    """What a rank raises that is told of another rank's exception."""
    if issubclass(kind, ALIKE):
        return kind(message)
    return RuntimeError(f"another rank raised {kind.__name__}: {message}")


def reduced(comm: MPI.Comm, values: np.ndarray, op: MPI.Op = MPI.SUM) -> np.ndarray:
    """Entry-wise reduction of a numeric array over the ranks, the same on all of them.

    Args:
        comm: communicator; the call is collective.
        values: array of the same shape and type on all ranks.
        op: reduction.
    """
    send = np.ascontiguousarray(values)
    result = np.empty_like(send)
    comm.Allreduce(send, result, op=op)
    return result


def binned(comm: MPI.Comm, bins: np.ndarray, weights: np.ndarray, count: int) -> np.ndarray:
    """Sums (count, ...) over all ranks of weights (n, ...) by bin (n,) in 0..count-1.

    Args:
        comm: communicator; the call is collective.
        bins: bin of each row.
        weights: rows to be summed.
        count: number of bins, the same on all ranks.
    """
    size = int(np.prod(weights.shape[1:]))
    columns = np.asarray(weights, dtype=float).reshape(len(bins), size).T
    sums = [np.bincount(bins, column, minlength=count).astype(float) for column in columns]
    return reduced(comm, np.stack(sums, axis=1)).reshape(count, *weights.shape[1:])
