"""A tick of every peer and of ours against the number of joints: standing robots that sway, on the same program.

Feet are points, as the peers' contacts are; a humanoid stands on its two ankles. Thrusters are absent: both variants of
a peer pose the same program, and one is told. The condensed WBC takes no point foot at the end of six joints. It has no
cost of posture; the sway is slow, so that this cost is small.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.measure.states import StateSequence
from comparison.peers.peer_problem import PeerProblem, make_problem
from harpy_pin.errors import HarpyError
from harpy_pin.gaits import Gait, Standing
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot, load_robot
from harpy_pin.model.state import State

__all__ = ["MU", "ROBOTS", "SWAYS", "growth_row", "standing_problem"]

ROBOTS: dict[str, tuple[str, ...]] = {
    "bolt": (),
    "solo12": (),
    "go2": (),
    "g1": ("left_ankle_roll_link", "right_ankle_roll_link"),
    "talos": ("leg_left_6_link", "leg_right_6_link"),
}
"""By name, with the links that stand on the ground as points; none where the robot's own feet are points."""

MU = 0.5
SWAYS = 800
"""States of a robot: two periods."""
_PERIOD = 0.4


def standing_problem(
    name: str, folder: Path, *, warm_up: int, most: int = SWAYS
) -> tuple[PeerProblem, Callable[[], Gait], StateSequence] | str:
    """A robot that stands and sways.

    Args:
        name: of the robot.
        folder: for a copy of its URDF without meshes, which placo would load.
        warm_up: ticks that are not counted.
        most: ticks.

    Returns:
        The problem, what makes its gait, and its states; or why there are none.
    """
    try:
        robot, posture = load_robot(name), None
        if ROBOTS[name]:
            posture = Standing(robot).initial_state()[0][7:]
            robot = load_robot(robot.urdf, feet=ROBOTS[name])
        gait = Standing(robot, posture)
        sequence = _sway(name, robot, gait, most)
        problem = make_problem(robot, [sequence], friction=MU, warm_up=warm_up, most=most, gait=gait)
    except HarpyError as error:
        return str(error).splitlines()[0]
    urdf = folder / f"{name}.urdf"
    _without_meshes(robot.urdf, urdf)
    problem = replace(problem, settings={**problem.settings, "urdf": str(urdf)})
    return problem, lambda: Standing(robot, posture), sequence


def _sway(name: str, robot: Robot, gait: Gait, most: int) -> StateSequence:
    model, dynamics = robot.model, Dynamics(robot)
    rest, _ = gait.initial_state()
    amplitude = 0.002 * np.random.default_rng(0).standard_normal(model.nv)
    rate = 2.0 * np.pi / _PERIOD
    force = np.zeros((len(robot.feet), 3))
    force[:, 2] = robot.mass * 9.81 / len(robot.feet)
    states = []
    for t in 0.001 * np.arange(most):
        q, v = pin.integrate(model, rest, amplitude * np.sin(rate * t)), rate * np.cos(rate * t) * amplitude
        dynamics.update(q, v)
        states.append(State(t, q, v, dynamics.foot_position.copy(), dynamics.foot_velocity.copy(), force))
    return StateSequence(name, tuple(states))


def _without_meshes(urdf: Path, out: Path) -> None:
    tree = ElementTree.parse(urdf)
    for link in tree.getroot().iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    tree.write(out)


def growth_row(name: str, problem: PeerProblem, entries: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of a robot: its size, and of every contender the median tick, µs, or why there is none."""
    row: dict[str, Any] = {
        "joints": problem.expected["decided"].torque.shape[1],
        "feet": len(problem.settings["feet"]),
        "ticks": len(problem),
        "unsolved_by_us": int(np.count_nonzero(~problem.expected["decided"].solved)),
        "contenders": {},
    }
    for contender, entry in entries.items():
        (times,) = list(entry.get("times", {}).values())[:1] or [None]
        row["contenders"][contender] = {
            "reason": entry["reason"],
            "p50_us": None if times is None else times["tick"]["p50_us"],
            "difference": entry.get("difference_max", {}).get("torque"),
        }
    return row
