"""The contact-aided invariant extended Kalman filter.

It is that of Hartley, Ghaffari, Eustice and Grizzle (IJRR 39(4), 2020), with footholds relative to
the inertial unit. The state is the rotation R of body axes to the world, velocity v and position p
of the inertial unit, the biases b_g and b_a, and for each foot in stance r_k = d_k − p, where d_k
is its foothold. With gyroscope ω and accelerometer a,

    Ṙ = R [ω − b_g]×,   v̇ = R (a − b_a) + g,   ṗ = v,   ṙ_k = −v + u_k,

u_k is the velocity of the centre of a foot that rolls or creeps, zero for a point that stands.
Errors are right-invariant:

    R̂ = exp([ξ_R]×) R,   ξ_v = v̂ − exp([ξ_R]×) v,   ξ_k = r̂_k − exp([ξ_R]×) r_k,
    ζ_p = p̂ − p,   ζ_g = b̂_g − b_g,   ζ_a = b̂_a − b_a.

To first order, with n_g and n_a the noise of gyroscope and accelerometer and n_k that of a
foothold's velocity,

    ξ̇_R = R̂ (n_g − ζ_g)
    ξ̇_v = g × ξ_R + R̂ (n_a − ζ_a) + v̂ × R̂ (n_g − ζ_g)
    ζ̇_p = ξ_v − v̂ × ξ_R
    ξ̇_k = −ξ_v + r̂_k × R̂ (n_g − ζ_g) + n_k.

Kinematics measure h_k = Rᵀ r_k in body axes. The innovation R̂ h_k − r̂_k is −ξ_k and noise,
whatever the state is. So nothing that is estimated depends on the place in the world or on the
heading, which cannot be observed: only p̂ does.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.estimation.record import ERRORS, FilterRecord
from harpy_pin.kernels import ByPrecision, diagonal, kernel
from harpy_pin.model.cholesky import factorise, solve_transposed
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import exp, skew

INNOVATION_TIME = 0.1
"""Time constant of the low-pass of the innovations, s."""
COMPENSATED = ByPrecision(0.0, single=1.0)
"""Whether steps add to the place what rounding has taken off those before."""
ROUNDING = ByPrecision(0.0, single=1.2e-7)
"""Share by which each step lets the variances of place and heading grow that nothing bounds: more
than its rounding, which would make their covariance indefinite.
"""


@kernel
def begin_filter(f: FilterRecord) -> None:
    """Forget all footholds, and take the covariance of the start."""
    f.covariance[:] = 0.0
    f.held[:] = 0
    f.innovation = 3.0
    diagonal(f.covariance)[:ERRORS] = f.start**2


@kernel(angular_velocity=(3,), acceleration=(3,), rolling="f.foothold")
def predict(
    f: FilterRecord, angular_velocity: Vector, acceleration: Vector, rolling: Vector
) -> None:
    """Go on by a period with the inertial unit's sample (body axes, biases taken off).

    ``rolling`` (feet, 3) are the velocities of the centres of feet in stance that roll or creep,
    m/s.
    """
    _predict_covariance(f)
    t, half = f.period, exp(0.5 * f.period * angular_velocity)
    middle = f.rotation @ half
    a = middle @ acceleration + f.gravity
    way = t * (f.velocity + 0.5 * t * a)
    f.velocity += t * a
    _move(f, way)
    f.foothold += t * rolling - way
    r = middle @ half
    f.rotation[:] = 1.5 * r - 0.5 * (r @ (r.T @ r))  # one Newton step takes rounding off


@kernel
def _move(f: FilterRecord, way: Vector) -> None:
    """Add a way to the place, by Kahan's compensated sum."""
    f.rest += way
    place = f.position + f.rest
    f.rest[:] = COMPENSATED * (f.rest - (place - f.position))
    f.position[:] = place


@kernel
def _predict_covariance(f: FilterRecord) -> None:
    """P ← Φ P Φᵀ + Q, with Φ = 1 + A T of the errors' linear dynamics."""
    p, t = f.covariance, f.period
    _advance_rows(f, p)
    f.work[:] = p.T
    _advance_rows(f, f.work)
    _turn_by_noise(f)
    p[:] = 0.5 * (f.work + f.work.T) + f.rows.T @ f.rows  # what is not symmetric grows
    p[3:6, 3:6] += f.accelerometer_density**2 * t * np.eye(3)
    p[9:12, 9:12] += f.gyroscope_walk**2 * t * np.eye(3)
    p[12:15, 12:15] += f.accelerometer_walk**2 * t * np.eye(3)
    diagonal(p)[2] += ROUNDING * p[2, 2]
    diagonal(p)[6:8] += ROUNDING * diagonal(p)[6:8]


@kernel(p="f.covariance")
def _advance_rows(f: FilterRecord, p: Vector) -> None:
    """p ← Φ p; rows are errors, in the order of :data:`~harpy_pin.estimation.record.ERRORS`."""
    t, rotation, velocity, position = f.period, p[0:3], p[3:6], p[6:9]
    turn, push = t * f.rotation @ p[9:12], t * f.rotation @ p[12:15]
    position += t * (velocity - np.cross(f.velocity, rotation.T).T)
    for k in range(f.held.shape[0]):
        if f.held[k] != 0:
            m = ERRORS + 3 * k
            p[m : m + 3] -= t * velocity + np.cross(f.foothold[k], turn.T).T
    velocity += t * np.cross(f.gravity, rotation.T).T - push - np.cross(f.velocity, turn.T).T
    rotation -= turn


@kernel
def _turn_by_noise(f: FilterRecord) -> None:
    """Noise of the gyroscope, which moves rotation, velocity and footholds together: into
    f.rows.
    """
    rows = f.rows
    rows[:] = 0.0
    rows[:, 0:3] = np.eye(3)
    rows[:, 3:6] = skew(f.velocity).T
    for k in range(f.held.shape[0]):
        if f.held[k] != 0:
            m = ERRORS + 3 * k
            rows[:, m : m + 3] = skew(f.foothold[k]).T
    rows *= f.gyroscope_density * np.sqrt(f.period)


@kernel
def slide(f: FilterRecord, k: int, share: float) -> None:
    """Let a foothold move at random over a period; the share scales the usual density."""
    m = ERRORS + 3 * k
    f.covariance[m : m + 3, m : m + 3] += (share * f.foothold_density) ** 2 * f.period * np.eye(3)


@kernel
def leave(f: FilterRecord, k: int) -> None:
    """Forget a foothold."""
    f.held[k] = 0
    m = ERRORS + 3 * k
    f.covariance[m : m + 3] = 0.0
    f.covariance[:, m : m + 3] = 0.0


@kernel(local=(3,), noise=(3, 3))
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
    m = ERRORS + 3 * k
    f.foothold[k] = f.rotation @ local
    f.covariance[m : m + 3, m : m + 3] = noise
    if f.height_noise < np.inf:
        _take_height(f, k)


@kernel
def _take_height(f: FilterRecord, k: int) -> None:
    """Correct by the height of a foothold on level ground, zero."""
    p, m, row = f.covariance, ERRORS + 3 * k, f.rows[0]
    x, y, z = f.foothold[k]
    row[:] = p[8] + p[m + 2] + y * p[0] - x * p[1]
    variance = row[8] + row[m + 2] + y * row[0] - x * row[1] + f.height_noise**2
    f.correction[:] = row * (f.position[2] + z) / variance
    row /= np.sqrt(variance)
    p -= np.outer(row, row)
    _correct(f)


@kernel(local=(3,), noise=(3, 3))
def take_kinematics(f: FilterRecord, k: int, local: Vector, noise: Vector) -> bool:
    """Correct by where kinematics say that a foot in stance is; arguments as of :func:`touch_down`.

    Returns whether the measurement was taken: one beyond the gate is not, because the foot has
    slipped.
    """
    p, m, rows = f.covariance, ERRORS + 3 * k, f.rows
    off = f.rotation @ local - f.foothold[k]
    factor = p[m : m + 3, m : m + 3] + noise
    rows[:] = p[m : m + 3]
    factorise(factor, factor)
    solve_transposed(factor, rows, rows.shape[1])
    solve_transposed(factor, off.reshape((3, 1)), 1)
    distance = off @ off
    f.innovation += min(f.period / INNOVATION_TIME, 1.0) * (min(distance, 100.0) - f.innovation)
    if not distance <= f.gate:
        return False
    f.correction[:] = -(off @ rows)
    p -= rows.T @ rows
    _correct(f)
    return True


@kernel
def _correct(f: FilterRecord) -> None:
    """Take the estimated errors off the state."""
    c = f.correction
    back = exp(-c[0:3])
    f.rotation[:] = back @ f.rotation
    f.velocity[:] = back @ (f.velocity - c[3:6])
    _move(f, -c[6:9])
    f.gyroscope_bias -= c[9:12]
    f.accelerometer_bias -= c[12:15]
    for k in range(f.held.shape[0]):
        if f.held[k] != 0:
            m = ERRORS + 3 * k
            f.foothold[k] = back @ (f.foothold[k] - c[m : m + 3])
