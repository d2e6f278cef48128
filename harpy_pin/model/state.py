"""What flows between plant and controller: :class:`State` and :class:`Command`. Conventions: see
:class:`State`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.memory import KeepsViews, fixed_arrays

Vector = NDArray[np.float64]
"""float64 array; the shape is given where it is used."""
GRAVITY = 9.81
"""m/s² (equations.md §3)."""


@dataclass(slots=True)
class State:
    """What a controller gets at each tick. The conventions of the whole library are stated here.

    - Units are SI: m, kg, s, N, N·m, rad.
    - World frame: x forward, y left, z up, right-handed. The ground is the plane z = 0, gravity is
      (0, 0, −9.81) m/s².
    - Body frame: fixed to the base link, parallel to the world frame when the robot stands upright
      and faces x.
    - q = (position of the body's origin in the world (3), quaternion in the order x, y, z, w (4),
      joint angles). The quaternion turns body axes into world axes: p_world = position + R p_body.
    - v = (linear velocity of the body's origin (3), angular velocity of the body (3), joint
      velocities). The two of the body are in *body* axes, as Pinocchio has them for a free flyer.
      So nv = nq − 1, and the body's linear velocity in world axes is R v[:3].
    - Joints follow the order of the model (``robot.joints``). Harpy's: left hip frontal, left hip
      sagittal, left knee, then the same on the right; nq = 13, nv = 12. A positive frontal angle is
      a right-handed turn about x, a positive sagittal or knee angle one about y, of the lower link
      against the upper.
    - Feet and thrusters follow ``robot.feet`` and ``robot.thrusters``: left, then right.
    - Contact forces act from the ground on the robot, thrusts from the thruster on the robot, joint
      torques from the upper link on the lower one. The force on a stance foot points upwards (z >
      0).
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
        return (
            f"State(t={self.t:.3f} s, body at ({place}) m, nq={len(self.q)}, "
            f"{len(self.foot_position)} feet)"
        )

    def copy(self) -> State:
        """A state that shares no memory with this one."""
        arrays = (self.q, self.v, self.foot_position, self.foot_velocity, self.foot_force)
        return State(self.t, *(array.copy() for array in arrays))


@fixed_arrays("law", "thrust", "torque", copied=False)
class Command(KeepsViews):
    """What a controller returns at each tick. To assign to an attribute writes into its array.

    A motor may have a law of its own, which it evaluates much faster than the controller ticks:

        τ_j + k_p (q_j* − q_j) + k_d (q̇_j* − q̇_j),

    within the model's peak torque. Plants evaluate it in every physics step.

    Args:
        torque: (joints,) joint torques, in the order of the model, N·m.
        thrust: (thrusters, 3) forces of thrusters and rotors on the robot, world axes, N; that of a
            rotor is along its axis, see :mod:`harpy_pin.model.rotor`. None for a robot without any.
        q: (joints,) joint targets q*, rad. They need a stiffness.
        v: (joints,) targets of their velocities q̇*, rad/s; zero by default.
        k_p: (joints,) stiffness of the motors, or one for all, N·m/rad.
        k_d: (joints,) damping of the motors, or one for all, N·m·s/rad.

    Attributes:
        torque: as given.
        thrust: as given.
        law: (4, joints) rows q*, q̇*, k_p and k_d; None for torque alone.

    Raises:
        InputError: numbers of the motors' law that do not fit the torques, are not finite, or gains
            that are negative.
    """

    torque: Vector
    thrust: Vector
    law: Vector | None
    _torque_: Vector
    _thrust_: Vector

    def __init__(
        self,
        torque: Vector,
        thrust: Vector | None = None,
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        k_p: ArrayLike | None = None,
        k_d: ArrayLike | None = None,
    ) -> None:
        self.torque, self.thrust = torque, np.zeros((0, 3)) if thrust is None else thrust
        self.law = None if k_p is None and k_d is None else _motor_law(len(torque), q, v, k_p, k_d)
        if self.law is None and not (q is None and v is None):
            raise InputError("joint targets need a stiffness k_p or a damping k_d", name="k_p")

    def __repr__(self) -> str:
        most = float(np.max(np.abs(self.torque), initial=0.0))
        text = f"Command({len(self.torque)} torques up to {most:.3g} N·m"
        if len(self.thrust):
            largest = float(np.linalg.norm(self.thrust, axis=1).max())
            text += f", {len(self.thrust)} thrusts up to {largest:.3g} N"
        if self.law is not None:
            text += f", motors with k_p up to {self.law[2].max():.3g} N·m/rad"
        return f"{text})"


def _motor_law(
    joints: int,
    q: ArrayLike | None,
    v: ArrayLike | None,
    k_p: ArrayLike | None,
    k_d: ArrayLike | None,
) -> Vector:
    """The rows of a command's law (4, joints)."""
    law = np.zeros((4, joints))
    if k_p is not None and q is None and np.any(np.asarray(k_p) != 0.0):
        raise InputError("a stiffness k_p needs joint targets q", name="q")
    for row, (name, value) in enumerate({"q": q, "v": v, "k_p": k_p, "k_d": k_d}.items()):
        if value is not None:
            given = np.full(joints, value) if row > 1 and np.ndim(value) == 0 else value
            law[row] = checks.vector(name, given, joints)
    if (law[2:] < 0.0).any():
        raise InputError(
            "gains of the motors must not be negative", name="k_p", value=law[2:].min()
        )
    return law
