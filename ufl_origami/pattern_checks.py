"""Checks of a crease pattern's topology and fold angles.

Functions take plain arrays and raise `PatternError`, which names the vertex, edge or face and the
value. Order matters: functions further down rely on what those above have established.
"""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from ufl_origami.errors import PatternError
from ufl_origami.pattern_topology import (
    Corners,
    Floats,
    Incidence,
    Ints,
    pair_index,
)

ASSIGNMENTS = {
    "B": "boundary",
    "M": "mountain",
    "V": "valley",
    "F": "flat",
    "U": "unassigned",
    "C": "cut",
    "J": "join",
}
#: Angles of the file and of the geometry may differ by this much (degrees): coordinates in
#: files are often rounded to a few digits.
ANGLE_TOLERANCE = 0.1


def fail_at(bad: npt.ArrayLike, describe: Callable[[int], str]) -> None:
    """Raise PatternError about the first True entry of `bad`, telling how many more there are."""
    where = np.flatnonzero(bad)
    if len(where):
        more = f" (and {len(where) - 1} more like it)" if len(where) > 1 else ""
        raise PatternError(describe(int(where[0])) + more)


def edge_label(edge: int, edges: Ints, assignment: Sequence[str] | None = None) -> str:
    """Name an edge by number, end vertices and assignment."""
    kind = f", {assignment[edge]}" if assignment is not None else ""
    return f"edge {edge} (vertices {edges[edge, 0]}-{edges[edge, 1]}{kind})"


def find_edges(pairs: Sequence[tuple[int, int]], edges: Ints) -> Ints:
    """Return the index of the edge of each vertex pair; PatternError where there is none."""
    found = pair_index(np.array(pairs, dtype=np.int64).reshape(-1, 2), edges)
    fail_at(found < 0, lambda k: f"no edge joins the vertices {tuple(pairs[k])}")
    return found


def check_coordinates(points: Floats) -> None:
    """Coordinates must be finite."""
    fail_at(
        ~np.isfinite(points).all(axis=1),
        lambda v: f"vertex {v} has coordinates {points[v].tolist()}: they must be finite",
    )


def check_edges(edges: Ints, num_vertices: int) -> None:
    """End vertices must exist and differ, and no edge may be listed twice."""
    fail_at(
        ((edges < 0) | (edges >= num_vertices)).any(axis=1),
        lambda e: (
            f"edge {e} has vertices {edges[e].tolist()}, but vertices go from 0 to "
            f"{num_vertices - 1}"
        ),
    )
    fail_at(
        edges[:, 0] == edges[:, 1],
        lambda e: f"edge {e} joins vertex {edges[e, 0]} to itself",
    )
    _, first, inverse = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_inverse=True
    )
    original = first[inverse.reshape(-1)]
    fail_at(
        original != np.arange(len(edges)),
        lambda e: f"edge {e} joins the same vertices {edges[e].tolist()} as edge {original[e]}",
    )


def check_assignments(assignment: Sequence[str], edges: Ints) -> None:
    """Assignments must be letters that FOLD 1.1 or 1.2 defines."""
    known = ", ".join(f"{key} ({word})" for key, word in ASSIGNMENTS.items())
    fail_at(
        [letter not in ASSIGNMENTS for letter in assignment],
        lambda e: (
            f"{edge_label(e, edges)} has the unknown assignment {assignment[e]!r}; "
            f"FOLD knows {known}"
        ),
    )


def check_loops(corners: Corners, num_vertices: int) -> None:
    """Face loops must have at least three different vertices, all of which exist."""
    if corners.num_faces == 0:
        raise PatternError("the pattern has no faces")
    loops = np.split(corners.vertex, corners.start[1:-1])
    sizes = np.diff(corners.start)
    fail_at(
        sizes < 3,
        lambda f: (
            f"face {f} is not closed: its loop {loops[f].tolist()} has {sizes[f]} vertices, "
            f"at least 3 are needed"
        ),
    )
    outside = (corners.vertex < 0) | (corners.vertex >= num_vertices)
    fail_at(
        outside,
        lambda c: (
            f"face {corners.face[c]} has vertex {corners.vertex[c]}, but vertices go from 0 to "
            f"{num_vertices - 1}"
        ),
    )
    order = np.lexsort((corners.vertex, corners.face))
    face, vertex = corners.face[order], corners.vertex[order]
    repeated = (face[1:] == face[:-1]) & (vertex[1:] == vertex[:-1])
    fail_at(
        repeated,
        lambda c: (
            f"face {face[c]} passes vertex {vertex[c]} more than once: a loop names each of its "
            f"vertices once and is closed without repeating the first (a slit needs its own "
            f"vertices)"
        ),
    )


def check_closed(corners: Corners, edges: Ints) -> None:
    """Each two neighbours in a face's loop must be joined by an edge."""
    pairs = corners.pairs
    fail_at(
        pair_index(pairs, edges) < 0,
        lambda c: (
            f"face {corners.face[c]} is not closed: no edge joins its neighbouring vertices "
            f"{pairs[c, 0]} and {pairs[c, 1]}"
        ),
    )


def check_unused(corners: Corners, num_vertices: int) -> None:
    """Each vertex must belong to a face."""
    used = np.zeros(num_vertices, dtype=bool)
    used[corners.vertex] = True
    fail_at(~used, lambda v: f"vertex {v} belongs to no face")


def check_sides(incidence: Incidence, edges: Ints, assignment: Sequence[str]) -> None:
    """Boundaries have one face, creases at least two, mountains and valleys exactly two."""
    count = incidence.num_faces
    letters = np.array(assignment, dtype="<U1")
    single = np.isin(letters, ["B", "C"])
    fail_at(
        single & (count != 1),
        lambda e: (
            f"{edge_label(e, edges, assignment)} is a {ASSIGNMENTS[assignment[e]]} edge with "
            f"{count[e]} faces: it must have one"
            + (" (give the two sides of a cut their own vertices)" if letters[e] == "C" else "")
        ),
    )
    fail_at(
        ~single & (count < 2),
        lambda e: (
            f"dangling crease: {edge_label(e, edges, assignment)} has {count[e]} "
            f"face{'s' * int(count[e] != 1)}, at least two must meet at it"
        ),
    )
    fail_at(
        ~single & (count > 2) & (letters != "U"),
        lambda e: (
            f"{edge_label(e, edges, assignment)} has {count[e]} faces: with more than two faces "
            f"an edge must be U, as no single fold angle belongs to it"
        ),
    )


def check_orientation(corners: Corners, incidence: Incidence, edges: Ints) -> None:
    """Two faces that meet at an edge must run through it in opposite directions."""
    where, first, second = incidence.two_sided()
    fail_at(
        incidence.forward[first] == incidence.forward[second],
        lambda k: (
            f"inconsistent orientation: faces {corners.face[first[k]]} and "
            f"{corners.face[second[k]]} run the same way along {edge_label(where[k], edges)}; "
            f"reverse the loop of one of them"
        ),
    )


def check_fold_angles(angle: Floats, edges: Ints, assignment: Sequence[str]) -> None:
    """Fold angles (degrees, NaN unknown) must lie in [-180, 180] and agree with the assignment."""
    fail_at(
        (np.abs(angle) > 180.0) | np.isinf(angle),
        lambda e: (
            f"{edge_label(e, edges, assignment)} has fold angle {angle[e]:g} deg, outside "
            f"[-180, 180]"
        ),
    )
    _check_sign(angle, edges, assignment, 0.0, "fold angle")
    letters = np.array(assignment, dtype="<U1")
    fail_at(
        np.isin(letters, list("FBCJ")) & (np.abs(angle) > 0.0),
        lambda e: (
            f"{edge_label(e, edges, assignment)} has fold angle {angle[e]:g} deg: a "
            f"{ASSIGNMENTS[assignment[e]]} edge has none"
        ),
    )


def _check_sign(
    angle: Floats, edges: Ints, assignment: Sequence[str], slack: float, what: str
) -> None:
    """Angles (degrees) of valleys must not be negative, of mountains not positive."""
    letters = np.array(assignment, dtype="<U1")
    wrong = ((letters == "M") & (angle > slack)) | ((letters == "V") & (angle < -slack))
    fail_at(
        wrong,
        lambda e: (
            f"{edge_label(e, edges, assignment)} has {what} {angle[e]:g} deg, which contradicts "
            f"its assignment: valleys are positive, mountains negative"
        ),
    )


def check_crease_flags(
    flagged: npt.NDArray[np.bool_], edges: Ints, assignment: Sequence[str]
) -> None:
    """The property `crease` makes creases of F edges; boundaries and joins cannot have it."""
    fail_at(
        flagged & np.isin(np.array(assignment, dtype="<U1"), list("BCJ")),
        lambda e: (
            f"{edge_label(e, edges, assignment)} has the property crease, but a "
            f"{ASSIGNMENTS[assignment[e]]} edge is no crease"
        ),
    )


def check_several_faces(angle: Floats, incidence: Incidence, edges: Ints) -> None:
    """An edge of more than two faces has no fold angle (null or 0 in the file)."""
    fail_at(
        (incidence.num_faces > 2) & (np.abs(angle) > 0.0),
        lambda e: (
            f"{edge_label(e, edges)} has fold angle {angle[e]:g} deg, but "
            f"{incidence.num_faces[e]} faces: a single fold angle has no meaning there"
        ),
    )


def check_folded(given: Floats, geometric: Floats, edges: Ints, assignment: Sequence[str]) -> None:
    """In a folded form, assignments and given fold angles must describe the geometry.

    A fold angle of 0 on an unassigned edge means "unknown" in FOLD and is not compared.

    Args:
        given: (m,) fold angles of the file, degrees, NaN unknown.
        geometric: (m,) fold angles of the geometry, degrees, NaN where an edge has not two faces.
        edges: (m, 2) edges.
        assignment: (m,) assignments.
    """
    folded_flat = np.abs(np.abs(geometric) - 180.0) <= ANGLE_TOLERANCE
    signed = np.where(folded_flat, np.nan, geometric)
    _check_sign(signed, edges, assignment, ANGLE_TOLERANCE, "a geometric fold angle of")
    letters = np.array(assignment, dtype="<U1")
    flat = np.isin(letters, ["F", "J"])
    fail_at(
        flat & (np.abs(geometric) > ANGLE_TOLERANCE),
        lambda e: (
            f"{edge_label(e, edges, assignment)} is a {ASSIGNMENTS[assignment[e]]} edge, but its "
            f"faces are turned by {geometric[e]:g} deg"
        ),
    )
    gap = np.abs((given - geometric + 180.0) % 360.0 - 180.0)
    fail_at(
        (gap > ANGLE_TOLERANCE) & ~((letters == "U") & (given == 0.0)),
        lambda e: (
            f"{edge_label(e, edges, assignment)} has edges_foldAngle {given[e]:g} deg, but its "
            f"faces are turned by {geometric[e]:g} deg in this folded form; correct one of them, "
            f"or leave the angle out (null) to take the geometry's"
        ),
    )


def check_unfolded(geometric: Floats, edges: Ints) -> None:
    """A crease pattern (unfolded) must be flat."""
    fail_at(
        np.abs(geometric) > ANGLE_TOLERANCE,
        lambda e: (
            f"frame_classes says creasePattern (unfolded), but the faces at "
            f"{edge_label(e, edges)} are turned by {geometric[e]:g} deg: call it foldedForm or "
            f"make it flat"
        ),
    )


def check_known_angles(angle: Floats, edges: Ints, assignment: Sequence[str]) -> None:
    """Each mountain and valley of an unfolded pattern needs a fold angle as its rest angle."""
    fail_at(
        np.isin(np.array(assignment, dtype="<U1"), ["M", "V"]) & np.isnan(angle),
        lambda e: (
            f"{edge_label(e, edges, assignment)} has no fold angle: the pattern is unfolded, so "
            f"its rest angle must come from edges_foldAngle"
        ),
    )
