"""Check a new environment: every module loads, dolfinx is recent, BLAS is OpenBLAS."""

import importlib
from pathlib import Path

names = ["dolfinx", "petsc4py.PETSc", "slepc4py.SLEPc", "mpi4py.MPI", "gmsh", "numba", "pyvista"]
names += ["scipy.linalg", "matplotlib", "h5py", "tqdm", "rich", "yaml", "pytest", "pip"]
modules = {name: importlib.import_module(name) for name in names}
version = modules["dolfinx"].__version__
if tuple(int(part) for part in version.split(".")[:2]) < (0, 9):
    raise SystemExit(f"dolfinx {version} is older than 0.9")
maps = Path("/proc/self/maps").read_text()
blas = {line.split()[-1] for line in maps.splitlines() if "blas" in line}
if not any("openblas" in path for path in blas):
    raise SystemExit(f"the linear algebra library is not OpenBLAS: {sorted(blas)}")
print("dolfinx", version, "with", *sorted(blas))
