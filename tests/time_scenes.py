"""Small scenes that move, their vibration modes, and how they swing."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from scipy import linalg
from scipy.sparse import csr_matrix

import ufl_origami as uo
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.surroundings import make_motion

PLAIN = uo.Record(fields="none")
SHARP = uo.NewtonSettings(rtol=1e-12, floor=10.0)
"""Newton goes on until round-off, so that what is left is the scheme's."""
ALONE = MPI.COMM_SELF


def fixed(step):
    return uo.TimeSettings(step=step, fixed=True)


def free_square(model, comm=ALONE, *, n=(2, 2), E=1e4):
    """Unit square that nothing holds; its mass is 0.05."""
    material = uo.Material(E, 0.3, 0.05, rho=1.0)
    return uo.Scene(rectangle(1.0, 1.0, n=n, comm=comm), material, model=model)


def strip(model, comm=ALONE, *, n=(4, 1)):
    """Cantilever 1 x 0.25, clamped at x = 0."""
    sheet = rectangle(1.0, 0.25, n=n, comm=comm)
    scene = uo.Scene(sheet, uo.Material(1e4, 0.3, 0.05, rho=1.0), model=model)
    scene.fix("x0")
    scene.clamp("x0")
    return scene


def folded(model, comm=ALONE, *, size=0.5, spring=0.02, angle=100.0, E=1e4):
    """Two unit panels with a crease between that include an angle (degrees), free."""
    pattern = uo.gallery.z_fold(included_angle=angle)
    sheet = uo.mesh_pattern(pattern, size, structure="structured", comm=comm)
    scene = uo.Scene(sheet, uo.Material(E, 0.3, 0.05, rho=1.0), model=model)
    scene.crease("crease", spring)
    return scene


def flap(model, comm=ALONE, **options):
    """Two panels in a plane with a crease between, the left one held."""
    scene = folded(model, comm, angle=180.0, **options)
    scene.fix("left")
    return scene


def landing(comm=ALONE, model="ddg", *, sideways=0.5):
    """Folded sheet that comes down on a floor and slides, its left panel magnetic."""
    scene = folded(model, comm)
    scene.gravity((0.0, 0.0, -1.0))
    scene.obstacle("floor", uo.Plane((0.0, 0.0, -0.7)), uo.suggest_barrier(scene, speed=1.0))
    scene.friction("floor", uo.Coulomb(0.3, eps=0.05))
    scene.damping(mass=0.1, stiffness=0.005)
    scene.launch((sideways, 0.1, -0.6))
    scene.magnetise("left", (0.0, 0.0, 1e-7))
    scene.magnetic_field(lambda time: (10 * np.sin(3 * time), 0.0, 0.0))
    return scene


LANDING = uo.TimeSettings(step=0.05, tolerance=5e-3, energy_tolerance=2e-2)


@dataclass(frozen=True)
class Modes:
    """Lowest vibrations of a held scene about its rest state, on one rank.

    Attributes:
        model: the model, at rest unless it was displaced.
        omega: (k,) circular frequencies.
        shapes: (size, k) unknowns, those without mass in equilibrium; unit generalised mass.
        mass: mass matrix (size, size).
        stiffness: tangent (size, size) at rest.
    """

    model: uo.Model
    omega: np.ndarray
    shapes: np.ndarray
    mass: csr_matrix
    stiffness: csr_matrix

    def swing(self, amplitude, step, count, *, mode=0, **options):
        """Let go from a displacement along a mode; the result with the modal coordinate.

        Returns:
            Result, and q + i v / omega (count + 1,) of the mode, over the amplitude.
        """
        model, weights = self.model, self.mass @ self.shapes[:, mode]
        rest, seen = model.x.array_r.copy(), [1.0 + 0.0j]
        model.x.array_w[:] += amplitude * self.shapes[:, mode]

        def note(_, model):
            q = weights @ (model.x.array_r - rest)
            seen.append(
                (q + 1j * (weights @ model.motion.v.array_r) / self.omega[mode]) / amplitude
            )

        options = {"newton": SHARP, "record": PLAIN, "on_accept": note} | options
        result = uo.solve_dynamic(model, [count * step], fixed(step), **options)
        return result, np.array(seen)


def matrices(model):
    """Tangent and mass matrix (size, size) at rest, and the unknowns that nothing holds."""
    motion = make_motion(model.scene, model.configuration, model.functions)
    model.problem.linearise(None, model.x)
    rows, columns, values = model.problem.stiffness(model.x).getValuesCSR()
    free = np.setdiff1d(np.arange(model.num_unknowns), model.problem.constraints.dofs)
    return csr_matrix((values, columns, rows)), motion.mass.matrix, free


def modes(scene, count=1):
    """Lowest modes from the model's own tangent and masses; unknowns without mass follow."""
    model = uo.build(scene)
    stiffness, mass, free = matrices(model)
    heavy = free[mass.diagonal()[free] > 0]
    light = np.setdiff1d(free, heavy)
    k = stiffness.toarray()
    follow = -np.linalg.solve(k[np.ix_(light, light)], k[np.ix_(light, heavy)])
    condensed = k[np.ix_(heavy, heavy)] + k[np.ix_(heavy, light)] @ follow
    m = mass[np.ix_(heavy, heavy)].toarray()
    squares, vectors = linalg.eigh(condensed, m, subset_by_index=(0, count - 1))
    shapes = np.zeros((len(k), count))
    shapes[heavy], shapes[light] = vectors, follow @ vectors
    return Modes(model, np.sqrt(squares), shapes, mass, stiffness)


def momenta(model):
    """Linear and angular momentum (6,)."""
    motion = model.motion
    return np.concatenate([motion.momentum(), motion.angular_momentum(model.x)])


def largest_energy(history):
    """Largest energy of a run, potential ones counted from the start."""
    kinds = [name for name in history.columns if name.startswith("energy_")]
    potential = set(kinds) - {"energy_kinetic", "energy_total"}
    moved = [np.abs(history[kind] - history[kind][0]).max() for kind in potential]
    return max(history["energy_kinetic"].max(), *moved)


def unbalanced(history):
    """Largest imbalance of the energy book over the largest energy."""
    return np.abs(history["imbalance"]).max() / largest_energy(history)


def derivative(times):
    """Weights of the derivative at times[0] of the polynomial through values at the times."""
    powers = np.vander(np.asarray(times) - times[0], increasing=True).T
    return np.linalg.solve(powers, np.eye(len(times))[1])
