"""The Z-fold demo as a user runs it: its summary, files and figures, on one and two ranks."""

import json
import time

import numpy as np
import pytest
from demo_runs import run_demo
from matplotlib.image import imread

from ufl_origami.history import read_history

pytestmark = pytest.mark.serial  # each test starts its own processes

KEYS = (
    "model bending eta d1 nu h size triangles dofs fold_angle_deg fold_angle_mid_deg force energy "
    "energy_membrane energy_bending energy_crease newton_iterations seconds"
).split()
ELASTICA_KEYS = ["elastica_fold_angle_deg", "elastica_force"]


def demo(folder, *words, ranks=1):
    return run_demo("zfold_tension", folder, *words, ranks=ranks)


def summary(done, folder):
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "summary.json").read_text())["runs"]


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Folder, run and console of the quick demo."""
    folder = tmp_path_factory.mktemp("zfold")
    done = demo(folder, "--quick")
    runs = summary(done, folder)
    assert len(runs) == 1
    return folder, runs[0], done.stdout


def test_quick_run_has_all_keys(quick):
    run = quick[1]
    assert list(run) == KEYS + ELASTICA_KEYS
    names = {"model": "ddg", "bending": "director", "eta": 0.5, "d1": 1.0, "nu": 0.0, "h": 0.01}
    assert {key: run[key] for key in names} == names
    assert run["triangles"] < 3000


def test_quick_run_agrees_with_the_elastica(quick):
    run = quick[1]
    assert run["elastica_fold_angle_deg"] == pytest.approx(52.432, abs=1e-3)
    assert run["fold_angle_deg"] == pytest.approx(run["elastica_fold_angle_deg"], abs=0.1)
    assert run["fold_angle_mid_deg"] == pytest.approx(run["elastica_fold_angle_deg"], abs=0.1)
    assert run["force"] == pytest.approx(run["elastica_force"], rel=0.01)


def test_energy_is_bending_and_crease_and_hardly_membrane(quick):
    run = quick[1]
    parts = [run[f"energy_{kind}"] for kind in ("membrane", "bending", "crease")]
    assert sum(parts) == pytest.approx(run["energy"], rel=1e-12)
    assert 0 < parts[0] < 1e-3 * run["energy"]
    turned = np.radians(run["fold_angle_deg"] - 35.6)
    stiffness = run["eta"] * 1e7 * run["h"] ** 3
    assert parts[2] == pytest.approx(0.5 * stiffness * turned**2, rel=1e-3)


def test_history_and_fields_are_written(quick):
    folder, run, _ = quick
    case = folder / "director_nu0_eta0.5"
    history = read_history(case / "history.csv")
    assert history["load_factor"][-1] == 1.0
    assert history["newton_iterations"].sum() == run["newton_iterations"]
    assert history["energy_total"][-1] == pytest.approx(run["energy"], rel=1e-12)
    assert history["included_virtual_crease"][-1] == pytest.approx(run["fold_angle_deg"])
    assert any(case.glob("fields.*"))


def is_drawn(file):
    """Whether a picture has ink in each of its quarters and is not all ink."""
    pixels = imread(file)[..., :3].mean(axis=2)
    ink = pixels < 0.95
    middle = [n // 2 for n in ink.shape]
    quarters = [q for half in np.split(ink, middle[:1]) for q in np.split(half, middle[1:], 1)]
    return all(q.mean() > 0.002 for q in quarters) and ink.mean() < 0.6


def test_figures_of_one_case_are_drawn(quick):
    folder = quick[0]
    assert sorted(f.stem for f in folder.glob("*.png")) == ["profiles", "sheet"]
    assert all(is_drawn(file) for file in folder.glob("*.png"))


def test_console_shows_the_case_and_the_claim(quick):
    out = quick[2]
    assert "fold_angle_deg" in out and "newton_iterations" in out
    assert "from the elastica (1 runs)" in out


def test_single_values_are_one_case_the_same_on_two_ranks(tmp_path):
    """On a coarse mesh, which the claim leaves out."""
    words = "--eta 20 --d1 1.2 --nu 0.3 --size 0.25 --mesh structured --h 0.02".split()
    done = [demo(tmp_path / f"{ranks}", *words, ranks=ranks) for ranks in (1, 2)]
    (one,), (two,) = (summary(d, tmp_path / f"{n}") for d, n in zip(done, (1, 2), strict=True))
    given = {"eta": 20, "d1": 1.2, "nu": 0.3, "size": 0.25, "h": 0.02, "bending": "director"}
    assert {key: one[key] for key in given} == given
    assert list(one) == list(two) == KEYS
    assert 35.6 < one["fold_angle_deg"] < 38.0
    for key in set(one) - {"seconds", "newton_iterations"}:
        expected = pytest.approx(one[key], rel=1e-6) if isinstance(one[key], float) else one[key]
        assert two[key] == expected, key
    assert abs(two["newton_iterations"] - one["newton_iterations"]) <= 1
    assert done[1].stdout.count("summary.json and the figures") == 1
    assert sorted(f.stem for f in (tmp_path / "2").glob("*.png")) == ["profiles", "sheet"]


def test_several_values_are_all_combined_and_drawn(tmp_path):
    words = "--eta 0.1 10 --d1 0.3 0.6 --size 0.2 --mesh structured".split()
    done = demo(tmp_path, *words)
    runs = summary(done, tmp_path)
    cases = {(r["bending"], r["nu"], r["eta"], r["d1"]) for r in runs}
    assert len(runs) == len(cases) == 16
    by_nu = {nu: [r for r in runs if r["nu"] == nu] for nu in (0.0, 0.3)}
    assert all("elastica_force" in r for r in by_nu[0.0])
    assert not any("elastica_force" in r for r in by_nu[0.3])
    expected = ["difference", "fold_angle", "force", "openings", "profiles", "sheet"]
    assert sorted(f.stem for f in tmp_path.glob("*.png")) == expected
    assert all(is_drawn(file) for file in tmp_path.glob("*.png"))
    for run in by_nu[0.0]:  # iterations and seconds add up along the path
        before = [r for r in runs if r["d1"] == 0.3 and r["d1"] < run["d1"]]
        same = [r for r in before if all(r[k] == run[k] for k in ("bending", "nu", "eta"))]
        assert all(r["newton_iterations"] < run["newton_iterations"] for r in same)


def test_wrong_values_end_with_the_usage(tmp_path):
    done = demo(tmp_path, "--d1", "-1")
    assert done.returncode == 2 and "usage: ./run demo zfold_tension" in done.stderr


@pytest.mark.slow
def test_the_fem_model_gives_the_same_outputs_on_two_ranks(tmp_path):
    """One case with the model's own mesh, near the elastica; ddg's choice is left empty."""
    done = demo(tmp_path, "--quick", "--model", "fem", ranks=2)
    (run,) = summary(done, tmp_path)
    assert list(run) == KEYS + ELASTICA_KEYS
    assert (run["model"], run["bending"]) == ("fem", None)
    assert run["triangles"] < 200
    assert run["fold_angle_deg"] == pytest.approx(run["elastica_fold_angle_deg"], abs=0.01)
    assert run["force"] == pytest.approx(run["elastica_force"], rel=1e-3)
    assert sorted(f.stem for f in tmp_path.glob("*.png")) == ["profiles", "sheet"]
    assert len(read_history(tmp_path / "fem_nu0_eta0.5" / "history.csv")) > 1
    assert "fem, nu = 0: at most" in done.stdout


def test_a_bending_form_of_another_model_is_refused(tmp_path):
    done = demo(tmp_path, "--quick", "--model", "fem", "--bending", "director")
    assert done.returncode == 1
    assert done.stderr == "zfold_tension.py: --bending is a choice of the ddg model\n"


@pytest.mark.slow
def test_whole_study_holds_its_claim_in_time(tmp_path):
    start = time.perf_counter()
    runs = summary(demo(tmp_path), tmp_path)
    seconds = time.perf_counter() - start
    judged = [r for r in runs if r["bending"] == "director" and r["nu"] == 0]
    assert len(judged) == 36 and {r["eta"] for r in judged} >= {1e-3, 0.01, 0.5, 100.0}
    for run in judged:
        assert run["fold_angle_deg"] == pytest.approx(run["elastica_fold_angle_deg"], abs=0.1)
        assert run["force"] == pytest.approx(run["elastica_force"], rel=0.01)
    assert {"convergence", "profiles"} <= {f.stem for f in tmp_path.glob("*.png")}
    assert seconds < 240
    start = time.perf_counter()
    summary(demo(tmp_path / "quick", "--quick"), tmp_path / "quick")
    assert time.perf_counter() - start < 20


@pytest.mark.slow
def test_whole_study_of_the_fem_model_holds_its_claim(tmp_path):
    runs = summary(demo(tmp_path, "--model", "fem"), tmp_path)
    judged = [r for r in runs if r["nu"] == 0]
    assert len(runs) == 72 and len(judged) == 36
    for run in judged:
        assert run["fold_angle_deg"] == pytest.approx(run["elastica_fold_angle_deg"], abs=0.1)
        assert run["force"] == pytest.approx(run["elastica_force"], rel=0.01)
    figures = {f.stem for f in tmp_path.glob("*.png")}
    assert figures == {
        "convergence", "difference", "fold_angle", "force", "openings", "profiles", "sheet",
    }  # fmt: skip
