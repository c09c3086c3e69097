"""Cantilever under a dead transverse force at its end (Sze, Liu & Lo 2004), without crease."""

from mpi4py import MPI

from ufl_origami.cross_quantities import Displacement, Energy, Profile
from ufl_origami.cross_validation import CrossScene, register
from ufl_origami.gallery.shell_problems import Form, cantilever_shear
from ufl_origami.scene import Scene

LENGTH = 10.0


def sheared(model: str, size: float, comm: MPI.Comm) -> Scene:
    """The cantilever; the size is that of the triangles over its width."""
    form = Form("unstructured", model=model, comm=comm)
    return cantilever_shear(round(1 / size), form).scene


register(
    CrossScene(
        name="cantilever_shear",
        make=sheared,
        sizes={"ddg": 0.25, "fem": 0.5},
        stops=(0.25, 0.5, 1.0),
        quantities=(
            Displacement("x1y0", "x", LENGTH, tolerance=2e-4),
            Displacement("x1y0", "z", LENGTH, tolerance=2e-4),
            Energy("total", tolerance=5e-4),
            Energy("bending", tolerance=5e-4),
            Profile("y0", width=LENGTH, tolerance=2e-4),
        ),
        quick=True,
    )
)
