"""An X server for off-screen rendering: Debian's VTK aborts the process when there is none."""

import os
import select
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

_START_SECONDS = 30.0
_STOP_SECONDS = 10.0


class DisplayError(RuntimeError):
    """No X server to render on: none is there and Xvfb is missing or does not start."""


@contextmanager
def virtual_display() -> Iterator[str]:
    """Name of an X display for the duration of the block; `DISPLAY` is set to it.

    Where Xvfb is installed a server of our own is started and stopped again, whatever `DISPLAY`
    says (VTK aborts the process on a stale one, and pictures need no screen). Else the display
    that `DISPLAY` names is used.

    Raises:
        DisplayError: Xvfb is missing and `DISPLAY` is not set, or Xvfb does not start.
    """
    before = os.environ.get("DISPLAY")
    if shutil.which("Xvfb") is None:
        if not before:
            raise DisplayError(
                "pictures need an X server: DISPLAY is not set and Xvfb is not installed "
                "(Debian package: xvfb)"
            )
        yield before
        return
    server, display = _start()
    os.environ["DISPLAY"] = display
    try:
        yield display
    finally:
        if before is None:
            del os.environ["DISPLAY"]
        else:
            os.environ["DISPLAY"] = before
        _stop(server)


def _start() -> tuple[subprocess.Popen, str]:
    """Start Xvfb on a free display; it writes the display's number to a pipe when ready."""
    readable, writable = os.pipe()
    command = ["Xvfb", "-displayfd", str(writable), "-screen", "0", "1280x1024x24"]
    try:
        server = subprocess.Popen(
            [*command, "-nolisten", "tcp"],
            pass_fds=(writable,),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is ours to handle
        )
    finally:
        os.close(writable)
    with open(readable, encoding="ascii") as pipe:
        ready = select.select([pipe], [], [], _START_SECONDS)[0]
        number = pipe.readline().strip() if ready else ""
    if not number:
        _stop(server)
        raise DisplayError(f"Xvfb did not start (exit code {server.returncode})")
    return server, f":{number}"


def _stop(server: subprocess.Popen) -> None:
    server.terminate()
    try:
        server.wait(_STOP_SECONDS)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
