"""What a task is: rows A x ≈ b in x = [a; f], accelerations and contact forces.

Every task of a whole-body problem is of this kind: those that every problem has
(:mod:`harpy_pin.wbc.tasks.built_in`) and those that users add (:mod:`harpy_pin.wbc.tasks.added`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.state import State, Vector


class Task(Protocol):
    """What a whole-body problem asks of a task; the number of its rows never changes."""

    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """Rows A x ≈ b at a state.

        Args:
            dynamics: terms at the state; ``dynamics.robot`` and ``dynamics.model`` are there, too.
            state: as measured.

        Returns:
            A and b, of shapes (m, nv) and (m,) where the task is on the generalised acceleration a alone, in the order
            of the state's v; or (m, nv + 3 feet) and (m,) with the contact forces f behind it, world axes.
        """
        ...


class MotionTask(ABC):
    """A task that follows a reference; its rows are in the classes derived from it.

        desired = acceleration + k_p (position − measured) + k_d (velocity − measured)

    The references may be overwritten between ticks.

    Args:
        size: number of components.
        velocity: (size,) reference; zero by default.
        acceleration: (size,) reference; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Raises:
        InputError: a reference of another size, or a negative gain.
    """

    def __init__(
        self, size: int, velocity: ArrayLike | None, acceleration: ArrayLike | None, gains: tuple[float, float]
    ) -> None:
        self.velocity = reference("velocity", velocity, size)
        self.acceleration = reference("acceleration", acceleration, size)
        k_p, k_d = checks.gains("gains", gains, 2)
        self.gains = (float(k_p), float(k_d))

    @abstractmethod
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""

    def desired(self, error: Vector | None, velocity: Vector) -> Vector:
        """Acceleration that the references ask for.

        Args:
            error: (size,) reference less measured position; None without a reference.
            velocity: (size,) as measured.

        Raises:
            InputError: arrays of another size.
        """
        k_p, k_d = self.gains
        velocity = checks.array("velocity", velocity, len(self.velocity))
        error = None if error is None else checks.array("error", error, len(self.velocity))
        desired: Vector = self.acceleration + k_d * (self.velocity - velocity)
        return desired if error is None else desired + k_p * error


def reference(name: str, given: ArrayLike | None, size: int) -> Vector:
    """A reference of a task, (size,); zero where none is given. For one component a number will do."""
    if given is None:
        return np.zeros(size)
    one = size == 1 and isinstance(given, int | float | np.number)
    return checks.vector(name, np.array([given]) if one else given, size)


def reference_position(given: ArrayLike | None, size: int, gains: tuple[float, float]) -> Vector | None:
    """The reference position, which a stiffness needs, and which needs a stiffness.

    Raises:
        InputError: there is none, and k_p is not zero; or there is one, and k_p is zero.
    """
    if given is not None:
        position = reference("position", given, size)
        check_stiffness("position", gains)
        return position
    if gains[0] != 0.0:
        raise InputError("a gain k_p needs a position to go to", name="position")
    return None


def check_stiffness(name: str, gains: tuple[float, float]) -> None:
    """Refuse a position or a rotation that nothing pulls towards.

    Raises:
        InputError: k_p is zero.
    """
    if gains[0] == 0.0:
        raise InputError(f"a {name} needs a gain k_p, such as gains=(100, 20)", name="gains", value=gains)
