"""The speed benchmarks run, their shares add up, and their files say on what they ran."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def rows_of(name, tmp_path):
    file = tmp_path / "figures.json"
    command = [sys.executable, str(BENCHMARKS / name), "--quick", "--repeats", "1"]
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
