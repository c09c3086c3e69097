"""Maps of the failure study; called on rank 0."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
from _failure_runs import Outcome
from _failure_text import Rows, Study
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

FILL = {"right": "#cfe8dc", "wrong": "#d55e00", "failed": "#565656"}
INK = {"right": "#1a3d2e", "wrong": "white", "failed": "white"}
SILENT = "#b0006d"  # fill of what is wrong without a warning
MARK = "#ffd000"  # corner of what was warned of
STYLE = {"font.family": "DejaVu Sans", "font.size": 8, "savefig.dpi": 150}
CELL = (0.36, 0.205)  # inches
GAP = 0.35  # between methods, over a cell's width
LEGEND = (
    (FILL["right"], False, "right"),
    (FILL["wrong"], True, "wrong, warned"),
    (SILENT, False, "wrong, silent"),
    (FILL["failed"], False, "failed"),
    ("#eeeeee", True, "warning"),
)
LETTER, LEGEND_SIZE = 0.059, 7.5  # inches, points
LABELS, HEAD, FOOT, TITLE = 1.15, 0.6, 0.75, 1.35  # inches; the last one in cells


def draw_all(folder: Path, studies: Iterable[Study]) -> list[Path]:
    """A map of single difficulties a study and one a pair; those of an earlier run are replaced."""
    for file in folder.glob("failure_map*.png"):
        file.unlink()
    files = []
    for study in studies:
        files.append(draw_difficulties(folder, study))
        files += [draw_pair(folder, study, i) for i in range(len(study.pairs))]
    return files


@contextmanager
def _map(file: Path, cells: tuple[float, float], labels: float, numbers: str) -> Iterator:
    """Axes counted in cells, y down from 0, with room for labels, head and legend."""
    size = [labels + cells[0] * CELL[0] + 0.1, HEAD + FOOT + cells[1] * CELL[1]]
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=size)
        box = (labels / size[0], FOOT / size[1], cells[0] * CELL[0] / size[0])
        axes = figure.add_axes((*box, cells[1] * CELL[1] / size[1]))
        axes.set(xlim=(0, cells[0]), ylim=(cells[1], 0))
        axes.axis("off")
        yield figure, axes
        _legend(figure, size, numbers)
        figure.savefig(file)


def draw_difficulties(folder: Path, study: Study) -> Path:
    """One row a setting, one column a method and solver."""
    columns = _split(study.groups, study.columns)
    wide = len(study.methods) * (len(study.solvers) + GAP) - GAP
    stride = wide + LABELS / CELL[0] + GAP
    high = max(sum(len(rows) + TITLE for rows in groups.values()) for groups in columns)
    file = folder / f"{study.name}.png"
    with _map(file, (stride * (len(columns) - 1) + wide, high), LABELS, study.numbers) as (_, axes):
        for i, groups in enumerate(columns):
            _column(axes, i * stride, study, groups)
    return file


def _split(groups: Mapping[str, Rows], number: int) -> list[dict[str, Rows]]:
    """The groups in their order, in columns about equally high."""
    total, high = sum(len(rows) + TITLE for rows in groups.values()), 0.0
    columns: list[dict[str, Rows]] = [{} for _ in range(number)]
    for title, rows in groups.items():
        middle = high + 0.5 * (len(rows) + TITLE)
        columns[min(int(number * middle / total), number - 1)][title] = rows
        high += len(rows) + TITLE
    return columns


def _column(axes, left: float, study: Study, groups: Mapping[str, Rows]) -> None:
    """Groups of rows one under the other, from x = left on."""
    per = len(study.solvers)
    places = [left + m * (per + GAP) for m in range(len(study.methods))]
    for x, method in zip(places, study.methods, strict=True):
        _text(axes, x + 0.5 * per, -1.5, method, weight="bold", size=9)
        for k, solver in enumerate(study.solvers):
            _text(axes, x + k + 0.5, -0.45, solver, size=6.5)
    y = 0.0
    for title, rows in groups.items():
        _text(axes, left - LABELS / CELL[0] + 0.1, y + 0.75, title, ha="left", weight="bold")
        y += TITLE
        for label, setting in rows.items():
            _text(axes, left - 0.15, y + 0.5, label, ha="right")
            for x, method in zip(places, study.methods, strict=True):
                found = [study.outcomes.get((setting, method, s)) for s in study.solvers]
                _row(axes, (x, y), found, study)
            y += 1


def draw_pair(folder: Path, study: Study, index: int) -> Path:
    """One small map for each method (down) and solver (across)."""
    title, pair = [*study.pairs.items()][index]
    rows: list[tuple[str, Rows]] = [*pair.items()]
    across, down = len(rows[0][1]), len(rows)
    step, stride = across + 0.6, down + 1.7
    cells = (step * len(study.solvers) - 0.6, stride * len(study.methods) - 1.7 + 1.2)
    file = folder / f"{study.name}_pair{index + 1}.png"
    with _map(file, cells, LABELS + 0.35, study.numbers) as (_, axes):
        _text(axes, 0.0, -1.9, title, ha="left", weight="bold", size=9)
        for k, solver in enumerate(study.solvers):
            _text(axes, k * step + 0.5 * across, -0.6, solver, weight="bold")
        for m, method in enumerate(study.methods):
            y = m * stride
            _text(axes, -(LABELS + 0.2) / CELL[0], y + 0.5 * down, method, rotation=90,
                  weight="bold", size=9)  # fmt: skip
            for r, (label, columns) in enumerate(rows):
                _text(axes, -0.15, y + r + 0.5, label, ha="right")
                for k, solver in enumerate(study.solvers):
                    found = [study.outcomes.get((one, method, solver)) for one in columns.values()]
                    _row(axes, (k * step, y + r), found, study)
            for k in range(len(study.solvers)):
                for c, label in enumerate(rows[0][1]):
                    _text(axes, k * step + c + 0.5, y + down + 0.45, label, size=6.5)
    return file


def _row(
    axes, corner: tuple[float, float], outcomes: Sequence[Outcome | None], study: Study
) -> None:
    """Cells of some outcomes, none where there is none."""
    for k, outcome in enumerate(outcomes):
        if outcome is None:
            continue
        place = corner[0] + k, corner[1]
        fill = SILENT if outcome.silent else FILL[outcome.verdict]
        _cell(axes, place, fill, bool(outcome.warned))
        text = study.number(outcome)
        _text(axes, place[0] + 0.5, place[1] + 0.54, text, color=INK[outcome.verdict], size=7)


def _cell(axes, corner: tuple[float, float], fill: str, warned: bool, size=(1.0, 1.0)) -> None:
    (x, y), (w, h) = corner, size
    axes.add_patch(Rectangle((x, y), w, h, facecolor=fill, edgecolor="white", lw=0.8))
    if warned:
        places = [(0.74, 0.04), (0.98, 0.04), (0.98, 0.46)]
        edge = [(x + a * w, y + b * h) for a, b in places]
        axes.add_patch(Polygon(edge, facecolor=MARK, edgecolor="#333333", lw=0.4))


def _text(axes, x: float, y: float, text: str, *, ha: str = "center", **look) -> None:
    axes.text(x, y, text, ha=ha, va="center", clip_on=False, **look)


def _legend(figure: Figure, size: Sequence[float], numbers: str) -> None:
    """Meaning of fills, mark and numbers under the map."""
    axes = figure.add_axes((0, 0, 1, FOOT / size[1]))
    axes.set(xlim=(0, size[0]), ylim=(FOOT, 0))
    axes.axis("off")
    x, y = 0.1, 0.12
    for fill, warned, text in (*LEGEND, ("", False, f"numbers: {numbers}")):
        wide = (CELL[0] + 0.06 if fill else 0.0) + LETTER * len(text)
        if x + wide > size[0]:
            x, y = 0.1, y + 1.4 * CELL[1]
        if fill:
            _cell(axes, (x, y), fill, warned, CELL)
        shift = CELL[0] + 0.06 if fill else 0.0
        _text(axes, x + shift, y + 0.5 * CELL[1], text, ha="left", size=LEGEND_SIZE)
        x += wide + 0.2
