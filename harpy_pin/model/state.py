"""What flows between plant and controller: :class:`State` and :class:`Command`. Conventions: see :class:`State`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harpy_pin.model.memory import KeepsViews, fixed_arrays

__all__ = ["Command", "State", "Vector"]

Vector = NDArray[np.float64]
"""float64 array; the shape is given where it is used."""


@dataclass(slots=True)
class State:
    """What a controller gets at each tick. The conventions of the whole library are stated here.

    - Units are SI: m, kg, s, N, N·m, rad.
    - World frame: x forward, y left, z up, right-handed. The ground is the plane z = 0, gravity is (0, 0, −9.81) m/s².
    - Body frame: fixed to the base link, parallel to the world frame when the robot stands upright and faces x.
    - q = (position of the body's origin in the world (3), quaternion in the order x, y, z, w (4), joint angles). The
      quaternion turns body axes into world axes: p_world = position + R p_body.
    - v = (linear velocity of the body's origin (3), angular velocity of the body (3), joint velocities). The two of the
      body are in *body* axes, as Pinocchio has them for a free flyer. So nv = nq − 1, and the body's linear velocity
      in world axes is R v[:3].
    - Joints follow the order of the model (``robot.joints``). Harpy's: left hip frontal, left hip sagittal, left knee,
      then the same on the right; nq = 13, nv = 12. A positive frontal angle is a right-handed turn about x, a positive
      sagittal or knee angle one about y, of the lower link against the upper.
    - Feet and thrusters follow ``robot.feet`` and ``robot.thrusters``: left, then right.
    - Contact forces act from the ground on the robot, thrusts from the thruster on the robot, joint torques from the
      upper link on the lower one. The force on a stance foot points upwards (z > 0).
    - Everything about feet, contact forces and thrusts is in world axes.

    Attributes:
        t: time, s: the present, even where the rest was measured a while ago.
        q: (nq,) configuration.
        v: (nv,) generalised velocity.
        foot_position: (feet, 3) foot positions, m.
        foot_velocity: (feet, 3) foot velocities, m/s.
        foot_force: (feet, 3) measured force of the ground on each foot, N.
    """

    t: float
    q: Vector
    v: Vector
    foot_position: Vector
    foot_velocity: Vector
    foot_force: Vector

    def __repr__(self) -> str:
        place = ", ".join(f"{value:.3f}" for value in np.asarray(self.q)[:3])
        return f"State(t={self.t:.3f} s, body at ({place}) m, nq={len(self.q)}, {len(self.foot_position)} feet)"

    def copy(self) -> State:
        """A state that shares no memory with this one."""
        arrays = (self.q, self.v, self.foot_position, self.foot_velocity, self.foot_force)
        return State(self.t, *(array.copy() for array in arrays))


@fixed_arrays("thrust", "torque")
@dataclass
class Command(KeepsViews):
    """What a controller returns at each tick. To assign to an attribute writes into its array.

    Attributes:
        torque: (joints,) joint torques, in the order of the model, N·m.
        thrust: (thrusters, 3) forces of thrusters and rotors on the robot, world axes, N; that of a rotor is along its
            axis, see :mod:`harpy_pin.model.rotor`.
    """

    torque: Vector
    thrust: Vector

    def __repr__(self) -> str:
        most = float(np.max(np.abs(self.torque), initial=0.0))
        text = f"Command({len(self.torque)} torques up to {most:.3g} N·m"
        if len(self.thrust):
            largest = float(np.linalg.norm(self.thrust, axis=1).max())
            text += f", {len(self.thrust)} thrusts up to {largest:.3g} N"
        return f"{text})"
