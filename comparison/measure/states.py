"""The recorded data: walks, and the states that the controllers were given in them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

import harpy_pin as hp
from comparison.measure.controllers import CONTENDERS, scenario_of
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.model.state import State, Vector
from harpy_pin.simulation.push import Push

__all__ = ["StateSequence", "draw_push", "pushed_walk", "record_states", "walk"]


@dataclass(frozen=True)
class StateSequence:
    """States of one walk, in the order of time.

    Attributes:
        name: the contender that walked.
        states: one per control tick.
    """

    name: str
    states: tuple[State, ...]

    def __len__(self) -> int:
        return len(self.states)

    def digest(self) -> str:
        """SHA-256 of every number, to show that replays leave the states as they were."""
        total = hashlib.sha256()
        for s in self.states:
            total.update(np.float64(s.t).tobytes())
            for array in (s.q, s.v, s.foot_position, s.foot_velocity, s.foot_force):
                total.update(array.tobytes())
        return total.hexdigest()


def walk(name: str, *, friction: float, duration: float, push: Vector | None = None) -> Run:
    """Walk in closed loop.

    The controller knows the ground's static friction coefficient; the duration is in s. ``push``, (2,), is added to the
    start's velocity along x and y, m/s.

    Returns:
        The log; it ends early if the robot falls.
    """
    start = np.zeros(6)
    if push is not None:
        start[:2] = push
    return hp.walk(
        scenario_of(
            CONTENDERS[name], friction, duration=duration, disturbances=hp.Disturbances(start_velocity=tuple(start))
        )
    )


def pushed_walk(name: str, *, friction: float, duration: float, impulse: float) -> Run:
    """Walk with a lateral push to alternating sides in every second of time: many touchdowns and recoveries.

    The name is that of :func:`~comparison.measure.controllers.scenario_of`. The controller knows the ground's static
    friction coefficient; the duration is in s, the impulse of each push in N·s.

    Returns:
        The log; it ends early if the robot falls.
    """
    times = np.arange(0.6, duration - 0.1, 1.0)
    pushes = tuple(Push(float(t), (0.0, impulse if k % 2 == 0 else -impulse, 0.0)) for k, t in enumerate(times))
    return hp.walk(scenario_of(name, friction, duration=duration, disturbances=hp.Disturbances(pushes=pushes)))


def draw_push(rng: np.random.Generator, speed: float) -> Vector:
    """A push of the given speed, m/s, in a random horizontal direction."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return speed * np.array([np.cos(angle), np.sin(angle)])


def record_states(name: str, run: Run, *, least: int) -> StateSequence:
    """The states of a walk.

    Raises:
        InputError: the walk ended before that.
    """
    if len(run) < least:
        raise InputError(
            f"the walk of '{name}' {run.ending} after {len(run)} ticks; the timing needs {least} (more friction helps)",
            name="friction",
        )
    q, v = run["q"], run["v"]
    position, velocity, force = run["foot_position"], run["foot_velocity"], run["foot_force"]
    return StateSequence(
        name,
        tuple(
            State(float(t), q[i].copy(), v[i].copy(), position[i].copy(), velocity[i].copy(), force[i].copy())
            for i, t in enumerate(run["t"])
        ),
    )
