"""How a robot is built, in which order its feet step, and how fast it walks by the inverse dynamics
of its legs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.fitting import GRAVITY, leg_length
from harpy_pin.gaits.velocity import warn_maker
from harpy_pin.gaits.walking.pendulum import NEAR, STRAIGHT_NEAR, UPRIGHT_END, toward, upright_end
from harpy_pin.model.legs import legs
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

NARROW, SOLE_NARROW = 0.27, 0.15
"""Largest distance of the two centres of pressure between which the body sways, on points and on
soles, in heights of the centre of mass: a pendulum needs half of it as friction.
"""
INNER = 0.35
"""How far the centre of pressure may come towards the other foot from the middle of a sole, in its
widths.
"""
BENT, SOLE_BENT, STRETCHED, SOLE_STRETCHED = 0.92, 0.9, 0.98, 0.965
"""Largest height of the hip while it walks, on points and on soles, and largest distance from there
to the foot, on both, in lengths of the leg.
"""
STEP, SOLE_STEP, FAST_SOLE_STEP = 0.82, 1.7, 1.25
"""Duration of a step on points and on soles, slow and at the largest speed, in √(leg / g)."""
SWING = 15.5
"""Least duration of a step of heavy legs with weak motors, in √(g leg) over the acceleration that
these give a foot.
"""
STRIDE = 0.6
"""Longest way of a step, in lengths of the leg."""
BOTH, POINT_BOTH, SOLE_BOTH = 0.05, 0.1, 0.15
"""Share of a step in which every foot is on the ground: on four feet, on two points, on soles."""
SLOW_BOTH = 0.2
"""This share on four feet that hardly walk: soft ground hardly moves feet to which the load goes
over slowly.
"""
SPEED, SLOW_SPEED, SOLE_SPEED, ROLLING_SPEED = 0.8, 0.65, 0.26, 0.33
"""Largest velocity of a foot's place in √(g leg): where two groups of point feet on four legs take
turns; on other points; on four soles; on two, which roll.
"""
SLOW = 0.1
"""Share of this velocity below which a robot is said to be slow."""
LEFT, KNEE = 0.75, 0.62
"""Share that is used of the reach that is left where feet are drawn together: a stretched leg
cannot push. On two soles all of it, as long as a knee needs no more than this share of its torque
for the weight.
"""
MOST_PUSH, FREE_PUSH = 0.25, 0.22
"""Largest acceleration of the body by legs that are swung, as a share of gravity; and that from
which on their motors, which then have to hold the body too, swing them with less of their torques.
"""
PEAK = 15.6
"""Peak of the acceleration of two feet that are swung, in the velocity of the walk over the
duration of a step.
"""
MOST_LOAD = 0.85
"""Largest torque of a leg that swings in a trot, pace or bound, as a share of its limit; in other
walks all of it.
"""
MORE_LOAD = 1.1
"""The same of such a walk in which lifting a foot takes more than that, and so lifts it less, as a
share of this.
"""
DIRECTION = 0.3
"""Least singular value of the Jacobian of a level sole that moves forward and aside, in lengths of
the leg.
"""
SHORT_LEG = "'{}' has a leg of fewer than three joints: its feet cannot go aside"
"""Why a robot cannot walk."""
SAMPLES = 30
"""Samples of a swing."""
ITERATIONS = 6
"""Iterations of the inverse kinematics at each of them, from the one before."""
SMALL = 1e-6
"""Regularises it where a leg is stretched, m²."""
HALVINGS = 7
"""How often the range of speeds is halved."""


def why_no_walk(robot: Robot) -> str:
    """Why the legs of a robot cannot walk, in one sentence; empty where they can.

    A foot has to go forward and aside, and a sole to stay level on its way: directions of the
    foot's Jacobian that the joints of its leg have to have, in the posture or at zero. They need
    not turn it about the vertical.
    """
    model, data, q = robot.model, robot.model.createData(), pin.neutral(robot.model)
    q[7:] = (
        np.clip(0.0, robot.joint_lower, robot.joint_upper)
        if robot.posture is None
        else robot.posture
    )
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    for leg in legs(robot):
        joints = len(leg.joints)
        if joints < 3:
            return SHORT_LEG.format(robot.name)
        frames = [robot.frame_id(name) for name in leg.points]
        jacobian = np.mean(
            [pin.getFrameJacobian(model, data, k, pin.LOCAL_WORLD_ALIGNED) for k in frames], axis=0
        )
        level = jacobian[:, [model.joints[j].idx_v for j in leg.joints]][
            [0, 4, 1, 3]
        ]  # (forward, pitch, aside, roll)
        level[[0, 2]] /= leg_length(robot)
        way, size, _ = np.linalg.svd(level)
        if len(frames) > 1 and size[-1] < DIRECTION:
            where = "aside" if np.abs(way[2:, -1]).max() > np.abs(way[:2, -1]).max() else "forward"
            return (
                f"'{robot.name}' cannot walk on soles: the {joints} joints of the leg of "
                f"'{leg.points[0]}' "
                f"cannot move it {where} and keep it level"
            )
    return ""


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
    swing_acceleration: (
        float  # largest horizontal one that the weakest motor of a hip alone gives a foot, m/s²
    )
    # (feet, 2, 3) what each foot's acceleration relative to the body gives a pendulum with the
    # robot's angular momentum
    # about the ground, forward and to the left
    reaction: Vector
    turning: Vector  # (feet, 2, 3) what of that is of the angular momentum about the centre of mass
    # share of the torque of a knee, the weakest, that holds the robot on one sole; zero on points
    knee: float
    narrow: float  # largest distance of the two groups of feet between which the body sways, m
    sole: Vector  # (2,) length and width of the largest sole; zero of points, m


@dataclass(frozen=True)
class Pace:
    """How long the steps of a walk last, and how fast it goes."""

    usual_step: float  # time from one touchdown to the next of a slow walk, s
    fast_double_support: (
        float  # share of a step in which every foot is on the ground, at the largest speed
    )
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
    lengths, hips, knees, swings, beside = [], [], [], [], np.zeros(len(robot.corners))
    for k, leg in enumerate(legs(robot)):
        points = [*(data.oMi[j].translation - q[:3] for j in leg.below_hip), place[k]]
        lengths.append(sum(float(np.linalg.norm(b - a)) for a, b in pairwise(points)))
        knees.append(model.effortLimit[model.joints[leg.joints[leg.knee]].idx_v])
        hips.append(float(points[0][2] - place[k, 2]))
        if len(robot.corners) > 2 and leg.knee > 1:
            beside[k] = place[k, 1] + q[1] - data.oMi[leg.joints[0]].translation[1]
        for joint in (
            leg.below_hip[:1] if robot.corners[k] == 1 else leg.joints[: max(leg.knee, 1)]
        ):  # soles roll, too
            column, arm = (
                model.joints[joint].idx_v,
                float(data.oMi[joint].translation[2] - q[2] - place[k, 2]),
            )
            swings.append(arm * model.effortLimit[column] / float(inertia[column, column]))
    length, hip = min(lengths), max(hips)
    bent, stretched = (SOLE_BENT, SOLE_STRETCHED) if robot.flat_feet else (BENT, STRETCHED)
    lower = max(
        hip - bent * length, 0.0
    )  # than the posture, where its legs would be almost stretched
    reach = float(np.sqrt(max((stretched * length) ** 2 - (hip - lower) ** 2, 0.0)))
    rise = float(centre[2] - point[:, 2].min()) - lower
    height, over = float(q[2]) - lower, hip - lower if len(place) > 2 or robot.flat_feet else 0.0
    reaction, turning = _reactions(robot, q, rise)
    soles = np.array([np.ptp(point[foot == k, :2], axis=0) for k in range(len(place))])
    narrow = (
        SOLE_NARROW * rise + 2.0 * INNER * float(soles[:, 1].min())
        if robot.flat_feet
        else NARROW * rise
    )
    sole = soles.max(axis=0)
    moment, swing = (
        0.5 * length * float(np.sqrt(1.0 - SOLE_BENT**2)) * robot.mass * GRAVITY,
        min(swings),
    )
    share = moment / min(knees) if robot.flat_feet else 0.0
    return Build(
        point,
        foot,
        place,
        length,
        height,
        rise,
        reach,
        over,
        beside,
        swing,
        reaction,
        turning,
        share,
        narrow,
        sole,
    )


def _reactions(robot: Robot, q: Vector, rise: float) -> Vector:
    """(2, feet, 2, 3) velocity of the pendulum for a velocity of each foot relative to the body, in
    the posture; and what of it is of the angular momentum about the centre of mass.
    """
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    momentum = np.array(pin.computeCentroidalMap(model, data, q)) / robot.mass
    turning = np.array((momentum[4], -momentum[3])) / rise
    both = np.array((momentum[:2] + turning, turning))
    starts = np.cumsum((0, *robot.corners))
    found = np.empty((2, len(robot.corners), 2, 3))
    for k in range(len(robot.corners)):
        jacobian = np.zeros((3, model.nv))
        for name in robot.feet[starts[k] : starts[k + 1]]:
            jacobian += pin.getFrameJacobian(
                model, data, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED
            )[:3]
        jacobian /= robot.corners[k]
        jacobian[:, :6] = 0.0
        found[:, k] = both @ np.linalg.pinv(jacobian)
    return found


def draw_together(places: Vector, group: NDArray[np.int64], most: float) -> float:
    """Move two groups of feet, 0 and 1, in place, until their middles are apart by ``most`` at
    most.

    The places are (feet, 2), about their common middle. Returns the distance of the two middles
    then.
    """
    middles = [places[group == g].mean(axis=0) for g in range(2)]
    apart = float(np.linalg.norm(middles[1] - middles[0]))
    share = max(1.0 - most / apart, 0.0) if apart > 0.0 else 0.0
    for g in range(2):
        places[group == g] -= share * middles[g]
    return (1.0 - share) * apart


Steps = tuple[tuple[str, ...], ...]
BY_FEET: dict[int, dict[str, Steps]] = {
    2: {"walk": (("left",), ("right",)), "step": (("left",), ("right",))},
    4: {
        "trot": (("left front", "right hind"), ("right front", "left hind")),
        "crawl": (("left hind",), ("left front",), ("right hind",), ("right front",)),
        "pace": (("left front", "left hind"), ("right front", "right hind")),
        "bound": (("left front", "right front"), ("left hind", "right hind")),
    },
    6: {
        "tripod": (
            ("left front", "right middle", "left hind"),
            ("right front", "left middle", "right hind"),
        )
    },
}
"""Feet that swing together, step after step, by the number of feet and the name of the schedule;
the first one is the default. ``step`` goes on stepping where it stands.
"""
SCHEDULES = tuple(name for schedules in BY_FEET.values() for name in schedules)
"""Their names."""
ROWS = {1: ("",), 2: (" front", " hind"), 3: (" front", " middle", " hind")}
"""What the feet of a side are called, from the front on."""


def groups_of(schedule: str, places: Vector) -> NDArray[np.int64]:
    """(feet,) the step of the cycle in which each foot swings.

    Args:
        schedule: a name of :data:`BY_FEET`, or ``stand``.
        places: (feet, 2) of the feet about their middle, x forward and y to the left, m.

    Raises:
        InputError: an unknown name, one for another number of feet, or not as many feet on the left
            as on the right.
    """
    known = BY_FEET.get(len(places), {})
    checks.one_of("schedule", schedule, ("stand", *known))
    if schedule == "stand":
        return np.zeros(len(places), dtype=np.int64)
    left, names = places[:, 1] > 0.0, [""] * len(places)
    if 2 * left.sum() != len(places):
        raise InputError(
            f"half of the feet must be on the left, got {left.sum()} of {len(places)}", name="robot"
        )
    for side, feet in (("left", np.flatnonzero(left)), ("right", np.flatnonzero(~left))):
        for k, row in zip(feet[np.argsort(-places[feet, 0])], ROWS[len(feet)], strict=True):
            names[k] = side + row
    steps = known[schedule]
    return np.array(
        [next(g for g, feet in enumerate(steps) if name in feet) for name in names], dtype=np.int64
    )


def pace_of(
    robot: Robot,
    q: Vector,
    build: Build,
    group: NDArray[np.int64],
    clearance: float,
    *,
    max_speed: float | None,
) -> tuple[Pace, str]:
    """The pace of a robot that stands in q, whose feet swing in the given groups, and what limits
    its largest speed.

    The largest speed is what legs and motors can do, where none is given: what holds the robot in
    mid-step, and swings the other legs, and how far feet reach. An :class:`InputError` says that it
    is zero.
    """
    groups = int(group.max()) + 1
    natural, soles = float(np.sqrt(build.leg / GRAVITY)), bool(robot.flat_feet)
    gentle = (
        groups == 2
        and len(build.place) > 2
        and not soles
        and not _one_behind_the_other(build, group)
    )
    double_support = SOLE_BOTH if soles else BOTH if len(build.place) > 2 else POINT_BOTH
    slow = SLOW_BOTH if gentle else double_support
    duration = (
        SOLE_STEP if soles else max(STEP, SWING * GRAVITY / build.swing_acceleration)
    ) * natural
    runs = groups == 2 and len(build.place) > 2
    stride = STRIDE * build.leg if runs else inf
    share = (
        (ROLLING_SPEED if len(build.place) == 2 else SOLE_SPEED)
        if soles
        else SPEED
        if runs
        else SLOW_SPEED
    )
    most, limited_by = share * GRAVITY * natural, "the length of its legs"
    push = PEAK * float(np.abs(build.reaction[:, 0, 0]).max()) / GRAVITY
    if runs and push > 0.0 and (slower := float(np.sqrt(MOST_PUSH * stride / push))) < most:
        most, limited_by = slower, "the push of the legs that it swings"
    if max_speed is not None:
        most, limited_by = max_speed, "max_speed"
    else:

        def load(speed: float) -> float:
            shortened = (
                FAST_SOLE_STEP * natural if soles else min(duration, stride / max(speed, SMALL))
            )
            near = NEAR if gentle else STRAIGHT_NEAR
            upright = upright_end(speed, float(np.sqrt(GRAVITY / build.rise)) * build.height, near)
            pushed = max(push * speed / (shortened * FREE_PUSH), 1.0) if runs else 1.0
            return pushed * swing_load(
                robot, q, build, speed, shortened, double_support, clearance, upright
            )

        held = holding_load(robot, q, group)
        allowed = MOST_LOAD if runs else max(1.0, MORE_LOAD * load(0.0))
        swung = fastest_speed(load, most, allowed) if held <= 1.0 else 0.0
        if swung < most:
            most, limited_by = swung, "the torques of its motors"
        if swung == 0.0:
            why = (
                f"hold it in mid-step, which takes {held:.2g} times their torques"
                if held > 1.0
                else "swing its legs"
            )
            message = (
                f"at no speed can the motors of '{robot.name}' {why}: give a max_speed, or "
                f"larger efforts"
            )
            raise InputError(message, name="max_speed")
    shortest = FAST_SOLE_STEP * natural if soles else min(duration, stride / most)
    reached = 2.0 * _reach(build, group) / ((groups - 1 + double_support) * shortest)
    if reached <= 0.0:
        apart = f"its feet, {np.ptp(build.place[:, 1]):.2g} m apart, have to come together"
        raise InputError(
            f"'{robot.name}' cannot walk: {apart}, and its legs do not reach so far", name="robot"
        )
    if reached < most:
        most, limited_by = reached, "how far its feet reach"
    if most < SLOW * share * GRAVITY * natural and max_speed is None:
        warn_maker(f"'{robot.name}' walks at {most:.2g} m/s at most, limited by {limited_by}")
    if soles:
        stride = most * shortest
    return Pace(duration, double_support, slow, gentle, stride, most), limited_by


def _one_behind_the_other(build: Build, group: NDArray[np.int64]) -> bool:
    """Whether two groups of feet stand one behind the other, so that the body goes to and fro
    between them.
    """
    ahead, aside = np.abs(
        build.place[group == 1, :2].mean(axis=0) - build.place[group == 0, :2].mean(axis=0)
    )
    return bool(ahead > aside)


def _reach(build: Build, group: NDArray[np.int64]) -> float:
    """Largest horizontal distance that a foot goes from its place in the walk, m."""
    if group.max() != 1:
        return build.reach
    left = KNEE / max(build.knee, KNEE) if len(build.place) == 2 and build.sole[0] > 0.0 else LEFT
    apart = build.place[:, :2] - build.place[:, :2].mean(axis=0)
    together = apart.copy()
    draw_together(together, group, build.narrow)
    drawn = float(np.linalg.norm(apart - together, axis=1).max())
    return left * (build.reach - drawn) if drawn > 0.0 else build.reach


def holding_load(robot: Robot, q: Vector, group: NDArray[np.int64]) -> float:
    """Largest torque of the motors of the legs that hold the weight, in equal shares, while each
    group of feet swings, as a share of their limits.
    """
    model, data = robot.model, robot.model.createData()
    weight = pin.computeGeneralizedGravity(model, data, q)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    found, worst = legs(robot), 0.0
    for swinging in range(int(group.max()) + 1):
        holding = [
            leg for leg, number in zip(found, group, strict=True) if number != swinging
        ] or found
        for leg in holding:
            frames = [robot.frame_id(name) for name in leg.points]
            up = np.mean(
                [pin.getFrameJacobian(model, data, k, pin.LOCAL_WORLD_ALIGNED)[2] for k in frames],
                axis=0,
            )
            joints = [model.joints[j].idx_v for j in leg.joints]
            torque = weight[joints] - up[joints] * robot.mass * GRAVITY / len(holding)
            worst = max(worst, float(np.max(np.abs(torque) / model.effortLimit[joints])))
    return worst


def swing_load(
    robot: Robot,
    q: Vector,
    build: Build,
    speed: float,
    step_duration: float,
    double_support: float,
    clearance: float,
    upright: float = UPRIGHT_END,
) -> float:
    """Largest torque of the motors of a leg that swings, as a share of their limits; of the weakest
    leg.

    The body goes straight on at the speed; a foot goes from half a stance behind its place to half
    a stance ahead. It moves vertically in the share ``upright`` of its swing, at the end.
    """
    model, data = robot.model, robot.model.createData()
    duration = (1.0 - double_support) * step_duration
    time, rest = np.linspace(0.0, duration, SAMPLES), (1.0 - upright) * duration
    ahead = np.array([toward(0.0, 0.0, 0.0, 1.0, rest, min(t, rest))[0] for t in time])
    u = np.minimum(time / rest, 1.0)
    way = np.zeros((SAMPLES, 3))
    way[:, 0] = speed * (
        2.0 * step_duration * ahead - 0.5 * (1.0 + double_support) * step_duration - time
    )
    way[:, 2] = q[2] - build.height + 64.0 * clearance * (u * (1.0 - u)) ** 3
    worst = 0.0
    for leg in legs(robot):
        joints = [model.joints[j].idx_v for j in leg.joints]
        path = _follow(robot, q, leg.points[0], joints, way)
        rate = [pin.difference(model, a, b) / time[1] for a, b in pairwise(path)]
        for i in range(1, SAMPLES - 1):
            torque = pin.rnea(
                model,
                data,
                path[i],
                0.5 * (rate[i - 1] + rate[i]),
                (rate[i] - rate[i - 1]) / time[1],
            )
            worst = max(worst, float(np.max(np.abs(torque[joints]) / model.effortLimit[joints])))
    return worst


def _follow(robot: Robot, q: Vector, foot: str, joints: list[int], way: Vector) -> list[Vector]:
    """Configurations in which the joints of one leg, of these columns, bring its foot along a
    way.
    """
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(foot)
    pin.framesForwardKinematics(model, data, q)
    start, path = data.oMf[frame].translation.copy(), []
    for offset in way:
        for _ in range(ITERATIONS):
            jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[
                :3, joints
            ]
            step = np.zeros(model.nv)
            missing = start + offset - data.oMf[frame].translation
            step[joints] = jacobian.T @ np.linalg.solve(
                jacobian @ jacobian.T + SMALL * np.eye(3), missing
            )
            q = pin.integrate(model, q, step)
            pin.framesForwardKinematics(model, data, q)
        path.append(q)
    return path


def fastest_speed(load: Callable[[float], float], high: float, most: float) -> float:
    """Largest speed up to ``high`` at which a load, which grows with it, is not above ``most``."""
    if load(high) <= most:
        return high
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if load(middle) <= most else (low, middle)
    return low
