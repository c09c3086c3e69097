"""What a moving sheet has beside its shape: masses, rates, momentum."""

from petsc4py import PETSc

import numpy as np

from ufl_origami.configuration import Configuration
from ufl_origami.terms.form import SheetFunctions
from ufl_origami.terms.inertia import InertiaTerm, Mass


class Motion:
    """Masses of a model with the rates of its current state.

    Args:
        configuration: numbering of the unknowns.
        functions: the scene's shared functions.
        mass: mass matrix.

    Attributes:
        v: rates of the unknowns.
        inertia: term of the time steps.
    """

    def __init__(self, configuration: Configuration, functions: SheetFunctions, mass: Mass):
        self.configuration, self.mass = configuration, mass
        self.inertia = InertiaTerm(mass)
        self.v = configuration.create_vector()
        self._dofs = functions.dofs.reshape(-1, 3)
        self._rest = functions.V.tabulate_dof_coordinates()

    def product(self, first: PETSc.Vec, second: PETSc.Vec) -> float:
        """First . M second; collective."""
        local = self.configuration.to_local
        return float(self.configuration.sum(self.mass.product(local(first), local(second))))

    def kinetic_energy(self, v: PETSc.Vec | None = None) -> float:
        """Half of v . M v, of the current rates by default; collective."""
        v = self.v if v is None else v
        return 0.5 * self.product(v, v)

    @property
    def total_mass(self) -> float:
        """Mass of everything that moves; collective."""
        ones = np.zeros(self.configuration.num_local)
        ones[self._dofs[:, 0]] = 1.0
        return float(self.configuration.sum(self.mass.product(ones, ones)))

    def momentum(self) -> np.ndarray:
        """Linear momentum (3,); collective."""
        return self.configuration.sum(self._momenta().sum(axis=0))

    def centre(self, x: PETSc.Vec) -> np.ndarray:
        """Centre of mass (3,) at unknowns x; collective."""
        values = np.zeros(self.configuration.num_local)
        values[self._dofs] = self._places(x)
        share = self.mass.times(values)[self._dofs].sum(axis=0)
        return self.configuration.sum(share) / self.total_mass

    def angular_momentum(self, x: PETSc.Vec, about=(0.0, 0.0, 0.0)) -> np.ndarray:
        """Angular momentum (3,) about a point at unknowns x; collective."""
        arms = self._places(x) - np.asarray(about)
        return self.configuration.sum(np.cross(arms, self._momenta()).sum(axis=0))

    def _momenta(self) -> np.ndarray:
        """This rank's share (nd, 3) of the nodes' momenta."""
        return self.mass.times(self.configuration.to_local(self.v))[self._dofs]

    def _places(self, x: PETSc.Vec) -> np.ndarray:
        """Current places (nd, 3) of the nodes."""
        return self._rest + self.configuration.to_local(x)[self._dofs]
