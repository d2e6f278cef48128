"""Standing on every foot, for robots with any number of feet: a posture held, and the body's weight shifted over it."""

from __future__ import annotations

from collections.abc import Mapping
from math import perm
from typing import Any

import numpy as np
import pinocchio as pin
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gait.base import GaitTarget
from harpy_pin.model.record import field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Standing"]

LONGEST = 1e9
"""Largest time, s."""
DEGREE = 5
"""Of the polynomials of :meth:`Standing.move`."""
GRAVITY = 9.81
"""m/s²."""
LEAST_SHARE = 0.02
"""Least normal force of a contact point, as a share of what it carries when all carry alike."""
FORCE_WEIGHT = 2e-4
"""Weight on contact forces times the squared mass, kg²: that of Harpy."""
PATCH_DAMPING = 20.0
"""Of the velocity of a flat foot that is held, 1/s."""
LEVEL = 2e-3
"""Largest difference between the heights of the feet, m."""


class Standing:
    """Targets of a robot that stands upright on all its feet, where a posture of its joints puts them.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from rest. At any time
    :meth:`move` sends it elsewhere, such as over one foot (:meth:`over`).

    The whole-body controllers' ranges of normal force and weight on it are made for Harpy; those that fit the weight of
    another robot are :attr:`parameters`.

    Args:
        robot: any robot with feet, points or patches.
        posture: (joints,) angles, rad; by default the robot's own.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.
        press: how much deeper than the ground a foot aims that does not carry, m: without it such a foot would come to
            rest just above the ground and never be held.

    Attributes:
        step_duration: one second, so that measures per step are per second.
        double_support: 1, always.
        constant: it changes by :meth:`move` alone, so that controllers may copy it
            (:func:`~harpy_pin.gait.base.own_target`); their copies move with it.

    Raises:
        InputError: values out of their domains, no posture given where the robot has none of its own, or a posture
            whose feet are not on one level below the body.
    """

    constant = True

    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        shift: ArrayLike = (0.0, 0.0, 0.0),
        shift_period: float = 2.0,
        press: float = 0.005,
    ) -> None:
        if not robot.feet:
            raise InputError(
                f"'{robot.name}' has no foot to stand on: hp.Hovering is for robots that fly", name="robot"
            )
        if posture is None:
            posture = robot.posture
        if posture is None:
            raise InputError(f"'{robot.name}' has no standing posture of its own: give one", name="posture")
        self.robot = robot
        self.step_duration, self.double_support = 1.0, 1.0
        model = robot.model
        self._q = pin.neutral(model)
        self._q[7:] = checks.vector("posture", posture, len(robot.joints))
        data = model.createData()
        pin.framesForwardKinematics(model, data, self._q)
        feet = np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet])
        if np.ptp(feet[:, 2]) > LEVEL or feet[:, 2].max() >= 0.0:
            heights = ", ".join(f"{name} {z:.3f} m" for name, z in zip(robot.feet, feet[:, 2], strict=True))
            raise InputError(f"this posture's feet are not on one level below the body: {heights}", name="posture")
        self._record = make_record(
            feet=feet,
            height=-float(feet[:, 2].min()),
            shift=checks.vector("shift", shift, 3),
            shift_period=checks.number("shift_period", shift_period, low=0.0, strict=True),
            press=checks.number("press", press, low=0.0),
            begin=0.0,
            duration=0.0,
            way=np.zeros((DEGREE + 1, 3)),  # coefficients of the offset's polynomial in the time since its begin
        )
        self._centre = np.array(pin.centerOfMass(model, data, self._q))
        self.target = GaitTarget(len(feet))

    @property
    def parameters(self) -> dict[str, Any]:
        """Settings of whole-body controllers that fit this robot's weight, for ``make_controller`` and ``Scenario``.

        Each contact point carries between 2 % of its share of the weight and twice the whole weight. The weight on
        contact forces is as large beside that on the body's acceleration as with Harpy. For flat feet the QP is told to
        take the formulation in which the whole sole is used, and the damping of held feet is less: on compliant ground
        a sole rocks, the whole leg would have to move to stop it, and from 100 1/s on G1 does not come to rest.
        """
        load = self.robot.mass * GRAVITY
        parameters: dict[str, Any] = {
            "min_normal_force": LEAST_SHARE * load / len(self.robot.feet),
            "max_normal_force": 2.0 * load,
            "weights": {"force": FORCE_WEIGHT / self.robot.mass**2},
        }
        if self.robot.patches:
            parameters.update(formulation="full", contact_damping=PATCH_DAMPING)
        return parameters

    def over(self, *feet: int) -> Vector:
        """Where the body has to move for the centre of mass to be above the middle of some feet.

        Args:
            feet: their numbers, in the order of :attr:`~harpy_pin.model.robot.Robot.corners`: a flat foot counts as
                one.

        Returns:
            (3,) offset for :meth:`move`, horizontal, m. Legs that stay behind are not taken into account: the centre of
            mass does not come all the way.

        Raises:
            InputError: no foot, or one that there is not.
        """
        corners = self.robot.corners
        for foot in feet:
            checks.whole("foot", foot, low=0)
        if not feet or max(feet) >= len(corners):
            raise InputError(f"'{self.robot.name}' has feet 0 to {len(corners) - 1}, got {feet}", name="feet")
        starts = np.cumsum((0, *corners))
        points = field(self._record, "feet")
        middles = [points[starts[foot] : starts[foot + 1]].mean(axis=0) for foot in feet]
        offset: Vector = np.mean(middles, axis=0) - self._centre
        offset[2] = 0.0
        return offset

    def move(self, offset: ArrayLike, *, t: float, duration: float = 1.0) -> None:
        """Send the body to another place, from the time t on; it gets there at rest, and stays.

        The way is a polynomial of fifth order, which takes up position, velocity and acceleration of the way before: a
        move may begin while another goes on.

        Args:
            offset: (3,) from where the posture has the body, world axes, m; what ``shift`` does comes on top.
            t: when it begins, s.
            duration: of the way, s.

        Raises:
            InputError: values out of their domains.
        """
        end = checks.vector("offset", offset, 3)
        begin = checks.number("t", t, low=0.0, high=LONGEST)
        length = checks.number("duration", duration, low=0.0, strict=True)
        start = np.zeros((3, 3))
        _offset_at(begin, self._record, start)
        way = np.zeros((DEGREE + 1, 3))
        way[:3] = start / np.array([[1.0], [1.0], [2.0]])
        # Rest at the end: position, velocity and acceleration by the three highest coefficients.
        powers = np.array([[perm(n, d) * length ** (n - d) for n in range(3, DEGREE + 1)] for d in range(3)])
        low = np.array([way[0] + (way[1] + way[2] * length) * length, way[1] + 2.0 * way[2] * length, 2.0 * way[2]])
        way[3:] = np.linalg.solve(powers, np.array([end, np.zeros(3), np.zeros(3)]) - low)
        self._record["way"][0] = way
        self._record["begin"][0], self._record["duration"][0] = begin, length

    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s.

        Args:
            t: time, s.

        Raises:
            InputError: t is no finite number, or beyond 1e9 s.
        """
        if not stand(t, self._record, self.target.record):
            raise InputError(f"the gait's time must be finite and below {LONGEST:g} s, got {t!r}", name="t", value=t)
        return self.target

    def initial_state(self, *, sink: float = 0.0) -> tuple[Vector, Vector]:
        """Configuration (nq,) and velocity (nv,) that match the targets at t = 0.

        Args:
            sink: how deep the lowest foot is in the ground, m (see ``Simulator.static_sink``).
        """
        q = self._q.copy()
        q[2] = float(self._record["height"][0]) - sink
        return q, np.zeros(self.robot.model.nv)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return {
            "posture": self._q[7:].tolist(),
            "shift": field(self._record, "shift").tolist(),
            "shift_period": float(self._record["shift_period"][0]),
            "press": float(self._record["press"][0]),
            "step_duration": self.step_duration,
        }


@njit(cache=True)
def _offset(t, p, out):  # type: ignore[no-untyped-def]
    """Offset that was asked for: (3, 3) position, velocity and acceleration; at rest before and after the way."""
    s = min(max(t - p.begin, 0.0), p.duration)
    moving = 0.0 <= t - p.begin < p.duration
    for i in range(3):
        position = velocity = acceleration = 0.0
        for n in range(p.way.shape[0] - 1, -1, -1):
            acceleration = acceleration * s + 2.0 * velocity
            velocity = velocity * s + position
            position = position * s + p.way[n, i]
        out[0, i] = position
        out[1, i] = velocity if moving else 0.0
        out[2, i] = acceleration if moving else 0.0


@njit(cache=True)
def _offset_at(t, gait, out):  # type: ignore[no-untyped-def]
    _offset(t, gait[0], out)


@njit(cache=True)
def stand(t, gait, target):  # type: ignore[no-untyped-def]
    """All targets at time t, of a robot with any number of feet or none; returns whether it is one."""
    if not abs(t) < LONGEST:
        return False
    p, o = gait[0], target[0]
    rate = 2.0 * np.pi / p.shift_period
    share, speed = 0.5 - 0.5 * np.cos(rate * t), 0.5 * rate * np.sin(rate * t)
    acceleration = 0.5 * rate * rate * np.cos(rate * t)
    _offset(t, p, o.body.reshape((3, 3)))
    for i in range(3):
        o.body[i] += share * p.shift[i]
        o.body[3 + i] += speed * p.shift[i]
        o.body[6 + i] += acceleration * p.shift[i]
        for k in range(o.stance.shape[0]):
            o.foot_position[k, i] = p.feet[k, i] - o.body[i]
            o.foot_velocity[k, i] = -o.body[3 + i]
            o.foot_acceleration[k, i] = -o.body[6 + i]
    o.body[2] += p.height
    for k in range(o.stance.shape[0]):
        o.foot_position[k, 2] -= p.press
        o.stance[k], o.progress[k] = 1.0, 0.5
    return True
