"""The optimum with every force in Coulomb's disc itself, by a short sequence of quadratic programs.

The disc ‖f_t‖ ≤ μ f_z is not a polyhedron. Each program has a pyramid around it, one face of which touches it in the
direction of the last force, and in its Hessian the curvature of the disc there,

    (λ / μ f_z) t tᵀ,   t the tangent, λ the multiplier of the disc.

This is Newton's method on the optimality conditions (sequential quadratic programming): near the optimum every program
squares the error. The last tick's direction and curvature begin it. It ends where the conditions of the disc hold to
``OUTSIDE`` and ``PULL``, or after ``PROGRAMS``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.active_set import search_active_set

if TYPE_CHECKING:
    from harpy_pin.wbc.condensed.condensed_record import CondensedRecord, SearchRecord
    from harpy_pin.wbc.condensed.cones import ConesRecord
    from harpy_pin.wbc.program import ProgramRecord
    from harpy_pin.wbc.weights import TargetsRecord

__all__: list[str] = []

PROGRAMS = 12
"""Most programs for one optimum in discs."""
OUTSIDE = 1e-6
"""Distance of a force from its disc with which it counts as on it, relative to 1 N + its friction limit."""
PULL = 1e-10
"""The same for the residual of stationarity, as a force by the Hessian's mean curvature."""
POINT = 1e-9
"""Friction limit below which the disc counts as a point, N."""
SINGLE = {"OUTSIDE": 1e-4, "PULL": 1e-6}
"""In single precision."""


@kernel
def search_in_discs(t: TargetsRecord, p: CondensedRecord, search: SearchRecord, z: Vector) -> None:
    """The optimum with the last variables in their discs.

    Args:
        t: element of the targets' record.
        p: of the controller's record; its status is updated.
        search: the program, and what searches its optimum.
        z: out.
    """
    c, qp = p.cones, search.program
    feet = t.held.shape[0]
    first = z.shape[0] - 3 * feet
    for k in range(feet):
        x = first + 3 * k
        c.block[k, 0], c.block[k, 1], c.block[k, 2] = qp.hessian[x, x], qp.hessian[x, x + 1], qp.hessian[x + 1, x + 1]
        if t.held[k] == 0.0:
            c.curvature[k] = 0.0
    for _ in range(PROGRAMS):
        for k in range(feet):
            if t.held[k] != 0.0:
                _set_tangent(c, qp, first, k)
        if not search_active_set(p, search, z):
            return
        error = 0.0
        for k in range(feet):
            if t.held[k] != 0.0:
                error = max(error, _residual(c, search, z, first, k))
        if error <= 1.0:
            return
    p.status_and_systems[0] |= 4


@kernel
def _set_tangent(c: ConesRecord, qp: ProgramRecord, first: int, k: int) -> None:
    """Set the pyramid and the Hessian of a foot for the direction of its force."""
    faces = c.pyramid.shape[1]
    column = first + 3 * k
    row = first + (faces + 1) * k  # the variables before the forces have a row each
    for r in range(faces):
        angle = c.direction[k] + 2.0 * np.pi * r / faces
        qp.inequality[row + r, column] = -np.cos(angle)
        qp.inequality[row + r, column + 1] = -np.sin(angle)
        qp.inequality[row + r, column + 2] = c.friction[k]
    tx, ty, bend = -np.sin(c.direction[k]), np.cos(c.direction[k]), c.curvature[k]
    qp.hessian[column, column] = c.block[k, 0] + bend * tx * tx
    qp.hessian[column, column + 1] = qp.hessian[column + 1, column] = c.block[k, 1] + bend * tx * ty
    qp.hessian[column + 1, column + 1] = c.block[k, 2] + bend * ty * ty


@kernel
def _residual(c: ConesRecord, search: SearchRecord, z: Vector, first: int, k: int) -> float:
    """Relative error of the disc's optimality conditions; sets the next direction and curvature."""
    faces = c.pyramid.shape[1]
    row = first + (faces + 1) * k
    x, y, limit = z[first + 3 * k], z[first + 3 * k + 1], c.friction[k] * z[first + 3 * k + 2]
    # Multiplier of the disc as a vector: those of the faces, and the part of the curvature.
    pull_x = pull_y = total = 0.0
    w, count = search.exchange, 0
    for r in range(w.active.shape[0]):
        if w.active[r] != 0:
            if row <= r < row + faces:
                share = abs(w.multiplier[count])
                total += share
                pull_x -= share * search.program.inequality[r, first + 3 * k]
                pull_y -= share * search.program.inequality[r, first + 3 * k + 1]
            count += 1
    tx, ty = -np.sin(c.direction[k]), np.cos(c.direction[k])
    held_back = c.curvature[k] * (tx * x + ty * y)
    pull_x += held_back * tx
    pull_y += held_back * ty
    length = np.hypot(x, y)
    scale = 0.5 * (c.block[k, 0] + c.block[k, 2])
    slipping = total > 0.0 and limit > POINT
    if slipping:
        nx, ny = x / length, y / length
        along = pull_x * nx + pull_y * ny
        across, upwards = pull_x * ny - pull_y * nx, c.friction[k] * (total - along)
        outside, pull = abs(length - limit), max(abs(across), abs(upwards))
        c.curvature[k] = max(along, 0.0) / limit
    else:
        outside, pull = length - limit, 0.0 if total > 0.0 else np.hypot(pull_x, pull_y)
        c.curvature[k] = 0.0
    c.direction[k] = np.arctan2(y, x)
    return float(max(outside / OUTSIDE, pull / (scale * PULL)) / (1.0 + limit))
