"""What paths by arc length are made of: settings, inner product, points, events."""

from dataclasses import dataclass, field
from typing import NamedTuple

from petsc4py import PETSc

import numpy as np

from ufl_origami.errors import InputError
from ufl_origami.problem import Problem
from ufl_origami.solvers.dynamics import sheet_size
from ufl_origami.solvers.weights import area_weights


@dataclass(frozen=True)
class ArcSettings:
    """Steps along a path.

    Attributes:
        first: first step, in units of the load factor.
        largest: longest step, arc length.
        load: largest change of the load factor in one step.
        shortest: a step below this part of the first one, or of the longest since, is given up.
        growth: factor after an easy step.
        easy: Newton iterations up to which a step is easy; above twice as many the next is shorter.
        bend: largest angle (radians) between the directions at both ends of a step: a sharper bend
            is taken in shorter steps, and may be the jump to another branch.
        stray: largest distance of a state from the predicted one over the length of the step.
        tolerance: length of the interval within which an event is located, over the step's.
        steps: largest number of steps.
        locate: whether limit points and bifurcations are sought.
    """

    first: float = 0.05
    largest: float = 0.1
    load: float = np.inf
    shortest: float = 1e-5
    growth: float = 1.5
    easy: int = 5
    bend: float = 0.5
    stray: float = 0.5
    tolerance: float = 1e-6
    steps: int = 1000
    locate: bool = True

    def __post_init__(self) -> None:
        """Refuse sizes that are none.

        Raises:
            InputError: naming the setting.
        """
        for name, value in vars(self).items():
            if name != "locate" and not value > 0:
                raise InputError(f"arc settings: {name} = {value} is not positive")
        if self.growth < 1:
            raise InputError(f"arc settings: growth {self.growth} is below 1")


class Metric:
    """Inner product of displacements: mean over the sheet, over its diagonal squared.

    Args:
        problem: terms and constraints.
    """

    def __init__(self, problem: Problem):
        self.weights = area_weights(problem.configuration, angles=False)
        self.diagonal = sheet_size(problem)
        self.weights.scale(3.0 / (self.weights.sum() * self.diagonal**2))

    def row(self, vector: PETSc.Vec) -> PETSc.Vec:
        """Coefficients of the product with a vector."""
        out = vector.duplicate()
        out.pointwiseMult(self.weights, vector)
        return out

    def dot(self, one: PETSc.Vec, other: PETSc.Vec) -> float:
        """Product of two vectors of unknowns."""
        return self.row(one).dot(other)

    def norm(self, vector: PETSc.Vec) -> float:
        """Length of a vector."""
        return float(np.sqrt(self.dot(vector, vector)))

    def distance(self, one: PETSc.Vec, other: PETSc.Vec) -> float:
        """Length of the difference of two vectors."""
        difference = one.copy()
        difference.axpy(-1.0, other)
        return self.norm(difference)


class ArcPoint(NamedTuple):
    """A point of a path.

    Attributes:
        x: unknowns.
        load: load factor.
        arc: arc length from the start.
        tangent: change of the unknowns with the arc length.
        slope: change of the load factor with it.
        pivots: negative pivots of the tangent stiffness, None where unknown.
        neutral: whether an eigenvalue is zero but for round-off.
    """

    x: PETSc.Vec
    load: float
    arc: float
    tangent: PETSc.Vec
    slope: float
    pivots: int | None
    neutral: bool = False


@dataclass(frozen=True)
class Event:
    """A limit point or a bifurcation.

    Attributes:
        kind: "limit point" or "bifurcation".
        load: load factor.
        arc: arc length at which it lies.
        before: negative pivots before it, None where unknown.
        after: negative pivots after it.
        x: unknowns; None where a resumed run has forgotten them.
        mode: the critical eigenvector, of length 1 by the path's metric; None where there is none.
        memory: branches of angles of the accepted state before, from which `x` counts its own.
    """

    kind: str
    load: float
    arc: float
    before: int | None
    after: int | None
    x: PETSc.Vec | None
    mode: PETSc.Vec | None = None
    memory: list[dict[str, np.ndarray]] = field(default_factory=list)
