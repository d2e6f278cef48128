"""One time step of the robot in the plane, for the many walks that a search needs.

The scheme of :mod:`harpy_pin.plant.simulator`, to rounding, and about ten times as fast: no call leaves compiled code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from harpy_pin.gait.planar.model import NV, planar_terms
from harpy_pin.model.state import Vector
from harpy_pin.plant.ground import contact_step

__all__ = ["planar_step", "workspace"]

LEAST_MOBILITY = 1e-9
"""Inverse mass of a foot sideways, 1/kg: it cannot move, and the contact solver must not divide by zero."""
MAX_SWEEPS = 500


@njit(cache=True)
def planar_step(
    q: Vector,
    v: Vector,
    torque: Vector,
    thrust: Vector,
    links: Vector,
    points: Vector,
    joint: Vector,
    gravity: float,
    dt: float,
    ground: Vector,
    force: Vector,
    feet: Vector,
    work: Any,
) -> int:
    """One time step, implicit in the contact, in place (the scheme of :mod:`harpy_pin.plant.simulator`).

    Args:
        q: (7,) configuration, in and out.
        v: (7,) velocity, in and out.
        torque: (4,) joint torques, N·m.
        thrust: (2,) sum of the thrusts, world x and z, N.
        links: see :class:`PlanarModel`.
        points: likewise.
        joint: likewise.
        gravity: magnitude, m/s².
        dt: step, s.
        ground: (7,) :attr:`harpy_pin.plant.ground.Ground.packed`.
        force: (6,) contact forces of left and right foot, world x, y, z: guess in, forces out, N.
        feet: (2, 2) out: foot positions at the start of the step, m.
        work: arrays of :func:`workspace`.

    Returns:
        Sweeps of the contact solver, 501 if they did not converge.
    """
    chol, bias, foot_jacobian, drift, mount_jacobian, solved, mobility, free, height = work
    planar_terms(q, v, links, points, joint, gravity, chol, bias, foot_jacobian, drift, feet, mount_jacobian)
    # Cholesky of M + dt B, in place.
    for j in range(NV):
        for i in range(j, NV):
            s = chol[i, j]
            if i == j:
                s += dt * joint[1, i]
            for k in range(j):
                s -= chol[i, k] * chol[j, k]
            chol[i, j] = np.sqrt(s) if i == j else s / chol[j, j]
    change = np.empty(NV)
    for i in range(NV):
        s = -bias[i] - joint[1, i] * v[i]
        s += mount_jacobian[0, i] * thrust[0] + mount_jacobian[1, i] * thrust[1]
        if i >= 3:
            s += torque[i - 3]
        s *= dt
        for k in range(i):
            s -= chol[i, k] * change[k]
        change[i] = s / chol[i, i]
    for c in range(4):
        for i in range(NV):
            s = foot_jacobian[c, i]
            for k in range(i):
                s -= chol[i, k] * solved[c, k]
            solved[c, i] = s / chol[i, i]
    # The contact solver works in space: rows x, y, z of each foot, no motion along y.
    for a in range(4):
        row = 3 * (a // 2) + 2 * (a % 2)
        s = 0.5 * dt * drift[a]
        for i in range(NV):
            s += foot_jacobian[a, i] * v[i] + solved[a, i] * change[i]
        free[row] = s
        for b in range(4):
            column = 3 * (b // 2) + 2 * (b % 2)
            s = 0.0
            for i in range(NV):
                s += solved[a, i] * solved[b, i]
            if a == b and s < LEAST_MOBILITY:
                s = LEAST_MOBILITY
            mobility[row, column] = dt * s
    mobility[1, 1] = dt * LEAST_MOBILITY
    mobility[4, 4] = dt * LEAST_MOBILITY
    height[0], height[1] = feet[0, 1], feet[1, 1]
    sweeps = contact_step(mobility, free, height, dt, ground, force, 1e-10, MAX_SWEEPS)
    for a in range(4):
        push = dt * force[3 * (a // 2) + 2 * (a % 2)]
        if push != 0.0:
            for i in range(NV):
                change[i] += solved[a, i] * push
    for i in range(NV - 1, -1, -1):
        s = change[i]
        for k in range(i + 1, NV):
            s -= chol[k, i] * change[k]
        change[i] = s / chol[i, i]
    for i in range(NV):
        v[i] += change[i]
        q[i] += dt * v[i]
    return sweeps


@njit(cache=True)
def workspace() -> Any:
    """Arrays that :func:`planar_step` works in."""
    return (
        np.zeros((NV, NV)),
        np.zeros(NV),
        np.zeros((4, NV)),
        np.zeros(4),
        np.zeros((2, NV)),
        np.zeros((4, NV)),
        np.zeros((6, 6)),
        np.zeros(6),
        np.zeros(2),
    )
