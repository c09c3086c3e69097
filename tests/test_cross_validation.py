"""Comparison of two models of a scene: what is measured, the registry, and the command."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from demo_runs import run_demo
from matplotlib.image import imread
from run_scenes import crush
from scenes import E, H, build, follow, z_fold_scene

from ufl_origami.cross_quantities import (
    Displacement,
    Energy,
    FoldAngle,
    Line,
    Profile,
    Reaction,
    material_line,
)
from ufl_origami.cross_scenes import load_all
from ufl_origami.cross_validation import (
    CrossScene,
    cross_validate,
    register,
    registered,
    registered_scene,
    run_model,
)
from ufl_origami.errors import InputError
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import MODELS, Scene

pytestmark = pytest.mark.mpi
REPO = Path(__file__).resolve().parents[1]


def arc(places, *, radius=0.5, angle=2.0):
    """Points of a circle's arc at places from 0 to 1."""
    places = np.asarray(places)
    turned = angle * places
    return Line(places, radius * np.column_stack([np.sin(turned), 0 * turned, 1 - np.cos(turned)]))


@pytest.mark.parametrize("counts", [(6, 102), (90, 7)])
def test_distance_of_profiles_is_that_of_the_curves_not_of_the_meshes(counts):
    """Coarse chords are 70 times farther from the arc than what is left."""
    first, second = (arc(np.linspace(0, 1, n)) for n in counts)
    found = Profile("edge", width=2.0).difference(first, second)
    chords = [0.5 * (1 - np.cos(1.0 / (n - 1))) for n in counts]
    assert found <= min(chords) / 2 * (1 + 1e-9)
    moved = Line(second.place, second.points + np.array([0.0, 0.03, 0.04]))
    assert Profile("edge", width=2.0).difference(first, moved) == pytest.approx(
        0.025, abs=found + 1e-12
    )


def test_distance_of_profiles_is_that_of_material_points():
    """The same circle, run through unevenly: points are compared where they are in the sheet."""
    places = np.linspace(0, 1, 201)
    uneven = Line(places, arc(places**1.5).points)
    gap = np.abs(places**1.5 - places).max()
    found = Profile("edge").difference(arc(places), uneven)
    assert found == pytest.approx(2 * 0.5 * np.sin(gap), rel=1e-3)


def test_a_line_is_ordered_along_the_sheet_on_any_number_of_ranks(comm):
    model = build(z_fold_scene(0.2, 1.0))
    line = material_line(model, "front")
    depth = np.cos(np.radians(35.6 / 2))
    width = np.sin(np.radians(35.6 / 2))
    assert line.points[0] == pytest.approx([-width, 0, 0])
    assert line.points[-1] == pytest.approx([width, 0, 0])
    crease = np.interp(0.5, line.place, line.points[:, 2])
    assert crease == pytest.approx(-depth)
    assert (np.diff(line.points[:, 0]) > 0).all()
    steps = np.linalg.norm(np.diff(line.points, axis=0), axis=1)
    assert np.diff(line.place) == pytest.approx(steps / 2)
    assert all(np.array_equal(line.points, other) for other in comm.allgather(line.points))


@pytest.mark.parametrize("name", ["boundary", "both"])
def test_edges_that_are_no_open_line_are_refused(name):
    sheet = mesh_pattern(z_fold(), 0.4)
    if name == "both":
        sheet.edges["both"] = np.union1d(sheet.edges["front"], sheet.edges["back"])
    scene = Scene(sheet, Material(E, 0.0, H))
    scene.crease("crease", 1.0)
    with pytest.raises(InputError, match=f"'{name}' is not one open line"):
        material_line(build(scene), name)


def test_quantities_are_those_of_the_model():
    model = build(z_fold_scene(0.3, 0.5, d1=0.6))
    follow(model)
    angle = FoldAngle("crease").sample(model)
    assert angle == pytest.approx(np.degrees(model.mean_fold_angle("crease")))
    assert Reaction("right_edge", "x").sample(model) == pytest.approx(
        model.reaction("right_edge")[0]
    )
    energies = model.energies()
    assert Energy("total").sample(model)[0] == pytest.approx(sum(energies.values()))
    assert Energy("bending").sample(model) == pytest.approx(
        (energies["bending"], sum(energies.values()))
    )
    drop = Displacement("A", "z", 1.0).sample(model)
    rest = -np.cos(np.radians(35.6 / 2))
    assert drop == pytest.approx(model.position("A")[2] - rest)
    assert drop > 0.1


def test_differences_are_relative_to_what_they_say():
    assert FoldAngle("c").difference(10.0, 10.3) == pytest.approx(0.3)
    assert Reaction("e", "x").difference(-2.0, -1.9) == pytest.approx(0.05)
    assert Reaction("e", "x").difference(0.0, 0.0) == 0.0
    assert Energy("membrane").difference((0.1, 10.0), (0.3, 8.0)) == pytest.approx(0.02)
    assert Energy("membrane").difference((0.0, 0.0), (0.0, 0.0)) == 0.0
    assert Displacement("A", "z", 5.0).difference(1.0, 1.1) == pytest.approx(0.02)


def two_meshes(name="two_meshes", **tolerances):
    """A scene whose two models are ddg on two meshes: a comparison that needs no other model."""

    def make(model, size, comm):
        scene = Scene(mesh_pattern(z_fold(), size, comm=comm), Material(E, 0.0, H))
        scene.crease("crease", 0.5 * E * H**3)
        scene.fix("left_edge")
        scene.move("right_edge", x=1.0, y=0.0, z=0.0)
        return scene

    quantities = (
        FoldAngle("crease", tolerances.get("angle", 0.5)),
        Reaction("right_edge", "x", 0.05),
        Energy("total", 0.05),
        Profile("front", tolerance=0.01),
    )
    return CrossScene(name, make, {"ddg": 0.15, "fem": 0.3}, (0.3, 0.6), quantities)


def test_a_comparison_holds_within_its_tolerances_and_fails_when_one_is_too_tight(comm):
    scene = two_meshes()
    result = cross_validate(scene, comm)
    assert result.ok
    assert [row.load for row in result.rows] == 4 * [0.3] + 4 * [0.6]
    differences = np.array([row.difference for row in result.rows])
    assert (differences > 0).all()
    efforts = [result.runs[model].effort for model in MODELS]
    assert efforts[0].triangles > 2 * efforts[1].triangles
    assert efforts[0].dofs > 2 * efforts[1].dofs
    angle = result.rows[4]
    assert angle.difference == pytest.approx(abs(angle.values["ddg"] - angle.values["fem"]))
    tight = cross_validate(two_meshes(angle=1.8 * angle.difference), comm, tighten=2.0)
    assert not tight.ok
    assert [row.ok for row in tight.rows].count(False) == 1 and not tight.rows[4].ok


def test_a_model_that_gives_up_is_told_and_out_of_tolerance(comm):
    """A sheet crushed in its plane beyond what a triangle may suffer."""
    scene = CrossScene(
        "crush", lambda model, size, comm: crush(comm), {"ddg": 1, "fem": 1}, (0.2, 1.0),
        (Energy("total"),),
    )  # fmt: skip
    run = run_model(scene, "ddg", comm)
    assert "step below the smallest size" in run.failure and run.effort is None
    result = cross_validate(scene, comm)
    assert [row.ok for row in result.rows] == [True, False]
    assert result.rows[1].difference is None
    assert result.summary()["models"]["ddg"]["failure"] == run.failure


def test_the_registry_refuses_what_it_cannot_compare():
    load_all()
    known = registered()[0]
    assert registered_scene(known.name) is known
    with pytest.raises(InputError, match="the name is taken"):
        register(two_meshes(known.name))
    with pytest.raises(InputError, match=f"did you mean '{known.name}'"):
        registered_scene(known.name + "x")
    with pytest.raises(InputError, match="mesh sizes of"):
        CrossScene("one", known.make, {"ddg": 0.1}, known.stops, known.quantities)
    with pytest.raises(InputError, match="no load factor or no quantity"):
        CrossScene("none", known.make, known.sizes, (), known.quantities)


def test_z_folds_of_soft_and_stiff_creases_and_both_poisson_ratios_are_registered():
    load_all()
    names = [scene.name for scene in registered() if scene.name.startswith("z_fold")]
    assert len(names) == len(set(names)) >= 6
    assert any(scene.quick for scene in registered())


@pytest.mark.serial
def test_example_of_a_registered_scene_runs_as_it_stands(comm):
    """The block of CONTRIBUTING.md, which `load_all` would find as a module."""
    text = (REPO / "CONTRIBUTING.md").read_text()
    (code,) = (
        block
        for block in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        if "register(" in block
    )
    exec(compile(code, "CONTRIBUTING.md", "exec"), {})
    result = cross_validate(registered_scene("unequal_fold"), comm)
    assert result.ok, [row for row in result.rows if not row.ok]


def demo(folder, *words, ranks=1):
    return run_demo("cross_validate", folder, *words, ranks=ranks)


def table_of(folder):
    """Rows of comparison.csv without its load factors."""
    with (folder / "comparison.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Folder and console of the quick command."""
    folder = tmp_path_factory.mktemp("quick")
    done = demo(folder, "--quick")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder, done.stdout


@pytest.mark.serial
def test_the_quick_command_compares_both_models_and_agrees(quick):
    folder, console = quick
    runs = json.loads((folder / "summary.json").read_text())["runs"]
    load_all()
    assert [run["scene"] for run in runs] == [scene.name for scene in registered() if scene.quick]
    rows = table_of(folder)
    assert len(rows) == sum(len(run["comparisons"]) for run in runs) > 20
    assert {row["ok"] for row in rows} == {"yes"}
    assert all(0 < float(row["difference"]) <= float(row["tolerance"]) for row in rows)
    for run in runs:
        ddg, fem = (run["models"][model] for model in MODELS)
        assert ddg["triangles"] > fem["triangles"]
        assert min(ddg["iterations"], fem["iterations"], ddg["seconds"], fem["seconds"]) > 0
    for word in ("fold angle crease (deg)", "force right_edge", "energy crease", "profile front",
                 "triangles", "dofs", "iterations", "seconds"):  # fmt: skip
        assert word in console
    assert f"both models agree in {len(runs)} scenes" in console
    assert (imread(folder / "profiles.png")[..., :3].mean(axis=2) < 0.9).mean() > 0.005


@pytest.mark.serial
@pytest.mark.parametrize("ranks", [1, 2])
def test_the_command_fails_where_a_tolerance_is_exceeded(tmp_path, quick, ranks):
    """The numbers are those of the quick command, on any number of ranks."""
    done = demo(tmp_path, "--scene", "cantilever_shear", "--tighten", "1e6", ranks=ranks)
    assert done.returncode == 1, done.stderr
    rows = table_of(tmp_path)
    assert {row["ok"] for row in rows} == {"NO"}
    assert done.stdout.count("15 comparisons out of tolerance") == 1
    wanted = [row for row in table_of(quick[0]) if row["scene"] == "cantilever_shear"]
    for found, row in zip(rows, wanted, strict=True):
        assert (found["quantity"], found["load factor"]) == (row["quantity"], row["load factor"])
        for model in filter(row.get, MODELS):
            assert float(found[model]) == pytest.approx(float(row[model]), rel=1e-6)


@pytest.mark.serial
def test_the_command_names_the_scene_it_does_not_know(tmp_path):
    done = demo(tmp_path, "--scene", "cantilever_shaer")
    assert done.returncode == 1
    assert "did you mean 'cantilever_shear'" in done.stderr
