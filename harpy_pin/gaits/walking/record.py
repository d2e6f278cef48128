"""What a walking gait knows, has measured and remembers, for kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.gaits.velocity import VelocityRecord
from harpy_pin.gaits.walking.build import Build, Pace
from harpy_pin.ground.surface import TerrainRecord
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import TreeRecord


class MeasuredRecord(RecordOf):
    """What the last good state says. A foot is a point, or a sole with several contact points."""

    seen: int = ZERO  # 1 once a state was measured
    ground: float = 0.0  # height of the plane that fits the ground around the body, m
    body: Vector = sized(6)  # place (m) and velocity (m/s) of the body's origin, world axes
    heading: float = 0.0  # in which the robot faces, rad
    centre: Vector = sized(6)  # place (m) and velocity (m/s) of the centre of mass
    spin: Vector = sized(3)  # angular momentum about it, per mass, m²/s
    # horizontal velocity of a pendulum with the robot's angular momentum about the ground below it,
    # along ``line`` that
    # of the centre of mass, m/s
    drift: Vector = sized(2)
    line: Vector = sized(
        2
    )  # direction of the line of two stance feet of four or more; zero where others are down
    point: Vector = sized("points", 3)  # places of the contact points, m
    place: Vector = sized("feet", 3)  # middles of the feet, m
    turned: Vector = sized("feet")  # heading of each foot, rad
    load: Vector = sized("feet")  # normal force on each foot, of the last samples, N


class WalkingRecord(VelocityRecord, Build, Pace):
    """What :class:`~harpy_pin.gaits.walking.WalkingGait` knows, has measured and remembers.

    How the robot is built and how fast it walks are the numbers of :class:`Build` and
    :class:`Pace`.
    """

    tree: TreeRecord  # bodies and joints of the robot
    terrain: TerrainRecord  # the ground; all heights below are above it
    steps_over: int  # 1 where swing feet go over the ground by world heights: ``lift`` holds these
    ground_reach: float  # half the side of the square to which that plane is fitted, m
    point_body: NDArray[np.int64]  # (points,) the body to which each contact point is fixed
    point_offset: Vector  # (points, 3) its place there, m
    corner: Vector  # (points, 2) its place about the foot's middle, axes of the foot, m
    own: Vector  # (points, 2) the same in the axes of its sole, m
    askew: Vector  # (feet,) how far these axes are turned to the left of those of the foot, rad
    facing: float  # yaw of the direction in which the robot faces, about its base's axes, rad
    group: NDArray[np.int64]  # (feet,) in which step of the cycle each foot swings
    groups: int  # steps of a cycle
    nominal: Vector  # (feet, 2) place of each foot about the centre of mass, axes of the heading, m
    spread: Vector  # (feet, 2) that about the mean of its group, m
    middle: Vector  # (groups, 2) mean of those of a group, m; of soles, of the present step
    sways: int  # 1 where two groups stand apart, so that the body goes to and fro between them
    step_duration: float  # T of the present step, from one touchdown to the next, s
    double_support: float  # share of the present step in which every foot is on the ground
    # share of its largest normal force up to which a foot's load rises over that time, and from
    # which it falls, at the
    # largest speed
    fast_load_ramp: float
    slow_load_ramp: float  # that of a robot that hardly walks
    start_time: float  # for which the robot stands on every foot before its first step, s
    omega: float  # of the pendulum, 1/s
    clearance: float  # height of a foot at mid-swing, m
    penetration_offset: float  # how much deeper than the ground a swing foot aims, m
    low: float  # height from which on a foot goes down slowly, m
    deeper: float  # how much deeper than the ground it then aims, m
    arrives: float  # share of its swing before its end at which a foot is almost where it lands
    # distance of the centre of mass from a single stance foot on a point at which the next one
    # should land, m
    lean: float
    touch_force: float  # normal force from which on a foot touches the ground, N
    acceleration: (
        Vector  # (2,) largest change of the applied velocity, forward and to the side, m/s²
    )
    turn_acceleration: float  # largest change of the applied turning velocity, rad/s²
    height_range: Vector  # (2,) least and largest change of the height, m
    always: int  # 1 where it steps at zero command, too
    holds_heading: int  # 1 where the stance feet can hold the heading
    soles: int  # 1 where feet are flat
    raised: float = 0.0  # present change of the height, m
    back: Vector = sized(2)  # velocity on the way back to the path, world axes, m/s
    desired: Vector = sized(2)  # velocity of the centre of mass, world axes, m/s
    demand: Vector = sized(2)  # acceleration of the centre of mass, world axes, m/s²
    pressure: Vector = sized(2)  # centre of pressure that goes with it, m
    time: float = -1.0  # of the last update, s; −1 before the first
    walking: int = ZERO  # 1 while it steps
    phase: float = 0.0  # share of the present step that is done
    haste: float = 1.0  # how much faster than its clock the present step goes on
    load_ramp: float = 1.0  # that of the present step
    # largest pitch in the present step of the foot that swings in it, rad; heel up is positive
    roll: float = 0.0
    pitch: Vector = sized(3)  # its present pitch, rate and acceleration, rad, rad/s and rad/s²
    pivot: Vector = sized(3)  # middle of the edge about which it rolls, m
    swings: int = ZERO  # the group that swings in the present step
    steps: int = ZERO  # made since the walk began
    in_air: Vector = sized("feet")  # 1 for a swing foot
    since: Vector = sized("feet")  # time since the last touchdown, s
    lifted_at: Vector = sized("feet")  # height of a swing foot when it was lifted, m
    felt: Vector = sized(
        "feet"
    )  # height of the ground that each foot met last, where that is not what was expected, m
    touched: Vector = sized("feet")  # height below which a stance foot touches the ground, m
    settled: Vector = sized("feet")  # 1 once a stance foot has settled
    pressed: Vector = sized("feet")  # mean of its load, N
    rest: Vector = sized("feet")  # mean of its height, m
    foothold: Vector = sized("feet", 3)  # where it lands, m, and its heading there, rad
    # place, velocity and acceleration of x, y (m) and heading (rad) of a swing foot
    swing: Vector = sized("feet", 3, 3)
    lift: Vector = sized("feet", 3)  # its height, velocity and acceleration
    held: Vector = sized(
        "feet", 4
    )  # acceleration of x, y, heading and height until the next update
    # height to which it rises, where feet step over the ground: it stays when an edge is behind, m
    risen: Vector = sized("feet")
    measured: MeasuredRecord  # the last good state
