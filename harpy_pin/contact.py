"""The true contact force as an affine map of what the robot is commanded (READING.md W9).

Feet that touch are taken to stick: J_f a + J̇ v = −κ v_foot. With M a + n + B v = X y + J_fᵀ f, y = [u; τ] the thrusts
and joint torques and X = [J_tᵀ S], the force on them is affine in the command:

    f(y) = −Λ ( J_f M⁻¹ (X y − n − B v) + J̇ v + κ v_foot ) = f₀ + A y
    Λ = (J_f M⁻¹ J_fᵀ)⁻¹,   A = −Λ J_f M⁻¹ X = [G H]

G acts from the thrusts, H from the joint torques. It is the force that *sticking demands*: a foot slides where it
leaves Coulomb's cone. A change δy changes the accelerations by M⁻¹ (X + J_fᵀ A) δy.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.dynamics import Dynamics
from harpy_pin.robot import Robot
from harpy_pin.state import Vector

__all__ = ["ContactForceMap", "ContactTerms"]


class ContactTerms:
    """Arrays that the kernels of this module share, made once for a robot.

    Attributes:
        rows: (3 feet,) indices of the foot directions that touch, packed to the front.
        factor: (nv, nv) lower Cholesky factor L of M, with the reciprocals of its diagonal in the diagonal's place.
        contact: (3 feet, nv) L⁻¹ J_fᵀ, one row per touching direction.
        inputs: (n_y, nv) L⁻¹ X, one row per input.
        drive: (nv,) work space.
        delassus: (3 feet, 3 feet) Cholesky factor of J_f M⁻¹ J_fᵀ, stored likewise.
        force: (3 feet,) f(y) of the touching directions, N.
        gain: (3 feet, n_y) A of the touching directions.
        response: (n_y, nv) change of the acceleration per input, one row per input.
    """

    def __init__(self, robot: Robot) -> None:
        nv, nf = robot.model.nv, 3 * len(robot.feet)
        ny = 3 * len(robot.thrusters) + len(robot.joints)
        self.joint_damping: Vector = np.array(robot.model.damping, dtype=np.float64)
        self.rows: NDArray[np.int64] = np.zeros(nf, dtype=np.int64)
        self.factor: Vector = np.zeros((nv, nv))
        self.contact: Vector = np.zeros((nf, nv))
        self.inputs: Vector = np.zeros((ny, nv))
        self.drive: Vector = np.zeros(nv)
        self.delassus: Vector = np.zeros((nf, nf))
        self.force: Vector = np.zeros(nf)
        self.gain: Vector = np.zeros((nf, ny))
        self.response: Vector = np.zeros((ny, nv))


class ContactForceMap:
    """Contact forces of feet that stick, and how thrusts and torques change them.

    All arrays are overwritten by :meth:`update`; the rows of feet that do not touch are zero.

    Args:
        robot: any robot with feet.
        damping: κ, rate at which a touching foot is taken to lose its velocity, 1/s.

    Attributes:
        force: (feet, 3) f at the command given, world axes, N.
        thrust_gain: (3 feet, 3 thrusters) G.
        torque_gain: (3 feet, joints) H, 1/m.
        response: (nv, 3 thrusters + joints) change of the generalised acceleration per change of [u; τ].

    Raises:
        InputError: a negative damping.
    """

    def __init__(self, robot: Robot, *, damping: float = 0.0) -> None:
        self.robot = robot
        self.damping = checks.number("damping", damping, low=0.0)
        feet, split = len(robot.feet), 3 * len(robot.thrusters)
        self._terms = ContactTerms(robot)
        self.force: Vector = np.zeros((feet, 3))
        self._gain = np.zeros((3 * feet, split + len(robot.joints)))
        self.thrust_gain: Vector = self._gain[:, :split]
        self.torque_gain: Vector = self._gain[:, split:]
        self.response: Vector = self._terms.response.T

    def update(self, dynamics: Dynamics, v: Vector, *, torque: Vector, thrust: Vector, touching: ArrayLike) -> Vector:
        """Evaluate the map.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            torque: (joints,) joint torques of the command, N·m.
            thrust: (thrusters, 3) thruster forces of the command, world axes, N.
            touching: (feet,) which feet touch the ground.

        Returns:
            (feet, 3) the force that sticking demands under this command, N: the array :attr:`force` itself.
        """
        w = self._terms
        feet = np.flatnonzero(checks.vector("touching", touching, len(self.robot.feet)))
        count = 3 * len(feet)
        w.rows[:count] = (3 * feet[:, None] + np.arange(3)).ravel()
        contact_force(
            dynamics.mass_matrix,
            dynamics.bias,
            w.joint_damping,
            v,
            dynamics.foot_jacobian,
            dynamics.foot_drift,
            dynamics.foot_velocity,
            dynamics.thruster_jacobian,
            torque,
            thrust,
            self.damping,
            w.rows,
            count,
            w.factor,
            w.contact,
            w.drive,
            w.delassus,
            w.force,
        )
        contact_gain(dynamics.thruster_jacobian, count, w.factor, w.contact, w.delassus, w.inputs, w.gain, w.response)
        self.force[:] = 0.0
        self._gain[:] = 0.0
        self.force.reshape(-1)[w.rows[:count]] = w.force[:count]
        self._gain[w.rows[:count]] = w.gain[:count]
        return self.force


@njit(cache=True)
def contact_force(  # type: ignore[no-untyped-def]
    mass_matrix,
    bias,
    joint_damping,
    v,
    foot_jacobian,
    foot_drift,
    foot_velocity,
    thruster_jacobian,
    torque,
    thrust,
    damping,
    rows,
    count,
    factor,
    contact,
    drive,
    delassus,
    force,
):
    """f(y) of the ``count`` touching directions in ``rows``; fills factor, contact, drive, delassus and force."""
    nv = v.shape[0]
    for i in range(nv):
        s = -bias[i] - joint_damping[i] * v[i]
        for k in range(thrust.shape[0]):
            for a in range(3):
                s += thruster_jacobian[3 * k + a, i] * thrust[k, a]
        drive[i] = s
    base = nv - torque.shape[0]
    for j in range(torque.shape[0]):
        drive[base + j] += torque[j]
    for j in range(nv):
        for i in range(j, nv):
            s = mass_matrix[i, j]
            for k in range(j):
                s -= factor[i, k] * factor[j, k]
            factor[i, j] = 1.0 / np.sqrt(s) if i == j else s * factor[j, j]
    forward_substitute(factor, drive, 0)
    for c in range(count):
        for i in range(nv):
            contact[c, i] = foot_jacobian[rows[c], i]
        forward_substitute(factor, contact[c], 0)
    for a in range(count):
        r = rows[a]
        s = foot_drift[r] + damping * foot_velocity[r // 3, r % 3]
        for i in range(nv):
            s += contact[a, i] * drive[i]
        force[a] = -s
        for b in range(a + 1):
            s = 0.0
            for i in range(nv):
                s += contact[a, i] * contact[b, i]
            for k in range(b):
                s -= delassus[a, k] * delassus[b, k]
            # Two feet in one place share a direction: the floor keeps their factor finite.
            delassus[a, b] = 1.0 / np.sqrt(max(s, 1e-12)) if a == b else s * delassus[b, b]
    solve_factored(delassus, force, count)


@njit(cache=True)
def contact_gain(  # type: ignore[no-untyped-def]
    thruster_jacobian, count, factor, contact, delassus, inputs, gain, response
):
    """A and M⁻¹ (X + J_fᵀ A), after :func:`contact_force`; fills inputs, gain and response."""
    ny, nv = inputs.shape
    nt = thruster_jacobian.shape[0]
    column = np.empty(count)
    for y in range(ny):
        x = inputs[y]
        first = 0
        if y < nt:
            for i in range(nv):
                x[i] = thruster_jacobian[y, i]
        else:
            first = nv - ny + y
            for i in range(nv):
                x[i] = 0.0
            x[first] = 1.0
        forward_substitute(factor, x, first)
        for c in range(count):
            s = 0.0
            for i in range(first, nv):
                s -= contact[c, i] * x[i]
            column[c] = s
        solve_factored(delassus, column, count)
        out = response[y]
        for i in range(nv):
            s = x[i]
            for c in range(count):
                s += contact[c, i] * column[c]
            out[i] = s
        for c in range(count):
            gain[c, y] = column[c]
        for i in range(nv - 1, -1, -1):
            s = out[i]
            for k in range(i + 1, nv):
                s -= factor[k, i] * out[k]
            out[i] = s * factor[i, i]


@njit(cache=True)
def forward_substitute(factor, x, first):  # type: ignore[no-untyped-def]
    """x ← L⁻¹ x for an x that is zero before ``first``; the diagonal of a factor holds the reciprocals."""
    for i in range(first, x.shape[0]):
        s = x[i]
        for k in range(first, i):
            s -= factor[i, k] * x[k]
        x[i] = s * factor[i, i]


@njit(cache=True)
def solve_factored(factor, x, n):  # type: ignore[no-untyped-def]
    """x ← (L Lᵀ)⁻¹ x for the leading n rows."""
    for i in range(n):
        s = x[i]
        for k in range(i):
            s -= factor[i, k] * x[k]
        x[i] = s * factor[i, i]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, n):
            s -= factor[k, i] * x[k]
        x[i] = s * factor[i, i]
