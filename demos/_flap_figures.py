"""Figures of the magnetic flap; called on rank 0."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ufl_origami.gather import Shape
from ufl_origami.plotting import Look, Series, Sheet, film, stacked_chart

NAMES = {"ddg": "DDG", "fem": "FEM"}
MARKS = 30
"""Marks on a curve that is drawn by points."""


def draw_angles(
    file: Path,
    times: np.ndarray,
    angles: Mapping[str, np.ndarray],
    references: Mapping[str, np.ndarray],
) -> None:
    """Fold angles of the models with those of the rigid flap, and their distance from it.

    Args:
        file: file to write.
        times: (n,).
        angles: model -> fold angle (n,) in degrees.
        references: "in time" and "at rest" -> angle of the rigid flap (n,) in degrees.
    """
    stride = max(2, len(times) // MARKS)
    moving, resting = references["in time"], references["at rest"]
    jumps = np.abs(np.diff(resting, prepend=resting[0])) > 20  # a gap in the line, not a stroke
    upper = [
        Series(times, np.where(jumps, np.nan, resting), "rigid flap, at rest", "dotted", 6),
        Series(times, moving, "rigid flap, in time", colour=5),
    ]
    lower = []
    for i, (model, found) in enumerate(angles.items()):
        some = slice(i * stride // 2, None, stride)
        upper.append(Series(times[some], found[some], NAMES[model], "points", colour=i))
        lower.append(Series(times, found - moving, f"{NAMES[model]} - rigid", colour=i))
    if len(angles) == 2:
        first, second = angles.values()
        lower.append(Series(times, first - second, "DDG - FEM", colour=2))
    rows = {"fold angle (deg)": upper, "difference (deg)": lower}
    stacked_chart(rows, file, abscissa="time (s)", heights=(2, 1))


def draw_film(
    file: Path,
    shapes: Mapping[str, Sequence[Shape]],
    field: Sequence[float],
    *,
    width: float,
    size: tuple[int, int],
) -> None:
    """The flaps of the models behind each other, and an arrow in the field's direction.

    Args:
        file: file to write.
        shapes: model -> shapes of all frames.
        field: angle of the field (radians) in all frames.
        width: width of a panel.
        size: pixels, width and height.
    """
    places = ("in front", "behind") if len(shapes) > 1 else ("",)
    names = ", ".join(f"{NAMES[m]} {p}".strip() for m, p in zip(shapes, places, strict=True))
    look = Look(
        camera=(-32.0, 20.0),
        title=f"Magnetic flap ({names}); the arrow is the field",
        scale_label="mm",
        size=size,
    )
    frames = [
        _frame([row[i] for row in shapes.values()], angle, width) for i, angle in enumerate(field)
    ]
    film(frames, file, look=look, frames_per_second=12)


def _frame(shapes: Sequence[Shape], angle: float, width: float) -> Sheet:
    """Sheets behind each other along y, and an arrow above the held panels; in millimetres."""
    points, triangles, lines = [], [], []
    count, shift = 0, 0.0
    for shape in shapes:
        points.append(shape.points + np.array([0.0, shift, 0.0]))
        triangles.append(shape.triangles + count)
        lines.append(shape.crease_edges + count)
        count, shift = count + len(shape.points), shift + 1.5 * np.ptp(shape.points[:, 1])
    points.append(_arrow(angle, width))
    lines.append(count + np.array([(0, 1), (1, 2), (1, 3)]))
    return Sheet(1e3 * np.vstack(points), np.vstack(triangles), crease_edges=np.vstack(lines))


def _arrow(angle: float, width: float) -> np.ndarray:
    """Tail, tip and barbs (4, 3) of an arrow above the held panels."""
    shaft = np.array([(-0.4, 0.0), (0.4, 0.0), (0.27, 0.08), (0.27, -0.08)]) * width
    cosine, sine = np.cos(angle), np.sin(angle)
    x, z = np.array([[cosine, -sine], [sine, cosine]]) @ shaft.T
    return np.column_stack([x - 0.7 * width, np.full(4, 0.3 * width), z + 0.9 * width])
