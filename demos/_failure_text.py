"""What the failure map says in words and tables: failure_map.md and failure_map.csv."""

import csv
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from _failure_runs import VERDICTS, Outcome

Rows = Mapping[str, Any]


@dataclass(frozen=True)
class Study:
    """A declared grid and its outcomes; not every method needs to meet every case.

    Attributes:
        name: stem of its maps' files.
        title: its heading.
        explained: which solution is wrong, in a sentence.
        methods: names of the discretisations.
        solvers: names of the solvers, or of the ways to step.
        own: those of them that are the package's own.
        groups: title -> label -> setting.
        pairs: title -> label -> label -> setting.
        outcomes: (setting, method, solver) -> outcome.
        number, numbers: what a map's cell says of an outcome, and how the legend calls it.
        columns: in which the map of single difficulties is set.
    """

    name: str
    title: str
    explained: str
    methods: Sequence[str]
    solvers: Sequence[str]
    own: Sequence[str]
    groups: Mapping[str, Rows]
    pairs: Mapping[str, Mapping[str, Rows]]
    outcomes: Mapping[tuple[Any, str, str], Outcome]
    number: Callable[[Outcome], str]
    numbers: str
    columns: int = 1

    def picked(self, method: str, solver: str) -> list[Outcome]:
        """All outcomes of a method with a solver."""
        return [o for (_, m, s), o in self.outcomes.items() if (m, s) == (method, solver)]

    def singles(self) -> set:
        """Settings of one difficulty."""
        return {setting for rows in self.groups.values() for setting in rows.values()}


def flat_rows(studies: Iterable[Study]) -> list[dict[str, Any]]:
    """One row a case of all studies, with the same columns; None where a case lacks a value."""
    every = [o for study in studies for o in study.outcomes.values()]
    columns = dict.fromkeys(f.name for o in every for f in fields(o.setting))
    rows = [o.row() for o in every]
    columns |= dict.fromkeys(name for row in rows for name in row)
    return [{name: row.get(name) for name in columns} for row in rows]


def write_csv(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write failure_map.csv, one line a case."""
    file = folder / "failure_map.csv"
    with file.open("w", newline="", encoding="ascii") as stream:
        writer = csv.DictWriter(stream, [*rows[0]])
        writer.writeheader()
        writer.writerows(rows)
    return file


def write_text(folder: Path, studies: Iterable[Study]) -> str:
    """Write failure_map.md; its text."""
    text = "\n".join(_text(study) for study in studies)
    (folder / "failure_map.md").write_text(text, encoding="ascii")
    return text


def _text(study: Study) -> str:
    every = [*study.outcomes.values()]
    silent = [o for o in every if o.silent]
    count = Counter(o.verdict for o in every)
    total = ", ".join(f"{count[v]} {v}" for v in ("right", "failed", "wrong"))
    parts = [
        f"# {study.title}",
        f"{len(every)} cases: {total}, of which {len(silent)} silent. {study.explained} Silent: "
        "wrong, and no warning was given.",
        "## Counts",
        _counts(study),
        "## Wrong and silent",
        _list(silent),
        "## Wrong, with a warning",
        _wrong_by_warning(o for o in every if o.verdict == "wrong" and o.warned),
        f"## Failed with {' or '.join(study.own)}",
        _list(o for o in every if o.verdict == "failed" and o.solver in study.own),
        "## Warnings",
        _warnings(every),
    ]
    return "\n\n".join(parts) + "\n"


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
            if found:
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
        return f"at {outcome.reached:.3g} of the path: {outcome.reason}"
    return f"error {outcome.error:.1%}"


def _order(outcome: Outcome) -> tuple:
    """By problem, then by difficulty, large thicknesses first."""
    setting = outcome.setting
    names = [f.name for f in fields(setting)]
    return tuple(-setting.h if name == "h" else getattr(setting, name) for name in names)


def describe(setting: Any) -> str:
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
