"""What a step of :class:`~harpy_pin.contrib.gym.robot_env.RobotEnv` earns: named terms, each with a
scale of its own.

The reward is the sum of scale times term, or whatever a function of the :class:`Step` returns.
Terms that are to be avoided get a negative scale. Velocities are in the axes of the heading.

| term | what | between |
|---|---|---|
| ``velocity`` | exp(−\\|v − v_desired\\|² / (0.25 m/s)²), horizontal | 0 and 1 |
| ``turning`` | exp(−(ω − ω_desired)² / (0.25 rad/s)²) about the vertical | 0 and 1 |
| ``alive`` | 1 unless the robot fell | 0 and 1 |
| ``tilt`` | squared sine of the body's tilt | 0 and 1 |
| ``height`` | squared distance of the body's height from standing, units of 0.1 m | 0 and more |
| ``bounce`` | squared vertical velocity of the body, m²/s² | 0 and more |
| ``torque`` | mean of the squared joint torques, each in units of its limit | 0 and 1 |
| ``power`` | sum over joints of \\|torque · velocity\\|, units of weight times 1 m/s | 0 and more |
| ``slip`` | path of the feet on the ground in this step, mm | 0 and more |
| ``action_rate`` | mean squared change of the action | 0 and 4 |
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Command, State, Vector

WIDTH = 0.25  # widths of the rewards of velocity and turning, m/s and rad/s
RISE = 0.1  # unit of the height, m
SMALLEST_LIMIT = 1e-6  # smallest limit of a joint's torque, N·m: some files give none
REWARDS: Mapping[str, float] = {
    "velocity": 1.0,
    "turning": 0.5,
    "torque": -0.1,
    "action_rate": -0.01,
}
"""Scales by default."""


@dataclass(frozen=True, eq=False)
class Step:
    """What a reward may look at."""

    robot: Robot
    state: State  # true, at the end of the step
    command: Command  # of the controller, at its end
    # (joints,) at its end, N·m, with what the motors add where the command has their own law
    torque: Vector
    action: Vector
    last_action: Vector  # of the step before
    # (3,) of the body in the frame of its heading: forward, to the left, m/s; turning, rad/s
    velocity: Vector
    desired: Vector  # (3,) velocity that is asked for, in the same frame
    standing_height: float  # of the body, m
    slip: float  # path of all feet on the ground in this step, m
    fell: bool


Reward: TypeAlias = Callable[[Step], float] | Mapping[str, float]


def _tilt(step: Step) -> float:
    x, y = step.state.q[3:5].tolist()
    upright = 1.0 - 2.0 * (x * x + y * y)
    return float(max(1.0 - upright * upright, 0.0))


def _torque(step: Step) -> float:
    limit = np.maximum(step.robot.torque_limit, SMALLEST_LIMIT)
    return float(np.mean((step.torque / limit) ** 2))


def _bounce(step: Step) -> float:
    x, y, z, w = step.state.q[3:7].tolist()
    vertical = np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
    velocity = float(np.dot(vertical, step.state.v[:3]))
    return velocity * velocity


def _power(step: Step) -> float:
    power = np.abs(step.torque * step.state.v[6:]).sum()
    return float(power / (step.robot.mass * GRAVITY))


TERMS: Mapping[str, Callable[[Step], float]] = {
    "velocity": lambda step: float(
        np.exp(-np.sum((step.velocity[:2] - step.desired[:2]) ** 2) / WIDTH**2)
    ),
    "turning": lambda step: float(np.exp(-((step.velocity[2] - step.desired[2]) ** 2) / WIDTH**2)),
    "alive": lambda step: 0.0 if step.fell else 1.0,
    "tilt": _tilt,
    "height": lambda step: float((step.state.q[2] - step.standing_height) / RISE) ** 2,
    "bounce": _bounce,
    "torque": _torque,
    "power": _power,
    "slip": lambda step: 1e3 * step.slip,
    "action_rate": lambda step: float(np.mean((step.action - step.last_action) ** 2)),
}
"""Terms of a reward by name; see the top of this module."""


def make_reward(reward: Reward | None) -> Callable[[Step], tuple[float, dict[str, float]]]:
    """A function from a step to its reward, and to what each term adds to it.

    It comes from a function of the step, or from scales by name, of :data:`REWARDS` by default; an
    :class:`InputError` refuses anything else, an unknown name, and a scale that is not finite.
    """
    if callable(reward):
        return partial(_of_function, reward)
    if reward is not None and not isinstance(reward, Mapping):
        raise InputError(
            f"reward must be a function of the step, or scales by name, got {shown(reward)}",
            name="reward",
            value=reward,
        )
    scales = {}
    for name, scale in (REWARDS if reward is None else reward).items():
        checks.one_of("term of the reward", name, TERMS)
        scales[name] = checks.number(f"scale of '{name}'", scale)
    return partial(_of_terms, scales)


def _of_function(reward: Callable[[Step], float], step: Step) -> tuple[float, dict[str, float]]:
    return checks.number("the reward that the function returned", reward(step)), {}


def _of_terms(scales: Mapping[str, float], step: Step) -> tuple[float, dict[str, float]]:
    parts = {name: scale * _finite(TERMS[name](step)) for name, scale in scales.items()}
    return sum(parts.values()), parts


def _finite(value: float) -> float:
    """The value, or zero where that of a robot that flew away is not finite."""
    return value if np.isfinite(value) else 0.0
