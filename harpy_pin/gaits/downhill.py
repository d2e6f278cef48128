"""Where the body is on a slope that is too steep for friction: downhill of its feet.

Thrust then holds what friction does not, and it acts high above the feet, so that it tips the robot uphill. The weight
balances that where the centre of mass is downhill of the feet. With the thrust T along the slope of angle a, at the
height h above the feet and the distance l uphill of them, the moments about the feet are zero where the centre of mass
is downhill by

    (T / W) (h cos a − l sin a),   T = W (sin a − μ cos a)

A body that moves along the slope changes neither side but by its legs, which move half as far.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["downhill"]

SHARE = 0.6
"""Of the friction that the body's place counts on: controllers leave some of it for errors."""
STEPS = 4
"""Of the iteration; each leaves a sixth of the error."""


def downhill(robot: Robot, posture: Callable[[Vector], Vector], slope: Vector, friction: float) -> Vector:
    """How far the body of a robot with free thrusters goes from its place, along the slope.

    Args:
        robot: who stands.
        posture: from an offset of the body, (3,) in m, to the configuration that has it, with the feet in their places.
        slope: (2,) rise of the ground per metre along x and y.
        friction: static coefficient.

    Returns:
        (3,) offset in world axes, m; zero where friction is enough.
    """
    offset, steep = np.zeros(3), float(np.hypot(*slope))
    short = steep - SHARE * friction
    if short <= 0.0 or not robot.thrusters or robot.rotors:
        return offset
    share = short / (1.0 + steep * steep)  # (T / W) cos a
    along, model, data = slope / steep, robot.model, robot.model.createData()
    for _ in range(STEPS):
        mass = pin.centerOfMass(model, data, posture(offset))
        pin.updateFramePlacements(model, data)
        feet, thrusters = (
            np.mean([data.oMf[robot.frame_id(name)].translation for name in names], axis=0)
            for names in (robot.feet, robot.thrusters)
        )
        arm = thrusters - feet
        uphill = along @ (mass - feet)[:2] + share * (arm[2] - steep * (along @ arm[:2]))
        offset -= uphill * np.array((*along, steep))
    return offset
