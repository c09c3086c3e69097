"""The tests of several ranks once more on three, which cut sheets otherwise; one start for all."""

from pathlib import Path

import pytest
from demo_runs import run_python

pytestmark = pytest.mark.serial  # each test starts its own processes

SAME = "test_ranks_together_and_one_rank_alone_give_the_same_answer"
ALIKE = "test_ranks_together_and_one_rank_alone_move_alike"


def assert_passed(count, *tests):
    """Run tests of this folder on three ranks, each of which must pass."""
    folder = Path(__file__).parent
    words = [
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        *(f"{folder}/{test}" for test in tests),
    ]
    done = run_python(*words, ranks=3, timeout=600)
    assert done.returncode == 0, done.stdout[-2000:]
    assert done.stdout.count(f"{count} passed") == 3


def test_three_ranks_agree_too():
    assert_passed(5, f"test_parallel.py::{SAME}", f"test_time_run.py::{ALIKE}[ddg]")


@pytest.mark.slow
def test_three_ranks_agree_on_the_fem_model_too():
    assert_passed(3, f"test_fem_parallel.py::{SAME}")
