"""Shared by all tests: serial-only tests are skipped under mpirun, ranks meet after each test."""

import gc

from mpi4py import MPI

import pytest


def pytest_collection_modifyitems(items):
    if MPI.COMM_WORLD.size == 1:
        return
    for item in items:
        if item.get_closest_marker("serial"):
            item.add_marker(pytest.mark.skip(reason="runs on one rank only"))


@pytest.fixture
def comm():
    return MPI.COMM_WORLD


@pytest.fixture(autouse=True)
def _meet_after_each_test():
    yield
    gc.collect()
    MPI.COMM_WORLD.Barrier()
