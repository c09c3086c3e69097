"""Meshes of patterns and of benchmark shapes: exact areas, matching creases, complete names."""

import math

from mpi4py import MPI

import gmsh
import numpy as np
import pytest

from ufl_origami import mesh_shapes
from ufl_origami.errors import MeshError
from ufl_origami.gallery.z_fold import z_fold
from ufl_origami.gmsh_fill import fill_polygon
from ufl_origami.mesh_checks import altitude_ratios, triangle_normals
from ufl_origami.meshing import MeshOptions, mesh_pattern, pattern_arrays
from ufl_origami.partition import edge_table
from ufl_origami.pattern import CreasePattern
from ufl_origami.pattern_names import PatternNames
from ufl_origami.sheet import sheet_from_arrays
from ufl_origami.sizing import Refinement

pytestmark = pytest.mark.mpi

STRUCTURES = ("unstructured", "structured", "crisscross")
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def global_sum(sheet, values):
    """Sum over owned cells of all ranks."""
    return sheet.comm.allreduce(float(np.sum(values[: sheet.num_owned_cells])))


def cell_normals(sheet):
    """Vector areas (nc, 3) of the local cells."""
    return 0.5 * triangle_normals(sheet.rest, sheet.cells)


def euler_characteristic(sheet):
    edges = sheet.mesh.topology.index_map(1).size_global
    return sheet.num_vertices_global - edges + sheet.num_cells_global


def edge_lengths(sheet, name):
    """Lengths of the facets of a named edge that this rank owns."""
    facets = sheet.edges[name]
    a, b = sheet.edge_vertices()[facets[facets < sheet.num_owned_edges]].T
    return np.linalg.norm(sheet.rest[a] - sheet.rest[b], axis=1)


def book(pages):
    """Unit square pages at one spine along y, named "page0", ...; points "foot" and "head"."""
    angle = math.pi * np.arange(pages) / pages
    out = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    vertices = np.concatenate([[[0, 0, 0], [0, 1, 0]], out, out + np.array([0, 1, 0])])
    faces = [(0, 2 + p, 2 + pages + p, 1)[:: 1 - 2 * (p % 2)] for p in range(pages)]
    edges = {"spine": [(0, 1)]} | {
        f"side{p}": [(0, 2 + p), (2 + p, 2 + pages + p), (2 + pages + p, 1)] for p in range(pages)
    }
    return CreasePattern(
        vertices,
        np.array([pair for pairs in edges.values() for pair in pairs]),
        ("U", *3 * pages * "B"),
        faces,
        names=PatternNames(
            ("foot", "head", *2 * pages * [None]),
            tuple(name for name, pairs in edges.items() for _ in pairs),
            tuple(f"page{p}" for p in range(pages)),
        ),
    )


@pytest.mark.parametrize("structure", STRUCTURES)
def test_z_fold_has_the_panels_area_and_normals(comm, structure):
    pattern = z_fold()
    sheet = mesh_pattern(pattern, 0.2, structure=structure, comm=comm)
    normals = cell_normals(sheet)
    for p, name in enumerate(sheet.panel_names):
        mine = np.where((sheet.cell_panel == p)[:, None], normals, 0.0)
        total = [global_sum(sheet, mine[:, i]) for i in range(3)]
        assert np.allclose(total, pattern.face_normals[pattern.panels[name][0]], atol=1e-13)
    area = np.linalg.norm(normals, axis=1)
    assert global_sum(sheet, area) == pytest.approx(2.0, abs=1e-13)
    assert euler_characteristic(sheet) == 1
    expected = {"structured": 100, "crisscross": 200}.get(structure, sheet.num_cells_global)
    assert sheet.num_cells_global == expected


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("pages", [2, 3, 4])
def test_names_are_complete_and_equal_to_the_serial_ones(comm, pages, structure):
    pattern = book(pages)
    sheet = mesh_pattern(pattern, 0.3, structure=structure, comm=comm)
    arrays = pattern_arrays(pattern, MeshOptions(0.3, structure))
    table = edge_table(arrays.triangles)
    assert sheet.panel_names == tuple(f"page{p}" for p in range(pages))
    assert sheet.creases == ("spine",)
    assert set(sheet.edges) == {"spine", "boundary", *(f"side{p}" for p in range(pages))}
    assert np.array_equal(sheet.cell_panel, arrays.panel[sheet.input_cell])
    edge = table.find(sheet.input_vertex[sheet.edge_vertices()])
    for name, pairs in arrays.edges.items():
        whole = np.unique(np.concatenate(comm.allgather(edge[sheet.edges[name]])))
        assert np.array_equal(whole, np.sort(table.find(pairs)))
    for name, place in {"foot": [0, 0, 0], "head": [0, 1, 0]}.items():
        local = sheet.points[name]
        assert local == -1 or np.allclose(sheet.rest[local], place, atol=1e-15)
        assert comm.allreduce(0 <= local < sheet.num_owned_vertices, MPI.SUM) == 1
    spine = sheet.edges["spine"]
    links = sheet.edge_cells()
    owned = [f for f in spine if f < sheet.num_owned_edges]
    for facet in owned:
        assert list(sheet.cell_panel[links.links(int(facet))]) == list(range(pages))
    assert comm.allreduce(len(owned)) == 4


def test_boundary_is_every_edge_of_one_panel(comm):
    sheet = mesh_pattern(book(3), 0.25, comm=comm)
    assert comm.allreduce(len(edge_lengths(sheet, "boundary"))) == 3 * 3 * 4
    assert comm.allreduce(edge_lengths(sheet, "boundary").sum()) == pytest.approx(9.0)


def test_four_to_one_panels_share_the_crease(comm):
    sheet = mesh_pattern(z_fold(), 0.1, panel_size={"left": 0.025}, comm=comm)
    crease = comm.allgather(edge_lengths(sheet, "crease"))
    assert np.allclose(np.concatenate(crease), 0.025, atol=1e-12)
    assert sum(map(len, crease)) == 40
    outer = np.concatenate(comm.allgather(edge_lengths(sheet, "right_edge")))
    assert np.allclose(outer, 0.1, atol=1e-12)
    area = np.linalg.norm(cell_normals(sheet), axis=1)
    ideal = math.sqrt(3.0) / 4.0
    far = sheet.rest[sheet.cells].mean(axis=1)[:, 0] > 0.6 * sheet.rest[:, 0].max()
    for cells, size in ((sheet.cell_panel == 0, 0.025), ((sheet.cell_panel == 1) & far, 0.1)):
        count = global_sum(sheet, cells)
        mean = global_sum(sheet, np.where(cells, area, 0.0)) / max(count, 1.0)
        assert count > 10
        assert mean == pytest.approx(ideal * size**2, rel=0.25)
    assert altitude_ratios(sheet.rest, sheet.cells).min() > 0.25


def test_structure_by_panel(comm):
    styles = {"left": "crisscross", "right": "structured"}
    sheet = mesh_pattern(z_fold(), 0.25, structure=styles, comm=comm)
    counts = [global_sum(sheet, sheet.cell_panel == p) for p in range(2)]
    assert counts == [64, 32]
    one = mesh_pattern(z_fold(), 0.25, structure={"left": "structured"}, comm=comm)
    assert global_sum(one, one.cell_panel == 0) == 32
    assert global_sum(one, one.cell_panel == 1) not in (32, 64)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_refinement_is_fine_where_it_should_be_and_only_there(comm, structure):
    near = Refinement("A", size=0.02, growth=0.3)
    sheet = mesh_pattern(z_fold(), 0.2, structure=structure, refine=[near], comm=comm)
    arrays = pattern_arrays(z_fold(), MeshOptions(0.2, structure, refine=[near]))
    corners = arrays.vertices[arrays.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    touching = (arrays.triangles == arrays.points["A"]).any(axis=1)
    assert longest[touching].max() < 0.06
    assert longest.max() < 0.45
    assert longest.max() > 0.15
    assert sheet.num_cells_global == len(longest)
    coarse = pattern_arrays(z_fold(), MeshOptions(0.2, structure))
    assert len(coarse.triangles) < len(longest)


def test_edge_size_divides_the_named_edge(comm):
    sheet = mesh_pattern(z_fold(), 0.25, edge_size={"right_edge": 0.05}, comm=comm)
    assert comm.allreduce(len(edge_lengths(sheet, "right_edge"))) == 20
    assert comm.allreduce(len(edge_lengths(sheet, "crease"))) == 4


@pytest.mark.serial
def test_same_pattern_same_mesh():
    first, second = (pattern_arrays(z_fold(), MeshOptions(0.07)) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.triangles, second.triangles)


@pytest.mark.serial
def test_unstructured_is_near_equilateral():
    arrays = pattern_arrays(z_fold(), MeshOptions(0.05))
    ratio = altitude_ratios(arrays.vertices, arrays.triangles)
    assert ratio.mean() > 0.78
    assert ratio.min() > 0.4


@pytest.mark.serial
def test_flat_edge_inside_a_panel_is_a_line_and_no_crease():
    vertices = [[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1]]
    faces = [(0, 1, 4, 5), (1, 2, 3, 4)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (1, 4)]
    names = PatternNames(edges=(*6 * [None], "middle"))
    pattern = CreasePattern(
        np.array(vertices), np.array(edges), tuple("BBBBBBF"), faces, names=names
    )
    for structure in STRUCTURES:
        sheet = mesh_pattern(pattern, 0.25, structure=structure, comm=MPI.COMM_SELF)
        assert sheet.panel_names == ("panel0",)
        assert sheet.creases == ()
        assert len(sheet.edges["middle"]) == 4
        x = sheet.rest[sheet.edge_vertices()[sheet.edges["middle"]]]
        assert np.allclose(x[..., 0], 1.0, atol=1e-15)


@pytest.mark.serial
def test_mapped_triangle_has_n_squared_triangles():
    pattern = CreasePattern.from_arrays([[0, 0], [2, 0], [0.5, 1.5]], [(0, 1, 2)])
    arrays = pattern_arrays(pattern, MeshOptions(0.25, "structured"))
    counts = len(arrays.edges["boundary"]) // 3
    assert len(arrays.triangles) == counts**2
    area = triangle_normals(arrays.vertices, arrays.triangles)[:, 2]
    assert np.allclose(area, 3.0 / counts**2, rtol=1e-9)


@pytest.mark.serial
def test_mapped_sides_of_several_edges_get_equal_counts():
    """A panel with a vertex in its lower side beside one with a vertex in its upper side."""
    vertices = [[0, 0], [0.3, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1], [1.5, 1]]
    pattern = CreasePattern.from_arrays(
        vertices, [(1, 2, 3, 4, 0), (2, 5, 6, 7, 3)], fold_angle={(2, 3): 0.0}
    )
    for structure in ("structured", "crisscross"):
        arrays = pattern_arrays(pattern, MeshOptions(0.21, structure))
        normals = triangle_normals(arrays.vertices, arrays.triangles)
        assert np.all(normals[:, 2] > 0.0)
        assert 0.5 * normals[:, 2].sum() == pytest.approx(2.0, abs=1e-13)
        sheet_from_arrays(MPI.COMM_SELF, arrays.vertices, arrays.triangles)


PENTAGON = CreasePattern.from_arrays([[0, 0], [2, 0], [2, 1], [1, 2], [0, 1]], [(0, 1, 2, 3, 4)])
DART = CreasePattern.from_arrays([[0, 0], [1, 0.2], [2, 0], [1, 2]], [(0, 1, 2, 3)])
BAD = {
    "size": (z_fold(), {"size": 0.0}, "panel 'left': size 0.0 is not positive"),
    "nan": (z_fold(), {"size": math.nan}, "size nan is not positive"),
    "panel": (z_fold(), {"panel_size": {"lefd": 0.1}}, "'lefd'; did you mean 'left'"),
    "edge": (z_fold(), {"edge_size": {"crese": 0.1}}, "'crese'; did you mean 'crease'"),
    "near": (z_fold(), {"refine": [Refinement("C", 0.1)]}, "edge or point .* named 'C'"),
    "style": (z_fold(), {"structure": "mapped"}, "panel 'left': structure 'mapped' is none of"),
    "style name": (z_fold(), {"structure": {"up": "structured"}}, "named 'up'"),
    "sides": (PENTAGON, {"structure": "structured"}, r"panel 'panel0' \(face 0\) has 5 sides"),
    "inverted": (DART, {"structure": "structured"}, r"panel 'panel0' \(face 0\): inverted"),
    "thin": (z_fold(width=1e-3), {"structure": "structured", "size": 1.0}, "panel 'left' .* below"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_meshes_are_named_on_all_ranks(comm, case):
    pattern, options, message = BAD[case]
    with pytest.raises(MeshError, match=message):
        mesh_pattern(pattern, **{"size": 0.25, "comm": comm, **options})


@pytest.mark.serial
def test_gmsh_is_silent_and_left_as_found(capfd):
    fill_polygon(SQUARE, 0.5)
    assert not gmsh.isInitialized()
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Algorithm", 5)
        gmsh.model.add("mine")
        fill_polygon(SQUARE, 0.5)
        assert gmsh.model.getCurrent() == "mine"
        assert "mine" in gmsh.model.list() and "panel_0" not in gmsh.model.list()
        assert gmsh.option.getNumber("Mesh.Algorithm") == 5
    finally:
        gmsh.finalize()
    assert capfd.readouterr() == ("", "")


@pytest.mark.serial
def test_polygon_that_gmsh_cannot_fill_is_an_error_and_gmsh_is_closed(capfd):
    bow = SQUARE[[0, 2, 1, 3]]
    with pytest.raises(MeshError, match="gmsh"):
        fill_polygon(bow, 0.5)
    assert not gmsh.isInitialized()
    assert capfd.readouterr() == ("", "")


SHAPES = {
    "rectangle": lambda n, **k: mesh_shapes.rectangle(3.0, 1.0, n, **k),
    "slit_annulus": lambda n, **k: mesh_shapes.slit_annulus(6.0, 10.0, n, **k),
    "hemisphere_quarter": lambda n, **k: mesh_shapes.hemisphere_quarter(10.0, 2 * n, **k),
    "cylinder_octant": lambda n, **k: mesh_shapes.cylinder_octant(4.953, 10.35, 2 * n, **k),
}
AREAS = {
    "rectangle": 3.0,
    "slit_annulus": 64.0 * math.pi,
    "hemisphere_quarter": 50.0 * math.pi * math.cos(math.radians(18.0)),
    "cylinder_octant": 0.5 * math.pi * 4.953 * 0.5 * 10.35,
}
SIDES = {
    "rectangle": {"x0": 1.0, "x1": 1.0, "y0": 3.0, "y1": 3.0},
    "slit_annulus": {
        "slit_clamped": 4.0,
        "slit_loaded": 4.0,
        "inner": 12.0 * math.pi,
        "outer": 20.0 * math.pi,
    },
    "hemisphere_quarter": {
        "equator": 5.0 * math.pi,
        "hole": 5.0 * math.pi * math.sin(math.radians(18.0)),
        "sym_x0": 4.0 * math.pi,
        "sym_y0": 4.0 * math.pi,
    },
    "cylinder_octant": {
        "sym_x0": 5.175,
        "sym_z0": 5.175,
        "sym_y0": 0.5 * math.pi * 4.953,
        "free_end": 0.5 * math.pi * 4.953,
    },
}


def outward(name, x):
    """Unit normals of a shape at points (n, 3)."""
    if name == "hemisphere_quarter":
        return x / 10.0
    if name == "cylinder_octant":
        return x * [1, 0, 1] / 4.953
    return np.broadcast_to([0.0, 0.0, 1.0], x.shape)


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("name", SHAPES)
def test_shape_area_sides_and_orientation(comm, name, structure):
    sheet = SHAPES[name](8, structure=structure, comm=comm)
    normals = cell_normals(sheet)
    area = np.linalg.norm(normals, axis=1)
    assert global_sum(sheet, area) == pytest.approx(AREAS[name], rel=0.01)
    middle = outward(name, sheet.rest[sheet.cells].mean(axis=1))
    assert np.all((normals * middle).sum(axis=1) > 0.9 * area)
    assert euler_characteristic(sheet) == 1
    lengths = {side: comm.allreduce(edge_lengths(sheet, side).sum()) for side in SIDES[name]}
    assert lengths == pytest.approx(SIDES[name], rel=0.01)
    boundary = np.unique(np.concatenate([sheet.edges[side] for side in SIDES[name]]))
    assert np.array_equal(boundary, sheet.edges["boundary"])
    assert altitude_ratios(sheet.rest, sheet.cells).min() > 0.1


@pytest.mark.parametrize("structure", STRUCTURES)
def test_vertices_lie_on_the_exact_surface(comm, structure):
    ball = SHAPES["hemisphere_quarter"](4, structure=structure, comm=comm)
    assert np.allclose(np.linalg.norm(ball.rest, axis=1), 10.0, rtol=1e-14)
    pipe = SHAPES["cylinder_octant"](4, structure=structure, comm=comm)
    assert np.allclose(np.hypot(pipe.rest[:, 0], pipe.rest[:, 2]), 4.953, rtol=1e-14)
    for sheet, planes in ((ball, ("sym_x0", "sym_y0")), (pipe, ("sym_x0", "sym_y0", "sym_z0"))):
        for plane in planes:
            ends = sheet.edge_vertices()[sheet.edges[plane]].ravel()
            assert np.all(sheet.rest[ends, "xyz".index(plane[4])] == 0.0)
    ring = sheet_side(SHAPES["slit_annulus"](4, structure=structure, comm=comm), "outer")
    assert np.allclose(np.linalg.norm(ring, axis=1), 10.0, rtol=1e-14)


def sheet_side(sheet, name):
    """Coordinates of the vertices of a named edge on this rank."""
    return sheet.rest[np.unique(sheet.edge_vertices()[sheet.edges[name]])]


@pytest.mark.parametrize("structure", STRUCTURES)
def test_slit_is_open(comm, structure):
    sheet = SHAPES["slit_annulus"](6, structure=structure, comm=comm)
    ends = [
        np.unique(
            np.concatenate(
                comm.allgather(sheet.input_vertex[sheet.edge_vertices()[sheet.edges[name]]])
            )
        )
        for name in ("slit_clamped", "slit_loaded")
    ]
    assert [len(e) for e in ends] == [7, 7]
    assert len(np.intersect1d(*ends)) == 0
    for name in ("slit_clamped", "slit_loaded"):
        assert np.allclose(sheet_side(sheet, name)[:, 1:], 0.0, atol=1e-12)


def test_named_points_of_the_shapes(comm):
    expected = {
        "rectangle": {"x1y0": [3, 0, 0], "x0y1": [0, 1, 0], "x0_mid": [0, 0.5, 0]},
        "slit_annulus": {"A": [6, 0, 0], "B": [10, 0, 0]},
        "hemisphere_quarter": {"A": [10, 0, 0], "B": [0, 10, 0]},
        "cylinder_octant": {"A": [0, 0, 4.953], "B": [4.953, 0, 0], "C": [4.953, 5.175, 0]},
    }
    for structure in STRUCTURES:
        for name, points in expected.items():
            sheet = SHAPES[name](4, structure=structure, comm=comm)
            for point, place in points.items():
                local = sheet.points[point]
                assert local == -1 or np.allclose(sheet.rest[local], place, atol=1e-12)
                assert comm.allreduce(0 <= local < sheet.num_owned_vertices, MPI.SUM) == 1
    odd = mesh_shapes.rectangle(1.0, 1.0, 3, comm=comm)
    assert "x0_mid" not in odd.points
    annulus = mesh_shapes.slit_annulus(1.0, 2.0, 2, comm=comm)
    loaded = annulus.edge_vertices()[annulus.edges["slit_loaded"]]
    found = [annulus.points[name] in loaded for name in ("A", "B") if len(loaded)]
    assert comm.allreduce(sum(found)) >= 2


@pytest.mark.serial
def test_area_of_the_hemisphere_converges_with_order_two():
    for structure in ("structured", "unstructured"):
        errors = []
        for n in (8, 16):
            sheet = SHAPES["hemisphere_quarter"](n, structure=structure, comm=MPI.COMM_SELF)
            area = np.linalg.norm(cell_normals(sheet), axis=1).sum()
            errors.append(AREAS["hemisphere_quarter"] - area)
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.serial
def test_rectangle_counts():
    make = mesh_shapes.rectangle
    assert make(4.0, 1.0, 3).num_cells_global == 2 * 12 * 3
    assert make(1.0, 4.0, 3).num_cells_global == 2 * 12 * 3
    assert make(4.0, 1.0, (5, 2), structure="crisscross").num_cells_global == 40
    assert make(4.0, 1.0, size=0.5).num_cells_global == 2 * 8 * 2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda c: mesh_shapes.rectangle(0.0, 1.0, 2, comm=c), "length = 0.0"),
        (lambda c: mesh_shapes.rectangle(1.0, 1.0, comm=c), "either n or size"),
        (lambda c: mesh_shapes.rectangle(1.0, 1.0, 2, size=0.1, comm=c), "either n or size"),
        (lambda c: mesh_shapes.rectangle(1.0, 1.0, 0, comm=c), "n = 0"),
        (lambda c: mesh_shapes.rectangle(1.0, 1.0, 2, structure="x", comm=c), "'x' is none of"),
        (lambda c: mesh_shapes.slit_annulus(2.0, 1.0, 2, comm=c), "width = -1.0"),
        (lambda c: mesh_shapes.hemisphere_quarter(1.0, 2, hole_angle_deg=95.0, comm=c), "height"),
        (lambda c: mesh_shapes.cylinder_octant(1.0, math.inf, 2, comm=c), "length = inf"),
    ],
)
def test_bad_shapes_are_named_on_all_ranks(comm, call, message):
    with pytest.raises(MeshError, match=message):
        call(comm)
