"""Charts in print quality: profiles, fold angles, histories, convergence.

Every function takes arrays and labels, writes one file (the suffix chooses png, pdf or svg) and
returns its path. Figures are made without pyplot and with local settings, so that nothing of
matplotlib's global state changes. Call on one rank only.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatterSciNotation
from numpy.typing import ArrayLike, NDArray

from ufl_origami.errors import InputError

# Okabe & Ito's colours for all kinds of colour vision, without the yellow (too pale on white).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_ETA = r"crease stiffness  $\eta = K_r W / (E h^3)$"
_MARKERS = "osD^vPX"
_DASHES = {"line": "-", "dashed": (0, (5, 2)), "dotted": (0, (1, 1.6)), "points": "none"}
_STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "lines.markersize": 4.5,
    "savefig.dpi": 220,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}


@dataclass(frozen=True)
class Series:
    """One curve of a chart.

    Attributes:
        x: abscissae (n,).
        y: ordinates (n,).
        label: text of the legend; series of one label share it.
        kind: how it is drawn.
        colour: index into `COLOURS`; by default the label's position among all labels.
    """

    x: ArrayLike
    y: ArrayLike
    label: str
    kind: Literal["line", "dashed", "dotted", "points"] = "line"
    colour: int | None = None

    def __post_init__(self) -> None:
        """Refuse arrays that do not pair up."""
        if np.ndim(self.x) != 1 or np.shape(self.x) != np.shape(self.y) or not np.size(self.x):
            raise InputError(
                f"series {self.label!r}: x {np.shape(self.x)} and y {np.shape(self.y)} must be "
                "arrays of one equal, positive length"
            )
        if self.kind not in _DASHES:
            raise InputError(f"series {self.label!r}: kind {self.kind!r} is none of {[*_DASHES]}")


def profile_chart(
    panels: Mapping[str, Sequence[Series]],
    file: str | Path,
    *,
    labels: tuple[str, str] = ("x / W", "z / W"),
    columns: int | None = None,
) -> Path:
    """Profiles at equal scale on both axes, one chart per title of `panels`, side by side.

    Args:
        panels: title of a chart -> its curves.
        file: file to write.
        labels: names of the axes.
        columns: charts in a row, default all.
    """
    every = [series for group in panels.values() for series in group]
    if not every:
        raise InputError(f"chart {Path(file).name}: nothing to draw")
    wide, high = (np.ptp(np.concatenate([np.asarray(getattr(s, a)) for s in every])) for a in "xy")
    across = min(columns or len(panels), len(panels))
    rows = ceil(len(panels) / across)
    width = max(2.5, 6.2 / across)
    height = min(max(0.9 * width * high / wide, 1.0), 6.0) if wide > 0 else 3.0
    wide, labels_of = width * across + 0.4, {series.label for series in every}
    legend = ceil(len(labels_of) / _legend_columns(labels_of, wide))
    with _figure(file, (wide, rows * (height + 0.5) + 0.3 + 0.2 * legend)) as (figure, path):
        grid = figure.subplots(rows, across, sharex=True, sharey=True, squeeze=False)
        charts: list[Any] = list(grid.flat)[: len(panels)]
        for axes, (title, group) in zip(charts, panels.items(), strict=True):
            _draw(axes, group, every)
            axes.set(title=title)
            axes.set_aspect("equal", adjustable="box")
        for axes in charts[-across:]:
            axes.set_xlabel(labels[0])
            axes.xaxis.set_tick_params(labelbottom=True)
        for axes in grid[:, 0]:
            axes.set_ylabel(labels[1])
        for axes in grid.ravel()[len(panels) :]:
            axes.set_visible(False)
        _legend(figure, charts)
    return path


def fold_angle_chart(
    series: Sequence[Series],
    file: str | Path,
    *,
    limits: Mapping[str, float] | None = None,
    labels: tuple[str, str] = (
        "crease stiffness  $\\eta = K_r W / (E h^3)$",
        "included fold angle (deg)",
    ),
) -> Path:
    """Fold angle against crease stiffness (logarithmic axis).

    Args:
        series: curves of angle (degrees) against eta.
        file: file to write.
        limits: name -> angle, drawn as thin horizontal lines named at the right margin.
        labels: names of the axes.
    """
    with _figure(file, (6.2, 4.0)) as (figure, path):
        axes = figure.subplots()
        _draw(axes, series, series)
        axes.set(xscale="log", xlabel=labels[0], ylabel=labels[1])
        for name, value in (limits or {}).items():
            axes.axhline(value, color="#777777", lw=0.8, zorder=0.5)
            axes.annotate(
                name,
                (1, value),
                xycoords=("axes fraction", "data"),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                color="#555555",
                fontsize=8,
            )
        _legend(figure, [axes])
    return path


def history_chart(
    history: str | Path,
    file: str | Path,
    *,
    x: str,
    y: Mapping[str, Sequence[str]],
    labels: Mapping[str, str] | None = None,
) -> Path:
    """Columns of a history (CSV, first line names the columns) against one of them.

    Args:
        history: CSV file.
        file: file to write.
        x: column of the abscissa.
        y: name of the ordinate (with unit) -> its columns; one chart each, one above the other.
        labels: column -> text of legend or abscissa; by default the column's name.
    """
    columns = _read_columns(history, [x, *(name for group in y.values() for name in group)])
    text = {name: (labels or {}).get(name, name) for name in columns}
    with _figure(file, (6.2, 0.8 + 1.9 * len(y))) as (figure, path):
        rows = figure.subplots(len(y), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (ordinate, group) in zip(rows, y.items(), strict=True):
            series = [Series(columns[x], columns[name], text[name]) for name in group]
            _draw(axes, series, series)
            axes.set_ylabel(ordinate)
            if len(group) > 1:
                axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        rows[-1].set_xlabel(text[x])
        figure.align_ylabels(rows)
    return path


def stacked_chart(
    rows: Mapping[str, Sequence[Series]],
    file: str | Path,
    *,
    abscissa: str,
    heights: Sequence[float] | None = None,
) -> Path:
    """Charts over one abscissa, one above the other; a label has one colour in all of them.

    Args:
        rows: name of the ordinate (with unit) -> its curves.
        file: file to write.
        abscissa: name of the abscissa, with unit.
        heights: relative heights of the rows, default equal.
    """
    every = [series for group in rows.values() for series in group]
    if not every:
        raise InputError(f"chart {Path(file).name}: nothing to draw")
    with _figure(file, (6.2, 1.2 + 1.9 * len(rows))) as (figure, path):
        charts = figure.subplots(len(rows), 1, sharex=True, squeeze=False, height_ratios=heights)
        for axes, (ordinate, group) in zip(charts[:, 0], rows.items(), strict=True):
            _draw(axes, group, every)
            axes.set_ylabel(ordinate)
        charts[-1, 0].set_xlabel(abscissa)
        figure.align_ylabels(charts[:, 0])
        _legend(figure, list(charts[:, 0]))
    return path


def convergence_chart(
    series: Sequence[Series],
    file: str | Path,
    *,
    labels: tuple[str, str] = ("element size", "relative error"),
    orders: Sequence[int] = (1, 2),
) -> Path:
    """Errors against element size, both logarithmic; the legend holds each fitted order.

    Args:
        series: curves of positive errors against positive sizes.
        file: file to write.
        labels: names of the axes.
        orders: slopes drawn for comparison, thin and grey.
    """
    fitted = [_with_order(s) for s in series]
    with _figure(file, (6.2, 4.0)) as (figure, path):
        axes = figure.subplots()
        _draw(axes, fitted, fitted, marks=True)
        axes.set(xscale="log", yscale="log", xlabel=labels[0], ylabel=labels[1])
        x = np.array(sorted({float(v) for s in series for v in np.asarray(s.x)}))[[0, -1]]
        top = max(float(np.asarray(s.y)[np.argmax(s.x)]) for s in series)
        for order in orders:
            axes.plot(x, 1.6 * top * (x / x[1]) ** order, color="#999999", lw=0.9, zorder=1)
            axes.annotate(
                f"order {order}",
                (x[0], 1.6 * top * (x[0] / x[1]) ** order),
                xytext=(-3, 0),
                textcoords="offset points",
                ha="right",
                va="center",
                color="#666666",
                fontsize=8,
            )
        axes.margins(x=0.16)
        axes.xaxis.set_minor_formatter(LogFormatterSciNotation(minor_thresholds=(2, 0.8)))
        axes.tick_params(axis="x", which="minor", labelsize=7.5)
        _legend(figure, [axes])
    return path


@contextmanager
def _figure(file: str | Path, size: tuple[float, float]) -> Iterator[tuple[Figure, Path]]:
    """Figure of a size in inches with local settings; saved when the block ends well."""
    path = Path(file)
    if path.suffix not in (".png", ".pdf", ".svg"):
        raise InputError(f"chart {path.name}: suffix must be .png, .pdf or .svg")
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        figure = Figure(figsize=size, layout="constrained")
        yield figure, path
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path)


def _draw(axes, group: Sequence[Series], every: Sequence[Series], *, marks: bool = False) -> None:
    """Draw a group of series; colours follow the labels among all series of the figure."""
    names = list(dict.fromkeys(series.label for series in every))
    for series in group:
        rank = names.index(series.label) if series.colour is None else series.colour
        points = series.kind == "points"
        axes.plot(
            series.x,
            series.y,
            label=series.label,
            color=COLOURS[rank % len(COLOURS)],
            linestyle=_DASHES[series.kind],
            marker=_MARKERS[rank % len(_MARKERS)] if points or marks else None,
            markerfacecolor="white" if points else None,
            zorder=3 if points else 2,
        )


def _legend(figure: Figure, axes: Sequence[Any]) -> None:
    """One legend under all charts, each label once."""
    entries: dict[str, Any] = {}
    for one in axes:
        for handle, label in zip(*one.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    columns = _legend_columns(entries, figure.get_figwidth())
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=columns)


def _legend_columns(labels: Iterable[str], width: float) -> int:
    """Columns of a legend that fit into a width in inches, at most four."""
    plain = [re.sub(r"\\[a-z]+|[${}\\]", "", label) for label in labels]
    longest = max(map(len, plain), default=0)
    return max(1, min(len(plain), 4, int(width / (0.65 + 0.065 * longest))))


def _with_order(series: Series) -> Series:
    x, y = np.asarray(series.x, float), np.asarray(series.y, float)
    if not (np.all(x > 0) and np.all(y > 0)):
        raise InputError(f"series {series.label!r}: sizes and errors must be positive")
    if x.size < 2:
        return series
    order = np.polyfit(np.log(x), np.log(y), 1)[0]
    return Series(x, y, f"{series.label} (order {order:.2f})", series.kind, series.colour)


def _read_columns(file: str | Path, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    table = np.genfromtxt(file, delimiter=",", names=True, deletechars="", ndmin=1)
    known = table.dtype.names or ()
    missing = [name for name in names if name not in known]
    if missing:
        raise InputError(f"{file}: no column {missing[0]!r} among {list(known)}")
    return {name: np.asarray(table[name], float) for name in names}
