"""One case in time of the failure map: followed, judged, with the warnings it gave."""

import time
import warnings
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
from _failure_cases import Method
from _failure_runs import KINDS, Outcome, judge
from _impact_cases import Flight, Throw, energy_gain, flight

from ufl_origami.discretise import build
from ufl_origami.dynamics import DynamicResult, solve_dynamic
from ufl_origami.energy_book import balance_error
from ufl_origami.errors import AccuracyWarning, ContactWarning, SolveError
from ufl_origami.history import Record
from ufl_origami.model import Model
from ufl_origami.obstacles import Plane
from ufl_origami.solvers.dynamics import TimeSettings, TimeStep

IN_TIME = {**KINDS, AccuracyWarning: "accuracy", ContactWarning: "contact"}


@dataclass(frozen=True)
class Way:
    """A way to step in time.

    Attributes:
        name: name in tables and maps.
        scheme: integrator.
        fixed: whether all steps are equally long.
    """

    name: str
    scheme: str
    fixed: bool = True


@dataclass
class Watch:
    """Counts the effort of accepted steps and measures the sheet's gap, as `on_accept`.

    Attributes:
        floor: the only obstacle.
        time: of the last accepted state.
        steps, cuts, iterations: numbers so far.
        gap: smallest distance of a node from the floor so far, negative behind it.
    """

    floor: Plane
    time: float = 0.0
    steps: int = 0
    cuts: int = 0
    iterations: int = 0
    gap: float = np.inf
    _rest: np.ndarray | None = field(default=None, repr=False)

    def __call__(self, step: TimeStep, model: Model) -> None:
        """Take note of a step; collective."""
        self.time, self.steps, self.cuts = step.time, step.number, self.cuts + step.cuts
        self.iterations += step.iterations
        functions = model.functions
        if self._rest is None:
            self._rest = functions.V.tabulate_dof_coordinates()
        nodes = self._rest + model.configuration.to_local(model.x)[functions.dofs].reshape(-1, 3)
        normal = np.asarray(self.floor.normal) / np.linalg.norm(self.floor.normal)
        gap = float(((nodes - self.floor.point) @ normal).min(initial=np.inf))
        self.gap = min(self.gap, model.sheet.comm.allreduce(gap, op=MPI.MIN))


def run_throw(throw: Throw, method: Method, way: Way, comm: MPI.Comm, bound: float) -> Outcome:
    """Follow and judge one case; collective."""
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        case = flight(throw, method.model, comm)
        model, watch = build(case.scene), Watch(case.floor)
        result, reason = _follow(case, model, way, watch)
    error = case.error(result.model, result.history) if result else None
    verdict = judge(error, bound)
    if result and watch.gap <= 0:
        verdict = "wrong"
    return Outcome(
        setting=throw,
        method=method.name,
        solver=way.name,
        verdict=verdict,
        error=error,
        iterations=watch.iterations,
        reached=watch.time / case.end,
        reason=reason,
        warned=_kinds(caught, comm),
        triangles=model.sheet.num_cells_global,
        unknowns=model.num_unknowns,
        seconds=time.perf_counter() - begin,
        measured=_measured(watch, result),
    )


def _follow(case: Flight, model: Model, way: Way, watch: Watch) -> tuple[DynamicResult | None, str]:
    """The motion to its end, or None and why it failed."""
    settings = TimeSettings(step=case.step, fixed=way.fixed)
    options = {"scheme": way.scheme, "record": Record(fields="none"), "on_accept": watch}
    try:
        return solve_dynamic(model, [case.end], settings, **options), ""
    except SolveError as error:
        return None, error.reason


def _measured(watch: Watch, result: DynamicResult | None) -> dict[str, float | int | None]:
    """Effort, smallest gap, and the energy book's figures where the end was reached."""
    history = result.history if result else None
    return {
        "time_steps": watch.steps,
        "cuts": watch.cuts,
        "min_gap": watch.gap if watch.steps else None,
        "energy_gain": energy_gain(history) if history else None,
        "energy_balance_error": balance_error(history) if history else None,
        "lost_integrator": float(history["lost_integrator"][-1]) if history else None,
    }


def _kinds(caught: list[warnings.WarningMessage], comm: MPI.Comm) -> tuple[str, ...]:
    """Kinds of the package's own warnings on any rank; collective."""
    own = {IN_TIME[w.category] for w in caught if w.category in IN_TIME}
    return tuple(sorted(set().union(*comm.allgather(own))))
