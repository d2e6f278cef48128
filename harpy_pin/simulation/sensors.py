"""Sensors between plant and controller: noise on what is measured, and the time it takes to
arrive.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import as_state
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector

TRUE, ESTIMATED = "true", "estimated"
"""What a controller may know of the state."""

MAX_NOISE = 1e6  # largest standard deviation, in its unit, and largest scale
DEVIATION: dict[str, Any] = {"low": 0.0, "high": MAX_NOISE}


@dataclass(frozen=True, kw_only=True)
class Noise(checks.Checked):
    """Standard deviations of white Gaussian noise, on each component and at each tick; zero means
    exact.

    Which sensor a field stands for, and what such sensors on small legged robots have (orders of
    magnitude; look them up for your own):

    ==================  ====================================================
    ========================== field               sensor
    typical ==================  ====================================================
    ========================== joint_position      encoder: a step of 2π/2¹⁴ is 0.4 mrad
    0.1 to 1 mrad joint_velocity      difference of encoder counts, filtered                10 to
    100 mrad/s angular_velocity    gyroscope of the inertial unit: 0.005 °/s/√Hz over    1 to 10
    mrad/s
                        some 100 Hz is 1 mrad/s, vibration comes on top
    orientation         the inertial unit's filter, roll and pitch            1 to 10 mrad
    position, velocity  state estimate from legs and inertial unit            1 to 10 mm, 10 to 50
    mm/s foot_force          load cell in the foot, or joint torques               0.5 to 5 N
    ==================  ====================================================
    ==========================

    Not in it: biases, drift of position and heading, noise that is correlated in time (as an
    estimate's is: white noise of that size is harder on stiff gains), quantisation, and lost
    samples.

    Attributes:
        joint_position: rad.
        joint_velocity: rad/s.
        position: of the body, world axes, m.
        orientation: of the body, a small rotation vector in body axes, rad.
        velocity: of the body, body axes, m/s.
        angular_velocity: of the body, body axes, rad/s.
        foot_force: of every foot, in swing too, world axes, N.
    """

    whose = "noise "
    joint_position: float = checks.setting(0.0, **DEVIATION)
    joint_velocity: float = checks.setting(0.0, **DEVIATION)
    position: float = checks.setting(0.0, **DEVIATION)
    orientation: float = checks.setting(0.0, **DEVIATION)
    velocity: float = checks.setting(0.0, **DEVIATION)
    angular_velocity: float = checks.setting(0.0, **DEVIATION)
    foot_force: float = checks.setting(0.0, **DEVIATION)

    @classmethod
    def typical(cls, scale: float = 1.0) -> Noise:
        """Noise as of encoders, an inertial unit and a state estimator of a small legged robot,
        times a scale.

        At scale 1: joints 0.5 mrad and 20 mrad/s; body 2 mm, 2 mrad, 10 mm/s and 5 mrad/s; foot
        forces 0.5 N.

        Args:
            scale: factor on all of them, 0 to a million.
        """
        scale = checks.number("noise", scale, low=0.0, high=MAX_NOISE)
        return cls(
            joint_position=5e-4 * scale,
            joint_velocity=2e-2 * scale,
            position=2e-3 * scale,
            orientation=2e-3 * scale,
            velocity=1e-2 * scale,
            angular_velocity=5e-3 * scale,
            foot_force=0.5 * scale,
        )

    def __bool__(self) -> bool:
        """Whether there is any."""
        return any(getattr(self, entry.name) > 0.0 for entry in fields(self))


class Sensors(KeepsViews):
    """What a controller gets to know of the true state.

    Positions and velocities of the feet follow from the measured configuration and velocity by
    forward kinematics, so that they hold nothing that the other measurements do not say.

    Args:
        robot: gives the kinematics.
        noise: none by default.
        delay: age of the measurements, in control ticks. Before there is a measurement so old, the
            oldest one is given. The time ``State.t`` is never delayed: it is the controller's own
            clock, which the gait runs by.
        seed: of the noise.

    Raises:
        InputError: the delay or the seed is not a whole number, or negative.
    """

    @checked
    def __init__(
        self, robot: Robot, noise: Noise | None = None, *, delay: int = 0, seed: int = 0
    ) -> None:
        self.noise = n = Noise() if noise is None else checks.instance("noise", noise, Noise)
        self.delay = checks.whole("delay in ticks", delay, high=checks.MAX_TICKS)
        self.seed = checks.whole("seed", seed)
        self._dynamics = Dynamics(robot)
        joints, feet = len(robot.joints), len(robot.feet)
        levels = (
            n.position,
            n.orientation,
            n.joint_position,
            n.velocity,
            n.angular_velocity,
            n.joint_velocity,
        )
        self._deviation = np.repeat((*levels, n.foot_force), (3, 3, joints, 3, 3, joints, 3 * feet))
        self._history: deque[State] = deque(maxlen=self.delay + 1)
        self.reset()

    def reset(self) -> None:
        """Forget what was measured, and begin the noise anew."""
        self._history.clear()
        # A stream of its own: callers draw pushes and starts from a generator with the same seed.
        self._rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(0,)))

    def measure(self, state: State) -> State:
        """Measure the true state, once per tick.

        Args:
            state: the true one, with one row for each foot of the robot.

        Returns:
            What the controller gets: measured ``delay`` ticks ago, with the present time; it shares
                no memory with the
            true state.

        Raises:
            InputError: it is no state of the robot.
        """
        state = as_state(state, self._dynamics.robot)
        self._history.append(self._noisy(state) if self.noise else state.copy())
        measured = self._history[0].copy()
        measured.t = state.t
        return measured

    def _noisy(self, state: State) -> State:
        """The state with noise drawn anew."""
        noise: Vector = self._deviation * self._rng.standard_normal(len(self._deviation))
        nv = len(state.v)
        q, v = state.q.copy(), state.v + noise[nv : 2 * nv]
        q[:3] += noise[:3]
        q[3:7] = (pin.Quaternion(q[3:7]) * pin.Quaternion(pin.exp3(noise[3:6]))).coeffs()
        q[7:] += noise[6:nv]
        d = self._dynamics
        d.update(q, v)
        force = state.foot_force + noise[2 * nv :].reshape(-1, 3)
        return State(state.t, q, v, d.foot_position.copy(), d.foot_velocity.copy(), force)
