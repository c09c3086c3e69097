"""Quality figures against the shell's own energy and solutions; warnings; any rank count."""

import warnings

from mpi4py import MPI

import numpy as np
import pytest

from ufl_origami import kernels
from ufl_origami.analytic import cantilever_end_shear
from ufl_origami.crossings import crossed
from ufl_origami.discretise import build
from ufl_origami.errors import MeshWarning, SceneError, SupportWarning
from ufl_origami.gallery.shell_problems import displacement
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.patch_check import curvature_maps, interior_cells, patch_errors, tangent_frames
from ufl_origami.quality import (
    LONG_EDGE,
    check_mesh,
    check_model,
    sagitta,
    warn_mesh,
    warn_sagitta,
)
from ufl_origami.run import solve_static
from ufl_origami.scene import Scene
from ufl_origami.sheet import sheet_from_arrays
from ufl_origami.sides import edge_sides
from ufl_origami.solvers.newton import NewtonSolver
from ufl_origami.solvers.static import StaticPath, StepSettings
from ufl_origami.supports import check_supports, pieces

NU = 0.3
STEEL = Material(E=1e6, nu=NU, h=0.01)
QUIET = pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning")


def lattice(nx, ny, lx=1.0, ly=1.0, kind="diagonal"):
    """Vertices and triangles of a flat rectangle of nx x ny squares."""
    x, y = np.meshgrid(np.linspace(0, lx, nx + 1), np.linspace(0, ly, ny + 1), indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    triangles = []
    for i in range(nx):
        for j in range(ny):
            a = i * (ny + 1) + j
            b, c, d = a + ny + 1, a + ny + 2, a + 1
            if kind == "union-jack" and (i + j) % 2:
                triangles += [(a, b, d), (b, c, d)]
            else:
                triangles += [(a, b, c), (a, c, d)]
    return vertices, np.array(triangles)


def sheet_of(comm, vertices, triangles, **names):
    return sheet_from_arrays(comm, vertices, triangles, **names)


def errors_of(sheet):
    return patch_errors(sheet, edge_sides(sheet), np.full(len(sheet.panel_names), NU))


def two_panels(comm, kind):
    """A one-diagonal panel "plain" beside a panel "odd" of the given kind, at right angles."""
    v, t = lattice(8, 8)
    w, s = lattice(8, 8, kind=kind)
    w = np.column_stack([1.0 + w[:, 2], w[:, 1], w[:, 0]])
    seam_v, seam_w = np.flatnonzero(v[:, 0] == 1.0), np.flatnonzero(w[:, 2] == 0.0)
    index = np.full(len(w), -1)
    index[seam_w] = seam_v
    new = np.flatnonzero(index < 0)
    index[new] = len(v) + np.arange(len(new))
    return sheet_of(
        comm,
        np.vstack([v, w[new]]),
        np.vstack([t, index[s]]),
        panel=np.repeat([0, 1], [len(t), len(s)]),
        panel_names=["plain", "odd"],
        edges={"fold": np.column_stack([seam_v[:-1], seam_v[1:]])},
        creases=["fold"],
    )


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("structure", "cylinder", "worst"),
    [("structured", 0.0, 0.0), ("crisscross", 0.65, 13 / 7)],
)
def test_patch_errors_of_lattices(comm, structure, cylinder, worst):
    errors = errors_of(rectangle(1.0, 1.0, 16, structure=structure, comm=comm))
    assert errors.worst[0] == pytest.approx(worst, abs=1e-9)
    assert errors.cylinder[0] == pytest.approx(cylinder, abs=1e-9)


@pytest.mark.mpi
def test_patch_error_of_union_jack_is_that_of_the_twist(comm):
    assert errors_of(sheet_of(comm, *lattice(16, 16, kind="union-jack"))).worst[0] == pytest.approx(
        13 / 7, abs=1e-9
    )


@pytest.mark.mpi
def test_patch_errors_do_not_depend_on_orientation_and_place(comm):
    vertices, triangles = lattice(9, 7, kind="union-jack")
    rng = np.random.default_rng(3)
    vertices[:, :2] += rng.uniform(-0.02, 0.02, vertices[:, :2].shape)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    before = errors_of(sheet_of(comm, vertices, triangles))
    after = errors_of(sheet_of(comm, 3.0 * vertices @ turn.T + [1, 2, 3], triangles))
    assert after.worst == pytest.approx(before.worst, rel=1e-9)
    assert after.cylinder == pytest.approx(before.cylinder, rel=2e-2)


@QUIET
@pytest.mark.mpi
@pytest.mark.parametrize("curvature", ["cylinder", "oblique", "saddle", "twist", "sphere"])
def test_patch_check_is_the_shells_own_energy(comm, curvature):
    """The linear map of patch_check against the kernels on an interpolated, nearly flat surface."""
    k = {
        "cylinder": np.diag([1.0, 0.0]),
        "oblique": np.outer([0.6, 0.8], [0.6, 0.8]),
        "saddle": np.diag([1.0, -1.0]),
        "twist": np.array([[0.0, 1.0], [1.0, 0.0]]),
        "sphere": np.eye(2),
    }[curvature]
    vertices, triangles = lattice(8, 8, kind="union-jack")
    vertices[:, :2] += np.random.default_rng(5).uniform(-0.02, 0.02, (len(vertices), 2))
    sheet = sheet_of(comm, vertices, triangles)
    model = build(Scene(sheet, STEEL, bending="averaged"))
    state = model.state
    state.x[:, 2] = 0.5e-4 * np.einsum("ni,ij,nj->n", sheet.rest[:, :2], k, sheet.rest[:, :2])
    inside = interior_cells(sheet, edge_sides(sheet))
    energy = area = 0.0
    for cells, abar, b in model.shell.second_forms(state):
        pick = np.isin(cells, inside)
        law = kernels.plane_stress_stiffness(
            abar[pick], young=STEEL.E, poisson=NU, thickness=STEEL.h**3 / 3
        )
        energy += 0.5 * np.einsum("ni,nij,nj->", b[pick], law, b[pick])
        area += 0.5 * np.sqrt(abar[pick, 0] * abar[pick, 2] - abar[pick, 1] ** 2).sum()
    energy, area = comm.allreduce(energy), comm.allreduce(area)
    trace, square = np.trace(k), np.trace(k @ k)
    exact = 0.5 * STEEL.bending_stiffness * area * (NU * trace**2 + (1 - NU) * square) * 1e-8
    error = energy / exact - 1
    predicted = _predicted_error(sheet, inside, k)
    assert error == pytest.approx(predicted, abs=1e-6)
    found = errors_of(sheet)
    bound = found.cylinder if curvature in ("cylinder", "oblique") else found.worst
    assert abs(error) <= abs(bound[0]) + 1e-3
    assert error > 0.01


def _predicted_error(sheet, inside, k):
    maps = curvature_maps(sheet, edge_sides(sheet), inside)
    frames = tangent_frames(sheet)[inside][:, :, :2]
    local = np.einsum("nai,ij,nbj->nab", frames, k, frames)
    given = np.stack([local[:, 0, 0], local[:, 0, 1], local[:, 1, 1]], axis=1)
    b = np.einsum("nij,nj->ni", maps, given)
    corners = sheet.rest[sheet.cells[inside]]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )

    def density(c):
        trace, square = c[:, 0] + c[:, 2], c[:, 0] ** 2 + 2 * c[:, 1] ** 2 + c[:, 2] ** 2
        return (area * (NU * trace**2 + (1 - NU) * square)).sum()

    top, bottom = sheet.comm.allreduce(density(b)), sheet.comm.allreduce(density(given))
    return top / bottom - 1


@pytest.mark.mpi
def test_unstructured_meshes_pass_only_when_fine(comm):
    coarse = errors_of(rectangle(1.0, 1.0, 8, structure="unstructured", comm=comm)).worst[0]
    fine = errors_of(rectangle(1.0, 1.0, 40, structure="unstructured", comm=comm)).worst[0]
    assert 0 < fine < 0.02
    assert fine < coarse < 0.3


@pytest.mark.mpi
def test_figures_do_not_depend_on_the_ranks(comm):
    """Each rank also meshes the whole sheet alone."""
    figures = []
    for on in (comm, MPI.COMM_SELF):
        sheet = rectangle(1.0, 1.0, 8, structure="unstructured", comm=on)
        model = build(Scene(sheet, Material(1e6, NU, 1e-4)))
        x, y, _ = sheet.rest[: model.configuration.nv_owned].T
        shift = np.stack([0 * x, 0 * x, 0.1 * np.sin(3 * x) * y**2], axis=1)
        model.x.array_w[: shift.size] = shift.ravel()
        worst, share = sagitta(model)
        stretched = rectangle(1.0, 2.0, (48, 5), comm=on)
        errors = errors_of(sheet)
        figures.append(
            [errors.worst[0], errors.cylinder[0], worst.value, *worst.place, worst.cell, share]
            + [finding.figure for finding in check_mesh(Scene(stretched, STEEL))]
        )
    assert len(figures[0]) == 9
    assert figures[0] == pytest.approx(figures[1], rel=1e-9)


@pytest.mark.mpi
def test_warning_names_the_panel_that_fails(comm):
    sheet = two_panels(comm, "union-jack")
    with pytest.warns(MeshWarning, match=r"panel 'odd'.*\+185\.7 %.*1 of 2 panels"):
        warn_mesh(Scene(sheet, STEEL, bending="averaged"))
    assert check_mesh(Scene(sheet, STEEL)) == []
    assert check_mesh(Scene(two_panels(comm, "diagonal"), STEEL, bending="averaged")) == []


@pytest.mark.mpi
def test_build_warns_of_averaged_normals_and_not_of_directors(comm):
    sheet = rectangle(1.0, 1.0, 8, structure="crisscross", comm=comm)
    with pytest.warns(MeshWarning, match=r"\+185\.7 %, of cylinders by up to \+65\.0 %"):
        build(Scene(sheet, STEEL, bending="averaged"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        build(Scene(sheet, STEEL))


@pytest.mark.mpi
def test_panel_without_interior_triangle_has_no_patch_error(comm):
    sheet = sheet_of(comm, *lattice(1, 1))
    assert np.isnan(errors_of(sheet).worst).all()
    assert check_mesh(Scene(sheet, STEEL, bending="averaged")) == []


@pytest.mark.mpi
def test_curved_panel_is_checked_in_its_tangent_planes(comm):
    """A rolled-up lattice has the patch errors of the flat one."""
    vertices, triangles = lattice(48, 24, lx=2.0, kind="union-jack")
    flat = errors_of(sheet_of(comm, vertices, triangles))
    x, y = vertices[:, 0], vertices[:, 1]
    rolled = errors_of(sheet_of(comm, np.column_stack([np.sin(x), y, np.cos(x)]), triangles))
    assert rolled.worst == pytest.approx(flat.worst, rel=2e-3)


@pytest.mark.mpi
def test_sliver_warns_with_its_altitude_ratio(comm):
    vertices, triangles = lattice(4, 4)
    centre = 2 * 5 + 2
    vertices[centre, :2] = vertices[centre + 1, :2] + [0.0, -0.002]
    findings = check_mesh(Scene(sheet_of(comm, vertices, triangles), STEEL, bending="averaged"))
    (sliver,) = (f for f in findings if f.kind == "altitude")
    assert sliver.figure == pytest.approx(_altitude(vertices, triangles), rel=1e-9)
    assert sliver.figure < 0.01
    assert f"down to {sliver.figure:.2g}" in sliver.message


def _altitude(vertices, triangles):
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(d, axis=1) for d in (b - a, c - b, a - c)], axis=0)
    return (twice / longest**2).min()


def deflection(sheet, nu):
    """Deflection of a cantilever plate under a small end shear over the beam's, less one."""
    length, h = sheet.comm.allreduce(sheet.rest[:, 0].max(initial=0.0), op=MPI.MAX), 0.05
    scene = Scene(sheet, Material(12 / h**3, nu, h))
    scene.fix("x0")
    scene.clamp("x0")
    scene.line_load("x1", (0.0, 0.0, 1e-6))
    model = build(scene)
    StaticPath(model.problem, NewtonSolver(model.problem), StepSettings(first=1.0)).run(
        model.x, 0.0, [1.0]
    )
    return model.position("x1_mid")[2] / (1e-6 * length**3 / 3) - 1


@pytest.mark.parametrize("along", [4, 2])
def test_long_edge_figure_bounds_the_measured_softness(comm, along):
    """With directors the plate is softer by 3/8 (a/L)^2 for nu = 0, whatever the aspect."""
    sheet = rectangle(10.0, 10.0, (32, along), comm=comm)
    with pytest.warns(MeshWarning, match="too soft"):
        measured = deflection(sheet, 0.0) - 0.5 / 32**2
    assert measured == pytest.approx(0.375 / along**2, rel=0.02)
    (finding,) = check_mesh(Scene(sheet, STEEL))
    a = np.hypot(10 / 32, 10 / along)
    assert finding.kind == "long edges"
    assert finding.figure == pytest.approx(LONG_EDGE * (a / 10) ** 2, rel=0.02)
    assert measured < finding.figure < 2 * measured


@pytest.mark.mpi
def test_long_edges_matter_against_the_extent_across_them(comm):
    """Stretched triangles are fine where they are short beside the panel, or not the director's."""
    long_strip = rectangle(10.0, 1.0, (64, 1), comm=comm)
    assert check_mesh(Scene(long_strip, STEEL)) == []
    wide = rectangle(1.0, 10.0, (64, 10), comm=comm)
    (finding,) = check_mesh(Scene(wide, STEEL))
    assert finding.figure == pytest.approx(LONG_EDGE, rel=1e-2)
    assert check_mesh(Scene(wide, STEEL, bending="averaged")) == []


def arc(model, radius):
    """Displace the model to the cylinder of a radius about y."""
    x = model.sheet.rest[:, 0] / radius
    place = np.column_stack([radius * np.sin(x), model.sheet.rest[:, 1], radius * (1 - np.cos(x))])
    shift = (place - model.sheet.rest)[: model.configuration.nv_owned]
    model.x.array_w[: shift.size] = shift.ravel()


@pytest.mark.mpi
@pytest.mark.parametrize("bending", ["director", "averaged"])
def test_sagitta_of_a_cylinder(comm, bending):
    """On a one-diagonal mesh the shell's curvature is that of the cylinder: kappa a^2 / (8 h)."""
    h, n, radius = 0.002, 16, 0.5
    scene = Scene(rectangle(1.0, 1.0, n, comm=comm), Material(1e6, NU, h), bending=bending)
    model = build(scene)
    assert sagitta(model)[0].value == 0.0
    warn_sagitta(model)
    arc(model, radius)
    worst, share = sagitta(model)
    assert worst.value == pytest.approx(2 / n**2 / (8 * radius * h), rel=0.01)
    assert share == 0.0
    arc(model, 0.25 * radius)
    (finding,) = check_model(model)
    assert finding.figure == pytest.approx(4 * worst.value, rel=0.03)
    assert sagitta(model)[1] > 0.8
    with pytest.warns(MeshWarning, match=f"sagitta/h is {finding.figure:.3g} in panel 'sheet'"):
        warn_sagitta(model)


@pytest.mark.mpi
@pytest.mark.parametrize("thin", ["first", "second"])
def test_sagitta_uses_the_panels_own_thickness(comm, thin):
    """Both panels bent to the same cylinder: the thin one counts, and names itself."""
    material = {name: Material(1e6, NU, 0.1) for name in ("first", "second")}
    model = build(Scene(two_pieces(comm, 16), material | {thin: Material(1e6, NU, 0.001)}))
    arc(model, 2.0)
    worst, _ = sagitta(model)
    assert worst.value == pytest.approx(2 / 16**2 / (8 * 2.0 * 0.001), rel=0.01)
    assert model.sheet.panel_names[worst.panel] == thin


def two_pieces(comm, n):
    """Panels "first" and "second", not connected."""
    v, t = lattice(n, n)
    return sheet_of(
        comm,
        np.vstack([v, v + np.array([3.0, 0.0, 0.0])]),
        np.vstack([t, t + len(v)]),
        panel=np.repeat([0, 1], len(t)),
        panel_names=["first", "second"],
    )


def plate(comm):
    return Scene(rectangle(1.0, 1.0, 4, comm=comm), STEEL)


@pytest.mark.mpi
def test_free_sheet_is_refused(comm):
    with pytest.raises(SceneError, match="panels 'sheet': no condition holds them"):
        check_supports(build(plate(comm)))


@pytest.mark.mpi
def test_free_direction_is_named(comm):
    scene = plate(comm)
    scene.fix("x0", "xz")
    scene.fix("x1", "z")
    with pytest.raises(SceneError, match=r"along \(0, 1, 0\)"):
        check_supports(build(scene))


@pytest.mark.mpi
def test_hinged_edge_lets_the_sheet_turn_and_a_clamp_does_not(comm):
    scene = plate(comm)
    scene.fix("x0")
    with pytest.warns(SupportWarning, match=r"turning about \(0, 1, 0\)"):
        check_supports(build(scene))
    scene.clamp("x0")
    check_supports(build(scene))


@pytest.mark.mpi
def test_three_points_hold_a_sheet(comm):
    """Six components: 3 + 2 + 1 at three corners, the fewest that do; any five do not."""
    fixed = [("x0y0", "xyz"), ("x1y0", "yz"), ("x0y1", "z")]
    scene = plate(comm)
    for point, components in fixed:
        scene.fix(point, components)
    check_supports(build(scene))
    scene = plate(comm)
    for point, components in fixed[:2]:
        scene.fix(point, components)
    with pytest.warns(SupportWarning, match=r"turning about \(1, 0, 0\)"):
        check_supports(build(scene))


@pytest.mark.mpi
def test_the_piece_that_nothing_holds_is_named(comm):
    scene = Scene(two_pieces(comm, 3), STEEL)
    scene.fix("first")
    model = build(scene)
    assert sorted(p.panels for p in pieces(model)) == [("first",), ("second",)]
    with pytest.raises(SceneError, match="panels 'second': no condition"):
        check_supports(model)


@pytest.mark.mpi
def test_panels_at_a_crease_are_one_piece(comm):
    scene = Scene(two_panels(comm, "diagonal"), STEEL)
    scene.crease("fold", 1.0)
    scene.fix("odd")
    (piece,) = pieces(build(scene))
    assert piece.panels == ("plain", "odd")
    assert len(piece.motions) == 0


@pytest.mark.mpi
def test_crossings_are_those_of_criss_cross_and_union_jack(comm):
    crisscross = rectangle(1.0, 1.0, 4, structure="crisscross", comm=comm)
    assert crossed(crisscross).all()
    for structure in ("structured", "unstructured"):
        assert not crossed(rectangle(1.0, 1.0, 6, structure=structure, comm=comm)).any()
    union_jack = crossed(sheet_of(comm, *lattice(4, 4, kind="union-jack")))
    # the odd vertices inside the lattice, each of four triangles, four of which are on no other
    assert comm.allreduce(int(union_jack.sum())) == 16


@pytest.mark.mpi
@pytest.mark.parametrize("structure", ["crisscross", "structured"])
def test_crossings_have_a_lower_limit_of_sagitta(comm, structure):
    h, n, radius = 0.001, 16, 1.0
    scene = Scene(rectangle(1.0, 1.0, n, structure=structure, comm=comm), Material(1e6, NU, h))
    model = build(scene)
    arc(model, radius)
    worst, _ = sagitta(model)
    assert 0.3 < worst.value < 1.0
    findings = check_model(model)
    assert [finding.limit for finding in findings] == [0.3] * (structure == "crisscross")
    if findings:
        with pytest.warns(MeshWarning, match=r"above 0.3 on .* criss-cross edges there"):
            warn_sagitta(model)


@pytest.mark.mpi
def test_criss_cross_plate_that_locks_is_announced(comm):
    """A plate under end shear, P L^2 / EI = 4, is too stiff by 3 % at a sagitta below h."""
    sheet = rectangle(10.0, 4.0, (20, 8), structure="crisscross", comm=comm)
    scene = Scene(sheet, Material(E=12 * 100.0 / 0.01**3, nu=0.0, h=0.01))
    scene.fix("x0")
    scene.clamp("x0")
    scene.line_load("x1", (0.0, 0.0, 4.0))
    with pytest.warns(MeshWarning, match="criss-cross edges there are too long"):
        model = solve_static(scene, [1.0]).model
    assert sagitta(model)[0].value < 1.0
    exact = cantilever_end_shear(4.0, length=10.0)
    assert displacement(model, "x1y0")[2] < 0.97 * exact.w


@pytest.mark.mpi
@pytest.mark.parametrize("model", ["ddg", "fem"])
@pytest.mark.parametrize(("stretch", "found"), [(0.6, []), (0.55, [0.55])])
def test_collapsing_triangles_are_announced(comm, model, stretch, found):
    """A bar is weakest at the stretch 3^-1/2 = 0.577."""
    sheet = rectangle(1.0, 1.0, 4, comm=comm)
    scene = Scene(sheet, STEEL, model=model)
    scene.move("sheet", x=lambda time, rest: (stretch - 1) * rest[:, 0], y=0.0, z=0.0)
    built = build(scene)
    dofs = built.problem.constraints.dofs
    built.x.array_w[dofs] = built.problem.constraints.values(1.0)
    built.x.assemble()
    assert [f.figure for f in check_model(built)] == pytest.approx(found, rel=1e-9)
    if found:
        with pytest.warns(MeshWarning, match=r"a triangle has shrunk to 0\.55 of its area"):
            warn_sagitta(built)
