"""Who pays least for a tolerance, judged from the points alone."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from _work_precision_figures import COSTS, known
from _work_precision_problems import METHODS, Problem

from ufl_origami.work_precision import Cost, Point, cost_at, error_names, picked

TOLERANCES = (0.01, 0.001)
TIE = 1.25  # factor in seconds below which repeated studies may change the order


@dataclass(frozen=True)
class Verdict:
    """What the methods pay for a tolerance in one error of one problem.

    Attributes:
        problem, thickness, error, mesh, tolerance, cost: what is compared.
        paid: method -> cost, None where its finest mesh does not reach the tolerance.
    """

    problem: Problem
    thickness: float
    error: str
    mesh: str
    tolerance: float
    cost: str
    paid: Mapping[str, Cost | None]

    @property
    def winner(self) -> str | None:
        """Name of the cheapest method, None where none reaches the tolerance."""
        found = {name: cost.value for name, cost in self.paid.items() if cost}
        return min(found, key=lambda name: found[name]) if found else None

    @property
    def ties(self) -> tuple[str, ...]:
        """Names of the methods that are as good as the winner, itself among them."""
        limit = TIE if self.cost == "seconds" else 1.0
        return tuple(name for name in self.paid if self.factor(name) <= limit)

    def factor(self, name: str) -> float:
        """Cost of a method over the winner's, inf where it does not reach the tolerance."""
        paid, best = self.paid[name], self.paid[self.winner] if self.winner else None
        return paid.value / best.value if paid and best else inf


def judge(points: Sequence[Point], errors: Iterable[str] | None = None) -> Iterator[Verdict]:
    """All verdicts of a study; the errors are the problem's and the "largest" by default."""
    for problem in known(points):
        own = picked(points, problem=problem.name)
        names = error_names(own)
        for thickness in dict.fromkeys(p.thickness for p in own):
            for error in errors or (("largest", *names) if len(names) > 1 else ("largest",)):
                for mesh in dict.fromkeys(p.mesh for p in own):
                    for tolerance in TOLERANCES:
                        for cost in COSTS:
                            some = picked(own, thickness=thickness, mesh=mesh)
                            paid = prices(some, error, tolerance, cost)
                            yield Verdict(problem, thickness, error, mesh, tolerance, cost, paid)


def methods_of(points: Iterable[Point]) -> list[str]:
    """Names of the methods of the points, in the order of the study."""
    names = {point.method for point in points}
    return [method.name for method in METHODS if method.name in names]


def prices(
    points: Sequence[Point], error: str, tolerance: float, cost: str
) -> dict[str, Cost | None]:
    """Cost of a tolerance by method."""
    paid = {}
    for method in methods_of(points):
        some = picked(points, method=method)
        costs, errors = [getattr(p, cost) for p in some], [p.error(error) for p in some]
        paid[method] = cost_at(costs, errors, tolerance)
    return paid
