"""How long feet stand and swing at a speed, so that the motors reach as far as they can.

A leg is followed through one stride over level ground below a body that goes straight on. In the
stance its foot goes back at the speed and bears its share of the weight, which grows with the
flight; in the swing it takes the way of :func:`harpy_pin.gaits.swing`. Joint speeds and the torques
of inverse dynamics, both as shares of the model's limits, say what a pace asks for. Long stances
need wide angles, short ones large forces, short swings fast joints: the best pace is searched.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from harpy_pin.errors import InputError
from harpy_pin.gaits.planned import DESCENT, EARLY, RISE
from harpy_pin.gaits.swing import on_its_way
from harpy_pin.model.legs import legs
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector

STANCE, SWING, SWEEP = 1.05, 0.96, 0.85
"""Usual durations of a stance and a swing, in √(leg / g), and way of a stance, in lengths of the
leg.
"""
STANCES, SWINGS = (0.38, 0.48, 0.6, 0.75, 0.9, 1.05), (0.96, 1.1, 1.25, 1.5, 1.8)
"""Durations that are tried, in √(leg / g)."""
EASY, HABIT = 0.8, 0.1
"""Share of the limits up to which all paces are alike, and what a pace that is e times as long or
short as the usual one costs in shares.
"""
MOST = 1.15
"""Largest share of the limits, of a stride in which nothing gives way: swing feet do."""
SPEEDS = 7
"""Speeds at which paces are searched; between them they are interpolated."""
FASTEST = 2.2
"""Highest speed that is tried, in √(g leg)."""
SAMPLES, ITERATIONS = 12, 3
"""Places of the foot in a stance, and as many in a swing; steps of the inverse kinematics to each.
"""


class Pace(NamedTuple):
    """Durations at one speed.

    Attributes:
        speed: m/s.
        stance: time that a foot is on the ground, s.
        swing: time that it is in the air, s.
        velocity: largest speed of a joint, as a share of its limit.
        torque: largest torque of a joint, as a share of its limit.
    """

    speed: float
    stance: float
    swing: float
    velocity: float
    torque: float

    @property
    def load(self) -> float:
        """The larger of both shares."""
        return max(self.velocity, self.torque)


class Stride:
    """The legs of a robot through a stride.

    Args:
        robot: on four feet.
        q: (nq,) in which it stands, at the height at which it walks.
        leg: length of a leg, m.
        clearance: height of a foot at mid-swing, m.
    """

    def __init__(self, robot: Robot, q: Vector, *, leg: float, clearance: float) -> None:
        self.robot, self.q, self.leg, self.clearance = robot, q, leg, clearance
        self.natural = float(np.sqrt(leg / GRAVITY))
        model = robot.model
        self._data, self._frames = model.createData(), [robot.frame_id(f) for f in robot.feet]
        self._columns = np.array([one.columns for one in legs(robot)])
        pin.framesForwardKinematics(model, self._data, robot.closed(q))
        self._feet = np.array([self._data.oMf[f].translation for f in self._frames])

    def way(self, speed: float, stance: float, swing: float) -> Vector:
        """(2 SAMPLES, 3) of a foot about its place in the posture, below the body, m."""
        share = np.arange(SAMPLES) / SAMPLES
        way = np.zeros((2 * SAMPLES, 3))
        way[:SAMPLES, 0] = (0.5 - share) * stance * speed
        begin = np.zeros((3, 3))
        goal = [speed * (stance + swing), 0.0, 0.0]
        for i, t in enumerate(swing * share):
            foot = on_its_way(
                begin,
                goal,
                t,
                left=swing,
                rise=RISE * swing,
                apex=self.clearance,
                early=EARLY * swing,
                descent=DESCENT * GRAVITY * self.natural,
            )[0]
            way[SAMPLES + i] = foot - [speed * (0.5 * stance + t), 0.0, 0.0]
        return way

    def pace(self, speed: float, stance: float, swing: float) -> Pace:
        """What these durations ask of the motors at a speed, m/s; infinitely much where a linkage
        does not go so far.
        """
        try:
            return self._asked(speed, stance, swing)
        except InputError:
            return Pace(speed, stance, swing, np.inf, np.inf)

    def _asked(self, speed: float, stance: float, swing: float) -> Pace:
        robot, data, columns = self.robot, self._data, self._columns
        model, q = robot.model, self.q.copy()
        path, pushes, maps = list[Vector](), list[Vector](), list[Vector]()
        for offset in self.way(speed, stance, swing):
            for _ in range(ITERATIONS):
                spread = robot.velocity_map(q)
                pin.computeJointJacobians(model, data, robot.closed(q))
                pin.updateFramePlacements(model, data)
                jacobians = np.array([
                    pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3] @ spread[:, c]
                    for f, c in zip(self._frames, columns, strict=True)
                ])  # fmt: skip
                places = np.array([data.oMf[f].translation for f in self._frames])
                off = self._feet + offset - places
                square = jacobians @ jacobians.transpose(0, 2, 1) + 1e-6 * np.eye(3)
                step = jacobians.transpose(0, 2, 1) @ np.linalg.solve(square, off[..., None])
                q[columns + 1] += step[..., 0]
            path.append(robot.closed(q)[7:].copy())
            pushes.append(jacobians[:, 2])
            maps.append(robot.velocity_map(q))
        times = np.append(stance, swing) / SAMPLES
        span = np.repeat(times, SAMPLES)[:, None]
        ways = (np.roll(path, -1, axis=0) - path) / span
        speeds = 0.5 * (ways + np.roll(ways, 1, axis=0))
        bends = 2.0 * (ways - np.roll(ways, 1, axis=0)) / (span + np.roll(span, 1, axis=0))
        # Feet that stand bear the weight for the whole stride, in pairs that take turns
        force = 0.25 * robot.mass * GRAVITY * (stance + swing) / stance
        torque = np.zeros((2 * SAMPLES, robot.nv))
        v, a, tree = np.zeros(model.nv), np.zeros(model.nv), robot.closed(self.q).copy()
        for i, (angles, speeds_now, bend) in enumerate(zip(path, speeds, bends, strict=True)):
            tree[7:], v[6:], a[6:] = angles, speeds_now, bend
            torque[i] = maps[i].T @ pin.rnea(model, data, tree, v, a)
            if i < SAMPLES:
                torque[i, columns] -= force * pushes[i]
        velocity = float(np.max(np.abs(speeds[:, robot.columns - 6]) / robot.velocity_limit))
        return Pace(
            speed,
            stance,
            swing,
            velocity,
            float(np.max(np.abs(torque[:, 6:]) / robot.torque_limit)),
        )

    def best(self, speed: float) -> Pace:
        """The pace at a speed, m/s, that asks for the least share of the limits."""
        usual = (
            min(STANCE * self.natural, SWEEP * self.leg / max(speed, 1e-6)),
            SWING * self.natural,
        )
        found: list[tuple[float, Pace]] = []
        for s, w in product(STANCES, SWINGS):
            stance, swing = s * self.natural, w * self.natural
            if speed * stance > SWEEP * self.leg * 1.01:
                continue
            pace = self.pace(speed, stance, swing)
            habit = abs(np.log(stance / usual[0])) + abs(np.log(swing / usual[1]))
            found.append((max(pace.load, EASY) + HABIT * habit, pace))
        return min(found, key=lambda one: one[0])[1] if found else self.pace(speed, *usual)
