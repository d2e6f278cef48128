"""Rods that close loops: a loop of a length is a rod without mass, which no link draws."""

from dataclasses import dataclass

import numpy as np

from harpy_pin.model.loops import Loop
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.nodes import Cylinder, Look, Motion, Motions, Node, turn_z_to

ROD = Look("#bfc2c7", light="body")
RADIUS = 0.015
"""Of a rod, in its length."""


@dataclass(frozen=True, eq=False)
class LoopRod:
    """One rod."""

    path: str  # of its node
    joint: tuple[int, int]  # Pinocchio's numbers of the joints that carry its ends
    offset: Vector  # (2, 3) of the ends in their frames, m
    length: float  # m

    @property
    def nodes(self) -> list[Node]:
        """The rod, along z about its middle."""
        return [Node(f"{self.path}/rod", Cylinder(self.length, RADIUS * self.length), ROD)]

    def motions(self, joints: Vector) -> Motions:
        """Where it is, from (n, model joints, 4, 4) joint placements."""
        ends = [
            joints[:, joint, :3, :3] @ offset + joints[:, joint, :3, 3]
            for joint, offset in zip(self.joint, self.offset, strict=True)
        ]
        way = ends[1] - ends[0]
        turn = turn_z_to(way / np.linalg.norm(way, axis=1, keepdims=True))
        return {self.path: Motion(position=0.5 * (ends[0] + ends[1]), quaternion=turn)}


def _loops(robot: Robot) -> list[Loop]:
    ties = () if robot.loops is None else robot.loops.ties
    return [tie for tie in ties if isinstance(tie, Loop)]


def loop_ends(robot: Robot) -> list[str]:
    """Names of the frames that loops hold together."""
    return [name for loop in _loops(robot) for name in (loop.first, loop.second)]


def loop_rods(robot: Robot) -> list[LoopRod]:
    """The rods of a robot."""
    rods = list[LoopRod]()
    for number, tie in enumerate(_loops(robot)):
        if tie.kind == "length":
            one, other = (robot.model.frames[robot.frame_id(n)] for n in (tie.first, tie.second))
            offset = np.array((one.placement.translation, other.placement.translation))
            joint = (one.parentJoint, other.parentJoint)
            rods.append(LoopRod(f"loop_rods/{number}", joint, offset, tie.length))
    return rods
