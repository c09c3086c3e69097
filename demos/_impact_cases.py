"""Problems in time of the failure map: sheets thrown at a floor, each with its exact answer.

All of them are squares of side a tenth and thickness h, and none is held.

* impact: a rigid sheet flies flat at the floor, without gravity. It comes back as fast as it went.
* block: it lies on the floor at the gap at which the barrier bears its weight, and slides off at a
  speed v: it stops after X = (v^2 - eps^2) / (2 mu g) + ln 2 eps^2 / (mu g).
* skid: it hits the floor flat while it moves along it. Friction takes mu times the impulse of the
  impact, 2 v.
* corner: an elastic sheet hits the floor with a corner first, its plane nearly upright. All that is
  judged is the energy: none above that of the start, and a closed balance.

Times are counted in units that are exact as well: the contact of a sheet that hits the floor flat
at speed 1 on the barrier suggested for it (of a block: the time in which it stops at mu = 0.3).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, log

from mpi4py import MPI

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from ufl_origami.barrier import Barrier
from ufl_origami.energy_book import balance_error, energy_changes
from ufl_origami.friction_laws import Coulomb
from ufl_origami.history import History
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.model import Model
from ufl_origami.obstacles import Plane
from ufl_origami.scene import Scene
from ufl_origami.suggestions import suggest_barrier

# %% Parameters, in m, kg, s
SIDE, H, RHO, G = 0.1, 0.01, 1000.0, 9.81
FLIGHT = 0.5  # time before and after a flat impact, in units of time
RIGID = 60.0  # sqrt(E / rho) h / side^2, about the sheet's frequency, times its contact's time
ELASTIC = 1e8  # E of the sheet that falls on its corner
EPS, MU = 0.01, 0.3  # speed from which on all of the friction acts; friction of the base cases
CORNER = np.array([1.0, 0.6, 0.4]) / np.linalg.norm([1.0, 0.6, 0.4])  # the floor's normal
WAY = 0.04  # of the corner until it is judged
SEGMENTS = {"ddg": 2, "fem": 1}  # along the sides of the elastic sheet


@dataclass(frozen=True)
class Throw:
    """What is solved; each attribute is one difficulty.

    Attributes:
        problem: name out of `PROBLEMS`.
        dt: only or first time step, in the problem's unit of time.
        speed: of the impact, or of the block at its start.
        stiffness: of the barrier, over the suggested one.
        d_hat: reach of the barrier over the thickness.
        anew: whether the barrier is suggested for this speed and d_hat, or for 1 and 1.
        mu: coefficient of friction.
        lagged: whether friction is the lagged one.
    """

    problem: str = "impact"
    dt: float = 0.02
    speed: float = 1.0
    stiffness: float = 1.0
    d_hat: float = 1.0
    anew: bool = True
    mu: float = MU
    lagged: bool = False


@dataclass(frozen=True)
class Flight:
    """A scene in time, and how it is judged.

    Attributes:
        scene: the scene.
        floor: its only obstacle.
        step: only or first time step.
        end: last time, a multiple of the step.
        error: distance of the last state, or of the history, from what is exact.
    """

    scene: Scene
    floor: Plane
    step: float
    end: float
    error: Callable[[Model, History], float]


def flight(throw: Throw, model: str, comm: MPI.Comm) -> Flight:
    """Scene and judgement of a throw with a model; collective."""
    return PROBLEMS[throw.problem](throw, model, comm)


# %% What is exact: a rigid sheet on a barrier, and a block that slides
def contact_time(barrier: Barrier, speed: float) -> float:
    """Time that a rigid sheet is in contact: what rho h z'' = pressure(z) leaves of quadratures.

    With y = z / d_hat, the energies give y' = -sqrt(1 - Psi(y) / (rho h v^2 / 2)) v / d_hat down to
    the gap y0 at which the root vanishes. y = y0 + (1 - y0) s^2 makes it regular there.
    """
    reach, kinetic = barrier.distance, 0.5 * RHO * H * speed**2

    def left(y: float) -> float:
        return 1.0 - barrier.energy(y * reach) / kinetic

    lowest = np.exp(brentq(lambda u: left(np.exp(u)), -700.0, -1e-9)) if left(1e-300) < 0 else 0.0

    def slowness(s: float) -> float:
        return 2 * s * (1 - lowest) / np.sqrt(max(left(lowest + (1 - lowest) * s**2), 1e-300))

    return float(2 * reach / speed * quad(slowness, 1e-6, 1.0, limit=200)[0])


def sliding_way(speed: float, mu: float) -> float:
    """Way of a block until friction mu f(v / EPS), f(y) = 2 y - y^2 below 1, has stopped it."""
    return ((speed**2 - EPS**2) / 2 + log(2) * EPS**2) / (mu * G)


# %% Scenes
def chosen_barrier(throw: Throw, scene: Scene) -> Barrier:
    """The barrier of a throw, by the suggestion for the scene."""
    named = (throw.speed, throw.d_hat) if throw.anew else (1.0, 1.0)
    suggested = suggest_barrier(scene, named[0], distance=named[1] * H)
    return Barrier(throw.stiffness * suggested.stiffness, throw.d_hat * H)


def _sheet(model: str, comm: MPI.Comm, young: float, segments: int = 1) -> Scene:
    mesh = rectangle(SIDE, SIDE, n=(segments, segments), comm=comm)
    return Scene(mesh, Material(young, 0.3, H, RHO), model=model)


def _velocity(model: Model) -> np.ndarray:
    """Velocity (3,) of the centre of mass; collective."""
    assert model.motion is not None
    return model.motion.momentum() / model.motion.total_mass


def _steps(end: float, step: float) -> float:
    """The first multiple of the step that is no earlier than the end."""
    return step * ceil(end / step - 1e-9)


# %% Problems
def impact(throw: Throw, model: str, comm: MPI.Comm) -> Flight:
    """Relative error of the speed at which a flat sheet comes back."""
    scene, floor, step, end = _flat(throw, model, comm)
    scene.launch((0.0, 0.0, -throw.speed))

    def error(made: Model, history: History) -> float:
        return abs(float(_velocity(made)[2]) / throw.speed - 1.0)

    return Flight(scene, floor, step, end, error)


def skid(throw: Throw, model: str, comm: MPI.Comm) -> Flight:
    """Relative error of the impulse that friction takes in a flat impact."""
    scene, floor, step, end = _flat(throw, model, comm)
    scene.friction("floor", Coulomb(throw.mu, EPS), lagged=throw.lagged)
    scene.launch((throw.speed, 0.0, -throw.speed))
    taken = 2 * throw.mu * throw.speed

    def error(made: Model, history: History) -> float:
        return abs(float(throw.speed - _velocity(made)[0]) / taken - 1.0)

    return Flight(scene, floor, step, end, error)


def _flat(throw: Throw, model: str, comm: MPI.Comm) -> tuple[Scene, Plane, float, float]:
    """A rigid sheet over the floor that it is about to hit flat, step and end.

    It is stiff enough not to swing: also at its contact's time scale, on which the consistent
    masses of the fem model and the nodes' contact forces would bend it.
    """
    bare = _sheet(model, comm, ELASTIC)
    barrier, unit = chosen_barrier(throw, bare), contact_time(suggest_barrier(bare, 1.0), 1.0)
    contact = contact_time(barrier, throw.speed)
    scene = _sheet(model, comm, RHO * (RIGID * SIDE**2 / (H * contact)) ** 2)
    way = throw.speed * FLIGHT * unit
    floor = Plane((0.0, 0.0, -barrier.distance - way))
    scene.obstacle("floor", floor, barrier)
    step = throw.dt * unit
    return scene, floor, step, _steps(contact + 2 * FLIGHT * unit, step)


def block(throw: Throw, model: str, comm: MPI.Comm) -> Flight:
    """Relative error of the way that a sliding block goes."""
    scene, half = _sheet(model, comm, ELASTIC), 0.5 * throw.d_hat * H
    shape = Barrier(1.0, 2 * half)
    barrier = Barrier(RHO * H * G / shape.pressure(half), shape.distance)
    floor, speed = Plane((0.0, 0.0, -half)), throw.speed
    scene.gravity((0.0, 0.0, -G))
    scene.obstacle("floor", floor, barrier)
    scene.friction("floor", Coulomb(throw.mu, EPS), lagged=throw.lagged)
    scene.launch((speed, 0.0, 0.0))
    unit = speed / (MU * G)
    step = throw.dt * unit
    end = _steps(1.25 * unit * MU / (throw.mu or MU), step)
    exact = sliding_way(speed, throw.mu) if throw.mu else speed * end

    def error(made: Model, history: History) -> float:
        assert made.motion is not None
        return abs(float(made.motion.centre(made.x)[0] - 0.5 * SIDE) / exact - 1.0)

    return Flight(scene, floor, step, end, error)


def corner(throw: Throw, model: str, comm: MPI.Comm) -> Flight:
    """Energy above that of the start, or imbalance, over the largest energy."""
    scene = _sheet(model, comm, ELASTIC, SEGMENTS[model])
    barrier = chosen_barrier(throw, scene)
    floor = Plane(tuple(-(barrier.distance + 0.125 * WAY) * CORNER), tuple(CORNER))
    scene.obstacle("floor", floor, barrier)
    scene.launch(tuple(-throw.speed * CORNER))
    step = throw.dt * contact_time(suggest_barrier(scene, 1.0), 1.0)

    def error(made: Model, history: History) -> float:
        return max(energy_gain(history), balance_error(history))

    return Flight(scene, floor, step, _steps(WAY / throw.speed, step), error)


def energy_gain(history: History) -> float:
    """Largest energy above that of the start, over the largest energy."""
    total = history["energy_total"]
    largest = max(float(np.abs(values).max()) for values in energy_changes(history).values())
    return float((total - total[0]).max()) / largest


PROBLEMS: dict[str, Callable[[Throw, str, MPI.Comm], Flight]] = {
    "impact": impact,
    "block": block,
    "skid": skid,
    "corner": corner,
}
