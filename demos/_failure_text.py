"""What the failure map says in words and tables: failure_map.md and failure_map.csv."""

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from _failure_cases import Setting
from _failure_runs import VERDICTS, Outcome

Rows = Mapping[str, Setting]


@dataclass(frozen=True)
class Study:
    """The declared grid and its outcomes.

    Attributes:
        folder: where files go.
        bound: error above which an equilibrium is wrong.
        methods: names of the discretisations.
        solvers: names of the solvers.
        groups: title -> label -> setting.
        pairs: title -> label -> label -> setting.
        outcomes: (setting, method, solver) -> outcome.
    """

    folder: Path
    bound: float
    methods: Sequence[str]
    solvers: Sequence[str]
    groups: Mapping[str, Rows]
    pairs: Mapping[str, Mapping[str, Rows]]
    outcomes: Mapping[tuple[Setting, str, str], Outcome]

    def picked(self, method: str, solver: str) -> list[Outcome]:
        """All outcomes of a method with a solver."""
        return [o for (_, m, s), o in self.outcomes.items() if (m, s) == (method, solver)]


def write_csv(study: Study) -> Path:
    """Write failure_map.csv, one line a case."""
    rows = [outcome.row() for outcome in study.outcomes.values()]
    file = study.folder / "failure_map.csv"
    with file.open("w", newline="", encoding="ascii") as stream:
        writer = csv.DictWriter(stream, [*rows[0]])
        writer.writeheader()
        writer.writerows(rows)
    return file


def write_text(study: Study) -> str:
    """Write failure_map.md; its text."""
    every = [*study.outcomes.values()]
    silent = [o for o in every if o.silent]
    count = Counter(o.verdict for o in every)
    total = ", ".join(f"{count[v]} {v}" for v in ("right", "failed", "wrong"))
    parts = [
        "# Where methods fail",
        f"{len(every)} cases: {total}, of which {len(silent)} silent. An equilibrium is wrong when "
        f"its error is above {study.bound:.0%} (tip of the cantilever; pull and fold angle of the "
        "z-fold; angle, crease and tip of a closed fold). Silent: wrong, and no warning was given.",
        "## Counts",
        _counts(study),
        "## Wrong and silent",
        _list(silent) if silent else "None.",
        "## Wrong, with a warning",
        _wrong_by_warning(o for o in every if o.verdict == "wrong" and o.warned),
        "## Failed with the package's own solver",
        _list(o for o in every if o.verdict == "failed" and o.solver in study.solvers[2:]),
        "## Warnings",
        _warnings(every),
    ]
    text = "\n\n".join(parts) + "\n"
    (study.folder / "failure_map.md").write_text(text, encoding="ascii")
    return text


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def _counts(study: Study) -> str:
    rows = []
    for method in study.methods:
        for solver in study.solvers:
            found = study.picked(method, solver)
            count = Counter(o.verdict for o in found)
            silent = sum(o.silent for o in found)
            rows.append([method, solver, *(count[v] for v in VERDICTS), silent])
    return table(["method", "solver", *VERDICTS, "wrong and silent"], rows)


def _list(outcomes: Iterable[Outcome]) -> str:
    """One line a case: what was solved, how, and how it ended."""
    rows = [
        [describe(o.setting), o.method, o.solver, o.iterations, _end(o)]
        for o in sorted(outcomes, key=_order)
    ]
    return table(["case", "method", "solver", "iterations", "end"], rows) if rows else "None."


def _end(outcome: Outcome) -> str:
    if outcome.error is None:
        return f"at load factor {outcome.reached:.3g}: {outcome.reason}"
    return f"error {outcome.error:.1%}"


def _order(outcome: Outcome) -> tuple:
    setting = outcome.setting
    return (setting.problem, setting.mesh, -setting.h, setting.eta, setting.angle, setting.steps)


def describe(setting: Setting) -> str:
    """A setting in words: the problem and what differs from its defaults."""
    other = [
        f"{f.name} {getattr(setting, f.name)}"
        for f in fields(setting)
        if f.name != "problem" and getattr(setting, f.name) != f.default
    ]
    return ", ".join([setting.problem, *other])


def _wrong_by_warning(outcomes: Iterable[Outcome]) -> str:
    count = Counter((o.method, "; ".join(o.warned)) for o in outcomes)
    rows = [[*key, number] for key, number in sorted(count.items())]
    return table(["method", "warnings", "cases"], rows) if rows else "None."


def _warnings(outcomes: Sequence[Outcome]) -> str:
    """How often each kind of warning was given, by verdict."""
    count = Counter((kind, o.verdict) for o in outcomes for kind in o.warned)
    kinds = sorted({kind for kind, _ in count})
    rows = [[kind, *(count[kind, v] for v in VERDICTS)] for kind in kinds]
    return table(["warning", *VERDICTS], rows) if rows else "None."
