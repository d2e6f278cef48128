"""Gaits as a user would write them: two methods, and nothing that says which settings fit."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

import harpy_pin as hp

GRAVITY = 9.81
SHIFT, SHIFT_PERIOD = 0.05, 1.0
"""How far it sways, in heights of the body, and there and back, s."""
STEP, CLEARANCE, BOTH = 1.6, 0.06, 0.2
"""Duration of a step in √(height / g), height of a swing foot in heights, and share with every foot
down.
"""
DEEPER = 0.002
"""How far below the ground feet aim, m."""


class OwnGait(hp.Gait):
    """Stands, sways to a side, or, on four feet, trots in place, in the posture in which its robot
    stands.
    """

    def __init__(self, robot: hp.Robot, kind: str) -> None:
        super().__init__(robot)
        self.kind = kind
        self._q, self._v = hp.Standing(robot).initial_state()
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, self._q)
        self._feet = (
            np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet])
            - self._q[:3]
        )
        self._height = float(self._q[2])
        self._step = STEP * np.sqrt(self._height / GRAVITY)
        front, left = self._feet[:, 0] > self._feet[:, 0].mean(), self._feet[:, 1] > 0.0
        self._group = (front ^ left).astype(int)

    def initial_state(self, *, penetration: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        q = self._q.copy()
        q[2] -= penetration
        return q, self._v.copy()

    def update(self, t: float) -> hp.GaitTarget:
        o, rate = self.target, np.pi / SHIFT_PERIOD
        o.body[:] = o.heading[:] = 0.0
        o.body[2], o.heading[0] = self._height, -self.robot.facing
        if self.kind == "sway":
            angle = rate * t
            way = (
                np.sin(angle) ** 2,
                rate * np.sin(2.0 * angle),
                2.0 * rate**2 * np.cos(2.0 * angle),
            )
            o.body[1::3] = SHIFT * self._height * np.array(way)
        o.foot_position[:] = self._feet + self._q[:3] - o.body[:3] - (0.0, 0.0, DEEPER)
        o.foot_velocity[:], o.foot_acceleration[:] = -o.body[3:6], -o.body[6:]
        o.stance[:], o.phase[:], o.world_frame_blend[:] = 1.0, 0.5, 0.0
        number, share = divmod(t / self._step, 1.0)
        if self.kind == "trot" and share > BOTH:
            self._lift(self._group == int(number) % 2, (share - BOTH) / (1.0 - BOTH))
        return o

    def _lift(self, swing: np.ndarray, u: float) -> None:
        o, peak, duration = self.target, 64.0 * CLEARANCE * self._height, (1.0 - BOTH) * self._step
        w, slope = u * (1.0 - u), 1.0 - 2.0 * u
        o.foot_position[swing, 2] += peak * w**3
        o.foot_velocity[swing, 2] += 3.0 * peak * w**2 * slope / duration
        o.foot_acceleration[swing, 2] += 6.0 * peak * w * (slope**2 - w) / duration**2
        o.stance[swing], o.phase[swing] = 0.0, u
        o.world_frame_blend[swing] = np.clip((u - 0.4) / 0.3, 0.0, 1.0)


class Wrapped(hp.Gait):
    """Another gait, without what it says of controllers."""

    def __init__(self, inner: hp.Gait) -> None:
        super().__init__(inner.robot)
        self.inner = inner

    def observe(self, state: hp.State) -> None:
        self.inner.observe(state)

    def update(self, t: float) -> hp.GaitTarget:
        return self.inner.update(t)

    def initial_state(self, *, penetration: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        return self.inner.initial_state(penetration=penetration)


def scaled(robot: hp.Robot, *, mass: float, length: float) -> hp.Robot:
    """A robot of another size, with motors as strong as its weight and legs ask for, and its feet's
    places.

    Every mass is multiplied by ``mass``, every distance by ``length``.
    """
    model = robot.model.copy()
    for k, inertia in enumerate(robot.model.inertias):
        model.inertias[k] = pin.Inertia(
            mass * inertia.mass, length * inertia.lever, mass * length**2 * inertia.inertia
        )
    for k, place in enumerate(robot.model.jointPlacements):
        model.jointPlacements[k] = pin.SE3(place.rotation, length * place.translation)
    for k, frame in enumerate(robot.model.frames):
        model.frames[k].placement = pin.SE3(
            frame.placement.rotation, length * frame.placement.translation
        )
    model.effortLimit[6:] = mass * length * robot.model.effortLimit[6:]
    model.armature = mass * length**2 * robot.model.armature
    return replace(robot, model=model)
