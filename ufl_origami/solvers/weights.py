"""Mass-like weights of the unknowns: for diagonal shifts, eigenvectors and arc lengths."""

from petsc4py import PETSc

import numpy as np

from ufl_origami.configuration import MIDDLE, Configuration
from ufl_origami.problem import Problem


def shift_weights(problem: Problem) -> PETSc.Vec:
    """Mass-like weights: lumped area at nodes, area squared at angles (rest state).

    Prescribed unknowns weigh nothing: a shift of their unit diagonal would change their values.
    """
    vector = area_weights(problem.configuration)
    vector.array_w[problem.constraints.dofs] = 0.0
    return vector


def area_weights(configuration: Configuration, *, angles: bool = True) -> PETSc.Vec:
    """Lumped rest area at displacements, area squared (or nothing) at angles."""
    sheet = configuration.sheet
    n = sheet.num_owned_cells
    corners = sheet.rest[sheet.cells[:n]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normal, axis=1)
    local = np.zeros(configuration.num_local)
    for k in range(3):
        np.add.at(local, 3 * sheet.cells[:n].ravel() + k, np.repeat(area / 3, 3))
    for name in configuration.edge_unknowns:
        slot = configuration.slot(name)[sheet.cell_edges[:n]]
        used = slot >= 0
        per_edge = area / 3 if name in MIDDLE else angles * area**2
        weight = np.broadcast_to(per_edge[:, None], slot.shape)[used]
        np.add.at(local, 3 * configuration.nv + slot[used], weight)
    vector = configuration.create_vector()
    configuration.add_to_global(local, vector)
    return vector
