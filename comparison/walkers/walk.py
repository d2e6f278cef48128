"""One walk in MuJoCo: the policy's actuators and rate, or torques of the condensed WBC at every step."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from time import thread_time_ns
from typing import Any

import numpy as np

from comparison.walkers.go1 import FEET, described, robot_of, torque_driven
from comparison.walkers.policy import PERIOD, Policy, package_in
from comparison.walkers.watch import Watch
from harpy_pin import Robot, State, WalkingGait, make_controller
from harpy_pin.errors import ControlError
from harpy_pin.model.state import Vector
from harpy_pin.simulation.mujoco.conventions import Conventions, import_mujoco

NETWORK, LAW, LEARNING = "policy", "condensed", "condensed, joint friction"
WALKERS = (NETWORK, LAW, LEARNING)
PLANTS: dict[str, dict[str, float]] = {
    "MuJoCo as trained": {"timestep": 4e-3},
    "MuJoCo, elliptic cones": {"timestep": 1e-3, "iterations": 100, "ls_iterations": 50, "cone": 1, "impratio": 100.0},
}
"""Options of MuJoCo that differ from the wheel's model. It has pyramids as friction cones and one iteration a step;
MuJoCo Menagerie has elliptic cones and this ``impratio`` for the same robot."""
CALLS = 200
PUSH = 0.1
"""Duration, s."""


def walked(job: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Measures of a walk.

    Args:
        job: ``walker``, ``plant``, ``friction`` and ``duration``, s; ``commands``, each with the time from which on it
            holds, s, forward, to the left and turning; ``push``, its time, s, and impulse over mass, m/s, or None.
        folder: of the peers' environments.

    Raises:
        WorkerError: the policy does not run.
    """
    spec = described(package_in(folder))
    model = spec.compile()
    for name, value in PLANTS[job["plant"]].items():
        setattr(model.opt, name, value)
    model.geom("floor").friction[0] = job["friction"]
    if job["walker"] == NETWORK:
        with Policy(folder) as network:
            measures, call_us = followed(job, model, network.act, PERIOD), network.call_us()
    else:
        law = Law(robot_of(spec), model, job["friction"], learning=job["walker"] == LEARNING)
        measures, call_us = followed(job, model, law.act, law.period), law.call_us()
    return {**measures, "call_us": call_us}


class Law:
    """The gait and the condensed WBC on a model that takes torques.

    Args:
        robot: the same as MuJoCo's.
        model: ``mujoco.MjModel``; its actuators are changed in place.
        mu: friction coefficient of the ground.
        learning: whether it estimates the friction in the joints.

    Attributes:
        period: of the ticks: MuJoCo's step, s.
    """

    def __init__(self, robot: Robot, model: Any, mu: float, *, learning: bool) -> None:
        torque_driven(model)
        self.robot, self.period, self.gait = robot, float(model.opt.timestep), WalkingGait(robot)
        self._states = Conventions(model, robot)
        changes = {**self.gait.parameters, "estimate_joint_friction": learning}
        self._controller = make_controller("condensed", self.gait, mu=mu, period=self.period, **changes)
        driven = {model.joint(joint).name: k for k, joint in enumerate(model.actuator_trnid[:, 0])}
        self._actuators = [driven[name] for name in robot.joints]
        self._recent: deque[State] = deque(maxlen=CALLS)

    def act(self, model: Any, data: Any, command: Vector) -> None:
        """Set the torques in MuJoCo's data.

        Raises:
            ControlError: it has none.
        """
        state = self._states.read(data)
        self._recent.append(state)
        self.gait.command[:3] = command
        data.ctrl[self._actuators] = self._controller.step(state).torque

    def call_us(self) -> float:
        """Thread time of a tick, from the state to the torques: of many in a row, at the last states once more."""
        known, after = list(self._recent), self._recent[-1].t - self._recent[0].t + self.period
        again = [State(s.t + after, s.q, s.v, s.foot_position, s.foot_velocity, s.foot_force) for s in known]
        begin = thread_time_ns()
        for state in again:
            self._controller.step(state)
        return 1e-3 * (thread_time_ns() - begin) / len(again)


def followed(job: dict[str, Any], model: Any, act: Callable[[Any, Any, Vector], None], period: float) -> dict[str, Any]:
    """Measures of a walk from the first keyframe to its end, or to the fall.

    Args:
        job: what is commanded, and the push.
        model: ``mujoco.MjModel``.
        act: sets the actuators from model, data and command.
        period: in which it is called, s.
    """
    mujoco = import_mujoco()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    watch, dt, command = Watch(model, data, FEET), float(model.opt.timestep), np.zeros(3)
    every = round(period / dt)
    for k in range(round(job["duration"] / dt)):
        t = k * dt
        command = np.array([row[1:] for row in ((0.0, 0.0, 0.0, 0.0), *job["commands"]) if row[0] <= t][-1])
        if job["push"] is not None:
            on = job["push"][0] <= t < job["push"][0] + PUSH
            mass = float(model.body_subtreemass[1])
            data.xfrc_applied[1, :2] = mass / PUSH * np.array(job["push"][1:]) if on else 0.0
        if k % every == 0:
            mujoco.mj_forward(model, data)
            try:
                act(model, data, command)
            except ControlError:
                watch.fell = True
                break
        mujoco.mj_step(model, data)
        watch.look(command)
        if watch.fell:
            break
    return watch.measures()
