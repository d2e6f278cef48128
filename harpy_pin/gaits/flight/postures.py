"""Postures in the air: legs so long, and the centre of mass where thrusts can carry it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from harpy_pin.errors import InputError
from harpy_pin.gaits.flight.balance import GRAVITY, lacking_moments
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__: list[str] = []

STEPS, DAMPING, CLOSE, FURTHEST = 60, 1e-8, 1e-6, 0.2
"""Of the iterations; the last is the longest step, rad."""
CHANGE = 1e-6
"""Of the joints, by which slopes are found, rad."""
MOST_ERROR = 1e-3
"""Of a posture, m."""


class AirPostures:
    """Joint angles of a robot in the air.

    Args:
        robot: with feet, and thrusters or rotors.
        q: (nq,) configuration in which it stands, upright and facing x.
    """

    def __init__(self, robot: Robot, q: Vector) -> None:
        self.robot, self._q = robot, q.copy()
        self._q[:3] = 0.0
        self._dynamics = Dynamics(robot)
        self.feet: Vector = self.places(self._q)

    def places(self, q: Vector) -> Vector:
        """(feet, 3) places about the body's origin, m; the terms are at q."""
        self._dynamics.update(q, np.zeros(self.robot.model.nv))
        return self._dynamics.foot_position.copy()

    def _lacking(self, q: Vector) -> Vector:
        """What the thrusters lack of the moments that carry the robot, per weight, m."""
        d = self._dynamics
        d.update(q, np.zeros(self.robot.model.nv))
        found: Vector = lacking_moments(d).T @ d.bias[:6] / (self.robot.mass * GRAVITY)
        return found

    def find(self, depth: float) -> Vector:
        """(nq,) configuration in which the robot can hover, its feet to the sides as in standing.

        Args:
            depth: how much further below the body than in standing the feet are, m.

        Raises:
            InputError: the legs do not reach so far.
        """
        q, joints = self._q.copy(), len(self.robot.joints)
        for _ in range(STEPS):
            error = self._error(q, depth)
            if np.abs(error).max() < CLOSE:
                break
            slope = np.empty((len(error), joints))
            for k in range(joints):
                moved = q.copy()
                moved[7 + k] += CHANGE
                slope[:, k] = (self._error(moved, depth) - error) / CHANGE
            step = slope.T @ np.linalg.solve(slope @ slope.T + DAMPING * np.eye(len(error)), error)
            q[7:] -= np.clip(step, -FURTHEST, FURTHEST)
        lower, upper = self.robot.joint_lower, self.robot.joint_upper
        beyond = (lower < upper) & ((q[7:] < lower - CLOSE) | (q[7:] > upper + CLOSE))
        if np.abs(self._error(q, depth)).max() > MOST_ERROR or beyond.any():
            message = (
                f"'{self.robot.name}' cannot hover with its feet {depth:.3g} m further below the body than standing"
            )
            raise InputError(message, name="robot", value=self.robot)
        return q

    def on_feet(self, feet: Vector, velocity: Vector) -> tuple[Vector, Vector]:
        """Configuration and velocity of a robot whose feet rest on the ground while its body moves, upright.

        Args:
            feet: (feet, 3) places about the body's origin, m.
            velocity: (3,) of the body, m/s.

        Raises:
            InputError: the legs do not reach.
        """
        d, nv = self._dynamics, self.robot.model.nv
        q, v = self._q.copy(), np.concatenate((velocity, np.zeros(nv - 3)))
        for _ in range(STEPS):
            away = (feet - self.places(q)).ravel()
            step = np.linalg.lstsq(d.foot_jacobian[:, 6:], away, rcond=1e-6)[0]
            q[7:] += np.clip(step, -FURTHEST, FURTHEST)
        if np.abs(feet - self.places(q)).max() > MOST_ERROR:
            message = f"the legs of '{self.robot.name}' do not reach the ground where this jump lets go of it"
            raise InputError(message, name="flights", value=self.robot)
        v[6:] = np.linalg.lstsq(d.foot_jacobian[:, 6:], -d.foot_jacobian[:, :3] @ velocity, rcond=1e-6)[0]
        return q, v

    def recoil(self, q: Vector, v: Vector) -> Vector:
        """(3,) What the body's velocity changes by while thrusts stop legs that swing, m/s.

        Args:
            q: (nq,) configuration, upright.
            v: (nv,) velocity.
        """
        model, data = self.robot.model, self.robot.model.createData()
        self._dynamics.update(q, v)
        axes = lacking_moments(self._dynamics)[3:]
        pin.ccrba(model, data, q, v)
        # An impulse p at the thrusters turns the robot by −c × p about its centre of mass c.
        lever = -axes.T @ pin.skew(data.com[0] - q[:3])[:, :2]
        impulse = np.linalg.lstsq(lever, -axes.T @ data.hg.angular, rcond=1e-6)[0]
        return np.append(impulse, 0.0) / self.robot.mass

    def _error(self, q: Vector, depth: float) -> Vector:
        """Of the feet to the sides and in height, and of the moments, m."""
        moments, feet = self._lacking(q), self._dynamics.foot_position
        return np.concatenate((feet[:, 1] - self.feet[:, 1], feet[:, 2] - self.feet[:, 2] + depth, moments))
