"""The force of the ground on a foot."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.state import State, Vector


@fixed_arrays("force")
class FootForceTask:
    """Force of the ground on a foot, world axes. In swing the task is inactive.

    Args:
        foot: its name.
        force: (3,) desired, N; zero by default.

    Attributes:
        force: as given; it may be overwritten between ticks.

    Raises:
        InputError: a force that is not a vector of three numbers. An unknown foot is refused when the task is added.
    """

    def __init__(self, foot: str, *, force: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self.foot = foot
        self.force = checks.vector("force", force, 3)

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        feet, nv = dynamics.robot.feet, len(state.v)
        checks.one_of("foot", self.foot, feet)
        first = nv + 3 * feet.index(self.foot)
        matrix = np.zeros((3, nv + 3 * len(feet)))
        matrix[:, first : first + 3] = np.eye(3)
        return matrix, self.force.copy()
