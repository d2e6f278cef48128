"""The data: walks, and the states that the controllers saw in them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from comparison.measure.contenders import make_contender
from harpy_pin.control import make_controller
from harpy_pin.errors import InputError
from harpy_pin.gait import make_gait
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.plant.ground import Ground
from harpy_pin.plant.push import Push
from harpy_pin.plant.run import Run
from harpy_pin.plant.simulator import Simulator

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


def walk(robot: Robot, name: str, *, friction: float, duration: float, push: Vector | None = None) -> Run:
    """Walk in closed loop at the gait's default speed.

    Args:
        robot: who walks.
        name: the contender in charge.
        friction: static friction coefficient of the ground, known to the controller.
        duration: s.
        push: (2,) velocity along x and y that the robot has too much at the start, m/s.

    Returns:
        The log; it ends early if the robot falls.
    """
    controller = make_contender(name, robot, friction)
    simulator = Simulator(robot, Ground(mu_s=friction))
    q, v = controller.gait.initial_state(sink=simulator.static_sink)
    if push is not None:
        v[:2] += push  # the body is upright and faces x: body and world axes agree
    simulator.reset(q, v)
    return simulator.run(controller, duration)


def pushed_walk(robot: Robot, name: str, *, friction: float, duration: float, impulse: float) -> Run:
    """Walk with a lateral push to alternating sides in every second of time: touchdowns and recoveries in plenty.

    Args:
        robot: who walks.
        name: ``contact`` for the governed controller with the governor of the true contact force, or ``wbc``.
        friction: static friction coefficient of the ground, known to the controller.
        duration: s.
        impulse: of each push, N·s.

    Returns:
        The log; it ends early if the robot falls.
    """
    gait = make_gait(robot)
    controller = make_controller("wbc" if name == "wbc" else "governed", gait, mu=friction, governor="contact")
    simulator = Simulator(robot, Ground(mu_s=friction))
    simulator.reset(*gait.initial_state(sink=simulator.static_sink))
    times = np.arange(0.6, duration - 0.1, 1.0)
    pushes = [Push(float(t), (0.0, impulse if k % 2 == 0 else -impulse, 0.0)) for k, t in enumerate(times)]
    return simulator.run(controller, duration, pushes=pushes)


def draw_push(rng: np.random.Generator, speed: float) -> Vector:
    """A push of the given speed, m/s, in a random horizontal direction."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return speed * np.array([np.cos(angle), np.sin(angle)])


def record_states(name: str, run: Run, *, least: int) -> StateSequence:
    """The states of a walk.

    Args:
        name: the contender that walked.
        run: its log.
        least: states needed.

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
