"""The motion of the centre of mass, and the robot's momentum about it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.tasks.task import MotionTask, reference, reference_position

MOMENTA = {"linear": slice(0, 3), "angular": slice(3, 6), "both": slice(0, 6)}


@fixed_arrays("acceleration", "position", "velocity")
class CentreOfMassTask(MotionTask):
    """Acceleration of the centre of mass, world axes.

    Args:
        position: (3,) where it should be, m.
        velocity: (3,) reference, m/s; zero by default.
        acceleration: (3,) reference, m/s²; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Attributes:
        position, velocity, acceleration, gains: as given; they may be overwritten between ticks.

    Raises:
        InputError: a k_p without a position.
    """

    def __init__(
        self,
        *,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        gains: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        super().__init__(3, velocity, acceleration, gains)
        self.position = reference_position(position, 3, self.gains)

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        rotation, mass = dynamics.rotation, dynamics.mass_matrix[0, 0]
        matrix = rotation @ dynamics.mass_matrix[:3] / mass
        drift = rotation @ dynamics.bias[:3] / mass + dynamics.model.gravity.linear
        error = None
        if self.position is not None:
            error = self.position - state.q[:3] - dynamics.rotation @ _centre(dynamics)
        return matrix, self.desired(error, matrix @ state.v) - drift


@fixed_arrays("momentum", "rate")
class MomentumTask:
    """Rate of the robot's momentum, the angular one about the centre of mass, world axes.

    Args:
        part: ``linear``, ``angular`` or ``both`` (linear first).
        momentum: (3,) or (6,) reference, kg·m/s and kg·m²/s; zero by default.
        rate: (3,) or (6,) reference of its rate, N and N·m; zero by default.
        gain: of the difference of momentum, 1/s.

    Attributes:
        momentum, rate, gain: as given; they may be overwritten between ticks.

    Raises:
        InputError: an unknown part, or a negative gain.
    """

    def __init__(
        self,
        *,
        part: str = "angular",
        momentum: ArrayLike | None = None,
        rate: ArrayLike | None = None,
        gain: float = 0.0,
    ) -> None:
        checks.one_of("part", part, MOMENTA)
        self._rows = MOMENTA[part]
        size = self._rows.stop - self._rows.start
        self.part = part
        self.momentum = reference("momentum", momentum, size)
        self.rate = reference("rate", rate, size)
        self.gain = checks.number("gain", gain, low=0.0)

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        matrix, drift = _momentum_rows(dynamics)
        matrix, drift = matrix[self._rows], drift[self._rows]
        return matrix, self.rate + self.gain * (self.momentum - matrix @ state.v) - drift


def _centre(dynamics: Dynamics) -> Vector:
    """(3,) centre of mass from the body's origin, body axes, m: the mass matrix has −m [c]× beside m I."""
    m = dynamics.mass_matrix
    return np.array((-m[2, 4], -m[0, 5], -m[1, 3]), dtype=np.float64) / float(m[0, 0])


def _momentum_rows(dynamics: Dynamics) -> tuple[Vector, Vector]:
    """(6, nv) A and (6,) d with ḣ = A a + d and h = A v, h the linear and angular momentum, world axes.

    The floating base's six rows of M a + n are the wrench on the robot about the base's origin without gravity, in body
    axes. About the centre of mass c its moment is less by c × force, and gravity has none.
    """
    rotation, matrix = dynamics.rotation, np.column_stack((dynamics.mass_matrix[:6], dynamics.bias[:6]))
    matrix[3:] -= pin.skew(_centre(dynamics)) @ matrix[:3]
    matrix = (rotation @ matrix.reshape(2, 3, -1)).reshape(6, -1)
    matrix[:3, -1] += dynamics.mass_matrix[0, 0] * dynamics.model.gravity.linear
    return matrix[:, :-1], matrix[:, -1]
