"""Print what this python3 lacks to run the project; print nothing when it has all."""

import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

MODULES = (
    *("dolfinx", "petsc4py", "slepc4py", "mpi4py", "gmsh", "numba", "scipy", "matplotlib"),
    *("h5py", "pyvista", "tqdm", "pytest", "xdist"),
)
OLDEST = (0, 9)
OLDEST_PYTHON = (3, 11)


def dolfinx_version():
    """Return the version of dolfinx as text, without importing it where that is possible."""
    try:
        return version("fenics-dolfinx")
    except PackageNotFoundError:
        import dolfinx

        return dolfinx.__version__


def problem():
    """Return one line on what is missing, or an empty string."""
    if sys.version_info[:2] < OLDEST_PYTHON:
        return f"python3 is {sys.version.split()[0]}, older than 3.11"
    missing = [name for name in MODULES if find_spec(name) is None]
    if missing:
        return "python3 lacks " + ", ".join(missing)
    found = dolfinx_version()
    if tuple(int(part) for part in found.split(".")[:2]) < OLDEST:
        return f"python3 has dolfinx {found}, older than 0.9"
    return ""


if __name__ == "__main__":
    print(problem(), end="")
