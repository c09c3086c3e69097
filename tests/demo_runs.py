"""Demos and scripts as a user starts them, in processes of their own."""

import os
import subprocess
import sys
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]


def run_python(*words, ranks=1, timeout=60):
    """Run Python; its processes must not take this process for their launcher's child."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("PMIX_", "PRTE_", "OMPI_"))}
    env |= {k: v for k, v in os.environ.items() if k.startswith(("OMPI_ALLOW", "OMPI_MCA_btl"))}
    env["PYTHONPATH"] = f"{REPO}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    env["OMPI_MCA_mpi_yield_when_idle"] = "1"  # the ranks may share cores with others
    mpirun = ["mpirun", "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
    command = [*mpirun, sys.executable, *words]
    return subprocess.run(command, env=env, capture_output=True, text=True, timeout=timeout)


def run_demo(name, folder, *words, ranks=1, timeout=300):
    """Run a demo with its output in a folder."""
    script = str(REPO / "demos" / f"{name}.py")
    return run_python(script, *words, "--output", str(folder), ranks=ranks, timeout=timeout)
