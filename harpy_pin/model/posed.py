"""Pinocchio's numbers of a robot in a configuration, with its loops closed, by base and driven
joints.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pinocchio as pin

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector


class Posed:
    """A robot in a configuration, at rest.

    Args:
        robot: any.
        q: (nq,) configuration.

    Attributes:
        tree: (model.nq,) configuration of the robot's tree.
        data: Pinocchio's, with the places of joints and frames, the centre of mass and Jacobians.
    """

    def __init__(self, robot: Robot, q: Vector) -> None:
        self.robot, self.tree, self._q = robot, robot.closed(q), q
        self.data: pin.Data = robot.model.createData()
        pin.centerOfMass(robot.model, self.data, self.tree)
        pin.computeJointJacobians(robot.model, self.data, self.tree)
        pin.updateFramePlacements(robot.model, self.data)

    @cached_property
    def _map(self) -> Vector:
        return self.robot.velocity_map(self._q)

    @property
    def centre(self) -> Vector:
        """(3,) centre of mass, world, m."""
        return np.array(self.data.com[0])

    def frame(self, name: str) -> pin.SE3:
        """Placement of a frame in the world.

        Args:
            name: of the frame.
        """
        return self.data.oMf[self.robot.frame_id(name)]

    def joint(self, number: int) -> Vector:
        """(3,) place of a joint, world, m.

        Args:
            number: Pinocchio's.
        """
        return np.array(self.data.oMi[number].translation)

    def jacobian(self, name: str) -> Vector:
        """(6, nv) Jacobian of a frame, linear and angular, world axes.

        Args:
            name: of the frame.
        """
        frame = self.robot.frame_id(name)
        full = pin.getFrameJacobian(self.robot.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
        return np.asarray(full @ self._map)

    @cached_property
    def mass_matrix(self) -> Vector:
        """(nv, nv), armature included."""
        upper = np.triu(pin.crba(self.robot.model, self.robot.model.createData(), self.tree))
        full = upper + np.triu(upper, 1).T
        return np.asarray(self._map.T @ full @ self._map)

    @property
    def holding(self) -> Vector:
        """(nv,) generalised forces that hold the robot against gravity."""
        model = self.robot.model
        full = pin.computeGeneralizedGravity(model, model.createData(), self.tree)
        return np.asarray(self._map.T @ full)

    @property
    def momentum_map(self) -> Vector:
        """(6, nv) linear and angular momentum about the centre of mass, world axes, of a
        velocity.
        """
        model = self.robot.model
        full = pin.computeCentroidalMap(model, model.createData(), self.tree)
        return np.asarray(np.array(full) @ self._map)


def free_inertia(robot: Robot, q: Vector) -> Vector:
    """(joints,) inertia of each joint where all others are free, kg·m².

    Args:
        robot: any.
        q: (nq,) configuration.
    """
    if robot.loops is not None:
        return np.asarray(1.0 / np.diag(np.linalg.inv(Posed(robot, q).mass_matrix))[6:])
    model = robot.model
    return np.asarray(1.0 / np.diag(pin.computeMinverse(model, model.createData(), q))[6:])
