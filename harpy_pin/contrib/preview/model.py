"""A robot as a single rigid body: what is measured of it, and how forces on the feet move it.

All is in the axes of the heading, x forward and z up, about the measured place of the body. Tilts
are small, the body's inertia is that of the posture, and the legs have no momentum of their own
(Di Carlo et al., "Dynamic locomotion in the MIT Cheetah 3 through convex model-predictive control",
2018). A force that is constant over an interval gives constant accelerations there, so positions
and velocities at the ends of the intervals are exact sums of them.
"""

import numpy as np
import pinocchio as pin

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, State, Vector


class SingleBody:
    """A robot as one rigid body, and its last measured state.

    Args:
        robot: any with feet.
        q: (nq,) the posture of the inertia.

    Attributes:
        mass: kg.
        inertia: (3, 3) about the centre of mass, in the axes of the heading, kg·m².
        yaw: of the heading, rad.
        turn: (3, 3) from the axes of the heading to the world's.
        place: (3,) of the body's origin, world, m.
        rotation: (3, 3) from the body's axes to the world's.
        centre: (3,) of the centre of mass from the body's origin, axes of the heading, m.
        motion: (2, 6) place of the body's origin and tilt (rotation vector), which are zero but for
            the tilt, m and rad; and their velocities. Axes of the heading.
    """

    def __init__(self, robot: Robot, q: Vector) -> None:
        self._robot, self._data = robot, robot.model.createData()
        self.mass = robot.mass
        tree = robot.closed(q)
        pin.ccrba(robot.model, self._data, tree, np.zeros(robot.model.nv))
        self.inertia: Vector = self._data.Ig.inertia.copy()
        self.centre: Vector = pin.centerOfMass(robot.model, self._data, tree) - q[:3]
        self.motion: Vector = np.zeros((2, 6))

    def measure(self, state: State) -> None:
        """Take a state."""
        self.rotation = pin.Quaternion(state.q[3:7]).matrix()
        roll, pitch, self.yaw = pin.rpy.matrixToRpy(self.rotation)
        self.turn = pin.rpy.rpyToMatrix(0.0, 0.0, self.yaw)
        robot, q = self._robot, state.q
        speed = robot.velocity_map(q) @ state.v
        pin.centerOfMass(robot.model, self._data, robot.closed(q), speed)
        self.place = self._data.com[0] - self.turn @ self.centre
        self.motion[0, 3:] = roll, pitch, 0.0
        self.motion[1, :3] = self.turn.T @ self._data.vcom[0]
        self.motion[1, 3:] = self.turn.T @ self.rotation @ state.v[3:6]

    def acceleration(self, foot: Vector, body: Vector) -> Vector:
        """(n, 6, 3) linear and angular acceleration per force and mass.

        Args:
            foot: (n, 3) on which the forces act, axes of the heading, m.
            body: (n, 3) where the body's origin is then, m.
        """
        gain = np.zeros((len(foot), 6, 3))
        gain[:, :3] = np.eye(3)
        arms = foot - body - self.centre
        cross = -np.cross(np.eye(3), arms[:, None]).transpose(0, 2, 1)  # arm × force
        gain[:, 3:] = self.mass * np.linalg.solve(self.inertia, cross)
        return gain


def sums(times: Vector) -> Vector:
    """(2, N, N) what an acceleration in each interval gives to place and velocity at the end of
    each.

    Args:
        times: (N + 1,) at which the intervals begin and end, s.
    """
    span, end = np.diff(times), times[1:]
    later = np.tri(len(span)) * span
    return np.array([later * (end[:, None] - end + 0.5 * span), later])


def falling(motion: Vector, times: Vector) -> Vector:
    """(2, N, 6) motion at the ends of the intervals without any force but gravity.

    Args:
        motion: (2, 6) at the beginning.
        times: (N + 1,), s.
    """
    t = (times[1:] - times[0])[:, None]
    weight = np.array([0.0, 0.0, -GRAVITY, 0.0, 0.0, 0.0])
    return np.array([motion[0] + t * motion[1] + 0.5 * t**2 * weight, motion[1] + t * weight])
