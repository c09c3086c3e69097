"""What is recommended for a scene: likeness, sizes, refusals, and that it meets the tolerance."""

import itertools
import warnings
from dataclasses import replace

import numpy as np
import pytest

import ufl_origami as uo
from ufl_origami.analytic import ZFold
from ufl_origami.errors import InputError, MeshWarning
from ufl_origami.gallery import z_fold
from ufl_origami.history import Record
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import cylinder_octant, hemisphere_quarter, rectangle, slit_annulus
from ufl_origami.meshing import mesh_pattern
from ufl_origami.recommendation import SAFETY, TABLE, kind_of_scene, panel_length, panel_shapes
from ufl_origami.scene import Scene
from ufl_origami.solvers.static import StepSettings
from ufl_origami.work_precision import read_points, write_points

ETA = 0.5


def fold(size=0.25, *, h=0.01, model="ddg", scale=1.0, **options):
    """Z-fold of panels of width `scale`, pulled apart by one width; EI = 1."""
    structure = options.pop("structure", "unstructured")
    sheet = mesh_pattern(z_fold(scale, scale), size, structure=structure)
    young = 12.0 / (h * scale) ** 3
    scene = Scene(sheet, Material(young, 0.0, h * scale), model=model, **options)
    scene.crease("crease", 12.0 * ETA / scale)
    scene.fix("left_edge")
    scene.move("right_edge", x=scale, y=0.0, z=0.0)
    return scene


def error_of(scene):
    """Largest relative error of angle and pull."""
    exact = ZFold.from_eta(ETA).solve(1.0)
    quiet = Record(energies=False, reactions=(), creases=(), points=(), fields="none")
    steps = StepSettings(0.5, 0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MeshWarning)
        model = uo.solve_static(scene, [1.0], record=quiet, steps=steps, progress=False).model
    angle = (np.pi - abs(model.mean_fold_angle("crease"))) / exact.included_angle - 1
    force = model.reaction("right_edge")[0] / exact.force - 1
    return max(abs(angle), abs(force))


@pytest.mark.parametrize("tolerance", [0.03, 0.01, 0.003])
@pytest.mark.parametrize("structure", ["structured", "unstructured"])
def test_recommended_set_up_meets_the_tolerance_on_the_z_fold(tolerance, structure):
    made = uo.recommend(fold(), tolerance, structures=[structure])
    assert made.problem == "z_fold" and made.structure == structure
    scene = fold(made.size, structure=structure, **made.options)
    assert error_of(scene) <= tolerance
    assert scene.sheet.num_cells_global == pytest.approx(made.triangles, rel=0.5)
    assert made.error <= SAFETY * tolerance * (1 + 1e-12) and made.seconds > 0


@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_tighter_tolerances_take_smaller_meshes(tmp_path, model):
    own = [p for p in read_points(TABLE) if p.model == model and p.method != "averaged"]
    table = write_points(tmp_path / "table.csv", own)
    scene = fold()
    made = [uo.recommend(scene, tol, table=table) for tol in (0.1, 0.03, 0.01, 0.004)]
    sizes, seconds = [m.size for m in made], [m.seconds for m in made]
    assert all(a >= b for a, b in itertools.pairwise(sizes)) and sizes[0] > sizes[-1]
    assert all(a <= b * 1.2 for a, b in itertools.pairwise(seconds))
    assert all(m.model == model for m in made)


def test_the_cheapest_method_is_taken(tmp_path):
    points = [p for p in read_points(TABLE) if p.problem == "z_fold"]
    scene = fold()
    for method in ("director", "fem"):
        dear = [replace(p, seconds=p.seconds * (1 if p.method == method else 1e6)) for p in points]
        table = write_points(tmp_path / f"{method}.csv", dear)
        made = uo.recommend(scene, 0.01, table=table)
        assert made.model == {"director": "ddg", "fem": "fem"}[method]
        assert made.options.get("bending", "") == {"director": "director", "fem": ""}[method]


@pytest.mark.mpi
def test_sizes_grow_with_the_panels():
    small, large = (uo.recommend(fold(0.3 * s, scale=s), 0.01) for s in (1.0, 7.0))
    assert large.size == pytest.approx(7 * small.size, rel=1e-9)
    assert large.triangles == small.triangles and large.seconds == pytest.approx(small.seconds)


def test_the_nearest_thickness_is_taken():
    found = [uo.recommend(fold(h=h), 0.01).thickness for h in (0.02, 0.0012, 1e-6)]
    assert found == pytest.approx([1e-2, 1e-3, 1e-4], rel=1e-6)


@pytest.mark.parametrize(
    ("sheet", "kind"),
    [
        (lambda: mesh_pattern(z_fold(), 0.5), "z_fold"),
        (lambda: rectangle(10.0, 1.0, 2), "cantilever"),
        (lambda: rectangle(2.0, 1.0, 3), "slit_annulus"),
        (lambda: slit_annulus(6.0, 10.0, 3), "slit_annulus"),
        (lambda: hemisphere_quarter(10.0, 8), "hemisphere"),
        (lambda: cylinder_octant(5.0, 10.0, 8), "hemisphere"),
    ],
)
def test_likeness_of_scenes(sheet, kind):
    assert kind_of_scene(sheet()) == kind


@pytest.mark.mpi
def test_shapes_of_panels_are_exact(comm):
    shapes = panel_shapes(rectangle(6.0, 1.5, 3, structure="unstructured"))
    assert shapes.area == pytest.approx([9.0], rel=1e-12)
    assert shapes.elongation == pytest.approx([4.0], rel=1e-9)
    assert shapes.straightness == pytest.approx([1.0], rel=1e-12)
    assert panel_length(mesh_pattern(z_fold(widths=(1.0, 4.0)), 0.5)) == pytest.approx(1.0)
    octant = panel_shapes(cylinder_octant(5.0, 10.0, 24))
    assert octant.straightness == pytest.approx([2 * np.sqrt(2) / np.pi], rel=1e-3)


@pytest.mark.parametrize("tolerance", [0.0, -0.01, float("nan"), float("inf")])
def test_tolerances_that_are_no_positive_number_are_refused(tolerance):
    with pytest.raises(InputError, match="is not a positive number"):
        uo.recommend(fold(), tolerance)


@pytest.mark.mpi
def test_a_tolerance_beyond_the_table_names_the_best_measured():
    with pytest.raises(InputError, match=r"tighter than all.*'z_fold'.*the best is (\S+)") as told:
        uo.recommend(fold(), 1e-9)
    best = float(str(told.value).split()[-1])
    assert uo.recommend(fold(), 1.05 * best).error <= best
    with pytest.raises(InputError, match="tighter"):
        uo.recommend(fold(), 0.95 * best)


def test_a_table_without_the_problem_is_refused(tmp_path):
    points = [p for p in read_points(TABLE) if p.problem == "hemisphere"]
    table = write_points(tmp_path / "table.csv", points)
    with pytest.raises(InputError, match="no points of 'z_fold'"):
        uo.recommend(fold(), 0.01, table=table)
