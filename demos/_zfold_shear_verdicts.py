"""What the branches of the Z-fold in shear say: onsets, windows, crossings, and the text."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from _zfold_shear_paths import CLOSE, Branch, Case

from ufl_origami.plotting.paths import stable_parts

FINE = 1201
"""Places at which energies of two branches are compared."""


@dataclass(frozen=True)
class Verdict:
    """What one case shows.

    Attributes:
        case: the case.
        onset: d2 of the first bifurcation of the unperturbed branch; None where there is none.
        unstable: windows of d2 in which that branch is unstable.
        broken_from: least d2 with a stable broken state; None without any.
        snap: d2 of the first limit point of the broken branch on its way; None without any.
        lower_from: d2 beyond which the broken branch has the lower energy throughout.
        ends: d2 of the comparison at the end, energies and heights there by name of the branch.
        mirror: distance of the broken branch's edge profiles from mirror images, over W.
        point: the same from images under the point reflection at the centre.
    """

    case: Case
    onset: float | None
    unstable: list[tuple[float, float]]
    broken_from: float | None
    snap: float | None
    lower_from: float | None
    ends: dict[str, dict]
    mirror: float | None
    point: float | None


def find(branches: Sequence[Branch], name: str) -> Branch | None:
    """The first branch of a name."""
    return next((branch for branch in branches if branch.name == name), None)


def places(branch: Branch, kind: str) -> list[float]:
    """Shears of a branch's events of a kind."""
    return [event["d2"] for event in branch.events if event["kind"] == kind]


def judge(branches: Sequence[Branch]) -> Verdict:
    """The verdict on one case; profiles are those of rank 0, so call it there."""
    symmetric, broken = find(branches, "symmetric"), find(branches, "broken")
    assert symmetric is not None
    bifurcations = places(symmetric, "bifurcation")
    stable = broken.column("d2")[broken.column("unstable_directions") == 0] if broken else []
    limits = places(broken, "limit point") if broken else []
    shapes = distances(broken) if broken and broken.shapes else (None, None)
    return Verdict(
        case=symmetric.case,
        onset=bifurcations[0] if bifurcations else None,
        unstable=windows(symmetric),
        broken_from=float(min([*limits, *stable])) if len(stable) else None,
        snap=limits[0] if limits else None,
        lower_from=lower_from(symmetric, broken) if broken else None,
        ends={branch.name: branch.runs[-1] for branch in branches if branch.runs},
        mirror=shapes[0],
        point=shapes[1],
    )


def windows(branch: Branch) -> list[tuple[float, float]]:
    """Intervals of d2, in the order of the path, in which a branch is unstable."""
    d2, unstable = branch.column("d2"), branch.column("unstable_directions")
    found, start = [], d2[0] if unstable[0] else None
    for event in branch.events:
        if not event["before"] and event["after"]:
            start = event["d2"]
        elif event["before"] and not event["after"] and start is not None:
            found.append((float(start), event["d2"]))
            start = None
    return found if start is None else [*found, (float(start), float(d2[-1]))]


def least_energy(branch: Branch, d2: np.ndarray) -> np.ndarray:
    """Least energy of a branch's stable states at each d2; infinite where it has none."""
    energy, at = branch.column("energy"), branch.column("d2")
    least = np.full(len(d2), np.inf)
    for part, stable in stable_parts(branch.column("unstable_directions")):
        x, y = at[part], energy[part]
        if stable and len(x) > 1:
            order = np.argsort(x)
            inside = (d2 >= x.min() - CLOSE) & (d2 <= x.max() + CLOSE)
            values = np.interp(d2[inside], x[order], y[order])
            least[inside] = np.minimum(least[inside], values)
    return least


def lower_from(symmetric: Branch, broken: Branch) -> float | None:
    """Shear beyond which stable broken states have less energy than symmetric ones."""
    at, energy = symmetric.column("d2"), symmetric.column("energy")
    first = slice(int(np.argmax(np.append(np.diff(at) < 0, True))) + 1)  # up to its first turn
    at, energy = at[first], energy[first]
    d2 = np.linspace(at[0], at[-1], FINE)
    higher = least_energy(broken, d2) >= np.interp(d2, at, energy)
    if higher[-1]:
        return None
    return float(d2[np.flatnonzero(higher)[-1] + 1]) if higher.any() else float(d2[0])


def distances(broken: Branch) -> tuple[float, float]:
    """Distance (root of mean square) of the back edge from two images of the front edge.

    Both reflect about the middle of the outer edges: x alone, or x and z.
    """
    (_, front), (_, back), _ = [*broken.shapes.values()][-1]
    centre = 0.5 * (front[0, 0] + front[-1, 0])
    mirrored = front[::-1] * [-1.0, 1.0, 1.0] + [2.0 * centre, 0.0, 0.0]
    off = (mirrored - back)[:, [0, 2]]
    turned = (mirrored * [1.0, 1.0, -1.0] - back)[:, [0, 2]]
    return tuple(float(np.sqrt((part**2).sum(axis=1).mean())) for part in (off, turned))


def text(verdict: Verdict) -> str:
    """One case in words."""
    case = verdict.case
    shown = ", ".join(f"{low:.4f} to {high:.4f}" for low, high in verdict.unstable)
    said = [
        f"{case.model}, eta = {case.eta:g}, nu = {case.nu:g}: the symmetric branch is "
        + (f"unstable from d2 = {shown}, else stable" if shown else "stable throughout")
    ]
    if verdict.broken_from is None:
        return f"{said[0]}; no broken branch was met."
    said.append(f"the broken one has stable states from d2 = {verdict.broken_from:.4f}")
    if verdict.snap:
        said.append(f"and snaps at {verdict.snap:.4f} when it is followed from its bifurcation")
    if verdict.lower_from is not None:
        said.append(f"it has the lower energy from d2 = {verdict.lower_from:.4f}")
    for name, run in verdict.ends.items():
        gap = run["z_a"] - run["z_b"]
        said.append(f"{name} at {run['d2']:g}: energy {run['energy']:.4f}, z_a - z_b {gap:+.4f}")
    off = f"{verdict.point:.3f} W from point and {verdict.mirror:.3f} W from mirror symmetry"
    return "; ".join([*said, f"its edge profiles are {off}"]) + "."


def account(verdicts: Sequence[Verdict], onsets: dict) -> list[str]:
    """The paper's account of the two branches, judged by what was found."""
    stiff = [verdict for verdict in verdicts if verdict.case.eta > 0]
    free = [verdict for verdict in verdicts if verdict.case.eta == 0]
    said = []
    for verdict in stiff:
        if verdict.onset is None or verdict.lower_from is None:
            continue
        name = f"{verdict.case.model}, eta = {verdict.case.eta:g}"
        alone = min(verdict.onset, verdict.broken_from or verdict.onset)
        said += [
            f"{name}: there are two modes, and each is stable for some d2: confirmed.",
            f"{name}: they part at the very onset of d2: contradicted; up to d2 = {alone:.4f} the "
            "symmetric one is the only one met, and stable.",
            f"{name}: at first the symmetric one has the lower energy, then the broken one: "
            f"confirmed, with the change at d2 = {verdict.lower_from:.4f}.",
        ]
    for verdict in free:
        if verdict.lower_from is None:
            continue
        name = f"{verdict.case.model}, eta = 0"
        state = "contradicted" if not verdict.unstable else "confirmed beyond the onset"
        said += [
            f"{name}: only the broken one is stable: {state}; the panels may bulge both down "
            "(where they go by themselves), both up or one each way.",
            f"{name}: the symmetric one has the lower energy up to d2 = {verdict.lower_from:.4f}, "
            "the broken one beyond.",
        ]
    if len(onsets) > 1:
        places = [
            f"{'not met' if d2 is None else format(d2, '.4f')} at {eta:g} ({model})"
            for (model, eta), d2 in sorted(onsets.items())
        ]
        said.append(f"onset of the symmetric one's instability by eta: {', '.join(places)}.")
    return said
