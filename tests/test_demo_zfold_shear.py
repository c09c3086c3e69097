"""The demo of the Z-fold in shear: branches, their symmetry and stability, both models, files."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial  # each test starts its own processes

REPO = Path(__file__).resolve().parent.parent
KEYS = (
    "model eta nu h size branch side d2 energy z_a z_b force_x force_y unstable_directions"
).split()


def demo(folder, *words, ranks=1):
    """Run the demo; its processes must not take this process for their launcher's child."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("PMIX_", "PRTE_", "OMPI_"))}
    env |= {k: v for k, v in os.environ.items() if k.startswith(("OMPI_ALLOW", "OMPI_MCA_btl"))}
    env["PYTHONPATH"] = f"{REPO}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    mpirun = ["mpirun", "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
    command = [*mpirun, sys.executable, str(REPO / "demos" / "zfold_shear.py"), *words]
    command += ["--output", str(folder)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "summary.json").read_text())["runs"], done.stdout


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Runs by model, branch and d2, console and folder of the quick demo."""
    folder = tmp_path_factory.mktemp("zfold_shear")
    runs, out = demo(folder, "--quick")
    assert all(list(run) == KEYS for run in runs)
    found = {(run["model"], run["branch"], run["d2"]): run for run in runs}
    assert len(found) == len(runs) == 6
    return found, out, folder


@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_the_symmetric_branch_loses_its_stability_to_a_broken_one_of_less_energy(quick, model):
    found = quick[0]
    before, beyond = (found[model, "symmetric", d2] for d2 in (0.05, 0.12))
    broken = found[model, "broken", 0.12]
    assert (model, "broken", 0.05) not in found
    assert [run["unstable_directions"] for run in (before, beyond, broken)] == [0, 1, 0]
    for run in (before, beyond):
        assert run["z_a"] == pytest.approx(run["z_b"], abs=1e-8)
    assert abs(broken["z_a"] - broken["z_b"]) > 0.15
    assert broken["energy"] < 0.96 * beyond["energy"]


@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_energy_grows_by_the_work_of_the_shearing_force(quick, model):
    """dE/dd2 = F_y: between the two stops F_y bends over, so that its mean is above the ends'."""
    before, beyond = (quick[0][model, "symmetric", d2] for d2 in (0.05, 0.12))
    slope = (beyond["energy"] - before["energy"]) / 0.07
    assert 0.5 * (before["force_y"] + beyond["force_y"]) < slope < beyond["force_y"]
    broken = quick[0][model, "broken", 0.12]
    assert broken["force_y"] < 0.8 * beyond["force_y"]


@pytest.mark.parametrize(
    ("branch", "d2"), [("symmetric", 0.05), ("symmetric", 0.12), ("broken", 0.12)]
)
def test_the_models_agree(quick, branch, d2):
    """Both meshes are coarse: one per cent in energy, one in heights, three in the force."""
    ddg, fem = (quick[0][model, branch, d2] for model in ("ddg", "fem"))
    assert ddg["energy"] == pytest.approx(fem["energy"], rel=0.015)
    heights = [sorted((run["z_a"], run["z_b"])) for run in (ddg, fem)]
    assert heights[0] == pytest.approx(heights[1], abs=0.01)
    assert ddg["force_y"] == pytest.approx(fem["force_y"], rel=0.03)


def test_console_judges_the_account_and_figures_are_drawn(quick):
    _, out, folder = quick
    for model in ("ddg", "fem"):
        assert f"{model}, eta = 0.5: they part at the very onset of d2: contradicted" in out
        assert f"{model}, eta = 0.5: there are two modes, and each is stable" in out
    assert (folder / "findings.txt").read_text() in out
    case = "eta0.5_nu0.3"
    names = {f"{branch}_{m}_{case}" for branch in ("symmetric", "broken") for m in ("ddg", "fem")}
    names |= {f"profiles_{model}_{case}" for model in ("ddg", "fem")}
    assert {file.stem for file in folder.glob("*.png")} == names | {"paths"}


@pytest.mark.slow
def test_without_stiffness_there_are_three_families_on_two_ranks(tmp_path):
    """Unperturbed panels bulge down and stay symmetric, stable and lowest in energy at first."""
    words = "--quick --model ddg --eta 0 --d2 0.03 --size 0.25".split()
    runs, out = demo(tmp_path, *words, ranks=2)
    found = {run["branch"]: run for run in runs}
    assert set(found) == {"symmetric", "arched", "broken"} and len(runs) == 3
    unstable = {name: run["unstable_directions"] for name, run in found.items()}
    assert unstable == {"symmetric": 0, "arched": 1, "broken": 0}
    for name in ("symmetric", "arched"):
        assert found[name]["z_a"] == pytest.approx(found[name]["z_b"], abs=1e-8)
    assert abs(found["broken"]["z_a"] - found["broken"]["z_b"]) > 0.01
    assert found["symmetric"]["energy"] < found["broken"]["energy"] < found["arched"]["energy"]
    assert out.count("summary.json, findings.txt and the figures") == 1
