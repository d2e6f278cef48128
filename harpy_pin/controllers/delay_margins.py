"""How much measurement delay a feedback loop survives: a linear argument, in discrete time and exact.

A loop ẋ = A x + B u is closed by u = −K x. The state is measured ``delay`` ago, and the command is held over a control
period T (zero-order hold). Between ticks the plant is integrated by the matrix exponential, so the state at the next
tick is a linear function of the present state and of the commands that are still under way. The loop is stable while
the eigenvalues of that map lie inside the unit circle, and the largest delay for which they do is its *delay margin*.

For joints under a PD control law the loop follows from the model: torques τ accelerate the joints by P τ, where

    P = [M⁻¹ − M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹ J M⁻¹] restricted to the joints,

J the Jacobian of the feet that are held. The base is free in it. 1/Pⱼⱼ is the *apparent*
inertia of motor j. The argument is about fast motion at one posture: it leaves out gravity, Coriolis terms, the slow
motion of the body on its foot, the ground's compliance, and the integral part of a PID.

With accelerations commanded through the inverse dynamics the loop is a double integrator at every posture, and its
margin has the closed form of :func:`pd_delay_margin`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, inf, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import Vector

__all__ = ["DelayedLoop", "joint_loop", "joint_mobility", "pd_delay_margin"]

MARGINAL = 1e-6
"""How far an eigenvalue may lie outside the unit circle by rounding."""


@dataclass(frozen=True, eq=False)
class DelayedLoop:
    """A linear plant under a linear feedback that is sampled, late and held.

    Attributes:
        a: (n, n) A of ẋ = A x + B u.
        b: (n, m) B.
        k: (m, n) K of u = −K x.
        period: T, between ticks, s.

    Raises:
        InputError: shapes that do not match, entries that are not finite, or a period that is not positive.
    """

    a: Vector
    b: Vector
    k: Vector
    period: float = 1e-3

    def __post_init__(self) -> None:
        a, b = np.atleast_2d(self.a), np.atleast_2d(self.b)
        n, m = b.shape
        k = checks.vector("k", np.atleast_2d(self.k), (m, n))
        checks.keep(self, a=checks.vector("a", a, (n, n)), b=checks.vector("b", b, (n, m)), k=k)
        checks.keep(self, period=checks.number("period", self.period, low=0.0, strict=True))

    def matrix(self, delay: float) -> Vector:
        """The map from one tick to the next.

        Args:
            delay: age of the measurements when they are used, s; any number, not only whole periods.

        Returns:
            (n + h m, n + h m) for the state x and the last h commands, the latest first; h = ⌊delay / T⌋ + 1.
        """
        delay = checks.number("delay", delay, low=0.0)
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

    def delay_margin(self, *, most: float = 0.1) -> float:
        """Largest delay up to which the loop is stable, s.

        Args:
            most: the largest delay that is looked at, s.

        Returns:
            To a hundredth of the period; zero where the loop is unstable without delay, ``inf`` where it is stable
            up to ``most``.
        """
        most = checks.number("most", most, low=0.0, strict=True)
        low, step = 0.0, 0.25 * self.period
        if not self._stable(low):
            return 0.0
        while self._stable(low + step):
            low += step
            if low >= most:
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


def joint_mobility(robot: Robot, q: ArrayLike, *, held: Sequence[str] = ()) -> Vector:
    """P: accelerations of the joints per joint torque, with the base free.

    Args:
        robot: any robot with a free base.
        q: (nq,) configuration.
        held: names of the feet that the ground holds.

    Returns:
        (joints, joints) P, rad/s² per N·m.

    Raises:
        InputError: a foot that the robot does not have, or no configuration.
    """
    for name in held:
        checks.one_of("foot", name, robot.feet)
    d = Dynamics(robot)
    d.update(configuration(robot.model, q), np.zeros(robot.model.nv))
    inverse = np.linalg.inv(d.mass_matrix)
    rows = [3 * k + i for k, name in enumerate(robot.feet) if name in held for i in range(3)]
    if rows:
        moved = d.foot_jacobian[rows] @ inverse
        inverse = inverse - moved.T @ np.linalg.pinv(moved @ d.foot_jacobian[rows].T) @ moved
    first = robot.model.nv - len(robot.joints)
    return np.array(inverse[first:, first:], dtype=np.float64)


def joint_loop(
    robot: Robot,
    q: ArrayLike,
    *,
    k_p: ArrayLike,
    k_d: ArrayLike,
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
        joints: which joints are controlled, in the order of the torques, all by default; the others move freely.
        period: between ticks, s.

    Raises:
        InputError: a foot or a joint that the robot does not have, or gains of another number.
    """
    count = len(robot.joints)
    stiffness, damping = checks.vector("k_p", k_p, count), checks.vector("k_d", k_d, count)
    chosen = list(range(count)) if joints is None else [int(j) for j in joints]
    if not chosen or len(set(chosen)) != len(chosen) or not all(0 <= j < count for j in chosen):
        message = f"joints must be different numbers from 0 to {count - 1}, got {joints!r}"
        raise InputError(message, name="joints", value=joints)
    mobility = joint_mobility(robot, q, held=held)[np.ix_(chosen, chosen)]
    n = len(chosen)
    friction = np.diag(np.array(robot.model.damping)[robot.model.nv - count :][chosen])
    zero = np.zeros((n, n))
    return DelayedLoop(
        a=np.block([[zero, np.eye(n)], [zero, -mobility @ friction]]),
        b=np.vstack((zero, mobility)),
        k=np.hstack((np.diag(stiffness[chosen]), np.diag(damping[chosen]))),
        period=period,
    )


def pd_delay_margin(k_p: float, k_d: float, *, period: float = 0.0) -> float:
    """Delay margin of a commanded acceleration −k_p e − k_d ė, in closed form.

    The open loop (k_d s + k_p)/s² has its crossover at ω_c with ω_c² = ½ (k_d² + √(k_d⁴ + 4 k_p²)) and the phase margin
    φ = atan(k_d ω_c / k_p). It survives a delay of φ/ω_c, of which the hold takes half a period. With k_p = 0, a
    velocity that is damped, this is π / (2 k_d) − T/2.

    Args:
        k_p: 1/s².
        k_d: 1/s.
        period: T, between ticks, s; zero for a command that is never held.

    Returns:
        The margin, s: exact without a hold, and with one to second order in ω_c T; never below zero.

    Raises:
        InputError: a gain that is negative, or both are zero.
    """
    k_p, k_d = checks.number("k_p", k_p, low=0.0), checks.number("k_d", k_d, low=0.0)
    period = checks.number("period", period, low=0.0)
    if k_p == 0.0 and k_d == 0.0:
        raise InputError("a loop without gains has no margin", name="k_d", value=k_d)
    crossover = sqrt(0.5 * (k_d**2 + sqrt(k_d**4 + 4.0 * k_p**2)))
    return max(atan2(k_d * crossover, k_p) / crossover - 0.5 * period, 0.0)
