"""The implicit time step of a contact: forces at the end of a step together with the velocities
that they cause.

A foot whose force fits in the cone does not move at all. The law is that of
:mod:`harpy_pin.ground.ground`.

Coulomb friction in the joints is found together with the contact forces. A joint whose friction
suffices to hold it does not move at all; another one has the whole friction against its motion.
Contact forces and joint friction are found in turn (Gauss–Seidel), each with the other given, until
neither changes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.ground.ground import GroundRecord, stribeck
from harpy_pin.kernels import kernel
from harpy_pin.model.cholesky import solve_transposed
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.simulation.sole_contact import sole_step

if TYPE_CHECKING:
    from harpy_pin.simulation.step import StepRecord

TINY = 1e-30  # keeps quotients of two zeros finite
ROUNDS = 200  # most rounds of contact forces and joint friction in a step
TOLERANCE = 1e-9  # change of a joint's friction, as a share of its limit, that ends them


@kernel
def _solve_normal(
    height: float, free: float, mobility: float, dt: float, k: float, d: float
) -> float:
    """Normal force at the end of a step, N: the law of E1 at height + dt u, with u = free +
    mobility·force.

    The law, with the vertical jump where the damper engages filled in, is a monotone graph in u:
    one solution.
    """
    threshold = -height / dt
    if free >= threshold:
        return 0.0
    # Going down: force = -k (height + dt u) - d u.
    force = (-k * height - (k * dt + d) * free) / (1.0 + (k * dt + d) * mobility)
    u = free + mobility * force
    if u >= 0.0:
        # Rebound: no damping.
        force = (-k * height - k * dt * free) / (1.0 + k * dt * mobility)
        u = free + mobility * force
    if u > threshold:
        force = (threshold - free) / mobility
    return max(force, 0.0)


@kernel
def _solve_slide_1d(
    free: float, mobility: float, normal: float, mu_s: float, mu_c: float, ground: GroundRecord
) -> float:
    """Friction along one axis, N: zero velocity if the box allows it, else sliding at the Stribeck
    force.
    """
    stick = -free / mobility
    if abs(stick) <= mu_s * normal:
        return stick
    # Speed s > 0 with s = |free| - mobility F(s): the right side falls below s at s = |free|.
    start = abs(free)
    low, high = 0.0, start
    speed = max(start - mobility * mu_s * normal, 0.0)
    drop = 2.0 * (mu_s - mu_c) * normal
    for _ in range(60):
        gap = speed + mobility * stribeck(speed, normal, mu_s, mu_c, ground) - start
        if gap > 0.0:
            high = speed
        else:
            low = speed
        if abs(gap) <= 1e-13 * start or high - low <= 1e-15:
            break
        ratio = speed / ground.stribeck_velocity
        slope = 1.0 + mobility * (
            ground.mu_v - drop * ratio / ground.stribeck_velocity * np.exp(-ratio * ratio)
        )
        speed = speed - gap / slope if slope > 0.0 else -1.0
        if speed <= low or speed >= high:
            speed = 0.5 * (low + high)
    return -(free / start) * stribeck(speed, normal, mu_s, mu_c, ground)


@kernel
def _solve_two(a: Vector, b: Vector) -> Vector:
    """A⁻¹ b of a symmetric matrix (2, 2)."""
    det = a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]
    return np.array(
        [(a[1, 1] * b[0] - a[0, 1] * b[1]) / det, (a[0, 0] * b[1] - a[0, 1] * b[0]) / det]
    )


@kernel
def _first_gain(u: Vector, a: Vector, most: float, guess: Vector) -> float:
    """Where to begin: the gain of the force guessed, or as if the mobility were the same in all
    directions.
    """
    w = u + a @ guess
    against = -(guess @ w)
    if against > 0.0:
        return float(against / (w @ w + TINY))
    start = np.sqrt(u @ u)
    return float(
        max(most / max(start - 0.5 * (a[0, 0] + a[1, 1]) * most, 0.01 * start + TINY), 1e-12)
    )


@kernel
def _solve_slide_2d(
    u: Vector,
    a: Vector,
    normal: float,
    mu_s: float,
    mu_c: float,
    ground: GroundRecord,
    guess: Vector,
) -> Vector:
    """Friction in the plane, N: zero velocity if Coulomb's disc allows it, else sliding against the
    motion.

    The force is −g w with w the velocity that it leaves, (I + g A)⁻¹ u, and g |w| = F(|w|). In g −
    F/|w|, nearly a straight line, Newton's steps find the gain g, with a bracket around it and a
    guess of the force to begin with.
    """
    stick = -_solve_two(a, u)
    if stick @ stick <= (mu_s * normal) ** 2:
        return stick
    gain = _first_gain(u, a, mu_c * normal, guess)
    low, high, last = 0.0, np.inf, np.inf
    w = np.empty(2)
    for _ in range(100):
        w[:] = _solve_two(np.eye(2) + gain * a, u)
        speed = float(np.sqrt(w @ w)) + TINY
        ratio = speed / ground.stribeck_velocity
        more = (mu_s - mu_c) * normal * np.exp(-ratio * ratio)
        friction = mu_c * normal + more + ground.mu_v * speed
        rest = gain - friction / speed
        if rest > 0.0:
            high = gain
        else:
            low = gain
        if abs(rest) * speed <= 1e-13 * (1.0 + friction) or high - low <= 1e-15 * gain:
            break
        # How the speed and rest change with the gain.
        slowing = -float(w @ _solve_two(np.eye(2) + gain * a, a @ w)) / speed
        steeper = ground.mu_v - 2.0 * more * ratio / ground.stribeck_velocity
        slope = 1.0 - (steeper - friction / speed) * slowing / speed
        gain = gain - rest / slope if slope > 0.0 and abs(rest) < 0.5 * last else -1.0
        last = abs(rest)
        if not low < gain < high:  # Newton leaves the bracket or is slow
            gain = 0.5 * (low + high) if high < np.inf else 4.0 * low
            last = np.inf
    return -gain * w


@kernel(
    mobility=("3n", "3n"), free_velocity=("3n",), height=("n",), friction=("n", 3), force=("3n",)
)
def contact_step(
    mobility: Vector,
    free_velocity: Vector,
    height: Vector,
    friction: Vector,
    dt: float,
    ground: GroundRecord,
    force: Vector,
    tolerance: float = 1e-10,
    max_sweeps: int = 500,
) -> int:
    """Contact forces of one implicit time step, by Gauss–Seidel over the feet.

    Finds forces f such that, with foot velocities u = free_velocity + mobility f, each normal force
    obeys E1 at the end of the step and each friction force obeys E2 at the velocity u, exactly at
    rest where the cone allows it.

    Args:
        mobility: (3n, 3n) change of foot velocity over the step per newton, dt J M⁻¹ Jᵀ, m/s/N.
        free_velocity: (3n,) foot velocities without contact forces, world axes, m/s.
        height: (n,) foot heights at the start of the step, m.
        friction: (n, 3) static and sliding coefficient under each foot, see :func:`local_friction`,
            and the stiffness there relative to the ground's; the damping changes by its root.
        dt: step, s.
        ground: the element of :attr:`Ground.record`.
        force: (3n,) starting guess in, forces out, world axes, N.
        tolerance: largest change of a force in the last sweep, relative to 1 N + the largest force.
        max_sweeps: limit of the iteration.

    Returns:
        Number of sweeps done; ``max_sweeps + 1`` if they did not converge.
    """
    n = height.shape[0]
    if not np.any(height + dt * free_velocity.reshape((n, 3))[:, 2] < 0.0):
        force[:] = 0.0
        return 0
    for sweep in range(1, max_sweeps + 1):
        change, largest = 0.0, 0.0
        relax = 1.0 if sweep <= 60 else 0.5  # breaks the rare cycle between sticking and sliding
        for k in range(n):
            own, f = mobility[3 * k : 3 * k + 3, 3 * k : 3 * k + 3], force[3 * k : 3 * k + 3]
            others = (
                free_velocity[3 * k : 3 * k + 3] + mobility[3 * k : 3 * k + 3] @ force - own @ f
            )
            mu_s, mu_c = friction[k, 0], friction[k, 1]
            stiffness, damping = (
                ground.stiffness * friction[k, 2],
                ground.damping * np.sqrt(friction[k, 2]),
            )
            # Normal and friction of one foot are coupled most: iterate them a few times.
            for _ in range(2):
                free = others[2] + own[2, :2] @ f[:2]
                normal = _solve_normal(height[k], free, own[2, 2], dt, stiffness, damping)
                change = max(change, abs(normal - f[2]))
                f[2] += relax * (normal - f[2])
                if f[2] <= 0.0:
                    change = max(change, abs(f[0]), abs(f[1]))
                    f[:2] = 0.0
                    break
                u = others[:2] + own[:2, 2] * f[2]
                if ground.per_axis:
                    for i in range(2):
                        free = u[i] + own[i, 1 - i] * f[1 - i]
                        along = _solve_slide_1d(free, own[i, i], f[2], mu_s, mu_c, ground)
                        change = max(change, abs(along - f[i]))
                        f[i] += relax * (along - f[i])
                else:
                    more = _solve_slide_2d(u, own[:2, :2], f[2], mu_s, mu_c, ground, f[:2]) - f[:2]
                    change = max(change, abs(more[0]), abs(more[1]))
                    f[:2] += relax * more
            largest = max(largest, f[2], abs(f[0]), abs(f[1]))
        if change <= tolerance * (1.0 + largest):
            return sweep
    return max_sweeps + 1


@kernel
def contact_forces(
    s: StepRecord, ground: GroundRecord, free: Vector, tolerance: float, sweeps: int
) -> int:
    """Contact forces at the end of a step, and the loads on its columns, from velocities without
    contact forces.

    Returns the sweeps of the solver, of soles Newton's steps; ``sweeps + 1`` if it did not
    converge.
    """
    if (
        s.soles.motion.shape[0] > 0
    ):  # known when compiling: of point feet and of soles there is one kernel each
        return sole_step(s, ground, free, tolerance, sweeps)
    used = contact_step(
        s.mobility, free, s.height, s.friction, s.dt, ground, s.force, tolerance, sweeps
    )
    s.load[:] = s.force
    return used


class JointFrictionRecord(RecordOf):
    """Coulomb friction of the joints; without it, arrays of no joints."""

    limit: Vector  # (joints,) N·m; of a robot with loops the driven joints, then the passive ones
    torque: Vector = sized("joints")  # (joints,) of the last step, N·m
    motion: Vector = sized("nv", "joints")  # S: velocities of the joints are Sᵀ v
    columns: Vector = sized("nv", "joints")  # (nv, joints) L⁻ᵀ S, with M + dt B = Lᵀ L
    free: Vector = sized(
        "contacts"
    )  # (contacts,) velocities of the feet under it without contact forces, m/s


@kernel
def step_with_friction(
    s: StepRecord, ground: GroundRecord, v: Vector, tolerance: float, sweeps: int
) -> int:
    """Contact forces and joint friction; adds the latter's part to the last of the step's columns.

    Columns, mobility and free velocities are those for the contact alone, v (nv,) is the velocity
    at the beginning of the step; tolerance and most sweeps are the contact solver's. Returns the
    sweeps of the last contact problem, ``sweeps + 1`` if it or the rounds did not converge.
    """
    f, dt, joints = s.joints, s.dt, s.joints.limit.shape[0]
    feet, drive = s.columns[:, : s.load.shape[0]], s.columns[:, s.load.shape[0]]
    f.columns[:] = f.motion
    solve_transposed(s.factor, f.columns, joints)
    drive += dt * (f.columns @ f.torque)  # last step's friction is the first guess
    used = 0
    for _ in range(ROUNDS):
        held = f.columns @ f.torque
        f.free[:] = s.free + dt * (feet.T @ held)
        used = contact_forces(s, ground, f.free, tolerance, sweeps)
        pushed = dt * (feet @ s.load)
        change = 0.0
        for j in range(joints):
            own = f.columns[:, j]
            speed, mobility = f.motion[:, j] @ v + own @ (drive + pushed), dt * (own @ own)
            torque = min(max(f.torque[j] - speed / mobility, -f.limit[j]), f.limit[j])
            more = torque - f.torque[j]
            drive += dt * more * own
            f.torque[j] = torque
            if f.limit[j] > 0.0:
                change = max(change, abs(more) / f.limit[j])
        if change <= TOLERANCE:
            return used
    return sweeps + 1
