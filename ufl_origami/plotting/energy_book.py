"""Chart of an energy book: where energy is, what came in and went out, what does not add up."""

from collections.abc import Mapping
from dataclasses import replace
from math import floor, log10
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ufl_origami.energy_book import LOSSES, balance_error, energy_changes
from ufl_origami.errors import InputError
from ufl_origami.history import History
from ufl_origami.plotting.charts import COLOURS, Series, _draw, _figure

# Each kind keeps its colour in all charts; black is left to the total.
_KINDS = (
    "kinetic", "gravity", "crease", "bending", "contact", "magnetic", "membrane", "load",
)  # fmt: skip
_WAYS = {
    "work": ("work", 6), "integrator": ("lost: integrator", 0), "damping": ("lost: damping", 2),
    "friction": ("lost: friction", 1),
}  # fmt: skip
_NAMES = "energy{},\npotential from start", "work and losses{}"
_NOTHING = 1e-4
"""Part of the largest energy below which a curve would lie on the axis."""


def energy_book_chart(
    history: History,
    file: str | Path,
    *,
    title: str = "",
    time_unit: str = "s",
    energy_unit: str = "J",
) -> Path:
    """Energy book of a motion: energies by kind, work and losses, imbalance, over time.

    Potential energies count from the start, and curves that would lie on the axis are left out.
    The imbalance is shown over the largest energy, so that its largest value is
    `energy_book.balance_error`.

    Args:
        history: history of a motion with its energies.
        file: file to write.
        title: text above the charts.
        time_unit: unit of time on the abscissa; empty for none.
        energy_unit: unit of energy; empty for none.

    Raises:
        InputError: no energy book, fewer than two rows, or no energy at all.
    """
    if len(history) < 2:
        raise InputError(f"chart {Path(file).name}: a history of {len(history)} rows has no steps")
    time, changes = history["time"], energy_changes(history)
    scale = max(float(np.abs(values).max()) for values in changes.values())
    if scale == 0:
        raise InputError(f"chart {Path(file).name}: there is no energy to draw")
    power, unit = _unit(scale, energy_unit)
    exchanged = {name: history[f"lost_{name}" if name in LOSSES else name] for name in _WAYS}
    charts = _energies(time, changes, scale), _exchanges(time, exchanged, scale)
    with _figure(file, (6.6, 5.6)) as (figure, path):
        rows = figure.subplots(3, 1, sharex=True, height_ratios=(2.0, 1.4, 1.0))
        for axes, series, name in zip(rows, charts, _NAMES, strict=False):
            scaled = [replace(one, y=np.asarray(one.y) / 10.0**power) for one in series]
            _draw(axes, scaled, scaled)
            axes.axhline(0.0, color="#777777", lw=0.7, zorder=0.5)
            axes.set_ylabel(name.format(unit))
            if series:
                axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        _draw_imbalance(rows[2], time, history["imbalance"] / scale, balance_error(history))
        rows[2].set_xlabel(f"time ({time_unit})" if time_unit else "time")
        rows[2].set_xlim(time[0], time[-1])
        if title:
            rows[0].set_title(title, loc="left")
        figure.align_ylabels(rows)
    return path


def _unit(scale: float, unit: str) -> tuple[int, str]:
    """Power of ten taken out of very small and very large energies, and the unit's text."""
    power = 0 if 0.1 <= scale < 1e4 else 3 * floor(log10(scale) / 3)
    text = f"$10^{{{power}}}$ {unit}".strip() if power else unit
    return power, f" ({text})" if text else ""


def _exchanges(time: NDArray, values: Mapping[str, NDArray], scale: float) -> list[Series]:
    """Curves of work and losses, those that there are."""
    there = [name for name in _WAYS if _counts(values[name], scale)]
    return [Series(time, values[name], _WAYS[name][0], colour=_WAYS[name][1]) for name in there]


def _counts(values: NDArray, scale: float) -> bool:
    return bool(np.abs(values).max() > _NOTHING * scale)


def _energies(time: NDArray, changes: Mapping[str, NDArray], scale: float) -> list[Series]:
    """Curves of the kinds that there are, and of their sum."""
    order = [kind for kind in _KINDS if kind in changes]
    order += [kind for kind in changes if kind not in _KINDS]
    series: list[Series] = []
    for kind in order:
        rank = _KINDS.index(kind) if kind in _KINDS else len(_KINDS) + len(series)
        again, colour = divmod(rank, len(COLOURS) - 1)
        if _counts(changes[kind], scale):
            dashes: Literal["line", "dashed"] = "dashed" if again else "line"
            series.append(Series(time, changes[kind], kind, dashes, colour))
    return [*series, Series(time, np.sum([*changes.values()], axis=0), "total", colour=6)]


def _draw_imbalance(axes, time: NDArray, imbalance: NDArray, worst: float) -> None:
    """What does not add up, over the largest energy; logarithmic, zeros left out."""
    size = np.where(imbalance == 0, np.nan, np.abs(imbalance))
    axes.plot(time, size, color=COLOURS[6], lw=1.0)
    axes.set_ylabel("imbalance over\nlargest energy")
    if worst == 0:
        axes.set(yticks=[])
        axes.annotate("none", (0.5, 0.5), xycoords="axes fraction", ha="center", va="center")
        return
    axes.set(yscale="log")
    axes.axhline(worst, color="#777777", lw=0.8, zorder=0.5)
    axes.annotate(
        f"largest {worst:.1e}",
        (1, worst),
        xycoords=("axes fraction", "data"),
        xytext=(8, 0),
        textcoords="offset points",
        va="center",
        color="#555555",
        fontsize=8,
    )
