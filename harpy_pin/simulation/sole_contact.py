"""The implicit time step of flat feet: forces at their corners together with the motion of rigid
soles.

The law is that of :mod:`harpy_pin.ground.ground` at every corner, but corners move as their sole
does. Many friction forces at its corners are then the same wrench. A creep decides between them:
friction at rest is in proportion to a velocity of the order of :data:`CREEP`, and so to the load of
a corner.

With the largest friction of each corner given, the forces fall with the velocity like the gradient
of a convex function, and Newton's method with a search along its direction finds them. Loads and
velocities found say the largest friction anew, until it stays. Forces and velocities of corners are
in the frames of their contacts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.ground.ground import GroundRecord
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.cholesky import add_product
from harpy_pin.model.dynamics import EquationsRecord
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import skew

if TYPE_CHECKING:
    from harpy_pin.simulation.step import StepRecord

CREEP = 1e-6  # velocity at which friction is 0.71 of the largest, m/s
ENGAGING = 1e-5  # velocity over which the damper sets in at the surface, m/s
SEARCHES = 30  # most lengths of a step that are tried
CALM = 100
"""Steps after which the largest friction changes by half of what is found only; by a quarter after
twice as many.
"""


class SolesRecord(RecordOf):
    """Soles in a :class:`~harpy_pin.simulation.step.StepRecord`; of point feet all arrays are
    empty.

    A sole moves in six modes, its rigid motions, orthonormal over the velocities of its corners.
    """

    mode: Vector = sized(
        "corners", 3, 6
    )  # (corners, 3, 6) velocity of a corner in each of its sole's modes
    motion: Vector = sized("6 soles")  # (6 soles,) velocities of the modes, m/s
    rest: Vector = sized("6 soles")  # (6 soles,) load less that of the corners' forces, N
    more_load: Vector = sized("6 soles")  # (6 soles,) direction of a step
    more_motion: Vector = sized("6 soles")
    most: Vector = sized(
        "corners", 3
    )  # (corners, 3) largest friction along x and y, N, and viscous friction, N·s/m
    slope: Vector = sized(
        "corners", 3, 3
    )  # (corners, 3, 3) fall of the force with the velocity, N·s/m
    gain: Vector = sized("6 soles", 6)  # (6 soles, 6) the same of each sole
    matrix: Vector = sized("6 soles", "6 soles + 1")  # (6 soles, 6 soles + 1) Newton's equations


@kernel
def sole_columns(d: EquationsRecord, s: StepRecord, v: Vector) -> None:
    """Modes of the soles, their columns of the Jacobian and their velocities before any force."""
    o, soles = s.soles, s.soles.motion.shape[0] // 6
    corners = o.mode.shape[0] // soles
    o.mode[:] = s.columns[:, : 6 * soles] = 0.0
    for n in range(soles):
        first, x, c = n * corners, 3 * n * corners, 6 * n
        rigid_modes(d.foot_position[first : first + corners], o.mode[first : first + corners])
        mode = o.mode[first : first + corners].reshape((3 * corners, 6))
        jacobian = d.foot_jacobian[x : x + 3 * corners]
        s.free[c : c + 6] = mode.T @ (0.5 * s.dt * d.foot_drift[x : x + 3 * corners] + jacobian @ v)
        add_product(jacobian.T, mode, s.columns[:, c : c + 6])


@kernel(place=("n", 3), mode=("n", 3, 6))
def rigid_modes(place: Vector, mode: Vector) -> None:
    """Rigid motions of points at places (n, 3), orthonormal; adds them to ``mode`` (n, 3, 6)."""
    n = place.shape[0]
    middle = np.sum(place, axis=0) / n
    mode[:, :, :3] += np.eye(3) / np.sqrt(n)
    for k in range(n):
        mode[k, :, 3:] -= skew(place[k] - middle)
    rows = mode.reshape((3 * n, 6))
    for c in range(3, 6):
        for other in range(3, c):
            rows[:, c] -= (rows[:, c] @ rows[:, other]) * rows[:, other]
        rows[:, c] /= np.sqrt(rows[:, c] @ rows[:, c])


@kernel(frame=("n", 3, 3), mode=("n", 3, 6))
def turn_modes(frame: Vector, mode: Vector) -> None:
    """Modes from world axes into the frames of the contacts."""
    for k in range(mode.shape[0]):
        mode[k] = frame[k].T @ mode[k]


@kernel
def _update_motion(s: StepRecord, free: Vector) -> None:
    """Velocities of the modes under their load."""
    s.soles.motion[:] = free + s.mobility @ s.load


@kernel
def _squared_speed(ground: GroundRecord, x: Vector) -> Vector:
    """Squared speed (2,) that friction along each axis knows, of a velocity (2,)."""
    return np.where(ground.per_axis, x * x, x @ x)


@kernel
def _update_forces(s: StepRecord, ground: GroundRecord, length: float) -> float:
    """Forces at the corners and what remains of the load, a length along the present direction.

    Returns how fast what is minimised changes along it.
    """
    o, dt = s.soles, s.dt
    corners = o.mode.shape[0] * 6 // o.motion.shape[0]
    o.rest[:] = s.load + length * o.more_load
    for k in range(o.mode.shape[0]):
        c, mode, slope, force = (
            6 * (k // corners),
            o.mode[k],
            o.slope[k],
            s.force[3 * k : 3 * k + 3],
        )
        u = mode @ (o.motion[c : c + 6] + length * o.more_motion[c : c + 6])
        x, z = u[:2], u[2]
        depth, normal, stiff = -(s.height[k] + dt * z), 0.0, 0.0
        if depth > 0.0:
            stiffness, damping = (
                ground.stiffness * s.friction[k, 2],
                ground.damping * np.sqrt(s.friction[k, 2]),
            )
            engaged = min(depth / (dt * ENGAGING), 1.0)
            normal, stiff = stiffness * depth, stiffness * dt
            if z < 0.0:
                normal -= damping * engaged * z
                stiff += damping * engaged
                if engaged < 1.0:
                    stiff -= damping * z / ENGAGING
        square = _squared_speed(ground, x) + CREEP * CREEP
        share = o.most[k, :2] / np.sqrt(square)
        fall, gain = np.outer(share * x / square, x), share + o.most[k, 2]
        slope[0, 0], slope[1, 1], slope[2, 2] = gain[0] - fall[0, 0], gain[1] - fall[1, 1], stiff
        slope[0, 1] = slope[1, 0] = 0.0 if ground.per_axis else -fall[0, 1]
        force[:2], force[2] = -gain * x, normal
        o.rest[c : c + 6] -= mode.T @ force
    return float(o.rest @ o.more_motion)


@kernel
def _update_most(s: StepRecord, ground: GroundRecord, share: float) -> float:
    """The largest friction of each corner by its normal force and velocity; returns its largest
    change, N.

    It goes the given share of the way there.
    """
    o, largest = s.soles, 0.0
    corners = o.mode.shape[0] * 6 // o.motion.shape[0]
    for k in range(o.mode.shape[0]):
        normal, c, most = s.force[3 * k + 2], 6 * (k // corners), o.most[k, :2]
        mu_s, mu_c = s.friction[k, 0], s.friction[k, 1]
        square = _squared_speed(ground, o.mode[k, :2] @ o.motion[c : c + 6])
        mu = mu_c + (mu_s - mu_c) * np.exp(-square / ground.stribeck_velocity**2)
        change = mu * max(normal, 0.0) - most
        most += share * change
        o.most[k, 2] = ground.mu_v if normal > 0.0 else 0.0
        largest = max(largest, np.max(np.abs(change)))
    return largest


@kernel
def _solve_newton(o: SolesRecord, mobility: Vector) -> None:
    """Direction of a step: (1 + gain mobility) more_load = −rest, by elimination with pivots in
    rows.
    """
    n, matrix = o.motion.shape[0], o.matrix
    corners = o.mode.shape[0] * 6 // n
    o.gain[:] = 0.0
    for k in range(o.mode.shape[0]):
        c = 6 * (k // corners)
        o.gain[c : c + 6] += o.mode[k].T @ o.slope[k] @ o.mode[k]
    for c in range(0, n, 6):
        matrix[c : c + 6, :n] = o.gain[c : c + 6] @ mobility[c : c + 6]
    matrix[:, n] = -o.rest
    diagonal(matrix[:, :n])[:] += 1.0
    for k in range(n):
        best = k + np.argmax(abs(matrix[k:, k]))
        row = matrix[k] + 0.0
        matrix[k] = matrix[best]
        matrix[best] = row
        for i in range(k + 1, n):
            matrix[i] -= matrix[i, k] / matrix[k, k] * matrix[k]
    for i in range(n - 1, -1, -1):
        o.more_load[i] = (matrix[i, n] - matrix[i, i + 1 : n] @ o.more_load[i + 1 :]) / matrix[i, i]
    o.more_motion[:] = mobility @ o.more_load


@kernel
def _search(s: StepRecord, ground: GroundRecord) -> float:
    """Length of the step: where the rate along its direction has at most half of its size at the
    beginning.
    """
    at_low, at_high = float(s.soles.rest @ s.soles.more_motion), 0.0
    length, low, high, enough = 1.0, 0.0, np.inf, 0.5 * abs(at_low)
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
def sole_step(
    s: StepRecord, ground: GroundRecord, free: Vector, tolerance: float, most_steps: int
) -> int:
    """Forces at the corners of all soles at the end of a step, and the loads of their modes.

    The forces of the last step are the first guess. ``free`` (6 soles,) are the velocities of the
    modes without contact forces, m/s, the tolerance is of a load or of the largest friction,
    relative to 1 N + the largest force. Returns the number of Newton's steps done; ``most_steps +
    1`` if they did not converge.
    """
    o, touching = s.soles, False
    corners = o.mode.shape[0] * 6 // free.shape[0]
    s.load[:] = 0.0
    for k in range(o.mode.shape[0]):
        c, mode = 6 * (k // corners), o.mode[k]
        down = mode[2] @ free[c : c + 6]
        touching = touching or s.height[k] + s.dt * down < 0.0
        s.load[c : c + 6] += mode.T @ s.force[3 * k : 3 * k + 3]
    if not touching:
        s.force[:] = s.load[:] = 0.0
        return 0
    _update_motion(s, free)
    _update_most(s, ground, 1.0)
    change, used = 1.0, 0
    while used < most_steps:
        used += 1
        _update_forces(s, ground, 0.0)
        largest = 1.0 + np.max(np.abs(s.force))
        rest = np.max(np.abs(o.rest)) / largest
        if rest <= max(tolerance, 0.05 * change):
            share = 1.0 if used <= CALM else 0.5 if used <= 2 * CALM else 0.25
            change = _update_most(s, ground, share) / largest
            if max(rest, change) <= tolerance:
                return used
            continue
        _solve_newton(o, s.mobility)
        length = _search(s, ground)
        s.load += length * o.more_load
        _update_motion(s, free)
    return most_steps + 1
