"""Standing on every foot, for robots with any number of feet: a posture held, and the body's weight shifted over it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.staying import Staying, read_posture
from harpy_pin.model.record import field
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Standing"]

GRAVITY = 9.81
"""m/s²."""
MIN_SHARE, SOLE_SHARE = 0.02, 0.1
"""Least normal force of a contact point, and of a corner of a sole, as a share of its load when all are loaded alike. A
sole whose centre of pressure comes to its edge tips over that edge; so it stays inside by a twentieth of the sole."""
FORCE_WEIGHT = 2e-4
"""Weight on contact forces times the squared mass, kg²: that of Harpy."""
FLAT_FOOT_DAMPING = 20.0
"""Of the velocity of a flat foot that is held, 1/s."""
LEVEL = 2e-3
"""Largest difference between the heights of the feet, m."""


class Standing(Staying):
    """Targets of a robot that stands upright on all its feet, where a posture of its joints puts them.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from rest. At any time
    :meth:`move` sends it elsewhere, such as over one foot (:meth:`over`).

    The whole-body controllers' ranges of normal force and weight on it are made for Harpy; those that fit the weight of
    another robot are :attr:`parameters`.

    Args:
        robot: any robot with feet, points or flat feet.
        posture: (joints,) angles, rad; by default the robot's own.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.
        penetration_offset: how much deeper than the ground an unloaded foot aims, m: without it such a foot would come
            to rest just above the ground and never be held.

    Attributes:
        step_duration: one second, so that measures per step are per second.
        double_support: 1, always.
        constant: it changes by :meth:`move` alone, so that controllers may copy it
            (:func:`~harpy_pin.gaits.gait.own_target`); their copies move with it.

    Raises:
        InputError: values out of their domains, no posture given where the robot has none of its own, or a posture
            beyond the joints' limits, or whose feet are not on one level below the body.
    """

    constant = True

    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        shift: ArrayLike = (0.0, 0.0, 0.0),
        shift_period: float = 2.0,
        penetration_offset: float = 0.005,
    ) -> None:
        checks.instance("robot", robot, Robot)
        if not robot.feet:
            raise InputError(
                f"'{robot.name}' has no foot to stand on: hp.Hovering is for robots that fly", name="robot"
            )
        if posture is None:
            posture = robot.posture
        if posture is None:
            angles = f"Standing(robot, posture) with {len(robot.joints)} angles in the order of robot.joints"
            raise InputError(f"'{robot.name}' has no standing posture of its own: give one: {angles}", name="posture")
        model = robot.model
        q = pin.neutral(model)
        q[7:] = read_posture(robot, posture)
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        feet = np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet])
        if np.ptp(feet[:, 2]) > LEVEL or feet[:, 2].max() >= 0.0:
            heights = ", ".join(f"{name} {z:.3f} m" for name, z in zip(robot.feet, feet[:, 2], strict=True))
            raise InputError(f"this posture's feet are not on one level below the body: {heights}", name="posture")
        self._centre = np.array(pin.centerOfMass(model, data, q))
        q[2] = -float(feet[:, 2].min())
        super().__init__(robot, q, feet, shift=shift, shift_period=shift_period, penetration_offset=penetration_offset)

    @property
    def parameters(self) -> dict[str, Any]:
        """Settings of whole-body controllers that fit this robot's weight, for ``make_controller`` and ``Scenario``.

        The normal force of a contact point is between 2 % of its share of the weight (of a corner of a sole: 10 %) and
        twice the whole weight. The weight on contact forces is as large beside that on the body's acceleration as with
        Harpy. For flat feet the formulation is the one that uses the whole sole, and held feet are damped less: on
        compliant ground a sole rocks, and with a damping from 100 1/s on G1 does not come to rest.
        """
        load, share = self.robot.mass * GRAVITY, SOLE_SHARE if self.robot.flat_feet else MIN_SHARE
        parameters: dict[str, Any] = {
            "min_normal_force": share * load / len(self.robot.feet),
            "max_normal_force": 2.0 * load,
            "weights": {"force": FORCE_WEIGHT / self.robot.mass**2},
        }
        if self.robot.flat_feet:
            parameters.update(formulation="full", contact_damping=FLAT_FOOT_DAMPING)
        return parameters

    def over(self, *feet: int) -> Vector:
        """Where the body has to move for the centre of mass to be above the middle of some feet.

        Args:
            feet: their numbers, in the order of :attr:`~harpy_pin.model.robot.Robot.corners`: a flat foot counts as
                one.

        Returns:
            (3,) offset for :meth:`move`, horizontal, m. The legs that stay behind are left out, so the centre of mass
            does not come all the way.

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

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return {
            "posture": self._q[7:].tolist(),
            "shift": field(self._record, "shift").tolist(),
            "shift_period": float(self._record["shift_period"][0]),
            "penetration_offset": float(self._record["penetration_offset"][0]),
            "step_duration": self.step_duration,
        }
