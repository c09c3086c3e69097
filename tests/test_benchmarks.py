"""The benchmarks run, their shares add up, and their files say on what they ran."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def rows_of(name, tmp_path, *options):
    file = tmp_path / "figures.json"
    command = [sys.executable, str(BENCHMARKS / name), "--quick", "--repeats", "1", *options]
    environment = os.environ | {"PYTHONPATH": str(BENCHMARKS.parent)}
    done = subprocess.run(
        [*command, "--output", str(file)], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    data = json.loads(file.read_text())
    assert data["machine"]["ranks"] == 1
    assert data["machine"]["processor"]
    assert len(done.stdout.splitlines()) == 2 + len(data["rows"])
    return data["rows"]


@pytest.mark.serial
def test_assembly(tmp_path):
    rows = rows_of("assembly.py", tmp_path)
    assert {row["bending"] for row in rows} == {"averaged", "director"}
    for row in rows:
        assert row["sum us"] == pytest.approx(row["kernels us"] + row["insertion us"])
        assert 0 < row["kernels cpu us"] <= 1.05 * row["kernels us"]
        assert row["residual us"] > 0


@pytest.mark.serial
def test_newton_iteration(tmp_path):
    for row in rows_of("newton_iteration.py", tmp_path):
        assert row["dofs"] == pytest.approx(10_000, rel=0.1)
        assert row["assembly %"] + row["factor %"] + row["rest %"] == pytest.approx(100)
        stages = ("residual s", "kernels s", "insertion s", "constraints s", "factor s", "solve s")
        assert row["iteration s"] == pytest.approx(sum(row[stage] for stage in stages))


@pytest.mark.serial
def test_time_step(tmp_path):
    rows = {row["scene"]: row for row in rows_of("time_step.py", tmp_path)}
    for row in rows.values():
        assert row["dofs"] == pytest.approx(1_000, rel=0.2)
        assert row["assembly %"] + row["factor %"] + row["rest %"] == pytest.approx(100)
        kinds = [row[f"{kind} %"] for kind in ("gravity", "contact", "friction", "magnetic")]
        assert row["surroundings %"] == pytest.approx(sum(kinds))
        assert 0 < row["book %"] < 50
    assert rows["free"]["surroundings %"] == 0
    assert min(rows["all, implicit"][f"{kind} %"] for kind in ("contact", "friction")) > 0
    assert rows["gravity"]["contact %"] == rows["contact"]["friction %"] == 0


def twin_and_others(rows):
    """Errors w and u in percent of the fem model, and of each other formulation by its name."""
    errors = {row["formulation"]: (abs(row["w %"]), abs(row["u %"])) for row in rows}
    assert all(row["tangent ms"] > 0 and row["iterations"] >= row["steps"] for row in rows)
    return errors.pop("twin"), errors


@pytest.mark.serial
def test_fem_formulations_coarse_and_thin(tmp_path):
    case = ["--mesh", "structured", "--n", "1", "--thinness", "1e-3"]
    names = ["--formulation", "twin", "naghdi"]
    twin, others = twin_and_others(rows_of("fem_formulations.py", tmp_path, *case, *names))
    assert max(twin) < 0.02
    assert min(others["naghdi"]) > 20 * max(twin)
    assert max(others["naghdi"]) < 3


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("mesh", ["structured", "unstructured"])
def test_fem_formulations_against_locking(tmp_path, mesh):
    """At h / L = 1e-4, one element across, only the fem model has both errors within 1 %."""
    case = ["--mesh", mesh, "--n", "1", "--thinness", "1e-4"]
    twin, others = twin_and_others(rows_of("fem_formulations.py", tmp_path, *case))
    assert max(twin) < 0.2
    for name, (w, u) in others.items():
        assert u > 1 and w > 5 * max(twin), name
    assert others["hhj_regge"] < others["hhj"]


@pytest.mark.serial
def test_critical_loads(tmp_path):
    rows = rows_of("critical_loads.py", tmp_path, "--problem", "column", "crease", "blade")
    assert {row["model"] for row in rows} == {"ddg", "fem"}
    assert len({row["problem"] for row in rows}) == 9
    for row in rows:
        limit = 0.5 if row["model"] == "fem" else 6.0
        assert abs(row["error %"]) < limit, row
        exact = row["exact"] * (1 + row["error %"] / 100)
        assert row["critical load"] == pytest.approx(exact)
        assert row["evaluations"] > 2
