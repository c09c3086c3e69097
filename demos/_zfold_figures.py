"""Figures of the Z-fold in tension; called on rank 0 with all results."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ufl_origami.analytic import REST_ANGLE, ZFold, ZFoldState, linear_beam_angle, ritz_angle
from ufl_origami.plotting import (
    Look,
    Series,
    convergence_chart,
    fold_angle_chart,
    profile_chart,
    still,
)

ETA_LABEL = r"crease stiffness  $\eta = K_r W / (E h^3)$"
FIGURES = (
    "profiles", "sheet", "fold_angle", "difference", "openings", "force", "convergence",
)  # fmt: skip


@dataclass(frozen=True)
class Study:
    """Results of the demo; the first of the variants is shown where one is.

    Attributes:
        folder: where the figures go.
        model: discretisation of the sheet.
        variants: pairs of bending form (None: the model has one only) and Poisson's ratio.
        etas: crease stiffnesses, ascending.
        openings: openings d1, ascending.
        profile_etas: those etas whose profiles are drawn.
        featured: eta and d1 of the picture; d1 also of the charts of all variants.
        elastica: exact fold of an eta.
        runs: objects of summary.json.
        refined: the same of other mesh sizes.
        shapes: variant and eta -> d1 -> profile of the front edge and shape of the sheet.
    """

    folder: Path
    model: str
    variants: list[tuple[str | None, float]]
    etas: list[float]
    openings: list[float]
    profile_etas: list[float]
    featured: tuple[float, float]
    elastica: Callable[[float], ZFold]
    runs: list[dict[str, Any]]
    refined: list[dict[str, Any]]
    shapes: dict
    _states: dict[tuple[float, float], ZFoldState] = field(default_factory=dict)

    def file(self, name: str) -> Path:
        """File of a figure."""
        return self.folder / f"{name}.png"

    def form(self, bending: str | None) -> str:
        """Name of a bending form in legends: the model's own where it has one only."""
        return bending or self.model

    @property
    def taut_opening(self) -> float:
        """Opening from which on there is no elastica."""
        return self.elastica(1.0).taut_opening

    def solved(self, eta: float, d1: float) -> ZFoldState:
        """The elastica of an eta pulled apart by d1."""
        if (eta, d1) not in self._states:
            self._states[eta, d1] = self.elastica(eta).solve(d1)
        return self._states[eta, d1]


def draw_all(study: Study) -> None:
    """All figures that the results allow; others of an earlier run are removed."""
    for name in FIGURES:
        study.file(name).unlink(missing_ok=True)
    draw_profiles(study)
    draw_sheet(study)
    positive = [eta for eta in study.etas if eta > 0]
    if len(positive) > 1:
        fine = np.geomspace(positive[0], positive[-1], 51)
        if study.featured[1] < study.taut_opening:
            draw_fold_angle(study, fine)
            draw_difference(study, fine)
        draw_openings(study, fine, "fold_angle_deg")
        draw_openings(study, fine, "force")
    if study.refined:
        draw_convergence(study)


def picked(rows, **values):
    """The runs with these values."""
    return [run for run in rows if all(run[key] == value for key, value in values.items())]


def marks(rows, key, label, *, colour, factor=1.0):
    """Marks of one result of the runs against eta."""
    y = [factor * run[key] for run in rows]
    return Series([run["eta"] for run in rows], y, label, "points", colour=colour)


def title(study, bending, nu):
    """Name of a variant in legends."""
    return rf"{study.form(bending)}, $\nu = {nu:g}$"


def profile_series(study, eta, d1, colour):
    """Elastica and front edge of the sheet from the crease, about six marks a panel."""
    bending, nu = study.variants[0]
    rest, now = study.shapes[bending, nu, eta][d1][0]
    crease = np.argmin(np.abs(rest[:, 0]))
    stride = max(1, len(now) // 12)
    some = np.r_[crease:-1:-stride][:0:-1], np.r_[crease + stride : len(now) : stride]
    x, _, z = (now[np.concatenate(some)] - now[crease]).T
    marked = [Series(x, z, rf"{study.form(bending)}, $d_1 = {d1:g}$", "points", colour=colour)]
    if d1 >= study.taut_opening:
        return [], marked
    panels = [part - part[-1] for part in study.solved(eta, d1).profile()]
    label = rf"elastica, $d_1 = {d1:g}$"
    return [Series(x, -z, label, colour=colour) for x, z in (part.T for part in panels)], marked


def draw_profiles(study):
    """Profiles of the sheet beside the elastica for each of three etas."""
    charts = {}
    for eta in study.profile_etas:
        pairs = [profile_series(study, eta, d1, i) for i, d1 in enumerate(study.openings)]
        lines = [one for part, _ in pairs for one in part]
        marked = [one for _, part in pairs for one in part]
        rest = study.shapes[*study.variants[0], eta][study.openings[0]][0][0]
        x, _, z = (rest - [0.0, 0.0, rest[:, 2].min()]).T
        at_rest = Series(x, z, "at rest", "dotted", colour=6)
        charts[rf"$\eta = {eta:g}$"] = [*lines, *marked, at_rest]
    profile_chart(charts, study.file("profiles"))


def draw_sheet(study):
    """The deformed sheet at middle stiffness."""
    bending, nu = study.variants[0]
    shape = study.shapes[bending, nu, study.featured[0]][study.featured[1]][1]
    text = rf"$\eta = {study.featured[0]:g}$, $d_1 = {study.featured[1]:g}$, $\nu = {nu:g}$"
    still(
        shape.points,
        shape.triangles,
        study.file("sheet"),
        crease_edges=shape.crease_edges,
        look=Look(title=text),
    )


def draw_fold_angle(study, fine):
    """The bending forms at one opening beside the elastica and the closed formulas."""
    rigid, rest = np.degrees([study.elastica(1.0).rigid_angle(study.featured[1]), REST_ANGLE])
    series = [
        Series(fine, exact_angles(study, fine), r"elastica, $\nu = 0$ (exact)", colour=6),
        Series(fine, ritz_angle(fine, rigid, rest), "Ritz line of the paper", "dashed", colour=3),
        Series(fine, linear_beam_angle(fine, rigid, rest), "linear beam", "dotted", colour=4),
    ]
    for i, (bending, nu) in reversed([*enumerate(study.variants)]):
        if nu == study.variants[0][1]:
            rows = picked(study.runs, bending=bending, nu=nu, d1=study.featured[1])
            series.append(marks(rows, "fold_angle_deg", title(study, bending, nu), colour=i))
    fold_angle_chart(series, study.file("fold_angle"), limits={"rigid": rigid, "rest": rest})


def exact_angles(study, values):
    """Fold angles of the elastica at the featured opening for several etas."""
    return np.array([study.solved(eta, study.featured[1]).included_angle_deg for eta in values])


def draw_difference(study, fine):
    """How far all variants are from the elastica, which bends without Poisson's effect.

    A wide plate is stiffer by 1 / (1 - nu^2); a finite panel lies between it and the elastica.
    """
    series = []
    for i, (bending, nu) in enumerate(study.variants):
        rows = picked(study.runs, bending=bending, nu=nu, d1=study.featured[1])
        found = {run["eta"]: run["fold_angle_deg"] for run in rows if run["eta"] > 0}
        values = np.array([*found])
        off = np.array([*found.values()]) - exact_angles(study, values)
        series.append(Series(values, off, title(study, bending, nu), "points", colour=i))
    for nu in sorted({nu for _, nu in study.variants if nu}):
        plate = exact_angles(study, fine * (1 - nu**2)) - exact_angles(study, fine)
        series.append(Series(fine, plate, rf"wide plate, $\nu = {nu:g}$", "dashed", colour=6))
    labels = (ETA_LABEL, "fold angle minus elastica (deg)")
    fold_angle_chart(series, study.file("difference"), limits={"elastica": 0.0}, labels=labels)


def draw_openings(study, fine, key):
    """Fold angle or pull of the first variant against eta for all openings, and the elastica's."""
    bending, nu = study.variants[0]
    series = []
    for i, d1 in enumerate(study.openings):
        if d1 < study.taut_opening:
            line = [exact_value(study.solved(eta, d1), key) for eta in fine]
            series.append(Series(fine, line, rf"elastica, $d_1 = {d1:g}$", colour=i))
        unit = 1.0 if key == "fold_angle_deg" else study.elastica(1.0).bending_stiffness[0]
        rows = picked(study.runs, bending=bending, nu=nu, d1=d1)
        label = rf"{study.form(bending)}, $d_1 = {d1:g}$"
        series.append(marks(rows, key, label, colour=i, factor=1 / unit))
    name, ordinate = {
        "fold_angle_deg": ("openings", "included fold angle (deg)"),
        "force": ("force", r"pull $P\,W^2 / EI$"),
    }[key]
    labels = (ETA_LABEL, rf"{ordinate}, $\nu = {nu:g}$")
    fold_angle_chart(series, study.file(name), labels=labels)


def exact_value(state, key):
    """Fold angle in degrees, or pull in units of EI / W^2."""
    if key == "fold_angle_deg":
        return state.included_angle_deg
    return state.force / state.fold.bending_stiffness[0]


def draw_convergence(study):
    """Distance of the pull from the elastica against the mesh size."""
    series = []
    for bending in dict.fromkeys(bending for bending, _ in study.variants):
        rows = picked(study.refined, bending=bending)
        error = [abs(run["force"] / run["elastica_force"] - 1) for run in rows]
        series.append(Series([run["size"] for run in rows], error, study.form(bending)))
    labels = ("size of the triangles / W", "relative distance of the pull from the elastica")
    convergence_chart(series, study.file("convergence"), labels=labels, orders=(2,))
