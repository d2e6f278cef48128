"""Settings of a walk that follow from the robot: its legs, its feet, and the height at which it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Build", "build_of"]


@dataclass(frozen=True)
class Build:
    """How a robot is built, in the posture in which it stands, heading along x.

    Attributes:
        centre: (3,) centre of mass about the body's origin, m.
        height: of the body's origin above the ground, m.
        point: (points, 3) contact points about the body's origin, m.
        place: (feet, 3) middles of the feet likewise, m.
        foot: (points,) the foot that each contact point is of.
        leg: length of a stretched leg from hip to foot, m; the shortest of all.
        hip_height: of the lowest hip above the ground, m.
    """

    centre: Vector
    height: float
    point: Vector
    place: Vector
    foot: NDArray[np.int64]
    leg: float
    hip_height: float


def build_of(robot: Robot, q: Vector) -> Build:
    """How a robot is built.

    Args:
        robot: with feet.
        q: (nq,) configuration in which it stands.
    """
    model, data = robot.model, robot.model.createData()
    centre = np.array(pin.centerOfMass(model, data, q)) - q[:3]
    pin.updateFramePlacements(model, data)
    point = np.array([data.oMf[robot.frame_id(name)].translation - q[:3] for name in robot.feet])
    foot = np.repeat(np.arange(len(robot.corners)), robot.corners)
    place = np.array([point[foot == k].mean(axis=0) for k in range(len(robot.corners))])
    legs, hips = [], []
    for k, name in enumerate(np.array(robot.feet)[np.unique(foot, return_index=True)[1]]):
        chain = [j for j in model.supports[model.frames[robot.frame_id(name)].parentJoint] if j > 1]
        joints = chain[-2:] if robot.corners[k] == 1 else chain[-4:]
        points = [data.oMi[j].translation - q[:3] for j in joints] + [place[k]]
        legs.append(sum(float(np.linalg.norm(b - a)) for a, b in zip(points[:-1], points[1:], strict=True)))
        hips.append(float(points[0][2] - place[k, 2]))
    return Build(centre, float(q[2]), point, place, foot, min(legs), max(hips))
