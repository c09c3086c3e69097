"""Z-fold in tension: soft to stiff crease, three openings, without and with Poisson's effect."""

from functools import partial

from mpi4py import MPI

from ufl_origami.cross_quantities import Energy, FoldAngle, Profile, Reaction
from ufl_origami.cross_validation import CrossScene, register
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene

E, H = 1e7, 0.01  # Young's modulus; thickness over the width of a panel
ETAS = (0.01, 0.5, 10.0)  # K_r W / (E h^3)
OPENINGS = (0.5, 1.0, 1.2)


def pulled(model: str, size: float, comm: MPI.Comm, *, eta: float, nu: float) -> Scene:
    """The Z-fold whose load factor is the opening d1."""
    scene = Scene(mesh_pattern(z_fold(), size, comm=comm), Material(E, nu, H), model=model)
    scene.crease("crease", eta * E * H**3)
    scene.fix("left_edge")
    scene.move("right_edge", x=1.0, y=0.0, z=0.0)
    return scene


# At d1 = 1.2 ddg is 0.045 deg (eta = 0.5) and 0.8 % of the pull (eta = 10) off the elastica.
QUANTITIES = (
    FoldAngle("crease", 0.06),
    Reaction("right_edge", "x", 0.008),
    *(Energy(kind, 0.004) for kind in ("total", "bending", "crease", "membrane")),
    Profile("front", width=1.0, tolerance=1.2e-3),
)

for nu in (0.0, 0.3):
    for eta in ETAS:
        register(
            CrossScene(
                name=f"z_fold_eta{eta:g}_nu{nu:g}",
                make=partial(pulled, eta=eta, nu=nu),
                sizes={"ddg": 0.042, "fem": 0.25},
                stops=OPENINGS,
                quantities=QUANTITIES,
                quick=(eta, nu) == (0.5, 0.3),
            )
        )
