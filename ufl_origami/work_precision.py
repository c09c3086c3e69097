"""Points of work-precision charts, their file, and what a tolerance costs.

A curve is one method's points over its meshes, or one integrator's over its time steps, from coarse
to fine. An error that is small on one mesh by chance, because it changes sign there, is no
accuracy: a tolerance counts as met from that mesh on from which all finer ones meet it too. Costs
in between are interpolated on the logarithmic chart.
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from math import ceil, inf, isfinite, log
from pathlib import Path
from typing import Any, Protocol, TypeVar, get_type_hints

import numpy as np

from ufl_origami.errors import InputError

ERRORS = ("angle", "force", "profile", "deflection")
"""Errors that a point may have, relative."""


@dataclass(frozen=True)
class Point:
    """One solved problem on one mesh.

    Attributes:
        problem, method, mesh: what was solved, how, on which kind of mesh.
        model, bending, measure: the scene's options of the method (bending and measure empty for
            "fem").
        step: load step.
        thickness: nominal thickness over length of the problem.
        n, size: segments as the problem counts them, length of one of them.
        h, panel_length, sheet_area: thickness, root of the smallest panel's area, area of all
            panels, in the units of the problem.
        triangles, dofs: size of the mesh, number of unknowns.
        steps, newton_iterations, factorisations, cuts, unstable: effort of the path; accepted
            unstable states.
        seconds, assembly_seconds, factorisation_seconds, rest_seconds: see timing.py.
        elapsed, build_seconds: elapsed seconds of the path, processor seconds from scene to model.
        error_angle, error_force, error_profile, error_deflection: relative errors with their sign
            (the profile's has none), None where the problem lacks them.
        failure: why the path stopped, or an empty string.
    """

    problem: str
    method: str
    mesh: str
    model: str
    bending: str
    measure: str
    step: float
    thickness: float
    n: int
    size: float
    h: float
    panel_length: float
    sheet_area: float
    triangles: int
    dofs: int
    steps: int
    newton_iterations: int
    factorisations: int
    cuts: int
    unstable: int
    seconds: float
    assembly_seconds: float
    factorisation_seconds: float
    rest_seconds: float
    elapsed: float
    build_seconds: float
    error_angle: float | None = None
    error_force: float | None = None
    error_profile: float | None = None
    error_deflection: float | None = None
    failure: str = ""

    def error(self, name: str = "largest") -> float:
        """Size of one of the `ERRORS`, or of the "largest" of them; inf where the path failed.

        Raises:
            InputError: the problem has no such error.
        """
        if self.failure:
            return inf
        wanted = ERRORS if name == "largest" else (name,)
        values = [getattr(self, f"error_{one}") for one in wanted]
        found = [abs(value) for value in values if value is not None]
        if not found:
            raise InputError(f"{self.problem}: no error {name!r}")
        return max(found)


@dataclass(frozen=True)
class TimePoint:
    """One motion followed by one integrator.

    Attributes:
        problem, scheme: what moved, the integrator.
        control: how steps were chosen, "fixed" or "adaptive".
        size: fixed step over the duration, or tolerance of the local error.
        duration: last time.
        dofs: number of unknowns.
        steps, newton_iterations, factorisations, cuts: effort of the motion.
        smallest_step, largest_step: of the accepted steps.
        seconds, assembly_seconds, factorisation_seconds, rest_seconds: see timing.py.
        elapsed: elapsed seconds.
        deviation: relative distance from the reference at the end, None where the motion failed.
        failure: why it stopped, or an empty string.
    """

    problem: str
    scheme: str
    control: str
    size: float
    duration: float
    dofs: int
    steps: int
    newton_iterations: int
    factorisations: int
    cuts: int
    smallest_step: float
    largest_step: float
    seconds: float
    assembly_seconds: float
    factorisation_seconds: float
    rest_seconds: float
    elapsed: float
    deviation: float | None = None
    failure: str = ""

    def error(self) -> float:
        """The deviation; inf where the motion failed."""
        return inf if self.deviation is None else self.deviation


class Refined(Protocol):
    """Anything that stands on a curve from coarse to fine."""

    @property
    def size(self) -> float:
        """What is refined: the smaller, the finer."""


Row = TypeVar("Row", Point, TimePoint)
Place = TypeVar("Place", bound=Refined)


def error_names(points: Iterable[Point]) -> tuple[str, ...]:
    """The `ERRORS` that any of the points has."""
    points = list(points)
    return tuple(
        name for name in ERRORS if any(getattr(p, f"error_{name}") is not None for p in points)
    )


def write_points(file: str | Path, points: Iterable[Point]) -> Path:
    """Write points as CSV, one line a point, columns as `Point`."""
    return _write(file, Point, points)


def write_time_points(file: str | Path, points: Iterable[TimePoint]) -> Path:
    """Write points as CSV, one line a point, columns as `TimePoint`."""
    return _write(file, TimePoint, points)


def _write(file: str | Path, kind: type[Row], points: Iterable[Row]) -> Path:
    path = Path(file)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="ascii") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(kind)])
        writer.writeheader()
        for point in points:
            writer.writerow({k: "" if v is None else v for k, v in asdict(point).items()})
    return path


def read_points(file: str | Path) -> list[Point]:
    """Read points back.

    Raises:
        InputError: the file has other columns, or a cell that is no number where one is due.
    """
    return _read(file, Point)


def read_time_points(file: str | Path) -> list[TimePoint]:
    """Read points of motions back.

    Raises:
        InputError: the file has other columns, or a cell that is no number where one is due.
    """
    return _read(file, TimePoint)


def _read(file: str | Path, kind: type[Row]) -> list[Row]:
    kinds = get_type_hints(kind)
    with Path(file).open(newline="", encoding="ascii") as stream:
        reader = csv.DictReader(stream)
        if list(reader.fieldnames or ()) != list(kinds):
            raise InputError(f"{file} is no table of work and precision: {reader.fieldnames}")
        rows = list(reader)
    try:
        return [kind(**_parsed(row, kinds)) for row in rows]
    except ValueError as error:
        raise InputError(f"{file}: {error}") from error


def _parsed(row: Mapping[str, str], kinds: Mapping[str, object]) -> dict[str, Any]:
    return {name: _parse(kinds[name], text) for name, text in row.items()}


def _parse(kind: object, text: str) -> str | int | float | None:
    if kind is str:
        return text
    if kind is int:
        return int(text)
    return float(text) if text or kind is float else None


def picked(points: Iterable[Place], **values: object) -> list[Place]:
    """The points with these values, from coarse to fine."""
    found = [p for p in points if all(getattr(p, k) == v for k, v in values.items())]
    return sorted(found, key=lambda point: -point.size)


def assured(errors: Sequence[float]) -> np.ndarray:
    """Largest error (n,) of each mesh and all finer ones; errors from coarse to fine."""
    return np.maximum.accumulate(np.asarray(errors, dtype=float)[::-1])[::-1]


@dataclass(frozen=True)
class Cost:
    """What a tolerance costs on a curve.

    Attributes:
        value: the cost.
        most: whether already the coarsest mesh meets the tolerance, so that it may cost less.
    """

    value: float
    most: bool = False


def cost_at(costs: Sequence[float], errors: Sequence[float], tolerance: float) -> Cost | None:
    """Cost of a tolerance on a curve, None where its finest mesh does not meet it.

    Where a finer mesh happens to cost less, its cost counts.

    Args:
        costs: positive costs (n,) from coarse to fine.
        errors: errors (n,) of the same meshes.
        tolerance: largest error.
    """
    at = place_of(errors, tolerance)
    if at is None:
        return None
    fine = ceil(at)
    between = float(np.exp(np.interp(at, np.arange(len(costs)), np.log(costs))))
    return Cost(min([between, *map(float, costs[fine:])]), most=fine == 0)


def place_of(errors: Sequence[float], tolerance: float) -> float | None:
    """Place on a curve, 0 the coarsest mesh, from which on it meets a tolerance; None: nowhere.

    Between two meshes the place is where the logarithm of the error is, or the finer one where the
    coarser has no solution.
    """
    least = assured(errors)
    met = np.flatnonzero(least <= tolerance)
    if not len(met):
        return None
    fine = int(met[0])
    if fine == 0 or not (isfinite(least[fine - 1]) and least[fine] > 0):
        return float(fine)
    high, low = float(least[fine - 1]), float(least[fine])
    return fine - 1 + log(high / tolerance) / log(high / low)


def order(points: Sequence[Point], error: str = "largest", last: int = 3) -> float:
    """Order in the size of the mesh, fitted through the last points from coarse to fine."""
    return fitted_order([p.size for p in points], [p.error(error) for p in points], last)


def fitted_order(sizes: Sequence[float], errors: Sequence[float], last: int = 3) -> float:
    """Order of errors in sizes, fitted through the last ones that are positive and finite; or nan.

    Args:
        sizes: what is refined (n,), from coarse to fine.
        errors: errors (n,).
        last: how many count.
    """
    some = [(s, e) for s, e in zip(sizes, errors, strict=True) if 0 < e < inf][-last:]
    if len(some) < 2:
        return float("nan")
    log_sizes, log_errors = [log(s) for s, _ in some], [log(e) for _, e in some]
    return float(np.polyfit(log_sizes, log_errors, 1)[0])
