"""How much delay, and how slow a thrust, a feedback loop survives: linear arguments.

A loop ẋ = A x + B u is closed by u = −K x. The state is measured ``delay`` ago, and the command is
held over a control period T (zero-order hold). Between ticks the plant is integrated by the matrix
exponential, so the state at the next tick is a linear function of the present state and of the
commands that are still under way. The loop is stable while the eigenvalues of that map lie inside
the unit circle, and the largest delay for which they do is its *delay margin*.

For joints under a PD control law the loop follows from the model: torques τ accelerate the joints
by P τ, where

    P = [M⁻¹ − M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹ J M⁻¹] restricted to the joints,

J the Jacobian of the feet that are held. The base is free in it. 1/Pⱼⱼ is the *apparent* inertia of
motor j. The argument is about fast motion at one posture: it leaves out gravity, Coriolis terms,
the slow motion of the body on its foot, the ground's compliance, and the integral part of a PID.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, inf, sqrt

import numpy as np
from scipy.linalg import expm

from harpy_pin import Dynamics, Robot
from harpy_pin.model.state import Vector

MARGINAL = 1e-6
"""How far an eigenvalue may lie outside the unit circle by rounding."""
MOST = 0.1
"""Largest delay that is looked at, s."""


@dataclass(frozen=True, eq=False)
class DelayedLoop:
    """A linear plant under a linear feedback that is sampled, late and held."""

    a: Vector  # (n, n) A of ẋ = A x + B u
    b: Vector  # (n, m) B
    k: Vector  # (m, n) K of u = −K x
    period: float = 1e-3  # T, between ticks, s

    def matrix(self, delay: float) -> Vector:
        """The map from one tick to the next, of measurements of this age when they are used, s.

        Returns:
            (n + h m, n + h m) for the state x and the last h commands, the latest first; h = ⌊delay
            / T⌋ + 1.
        """
        n, m = self.b.shape
        ticks = int(delay / self.period + 1e-9)
        late = max(delay - ticks * self.period, 0.0)
        whole, _ = self._held(self.period)
        rest, new = self._held(self.period - late)
        _, old = self._held(late)
        size = n + m * (ticks + 1)
        out = np.zeros((size, size))
        out[:n, :n] = whole
        # Over this period acts first the command of ticks + 1 ticks ago, then that of ticks ago.
        for age, gain in ((ticks + 1, rest @ old), (ticks, new)):
            if age == 0:
                out[:n, :n] -= gain @ self.k
            else:
                out[:n, n + m * (age - 1) : n + m * age] += gain
        out[n : n + m, :n] = -self.k
        out[n + m :, n:-m] = np.eye(size - n - m)
        return out

    def growth(self, delay: float) -> float:
        """Rate at which the worst motion grows, 1/s: below zero the loop is stable."""
        radius = float(np.abs(np.linalg.eigvals(self.matrix(delay))).max())
        return float(np.log(max(radius, 1e-300))) / self.period

    def delay_margin(self) -> float:
        """Largest delay up to which the loop is stable, s, to a hundredth of the period.

        Zero where it is unstable without delay, ``inf`` where it is stable up to :data:`MOST`.
        """
        low, step = 0.0, 0.25 * self.period
        if not self._stable(low):
            return 0.0
        while self._stable(low + step):
            low += step
            if low >= MOST:
                return inf
        high = low + step
        while high - low > 0.01 * self.period:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._stable(middle) else (low, middle)
        return low

    def _stable(self, delay: float) -> bool:
        return self.growth(delay) * self.period <= MARGINAL

    def _held(self, time: float) -> tuple[Vector, Vector]:
        """State transition over a time, and what a command held for that time adds."""
        n, m = self.b.shape
        block = np.zeros((n + m, n + m))
        block[:n, :n], block[:n, n:] = self.a, self.b
        block = expm(block * time)
        return block[:n, :n], block[:n, n:]


def joint_mobility(robot: Robot, q: Vector, *, held: Sequence[str] = ()) -> Vector:
    """P, (joints, joints), rad/s² per N·m: accelerations of the joints per joint torque, with the
    base free.

    Args:
        robot: any robot with a free base.
        q: (nq,) configuration.
        held: names of the feet that the ground holds.
    """
    d = Dynamics(robot)
    d.update(q, np.zeros(robot.nv))
    inverse = np.linalg.inv(d.mass_matrix)
    rows = [3 * robot.feet.index(name) + i for name in held for i in range(3)]
    if rows:
        moved = d.foot_jacobian[rows] @ inverse
        inverse = inverse - moved.T @ np.linalg.pinv(moved @ d.foot_jacobian[rows].T) @ moved
    first = robot.nv - len(robot.joints)
    return np.array(inverse[first:, first:], dtype=np.float64)


def joint_loop(
    robot: Robot,
    q: Vector,
    *,
    k_p: Sequence[float],
    k_d: Sequence[float],
    held: Sequence[str] = (),
    joints: Sequence[int] | None = None,
    period: float = 1e-3,
) -> DelayedLoop:
    """Joints under a PD control law at one posture.

    Args:
        robot: any robot with a free base.
        q: (nq,) configuration.
        k_p: (joints,) stiffness, N·m/rad.
        k_d: (joints,) damping, N·m·s/rad.
        held: names of the feet that the ground holds.
        joints: which are controlled, in the order of the torques, all by default; the others move
            freely.
        period: between ticks, s.
    """
    count = len(robot.joints)
    chosen = list(range(count) if joints is None else joints)
    mobility = joint_mobility(robot, q, held=held)[np.ix_(chosen, chosen)]
    friction = np.diag(np.array(robot.model.damping)[robot.nv - count :][chosen])
    zero = np.zeros((len(chosen), len(chosen)))
    return DelayedLoop(
        a=np.block([[zero, np.eye(len(chosen))], [zero, -mobility @ friction]]),
        b=np.vstack((zero, mobility)),
        k=np.hstack((np.diag(np.array(k_p)[chosen]), np.diag(np.array(k_d)[chosen]))),
        period=period,
    )


def pd_delay_margin(k_p: float, k_d: float, *, period: float = 0.0) -> float:
    """Delay margin of a commanded acceleration −k_p e − k_d ė, s: a double integrator at every
    posture.

    The open loop (k_d s + k_p)/s² has its crossover at ω_c with ω_c² = ½ (k_d² + √(k_d⁴ + 4 k_p²))
    and the phase margin φ = atan(k_d ω_c / k_p). It survives a delay of φ/ω_c, of which the hold
    takes half a period. With k_p = 0, a velocity that is damped, this is π / (2 k_d) − T/2. Exact
    without a hold, and with one to second order in ω_c T; never below zero.

    Args:
        k_p: 1/s².
        k_d: 1/s.
        period: T, between ticks, s; zero for a command that is never held.
    """
    crossover = sqrt(0.5 * (k_d**2 + sqrt(k_d**4 + 4.0 * k_p**2)))
    return max(atan2(k_d * crossover, k_p) / crossover - 0.5 * period, 0.0)


def pd_lag_margin(k_p: float, k_d: float, *, period: float = 0.0) -> float:
    """Largest lag T of thrusts up to which −k_p e − k_d ė is stable where only thrusts can give it,
    s.

    Tasks of whole-body controllers and the paper's thruster feedback command so. Thrusts follow by
    a first-order lag T, and the closed loop is s² (T s + 1) + (k_d s + k_p) e^(−s h/2) = 0, with
    half a period h for the hold. To first order in h this is a cubic, and the criterion of Routh
    and Hurwitz says up to which T it is stable: k_d/k_p where nothing is held; never below zero.
    Where legs and contact forces give what thrusts do not give yet, walks bear more.

    Args:
        k_p: 1/s².
        k_d: 1/s.
        period: h, between ticks, s; zero for a command that is never held.
    """
    square, linear = 1.0 - 0.5 * period * k_d, k_d / k_p - 0.5 * period
    return square * linear if square > 0.0 and linear > 0.0 else 0.0
