"""Shields for many environments in one compiled loop; :class:`~harpy_pin.contrib.shield.Shield` is
the loop for one.
"""

from __future__ import annotations

from operator import attrgetter

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.shield import ShieldAnswer, ShieldLoop
from harpy_pin.contrib.threads import selection
from harpy_pin.governors.contact_force_parameters import ContactForceFilterParameters
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["ShieldBatch"]


@fixed_arrays("mu")
class ShieldBatch(KeepsViews):
    """A shield for each of n environments with the same robot, in one call.

    Every environment has a memory of its own, as if it had a
    :class:`~harpy_pin.contrib.shield.Shield` of its own. The time of a call grows linearly with n.

    Args:
        robot: with feet and thrusters, a free flyer.
        n: number of environments.
        mu: friction coefficient of the ground, one for all or (n,).
        period: time between commands, s.
        parameters: other settings of the filter; their ``mu`` is replaced.

    Attributes:
        mu: (n,) friction coefficients, to be overwritten where more is known.

    Raises:
        InputError: n is no positive integer, or a friction is negative or not finite.
    """

    n = property(attrgetter("_n"))

    @checked
    def __init__(
        self,
        robot: Robot,
        n: int,
        *,
        mu: ArrayLike,
        period: float = 1e-3,
        parameters: ContactForceFilterParameters | None = None,
    ) -> None:
        self.robot = robot
        self._n = checks.whole("n", n, low=1, high=checks.MAX_TICKS)
        given = checks.array("mu", mu, None)
        self.mu = checks.vector("mu", np.full(self.n, given) if given.ndim == 0 else given, self.n)
        for value in self.mu:
            checks.number("mu", value, low=0.0)
        feet, thrusters, joints = len(robot.feet), len(robot.thrusters), len(robot.joints)
        self._loop = ShieldLoop(
            robot, self.n, mu=float(self.mu[0]), period=period, parameters=parameters
        )
        one = {"q": (robot.nq,), "v": (robot.nv,), "foot_force": (feet, 3)}
        one |= {"torque": (joints,), "thrust": (thrusters, 3)}
        self._shapes = {name: (self.n, *shape) for name, shape in one.items()}

    def reset(self, which: ArrayLike | None = None) -> None:
        """Forget the last changes and commands.

        Args:
            which: indices or mask of the environments; all by default.
        """
        self._loop.reset(selection("which", which, self.n))

    def __call__(
        self,
        q: ArrayLike,
        v: ArrayLike,
        foot_force: ArrayLike,
        torque: ArrayLike,
        thrust: ArrayLike,
    ) -> tuple[Vector, Vector, ShieldAnswer]:
        """The commands to be sent, and the report.

        Args:
            q: (n, nq) configurations.
            v: (n, nv) generalised velocities.
            foot_force: (n, feet, 3) measured contact forces, world axes, N.
            torque: (n, joints) of the commands, N·m; not overwritten.
            thrust: (n, thrusters, 3) of the commands, world axes, N; not overwritten.

        Returns:
            New arrays (n, joints) and (n, thrusters, 3), and what was changed.

        Raises:
            InputError: an array has the wrong shape, or no numbers.
        """
        given = {"q": q, "v": v, "foot_force": foot_force, "torque": torque, "thrust": thrust}
        arrays = {
            name: checks.array(name, value, self._shapes[name]) for name, value in given.items()
        }
        friction = np.repeat(self.mu, len(self.robot.feet)).reshape(self.n, -1)
        answer = self._loop.answer(friction, tuple(arrays.values()))
        return answer.torque, answer.thrust, answer
