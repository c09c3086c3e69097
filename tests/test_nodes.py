"""Sums over nodes: shares of rest area, and the same by parts as whole in one triangle."""

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from contact_scenes import plate
from scenes import build

from ufl_origami.terms.form import NodalFormTerm
from ufl_origami.terms.nodes import covering, full_sum, node_areas, sparse_sum

pytestmark = pytest.mark.mpi

MODELS = ("ddg", "fem")


def some_nodes(functions):
    """All nodes with x below 60 % of the side."""
    return (functions.V.tabulate_dof_coordinates()[:, 0] < 0.06).astype(float)


def owned(functions, values):
    return values[: functions.V.dofmap.index_map.size_local]


@pytest.mark.parametrize("model", MODELS)
def test_shares_add_up_to_the_sheets_area(comm, model):
    functions = build(plate((7, 4), model=model)).functions
    areas = owned(functions, node_areas(functions))
    assert (areas > 0).all()
    assert comm.allreduce(areas.sum()) == pytest.approx(0.01, rel=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_one_triangle_a_node_gives_the_sum_of_all(comm, model):
    """Energy, forces and blocks of a nonlinear density, on a part of the nodes."""
    built = build(plate((7, 4), model=model))
    functions, state = built.functions, built.state
    nodes, x = some_nodes(functions), ufl.SpatialCoordinate(built.sheet.mesh) + functions.u
    density = (1.0 + x[0]) ** 3 + ufl.sin(5 * x[1]) * x[2] + x[2] ** 2
    found = []
    for total in (full_sum(functions, nodes), sparse_sum(functions, nodes)):
        term = NodalFormTerm(total.here, "own", functions, energy=total.of(density))
        energy = comm.allreduce(term.energies(state)[0])
        local = np.zeros(built.configuration.num_local)
        term.add_residual(state, local)
        force = built.x.duplicate()
        force.set(0.0)
        built.configuration.add_to_global(local, force)
        (stencil,), blocks = term.stencils(), [np.zeros((total.here.sum(), 3, 3))]
        term.tangent(state, blocks)
        stiffness = comm.allreduce(blocks[0].sum(axis=0))
        found.append((energy, force.array_r.copy(), stiffness, len(stencil)))
    (energy, force, stiffness, _), (other, others, stiffnesses, _) = found
    assert other == pytest.approx(energy, rel=1e-12)
    assert others == pytest.approx(force, rel=1e-10, abs=1e-12 * np.abs(force).max())
    assert stiffnesses == pytest.approx(stiffness, rel=1e-10, abs=1e-14)
    # each node once
    total = sparse_sum(functions, nodes)
    wanted = comm.allreduce(owned(functions, nodes).sum(), op=MPI.SUM)
    assert comm.allreduce(total.here.sum()) == wanted == comm.allreduce(len(total.cells))


@pytest.mark.parametrize(("model", "most"), [("ddg", 0.4), ("fem", 0.8)])
def test_few_triangles_serve_all_nodes(comm, model, most):
    functions = build(plate((20, 20), model=model)).functions
    total = sparse_sum(functions, np.ones(len(functions.dofs) // 3))
    count = comm.allreduce(len(np.unique(total.cells)))
    assert count < most * comm.allreduce(functions.sheet.num_owned_cells)


def test_covering_takes_the_cells_with_most_new_nodes_first():
    table = np.array([[0, 1, 2], [2, 3, 1], [3, 4, 5], [5, 6, 0]])
    nodes, cells, corners = covering(table, np.ones(8, dtype=bool))
    assert nodes.tolist() == list(range(7))
    assert cells.tolist() == [0, 0, 0, 2, 2, 2, 3]
    assert corners.tolist() == [0, 1, 2, 0, 1, 2, 1]
    assert len(covering(table, np.zeros(8, dtype=bool))[0]) == 0
