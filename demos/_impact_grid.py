"""The declared grid of difficulties in time: dt, barrier, friction, speed of the impact."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from _failure_cases import Method
from _failure_runs import Outcome
from _impact_cases import Throw
from _impact_runs import Way

METHODS = (Method("director", "ddg"), Method("fem", "fem"))
WAYS = (
    Way("euler", "implicit_euler"),
    Way("bdf2", "bdf2"),
    Way("auto", "bdf2", fixed=False),
)
OWN = ("auto",)
WHOLE = {
    "impact dt": (0.004, 0.02, 0.1, 0.5, 2.0),
    "stiffness": (1e-2, 1e-1, 1.0, 1e2, 1e4),
    "d_hat": (0.1, 1.0, 10.0),
    "d_hat anew": (0.01, 0.1, 1.0),
    "speed": (0.1, 1.0, 3.0, 10.0, 100.0),
    "speed anew": (1.0, 10.0, 100.0),
    "block dt": (0.02, 0.1, 0.5),
    "mu": (0.0, 0.1, 0.3, 3.0, 10.0, 30.0),
    "lagged mu": (0.3, 10.0),
    "skid dt": (0.02, 0.1, 0.5, 2.0),
    "lagged skid dt": (0.02, 0.1, 0.5, 2.0),
    "corner speed": (1.0, 3.0, 100.0),
    "corner speed anew": (1.0, 10.0, 100.0),
}
QUICK = {
    "impact dt": (0.02, 0.5),
    "speed": (100.0,),
    "speed anew": (100.0,),
    "mu": (10.0,),
    "corner speed anew": (10.0,),
}
BOUND = 0.05  # error above which a motion is wrong
EXPLAINED = (
    f"A motion is wrong when its error is above {BOUND:.0%} (speed of the rebound; way of the "
    "block; friction's impulse of a skid; energy gained or unaccounted for of the corner) or when "
    "it went through the floor."
)

_DT = f"dt/T = {Throw.dt:g}"
_TITLES = {
    "impact dt": ("flat impact, barrier as suggested: dt / T", "dt", Throw()),
    "stiffness": (f"flat impact, {_DT}: stiffness / suggested", "stiffness", Throw()),
    "d_hat": ("flat impact, suggested stiffness kept: d_hat / h", "d_hat", Throw(anew=False)),
    "d_hat anew": ("flat impact, suggested anew: d_hat / h", "d_hat", Throw()),
    "speed": ("flat impact, suggested barrier kept: speed", "speed", Throw(anew=False)),
    "speed anew": ("flat impact, suggested anew: speed", "speed", Throw()),
    "block dt": ("sliding block: dt / T", "dt", Throw("block")),
    "mu": (f"sliding block, {_DT}: mu", "mu", Throw("block")),
    "lagged mu": ("sliding block, lagged friction: mu", "mu", Throw("block", lagged=True)),
    "skid dt": ("skidding impact: dt / T", "dt", Throw("skid")),
    "lagged skid dt": ("skidding impact, lagged: dt / T", "dt", Throw("skid", lagged=True)),
    "corner speed": (
        "corner impact, suggested barrier kept: speed", "speed", Throw("corner", anew=False),
    ),
    "corner speed anew": ("corner impact, suggested anew: speed", "speed", Throw("corner")),
}  # fmt: skip


def in_short(throw: Throw, method: Method, way: Way) -> bool:
    """Whether a case is in the short grid: equal steps only meet dt, with the ddg model."""
    return way.name in OWN or (method.model == "ddg" and throw == Throw(dt=throw.dt))


def names_barrier(outcome: Outcome) -> bool:
    """Whether a failure's reason is that the barrier is too weak."""
    return "obstacle 'floor': its barrier" in outcome.reason and "too weak" in outcome.reason


def declare(values: Mapping[str, Sequence[float]]) -> dict[str, dict[str, Throw]]:
    """Groups of rows, title -> label -> throw; what is the base case in all of them is one."""
    groups = {}
    for name, numbers in values.items():
        title, attribute, base = _TITLES[name]
        rows = {f"{number:g}": replace(base, **{attribute: number}) for number in numbers}
        groups[title] = {label: _plain(throw) for label, throw in rows.items()}
    return groups


def _plain(throw: Throw) -> Throw:
    """The same throw with a barrier that is suggested anew, where this changes nothing."""
    kept = (throw.speed, throw.d_hat) == (1.0, 1.0)
    return replace(throw, anew=True) if kept else throw
