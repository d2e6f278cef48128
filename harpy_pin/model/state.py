"""What flows between plant and controller: :class:`State` and :class:`Command`.

World frame: x forward, y left, z up; the ground is z = 0. Generalised coordinates are Pinocchio's for a free
flyer: q = (position, quaternion xyzw, joint angles), v = (linear velocity in the body frame, angular velocity
in the body frame, joint velocities).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Command", "State", "Vector"]

Vector = NDArray[np.float64]
"""float64 array; the shape is given where it is used."""


@dataclass(slots=True)
class State:
    """What a controller gets at each tick.

    Attributes:
        t: time, s: the present, even where the rest was measured a while ago.
        q: (nq,) configuration.
        v: (nv,) generalised velocity.
        foot_position: (feet, 3) foot positions, world, m.
        foot_velocity: (feet, 3) foot velocities, world axes, m/s.
        foot_force: (feet, 3) measured force of the ground on each foot, world axes, N.
    """

    t: float
    q: Vector
    v: Vector
    foot_position: Vector
    foot_velocity: Vector
    foot_force: Vector

    def copy(self) -> State:
        """A state that shares no memory with this one."""
        return State(
            self.t,
            self.q.copy(),
            self.v.copy(),
            self.foot_position.copy(),
            self.foot_velocity.copy(),
            self.foot_force.copy(),
        )


@dataclass(slots=True)
class Command:
    """What a controller returns at each tick.

    Attributes:
        torque: (joints,) joint torques, in the order of the model, N·m.
        thrust: (thrusters, 3) thruster forces on the robot, world axes, N.
    """

    torque: Vector
    thrust: Vector
