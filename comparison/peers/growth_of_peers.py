"""A tick of every peer and of ours against the number of joints: standing robots that sway, on the same program.

Feet are points, as the peers' contacts are; a humanoid stands on its two ankles. Thrusters are absent: both variants of
a peer pose the same program, and one is kept. The condensed WBC takes no point foot at the end of six joints.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.measure.states import StateSequence
from comparison.peers.environment import PEERS, Peer
from comparison.peers.measure_peer import PeerSettings, measure_peer
from comparison.peers.ours import OURS, Ours, WholeBody, peers_parameters
from comparison.peers.peer_problem import PeerProblem, make_problem
from harpy_pin.controllers import CondensedController, WholeBodyController, WholeBodyParameters
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.gaits import Gait, Standing
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot, load_robot
from harpy_pin.model.state import State
from harpy_pin.wbc import WholeBodyWeights

SHORT_LEGS = WholeBodyWeights(body=1e3, orientation=1e2, swing=5e3, arms=1e3, thrust=5.0, force=1e-2)
"""For legs of three joints: the default weights times 1,000 but that of the legs' posture, 1e-6.

The condensed WBC has no cost of posture there, and its torques differ in proportion to that cost's share: by up to
0.06 N·m on Go2 with the default weights, by 7e-5 with these."""

LONG_LEGS = WholeBodyWeights(posture=1e-2)
"""On two points the ankles are free, and only the cost of posture decides their accelerations."""

ROBOTS: dict[str, tuple[WholeBodyWeights, tuple[str, ...]]] = {
    "bolt": (SHORT_LEGS, ()),
    "solo12": (SHORT_LEGS, ()),
    "go2": (SHORT_LEGS, ()),
    "g1": (LONG_LEGS, ("left_ankle_roll_link", "right_ankle_roll_link")),
    "talos": (LONG_LEGS, ("leg_left_6_link", "leg_right_6_link")),
}
"""By name: weights, and the links that stand on the ground as points; none where the robot's own feet are points."""

_FRICTION = 0.5
_SWAYS = 800
"""States of a robot: two periods."""
_PERIOD = 0.4
_AMPLITUDE = 0.02
"""Standard deviation over the directions of the sway, m and rad."""


def standing_problem(
    name: str, folder: Path, *, warm_up: int, most: int = _SWAYS
) -> tuple[PeerProblem, Callable[[], Gait], StateSequence]:
    """A robot that stands and sways: the problem, what makes its gait, and its states.

    Args:
        name: of the robot.
        folder: for a copy of its URDF without meshes, which placo would load.
        warm_up: ticks that are not counted.
        most: ticks.

    Raises:
        HarpyError: there is no such robot here.
    """
    robot, posture = load_robot(name), None
    weights, feet = ROBOTS[name]
    if feet:
        posture = Standing(robot).initial_state()[0][7:]
        robot = load_robot(robot.urdf, feet=feet)
    sequence = _sway(name, robot, Standing(robot, posture), most)
    problem = make_problem(
        robot,
        [sequence],
        friction=_FRICTION,
        warm_up=warm_up,
        most=most,
        gait=Standing(robot, posture),
        weights=weights,
    )
    tree, urdf = ElementTree.parse(robot.urdf), folder / f"{name}.urdf"
    for link in tree.getroot().iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    tree.write(urdf)
    return (
        replace(problem, settings={**problem.settings, "urdf": str(urdf)}),
        partial(Standing, robot, posture),
        sequence,
    )


def _sway(name: str, robot: Robot, gait: Gait, most: int) -> StateSequence:
    model, dynamics = robot.model, Dynamics(robot)
    rest, _ = gait.initial_state()
    amplitude = _AMPLITUDE * np.random.default_rng(0).standard_normal(model.nv)
    rate = 2.0 * np.pi / _PERIOD
    force = np.zeros((len(robot.feet), 3))
    force[:, 2] = robot.mass * 9.81 / len(robot.feet)
    states = []
    for t in 0.001 * np.arange(most):
        q, v = pin.integrate(model, rest, amplitude * np.sin(rate * t)), rate * np.cos(rate * t) * amplitude
        dynamics.update(q, v)
        states.append(State(t, q, v, dynamics.foot_position.copy(), dynamics.foot_velocity.copy(), force))
    return StateSequence(name, tuple(states))


def measure_growth(
    folder: Path, settings: PeerSettings, *, robots: Sequence[str] = tuple(ROBOTS), peers: Mapping[str, Peer] = PEERS
) -> dict[str, Any]:
    """A tick of everybody on each of some of :data:`ROBOTS`; a reason where there is none.

    The peers' environments are in a folder. Of the ticks there are a fifth of what the settings say.
    """
    rows: dict[str, Any] = {}
    for robot in robots:
        with TemporaryDirectory() as scratch:
            try:
                problem, gait, sequence = standing_problem(
                    robot, Path(scratch), warm_up=settings.warm_up, most=settings.most // 5
                )
            except HarpyError as error:
                rows[robot] = {"reason": str(error).splitlines()[0]}
                continue
            entries: dict[str, Any] = {}
            parameters = peers_parameters(_FRICTION, ROBOTS[robot][0])
            for name, kind in (("WBC QP", WholeBodyController), ("condensed WBC", CondensedController)):
                try:
                    ours = Ours(partial(_made, kind, gait, parameters), [sequence], len(sequence))
                    ours.replay(settings.repetitions)
                    entries[f"{OURS}, {name}"] = ours.entry(problem)
                except InputError as error:
                    entries[f"{OURS}, {name}"] = {"reason": str(error).splitlines()[0]}
            for name, peer in peers.items():
                variants = measure_peer(name, peer, problem, folder, settings.repetitions)
                entries[name] = variants[f"{name}, thrusts decided"]
        rows[robot] = {
            "joints": problem.expected["decided"].torque.shape[1],
            "feet": len(problem.settings["feet"]),
            "ticks": len(problem),
            "unsolved_by_us": int(np.count_nonzero(~problem.expected["decided"].solved)),
            "contenders": {name: _summary(entry) for name, entry in entries.items()},
        }
    return rows


def _made(kind: type[WholeBody], gait: Callable[[], Gait], parameters: WholeBodyParameters) -> WholeBody:
    """A controller with a gait of its own."""
    return kind(gait(), parameters)


def _summary(entry: Mapping[str, Any]) -> dict[str, Any]:
    """What the table says of a contender: its median tick, µs, or why there is none."""
    times = next(iter(entry.get("times", {}).values()), None)
    return {
        "reason": entry["reason"],
        "p50_us": None if times is None else times["tick"]["p50_us"],
        "difference": entry.get("difference_max", {}).get("torque"),
    }
