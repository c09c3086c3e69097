"""Work-precision charts: errors against cost, a grid of panels with one legend."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from ufl_origami.errors import InputError
from ufl_origami.plotting.charts import COLOURS, _figure

_MARKERS = "os^Dv"
_LINES = ("-", (0, (4, 2)), (0, (1, 1.5)))
_LEVEL = "#8a8a8a"


@dataclass(frozen=True)
class WorkCurve:
    """Errors of one method on one kind of mesh, or with one kind of steps.

    Attributes:
        cost: costs (n,), positive.
        error: errors (n,), positive.
        method: name in the legend, by colour.
        mesh: kind of mesh or steps in the legend, by marker and line.
    """

    cost: ArrayLike
    error: ArrayLike
    method: str
    mesh: str


@dataclass(frozen=True)
class WorkPanel:
    """One chart of the grid.

    Attributes:
        title: what is solved.
        ordinate: which error is shown.
        curves: what is drawn.
    """

    title: str
    ordinate: str
    curves: Sequence[WorkCurve]


def work_precision_chart(
    panels: Sequence[WorkPanel],
    file: str | Path,
    *,
    columns: int,
    abscissa: str,
    levels: Sequence[float] = (0.01, 0.001),
    least: float | None = None,
    refined: str = "mesh",
) -> Path:
    """Errors against cost, both logarithmic; equal axes in a row, equal abscissae everywhere.

    Args:
        panels: charts, row by row.
        file: file to write.
        columns: charts in a row.
        abscissa: name of the costs, with unit.
        levels: errors that thin lines mark.
        least: error at which the charts end; None: all are shown.
        refined: what the curves refine, in the legend.

    Raises:
        InputError: nothing to draw.
    """
    curves = [curve for panel in panels for curve in panel.curves]
    if not curves:
        raise InputError(f"chart {Path(file).name}: nothing to draw")
    methods = list(dict.fromkeys(curve.method for curve in curves))
    meshes = list(dict.fromkeys(curve.mesh for curve in curves))
    rows = -(-len(panels) // columns)
    with _figure(
        file, (0.4 + 2.75 * columns, 0.75 + 2.15 * rows + (0.2 if columns < 3 else 0.0))
    ) as (figure, path):
        grid = figure.subplots(rows, columns, sharex=True, sharey="row", squeeze=False)
        for axes, panel in zip(grid.flat, panels, strict=False):
            for curve in panel.curves:
                _draw_curve(axes, curve, methods.index(curve.method), meshes.index(curve.mesh))
            for level in levels:
                axes.axhline(level, color=_LEVEL, lw=0.8, zorder=0.8)
            axes.set(title=panel.title, xscale="log", yscale="log")
            if least is not None:
                axes.set_ylim(bottom=least)
        for axes in grid.flat[len(panels) :]:
            axes.set_axis_off()
        _name_axes(grid, panels, columns, abscissa)
        entries = [_entry(i, None, name) for i, name in enumerate(methods)]
        entries += [_entry(None, i, f"{name} {refined}") for i, name in enumerate(meshes)]
        figure.legend(
            handles=entries,
            loc="outside lower center",
            ncols=_legend_columns(columns),
            handlelength=2.6,
        )
    return path


def _legend_columns(columns: int) -> int:
    """Entries that fit side by side under a number of charts."""
    return {1: 2, 2: 3}.get(columns, 5)


def _draw_curve(axes, curve: WorkCurve, method: int, mesh: int) -> None:
    colour = COLOURS[method % len(COLOURS)]
    axes.plot(
        curve.cost,
        curve.error,
        color=colour,
        linestyle=_LINES[mesh % len(_LINES)],
        linewidth=1.3,
        marker=_MARKERS[mesh % len(_MARKERS)],
        markersize=4.2,
        markerfacecolor="white" if mesh else colour,
        zorder=3,
    )


def _name_axes(grid, panels: Sequence[WorkPanel], columns: int, abscissa: str) -> None:
    """Name the errors where they change along a row, the costs under the last chart of a column."""
    for index, panel in enumerate(panels):
        axes = grid.flat[index]
        if index % columns == 0 or panel.ordinate != panels[index - 1].ordinate:
            axes.set_ylabel(panel.ordinate)
        if index + columns >= len(panels):
            axes.set_xlabel(abscissa)
            axes.tick_params(labelbottom=True)


def _entry(method: int | None, mesh: int | None, label: str) -> Line2D:
    """Legend entry of a method (its colour) or of a kind of mesh (its marker and line)."""
    if mesh is None:
        return Line2D([], [], color=COLOURS[(method or 0) % len(COLOURS)], lw=2.4, label=label)
    return Line2D(
        [],
        [],
        color="#444444",
        linestyle=_LINES[mesh % len(_LINES)],
        marker=_MARKERS[mesh % len(_MARKERS)],
        markersize=4.2,
        markerfacecolor="white" if mesh else "#444444",
        linewidth=1.3,
        label=label,
    )
