"""A sheet as plain arrays, made on rank 0 and then spread over the ranks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np

from ufl_origami.collective import on_rank0
from ufl_origami.sheet import SheetMesh, Surface, sheet_from_arrays


@dataclass(frozen=True)
class SheetArrays:
    """Arguments of :func:`ufl_origami.sheet.sheet_from_arrays`.

    Attributes:
        vertices: (n, 3) rest coordinates.
        triangles: (m, 3) vertices, oriented as the panel.
        panel: (m,) panel of each triangle.
        panel_names: names of the panels.
        edges: name -> (k, 2) vertex pairs.
        creases: the names in edges that are creases.
        points: name -> vertex.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    panel: np.ndarray
    panel_names: tuple[str, ...]
    edges: Mapping[str, np.ndarray] = field(default_factory=dict)
    creases: tuple[str, ...] = ()
    points: Mapping[str, int] = field(default_factory=dict)


def build_sheet(
    comm: MPI.Comm, make: Callable[[], SheetArrays], surface: Surface | None = None
) -> SheetMesh:
    """Call `make` on rank 0 and build the sheet; collective, errors are raised on all ranks."""
    made = on_rank0(comm, make)
    if made is None:
        return sheet_from_arrays(comm, None, None, surface=surface)
    return sheet_from_arrays(
        comm,
        made.vertices,
        made.triangles,
        panel=made.panel,
        panel_names=made.panel_names,
        edges=made.edges,
        creases=made.creases,
        points=made.points,
        surface=surface,
    )
