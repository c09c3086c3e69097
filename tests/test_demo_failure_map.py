"""The failure map as a user runs it: its quick grid, what it claims, and its meshes."""

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

REPO = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPO / "demos"))

from _failure_meshes import mesh_kinds, plate, smallest_angle  # noqa: E402

DIRECTOR, SHARP = "director", 1e-12
OWN = ("default", "auto")


def demo(folder, *words, ranks=1):
    """Run the demo; its processes must not take this process for their launcher's child."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("PMIX_", "PRTE_", "OMPI_"))}
    env |= {k: v for k, v in os.environ.items() if k.startswith(("OMPI_ALLOW", "OMPI_MCA_btl"))}
    env["PYTHONPATH"] = f"{REPO}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    env["OMPI_MCA_mpi_yield_when_idle"] = "1"  # the ranks may share cores with others
    mpirun = ["mpirun", "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
    command = [*mpirun, sys.executable, str(REPO / "demos" / "failure_map.py"), *words]
    done = subprocess.run(
        [*command, "--output", str(folder)], env=env, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Folder, runs and console of the quick grid."""
    folder = tmp_path_factory.mktemp("failure_map")
    done = demo(folder, "--quick")
    return folder, json.loads((folder / "summary.json").read_text())["runs"], done.stdout


def picked(runs, **values):
    """Runs with these values; at least one."""
    found = [run for run in runs if all(run[key] == value for key, value in values.items())]
    assert found, values
    return found


@pytest.mark.serial
def test_own_solver_with_directors_is_right_in_every_difficulty(quick):
    """One difficulty at a time; what the pairs add is thin criss-cross and forces in round-off."""
    runs = picked(quick[1], method=DIRECTOR, solver="auto")
    other = [run for run in runs if run["verdict"] != "right"]
    assert all(run["h"] == 1e-4 and run["warned"] for run in other)
    assert re.search(r"director, auto: (\d+) of \1 single difficulties .* end right", quick[2])


@pytest.mark.serial
def test_no_wrong_answer_is_silent(quick):
    """But for other equilibria of a fold that is led by its edge."""
    led = "closed by edge"
    wrong = [r for r in quick[1] if r["verdict"] == "wrong" and r["problem"] != led]
    assert wrong and all(run["warned"] for run in wrong)


@pytest.mark.serial
@pytest.mark.parametrize("mesh", ["criss-cross", "Delaunay", "slivers 2 deg"])
def test_averaged_normals_are_wrong_on_bad_meshes_and_warned_of(quick, mesh):
    """By the patch check, before anything is solved; directors on the same mesh are right."""
    case = {"problem": "cantilever", "h": 0.01, "mesh": mesh}
    for run in picked(quick[1], method="averaged", **case):
        assert run["verdict"] in ("wrong", "failed") and "patch" in run["warned"]
    (right,) = picked(quick[1], method=DIRECTOR, solver="auto", **case)
    assert right["verdict"] == "right" and "patch" not in right["warned"]


@pytest.mark.serial
def test_line_search_fails_where_the_own_solver_needs_few_iterations(quick):
    """A thin cantilever in four steps: steps that lower the energy are short ones."""
    case = {"problem": "cantilever", "mesh": "one-diagonal", "h": 1e-4, "steps": 4}
    for method in ("averaged", DIRECTOR):
        (bt,) = picked(quick[1], method=method, solver="bt", **case)
        (newton,) = picked(quick[1], method=method, solver="newton", **case)
        (own,) = picked(quick[1], method=method, solver="default", **case)
        assert bt["verdict"] == "failed" and bt["reason"] and bt["error"] is None
        assert own["verdict"] == newton["verdict"] == "right"
        assert 3 * own["iterations"] < newton["iterations"]


@pytest.mark.serial
@pytest.mark.parametrize(("mesh", "h"), [("criss-cross", 1e-4), ("Delaunay", 1e-4)])
def test_fem_does_not_lock_where_directors_do(quick, mesh, h):
    case = {"problem": "cantilever", "mesh": mesh, "h": h, "solver": "auto"}
    (locked,) = picked(quick[1], method=DIRECTOR, **case)
    (fem,) = picked(quick[1], method="fem", **case)
    assert locked["verdict"] != "right" and locked["warned"]
    assert fem["verdict"] == "right" and fem["error"] < 0.01 and not fem["warned"]


@pytest.mark.serial
def test_forces_lost_in_round_off_are_announced(quick):
    case = {"problem": "z-fold", "eta": 1e-6}
    for run in picked(quick[1], h=1e-4, **case):
        assert "round-off" in run["warned"]
    for run in picked(quick[1], h=1e-2, **case):
        assert "round-off" not in run["warned"] and run["verdict"] == "right"


@pytest.mark.serial
def test_folds_close_beyond_half_a_turn(quick):
    for drive in ("rest angle", "moment", "edge"):
        case = {"problem": f"closed by {drive}", "angle": 200.0, "method": DIRECTOR}
        (run,) = picked(quick[1], solver="auto", **case)
        assert run["verdict"] == "right" and run["error"] < 0.005, drive


@pytest.mark.serial
def test_verdicts_follow_from_errors_and_reasons(quick):
    for run in quick[1]:
        failed = run["verdict"] == "failed"
        assert failed == bool(run["reason"]) == (run["error"] is None)
        assert failed == (run["reached"] < 1.0)
        assert failed or (run["error"] <= 0.03) == (run["verdict"] == "right")


@pytest.mark.serial
def test_text_lists_and_counts_what_the_table_holds(quick):
    folder, runs, console = quick
    text = (folder / "failure_map.md").read_text()
    assert text.strip() in console
    assert f"{len(runs)} cases: " in text
    with (folder / "failure_map.csv").open(newline="") as stream:
        rows = [*csv.DictReader(stream)]
    assert [row["verdict"] for row in rows] == [run["verdict"] for run in runs]
    for method in {run["method"] for run in runs}:
        for solver in ("newton", "bt", *OWN):
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
    files = sorted(quick[0].glob("*.png"))
    assert [f.stem for f in files] == ["failure_map", "failure_map_pair1", "failure_map_pair2"]
    for file in files:
        pixels = imread(file)[..., :3]
        filled = (np.abs(pixels - 1.0) > 0.05).any(axis=2)
        assert 0.2 < filled.mean() < 0.8


@pytest.mark.slow
@pytest.mark.serial
def test_two_ranks_find_the_same(quick, tmp_path):
    """The same grid; the same errors but where round-off decides (thin, or led by an edge)."""
    demo(tmp_path, "--quick", ranks=2)
    two = json.loads((tmp_path / "summary.json").read_text())["runs"]
    keys = ("problem", "mesh", "h", "eta", "steps", "angle", "method", "solver", "triangles")
    assert [[run[k] for k in keys] for run in two] == [[run[k] for k in keys] for run in quick[1]]
    own = [(a, b) for a, b in zip(quick[1], two, strict=True) if a["solver"] == "auto"]
    steady = [pair for pair in own if pair[0]["h"] == 0.01]
    steady = [pair for pair in steady if pair[0]["problem"] != "closed by edge"]
    assert len(steady) > 20
    for one, other in steady:
        assert one["error"] == pytest.approx(other["error"], abs=1e-5)
        assert (one["verdict"], one["warned"]) == (other["verdict"], other["warned"])


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
