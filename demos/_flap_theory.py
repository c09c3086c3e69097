"""A rigid magnetised flap on an elastic hinge in a field that turns: at rest and in motion.

Per length of the hinge, with the flap's angle a and the field's angle f,

    I a'' + c I a' + K a = T sin(f - a)

The ratio T / K decides whether the flap follows the field all the way round: above 1 the torque has
a largest value that the hinge passes, 1 + T/K cos(f - a) = 0, and the flap snaps to the other side.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


@dataclass(frozen=True)
class RigidFlap:
    """The flap, all per length of its hinge.

    Attributes:
        stiffness: K, moment per angle.
        torque: T, largest moment of the field.
        inertia: I about the hinge.
        damping: c (1 / time), of the angular momentum.
    """

    stiffness: float
    torque: float
    inertia: float
    damping: float

    @property
    def ratio(self) -> float:
        """Largest moment of the field over the stiffness: the largest angle that it can hold."""
        return self.torque / self.stiffness

    @property
    def period(self) -> float:
        """Period of small vibrations in a field along the flap's rest direction."""
        return 2 * np.pi * np.sqrt(self.inertia / (self.stiffness + self.torque))

    def at_rest(self, field: np.ndarray) -> np.ndarray:
        """Stable angles (n,) while the field turns slowly through angles (n,) from 0 on.

        Where the branch that the flap is on ends, it goes on from the stable angle next to it.
        """
        angles, last = np.empty(len(field)), 0.0
        for i, direction in enumerate(field):
            last = min(self._stable(direction), key=lambda angle: abs(angle - last))
            angles[i] = last
        return angles

    def _stable(self, direction: float) -> list[float]:
        """All stable angles in a field."""

        def moment(angle):
            return angle - self.ratio * np.sin(direction - angle)

        trial = np.linspace(-1.01, 1.01, 400) * self.ratio
        values = moment(trial)
        rising = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
        return [brentq(moment, trial[i], trial[i + 1]) for i in rising]

    def in_time(self, times: np.ndarray, field: Callable[[float], float]) -> np.ndarray:
        """Angles (n,) at increasing times (n,) from rest at angle 0, in a field that turns."""

        def rates(time, state):
            angle, rate = state
            moment = self.torque * np.sin(field(time) - angle) - self.stiffness * angle
            return rate, moment / self.inertia - self.damping * rate

        span = (times[0], times[-1])
        solved = solve_ivp(
            rates, span, (0.0, 0.0), t_eval=times, rtol=1e-9, atol=1e-9, max_step=self.period / 10
        )
        return solved.y[0]
