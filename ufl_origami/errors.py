"""Exceptions of the package: what is wrong with the input, and why a solve failed."""


class InputError(ValueError):
    """Input that cannot be simulated: the message names what is wrong and where."""


class PatternError(InputError):
    """A crease pattern that is not a valid set of panels and creases."""


class MeshError(InputError):
    """A mesh that cannot carry the model: inverted, degenerate, open or untagged."""


class SceneError(InputError):
    """A scene that is incomplete or contradicts itself: unknown name, missing value."""


class SolveError(RuntimeError):
    """A solve that did not converge.

    Attributes:
        reason: one line that says why (solver's own reason, smallest step, indefinite tangent).
        load_factor: load factor (or time) of the last accepted state.
    """

    def __init__(self, reason: str, load_factor: float | None = None):
        """Store the reason and the load factor of the last accepted state."""
        at = "" if load_factor is None else f" (last accepted state at {load_factor:g})"
        super().__init__(reason + at)
        self.reason = reason
        self.load_factor = load_factor


class MeshWarning(UserWarning):
    """A mesh that the chosen form represents poorly: the message holds the measured figure."""


class StabilityWarning(UserWarning):
    """An accepted equilibrium with negative directions of the tangent: it is unstable."""


class BranchWarning(UserWarning):
    """An accepted equilibrium that was found far from the predicted one: the branch may differ."""


class RoundOffWarning(UserWarning):
    """Forces that are smaller than the round-off of the residual: the message tells by how much."""


class SupportWarning(UserWarning):
    """A piece of the sheet that no condition keeps from turning: a singular tangent at rest."""


class AccuracyWarning(UserWarning):
    """A time step whose local error exceeds the tolerance although it is the smallest allowed."""


class ContactWarning(UserWarning):
    """A gap that has nearly closed: the barrier is weak for the forces on it."""
