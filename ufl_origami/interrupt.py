"""Ctrl-C that waits for a good moment, agreed among the ranks."""

import signal
import threading
from types import FrameType

from mpi4py import MPI


class InterruptRequest:
    """Context in which the first SIGINT is noted and a second one interrupts at once.

    Signals reach the main thread only; elsewhere nothing is changed and nothing is noted.
    """

    def __init__(self) -> None:
        self.noted = False
        self._before: object = None
        self._active = False

    def __enter__(self) -> "InterruptRequest":
        """Take over SIGINT."""
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._note)
            self._active = True
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.noted = True
        self._give_back()

    def _give_back(self) -> None:
        if self._active:
            signal.signal(signal.SIGINT, self._before)  # type: ignore[arg-type]
            self._active = False

    def __exit__(self, *exception: object) -> None:
        """Give SIGINT back."""
        self._give_back()

    def agreed(self, comm: MPI.Comm) -> bool:
        """Whether any rank has been interrupted; collective."""
        return bool(comm.allreduce(int(self.noted), op=MPI.MAX))
