"""What every flight of a robot has in common: its postures, the feedback in the air, and what its
thrusters have to spare.
"""

from math import sqrt

import numpy as np
import pinocchio as pin

from harpy_pin.contrib.flight.airway import Balance, Quintic, lacking_moments
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector

REACH = 0.25  # how much longer than in standing the legs are in the air, in heights of the body
LEGS = 0.3  # time after lift-off from which on legs are so, s
SPARE, LEAST_SPARE = 0.5, 1.0
"""Share that rising and braking use of what thrusters can do beyond the weight, and the least that
there must be, m/s².
"""
MOST_BRAKE = 8.0  # largest acceleration with which flights rise and are braked, m/s²
SIDE = 0.82
"""Share of a free thruster's limit that whole-body controllers use upwards (``lateral_thrust``)."""
TOUCHDOWN, ABOVE = 0.1, 0.03
"""Speed at which feet meet the ground, m/s, and height above it from which on they have it, m."""
LED = 0.35
"""Share of the thrusts' lag with which they follow the plan, where their commands lead as far as
limits allow.
"""
BEND = 2.5  # duration of a crouch, in √(height / g)


class Flyer:
    """A robot with feet, and thrusters or rotors, that flies, and stands in ``q``, (nq,), upright
    and facing x.

    Raises:
        InputError: thrusters do not carry the robot, or its legs do not reach as far as flights
            need.
    """

    def __init__(self, robot: Robot, q: Vector) -> None:
        self.robot, self.height = robot, float(q[2])
        spare = thrust_upwards(robot) / robot.mass - GRAVITY
        if spare < LEAST_SPARE:
            raise InputError(
                f"thrusters of '{robot.name}' must carry it with {LEAST_SPARE:g} m/s² to "
                f"spare, have {spare:.2g}",
                name="robot",
                value=robot,
            )
        self.brake, self.scale = (
            min(SPARE * spare, MOST_BRAKE),
            sqrt(self.height / GRAVITY),
        )  # m/s² upwards; s
        self.postures = AirPostures(robot, q)
        self.air = self.postures.find(REACH * self.height)  # (nq,) in which it lands
        self.feet: Vector = self.postures.places(self.air).mean(
            axis=0
        )  # their middle then, about the body, m
        self.stand: Vector = self.postures.feet.mean(axis=0)  # the same in standing
        centre = pin.centerOfMass(robot.model, robot.model.createData(), robot.closed(q)) - q[:3]
        self.over: Vector = np.array(
            (centre[0], centre[1], self.stand[2])
        )  # the point below the centre of mass
        self.balance = Balance(robot, self.air)
        self._gains = {1.0: self.balance.gain}
        # with which thrusts follow the jumps' plan, s, where a controller knows of one
        self.lag = 0.0

    def gain(self, weight: float) -> Vector:
        """Feedback where thrusters carry the robot's weight times a factor."""
        if weight not in self._gains:
            self._gains[weight] = Balance(self.robot, self.air, weight=weight).gain
        return self._gains[weight]

    def legs(self, joints: Vector, duration: float) -> Quintic:
        """Angles of the joints, from present ones (2, n) with their rates to those of landing, in
        so many seconds.
        """
        rest = np.zeros((2, joints.shape[1]))
        return Quintic(np.vstack((joints, rest[:1])), np.vstack((self.air[7:], rest)), duration)


def thrust_upwards(robot: Robot) -> float:
    """Force upwards that the thrusters of an upright robot can give together, N."""
    free = len(robot.thrusters) - len(robot.rotors)
    rotors = sum(rotor.limit[1] * abs(rotor.axis[2]) for rotor in robot.rotors)
    return rotors + (free * robot.thrust_limit * SIDE if free else 0.0)


STEPS, DAMPING, CLOSE, FURTHEST = 60, 1e-8, 1e-6, 0.2
"""Number of iterations, their damping and tolerance, and the longest step, rad."""
CHANGE = 1e-6  # change of the joints by which slopes are found, rad
MOST_ERROR = 1e-3  # largest error of a posture, m


class AirPostures:
    """Joint angles of a robot in the air, of one with feet that stands upright in ``q``, (nq,),
    facing x.
    """

    def __init__(self, robot: Robot, q: Vector) -> None:
        self.robot, self._q = robot, q.copy()
        self._q[:3] = 0.0
        self._dynamics = Dynamics(robot)
        self.feet: Vector = self.places(self._q)

    def places(self, q: Vector) -> Vector:
        """(feet, 3) places about the body's origin, m; the terms are at q."""
        self._dynamics.update(q, np.zeros(self.robot.nv))
        return self._dynamics.foot_position.copy()

    def _lacking(self, q: Vector) -> Vector:
        """What the thrusters lack of the moments that carry the robot, per weight, m."""
        d = self._dynamics
        d.update(q, np.zeros(self.robot.nv))
        found: Vector = lacking_moments(d).T @ d.bias[:6] / (self.robot.mass * GRAVITY)
        return found

    def find(self, depth: float) -> Vector:
        """(nq,) configuration in which the robot can hover, its feet to the sides as in standing.

        They are further below the body than in standing, by ``depth``, m: an :class:`InputError`
        where the legs are short.
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
            raise InputError(
                f"'{self.robot.name}' cannot hover with its feet {depth:.3g} m further below "
                f"the body than standing",
                name="robot",
                value=self.robot,
            )
        return q

    def on_feet(self, feet: Vector, velocity: Vector) -> tuple[Vector, Vector]:
        """Configuration and velocity of an upright robot whose body moves with a velocity (3,),
        m/s.

        Its feet rest on the ground, at places (feet, 3) about the body's origin, m: an
        :class:`InputError` if out of reach.
        """
        d, nv = self._dynamics, self.robot.nv
        q, v = self._q.copy(), np.concatenate((velocity, np.zeros(nv - 3)))
        for _ in range(STEPS):
            away = (feet - self.places(q)).ravel()
            step = np.linalg.lstsq(d.foot_jacobian[:, 6:], away, rcond=1e-6)[0]
            q[7:] += np.clip(step, -FURTHEST, FURTHEST)
        if np.abs(feet - self.places(q)).max() > MOST_ERROR:
            raise InputError(
                f"the legs of '{self.robot.name}' do not reach the ground where this jump "
                f"lets go of it",
                name="flights",
                value=self.robot,
            )
        v[6:] = np.linalg.lstsq(
            d.foot_jacobian[:, 6:], -d.foot_jacobian[:, :3] @ velocity, rcond=1e-6
        )[0]
        return q, v

    def recoil(self, q: Vector, v: Vector) -> Vector:
        """(3,) What the body's velocity changes by while thrusts stop legs that swing, m/s; q is
        upright.
        """
        model, data = self.robot.model, self.robot.model.createData()
        self._dynamics.update(q, v)
        axes = lacking_moments(self._dynamics)[3:]
        pin.ccrba(model, data, self.robot.closed(q), self.robot.velocity_map(q) @ v)
        # An impulse p at the thrusters turns the robot by −c × p about its centre of mass c.
        lever = -axes.T @ pin.skew(data.com[0] - q[:3])[:, :2]
        impulse = np.linalg.lstsq(lever, -axes.T @ data.hg.angular, rcond=1e-6)[0]
        return np.append(impulse, 0.0) / self.robot.mass

    def _error(self, q: Vector, depth: float) -> Vector:
        """Errors of the feet to the sides and in height, and of the moments, m."""
        moments, feet = self._lacking(q), self._dynamics.foot_position
        return np.concatenate(
            (feet[:, 1] - self.feet[:, 1], feet[:, 2] - self.feet[:, 2] + depth, moments)
        )
