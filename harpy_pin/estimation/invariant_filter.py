"""The contact-aided invariant extended Kalman filter.

It is that of Hartley, Ghaffari, Eustice and Grizzle (IJRR 39(4), 2020), with footholds relative to the inertial unit.
The state is the rotation R of body axes to the world, velocity v and position p of the inertial unit, the biases b_g
and b_a, and for each foot in stance r_k = d_k − p, where d_k is its foothold. With gyroscope ω and accelerometer a,

    Ṙ = R [ω − b_g]×,   v̇ = R (a − b_a) + g,   ṗ = v,   ṙ_k = −v + u_k,

u_k is the velocity of the centre of a round foot that rolls, zero for a point. Errors are right-invariant:

    R̂ = exp([ξ_R]×) R,   ξ_v = v̂ − exp([ξ_R]×) v,   ξ_k = r̂_k − exp([ξ_R]×) r_k,
    ζ_p = p̂ − p,   ζ_g = b̂_g − b_g,   ζ_a = b̂_a − b_a.

To first order, with n_g and n_a the noise of gyroscope and accelerometer and n_k that of a foothold's velocity,

    ξ̇_R = R̂ (n_g − ζ_g)
    ξ̇_v = g × ξ_R + R̂ (n_a − ζ_a) + v̂ × R̂ (n_g − ζ_g)
    ζ̇_p = ξ_v − v̂ × ξ_R
    ξ̇_k = −ξ_v + r̂_k × R̂ (n_g − ζ_g) + n_k.

Kinematics measure h_k = Rᵀ r_k in body axes. The innovation R̂ h_k − r̂_k is −ξ_k and noise, whatever the state is. So
nothing that is estimated depends on the place in the world or on the heading, which cannot be observed: only p̂ does.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.estimation.record import ERRORS, FilterRecord
from harpy_pin.model.cholesky import factorise, solve_transposed
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import SMALL_ANGLE

INNOVATION_TIME = 0.5
"""Time constant of the low-pass of the innovations, s."""


@kernel
def rotation_of(x: float, y: float, z: float, out: Vector) -> None:
    """The rotation matrix exp([w]×) of a rotation vector w = (x, y, z), rad, into ``out`` (3, 3)."""
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < SMALL_ANGLE:
        a, b = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    c = 1.0 - b * square
    out[0, 0], out[1, 1], out[2, 2] = c + b * x * x, c + b * y * y, c + b * z * z
    out[0, 1], out[1, 0] = b * x * y - a * z, b * x * y + a * z
    out[0, 2], out[2, 0] = b * x * z + a * y, b * x * z - a * y
    out[1, 2], out[2, 1] = b * y * z - a * x, b * y * z + a * x


@kernel
def orthonormalise(r: Vector) -> None:
    """Take rounding out of a rotation matrix: one Newton step R ← R (3 − Rᵀ R) / 2, in place."""
    old, square = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            old[i, j] = r[i, j]
            square[i, j] = r[0, i] * r[0, j] + r[1, i] * r[1, j] + r[2, i] * r[2, j]
    for i in range(3):
        for j in range(3):
            s = old[i, 0] * square[0, j] + old[i, 1] * square[1, j] + old[i, 2] * square[2, j]
            r[i, j] = 1.5 * old[i, j] - 0.5 * s


@kernel
def begin_filter(f: FilterRecord) -> None:
    """Forget all footholds, and take the covariance of the start."""
    f.covariance[:] = 0.0
    f.held[:] = 0
    f.innovation = 3.0
    for i in range(ERRORS):
        f.covariance[i, i] = f.start[i] * f.start[i]


@kernel
def predict(f: FilterRecord, angular_velocity: Vector, acceleration: Vector, rolling: Vector) -> None:
    """Go on by a period with the inertial unit's sample (body axes, biases taken off).

    ``rolling`` (feet, 3) are the velocities of the centres of round feet in stance, m/s.
    """
    t, r, half = f.period, f.rotation, f.step_rotation
    _predict_covariance(f)
    wx, wy, wz = angular_velocity[0], angular_velocity[1], angular_velocity[2]
    rotation_of(0.5 * t * wx, 0.5 * t * wy, 0.5 * t * wz, half)
    turn_by(r, half)
    for i in range(3):
        a = r[i, 0] * acceleration[0] + r[i, 1] * acceleration[1] + r[i, 2] * acceleration[2] + f.gravity[i]
        way = t * (f.velocity[i] + 0.5 * t * a)
        f.velocity[i] += t * a
        f.position[i] += way
        for k in range(f.held.shape[0]):
            f.foothold[k, i] += t * rolling[k, i] - way
    turn_by(r, half)
    orthonormalise(r)


@kernel
def turn_by(r: Vector, turn: Vector) -> None:
    """R ← R turn, both (3, 3)."""
    for i in range(3):
        x, y, z = r[i, 0], r[i, 1], r[i, 2]
        for j in range(3):
            r[i, j] = x * turn[0, j] + y * turn[1, j] + z * turn[2, j]


@kernel
def _predict_covariance(f: FilterRecord) -> None:
    """P ← Φ P Φᵀ + Q, with Φ = 1 + A T of the errors' linear dynamics."""
    n, p = f.covariance.shape[0], f.covariance
    _advance_rows(f, p)
    for i in range(n):
        for j in range(n):
            f.work[j, i] = p[i, j]
    _advance_rows(f, f.work)
    for i in range(n):
        for j in range(i, n):  # rounding differs below the diagonal, and what is not symmetric grows
            p[i, j] = p[j, i] = f.work[i, j]
    _add_noise(f)


@kernel
def _advance_rows(f: FilterRecord, p: Vector) -> None:
    """p ← Φ p; rows are errors, in the order of :data:`~harpy_pin.estimation.record.ERRORS`."""
    n, t, r, v, g, turned = p.shape[0], f.period, f.rotation, f.velocity, f.gravity, f.turned
    for i in range(3):  # R̂ times the rows of the biases
        for j in range(n):
            turned[i, j] = t * (r[i, 0] * p[9, j] + r[i, 1] * p[10, j] + r[i, 2] * p[11, j])
            turned[3 + i, j] = t * (r[i, 0] * p[12, j] + r[i, 1] * p[13, j] + r[i, 2] * p[14, j])
    for j in range(n):
        vx, vy, vz, ex, ey, ez = p[3, j], p[4, j], p[5, j], p[0, j], p[1, j], p[2, j]
        p[6, j] += t * (vx - v[1] * ez + v[2] * ey)
        p[7, j] += t * (vy - v[2] * ex + v[0] * ez)
        p[8, j] += t * (vz - v[0] * ey + v[1] * ex)
        gx, gy, gz = turned[0, j], turned[1, j], turned[2, j]
        p[3, j] += t * (g[1] * ez - g[2] * ey) - turned[3, j] - v[1] * gz + v[2] * gy
        p[4, j] += t * (g[2] * ex - g[0] * ez) - turned[4, j] - v[2] * gx + v[0] * gz
        p[5, j] += t * (g[0] * ey - g[1] * ex) - turned[5, j] - v[0] * gy + v[1] * gx
        p[0, j] -= gx
        p[1, j] -= gy
        p[2, j] -= gz
        turned[3, j], turned[4, j], turned[5, j] = t * vx, t * vy, t * vz
    for k in range(f.held.shape[0]):
        if f.held[k] != 0:
            rx, ry, rz, m = f.foothold[k, 0], f.foothold[k, 1], f.foothold[k, 2], ERRORS + 3 * k
            for j in range(n):
                gx, gy, gz = turned[0, j], turned[1, j], turned[2, j]
                p[m, j] -= turned[3, j] + ry * gz - rz * gy
                p[m + 1, j] -= turned[4, j] + rz * gx - rx * gz
                p[m + 2, j] -= turned[5, j] + rx * gy - ry * gx


@kernel
def _add_noise(f: FilterRecord) -> None:
    """P ← P + Q T; that of the gyroscope moves rotation, velocity and footholds together."""
    p, t, rows = f.covariance, f.period, f.rows
    rows[:] = 0.0
    share = f.gyroscope_density * np.sqrt(t)
    for i in range(3):
        rows[i, i] = share
    _put_cross(rows, 3, f.velocity, share)
    for k in range(f.held.shape[0]):
        if f.held[k] != 0:
            _put_cross(rows, ERRORS + 3 * k, f.foothold[k], share)
    for c in range(3):
        _add_outer(p, rows[c], 1.0)
    for i in range(3):
        p[3 + i, 3 + i] += f.accelerometer_density**2 * t
        p[9 + i, 9 + i] += f.gyroscope_walk**2 * t
        p[12 + i, 12 + i] += f.accelerometer_walk**2 * t


@kernel
def _put_cross(rows: Vector, m: int, a: Vector, share: float) -> None:
    """Columns m to m + 2 of rows ← share [a]×ᵀ."""
    rows[0, m + 1], rows[0, m + 2] = share * a[2], -share * a[1]
    rows[1, m], rows[1, m + 2] = -share * a[2], share * a[0]
    rows[2, m], rows[2, m + 1] = share * a[1], -share * a[0]


@kernel
def _add_outer(p: Vector, row: Vector, sign: float) -> None:
    """P ← P + sign row rowᵀ."""
    n = p.shape[0]
    for i in range(n):
        if row[i] != 0.0:
            factor = sign * row[i]
            for j in range(n):
                p[i, j] += factor * row[j]


@kernel
def slide(f: FilterRecord, k: int, share: float) -> None:
    """Let a foothold move at random over a period; the share scales the usual density."""
    for i in range(3):
        f.covariance[ERRORS + 3 * k + i, ERRORS + 3 * k + i] += (share * f.foothold_density) ** 2 * f.period


@kernel
def leave(f: FilterRecord, k: int) -> None:
    """Forget a foothold."""
    f.held[k] = 0
    m, n = ERRORS + 3 * k, f.covariance.shape[0]
    for i in range(3):
        for j in range(n):
            f.covariance[m + i, j] = f.covariance[j, m + i] = 0.0


@kernel
def touch_down(f: FilterRecord, k: int, local: Vector, noise: Vector) -> None:
    """Begin a foothold where kinematics say that the foot is.

    Args:
        f: the filter.
        k: number of the foot.
        local: (3,) of the foot less the inertial unit, body axes, m.
        noise: (3, 3) covariance of that, world axes, m².
    """
    leave(f, k)
    f.held[k] = 1
    m, r = ERRORS + 3 * k, f.rotation
    for i in range(3):
        f.foothold[k, i] = r[i, 0] * local[0] + r[i, 1] * local[1] + r[i, 2] * local[2]
        for j in range(3):
            f.covariance[m + i, m + j] = noise[i, j]
    if f.height_noise < np.inf:
        _take_height(f, k)


@kernel
def _take_height(f: FilterRecord, k: int) -> None:
    """Correct by the height of a foothold on level ground, zero."""
    n, p, m, row = f.covariance.shape[0], f.covariance, ERRORS + 3 * k, f.rows[0]
    rx, ry = f.foothold[k, 0], f.foothold[k, 1]
    for j in range(n):
        row[j] = p[8, j] + p[m + 2, j] + ry * p[0, j] - rx * p[1, j]
    variance = row[8] + row[m + 2] + ry * row[0] - rx * row[1] + f.height_noise * f.height_noise
    off = f.position[2] + f.foothold[k, 2]
    for j in range(n):
        f.correction[j] = row[j] * off / variance
        row[j] /= np.sqrt(variance)
    _add_outer(p, row, -1.0)
    _correct(f)


@kernel
def take_kinematics(f: FilterRecord, k: int, local: Vector, noise: Vector) -> bool:
    """Correct by where kinematics say that a foot in stance is; arguments as of :func:`touch_down`.

    Returns whether the measurement was taken: one beyond the gate is not, because the foot has slipped.
    """
    n, p, m, r, rows = f.covariance.shape[0], f.covariance, ERRORS + 3 * k, f.rotation, f.rows
    factor, off = np.empty((3, 3)), np.empty((3, 1))
    for i in range(3):
        off[i, 0] = r[i, 0] * local[0] + r[i, 1] * local[1] + r[i, 2] * local[2] - f.foothold[k, i]
        for j in range(3):
            factor[i, j] = p[m + i, m + j] + noise[i, j]
        for j in range(n):
            rows[i, j] = p[m + i, j]
    factorise(factor, factor)
    solve_transposed(factor, rows, n)
    solve_transposed(factor, off, 1)
    distance = off[0, 0] ** 2 + off[1, 0] ** 2 + off[2, 0] ** 2
    f.innovation += min(f.period / INNOVATION_TIME, 1.0) * (min(distance, 100.0) - f.innovation)
    if not distance <= f.gate:
        return False
    for j in range(n):
        f.correction[j] = -(rows[0, j] * off[0, 0] + rows[1, j] * off[1, 0] + rows[2, j] * off[2, 0])
    for c in range(3):
        _add_outer(p, rows[c], -1.0)
    _correct(f)
    return True


@kernel
def _correct(f: FilterRecord) -> None:
    """Take the estimated errors off the state."""
    c, back = f.correction, f.step_rotation
    rotation_of(-c[0], -c[1], -c[2], back)
    _turn(back, f.velocity, c[3:6])
    for k in range(f.held.shape[0]):
        if f.held[k] != 0:
            _turn(back, f.foothold[k], c[ERRORS + 3 * k : ERRORS + 3 * k + 3])
    r = f.rotation
    for j in range(3):
        x, y, z = r[0, j], r[1, j], r[2, j]
        for i in range(3):
            r[i, j] = back[i, 0] * x + back[i, 1] * y + back[i, 2] * z
            if j == 0:
                f.position[i] -= c[6 + i]
                f.gyroscope_bias[i] -= c[9 + i]
                f.accelerometer_bias[i] -= c[12 + i]


@kernel
def _turn(back: Vector, a: Vector, error: Vector) -> None:
    """A ← back (a − error)."""
    x, y, z = a[0] - error[0], a[1] - error[1], a[2] - error[2]
    for i in range(3):
        a[i] = back[i, 0] * x + back[i, 1] * y + back[i, 2] * z
