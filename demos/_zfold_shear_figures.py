"""Figures of the Z-fold in shear; called on rank 0 with all branches."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from _zfold_shear_paths import Branch, Case, Row

from ufl_origami.plotting import (
    Look,
    PathCurve,
    Series,
    fold_angle_chart,
    path_chart,
    profile_chart,
    still,
)

COLOUR = {"symmetric": 0, "broken": 1, "arched": 2}
ETA_LABEL = r"crease stiffness  $\eta = K_r W / (E h^3)$"
Found = Mapping[Case, Sequence[Branch]]


def draw_all(folder: Path, found: Found, onsets: Mapping[tuple[str, float], float | None]) -> None:
    """All figures that the results allow."""
    draw_paths(folder / "paths.png", found)
    for case, branches in found.items():
        shown = [branch for branch in branches if branch.side >= 0 and branch.shapes]
        if shown:
            draw_profiles(folder / f"profiles_{tag(case)}.png", shown)
        for branch in shown:
            draw_still(folder / f"{branch.name}_{tag(case)}.png", branch)
    models = [*dict.fromkeys(model for model, _ in onsets)]
    series = [onset_series(onsets, model, colour) for colour, model in enumerate(models)]
    known = [one for one in series if one is not None]
    if known and any(np.size(one.x) > 1 for one in known):
        labels = (ETA_LABEL, r"$d_2$ at which the symmetric branch loses stability")
        fold_angle_chart(known, folder / "onset.png", labels=labels)


def tag(case: Case) -> str:
    """Part of a file's name."""
    return f"{case.model}_eta{case.eta:g}_nu{case.nu:g}"


def title(case: Case) -> str:
    """Title of a column: all models share it."""
    return rf"$\eta = {case.eta:g}$, $\nu = {case.nu:g}$"


def draw_paths(file: Path, found: Found) -> None:
    """Energy and difference in height against d2: the first model as lines, others as points."""
    first = next(iter(found)).model
    charts: dict[str, dict[str, list[PathCurve]]] = {}
    for case, branches in found.items():
        groups = charts.setdefault(title(case), {"energy": [], "$z_A - z_B$": []})
        for branch in branches:
            groups["energy"].append(curve(branch, lambda row: row["energy"], first))
            groups["$z_A - z_B$"].append(curve(branch, lambda row: row["z_a"] - row["z_b"], first))
    path_chart(charts, file, abscissa="shear $d_2$")


def curve(branch: Branch, value: Callable[[Row], float], first: str) -> PathCurve:
    """One branch of one model."""
    d2, unstable = branch.column("d2"), branch.column("unstable_directions")
    values = [value(row) for row in branch.rows]
    label, colour = f"{branch.name}, {branch.case.model}", COLOUR[branch.name]
    if branch.case.model != first:
        return PathCurve(d2, values, unstable, label, colour, "points")
    events = [(event["kind"], event["d2"], value(event)) for event in branch.events]
    return PathCurve(d2, values, unstable, label, colour, events=events)


def draw_profiles(file: Path, branches: Sequence[Branch]) -> None:
    """Front and back edge at the last stop, a chart for each branch."""
    panels = {}
    for branch in branches:
        stop, ((_, front), (_, back), _) = [*branch.shapes.items()][-1]
        panels[f"{branch.name}, $d_2 = {stop:g}$"] = [
            Series(front[:, 0], front[:, 2], "front edge", colour=0),
            Series(back[:, 0], back[:, 2], "back edge", "dashed", colour=1),
        ]
    profile_chart(panels, file)


def draw_still(file: Path, branch: Branch) -> None:
    """The sheet at the last stop."""
    stop, (_, _, shape) = [*branch.shapes.items()][-1]
    text = rf"{branch.name}, {title(branch.case)}, $d_2 = {stop:g}$"
    still(
        shape.points,
        shape.triangles,
        file,
        crease_edges=shape.crease_edges,
        look=Look(title=text, size=(900, 675)),
    )


def onset_series(onsets, model: str, colour: int) -> Series | None:
    """Onset of instability against positive crease stiffness for one model."""
    points = sorted((eta, d2) for (name, eta), d2 in onsets.items() if name == model and eta and d2)
    if not points:
        return None
    eta, d2 = zip(*points, strict=True)
    return Series(eta, d2, model, "line" if colour == 0 else "points", colour=colour)
