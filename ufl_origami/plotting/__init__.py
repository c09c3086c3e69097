"""Charts (matplotlib) and pictures of sheets (pyvista): plain arrays in, files out."""

from ufl_origami.plotting.charts import (
    Series,
    convergence_chart,
    fold_angle_chart,
    history_chart,
    profile_chart,
    stacked_chart,
)
from ufl_origami.plotting.display import DisplayError, virtual_display
from ufl_origami.plotting.energy_book import energy_book_chart
from ufl_origami.plotting.paths import PathCurve, path_chart
from ufl_origami.plotting.settling import settling_chart
from ufl_origami.plotting.stills import Look, Sheet, film, still

__all__ = [
    "DisplayError",
    "Look",
    "PathCurve",
    "Series",
    "Sheet",
    "convergence_chart",
    "energy_book_chart",
    "film",
    "fold_angle_chart",
    "history_chart",
    "path_chart",
    "profile_chart",
    "settling_chart",
    "stacked_chart",
    "still",
    "virtual_display",
]
