"""How a robot is built that walks."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from harpy_pin.gaits.walking.parameters import WalkingParameters
from harpy_pin.gaits.walking.rolling import soles_of
from harpy_pin.model.legs import legs
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector


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
    hip: float  # height of the hips above the feet, of four legs and of soles, m
    # (feet,) how far each foot is to the left of the axis about which its leg swings sideways, m
    beside: Vector
    # largest horizontal one that the weakest motor of a hip alone gives a foot, m/s²
    swing_acceleration: float
    # (feet, 2, 3) what each foot's acceleration relative to the body gives a pendulum with the
    # robot's angular momentum about the ground, forward and to the left
    reaction: Vector
    turning: Vector  # (feet, 2, 3) what of that is of the angular momentum about the centre of mass
    # share of the torque of a knee, the weakest, that holds the robot on one sole; zero on points
    knee: float
    narrow: float  # largest distance of the two groups of feet between which the body sways, m
    sole: Vector  # (2,) length and width of the largest sole; zero of points, m
    point_body: NDArray[np.int64]  # (points,) the body to which each contact point is fixed
    point_offset: Vector  # (points, 3) its place there, m
    corner: Vector  # (points, 2) its place about the foot's middle, axes of the foot, m
    own: Vector  # (points, 2) the same in the axes of its sole, m
    askew: Vector  # (feet,) how far these axes are turned to the left of those of the foot, rad
    facing: float  # yaw of the direction in which the robot faces, about its base's axes, rad
    soles: bool  # whether feet are flat

    def around(self) -> Vector:
        """(feet, 2) middles of the feet about their common middle, m."""
        places = self.place[:, :2]
        return np.asarray(places - places.mean(axis=0))


def build_of(robot: Robot, q: Vector, w: WalkingParameters) -> Build:
    """How a robot with feet is built that stands in the configuration q."""
    soles = robot.on_soles
    posed, model = Posed(robot, q), robot.model
    centre = posed.centre - q[:3]
    point = np.array([posed.frame(name).translation - q[:3] for name in robot.feet])
    foot = np.repeat(np.arange(len(robot.corners)), robot.corners)
    place = np.array([point[foot == k].mean(axis=0) for k in range(len(robot.corners))])
    inertia, limit = posed.mass_matrix, robot.torque_limit
    lengths, hips, knees, swings, beside = [], [], [], [], np.zeros(len(robot.corners))
    for k, leg in enumerate(legs(robot)):
        points = [*(posed.joint(j) - q[:3] for j in leg.way), place[k]]
        lengths.append(sum(float(np.linalg.norm(b - a)) for a, b in pairwise(points)))
        knees.append(limit[leg.columns[leg.knee] - 6])
        hips.append(float(points[0][2] - place[k, 2]))
        if len(robot.corners) > 2 and leg.knee > 1:
            beside[k] = place[k, 1] + q[1] - posed.joint(leg.joints[0])[1]
        top = max(leg.knee - 1, 0)
        for n in (top,) if robot.corners[k] < 3 else range(max(leg.knee, 1)):  # soles roll, too
            column = leg.columns[n]
            arm = float(posed.joint(leg.joints[n])[2] - q[2] - place[k, 2])
            swings.append(arm * limit[column - 6] / float(inertia[column, column]))
    length, hip = min(lengths), max(hips)
    bent, stretched = (w.sole_hip_height, w.sole_stretch) if soles else (w.hip_height, w.stretch)
    # Lower than the posture, where its legs would be almost stretched.
    lower = max(hip - bent * length, 0.0)
    reach = float(np.sqrt(max((stretched * length) ** 2 - (hip - lower) ** 2, 0.0)))
    rise = float(centre[2] - point[:, 2].min()) - lower
    reaction, turning = _reactions(posed, rise)
    frames = [model.frames[robot.frame_id(name)] for name in robot.feet]
    corner = (point - place[foot])[:, :2]
    own, askew = soles_of(corner, foot)
    sides = np.array([np.ptp(point[foot == k, :2], axis=0) for k in range(len(place))])
    inner = w.sole_narrow * rise + 2.0 * w.inner * float(sides[:, 1].min())
    moment = 0.5 * length * float(np.sqrt(1.0 - w.sole_hip_height**2)) * robot.mass * GRAVITY
    return Build(
        point=point,
        foot=foot,
        place=place,
        leg=length,
        height=float(q[2]) - lower,
        rise=rise,
        reach=reach,
        hip=hip - lower if len(place) > 2 or soles else 0.0,
        beside=beside,
        swing_acceleration=min(swings),
        reaction=reaction,
        turning=turning,
        knee=moment / min(knees) if soles else 0.0,
        narrow=inner if soles else w.narrow * rise,
        sole=sides.max(axis=0) if soles else np.zeros(2),
        point_body=np.array([frame.parentJoint - 1 for frame in frames], dtype=np.int64),
        point_offset=np.array([frame.placement.translation for frame in frames]),
        corner=corner,
        own=own,
        askew=askew,
        facing=robot.facing,
        soles=soles,
    )


def _reactions(posed: Posed, rise: float) -> Vector:
    """(2, feet, 2, 3) velocity of the pendulum for a velocity of each foot relative to the body, in
    the posture; and what of it is of the angular momentum about the centre of mass.
    """
    robot = posed.robot
    momentum = posed.momentum_map / robot.mass
    turning = np.array((momentum[4], -momentum[3])) / rise
    both = np.array((momentum[:2] + turning, turning))
    starts = np.cumsum((0, *robot.corners))
    found = np.empty((2, len(robot.corners), 2, 3))
    for k in range(len(robot.corners)):
        jacobian = np.zeros((3, robot.nv))
        for name in robot.feet[starts[k] : starts[k + 1]]:
            jacobian += posed.jacobian(name)[:3]
        jacobian /= robot.corners[k]
        jacobian[:, :6] = 0.0
        found[:, k] = both @ np.linalg.pinv(jacobian)
    return found
