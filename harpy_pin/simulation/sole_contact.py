"""The implicit time step of flat feet: forces at their corners together with the motion of rigid soles.

The law is that of :mod:`harpy_pin.ground.ground` at every corner, but corners move as their sole does. Many friction
forces at its corners are then the same wrench. A creep decides between them: friction at rest is in proportion to a
velocity of the order of :data:`CREEP`, and so to the load of a corner.

With the largest friction of each corner given, the forces fall with the velocity like the gradient of a convex
function, and Newton's method with a search along its direction finds them. Loads and velocities found say the largest
friction anew, until it stays. Forces and velocities of corners are in the frames of their contacts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.ground.contact_frame import to_contact
from harpy_pin.ground.ground import GroundRecord
from harpy_pin.model.dynamics import EquationsRecord
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.simulation.step import StepRecord

CREEP = 1e-6  # velocity at which friction is 0.71 of the largest, m/s
ENGAGING = 1e-5  # velocity over which the damper sets in at the surface, m/s
SEARCHES = 30  # most lengths of a step that are tried
CALM = 100
"""Steps after which the largest friction changes by half of what is found only; by a quarter after twice as many."""


class SolesRecord(RecordOf):
    """Soles in a :class:`~harpy_pin.simulation.step.StepRecord`; of point feet all arrays are empty.

    A sole moves in six modes, its rigid motions, orthonormal over the velocities of its corners.
    """

    mode: Vector = sized("corners", 3, 6)  # (corners, 3, 6) velocity of a corner in each of its sole's modes
    motion: Vector = sized("6 soles")  # (6 soles,) velocities of the modes, m/s
    rest: Vector = sized("6 soles")  # (6 soles,) load less that of the corners' forces, N
    more_load: Vector = sized("6 soles")  # (6 soles,) direction of a step
    more_motion: Vector = sized("6 soles")
    most: Vector = sized("corners", 3)  # (corners, 3) largest friction along x and y, N, and viscous friction, N·s/m
    slope: Vector = sized("corners", 3, 3)  # (corners, 3, 3) fall of the force with the velocity, N·s/m
    gain: Vector = sized("6 soles", 6)  # (6 soles, 6) the same of each sole
    matrix: Vector = sized("6 soles", "6 soles + 1")  # (6 soles, 6 soles + 1) Newton's equations


@kernel
def sole_columns(d: EquationsRecord, s: StepRecord, v: Vector) -> None:
    """Modes of the soles, their columns of the Jacobian and their velocities before any force."""
    o, nv = s.soles, v.shape[0]
    soles = o.motion.shape[0] // 6
    corners = o.mode.shape[0] // soles
    o.mode[:] = 0.0
    for n in range(soles):
        mode, place = o.mode[n * corners : (n + 1) * corners], d.foot_position[n * corners : (n + 1) * corners]
        rigid_modes(place, mode)
        for c in range(6 * n, 6 * n + 6):
            s.free[c] = 0.0
            for i in range(nv):
                s.columns[i, c] = 0.0
        for k in range(corners):
            row = 3 * (n * corners + k)
            for a in range(3):
                free = 0.5 * s.dt * d.foot_drift[row + a]
                for i in range(nv):
                    x = d.foot_jacobian[row + a, i]
                    free += x * v[i]
                    if x != 0.0:
                        for c in range(6):
                            s.columns[i, 6 * n + c] += mode[k, a, c] * x
                for c in range(6):
                    s.free[6 * n + c] += mode[k, a, c] * free


@kernel
def rigid_modes(place: Vector, mode: Vector) -> None:
    """Rigid motions of points at places (n, 3), orthonormal; adds them to ``mode`` (n, 3, 6)."""
    n = place.shape[0]
    middle = np.zeros(3)
    for k in range(n):
        for c in range(3):
            middle[c] += place[k, c] / n
    for k in range(n):
        for c in range(3):
            a, b = (c + 1) % 3, (c + 2) % 3
            mode[k, c, c] += 1.0 / np.sqrt(n)
            mode[k, b, 3 + c] += place[k, a] - middle[a]
            mode[k, a, 3 + c] -= place[k, b] - middle[b]
    for c in range(3, 6):
        for other in range(3, c + 1):
            share = 0.0
            for k in range(n):
                for a in range(3):
                    share += mode[k, a, c] * mode[k, a, other]
            for k in range(n):
                for a in range(3):
                    if other < c:
                        mode[k, a, c] -= share * mode[k, a, other]
                    else:
                        mode[k, a, c] /= np.sqrt(share)


@kernel
def turn_modes(frame: Vector, mode: Vector) -> None:
    """Modes from world axes into the frames of the contacts."""
    column = np.zeros(3)
    for k in range(mode.shape[0]):
        for c in range(6):
            for a in range(3):
                column[a] = mode[k, a, c]
            to_contact(frame[k], column)
            for a in range(3):
                mode[k, a, c] = column[a]


@kernel
def _update_motion(s: StepRecord, free: Vector) -> None:
    """Velocities of the modes under their load."""
    for i in range(free.shape[0]):
        motion = free[i]
        for j in range(free.shape[0]):
            motion += s.mobility[i, j] * s.load[j]
        s.soles.motion[i] = motion


@kernel
def _update_forces(s: StepRecord, ground: GroundRecord, length: float) -> float:
    """Forces at the corners and what remains of the load, a length along the present direction.

    Returns how fast what is minimised changes along it.
    """
    o, dt = s.soles, s.dt
    soles = o.motion.shape[0] // 6
    corners = o.mode.shape[0] // soles
    rate = 0.0
    for c in range(6 * soles):
        o.rest[c] = s.load[c] + length * o.more_load[c]
    for k in range(soles * corners):
        first, mode, slope = 6 * (k // corners), o.mode[k], o.slope[k]
        x, y, z = 0.0, 0.0, 0.0
        for c in range(6):
            u = o.motion[first + c] + length * o.more_motion[first + c]
            x += mode[0, c] * u
            y += mode[1, c] * u
            z += mode[2, c] * u
        depth, normal, stiff = -(s.height[k] + dt * z), 0.0, 0.0
        if depth > 0.0:
            stiffness, damping = ground.stiffness * s.friction[k, 2], ground.damping * np.sqrt(s.friction[k, 2])
            engaged = min(depth / (dt * ENGAGING), 1.0)
            normal, stiff = stiffness * depth, stiffness * dt
            if z < 0.0:
                normal -= damping * engaged * z
                stiff += damping * engaged
                if engaged < 1.0:
                    stiff -= damping * z / ENGAGING
        viscous = o.most[k, 2]
        if ground.per_axis:
            sx, sy = np.sqrt(x * x + CREEP * CREEP), np.sqrt(y * y + CREEP * CREEP)
        else:
            sx = np.sqrt(x * x + y * y + CREEP * CREEP)
            sy = sx
        gx, gy = o.most[k, 0] / sx, o.most[k, 1] / sy
        slope[0, 0] = viscous + gx - gx * x * x / (sx * sx)
        slope[1, 1] = viscous + gy - gy * y * y / (sy * sy)
        slope[0, 1] = 0.0 if ground.per_axis else -gx * x * y / (sx * sx)
        slope[1, 0] = slope[0, 1]
        slope[2, 2] = stiff
        s.force[3 * k] = -(viscous + gx) * x
        s.force[3 * k + 1] = -(viscous + gy) * y
        s.force[3 * k + 2] = normal
        for c in range(6):
            for a in range(3):
                o.rest[first + c] -= mode[a, c] * s.force[3 * k + a]
    for c in range(6 * soles):
        rate += o.rest[c] * o.more_motion[c]
    return rate


@kernel
def _update_most(s: StepRecord, ground: GroundRecord, share: float) -> float:
    """The largest friction of each corner by its normal force and velocity; returns its largest change, N.

    It goes the given share of the way there.
    """
    o = s.soles
    corners = o.mode.shape[0] * 6 // o.motion.shape[0]
    largest = 0.0
    for k in range(o.mode.shape[0]):
        normal, first = s.force[3 * k + 2], 6 * (k // corners)
        x, y = 0.0, 0.0
        for c in range(6):
            x += o.mode[k, 0, c] * o.motion[first + c]
            y += o.mode[k, 1, c] * o.motion[first + c]
        mu_s, mu_c = s.friction[k, 0], s.friction[k, 1]
        o.most[k, 2] = ground.mu_v if normal > 0.0 else 0.0
        for a in range(2):
            speed = x * x + y * y if not ground.per_axis else x * x if a == 0 else y * y
            mu = mu_c + (mu_s - mu_c) * np.exp(-speed / ground.stribeck_velocity**2)
            most = mu * normal if normal > 0.0 else 0.0
            largest = max(largest, abs(most - o.most[k, a]))
            o.most[k, a] += share * (most - o.most[k, a])
    return largest


@kernel
def _solve_newton(o: SolesRecord, mobility: Vector) -> None:
    """Direction of a step: (1 + gain mobility) more_load = −rest, by elimination with pivots in rows."""
    n = o.motion.shape[0]
    corners = o.mode.shape[0] * 6 // n
    matrix = o.matrix
    o.gain[:] = 0.0
    for k in range(o.mode.shape[0]):
        first = 6 * (k // corners)
        for a in range(3):
            for b in range(3):
                slope = o.slope[k, a, b]
                if slope != 0.0:
                    for i in range(6):
                        x = o.mode[k, a, i] * slope
                        for j in range(6):
                            o.gain[first + i, j] += x * o.mode[k, b, j]
    for i in range(n):
        first = 6 * (i // 6)
        for j in range(n):
            matrix[i, j] = 0.0
        for c in range(6):
            gain = o.gain[i, c]
            for j in range(n):
                matrix[i, j] += gain * mobility[first + c, j]
        matrix[i, i] += 1.0
        matrix[i, n] = -o.rest[i]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        for j in range(k, n + 1):
            matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, n + 1):
                matrix[i, j] -= factor * matrix[k, j]
    for i in range(n - 1, -1, -1):
        x = matrix[i, n]
        for j in range(i + 1, n):
            x -= matrix[i, j] * o.more_load[j]
        o.more_load[i] = x / matrix[i, i]
    for i in range(n):
        o.more_motion[i] = 0.0
        for j in range(n):
            o.more_motion[i] += mobility[i, j] * o.more_load[j]


@kernel
def _search(s: StepRecord, ground: GroundRecord) -> float:
    """Length of the step: where the rate along its direction has at most half of its size at the beginning."""
    rest, length, low, high = 0.0, 1.0, 0.0, np.inf
    for c in range(s.soles.rest.shape[0]):
        rest += s.soles.rest[c] * s.soles.more_motion[c]
    at_low, at_high, enough = rest, 0.0, 0.5 * abs(rest)
    for _ in range(SEARCHES):
        rate = _update_forces(s, ground, length)
        if abs(rate) <= enough:
            break
        if rate > 0.0:
            high, at_high = length, rate
        else:
            low, at_low = length, rate
        if high < np.inf:
            between = at_low / (at_low - at_high)
            length = low + min(max(between, 0.05), 0.95) * (high - low)
        elif length >= 4.0:
            break
        else:
            length *= 2.0
    return length


@kernel
def sole_step(s: StepRecord, ground: GroundRecord, free: Vector, tolerance: float, most_steps: int) -> int:
    """Forces at the corners of all soles at the end of a step, and the loads of their modes.

    The forces of the last step are the first guess. ``free`` (6 soles,) are the velocities of the modes without contact
    forces, m/s, the tolerance is of a load or of the largest friction, relative to 1 N + the largest force. Returns the
    number of Newton's steps done; ``most_steps + 1`` if they did not converge.
    """
    o, n = s.soles, free.shape[0]
    corners = o.mode.shape[0] * 6 // n
    touching = False
    s.load[:] = 0.0
    for k in range(o.mode.shape[0]):
        first, down = 6 * (k // corners), 0.0
        for c in range(6):
            down += o.mode[k, 2, c] * free[first + c]
            for a in range(3):
                s.load[first + c] += o.mode[k, a, c] * s.force[3 * k + a]
        touching = touching or s.height[k] + s.dt * down < 0.0
    if not touching:
        s.force[:] = 0.0
        s.load[:] = 0.0
        return 0
    _update_motion(s, free)
    _update_most(s, ground, 1.0)
    change, used = 1.0, 0
    while used < most_steps:
        used += 1
        _update_forces(s, ground, 0.0)
        largest, rest = 1.0, 0.0
        for a in range(s.force.shape[0]):
            largest = max(largest, 1.0 + abs(s.force[a]))
        for c in range(n):
            rest = max(rest, abs(o.rest[c]) / largest)
        if rest <= max(tolerance, 0.05 * change):
            share = 1.0 if used <= CALM else 0.5 if used <= 2 * CALM else 0.25
            change = _update_most(s, ground, share) / largest
            if max(rest, change) <= tolerance:
                return used
            continue
        _solve_newton(o, s.mobility)
        length = _search(s, ground)
        for i in range(n):
            s.load[i] += length * o.more_load[i]
        _update_motion(s, free)
    return most_steps + 1
