"""Work done on rank 0 whose failure must reach every rank."""

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

from ufl_origami.errors import InputError

T = TypeVar("T")


def on_rank0(comm: MPI.Comm, function: Callable[[], T]) -> T | None:
    """Call the function on rank 0 and return its value there, None on the other ranks.

    Args:
        comm: communicator; the call is collective.
        function: takes no argument and does not communicate.

    Raises:
        Exception: on rank 0 whatever the function raised; on the other ranks the same class with
            the same message for the package's InputError classes, else a RuntimeError.
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
        kind, message = told
        if issubclass(kind, InputError):
            raise kind(message)
        raise RuntimeError(f"rank 0 raised {kind.__name__}: {message}")
    return value
