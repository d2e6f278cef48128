"""Thrusters whose lag is of second order; and thrusters that give less than they should, found in
the air.

What they give is found from the change of momentum, and what lacks is made up for.

In the air the momentum h of the robot about its centre of mass changes by thrusts and weight alone,

    ḣ = Σ e_k w_k + (m g, 0),    w_k = (u_k, (p_k − c) × u_k),

with the force u_k commanded of thruster k, its place p_k, and its effectiveness e_k, the share of
the command that it gives. An observer of first order finds from the measured h what the present
estimates leave unexplained, and each estimate follows its own part of that. The command of a
thruster is divided by its effectiveness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.linalg import expm

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.entry import as_state
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Command, State, Vector
from harpy_pin.simulation.loop import Controller
from harpy_pin.simulation.thrusters import Thrusters

AIRBORNE = 0.05
"""Measured contact force below which the robot is in the air, as a share of the weight."""
OBSERVER, ADAPTS = 30.0, 6.0  # rates of the observer and of the estimates, 1/s
ARM = 0.1  # length by which moments are compared with forces, m
LEAST, MOST = 0.2, 1.2  # least and largest effectiveness


@dataclass(frozen=True, kw_only=True)
class SecondOrderThrusters(Thrusters):
    """As :class:`harpy_pin.Thrusters`, with the natural frequency 1 / ``lag``, which must not be
    zero.

    Attributes:
        damping_ratio: of the lag, 0.05 to 20.

    Raises:
        InputError: a value out of its domain.
    """

    lag: float = checks.setting(0.1, low=0.0, high=checks.MAX_LAG, strict=True)
    damping_ratio: float = checks.setting(1.0, low=0.05, high=20.0)

    def _response(self, dt: float) -> tuple[Vector, Vector]:
        frequency = 1.0 / self.lag
        matrix = np.array([[0.0, 1.0], [-(frequency**2), -2.0 * self.damping_ratio * frequency]])
        transition = expm(matrix * dt)
        return transition, np.linalg.solve(matrix, transition - np.eye(2))[0] / dt


class ThrustWatch(KeepsViews):
    """A controller whose thrusters are watched.

    Args:
        controller: that believes in its thrusters.
        robot: with free thrusters.

    Attributes:
        effectiveness: (thrusters,) share of its command that each thruster gives, as estimated.

    Raises:
        InputError: the robot has no free thrusters.
    """

    @checked
    def __init__(self, controller: Controller, robot: Robot) -> None:
        if not robot.thrusters or robot.rotors:
            raise InputError(
                f"'{robot.name}' has no free thrusters to watch", name="robot", value=robot
            )
        self.robot, self._inner = robot, controller
        self.period = checks.number(
            "period", getattr(controller, "period", 1e-3), low=0.0, strict=True
        )
        self._data = robot.model.createData()
        self._frames = [robot.frame_id(name) for name in robot.thrusters]
        self.effectiveness: Vector = np.ones(len(robot.thrusters))
        self._command = Command(np.zeros(len(robot.joints)), np.zeros((len(robot.thrusters), 3)))
        self.reset()

    def reset(self) -> None:
        """Believe in all thrusters again, and forget the past."""
        self.effectiveness[:] = 1.0
        self._expected: Vector | None = None
        self._command.thrust[:] = 0.0
        forget = getattr(self._inner, "reset", None)
        if forget is not None:
            forget()

    def step(self, state: State) -> Command:
        """The controller's command, with thrusts that make up for what thrusters do not give.

        Args:
            state: measured.

        Raises:
            InputError: it is no state of the robot.
        """
        state = as_state(state, self.robot)
        self._watch(state)
        given = self._inner.step(state)
        self._command.torque[:], self._command.law = given.torque, given.law
        for k, force in enumerate(given.thrust):
            more = force / self.effectiveness[k]
            size = float(np.linalg.norm(more))
            self._command.thrust[k] = more * min(1.0, self.robot.thrust_limit / max(size, 1e-9))
        return self._command

    def _watch(self, state: State) -> None:
        """Compare the momentum with what the last command should have made of it."""
        weight = self.robot.mass * GRAVITY
        good = all(np.isfinite(array).all() for array in (state.q, state.v, state.foot_force))
        if not good or np.abs(state.foot_force).sum() > AIRBORNE * weight + 3.0:
            self._expected = None
            return
        model, tree, v = self.robot.model, self.robot.closed(state.q), state.v
        if self.robot.loops is not None:
            v = self.robot.velocity_map(state.q) @ v
        pin.computeCentroidalMomentum(model, self._data, tree, v)
        pin.updateFramePlacements(model, self._data)
        centre, hg = self._data.com[0], self._data.hg
        momentum = np.concatenate((hg.linear, hg.angular / ARM))
        arms = np.array([self._data.oMf[frame].translation - centre for frame in self._frames])
        thrust = self._command.thrust
        effects = np.hstack((thrust, np.cross(arms, thrust) / ARM))
        if self._expected is None:
            self._expected = momentum
            return
        left = OBSERVER * (momentum - self._expected)  # rate of the momentum that is not explained
        rate = self.effectiveness @ effects + np.array((0.0, 0.0, -weight, 0.0, 0.0, 0.0))
        self._expected = self._expected + self.period * (rate + left)
        own = effects @ effects.T + 0.1 * weight * np.eye(len(effects))
        self.effectiveness += self.period * ADAPTS * np.linalg.solve(own, effects @ left)
        np.clip(self.effectiveness, LEAST, MOST, out=self.effectiveness)

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The controller's signals, and the estimates."""
        signals: Mapping[str, ArrayLike] = getattr(self._inner, "telemetry", dict)()
        return {**signals, "thrust_effectiveness": self.effectiveness}

    def describe(self) -> Mapping[str, Any]:
        """The controller's parameters."""
        described: Mapping[str, Any] = getattr(self._inner, "describe", dict)()
        return described
