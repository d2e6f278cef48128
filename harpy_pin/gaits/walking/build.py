"""How a robot is built, in the posture in which it stands, and by which schedules its feet step."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["BY_FEET", "FOUR_FEET", "TWO_FEET", "Build", "Pace", "build_of", "draw_together", "groups_of"]

NARROW, SOLE_NARROW = 0.27, 0.15
"""Largest distance of the two centres of pressure between which the body sways, on points and on soles, in heights of
the centre of mass: a pendulum needs half of it as friction."""
INNER = 0.35
"""How far the centre of pressure may come towards the other foot from the middle of a sole, in its widths."""
BENT, STRETCHED = 0.92, 0.98
"""Largest height of the hip while it walks, and largest distance from there to the foot, in lengths of the leg."""


@dataclass(frozen=True)
class Build:
    """How a robot is built, in the posture in which it stands, heading along x."""

    point: Vector  # (points, 3) contact points about the body's origin, m
    foot: NDArray[np.int64]  # (points,) the foot that each contact point is of
    place: Vector  # (feet, 3) middles of the feet about the body's origin, m
    leg: float  # length of a stretched leg from hip to foot, the shortest of all, m
    height: float  # of the body's origin above the ground while it walks, m
    rise: float  # height of the centre of mass above the ground while it walks, m
    reach: float  # largest horizontal distance of a foot from its hip, m
    hip: float  # height of the hips above the feet, of four legs, m
    beside: Vector  # (feet,) how far each foot is to the left of the axis about which its leg swings sideways, m
    swing_acceleration: float  # largest horizontal one that the motors of the weakest leg's hip alone give a foot, m/s²
    # (feet, 2, 3) what each foot's acceleration relative to the body gives a pendulum with the robot's angular momentum
    # about the ground, forward and to the left
    reaction: Vector
    narrow: float  # largest distance of the two groups of feet between which the body sways, m


@dataclass(frozen=True)
class Pace:
    """How long the steps of a walk last, and how fast it goes."""

    usual_step: float  # time from one touchdown to the next of a slow walk, s
    fast_double_support: float  # share of a step in which every foot is on the ground, at the largest speed
    slow_double_support: float  # the same of a robot that hardly walks
    gentle: bool  # whether feet go down slowly, and take over the load slowly
    stride: float  # longest way of a step, m: beyond, steps are shorter in time
    max_speed: float  # largest velocity of a foot's place, m/s


def build_of(robot: Robot, q: Vector) -> Build:
    """How a robot with feet is built that stands in the configuration q."""
    model, data = robot.model, robot.model.createData()
    centre = np.array(pin.centerOfMass(model, data, q)) - q[:3]
    pin.updateFramePlacements(model, data)
    point = np.array([data.oMf[robot.frame_id(name)].translation - q[:3] for name in robot.feet])
    foot = np.repeat(np.arange(len(robot.corners)), robot.corners)
    place = np.array([point[foot == k].mean(axis=0) for k in range(len(robot.corners))])
    inertia = pin.crba(model, data, q)
    legs, hips, swings, beside = [], [], [], np.zeros(len(robot.corners))
    for k, first in enumerate(np.unique(foot, return_index=True)[1]):
        chain = [j for j in model.supports[model.frames[robot.frame_id(robot.feet[first])].parentJoint] if j > 1]
        joints = chain[-2:] if robot.corners[k] == 1 else chain[-4:]  # from the hip's pitch on
        points = [*(data.oMi[j].translation - q[:3] for j in joints), place[k]]
        legs.append(sum(float(np.linalg.norm(b - a)) for a, b in pairwise(points)))
        hips.append(float(points[0][2] - place[k, 2]))
        if len(robot.corners) == 4 and len(chain) > len(joints):
            beside[k] = place[k, 1] + q[1] - data.oMi[chain[0]].translation[1]
        column = model.joints[joints[0]].idx_v
        swings.append(float(hips[-1] * model.effortLimit[column] / inertia[column, column]))
    leg, hip = min(legs), max(hips)
    lower = max(hip - BENT * leg, 0.0)  # than the posture, where its legs would be almost stretched
    reach = float(np.sqrt(max((STRETCHED * leg) ** 2 - (hip - lower) ** 2, 0.0)))
    rise = float(centre[2] - point[:, 2].min()) - lower
    height, over = float(q[2]) - lower, hip - lower if len(legs) == 4 else 0.0
    reactions = _reactions(robot, q, rise)
    narrow = NARROW * rise
    if robot.flat_feet:
        narrow = SOLE_NARROW * rise + 2.0 * INNER * min(float(np.ptp(point[foot == k, 1])) for k in range(len(place)))
    return Build(point, foot, place, leg, height, rise, reach, over, beside, min(swings), reactions, narrow)


def _reactions(robot: Robot, q: Vector, rise: float) -> Vector:
    """(feet, 2, 3) velocity of the pendulum for a velocity of each foot relative to the body, in the posture."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    momentum = np.array(pin.computeCentroidalMap(model, data, q)) / robot.mass
    pendulum = np.array((momentum[0] + momentum[4] / rise, momentum[1] - momentum[3] / rise))
    starts = np.cumsum((0, *robot.corners))
    found = np.empty((len(robot.corners), 2, 3))
    for k in range(len(robot.corners)):
        jacobian = np.zeros((3, model.nv))
        for name in robot.feet[starts[k] : starts[k + 1]]:
            jacobian += pin.getFrameJacobian(model, data, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED)[:3]
        jacobian /= robot.corners[k]
        jacobian[:, :6] = 0.0
        found[k] = pendulum @ np.linalg.pinv(jacobian)
    return found


def draw_together(places: Vector, group: NDArray[np.int64], most: float) -> float:
    """Move two groups of feet, 0 and 1, in place, until their middles are apart by ``most`` at most.

    The places are (feet, 2), about their common middle. Returns the distance of the two middles then.
    """
    middles = [places[group == g].mean(axis=0) for g in range(2)]
    apart = float(np.linalg.norm(middles[1] - middles[0]))
    share = max(1.0 - most / apart, 0.0) if apart > 0.0 else 0.0
    for g in range(2):
        places[group == g] -= share * middles[g]
    return (1.0 - share) * apart


Steps = tuple[tuple[str, ...], ...]
FOUR_FEET: dict[str, Steps] = {
    "trot": (("left front", "right hind"), ("right front", "left hind")),
    "crawl": (("left hind",), ("left front",), ("right hind",), ("right front",)),
    "pace": (("left front", "left hind"), ("right front", "right hind")),
    "bound": (("left front", "right front"), ("left hind", "right hind")),
}
"""Feet of four-legged robots that swing together, step after step."""
TWO_FEET: dict[str, Steps] = {"walk": (("left",), ("right",)), "step": (("left",), ("right",))}
"""Feet of bipeds that swing, step after step; ``step`` goes on stepping where it stands."""
BY_FEET = {2: TWO_FEET, 4: FOUR_FEET}
"""By the number of feet."""


def groups_of(schedule: str, places: Vector) -> NDArray[np.int64]:
    """(feet,) the step of the cycle in which each foot swings.

    Args:
        schedule: a name of :data:`FOUR_FEET`, of :data:`TWO_FEET`, or ``stand``.
        places: (feet, 2) of the feet about their middle, x forward and y to the left, m.

    Raises:
        InputError: an unknown name, one for another number of feet, or two feet in the same quarter.
    """
    known = BY_FEET.get(len(places), {})
    checks.one_of("schedule", schedule, ("stand", *known))
    if schedule == "stand":
        return np.zeros(len(places), dtype=np.int64)
    names = []
    for x, y in places:
        side = "left" if y > 0.0 else "right"
        names.append(side if len(places) == 2 else f"{side} {'front' if x > 0.0 else 'hind'}")
    if len(set(names)) < len(names):
        raise InputError(f"the feet must be in different quarters about their middle, got {names}", name="robot")
    steps = known[schedule]
    return np.array([next(g for g, feet in enumerate(steps) if name in feet) for name in names], dtype=np.int64)
