"""The speed-accuracy demo as a user runs it, in its quick form: points, orders, text, charts."""

import json
from dataclasses import asdict, fields
from math import exp, log
from pathlib import Path

import pytest
from demo_runs import run_demo
from matplotlib.image import imread

from ufl_origami.recommendation import TABLE
from ufl_origami.work_precision import (
    Point,
    fitted_order,
    order,
    picked,
    read_points,
    read_time_points,
)

pytestmark = pytest.mark.serial  # each test starts its own processes

REPO = Path(__file__).resolve().parent.parent
TITLES = {"averaged": "DDG averaged", "director": "DDG director", "fem": "FEM twin"}
MESHES = ("structured", "unstructured")
MOTIONS = ("vibration", "snap", "impact")
CURVES = {
    (scheme, control): f"{title} with {control} steps"
    for scheme, title in (("implicit_euler", "implicit Euler"), ("bdf2", "BDF2"))
    for control in ("fixed", "adaptive")
}


def demo(folder, *words, ranks=1):
    return run_demo("speed_accuracy", folder, *words, ranks=ranks)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Folder, points over meshes and text of the quick demo."""
    folder = tmp_path_factory.mktemp("speed")
    done = demo(folder, "--quick")
    assert done.returncode == 0, done.stderr
    text = (folder / "speed_accuracy.md").read_text()
    assert text in done.stdout
    return folder, read_points(folder / "speed_accuracy.csv"), text


@pytest.fixture(scope="module")
def moved(quick):
    """Points over time steps of the quick demo."""
    return read_time_points(quick[0] / "time_precision.csv")


def curve(points, method, mesh):
    return picked(points, method=method, mesh=mesh)


def steps_of(points, problem, curve):
    """Points of an integrator with one kind of steps, from long to short."""
    return picked(points, problem=problem, scheme=curve[0], control=curve[1])


def test_every_point_is_complete(quick):
    points = quick[1]
    assert {(p.method, p.mesh) for p in points} == {(m, k) for m in TITLES for k in MESHES}
    empty = {"error_deflection", "failure"}
    for p in points:
        assert p.problem == "z_fold" and not p.failure
        assert all(getattr(p, f.name) is not None for f in fields(Point) if f.name not in empty)
        assert p.factorisations >= p.steps > 0 and p.newton_iterations >= p.steps
        parts = p.assembly_seconds, p.factorisation_seconds, p.rest_seconds
        assert min(parts) > 0 and sum(parts) == pytest.approx(p.seconds, rel=1e-9)
        assert (p.bending, p.measure != "") == (
            ("", False) if p.model == "fem" else (p.method, True)
        )


def test_every_motion_is_complete(moved):
    assert {(p.problem, p.scheme, p.control) for p in moved} == {
        (problem, *curve) for problem in MOTIONS for curve in CURVES
    }
    for p in moved:
        assert not p.failure and p.dofs > 0 and p.newton_iterations >= p.steps > 0
        parts = p.assembly_seconds, p.factorisation_seconds, p.rest_seconds
        assert min(parts) > 0 and sum(parts) == pytest.approx(p.seconds, rel=1e-9)
        if p.control == "fixed":
            assert (p.cuts, p.steps) == (0, round(1 / p.size))
            shortest = longest = p.duration * p.size
        else:
            shortest, longest = p.smallest_step, p.largest_step
            assert 2 * shortest < longest < p.duration
        assert (p.smallest_step, p.largest_step) == pytest.approx((shortest, longest), rel=1e-9)


def test_summary_has_all_points(quick, moved):
    runs = json.loads((quick[0] / "summary.json").read_text())["runs"]
    assert runs == [asdict(p) for p in (*quick[1], *moved)]


def test_observed_orders(quick):
    """Second order for directors on any mesh, for averaged normals on structured ones only."""
    points = quick[1]
    for mesh in MESHES:
        assert order(curve(points, "director", mesh)) == pytest.approx(2.0, abs=0.3)
        assert order(curve(points, "fem", mesh)) > 2.0
    assert order(curve(points, "averaged", "structured")) == pytest.approx(2.0, abs=0.3)
    assert order(curve(points, "averaged", "unstructured")) < 0.5


def test_errors_are_ranked_as_claimed(quick):
    """Directors beat averaged normals on unstructured meshes, the twin both at equal size."""
    points = quick[1]
    director, averaged = (curve(points, m, "unstructured") for m in ("director", "averaged"))
    assert director[-1].size == averaged[-1].size
    for error, factor in (("angle", 0.2), ("force", 0.2), ("profile", 1.0)):
        assert director[-1].error(error) < factor * averaged[-1].error(error)
    for mesh in MESHES:
        twin = curve(points, "fem", mesh)[-1]
        same = [p for p in curve(points, "director", mesh) if p.size == twin.size]
        assert twin.error() < 0.2 * same[0].error()


def test_observed_orders_in_time(moved):
    """BDF2 seems to have order 2.2: its reference has no more than twice as many steps."""
    for scheme, expected in (("implicit_euler", 1.0), ("bdf2", 2.2)):
        found = steps_of(moved, "vibration", (scheme, "fixed"))
        sizes, errors = [p.size for p in found], [p.error() for p in found]
        assert fitted_order(sizes, errors) == pytest.approx(expected, abs=0.15)


@pytest.mark.parametrize("problem", MOTIONS)
def test_bdf2_beats_implicit_euler(moved, problem):
    """With steps not shorter than those of implicit Euler, and as many seconds or fewer."""
    euler, bdf2 = (steps_of(moved, problem, (s, "fixed")) for s in ("implicit_euler", "bdf2"))
    same = [p for p in bdf2 if p.size == euler[0].size]
    assert same[0].error() < 0.2 * euler[0].error()
    assert bdf2[-1].error() < 0.01 < 0.2 * euler[-1].error()


def cost(points, tolerance, name):
    """Cost of a tolerance, inf where it is not met: by hand, along the chart."""
    errors = [max(p.error() for p in points[i:]) for i in range(len(points))]
    costs = [getattr(p, name) for p in points]
    if errors[0] <= tolerance:
        return min(costs)
    for i in range(1, len(points)):
        if errors[i] <= tolerance:
            share = log(errors[i - 1] / tolerance) / log(errors[i - 1] / errors[i])
            between = exp(log(costs[i - 1]) + share * log(costs[i] / costs[i - 1]))
            return min(between, *costs[i:])
    return float("inf")


@pytest.mark.parametrize("tolerance", [0.01, 0.001])
@pytest.mark.parametrize(("name", "unit"), [("seconds", "s"), ("dofs", "unknowns")])
@pytest.mark.parametrize("mesh", MESHES)
def test_text_names_the_winner_of_the_table(quick, tolerance, name, unit, mesh):
    _, points, text = quick
    paid = {m: cost(curve(points, m, mesh), tolerance, name) for m in TITLES}
    winner = min(paid, key=paid.get)
    assert paid[winner] < float("inf")
    what = "seconds" if name == "seconds" else "unknowns"
    section = text.split(f"Z-fold, {100 * tolerance:g} %, in {what} (largest error):")[1]
    line = section.split(f"h/W = 0.01, {mesh} mesh: ")[1].splitlines()[0]
    assert f"**{TITLES[winner]}** wins with" in line
    value = float(line.split(f" {unit}")[0].split()[-1])
    assert value == pytest.approx(paid[winner], rel=6e-3)  # printed with three digits
    for method in set(TITLES) - {winner}:
        if paid[method] == float("inf"):
            assert f"{TITLES[method]} does not reach it" in line
        else:
            factor = float(line.split(f"{TITLES[method]} ")[1].split(" times")[0])
            assert factor == pytest.approx(paid[method] / paid[winner], rel=6e-3)


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("thickness", [0.01, 0.001, 0.0001])
def test_documented_text_is_that_of_the_table_of_recommendations(thickness, mesh):
    text = (REPO / "docs" / "speed_accuracy.md").read_text()
    points = [p for p in read_points(TABLE) if (p.problem, p.thickness) == ("z_fold", thickness)]
    for tolerance in (0.01, 0.001):
        paid = {m: cost(curve(points, m, mesh), tolerance, "seconds") for m in TITLES}
        section = text.split(f"Z-fold, {100 * tolerance:g} %, in seconds (largest error):")[1]
        line = section.split(f"h/W = {thickness:g}, {mesh} mesh: ")[1].splitlines()[0]
        winner = min(paid, key=paid.get)
        assert f"**{TITLES[winner]}** wins with {paid[winner]:.3g} s" in line


def test_readme_quotes_the_text():
    """Line breaks apart."""
    readme, text = (
        " ".join(path.read_text().split())
        for path in (REPO / "README.md", REPO / "docs" / "speed_accuracy.md")
    )
    quoted = readme.split("it says: - ")[1].split(" `uo.recommend(")[0].split(". - ")
    assert len(quoted) == 4
    assert all(sentence.rstrip(".") in text for sentence in quoted)


@pytest.mark.parametrize("problem", MOTIONS)
@pytest.mark.parametrize("tolerance", [0.01, 0.001])
def test_text_names_the_integrator_that_wins(quick, moved, problem, tolerance):
    paid = {c: cost(steps_of(moved, problem, c), tolerance, "seconds") for c in CURVES}
    section = quick[2].split("## Which integrator wins")[1]
    line = section.split(f"- {problem}, {100 * tolerance:g} %: ")[1].splitlines()[0]
    winner = min(paid, key=paid.get)
    if paid[winner] == float("inf"):
        assert line == "no integrator reaches it."
        return
    assert line.startswith(f"**{CURVES[winner]}** wins with")
    value = float(line.split(" s;")[0].split()[-1])
    assert value == pytest.approx(paid[winner], rel=6e-3)
    for other in set(CURVES) - {winner}:
        tail = line.split(f"{CURVES[other]} ")[1]
        if paid[other] == float("inf"):
            assert tail.startswith("does not reach it")
        else:
            factor = float(tail.split(" times")[0])
            assert factor == pytest.approx(paid[other] / paid[winner], rel=6e-3)


def test_documented_text_is_that_of_the_command(quick):
    """The same sections, and the same motions; their figures are those of the full study."""
    texts = (REPO / "docs" / "speed_accuracy.md").read_text(), quick[2]
    heads, motions = (
        [
            [line.split(" Reference:")[0] for line in text.splitlines() if line.startswith(start)]
            for text in texts
        ]
        for start in ("#", tuple(f"- {problem}: " for problem in MOTIONS))
    )
    assert heads[0] == heads[1] and len(heads[0]) > 10
    assert motions[0] == motions[1] and len(motions[0]) == len(MOTIONS)


def test_text_states_the_settings(quick):
    _, points, text = quick
    settings = text.split("## Settings")[1]
    for method, title in TITLES.items():
        (chosen,) = {(p.step, p.measure) for p in points if p.method == method}
        assert f"| z fold | {title} | {chosen[0]:g} |" in settings
    assert f"| {chosen[1] or '-'} |" in settings


def is_drawn(file):
    """Whether a picture has ink in its upper and lower half and is not all ink."""
    ink = imread(file)[..., :3].mean(axis=2) < 0.95
    half = len(ink) // 2
    return ink[:half].mean() > 0.002 and ink[half:].mean() > 0.002 and ink.mean() < 0.6


def test_charts_are_drawn(quick):
    names = ["error_dofs", "error_seconds", "speed_accuracy", "time_precision"]
    assert sorted(f.stem for f in quick[0].glob("*.png")) == names
    assert all(is_drawn(quick[0] / f"{name}.png") for name in names)


@pytest.mark.slow
def test_two_ranks_find_the_same_errors(quick, tmp_path):
    done = demo(tmp_path, "--quick", "--problem", "z_fold", "--method", "director", ranks=2)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("# Speed against accuracy\n") == 1
    others = picked(quick[1], method="director")
    found = read_points(tmp_path / "speed_accuracy.csv")
    assert len(found) == len(others)
    for p in found:
        (one,) = picked(others, mesh=p.mesh, n=p.n)
        assert (p.triangles, p.dofs) == (one.triangles, one.dofs)
        assert p.error("force") == pytest.approx(one.error("force"), rel=1e-4)
        assert p.error("profile") == pytest.approx(one.error("profile"), rel=1e-4)


@pytest.mark.slow
def test_two_ranks_follow_the_same_impact(moved, tmp_path):
    """Errors agree to what Newton's tolerance leaves of them after all steps."""
    done = demo(tmp_path, "--quick", "--problem", "impact", ranks=2)
    assert done.returncode == 0, done.stderr
    found, alone = (
        read_time_points(tmp_path / "time_precision.csv"),
        picked(moved, problem="impact"),
    )
    assert len(found) == len(alone)
    for p, one in zip(picked(found), alone, strict=True):
        for name in ("scheme", "control", "size", "dofs", "steps"):
            assert getattr(p, name) == getattr(one, name)
        assert p.error() == pytest.approx(one.error(), rel=1e-3)


def test_unknown_names_end_with_close_ones(tmp_path):
    done = demo(tmp_path, "--problem", "zfold")
    assert done.returncode == 1 and "no problem is named 'zfold'" in done.stderr
    assert "'z_fold'" in done.stderr
