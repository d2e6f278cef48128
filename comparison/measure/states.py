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


@dataclass(frozen=True)
class StateSequence:
    """States of one walk, in the order of time, one per control tick; ``name`` is the contender that walked."""

    name: str
    states: tuple[State, ...]

    def __len__(self) -> int:
        return len(self.states)

    def digest(self) -> str:
        """SHA-256 of every number, to show that replays leave the states as they were."""
        total = hashlib.sha256()
        for s in self.states:
            for array in (np.float64(s.t), s.q, s.v, s.foot_position, s.foot_velocity, s.foot_force):
                total.update(array.tobytes())
        return total.hexdigest()


def walk(name: str, *, friction: float, duration: float, push: Vector | None = None) -> Run:
    """Walk in closed loop; the log ends early if the robot falls.

    The controller knows the ground's static friction coefficient; the duration is in s. ``push``, (2,), is added to the
    start's velocity along x and y, m/s.
    """
    start = np.zeros(6)
    if push is not None:
        start[:2] = push
    disturbances = hp.Disturbances(start_velocity=tuple(start))
    return hp.walk(scenario_of(CONTENDERS[name], friction, duration=duration, disturbances=disturbances))


def pushed_walk(name: str, *, friction: float, duration: float, impulse: float) -> Run:
    """Walk with a lateral push to alternating sides in every second of time: many touchdowns and recoveries.

    The name is that of :func:`~comparison.measure.controllers.scenario_of`. The duration is in s, the impulse of each
    push in N·s.
    """
    times = np.arange(0.6, duration - 0.1, 1.0)
    pushes = tuple(Push(float(t), (0.0, impulse if k % 2 == 0 else -impulse, 0.0)) for k, t in enumerate(times))
    return hp.walk(scenario_of(name, friction, duration=duration, disturbances=hp.Disturbances(pushes=pushes)))


def record_states(name: str, run: Run, *, least: int) -> StateSequence:
    """The states of a walk.

    Raises:
        InputError: the walk has fewer ticks.
    """
    if len(run) < least:
        raise InputError(
            f"the walk of '{name}' {run.ending} after {len(run)} ticks; the timing needs {least} (more friction helps)",
            name="friction",
        )
    arrays = [run[key] for key in ("q", "v", "foot_position", "foot_velocity", "foot_force")]
    return StateSequence(
        name, tuple(State(float(t), *(array[i].copy() for array in arrays)) for i, t in enumerate(run["t"]))
    )
