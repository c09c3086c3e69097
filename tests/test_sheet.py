"""SheetMesh: the same mesh and the same names on any number of ranks, or a clear error."""

from mpi4py import MPI

import dolfinx
import numpy as np
import pytest
import ufl

from ufl_origami.errors import InputError, MeshError
from ufl_origami.partition import edge_table, merge_cells, pinched_vertices
from ufl_origami.sheet import sheet_from_arrays

pytestmark = pytest.mark.mpi


def grid(nx, ny):
    """Unit square of nx x ny one-diagonal quads, vertex i * (ny + 1) + j at (i / nx, j / ny)."""
    x, y = np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1), indexing="ij")
    corner = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).ravel()
    quad = corner[:, None] + np.array([0, ny + 1, ny + 2, 1])
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    return vertices, np.concatenate([quad[:, :3], quad[:, [0, 2, 3]]])


def star(panels, n, coincide=False):
    """Square panels round one crease of n edges along y (vertices 0..n), maybe coinciding."""
    vertices = [
        np.stack([0 * np.arange(n + 1), np.arange(n + 1) / n, 0 * np.arange(n + 1)], axis=1)
    ]
    triangles, panel = [], []
    flat, cells = grid(n, n)
    for p in range(panels):
        angle = 0.0 if coincide else 2 * np.pi * p / panels
        turned = np.stack([flat[:, 0] * np.cos(angle), flat[:, 1], flat[:, 0] * np.sin(angle)], 1)
        shift = p * n * (n + 1)
        triangles.append(np.where(cells > n, cells + shift, cells))
        panel.append(np.full(len(cells), p))
        vertices.append(turned[n + 1 :])
    crease = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    return np.concatenate(vertices), np.concatenate(triangles), np.concatenate(panel), crease


def touching_cones(n=6):
    """Two cones of n triangles that have only their tip, vertex 0, in common."""
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle), np.ones(n)], axis=1)
    vertices = np.concatenate([np.zeros((1, 3)), ring, ring * [1, 1, -1]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    upper = np.stack([0 * i, 1 + i, 1 + j], axis=1)
    return vertices, np.concatenate([upper, np.where(upper > 0, upper + n, 0)])


def scatter_at_random(seed):
    """Graph partitioner that deals the nodes at random: every cut that can happen happens."""

    def part(comm, nparts, dual, ghosting):
        owner = np.random.default_rng(seed).integers(0, nparts, dual.num_nodes)
        return dolfinx.graph.adjacencylist(owner.astype(np.int32))

    return part


def on_rank0(comm, *arrays):
    """Return the arrays on rank 0 and None elsewhere, as a caller may pass them."""
    return arrays if comm.rank == 0 else tuple(None for _ in arrays)


def assert_same_as_input(sheet, vertices, triangles, panel, edges, points):
    """The local pieces make up the input, and every owned cell sees all its neighbours."""
    comm, table = sheet.comm, edge_table(triangles)
    assert sheet.num_vertices_global == len(vertices)
    assert sheet.num_cells_global == len(triangles)
    assert sheet.mesh.topology.index_map(1).size_global == len(table.count)
    assert np.array_equal(sheet.input_vertex[sheet.cells], triangles[sheet.input_cell])
    assert np.array_equal(sheet.rest, vertices[sheet.input_vertex])
    assert np.array_equal(sheet.cell_panel, panel[sheet.input_cell])
    assert_partition_of(comm, sheet.input_cell[: sheet.num_owned_cells], len(triangles))
    assert_partition_of(comm, sheet.input_vertex[: sheet.num_owned_vertices], len(vertices))
    edge = table.find(sheet.input_vertex[sheet.edge_vertices()])
    assert_partition_of(comm, edge[: sheet.num_owned_edges], len(table.count))
    for name, pairs in edges.items():
        mine = np.sort(edge[sheet.edges[name]])
        assert np.array_equal(mine, np.intersect1d(edge, table.find(np.array(pairs))))
        assert np.all(np.diff(sheet.edges[name]) > 0)
    for name, vertex in points.items():
        local = sheet.points[name]
        assert (local == -1) == (vertex not in sheet.input_vertex)
        assert local == -1 or sheet.input_vertex[local] == vertex
    assert_halo(sheet, table, edge)


def assert_partition_of(comm, owned, count):
    """Each of 0..count-1 is owned once."""
    total = np.zeros(count, dtype=np.int64)
    np.add.at(total, owned, 1)
    assert np.array_equal(comm.allreduce(total), np.ones(count))


def assert_halo(sheet, table, edge):
    """Facets of owned cells and owned facets have all their triangles here, in canonical order."""
    links = sheet.edge_cells()
    whole = np.union1d(sheet.cell_edges[: sheet.num_owned_cells], np.arange(sheet.num_owned_edges))
    for facet in whole:
        cells = links.links(int(facet))
        assert len(cells) == table.count[edge[facet]]
        assert (
            len(cells) <= 2
            or np.all(cells < sheet.num_owned_cells)
            or np.all(cells >= sheet.num_owned_cells)
        )
        key = [(sheet.cell_panel[c], sheet.input_cell[c]) for c in cells]
        assert key == sorted(key)
        a, b = sheet.edge_vertices()[facet]
        first = list(sheet.cells[cells[0]])
        assert first[(first.index(a) + 1) % 3] == b


@pytest.mark.parametrize("seed", [None, 0, 1])
@pytest.mark.parametrize("n", [1, 2, 9])
def test_square_is_the_input_on_any_number_of_ranks(comm, n, seed):
    vertices, triangles = grid(n, n)
    edges = {"x0": np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)}
    points = {"origin": 0, "far": len(vertices) - 1}
    part = None if seed is None else scatter_at_random(seed)
    x, cells, tags, named = on_rank0(comm, vertices, triangles, edges, points)
    sheet = sheet_from_arrays(comm, x, cells, edges=tags, points=named, partitioner=part)
    table = edge_table(triangles)
    edges["boundary"] = table.vertices[table.count == 1]
    assert set(sheet.edges) == set(edges)
    assert len(edges["boundary"]) == 4 * n
    panel = np.zeros(len(triangles), dtype=int)
    assert_same_as_input(sheet, vertices, triangles, panel, edges, points)


@pytest.mark.parametrize("seed", [None, 0, 1, 2])
@pytest.mark.parametrize("panels", [2, 3, 5])
@pytest.mark.parametrize("coincide", [False, True])
def test_crease_of_many_panels_sees_all_its_triangles(comm, panels, coincide, seed):
    vertices, triangles, panel, crease = star(panels, 4, coincide)
    if panels == 2 and coincide:
        panel = panel * 0 + np.repeat([0, 1], len(panel) // 2)
    edges = {"hinge": crease}
    part = None if seed is None else scatter_at_random(seed)
    sheet = sheet_from_arrays(
        comm,
        vertices,
        triangles,
        panel=panel,
        panel_names=[f"p{i}" for i in range(panels)],
        edges=edges,
        creases=["hinge"],
        points={"end": 4},
        partitioner=part,
    )
    assert sheet.creases == ("hinge",)
    assert_same_as_input(sheet, vertices, triangles, panel, edges, {"end": 4})
    owned = sum(np.count_nonzero(sheet.panel_cells(f"p{i}") >= 0) for i in range(panels))
    assert owned == len(sheet.cells)


@pytest.mark.parametrize("seed", range(4))
def test_parts_that_touch_at_a_vertex_number_it_once(comm, seed):
    vertices, triangles = touching_cones()
    sheet = sheet_from_arrays(comm, vertices, triangles, partitioner=scatter_at_random(seed))
    table = edge_table(triangles)
    assert list(pinched_vertices(table)) == [0]
    assert merge_cells(table)[0] == 1
    assert_same_as_input(sheet, vertices, triangles, np.zeros(12, dtype=int), {}, {})


def test_orientation_and_area_survive_the_split(comm):
    vertices, triangles = grid(7, 5)
    flipped = triangles[:, [1, 0, 2]]
    for cells, sign in ((triangles, 1.0), (flipped, -1.0)):
        sheet = sheet_from_arrays(comm, vertices, cells)
        normal = ufl.CellNormal(sheet.mesh)[2] * ufl.dx
        total = dolfinx.fem.assemble_scalar(dolfinx.fem.form(normal))
        assert comm.allreduce(total) == pytest.approx(sign, abs=1e-13)
        corners = sheet.rest[sheet.cells]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.all(sign * cross[:, 2] > 0)


def test_vertices_are_the_dofs_of_the_space(comm):
    sheet = sheet_from_arrays(comm, *grid(6, 6))
    dofs = sheet.V.tabulate_dof_coordinates()
    assert np.allclose(dofs[: len(sheet.rest)], sheet.rest, atol=1e-15)


def test_boundary_name_of_the_user_is_kept(comm):
    sheet = sheet_from_arrays(comm, *grid(2, 2), edges={"boundary": [(0, 1)]})
    seen = comm.allreduce(np.count_nonzero(sheet.edges["boundary"] < sheet.num_owned_edges))
    assert seen == 1


def test_unknown_names_come_with_close_ones(comm):
    sheet = sheet_from_arrays(comm, *grid(2, 2), edges={"left": [(0, 1)]}, points={"tip": 8})
    for call in (sheet.panel_cells, sheet.edge_facets, sheet.point_vertex):
        with pytest.raises(InputError, match=r"no .* is named 'lfet'; did you mean '"):
            call("lfet")
    with pytest.raises(InputError, match="did you mean 'left'"):
        sheet.edge_facets("lefd")


FLAT, QUADS = grid(2, 2)


def changed(array, index, value):
    copy = array.copy()
    copy[index] = value
    return copy


BAD = {
    "coordinates": (changed(FLAT, 3, np.nan), QUADS, {}, r"vertex 3 has coordinates"),
    "shape": (FLAT[:, :2], QUADS, {}, r"shape \(n, 3\)"),
    "no triangle": (FLAT, QUADS[:0], {}, r"m > 0"),
    "range": (FLAT, changed(QUADS, (1, 2), 9), {}, r"triangle 1 .* outside"),
    "unused": (np.vstack([FLAT, [[9, 9, 9]]]), QUADS, {}, r"1 vertices are in no triangle.* 9"),
    "repeated vertex": (FLAT, changed(QUADS, (0, 1), 0), {}, "triangle 0 .* degenerate"),
    "slit": (changed(FLAT, 4, FLAT[0] + 1e-12), QUADS, {}, "degenerate"),
    "against": (FLAT, changed(QUADS, 0, QUADS[0][::-1]), {}, "oriented against each other"),
    "inverted": (changed(FLAT, 4, [1.6, 1.7, 0]), QUADS, {}, "fold over"),
    "no edge": (FLAT, QUADS, {"edges": {"e": [(0, 8)]}}, r"'e': \(0, 8\) is no edge"),
    "no such vertex": (FLAT, QUADS, {"edges": {"e": [(0, 80)]}}, r"\(0, 80\) is no edge"),
    "open crease": (FLAT, QUADS, {"edges": {"e": [(0, 1)]}, "creases": ["e"]}, "'e' is open"),
    "no crease": (FLAT, QUADS, {"creases": ["fold"]}, "'fold' is no named edge set"),
    "point": (FLAT, QUADS, {"points": {"tip": 9}}, "'tip': vertex 9 is outside"),
    "panel shape": (FLAT, QUADS, {"panel": [0, 1]}, r"panel must have the shape \(8,\)"),
    "panel range": (FLAT, QUADS, {"panel": [2] * 8, "panel_names": ["a"]}, "with 1 panel names"),
    "names": (FLAT, QUADS, {"panel_names": ["a", "a"]}, "not unique"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_on_all_ranks(comm, case):
    vertices, triangles, options, message = BAD[case]
    with pytest.raises(MeshError, match=message):
        sheet_from_arrays(comm, *on_rank0(comm, vertices, triangles), **options)


def test_undeclared_crease_of_three_panels_is_an_error(comm):
    vertices, triangles, panel, crease = star(3, 2)
    with pytest.raises(MeshError, match=r"has 3 triangles but is not declared a crease"):
        sheet_from_arrays(comm, vertices, triangles, panel=panel, edges={"hinge": crease})


def test_failing_partitioner_raises_on_all_ranks(comm):
    def fail(*args):
        raise ZeroDivisionError("no cut")

    if comm.size == 1:
        sheet_from_arrays(comm, *grid(2, 2), partitioner=fail)
        return
    with pytest.raises((ZeroDivisionError, RuntimeError), match="no cut"):
        sheet_from_arrays(comm, *grid(2, 2), partitioner=fail)


def test_more_ranks_than_cells(comm):
    sheet = sheet_from_arrays(comm, FLAT[[0, 1, 3]], np.array([[0, 2, 1]]))
    assert sheet.num_cells_global == 1
    assert comm.allreduce(sheet.num_owned_cells) == 1
    assert comm.allreduce(sheet.num_owned_cells > 0, MPI.SUM) == 1
    assert set(sheet.edges) == {"boundary"}
