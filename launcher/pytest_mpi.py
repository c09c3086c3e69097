"""Pytest plugin for a run under mpirun: rank 0 prints, all ranks agree on the exit code.

A test that fails on one rank only leaves the others waiting in some collective call for ever. So
the ranks meet after each test body; a rank whose test failed waits for `PATIENCE` seconds, then
prints its failure and ends the whole run. The other ranks write to a file, shown if they fail.
"""

import os
import sys
import tempfile
import time

from mpi4py import MPI

import pytest

PATIENCE = float(os.environ.get("UFL_ORIGAMI_MPI_PATIENCE", "60"))
comm = MPI.COMM_WORLD.Dup()
stdout = sys.stdout
stdout.isatty = lambda: False  # mpirun gives each rank a terminal, also where there is none
if comm.rank > 0:
    sys.stdout = tempfile.TemporaryFile("w+")


def _show(text):
    print(f"===== rank {comm.rank} =====\n{text}", file=sys.stderr, flush=True)


def _meet(report):
    request = comm.Ibarrier()
    if report.passed or report.skipped:
        request.Wait()
        return
    end = time.monotonic() + PATIENCE
    while not request.Test():
        if time.monotonic() > end:
            _show(f"{report.nodeid} failed here, the other ranks hang:\n{report.longreprtext}")
            comm.Abort(1)
        time.sleep(0.01)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Meet the other ranks after each test body."""
    report = yield
    if report.when == "call":
        _meet(report)
    return report


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session, exitstatus):
    """Give all ranks the worst exit code; no test at all is no failure here."""
    if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
        exitstatus = pytest.ExitCode.OK
    session.exitstatus = comm.allreduce(int(exitstatus), op=MPI.MAX)


def pytest_unconfigure():
    """Show what a failing rank above 0 wrote."""
    if comm.rank > 0:
        sys.stdout.seek(0)
        text = sys.stdout.read()
        if "failed" in text or "error" in text:
            _show(text)
        sys.stdout = stdout
