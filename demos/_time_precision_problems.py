"""Motions of the speed-accuracy study: a vibration, a snap, an impact, and what is measured."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi, radians, sin, sqrt

from mpi4py import MPI

import numpy as np
from _work_precision_problems import NO_RECORD

from ufl_origami.discretise import build
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.model import Model
from ufl_origami.obstacles import Plane
from ufl_origami.run import solve_static
from ufl_origami.scene import Scene
from ufl_origami.solvers.static import StepSettings
from ufl_origami.suggestions import suggest_barrier

# Flap: a panel held, another one on a soft crease, in units of their width
FLAP = Material(E=1e7, nu=0.3, h=0.01, rho=1000.0)
FLAP_ETA = 2e-3  # crease stiffness K_r W / (E h^3)
FLAP_ANGLE = radians(60.0)  # where the crease has no moment
FLAP_DAMPING = 0.01  # in proportion to the stiffness, over the frequency of a stiff flap
# Strip between pins, in units of its length
STRIP = Material(E=1e6, nu=0.0, h=0.02, rho=1000.0)
WIDTH, SEGMENTS = 0.25, 8
SHORTENING = 0.0025  # of the distance between the pins
BENT = 0.03  # natural curvature, by which the strip knows its side
LOAD = 6.0  # EI / L^2, on the whole strip
STRIP_DAMPING = 0.05  # in proportion to the stiffness, over the frequency of the straight strip
# Tent of two panels of paper, in m, kg, s
PAPER = Material(E=2e9, nu=0.3, h=3e-4, rho=800.0)
PANEL, DEPTH, INCLUDED = 0.08, 0.10, 50.0  # across and along the crease, degrees
CREASE = 0.3  # moment per length and radian
SPEED, GAP, REACH = 1.0, 2e-3, 1e-3  # at the start; gap at which contact begins


@dataclass(frozen=True)
class Motion:
    """A motion that can be followed again and again from its start.

    Attributes:
        start: model at its start; collective.
        end: last time, from 0.
        state: what is compared at the end, in units of what it is compared with; collective.
    """

    start: Callable[[], Model]
    end: float
    state: Callable[[Model], np.ndarray]


@dataclass(frozen=True)
class TimeProblem:
    """A motion of the study.

    Attributes:
        name, title: name among the options, name in charts and texts.
        moves: what moves.
        compared: what is compared at the end, and with what.
        make: the motion; collective.
    """

    name: str
    title: str
    moves: str
    compared: str
    make: Callable[[MPI.Comm], Motion]


def swing(comm: MPI.Comm) -> Motion:
    """Flap let go in the plane of the held panel: half a period of a stiff flap."""
    sheet = mesh_pattern(z_fold(included_angle=180.0), 0.5, structure="structured", comm=comm)
    stiffness = FLAP_ETA * FLAP.E * FLAP.h**3
    frequency = sqrt(3.0 * stiffness / (FLAP.rho * FLAP.h))
    amplitude = 0.5 * sin(0.5 * FLAP_ANGLE)  # of the centre of both panels

    def start() -> Model:
        scene = Scene(sheet, FLAP)
        scene.crease("crease", stiffness, rest_angle=FLAP_ANGLE)
        scene.fix("left")
        scene.damping(stiffness=FLAP_DAMPING / frequency)
        return build(scene)

    def state(model: Model) -> np.ndarray:
        return np.concatenate([centre(model), speed(model) / frequency]) / amplitude

    return Motion(start, pi / frequency, state)


def snap(comm: MPI.Comm) -> Motion:
    """Strip that is buckled upwards and pushed down by a load that acts at once."""
    sheet = rectangle(1.0, WIDTH, n=(SEGMENTS, 1), comm=comm)
    bending = STRIP.E * STRIP.h**3 / 12.0  # per width
    frequency = pi**2 * sqrt(bending / (STRIP.rho * STRIP.h))
    rise = 2.0 / pi * sqrt(SHORTENING)

    def strip(load: float) -> Model:
        scene = Scene(sheet, STRIP)
        scene.fix("x0")
        scene.move("x1", x=-SHORTENING, y=0.0, z=0.0)
        scene.natural_curvature("sheet", np.diag([-BENT, 0.0, 0.0]))
        scene.damping(stiffness=STRIP_DAMPING / frequency)
        scene.area_load("sheet", (0.0, 0.0, -load * bending))
        return build(scene)

    buckled = strip(0.0)
    solve_static(buckled, [1.0], record=NO_RECORD, steps=StepSettings(0.25, 0.25), progress=False)

    def start() -> Model:
        model = strip(LOAD)
        model.x.array_w[:] = buckled.x.array_r
        return model

    def state(model: Model) -> np.ndarray:
        return np.array([centre(model)[2], speed(model)[2] / frequency]) / rise

    return Motion(start, 0.8 * pi / frequency, state)


def impact(comm: MPI.Comm) -> Motion:
    """Tent that falls on its feet on a smooth plane and flies off again."""
    pattern = z_fold(PANEL, DEPTH, INCLUDED)
    places = pattern.vertices_coords * [-1.0, 1.0, -1.0] + [0.0, 0.0, GAP]
    tent = replace(pattern, vertices_coords=places)
    sheet = mesh_pattern(tent, 0.5 * PANEL, structure="structured", comm=comm)

    def start() -> Model:
        scene = Scene(sheet, PAPER)
        scene.crease("crease", CREASE)
        scene.obstacle("floor", Plane(), suggest_barrier(scene, SPEED, distance=REACH))
        scene.launch((0.0, 0.0, -SPEED))
        return build(scene)

    return Motion(start, 2.5 * GAP / SPEED, lambda model: speed(model)[2:] / SPEED)


def centre(model: Model) -> np.ndarray:
    """Centre of mass (3,) of a model that moved; collective."""
    assert model.motion is not None
    return model.motion.centre(model.x)


def speed(model: Model) -> np.ndarray:
    """Velocity (3,) of the centre of mass of a model that moved; collective."""
    assert model.motion is not None
    return model.motion.momentum() / model.motion.total_mass


TIME_PROBLEMS = (
    TimeProblem(
        "vibration",
        "vibration",
        f"a stiff flap on a soft crease (eta = {FLAP_ETA:g}) beside a held panel is let go "
        f"{np.degrees(FLAP_ANGLE):.0f} degrees from its rest angle and swings to the other side; "
        f"damping in proportion to the stiffness, {50 * FLAP_DAMPING:g} % of critical",
        "place of the centre of mass over the amplitude, its velocity over amplitude and frequency",
        swing,
    ),
    TimeProblem(
        "snap",
        "snap",
        f"a strip between pins (h/L = {STRIP.h:g}), pushed together by {100 * SHORTENING:g} % so "
        f"that it bows upwards, is loaded at once by {LOAD:g} EI/L^2, hesitates, snaps through and "
        f"swings back; damping in proportion to the stiffness, {50 * STRIP_DAMPING:g} % of "
        "critical for the straight strip",
        "height of the centre of mass over the rise, its velocity over rise and frequency",
        snap,
    ),
    TimeProblem(
        "impact",
        "impact",
        f"a tent of two panels of paper (included angle {INCLUDED:g} degrees) falls at "
        f"{SPEED:g} m/s on its feet on a smooth plane (barrier as suggested, reach "
        f"{1000 * REACH:g} mm) and flies off",
        "vertical velocity of the centre of mass over the speed of the impact",
        impact,
    ),
)
