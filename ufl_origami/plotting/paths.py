"""Charts of paths of equilibria: solid where stable, dashed where not, events marked."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from ufl_origami.errors import InputError
from ufl_origami.plotting.charts import COLOURS, Series, _figure, _legend_columns

_EVENTS = {"limit point": "v", "bifurcation": "D"}
_EVENT: dict[str, Any] = {
    "color": "#222222",
    "markerfacecolor": "white",
    "markersize": 5.0,
    "linestyle": "none",
}


@dataclass(frozen=True)
class PathCurve:
    """One quantity along a path of equilibria.

    Attributes:
        x: abscissae (n,), such as load factors; they may turn.
        y: ordinates (n,).
        unstable: number of unstable directions (n,) of each state.
        label: text of the legend; curves of one label share it.
        colour: index into `COLOURS`; by default the label's position among all labels.
        kind: "line" (solid where stable, else dashed) or "points" (full where stable, else hollow).
        events: (kind, x, y) of limit points and bifurcations.
    """

    x: ArrayLike
    y: ArrayLike
    unstable: ArrayLike
    label: str
    colour: int | None = None
    kind: Literal["line", "points"] = "line"
    events: Sequence[tuple[str, float, float]] = ()

    def __post_init__(self) -> None:
        """Refuse arrays that do not pair up and events of an unknown kind."""
        Series(self.x, self.y, self.label)
        if np.shape(self.unstable) != np.shape(self.x):
            raise InputError(
                f"path {self.label!r}: unstable {np.shape(self.unstable)} does not pair with x "
                f"{np.shape(self.x)}"
            )
        for kind, *_ in self.events:
            if kind not in _EVENTS:
                raise InputError(f"path {self.label!r}: {kind!r} is none of {[*_EVENTS]}")


Charts = Mapping[str, Mapping[str, Sequence[PathCurve]]]


def path_chart(charts: Charts, file: str | Path, *, abscissa: str) -> Path:
    """Charts of paths: a column for each title, a row for each quantity.

    Args:
        charts: title of a column -> name of the ordinate (with unit) -> its curves; all columns
            have the same ordinates.
        file: file to write; the suffix chooses png, pdf or svg.
        abscissa: name of the abscissa, with unit.

    Raises:
        InputError: nothing to draw, or columns with different ordinates.
    """
    ordinates = [*dict.fromkeys(name for column in charts.values() for name in column)]
    every = [curve for column in charts.values() for group in column.values() for curve in group]
    if not every:
        raise InputError(f"chart {Path(file).name}: nothing to draw")
    if any([*column] != ordinates for column in charts.values()):
        raise InputError(f"chart {Path(file).name}: columns have different ordinates")
    labels = [*dict.fromkeys(curve.label for curve in every)]
    size = (max(4.4, 3.3 * len(charts)), 1.0 + 2.2 * len(ordinates))
    with _figure(file, size) as (figure, path):
        grid = figure.subplots(
            len(ordinates), len(charts), sharex="col", sharey="row", squeeze=False
        )
        for column, (title, groups) in zip(grid.T, charts.items(), strict=True):
            column[0].set_title(title)
            for axes, group in zip(column, groups.values(), strict=True):
                for curve in group:
                    _draw_path(axes, curve, _colour(curve, labels))
            column[-1].set_xlabel(abscissa)
        for axes, name in zip(grid[:, 0], ordinates, strict=True):
            axes.set_ylabel(name)
        figure.align_ylabels(grid[:, 0])
        entries = _entries(every, labels)
        names = [str(entry.get_label()) for entry in entries]
        columns = _legend_columns(names, figure.get_figwidth())
        figure.legend(handles=entries, loc="outside lower center", ncols=columns)
    return path


def _colour(curve: PathCurve, labels: Sequence[str]) -> str:
    rank = labels.index(curve.label) if curve.colour is None else curve.colour
    return COLOURS[rank % len(COLOURS)]


def stable_parts(unstable: ArrayLike) -> Iterator[tuple[slice, bool]]:
    """Runs of states with one verdict, each up to the first state of the next one.

    Yields:
        States of a run as a slice, and whether they are stable.
    """
    stable = np.asarray(unstable) == 0
    bounds = [0, *(np.flatnonzero(np.diff(stable)) + 1), len(stable)]
    for start, end in pairwise(bounds):
        yield slice(int(start), int(end) + 1), bool(stable[start])


def _draw_path(axes, curve: PathCurve, colour: str) -> None:
    x, y = np.asarray(curve.x, float), np.asarray(curve.y, float)
    if curve.kind == "points":
        stable = np.asarray(curve.unstable) == 0
        for some, face in ((stable, colour), (~stable, "white")):
            axes.plot(
                x[some], y[some], "o", color=colour, markersize=3.4, markerfacecolor=face,
                markeredgewidth=0.8, zorder=3,
            )  # fmt: skip
    else:
        for part, stable in stable_parts(curve.unstable):
            style = "-" if stable else (0, (4, 2))
            axes.plot(x[part], y[part], color=colour, linestyle=style, zorder=2)
    for kind, *place in curve.events:
        axes.plot(*place, marker=_EVENTS[kind], zorder=4, **_EVENT)


def _entries(curves: Sequence[PathCurve], labels: Sequence[str]) -> list[Line2D]:
    """Legend: each label once, then what lines and marks mean, as far as they are used."""
    entries = []
    for label in labels:
        curve = next(curve for curve in curves if curve.label == label)
        style: dict[str, Any] = {"color": _colour(curve, labels)}
        if curve.kind == "points":
            style |= {"marker": "o", "linestyle": "none", "markersize": 3.4}
        entries.append(Line2D([], [], label=label, **style))
    if any(np.any(np.asarray(curve.unstable) != 0) for curve in curves):
        hollow = any(curve.kind == "points" for curve in curves)
        text = "unstable (hollow)" if hollow else "unstable"
        entries.append(Line2D([], [], color="#777777", linestyle=(0, (4, 2)), label=text))
    used = {kind for curve in curves for kind, *_ in curve.events}
    marks = [kind for kind in _EVENTS if kind in used]
    return entries + [Line2D([], [], marker=_EVENTS[k], label=k, **_EVENT) for k in marks]
