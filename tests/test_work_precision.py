"""Costs of tolerances on curves whose answers are known, and the file of points."""

from dataclasses import replace
from math import inf, isnan

import numpy as np
import pytest
from matplotlib.image import imread

from ufl_origami.errors import InputError
from ufl_origami.plotting.work_precision import WorkCurve, WorkPanel, work_precision_chart
from ufl_origami.work_precision import (
    Cost,
    Point,
    assured,
    cost_at,
    error_names,
    order,
    picked,
    place_of,
    read_points,
    write_points,
)

POINT = Point(
    problem="z_fold", method="director", mesh="structured", model="ddg", bending="director",
    measure="tan", step=0.5, thickness=0.01, n=4, size=0.25, h=0.01, panel_length=1.0,
    sheet_area=2.0, triangles=64, dofs=247, steps=2, newton_iterations=9, factorisations=9, cuts=0,
    unstable=0, seconds=0.1, assembly_seconds=0.03, factorisation_seconds=0.05, rest_seconds=0.02,
    elapsed=0.11, build_seconds=0.01, error_angle=-0.02, error_force=0.05, error_profile=None,
)  # fmt: skip


def test_power_law_is_interpolated_exactly():
    costs = np.array([1.0, 4.0, 16.0])
    found = cost_at(costs, 0.1 * costs**-1.5, 0.1 * 6.0**-1.5)
    assert found.value == pytest.approx(6.0, rel=1e-12) and not found.most


def test_accuracy_by_chance_on_a_coarse_mesh_does_not_count():
    costs, errors = [1.0, 2.0, 4.0, 8.0], [0.1, 0.001, 0.04, 0.004]
    assert assured(errors).tolist() == [0.1, 0.04, 0.04, 0.004]
    assert 4.0 < cost_at(costs, errors, 0.01).value < 8.0


def test_tolerances_beyond_the_ends_of_a_curve():
    costs, errors = [1.0, 2.0], [0.1, 0.01]
    assert cost_at(costs, errors, 0.005) is None
    assert cost_at(costs, errors, 0.2) == Cost(1.0, most=True)
    assert cost_at(costs, errors, 0.01).value == pytest.approx(2.0)


def test_a_finer_mesh_that_costs_less_counts():
    assert cost_at([1.0, 50.0, 3.0, 9.0], [0.1, 0.01, 0.002, 0.001], 0.01).value == 3.0
    assert cost_at([7.0, 3.0], [0.01, 0.001], 0.05) == Cost(3.0, most=True)


def test_places_on_a_curve():
    errors = [0.1, 0.01, 0.0001]
    assert place_of(errors, 0.5) == 0 and place_of(errors, 1e-5) is None
    assert place_of(errors, 0.01) == pytest.approx(1.0)
    assert place_of(errors, 0.001) == pytest.approx(1.5)
    assert place_of([inf, 0.01, 0.0001], 0.05) == 1


def test_a_failed_coarse_mesh_leaves_the_next_finer_one():
    assert cost_at([1.0, 2.0, 4.0], [inf, 0.005, 0.001], 0.01) == Cost(2.0)
    assert cost_at([1.0, 2.0], [0.005, inf], 0.01) is None


def test_largest_error_and_failures():
    assert POINT.error() == 0.05 and POINT.error("angle") == 0.02
    assert replace(POINT, failure="step too small").error("angle") == inf
    with pytest.raises(InputError, match=r"z_fold: no error 'profile'"):
        POINT.error("profile")
    assert error_names([POINT]) == ("angle", "force")


def test_points_are_picked_from_coarse_to_fine():
    points = [replace(POINT, size=s, method=m) for s in (0.1, 0.3) for m in ("director", "fem")]
    assert [p.size for p in picked(points, method="fem")] == [0.3, 0.1]
    assert picked(points, method="averaged") == []


def test_fitted_order():
    sizes = (0.4, 0.2, 0.1, 0.05)
    points = [replace(POINT, size=s, error_angle=0.0, error_force=3 * s**2) for s in sizes]
    assert order(points, "force") == pytest.approx(2.0, rel=1e-12)
    assert isnan(order(points[:1]))


def test_points_survive_their_file(tmp_path):
    failed = replace(POINT, error_angle=None, error_force=None, failure="a, b", measure="")
    file = write_points(tmp_path / "new" / "points.csv", [POINT, failed])
    assert read_points(file) == [POINT, failed]


@pytest.mark.parametrize(
    ("change", "message"),
    [(("problem,", "place,"), "no table of work"), (("247", "many"), "invalid literal")],
)
def test_other_tables_are_refused(tmp_path, change, message):
    file = write_points(tmp_path / "points.csv", [POINT])
    file.write_text(file.read_text().replace(*change))
    with pytest.raises(InputError, match=message):
        read_points(file)


def test_chart_of_two_methods_is_drawn_and_an_empty_one_refused(tmp_path):
    curves = [WorkCurve([0.1, 1.0], [0.1, 1e-3], m, "structured") for m in ("one", "other")]
    panels = [WorkPanel("a", "error", curves), WorkPanel("b", "error", curves[:1])]
    file = work_precision_chart(panels, tmp_path / "c.png", columns=2, abscissa="s", least=1e-4)
    assert imread(file).std() > 0.05
    with pytest.raises(InputError, match="nothing to draw"):
        work_precision_chart([WorkPanel("a", "error", [])], file, columns=1, abscissa="s")
