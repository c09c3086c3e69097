"""Branches of the Z-fold in shear: the scene, how each branch is reached, what is kept of it."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from _zfold_shear_mesh import half_turn_mesh

from ufl_origami.branches import restore, stability, switch_branch
from ufl_origami.discretise import build
from ufl_origami.errors import BranchWarning, SolveError, StabilityWarning
from ufl_origami.gather import gather_profile, gather_sheet
from ufl_origami.material import Material
from ufl_origami.paths import PathResult, follow_path
from ufl_origami.run import solve_static
from ufl_origami.scene import Scene
from ufl_origami.solvers.arc import ArcSettings, Event

W, E, H = 1.0, 1e7, 0.01  # width of a panel and length of the crease; Young's modulus; thickness
UNIT = E * H**3 / W**3  # of pushes: force per area
PUSH, NUDGE = 0.1, 0.02  # loads per area over the unit: into a family, and off a branch
OPENED = 1.0  # load factor up to which the edge moves by d1, beyond it by d2
GAP = 1e-4  # paths by arc length keep off the bend of the motion at d2 = 0 by so much
SMALL = 0.004  # shear at which pushes of families are let go
MEASURES = ("d2", "energy", "z_a", "z_b", "force_x", "force_y", "unstable_directions")
CLOSE = 1e-9  # round-off of d2

Row = dict[str, Any]


class Push:
    """Dead load along z on both panels, over UNIT; set between the stages of a run."""

    def __init__(self) -> None:
        self.left = self.right = 0.0

    def on(self, panel: str):
        """The load of a panel as a scene takes it."""
        return lambda _: np.array([0.0, 0.0, getattr(self, panel) * UNIT])


@dataclass(frozen=True)
class Case:
    """What is the same on all branches.

    Attributes:
        model: discretisation.
        eta: crease stiffness K_r W / (E h^3).
        nu: Poisson's ratio.
        size: length of the triangles' sides over W.
        stops: values of d2 that are reported, ascending.
        comm: communicator.
    """

    model: str
    eta: float
    nu: float
    size: float
    stops: tuple[float, ...]
    comm: Any = field(repr=False, compare=False)

    @property
    def values(self) -> Row:
        """What summary.json says of the case."""
        return {"model": self.model, "eta": self.eta, "nu": self.nu, "h": H, "size": self.size}


@dataclass
class Branch:
    """One branch as it was followed.

    Attributes:
        case: the case.
        name: "symmetric" or "broken"; "arched" for the second symmetric one.
        side: 1 or -1 for the two mirror images of a broken branch, 0 for symmetric ones.
        rows: MEASURES at every step.
        runs: the same at the stops.
        events: limit points and bifurcations: kind, MEASURES but for forces.
        bifurcations: those with their states.
        shapes: d2 of a stop -> profiles of front and back edge and the sheet, on rank 0.
        ended: why the branch ends before the last stop, or an empty string.
    """

    case: Case
    name: str
    side: int = 0
    rows: list[Row] = field(default_factory=list)
    runs: list[Row] = field(default_factory=list)
    events: list[Row] = field(default_factory=list)
    bifurcations: list[Event] = field(default_factory=list)
    shapes: dict[float, tuple] = field(default_factory=dict)
    ended: str = ""

    def column(self, key: str) -> np.ndarray:
        """One of MEASURES along the branch."""
        return np.array([row[key] for row in self.rows])


def build_scene(case: Case, push: Push | None = None) -> Scene:
    """The Z-fold: load factors up to OPENED are the opening d1, what is beyond is the shear d2.

    The sheared fold has one symmetry, the half-turn about z, and so has the mesh.
    """
    sheet = half_turn_mesh(W, W, case.size * W, case.comm)
    scene = Scene(sheet, Material(E, case.nu, H), model=case.model)
    scene.crease("crease", case.eta * E * H**3 / W)
    scene.fix("left_edge")
    scene.move("right_edge", x=lambda t: min(t, OPENED), y=lambda t: max(t - OPENED, 0.0), z=0.0)
    if push:
        for panel in ("left", "right"):
            scene.area_load(panel, push.on(panel))
    return scene


def measure(model, unstable: int | None = None) -> Row:
    """MEASURES of the current state."""
    force = model.reaction("right_edge")
    return {
        "d2": float(model.problem.time - OPENED),
        "energy": sum(model.energies().values()),
        "z_a": float(model.position("A")[2]),
        "z_b": float(model.position("B")[2]),
        "force_x": float(force[0]),
        "force_y": float(force[1]),
        "unstable_directions": stability(model) if unstable is None else unstable,
    }


def opened(case: Case):
    """The model after the opening, just beyond d2 = 0, without any perturbation."""
    return solve_static(build_scene(case), [0.5 * OPENED, OPENED, OPENED + GAP]).model


def pushed(case: Case, left: float, right: float, *, until: float):
    """The model after pushes (over UNIT) that are let go at a shear."""
    push = Push()
    push.left, push.right = left, right
    model = build(build_scene(case, push))
    with warnings.catch_warnings():  # letting go is a jump
        warnings.simplefilter("ignore", BranchWarning)
        warnings.simplefilter("ignore", StabilityWarning)
        solve_static(model, [0.5 * OPENED, OPENED, OPENED + until])
        if left or right:
            push.left = push.right = 0.0
            solve_static(model, [OPENED + until + GAP])
    return model


def follow(model, branch: Branch, towards=1.0, first: float = 0.005) -> Branch:
    """Follow a branch through the stops, from one to the next."""
    arc = ArcSettings(first=first, largest=0.05, load=0.02, steps=300)
    start = model.problem.time - OPENED
    for stop in [stop for stop in branch.case.stops if stop > start + CLOSE]:
        try:
            path = advance(model, branch, stop, towards, arc)
        except SolveError as error:
            branch.ended = f"ends: {error}"
            break
        if abs(path.end.load - OPENED - stop) > CLOSE:
            branch.ended = f"does not reach d2 = {stop:g}: {path.reason}"
            break
        keep(model, branch, stop)
        towards = path.end.tangent
    return branch


def advance(model, branch: Branch, stop: float, towards, arc: ArcSettings) -> PathResult:
    """Follow a branch to a stop, or back to the beginning of the shear, with all that is met."""
    rows = [branch.rows[-1]]

    def on_accept(step, model):
        rows.append(measure(model, step.negative_pivots))

    ends = [OPENED + stop, OPENED + 0.5 * GAP]
    try:
        path = follow_path(model, ends, towards=towards, arc=arc, on_accept=on_accept)
    finally:
        branch.rows += rows[1:]
    branch.events += [placed(event, path.history["arc_length"], rows) for event in path.events]
    branch.bifurcations += path.bifurcations
    return path


def placed(event: Event, arcs: np.ndarray, rows: Sequence[Row]) -> Row:
    """An event with what is measured there, between the states beside it."""
    keys = ("energy", "z_a", "z_b")
    values = {key: float(np.interp(event.arc, arcs, [row[key] for row in rows])) for key in keys}
    kept = {"kind": event.kind, "d2": event.load - OPENED}
    return kept | values | {"before": event.before, "after": event.after}


def keep(model, branch: Branch, stop: float) -> None:
    """Report the state at a stop."""
    row = {**branch.rows[-1], "d2": stop}
    branch.runs.append({**branch.case.values, "branch": branch.name, "side": branch.side, **row})
    profiles = gather_profile(model, "front"), gather_profile(model, "back")
    branch.shapes[stop] = *profiles, gather_sheet(model)


def with_stiffness(case: Case, sides: Iterable[int]) -> list[Branch]:
    """The symmetric branch and those that leave it at its first bifurcation."""
    model = opened(case)
    symmetric = Branch(case, "symmetric", rows=[measure(model)])
    branches = [follow(model, symmetric)]
    if symmetric.bifurcations:
        event = symmetric.bifurcations[0]
        for side in sides:
            broken = Branch(case, "broken", side)
            restore(model, event)
            broken.rows.append(measure(model, event.before))
            way = switch_branch(model, event, side=side)
            broken.rows.append(measure(model))
            branches.append(follow(model, broken, way))
    return branches


FAMILIES = {(1, 1): ("arched", 0), (1, -1): ("broken", 1), (-1, 1): ("broken", -1)}
"""Pushes of both panels -> name and side of the family that they lead to without stiffness."""


def without_stiffness(case: Case, sides: Iterable[int]) -> list[Branch]:
    """The unperturbed branch, and the families into which pushes lead the flat panels."""
    model = opened(case)
    symmetric = Branch(case, "symmetric", rows=[measure(model)])
    branches = [follow(model, symmetric, first=2e-4)]
    for (left, right), (name, side) in FAMILIES.items():
        if side and side not in sides:
            continue
        model = pushed(case, PUSH * left, PUSH * right, until=SMALL)
        branches.append(follow(model, Branch(case, name, side, rows=[measure(model)])))
    return branches


def onset(case: Case, stride: float = 0.02) -> float | None:
    """Shear at which the unperturbed branch becomes unstable; None up to the last stop."""
    model, towards = opened(case), 1.0
    arc = ArcSettings(first=0.005, largest=0.05, load=0.02)
    ends: Sequence[float] = np.arange(stride, case.stops[-1] + 0.5 * stride, stride)
    for end in ends:
        path = follow_path(model, [OPENED + end], towards=towards, arc=arc)
        if path.bifurcations:
            return float(path.bifurcations[0].load - OPENED)
        towards = path.end.tangent
    return None


def selection(case: Case, pushes: Iterable[tuple[int, int]], places: Iterable[float]) -> list[Row]:
    """Where a fold rests that was pushed until some shear and then let go."""
    rows = []
    for until in places:
        for left, right in pushes:
            found = measure(pushed(case, NUDGE * left, NUDGE * right, until=until))
            difference = found["z_a"] - found["z_b"]
            rows.append(
                {
                    **case.values,
                    "push": f"{left:+d} {right:+d}",
                    "until": until,
                    "difference": difference,
                    "energy": found["energy"],
                    "unstable_directions": found["unstable_directions"],
                }
            )
    return rows
