"""Film and charts of the drop; called on rank 0 with all results."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ufl_origami.gather import Shape
from ufl_origami.history import History
from ufl_origami.plotting import (
    Look,
    Series,
    Sheet,
    energy_book_chart,
    film,
    history_chart,
    settling_chart,
)

SPACING = 0.05  # of the lines across the incline, in the film
MARGIN = 0.02  # of the incline around the sheet's way


def draw_film(frames: Sequence[Shape], directions: np.ndarray, file: Path, look: Look) -> Path:
    """The sheet and the incline.

    Args:
        frames: shapes of the sheet.
        directions: rows (3, 3): down the incline, across it, its normal.
        file: file to write.
        look: camera and size of the pictures.
    """
    bodies = [*look.obstacles, incline(frames, directions)]
    sheets = [Sheet(f.points, f.triangles, crease_edges=f.crease_edges) for f in frames]
    return film(sheets, file, look=Look(**vars(look) | {"obstacles": bodies}))


def incline(frames: Sequence[Shape], directions: np.ndarray) -> Sheet:
    """The part of a plane through the origin that lies below all frames, with lines across it."""
    way = np.concatenate([frame.points for frame in frames]) @ directions[:2].T
    (top, back), (foot, front) = way.min(axis=0) - MARGIN, way.max(axis=0) + MARGIN
    places = np.arange(np.ceil(top / SPACING), np.floor(foot / SPACING) + 1) * SPACING
    along = np.repeat([top, foot, *places], 2)
    across = np.tile([back, front], len(places) + 2)
    points = np.column_stack([along, across]) @ directions[:2]
    lines = np.arange(4, len(points)).reshape(-1, 2)
    return Sheet(points, [[0, 2, 3], [0, 3, 1]], crease_edges=lines)


def draw_charts(history: History, folder: Path, predicted: float, tolerance: float) -> list[Path]:
    """Speed with its prediction, heights and steps, energy book."""
    rows = {
        "height of the centre\nover the incline (m)": ["height"],
        "fold angle (deg)": ["fold_virtual_crease"],
        "time step (s)": ["step_size"],
        "Newton iterations\nof the step": ["newton_iterations"],
    }
    return [
        settling_chart(
            [Series(history["time"], history["speed"], "centre of mass")],
            predicted,
            folder / "speed.png",
            labels=("time (s)", "speed down the incline\nof the centre of mass (m/s)"),
            limit_label="predicted\ncreep",
            tolerance=tolerance,
        ),
        history_chart(
            folder / "history.csv",
            folder / "motion.png",
            x="time",
            y=rows,
            labels={"time": "time (s)"},
        ),
        energy_book_chart(history, folder / "energy_book.png"),
    ]
