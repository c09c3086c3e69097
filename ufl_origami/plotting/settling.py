"""Chart of a quantity that settles to a predicted value."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ufl_origami.errors import InputError
from ufl_origami.plotting.charts import Series, _draw, _figure

_GREY, _INK = "#777777", "#555555"


def settling_chart(
    series: Sequence[Series],
    limit: float,
    file: str | Path,
    *,
    labels: tuple[str, str] = ("time (s)", "value"),
    limit_label: str = "predicted",
    tolerance: float | None = None,
) -> Path:
    """A quantity over time with its predicted value, and below its distance from it.

    Args:
        series: curves over time.
        limit: predicted value, not zero; a thin horizontal line.
        file: file to write.
        labels: names of time and quantity, with units.
        limit_label: name of the predicted value, at the right margin.
        tolerance: relative distance that another line marks in the lower chart.

    Raises:
        InputError: nothing to draw, or a limit of zero.
    """
    if not series or limit == 0:
        raise InputError(f"chart {Path(file).name}: needs curves and a limit other than zero")
    off = [_distances(one, limit) for one in series]
    with _figure(file, (6.2, 4.6)) as (figure, path):
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1.0))
        _draw(upper, series, series)
        _draw(lower, off, off)
        _line(upper, limit, limit_label)
        lower.set(yscale="log", xlabel=labels[0], ylabel="relative distance\nfrom prediction")
        if tolerance is not None:
            _line(lower, tolerance, f"{100 * tolerance:g} %")
        upper.set_ylabel(labels[1])
        if len(series) > 1:
            upper.legend()
        figure.align_ylabels()
    return path


def _distances(series: Series, limit: float) -> Series:
    """Distance of a curve from the limit, over it; where it is zero there is no point."""
    off = np.abs(np.asarray(series.y, float) / limit - 1)
    return Series(series.x, np.where(off > 0, off, np.nan), series.label, series.kind)


def _line(axes, value: float, name: str) -> None:
    """Thin horizontal line, named at the right margin."""
    axes.axhline(value, color=_GREY, lw=0.8, zorder=2.5)
    axes.annotate(
        name,
        (1, value),
        xycoords=("axes fraction", "data"),
        xytext=(4, 0),
        textcoords="offset points",
        va="center",
        color=_INK,
        fontsize=8,
    )
