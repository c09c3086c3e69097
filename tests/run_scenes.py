"""Scenes and runs of test_run.py, also started by it in processes of their own.

As a script: run the pulled Z-fold into a folder and die by SIGKILL at the given step and place.
"""

import math
import os
import signal
import sys

from mpi4py import MPI

from ufl_origami import checkpoint
from ufl_origami.gallery import z_fold
from ufl_origami.history import Record
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.run import solve_static
from ufl_origami.scene import Scene
from ufl_origami.solvers.static import StepSettings

PULL_STOPS = (0.4, 1.0)
PULL_STEPS = StepSettings(first=0.1, largest=0.2)


def pull(comm, *, material=None, size=0.25, load=0.0):
    """Z-fold pulled open, with a line load on the crease that is a function of time."""
    scene = Scene(mesh_pattern(z_fold(), size, comm=comm), material or Material(1e7, 0.3, 0.01))
    scene.crease("crease", 10.0)
    scene.fix("left_edge")
    scene.move("right_edge", x=1.0, y=0.0, z=0.0)
    scene.line_load("crease", lambda time: (0.0, 0.0, load * time))
    return scene


def roll(comm):
    """Cantilever rolled up in its plane to a full circle by an end moment."""
    scene = Scene(rectangle(10.0, 1.0, n=(16, 2), comm=comm), Material(1.2e6, 0.0, 0.1))
    scene.fix("sheet", "y")
    scene.fix("x0")
    scene.clamp("x0")
    scene.edge_moment("x1", 20.0 * math.pi)
    return scene


def squeeze(comm):
    """Strip pushed together along its axis far beyond its buckling load, a little off its axis."""
    scene = Scene(rectangle(10.0, 1.0, n=(10, 2), comm=comm), Material(1e6, 0.0, 0.1))
    scene.fix("x0")
    scene.move("x1", x=-0.1, y=0.0, z=0.0)
    scene.point_load("y0_mid", (0.0, 0.0, 1e-2))
    return scene


def crush(comm):
    """Rectangle whose every vertex is moved in its plane: area ratio 1 - 0.95 load factor."""
    scene = Scene(rectangle(1.0, 1.0, n=(2, 2), comm=comm), Material(1.0, 0.0, 0.1))
    scene.move("sheet", x=lambda time, rest: -0.95 * time * rest[:, 0], y=0.0, z=0.0)
    return scene


class AtStep:
    """Extra column "calls" that does something when it is measured for the n-th time."""

    def __init__(self, number=None, action=None):
        self.number, self.action, self.calls = number, action, 0

    def __call__(self, model):
        self.calls += 1
        if self.calls == self.number:
            self.action()
        return 1.0

    @property
    def record(self):
        return Record(extra={"calls": self}, fields="none")


def run_pull(comm, output, measure=None, **options):
    record = (measure or AtStep()).record
    return solve_static(
        pull(comm), PULL_STOPS, output=output, record=record, steps=PULL_STEPS, **options
    )


def kill():
    os.kill(os.getpid(), signal.SIGKILL)


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


if __name__ == "__main__":
    folder, place = sys.argv[1:]
    if place == "before its row":
        run_pull(MPI.COMM_SELF, folder, AtStep(3, kill))
    publish = checkpoint.Checkpoint._publish

    def die(self, manifest):
        if len(manifest["steps"]) == 3:
            kill()
        publish(self, manifest)

    checkpoint.Checkpoint._publish = die
    run_pull(MPI.COMM_SELF, folder)
