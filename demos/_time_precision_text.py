"""The study in time in words: which integrator pays least, made from the points alone."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan

from _time_precision_figures import moved
from _time_precision_problems import TimeProblem
from _time_precision_runs import CONTROLS, ENERGY, SCHEMES, TIME_ENOUGH, TIME_REPEATS, Reference
from _work_precision_text import head, number, percent, price, row
from _work_precision_verdicts import TIE, TOLERANCES

from ufl_origami.work_precision import Cost, TimePoint, cost_at, fitted_order, picked

Curve = tuple[str, str]
CURVES: dict[Curve, str] = {
    (scheme, control): f"{title} with {control} steps"
    for scheme, title in SCHEMES.items()
    for control in CONTROLS
}


@dataclass(frozen=True)
class TimeVerdict:
    """What the curves of one problem pay for a tolerance.

    Attributes:
        problem, tolerance: what is compared.
        paid: curve -> seconds, None where its finest point does not reach the tolerance.
        steps: curve -> steps.
        guessed: curve -> seconds where its last points, followed on straight, would reach it.
    """

    problem: TimeProblem
    tolerance: float
    paid: Mapping[Curve, Cost | None]
    steps: Mapping[Curve, Cost | None]
    guessed: Mapping[Curve, float]

    @property
    def winner(self) -> Curve | None:
        """The cheapest curve, None where none reaches the tolerance."""
        return min(self.paid, key=self.seconds) if any(self.paid.values()) else None

    def seconds(self, curve: Curve) -> float:
        """Seconds of a curve, inf where it does not reach the tolerance."""
        paid = self.paid.get(curve)
        return paid.value if paid else inf

    def factor(self, curve: Curve, *, guess: bool = False) -> float:
        """Seconds of a curve, guessed ones if asked for, over the winner's."""
        found = self.guessed[curve] if guess else self.seconds(curve)
        return found / self.seconds(self.winner) if self.winner else inf

    def best(self, scheme: str) -> float:
        """Seconds of a scheme with its better steps, inf where it does not reach the tolerance."""
        return min(self.seconds((scheme, control)) for control in CONTROLS)


def judge_time(points: Sequence[TimePoint]) -> Iterator[TimeVerdict]:
    """All verdicts of the study in time."""
    for problem in moved(points):
        curves = {
            curve: picked(points, problem=problem.name, scheme=curve[0], control=curve[1])
            for curve in CURVES
        }
        curves = {curve: some for curve, some in curves.items() if some}
        for tolerance in TOLERANCES:
            paid, steps, guessed = {}, {}, {}
            for curve, some in curves.items():
                errors, seconds = [p.error() for p in some], [p.seconds for p in some]
                paid[curve] = cost_at(seconds, errors, tolerance)
                steps[curve] = cost_at([float(p.steps) for p in some], errors, tolerance)
                guessed[curve] = followed_on(seconds, errors, tolerance)
            yield TimeVerdict(problem, tolerance, paid, steps, guessed)


def followed_on(seconds: Sequence[float], errors: Sequence[float], tolerance: float) -> float:
    """Seconds at which the straight line through the last three points meets a tolerance."""
    some = [(e, s) for e, s in zip(errors, seconds, strict=True) if 0 < e < inf]
    slope = fitted_order(*zip(*some, strict=True)) if some else inf
    if not slope < 0:
        return inf
    last, spent = some[-1]
    return spent * (tolerance / last) ** slope


def time_report(points: Sequence[TimePoint], references: Sequence[Reference], ranks: int) -> str:
    """The text, in Markdown.

    Args:
        points: all points.
        references: what they are compared with.
        ranks: number of processes.
    """
    verdicts = list(judge_time(points))
    parts = [
        ["# Speed against accuracy in time", "", *introduction(points, ranks)],
        ["## Integrators in short", "", *summary(verdicts)],
        ["## Which integrator wins", "", *map(sentence, verdicts)],
        ["## Seconds and steps of each tolerance", "", *table(verdicts)],
        ["## Orders in the time step", "", *orders(points)],
        ["## Motions and their references", "", *motions(points, references)],
    ]
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def introduction(points: Sequence[TimePoint], ranks: int) -> list[str]:
    """How to read the figures."""
    elapsed = sum(p.elapsed for p in points) / sum(p.seconds for p in points)
    failed = sum(bool(p.failure) for p in points)
    return [
        f"{len(points)} points, {failed} of them without a solution, on {ranks} rank(s), the mesh "
        "of each motion the same. Made by `./run demo speed_accuracy`; nothing is written by hand.",
        "",
        "- Seconds are processor seconds of the slowest rank from the start of the motion to its "
        "end; building the model is left out. A point is the fastest of up to "
        f"{TIME_REPEATS} runs (one with --quick, or from {TIME_ENOUGH:g} s on). In this run "
        f"{elapsed:.2f} seconds passed for each of them.",
        "- The error is that of the state at the end: the distance of what each motion compares "
        '("Motions and their references") from a fine run of BDF2, relative to the quantities '
        "named there.",
        "- Fixed steps divide the duration, and keep no energy book. Adaptive steps follow a "
        f"tolerance of the local error and {ENERGY:g} times as much for the energy lost in a "
        "step, for which they keep the book.",
        "- A tolerance is met from that step on from which all finer ones meet it as well; seconds "
        "between two points are interpolated on the logarithmic chart. A tie: within "
        f"{TIE:g} times the seconds of the winner. Where a curve ends above a tolerance, its last "
        "three points are followed on straight, and the factor is called extrapolated.",
    ]


def summary(verdicts: Sequence[TimeVerdict]) -> list[str]:
    """BDF2 against implicit Euler, each with its better kind of steps."""
    lines = []
    for tolerance in TOLERANCES:
        parts = [compared(v) for v in verdicts if v.tolerance == tolerance]
        lines.append(
            f"- At {percent(tolerance)} implicit Euler takes, each with its better kind of steps, "
            f"so many times the seconds of BDF2: {', '.join(parts)}."
        )
    return lines


def compared(verdict: TimeVerdict) -> str:
    """Seconds of implicit Euler over those of BDF2 in words."""
    euler, bdf2, title = verdict.best("implicit_euler"), verdict.best("bdf2"), verdict.problem.title
    if isfinite(euler) and isfinite(bdf2):
        return f"{number(euler / bdf2)} ({title})"
    if not isfinite(bdf2):
        return f"not reached by BDF2 ({title})"
    guess = min(v for (scheme, _), v in verdict.guessed.items() if scheme == "implicit_euler")
    if not isfinite(guess):
        return f"not reached by implicit Euler ({title})"
    return f"about {rough(guess / bdf2)}, extrapolated ({title})"


def rough(value: float) -> str:
    """Two digits."""
    return number(float(f"{value:.2g}"))


def sentence(verdict: TimeVerdict) -> str:
    """One verdict as a sentence."""
    start = f"- {verdict.problem.title}, {percent(verdict.tolerance)}: "
    if verdict.winner is None:
        return f"{start}no integrator reaches it."
    winner, others = verdict.winner, [c for c in verdict.paid if c != verdict.winner]
    cost = price(verdict.paid[winner])
    tail = "; ".join(behind(verdict, curve) for curve in others)
    return f"{start}**{CURVES[winner]}** wins with {cost} s" + (f"; {tail}." if tail else ".")


def behind(verdict: TimeVerdict, curve: Curve) -> str:
    """How much dearer a curve is than the winner."""
    if verdict.paid[curve] is None:
        guess = verdict.factor(curve, guess=True)
        end = f", about {rough(guess)} times if extrapolated" if isfinite(guess) else ""
        return f"{CURVES[curve]} does not reach it{end}"
    tie = " (a tie)" if verdict.factor(curve) <= TIE else ""
    return f"{CURVES[curve]} {number(verdict.factor(curve))} times{tie}"


def table(verdicts: Sequence[TimeVerdict]) -> list[str]:
    """Seconds and steps."""
    curves = [curve for curve in CURVES if any(curve in v.paid for v in verdicts)]
    lines = head(["motion", "error", *(CURVES[curve] for curve in curves)])
    for verdict in verdicts:
        cells = []
        for curve in curves:
            steps = verdict.steps.get(curve)
            text = price(verdict.paid.get(curve)) + (
                f" s, {steps.value:.0f} steps" if steps else ""
            )
            cells.append(f"**{text}**" if curve == verdict.winner else text)
        lines.append(row([verdict.problem.title, percent(verdict.tolerance), *cells]))
    return lines


def orders(points: Sequence[TimePoint]) -> list[str]:
    """Orders of fixed steps."""
    lines = ["Of fixed steps, fitted through the three smallest.", ""]
    lines += head(["motion", *SCHEMES.values()])
    for problem in moved(points):
        found = [time_order(points, problem.name, scheme) for scheme in SCHEMES]
        lines.append(row([problem.title, *("-" if isnan(o) else f"{o:.2f}" for o in found)]))
    return lines


def time_order(points: Sequence[TimePoint], problem: str, scheme: str) -> float:
    """Order of an integrator with fixed steps on one motion."""
    some = picked(points, problem=problem, scheme=scheme, control="fixed")
    return fitted_order([p.size for p in some], [p.error() for p in some])


def motions(points: Sequence[TimePoint], references: Sequence[Reference]) -> list[str]:
    """What moves, what is compared, and how good the reference is."""
    lines = []
    for problem, reference in zip(moved(points), references, strict=True):
        own = picked(points, problem=problem.name)[0]
        lines.append(
            f"- {problem.title}: {problem.moves}; {own.dofs} unknowns. Compared: "
            f"{problem.compared}. Reference: {reference.steps} fixed steps of BDF2 "
            f"({number(reference.seconds)} s), {100 * reference.error:.2g} % off if the error "
            "falls by the square of the step from the finest point on."
        )
    return lines
