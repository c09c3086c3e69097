"""The failure map as a user runs it: its quick grid, what it claims, its meshes, exact motions."""

import csv
import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from demo_runs import run_demo
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from scipy.integrate import solve_ivp

from ufl_origami.barrier import Barrier

REPO = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPO / "demos"))

from _failure_figures import CELL, FILL, STYLE  # noqa: E402
from _failure_meshes import mesh_kinds, plate, smallest_angle  # noqa: E402
from _impact_cases import EPS, RHO, G, H, Throw, contact_time, sliding_way  # noqa: E402
from _impact_grid import METHODS, WAYS  # noqa: E402
from _impact_runs import run_throw  # noqa: E402

DIRECTOR, SHARP = "director", 1e-12
BOUND, BOUND_IN_TIME = 0.03, 0.05
IN_TIME = ("impact", "block", "skid", "corner")
SNAPS = ("truss", "roof", "thin roof")


def demo(folder, *words, ranks=1):
    done = run_demo("failure_map", folder, *words, ranks=ranks, timeout=600)
    assert done.returncode == 0, done.stderr
    return done


def read_runs(folder):
    """Runs of the static part, those in time, and those past limit points."""
    runs = json.loads((folder / "summary.json").read_text())["runs"]
    static = [run for run in runs if run["problem"] not in (*IN_TIME, *SNAPS)]
    parts = [[run for run in runs if run["problem"] in part] for part in (IN_TIME, SNAPS)]
    return static, *parts


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Folder, static runs, runs in time and console of the quick grid."""
    folder = tmp_path_factory.mktemp("failure_map")
    done = demo(folder, "--quick")
    static, thrown, led = read_runs(folder)
    return SimpleNamespace(
        folder=folder, static=static, thrown=thrown, led=led, console=done.stdout
    )


def picked(runs, **values):
    """Runs with these values; at least one."""
    found = [run for run in runs if all(run[key] == value for key, value in values.items())]
    assert found, values
    return found


@pytest.mark.serial
def test_own_solver_with_directors_is_right_in_every_difficulty(quick):
    """One difficulty at a time; what the pairs add is thin criss-cross and forces in round-off."""
    runs = picked(quick.static, method=DIRECTOR, solver="auto")
    other = [run for run in runs if run["verdict"] != "right"]
    assert all(run["h"] == 1e-4 and run["warned"] for run in other)
    assert re.search(r"director, auto: (\d+) of \1 single difficulties .* end right", quick.console)


@pytest.mark.serial
def test_arc_length_finds_the_limit_points_that_a_load_jumps_over(quick):
    for method in ("director", "fem"):
        (arc,) = picked(quick.led, method=method, solver="arc")
        (load,) = picked(quick.led, method=method, solver="load")
        assert (arc["verdict"], arc["limit_points"], arc["warned"]) == ("right", 2, "")
        assert (load["verdict"], load["limit_points"], load["warned"]) == ("right", 0, "branch")
        assert arc["error"] < 1e-6 and load["error"] < 1e-6


@pytest.mark.serial
def test_no_wrong_answer_is_silent(quick):
    """But for other equilibria of a fold that is led by its edge."""
    led = "closed by edge"
    wrong = [r for r in quick.static if r["verdict"] == "wrong" and r["problem"] != led]
    assert wrong and all(run["warned"] for run in wrong)


@pytest.mark.serial
@pytest.mark.parametrize("mesh", ["criss-cross", "Delaunay", "slivers 2 deg"])
def test_averaged_normals_are_wrong_on_bad_meshes_and_warned_of(quick, mesh):
    """By the patch check, before anything is solved; directors on the same mesh are right."""
    case = {"problem": "cantilever", "h": 0.01, "mesh": mesh}
    averaged = picked(quick.static, method="averaged", **case)
    assert {run["solver"] for run in averaged} == {"newton", "bt", "default", "auto"}
    for run in averaged:
        assert run["verdict"] in ("wrong", "failed") and "patch" in run["warned"]
    (right,) = picked(quick.static, method=DIRECTOR, solver="auto", **case)
    assert right["verdict"] == "right" and "patch" not in right["warned"]


@pytest.mark.serial
def test_line_search_fails_where_the_own_solver_needs_few_iterations(quick):
    """A thin cantilever in four steps: steps that lower the energy are short ones."""
    case = {"problem": "cantilever", "mesh": "one-diagonal", "h": 1e-4, "steps": 4}
    for method in ("averaged", DIRECTOR):
        (bt,) = picked(quick.static, method=method, solver="bt", **case)
        (newton,) = picked(quick.static, method=method, solver="newton", **case)
        (own,) = picked(quick.static, method=method, solver="default", **case)
        assert bt["verdict"] == "failed" and bt["reason"] and bt["error"] is None
        assert own["verdict"] == newton["verdict"] == "right"
        assert 3 * own["iterations"] < newton["iterations"]


@pytest.mark.serial
@pytest.mark.parametrize(("mesh", "h"), [("criss-cross", 1e-4), ("Delaunay", 1e-4)])
def test_fem_does_not_lock_where_directors_do(quick, mesh, h):
    case = {"problem": "cantilever", "mesh": mesh, "h": h, "solver": "auto"}
    (locked,) = picked(quick.static, method=DIRECTOR, **case)
    (fem,) = picked(quick.static, method="fem", **case)
    assert locked["verdict"] != "right" and locked["warned"]
    assert fem["verdict"] == "right" and fem["error"] < 0.01 and not fem["warned"]


@pytest.mark.serial
def test_forces_lost_in_round_off_are_announced(quick):
    case = {"problem": "z-fold", "eta": 1e-6}
    for run in picked(quick.static, h=1e-4, **case):
        assert "round-off" in run["warned"]
    for run in picked(quick.static, h=1e-2, **case):
        assert "round-off" not in run["warned"] and run["verdict"] == "right"


@pytest.mark.serial
def test_folds_close_beyond_half_a_turn(quick):
    for drive in ("rest angle", "moment", "edge"):
        case = {"problem": f"closed by {drive}", "angle": 200.0, "method": DIRECTOR}
        (run,) = picked(quick.static, solver="auto", **case)
        assert run["verdict"] == "right" and run["error"] < 0.005, drive


@pytest.mark.serial
def test_automatic_steps_in_time_are_right_or_fail_and_name_the_barrier(quick):
    for run in picked(quick.thrown, solver="auto"):
        if run["speed"] == 100.0 and not run["anew"]:  # with the barrier for speed 1
            assert run["verdict"] == "failed" and "contact" in run["warned"]
            assert "obstacle 'floor': its barrier" in run["reason"]
            assert 0 < run["min_gap"] < 1e-2 * H
        else:
            assert run["verdict"] == "right" and run["error"] <= BOUND_IN_TIME
            assert run["min_gap"] > 0.1 * H
    text = (
        "in time, auto: 10 of 12 single difficulties end right, 2 fail and name the barrier; 0 of"
    )
    assert text in quick.console


@pytest.mark.serial
def test_equal_steps_in_time_take_the_rebound_where_they_are_long(quick):
    """Half a contact is too long for both; a fiftieth for implicit Euler alone."""
    error = {
        (way, dt): picked(quick.thrown, problem="impact", method=DIRECTOR, solver=way, dt=dt)[0]
        for way in ("euler", "bdf2")
        for dt in (0.02, 0.5)
    }
    error = {case: run["error"] for case, run in error.items()}
    assert error["bdf2", 0.02] < 0.002 < 0.05 < error["euler", 0.02] < 0.2
    assert 0.2 < error["bdf2", 0.5] < error["euler", 0.5]


@pytest.mark.serial
def test_energy_in_time_is_accounted_for_and_never_gained(quick):
    ended = [run for run in quick.thrown if run["verdict"] != "failed"]
    assert {run["problem"] for run in ended} == {"impact", "block", "corner"}
    for run in ended:
        assert run["energy_balance_error"] < 1e-5
        assert run["energy_gain"] < 1e-9


@pytest.mark.serial
def test_verdicts_follow_from_errors_and_reasons(quick):
    for runs, bound in ((quick.static, BOUND), (quick.thrown, BOUND_IN_TIME)):
        for run in runs:
            failed = run["verdict"] == "failed"
            assert failed == bool(run["reason"]) == (run["error"] is None)
            assert failed == (run["reached"] < 1.0)
            assert failed or (run["error"] <= bound) == (run["verdict"] == "right")


@pytest.mark.serial
def test_text_lists_and_counts_what_the_table_holds(quick):
    text = (quick.folder / "failure_map.md").read_text()
    assert text.strip() in quick.console
    runs = [*quick.static, *quick.thrown, *quick.led]
    with (quick.folder / "failure_map.csv").open(newline="") as stream:
        rows = [*csv.DictReader(stream)]
    assert [row["verdict"] for row in rows] == [run["verdict"] for run in runs]
    assert all([*row] == [*runs[0]] for row in rows)
    title, part, time, path = re.split(r"^# ", text, flags=re.MULTILINE)
    assert title == "" and time.startswith("Where methods fail in time\n")
    assert path.startswith("Which way gets past which limit point\n")
    for section, found in ((part, quick.static), (time, quick.thrown), (path, quick.led)):
        check_section(section, found)


def check_section(text, runs):
    """Compare the text of one part with its runs."""
    assert f"{len(runs)} cases: " in text
    for method, solver in {(run["method"], run["solver"]) for run in runs}:
        found = picked(runs, method=method, solver=solver)
        counts = [sum(r["verdict"] == v for r in found) for v in ("right", "wrong", "failed")]
        silent = sum(r["verdict"] == "wrong" and not r["warned"] for r in found)
        line = " | ".join(map(str, [method, solver, *counts, silent]))
        assert f"| {line} |" in text
    silent = [r for r in runs if r["verdict"] == "wrong" and not r["warned"]]
    section = text.split("## Wrong and silent")[1].split("##")[0]
    assert section.count("| error") == len(silent)


@pytest.mark.serial
def test_maps_are_drawn(quick):
    files = sorted(quick.folder.glob("*.png"))
    pairs = ["failure_map_pair1", "failure_map_pair2"]
    assert [f.stem for f in files] == [
        "failure_map",
        *pairs,
        "failure_map_path",
        "failure_map_time",
    ]
    for file in files:
        pixels = imread(file)[..., :3]
        filled = (np.abs(pixels - 1.0) > 0.05).any(axis=2)
        assert 0.03 < filled.mean() < 0.8
    right = sum(run["verdict"] == "right" for run in quick.thrown)
    green = (np.abs(pixels - to_rgb(FILL["right"])) < 0.01).all(axis=2).sum()
    cell = CELL[0] * CELL[1] * STYLE["savefig.dpi"] ** 2
    assert 0.75 * cell * (right + 1) < green < cell * (right + 1)  # the legend has one, too


@pytest.mark.slow
@pytest.mark.serial
def test_two_ranks_find_the_same(quick, tmp_path):
    """The same grid; the same errors but where round-off decides (thin, or led by an edge)."""
    demo(tmp_path, "--quick", ranks=2)
    static, thrown, _ = read_runs(tmp_path)
    keys = ("problem", "mesh", "h", "eta", "steps", "angle", "method", "solver", "triangles")
    assert [[run[k] for k in keys] for run in static] == [
        [run[k] for k in keys] for run in quick.static
    ]
    own = [(a, b) for a, b in zip(quick.static, static, strict=True) if a["solver"] == "auto"]
    steady = [pair for pair in own if pair[0]["h"] == 0.01]
    steady = [pair for pair in steady if pair[0]["problem"] != "closed by edge"]
    assert len(steady) > 20
    for one, other in steady:
        assert one["error"] == pytest.approx(other["error"], abs=1e-5)
        assert (one["verdict"], one["warned"]) == (other["verdict"], other["warned"])
    for one, other in zip(quick.thrown, thrown, strict=True):
        assert one["verdict"] == other["verdict"]
        if one["error"] is not None:
            assert one["error"] == pytest.approx(other["error"], abs=2e-3)


@pytest.mark.mpi
@pytest.mark.parametrize("kind", mesh_kinds((10, 5, 2)))
def test_meshes_cover_the_plate_and_are_as_bad_as_named(comm, kind):
    sheet = plate(kind, (10.0, 4.0), (20, 8), comm)
    corners = sheet.rest[sheet.cells[: sheet.num_owned_cells]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert comm.allreduce(normal[:, 2].sum()) == pytest.approx(80.0, rel=SHARP)
    assert (normal[:, 2] > 0).all()
    facets = sheet.edge_facets("x1")
    ends = sheet.edge_vertices()[facets[facets < sheet.num_owned_edges]]
    length = np.linalg.norm(sheet.rest[ends[:, 1]] - sheet.rest[ends[:, 0]], axis=1)
    assert comm.allreduce(length.sum()) == pytest.approx(4.0, rel=SHARP)
    angle = smallest_angle(sheet)
    if kind.startswith("slivers"):
        assert angle == pytest.approx(float(kind.split()[1]), rel=1e-9)
    else:
        assert angle > 12.0


@pytest.mark.parametrize("strength", [0.2, 1.0, 50.0])
def test_contact_time_is_that_of_the_equation_of_motion(strength):
    """Rho h z'' = pressure(z) from the barrier's edge, until the sheet is back there."""
    speed, reach = 3.0, 0.02
    barrier = Barrier(strength * RHO * H * speed**2 / reach**2, reach)

    def back(_, y):
        return y[0] - reach

    back.terminal, back.direction = True, 1.0
    path = solve_ivp(
        lambda _, y: [y[1], barrier.pressure(max(y[0], 1e-6 * reach)) / (RHO * H)],
        (0.0, 10 * reach / speed),
        [reach, -speed],
        events=back,
        method="DOP853",
        rtol=1e-10,
        atol=1e-14,
    )
    assert path.y[1, -1] == pytest.approx(speed, rel=1e-8)
    assert contact_time(barrier, speed) == pytest.approx(path.t[-1], rel=1e-5)


def test_contact_time_on_a_barrier_that_hardly_acts_is_that_of_flight():
    weak = Barrier(1e-6 * RHO * H / 0.01**2, 0.01)
    assert contact_time(weak, 1.0) == pytest.approx(2 * 0.01, rel=1e-4)


@pytest.mark.parametrize("mu", [0.1, 10.0])
def test_sliding_way_is_that_of_the_equation_of_motion(mu):
    speed = 0.5

    def rates(_, y):
        share = min(y[1] / EPS, 1.0)
        return [y[1], -mu * G * (2 * share - share**2)]

    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-14, "max_step": 0.01 / mu}
    path = solve_ivp(rates, (0.0, 1.5 * speed / (mu * G)), [0.0, speed], **options)
    assert path.y[1, -1] < 1e-6
    assert sliding_way(speed, mu) == pytest.approx(path.y[0, -1], rel=1e-6)


@pytest.mark.serial
def test_first_step_longer_than_the_whole_slide_is_cut(comm):
    """It may not take the energy at the start for the integrator's own."""
    throw = Throw("block", mu=100.0)
    way = {way.name: way for way in WAYS}
    fixed = run_throw(throw, METHODS[0], way["euler"], comm, BOUND_IN_TIME)
    assert fixed.measured["time_steps"] == 1 and fixed.error > 0.9
    free = run_throw(throw, METHODS[0], way["auto"], comm, BOUND_IN_TIME)
    assert free.measured["cuts"] > 0 and free.error < 0.1
