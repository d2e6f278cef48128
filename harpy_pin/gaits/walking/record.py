"""What a walking gait knows, has measured and remembers, for kernels: a record for what each of its
files finds, which no other file writes.

The tuned numbers, the build of the robot and the pace are written by Python alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.gaits.velocity import VelocityRecord
from harpy_pin.gaits.walking.build import Build
from harpy_pin.gaits.walking.pace import Pace
from harpy_pin.gaits.walking.parameters import TunedRecord, WalkingParameters
from harpy_pin.gaits.walking.schedules import draw_together
from harpy_pin.ground.surface import TerrainRecord, flat_terrain
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.model.tree import TreeRecord, tree_record


class BuildRecord(RecordOf, Build):
    """The numbers of :class:`Build`."""


class PaceRecord(RecordOf, Pace):
    """The numbers of :class:`Pace`, and what else the walk has from the start."""

    group: NDArray[np.int64]  # (feet,) in which step of the cycle each foot swings
    groups: int  # steps of a cycle
    nominal: Vector  # (feet, 2) place of each foot about the centre of mass, axes of the heading, m
    spread: Vector  # (feet, 2) that about the mean of its group, m
    sways: int  # 1 where two groups stand apart, so that the body goes to and fro between them
    always: int  # 1 where it steps at zero command, too
    holds_heading: int  # 1 where the stance feet can hold the heading
    steps_over: int  # 1 where swing feet go over the ground by world heights: ``lift`` holds these
    ground_reach: float  # half the side of the square to which the ground's plane is fitted, m
    # share of its largest normal force up to which a foot's load rises over the double support, and
    # from which it falls, at the largest speed; and of a robot that hardly walks
    fast_load_ramp: float
    slow_load_ramp: float
    start_time: float  # for which the robot stands on every foot before its first step, s
    omega: float  # of the pendulum, 1/s
    clearance: float  # height of a foot at mid-swing, m
    low: float  # height from which on a foot goes down slowly, m
    deeper: float  # how much deeper than the ground it then aims, m
    arrives: float  # share of its swing before its end at which a foot is almost where it lands
    # distance of the centre of mass from a single stance foot on a point at which the next one
    # should land, m
    lean: float
    touch_force: float  # normal force from which on a foot touches the ground, N


class MeasuredRecord(RecordOf):
    """What the last good state says, of ``measuring``. A foot is a point, or a sole with several
    contact points.
    """

    tree: TreeRecord  # bodies and joints of the robot
    seen: int = ZERO  # 1 once a state was measured
    ground: float = 0.0  # height of the plane that fits the ground around the body, m
    body: Vector = sized(6)  # place (m) and velocity (m/s) of the body's origin, world axes
    heading: float = 0.0  # in which the robot faces, rad
    centre: Vector = sized(6)  # place (m) and velocity (m/s) of the centre of mass
    spin: Vector = sized(3)  # angular momentum about it, per mass, m²/s
    # horizontal velocity of a pendulum with the robot's angular momentum about the ground below it,
    # along ``line`` that of the centre of mass, m/s
    drift: Vector = sized(2)
    # direction of the line of two stance feet of four or more; zero where others are down
    line: Vector = sized(2)
    point: Vector = sized("points", 3)  # places of the contact points, m
    place: Vector = sized("feet", 3)  # middles of the feet, m
    turned: Vector = sized("feet")  # heading of each foot, rad
    load: Vector = sized("feet")  # normal force on each foot, of the last samples, N


class PlannedRecord(VelocityRecord):
    """Velocity and path, of ``path``."""

    acceleration: Vector  # (2,) largest change of the velocity, forward and to the side, m/s²
    turn_acceleration: float  # largest change of the turning velocity, rad/s²
    height_range: Vector  # (2,) least and largest change of the height, m
    raised: float = 0.0  # present change of the height, m
    back: Vector = sized(2)  # velocity on the way back to the path, world axes, m/s
    desired: Vector = sized(2)  # velocity of the centre of mass, world axes, m/s


class StepsRecord(RecordOf):
    """The present step, and which feet are down, of ``contacts``."""

    duration: float  # T, from one touchdown to the next, s
    double_support: float  # share of it in which every foot is on the ground
    load_ramp: float = 1.0  # present one, see PaceRecord
    walking: int = ZERO  # 1 while it steps
    phase: float = 0.0  # share of the step that is done
    haste: float = 1.0  # how much faster than its clock it goes on
    swings: int = ZERO  # the group that swings in it
    made: int = ZERO  # steps since the walk began
    in_air: Vector = sized("feet")  # 1 for a swing foot
    since: Vector = sized("feet")  # time since the last touchdown, s
    # height of the ground that each foot met last, where that is not what was expected, m
    felt: Vector = sized("feet")
    touched: Vector = sized("feet")  # height below which a stance foot touches the ground, m
    settled: Vector = sized("feet")  # 1 once a stance foot has settled
    pressed: Vector = sized("feet")  # mean of its load, N
    rest: Vector = sized("feet")  # mean of its height, m


class RollRecord(RecordOf):
    """How the sole rolls that swings in the present step, of ``rolling``."""

    largest: float = 0.0  # its largest pitch, rad; heel up is positive
    pitch: Vector = sized(3)  # present pitch, rate and acceleration, rad, rad/s and rad/s²
    pivot: Vector = sized(3)  # middle of the edge about which it rolls, m


class FootholdsRecord(RecordOf):
    """Where swing feet land, of ``footholds``."""

    middle: Vector  # (groups, 2) mean of ``nominal`` of a group, m; of soles, of the present step
    place: Vector = sized("feet", 3)  # x and y, m, and heading, rad


class SwingRecord(RecordOf):
    """The swing feet, of ``swinging``."""

    # place, velocity and acceleration of x, y (m) and heading (rad)
    motion: Vector = sized("feet", 3, 3)
    lift: Vector = sized("feet", 3)  # height, its velocity and its acceleration
    held: Vector = sized("feet", 4)  # acceleration of x, y, heading, height until the next update
    lifted_at: Vector = sized("feet")  # height at which each was lifted, m
    # height to which it rises, where feet step over the ground: it stays when an edge is behind, m
    risen: Vector = sized("feet")


class DemandRecord(RecordOf):
    """What the stance feet are to give the body, of ``body``."""

    acceleration: Vector = sized(2)  # of the centre of mass, world axes, m/s²
    pressure: Vector = sized(2)  # centre of pressure that goes with it, m


class WalkingRecord(RecordOf):
    """What :class:`~harpy_pin.gaits.walking.WalkingGait` knows, has measured and remembers."""

    tuned: TunedRecord
    build: BuildRecord
    pace: PaceRecord
    terrain: TerrainRecord  # the ground; all heights are above it
    measured: MeasuredRecord
    planned: PlannedRecord
    steps: StepsRecord
    roll: RollRecord
    footholds: FootholdsRecord
    swing: SwingRecord
    demand: DemandRecord
    time: float = -1.0  # of the last update, s, of ``tick``; −1 before the first


def walking_record(
    robot: Robot,
    build: Build,
    pace: Pace,
    group: NDArray[np.int64],
    w: WalkingParameters,
    *,
    clearance: float,
    max_speed: float,
    steps_at_rest: bool,
) -> Records[WalkingRecord]:
    """The record of a robot that stands, and steps at zero command where that is said."""
    feet, groups, soles = len(build.place), int(group.max()) + 1, build.soles
    sizes = {"feet": feet, "points": len(robot.feet), "entries": 4}
    omega, leg, usual = float(np.sqrt(GRAVITY / build.rise)), build.leg, pace.usual_step
    balances = feet == 2 and not soles and groups == 2
    nominal = build.around()
    sways = groups == 2 and draw_together(nominal, group, build.narrow) > w.sway * build.rise
    middle = np.array([nominal[group == g].mean(axis=0) for g in range(groups)])
    max_aside, aside = np.inf, w.acceleration
    if balances:
        max_aside = (1.0 - w.apart) * float(np.ptp(nominal[:, 1])) / usual
    elif feet == 2 and groups == 2:
        max_aside = w.sole_aside * float(np.sqrt(GRAVITY * leg))
        aside = w.sole_shift * float(np.expm1(omega * usual)) / usual**2
    # On two points the friction bounds the way of a foot, too: a pendulum needs as much.
    reach = min(build.reach, w.steepest * build.rise) if balances else build.reach
    near = (w.near if pace.gentle else w.straight_near) if feet > 2 else 0.0
    return make_record(
        WalkingRecord,
        tuned=make_record(TunedRecord, **vars(w)),
        build=make_record(BuildRecord, **{**vars(build), "reach": reach}),
        pace=make_record(
            PaceRecord,
            **vars(pace),
            group=group,
            groups=np.int64(groups),
            nominal=nominal,
            spread=nominal - middle[group],
            sways=np.int64(sways),
            always=np.int64(steps_at_rest or balances),
            holds_heading=np.int64(len(robot.feet) > feet or feet > 2),
            steps_over=np.int64(0),
            ground_reach=0.0,
            fast_load_ramp=w.fast_load_ramp if pace.gentle else 1.0,
            slow_load_ramp=w.load_ramp if pace.gentle else 1.0,
            start_time=0.0 if feet == 2 and not soles else w.start * float(np.sqrt(leg / GRAVITY)),
            omega=omega,
            clearance=clearance,
            low=w.low * clearance if pace.gentle else 0.0,
            deeper=(w.aim if pace.gentle else 1.0) * w.penetration_offset,
            arrives=1.0 - w.settle if soles else near,
            lean=w.lean * build.rise if balances else np.inf,
            touch_force=max(w.touch_force * robot.mass * GRAVITY / feet, w.min_touch_force),
        ),
        terrain=flat_terrain(),
        measured=make_record(MeasuredRecord, sizes, tree=tree_record(robot.model, robot.loops)),
        planned=make_record(
            PlannedRecord,
            sizes,
            radius=np.hypot(*nominal.T).max(),
            max_speed=max_speed,
            max_aside=max_aside,
            max_turn=w.max_turn,
            max_bend=aside,
            acceleration=np.array((w.acceleration, aside)),
            turn_acceleration=w.turn_acceleration,
            height_range=np.array((-w.max_lower, w.max_higher)) * build.height,
        ),
        steps=make_record(
            StepsRecord, sizes, duration=usual, double_support=pace.slow_double_support
        ),
        roll=make_record(RollRecord),
        footholds=make_record(FootholdsRecord, sizes, middle=middle),
        swing=make_record(SwingRecord, sizes),
        demand=make_record(DemandRecord),
    )
