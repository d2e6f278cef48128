"""The implicit time step of a contact: forces at the end of a step together with the velocities that they cause.

A foot whose force fits in the cone does not move at all. The law is that of :mod:`harpy_pin.ground.ground`.

Coulomb friction in the joints is found together with the contact forces. A joint whose friction suffices to hold it
does not move at all; another one has the whole friction against its motion. Contact forces and joint friction are found
in turn (Gauss–Seidel), each with the other given, until neither changes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.ground.ground import GroundRecord, stribeck
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
def _solve_normal(height: float, free: float, mobility: float, dt: float, k: float, d: float) -> float:
    """Normal force at the end of a step, N: the law of E1 at height + dt u, with u = free + mobility·force.

    The law, with the vertical jump where the damper engages filled in, is a monotone graph in u: one solution.
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
    """Friction along one axis, N: zero velocity if the box allows it, else sliding at the Stribeck force."""
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
        slope = 1.0 + mobility * (ground.mu_v - drop * ratio / ground.stribeck_velocity * np.exp(-ratio * ratio))
        speed = speed - gap / slope if slope > 0.0 else -1.0
        if speed <= low or speed >= high:
            speed = 0.5 * (low + high)
    return -(free / start) * stribeck(speed, normal, mu_s, mu_c, ground)


@kernel
def _slide_velocity(gain: float, a11: float, a12: float, a22: float, u1: float, u2: float) -> tuple[float, float]:
    """(I + gain A)⁻¹ u: the velocity of a foot under the friction force −gain·velocity."""
    b11, b12, b22 = 1.0 + gain * a11, gain * a12, 1.0 + gain * a22
    det = b11 * b22 - b12 * b12
    return (b22 * u1 - b12 * u2) / det, (b11 * u2 - b12 * u1) / det


@kernel
def _first_gain(u1: float, u2: float, a11: float, a12: float, a22: float, most: float, f1: float, f2: float) -> float:
    """Where to begin: the gain of the force guessed, or as if the mobility were the same in all directions."""
    w1, w2 = u1 + a11 * f1 + a12 * f2, u2 + a12 * f1 + a22 * f2
    against = -(f1 * w1 + f2 * w2)
    if against > 0.0:
        return against / (w1 * w1 + w2 * w2 + TINY)
    start = np.sqrt(u1 * u1 + u2 * u2)
    return float(max(most / max(start - 0.5 * (a11 + a22) * most, 0.01 * start + TINY), 1e-12))


@kernel
def _solve_slide_2d(
    u1: float,
    u2: float,
    a11: float,
    a12: float,
    a22: float,
    normal: float,
    mu_s: float,
    mu_c: float,
    ground: GroundRecord,
    f1: float,
    f2: float,
) -> tuple[float, float]:
    """Friction in the plane, N: zero velocity if Coulomb's disc allows it, else sliding against the motion.

    The force is −g w with w the velocity that it leaves, (I + g A)⁻¹ u, and g |w| = F(|w|). In g − F/|w|, nearly a
    straight line, Newton's steps find the gain g, with a bracket around it; (f1, f2) is a guess of the force.
    """
    det = a11 * a22 - a12 * a12
    stick1, stick2 = -(a22 * u1 - a12 * u2) / det, -(a11 * u2 - a12 * u1) / det
    if stick1 * stick1 + stick2 * stick2 <= (mu_s * normal) ** 2:
        return stick1, stick2
    gain = _first_gain(u1, u2, a11, a12, a22, mu_c * normal, f1, f2)
    low, high, last = 0.0, np.inf, np.inf
    w1, w2 = u1, u2
    for _ in range(100):
        w1, w2 = _slide_velocity(gain, a11, a12, a22, u1, u2)
        speed = np.sqrt(w1 * w1 + w2 * w2) + TINY
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
        z1, z2 = _slide_velocity(gain, a11, a12, a22, a11 * w1 + a12 * w2, a12 * w1 + a22 * w2)
        slowing = -(w1 * z1 + w2 * z2) / speed
        steeper = ground.mu_v - 2.0 * more * ratio / ground.stribeck_velocity
        slope = 1.0 - (steeper - friction / speed) * slowing / speed
        gain = gain - rest / slope if slope > 0.0 and abs(rest) < 0.5 * last else -1.0
        last = abs(rest)
        if not low < gain < high:  # Newton leaves the bracket or is slow
            gain = 0.5 * (low + high) if high < np.inf else 4.0 * low
            last = np.inf
    return -gain * w1, -gain * w2


@kernel(mobility=("3n", "3n"), free_velocity=("3n",), height=("n",), friction=("n", 3), force=("3n",))
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

    Finds forces f such that, with foot velocities u = free_velocity + mobility f, each normal force obeys E1 at the
    end of the step and each friction force obeys E2 at the velocity u, exactly at rest where the cone allows it.

    Args:
        mobility: (3n, 3n) change of foot velocity over the step per newton, dt J M⁻¹ Jᵀ, m/s/N.
        free_velocity: (3n,) foot velocities without contact forces, world axes, m/s.
        height: (n,) foot heights at the start of the step, m.
        friction: (n, 3) static and sliding coefficient under each foot, see :func:`local_friction`, and the stiffness
            there relative to the ground's; the damping changes by its root.
        dt: step, s.
        ground: the element of :attr:`Ground.record`.
        force: (3n,) starting guess in, forces out, world axes, N.
        tolerance: largest change of a force in the last sweep, relative to 1 N + the largest force.
        max_sweeps: limit of the iteration.

    Returns:
        Number of sweeps done; ``max_sweeps + 1`` if they did not converge.
    """
    n = height.shape[0]
    touching = False
    for k in range(n):
        touching = touching or height[k] + dt * free_velocity[3 * k + 2] < 0.0
    if not touching:
        force[:] = 0.0
        return 0
    for sweep in range(1, max_sweeps + 1):
        change, largest = 0.0, 0.0
        relax = 1.0 if sweep <= 60 else 0.5  # breaks the rare cycle between sticking and sliding
        for k in range(n):
            x, y, z = 3 * k, 3 * k + 1, 3 * k + 2
            mu_s, mu_c = friction[k, 0], friction[k, 1]
            stiffness, damping = ground.stiffness * friction[k, 2], ground.damping * np.sqrt(friction[k, 2])
            # Normal and friction of one foot are coupled most: iterate them a few times.
            for _ in range(2):
                free = free_velocity[z]
                for j in range(3 * n):
                    if j != z:
                        free += mobility[z, j] * force[j]
                normal = _solve_normal(height[k], free, mobility[z, z], dt, stiffness, damping)
                change = max(change, abs(normal - force[z]))
                normal = force[z] + relax * (normal - force[z])
                force[z] = normal
                if normal <= 0.0:
                    change = max(change, abs(force[x]), abs(force[y]))
                    force[x] = 0.0
                    force[y] = 0.0
                    break
                if ground.per_axis:
                    for i in (x, y):
                        free = free_velocity[i]
                        for j in range(3 * n):
                            if j != i:
                                free += mobility[i, j] * force[j]
                        along = _solve_slide_1d(free, mobility[i, i], normal, mu_s, mu_c, ground)
                        change = max(change, abs(along - force[i]))
                        force[i] += relax * (along - force[i])
                else:
                    free_x, free_y = free_velocity[x], free_velocity[y]
                    for j in range(3 * n):
                        if j != x and j != y:
                            free_x += mobility[x, j] * force[j]
                            free_y += mobility[y, j] * force[j]
                    a11, a12, a22 = mobility[x, x], mobility[x, y], mobility[y, y]
                    fx, fy = _solve_slide_2d(
                        free_x, free_y, a11, a12, a22, normal, mu_s, mu_c, ground, force[x], force[y]
                    )
                    change = max(change, abs(fx - force[x]), abs(fy - force[y]))
                    force[x] += relax * (fx - force[x])
                    force[y] += relax * (fy - force[y])
            largest = max(largest, force[z], abs(force[x]), abs(force[y]))
        if change <= tolerance * (1.0 + largest):
            return sweep
    return max_sweeps + 1


@kernel
def contact_forces(s: StepRecord, ground: GroundRecord, free: Vector, tolerance: float, sweeps: int) -> int:
    """Contact forces at the end of a step, and the loads on its columns, from velocities without contact forces.

    Returns the sweeps of the solver, of soles Newton's steps; ``sweeps + 1`` if it did not converge.
    """
    if s.soles.motion.shape[0] > 0:  # known when compiling: of point feet and of soles there is one kernel each
        return sole_step(s, ground, free, tolerance, sweeps)
    used = contact_step(s.mobility, free, s.height, s.friction, s.dt, ground, s.force, tolerance, sweeps)
    s.load[:] = s.force
    return used


class JointFrictionRecord(RecordOf):
    """Coulomb friction of the joints; without it, arrays of no joints."""

    limit: Vector  # (joints,) N·m
    torque: Vector = sized("joints")  # (joints,) of the last step, N·m
    columns: Vector = sized("nv", "joints")  # (nv, joints) L⁻ᵀ S, with M + dt B = Lᵀ L
    free: Vector = sized("contacts")  # (contacts,) velocities of the feet under it without contact forces, m/s


@kernel
def step_with_friction(s: StepRecord, ground: GroundRecord, v: Vector, tolerance: float, sweeps: int) -> int:
    """Contact forces and joint friction; adds the latter's part to the last of the step's columns.

    Columns, mobility and free velocities are those for the contact alone, v (nv,) is the velocity at the beginning of
    the step; tolerance and most sweeps are the contact solver's. Returns the sweeps of the last contact problem,
    ``sweeps + 1`` if it or the rounds did not converge.
    """
    f, dt = s.joints, s.dt
    nv, nc, joints = v.shape[0], s.load.shape[0], f.limit.shape[0]
    columns, own = s.columns, f.columns
    for i in range(nv):
        for j in range(joints):
            own[i, j] = 1.0 if i == 6 + j else 0.0
    solve_transposed(s.factor, own, joints)
    for j in range(joints):  # last step's friction is the first guess
        for i in range(nv):
            columns[i, nc] += dt * own[i, j] * f.torque[j]
    used = 0
    for _ in range(ROUNDS):
        for a in range(nc):
            f.free[a] = s.free[a]
            for j in range(joints):
                for i in range(nv):
                    f.free[a] += dt * columns[i, a] * own[i, j] * f.torque[j]
        used = contact_forces(s, ground, f.free, tolerance, sweeps)
        change = 0.0
        for j in range(joints):
            speed, mobility = v[6 + j], 0.0
            for i in range(nv):
                drive = columns[i, nc]
                for c in range(nc):
                    drive += dt * columns[i, c] * s.load[c]
                speed += own[i, j] * drive
                mobility += dt * own[i, j] * own[i, j]
            torque = min(max(f.torque[j] - speed / mobility, -f.limit[j]), f.limit[j])
            more = torque - f.torque[j]
            for i in range(nv):
                columns[i, nc] += dt * own[i, j] * more
            f.torque[j] = torque
            if f.limit[j] > 0.0:
                change = max(change, abs(more) / f.limit[j])
        if change <= TOLERANCE:
            return used
    return sweeps + 1
