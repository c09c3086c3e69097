"""What demos share: options, summary, arrays gathered on rank 0, the end of a failing run."""

import json
from pathlib import Path

import numpy as np
import pytest
from demo_runs import run_python
from scenes import build, follow, z_fold_scene

from ufl_origami.demo import print_table, read_options, write_summary
from ufl_origami.gather import gather_fold_angles, gather_profile, gather_sheet
from ufl_origami.run import solve_static

DEFAULTS = {"model": "ddg", "bending": ("director", "averaged"), "eta": (0.1, 1.0), "h": 0.01}


def read(*words, **quick):
    return read_options("fold", "A fold.", DEFAULTS, quick=quick, argv=words)


@pytest.mark.mpi
def test_options_not_given_have_their_defaults():
    options = read()
    assert options.eta == (0.1, 1.0) and options.h == 0.01 and not options.quick
    assert options.bending == ("director", "averaged") and options.given == set()
    assert options.output == Path("output/fold")


@pytest.mark.mpi
def test_given_options_win_over_quick_ones_and_these_over_defaults():
    options = read("--quick", "--h", "0.02", "--bending", "averaged", eta=(3.0,), h=0.5)
    assert options.eta == (3.0,) and options.h == 0.02 and options.bending == ("averaged",)
    assert options.given == {"quick", "h", "bending"}


@pytest.mark.mpi
def test_one_option_takes_several_values():
    assert read("--eta", "0", "1e-3", "5").eta == (0.0, 1e-3, 5.0)
    assert read("--eta", "2").eta == (2.0,)


@pytest.mark.mpi
@pytest.mark.parametrize(
    "words",
    [
        ("--eta", "-1"),
        ("--eta", "nan"),
        ("--eta", "inf"),
        ("--eta",),
        ("--h", "0"),
        ("--bending", "bent"),
        ("--model", "exact"),
        ("--nu", "0.3"),
    ],
    ids=" ".join,
)
def test_wrong_options_end_all_ranks_with_code_2(words, comm):
    with pytest.raises(SystemExit) as stop:
        read(*words)
    assert comm.allgather(stop.value.code) == [2] * comm.size


@pytest.mark.serial
def test_help_names_what_quick_replaces_and_nothing_where_it_replaces_nothing(capsys):
    for quick, text in (
        ({"eta": (3.0,), "h": 0.5}, "a short run: eta 3.0, h 0.5"),
        ({}, "a short run"),
    ):
        with pytest.raises(SystemExit) as stop:
            read("--help", **quick)
        assert stop.value.code == 0
        assert " ".join(capsys.readouterr().out.split()).endswith(f"--quick {text}")


@pytest.mark.serial
def test_summary_refuses_numbers_that_json_lacks(tmp_path):
    file = write_summary(tmp_path / "new", [{"eta": 0.1}, {"eta": 1.0}])
    assert json.loads(file.read_text()) == {"runs": [{"eta": 0.1}, {"eta": 1.0}]}
    with pytest.raises(ValueError, match="JSON"):
        write_summary(tmp_path / "new", [{"force": float("nan")}])
    assert json.loads(file.read_text())["runs"][0]["eta"] == 0.1


@pytest.mark.serial
def test_table_aligns_columns_and_marks_missing_values(capsys):
    print_table([{"eta": 0.01, "force": 2.0}, {"eta": 100.0}], {"eta": "g", "force": ".2f"})
    assert capsys.readouterr().out == " eta  force\n0.01   2.00\n 100      -\n"


@pytest.fixture(scope="module")
def pulled():
    model = build(z_fold_scene(0.2, 0.5))
    follow(model)
    return model


@pytest.mark.mpi
def test_gathered_sheet_has_the_panels_area_and_the_crease(pulled, comm):
    shape = gather_sheet(pulled)
    assert (shape is None) == (comm.rank > 0)
    if shape is None:
        return
    a, b, c = np.asarray(shape.points)[np.asarray(shape.triangles)].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(2.0, rel=5e-3)
    ends = np.asarray(shape.points)[np.asarray(shape.crease_edges)]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(1.0, rel=1e-3)
    assert np.ptp(ends[..., 0]) < 1e-2 < np.ptp(ends[..., 1])


@pytest.mark.mpi
def test_gathered_profile_runs_from_edge_to_edge(pulled, comm):
    found = gather_profile(pulled, "front")
    assert (found is None) == (comm.rank > 0)
    if found is None:
        return
    rest, now = found
    assert (np.diff(rest[:, 0]) > 0).all() and (rest[:, 1] == 0).all()
    assert now[0] == pytest.approx(rest[0], abs=1e-14)
    assert now[-1] == pytest.approx(rest[-1] + [1.0, 0.0, 0.0], abs=1e-14)
    length = np.linalg.norm(np.diff(now, axis=0), axis=1).sum()
    assert length == pytest.approx(2.0, rel=5e-3)


@pytest.mark.mpi
def test_gathered_fold_angles_are_ordered_and_have_the_mean(pulled, comm):
    angles = gather_fold_angles(pulled, "crease")
    assert (np.diff(angles.middle[:, 1]) > 0).all()
    assert angles.length.sum() == pytest.approx(1.0, rel=1e-12)
    mean = np.average(angles.virtual, weights=angles.length)
    assert mean == pytest.approx(pulled.mean_fold_angle("crease"), rel=1e-12)
    assert len(set(comm.allgather(angles.virtual.tobytes()))) == 1


@pytest.mark.mpi
def test_on_accept_sees_each_step_in_its_state():
    seen = []
    model = build(z_fold_scene(0.25, 0.5))
    result = solve_static(
        model,
        [0.25, 0.5],
        on_accept=lambda step, m: seen.append((step, m.problem.time, m.reaction("right_edge")[0])),
    )
    assert [step for step, *_ in seen] == result.steps
    assert [time for _, time, _ in seen] == [step.time for step in result.steps]
    assert [force for *_, force in seen] == list(result.history["reaction_right_edge_x"])


FAILING = """
from mpi4py import MPI
from ufl_origami.demo import fail_together
from ufl_origami.errors import {kind}
fail_together()
if MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1:
    raise {kind}("crease 'c' is missing")
MPI.COMM_WORLD.Barrier()
"""


@pytest.mark.serial
def test_wrong_input_ends_in_one_line():
    done = run_python("-c", FAILING.format(kind="SceneError"))
    assert done.returncode == 1 and done.stderr == "-c: crease 'c' is missing\n"


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["SolveError", "SceneError"])
def test_a_rank_that_fails_alone_ends_the_run(kind):
    done = run_python("-c", FAILING.format(kind=kind), ranks=2)
    assert done.returncode != 0
    assert "crease 'c' is missing" in done.stderr
