"""The root's six equations in the acceleration of the centre of mass (:mod:`harpy_pin.wbc.condensed.condense`).

With the limbs eliminated c̈ is affine in the root's acceleration and in the free accelerations o,

    z = C a_r + C_o o + c,    z = [c̈_x, c̈_y, z̈ of the body's origin, angular acceleration]

and so is a_r in z. Put into M_b a_r + n_b = G_f f + G_o o this gives equations of the same form in z, with M_b C⁻¹,
n_b − M_b C⁻¹ c and G_o + M_b C⁻¹ C_o. The weights W are then on z − z_d, and all that follows stays as it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.condensed.condense import CondensationRecord
    from harpy_pin.wbc.weights import TargetsRecord

__all__: list[str] = []

MIN_DETERMINANT = 1e-2
"""Least determinant of the part of C that maps the linear acceleration; below it the task is the body's origin's."""


@kernel
def turn_to_centre(d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, v: Vector) -> None:
    """Change the root's equations, with the limbs eliminated, and what is demanded, to z."""
    rotation, mass, thrusts = d.tree.rotation, d.mass_matrix[0, 0], d.thruster_jacobian.shape[0]
    e.centred = 0
    _linear_rows(e, rotation, mass)
    if not _invert(e):
        return
    e.centred = 1
    free = e.free_map.shape[1]
    for k in range(2):
        s = t.centre_drift[k]
        for i in range(3):
            s += rotation[k, i] * (e.bias[i] - d.bias[i]) / mass
        e.centre_bias[k] = s
        for c in range(free):
            s = 0.0
            for i in range(3):
                s -= rotation[k, i] * e.free_map[i, c] / mass
            e.centre_free[k, c] = s if c >= thrusts else 0.0
    e.centre_bias[2] = 0.0
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        e.centre_bias[2] += rotation[2, i] * (v[3 + a] * v[b] - v[3 + b] * v[a])
        e.desired[i] = t.body[i]
    row = np.empty(6)
    for i in range(6):
        for j in range(6):
            row[j] = 0.0
            for k in range(6):
                row[j] += e.mass[i, k] * e.root_per_centre[k, j]
        for j in range(6):
            e.mass[i, j] = row[j]
        for k in range(3):
            e.bias[i] -= row[k] * e.centre_bias[k]
        for c in range(free):
            e.free_map[i, c] += row[0] * e.centre_free[0, c] + row[1] * e.centre_free[1, c]


@kernel
def _linear_rows(e: CondensationRecord, rotation: Vector, mass: float) -> None:
    """The first three rows of C, into ``root_per_centre``."""
    for k in range(3):
        for j in range(6):
            s = 0.0
            for i in range(3):
                s += rotation[k, i] * e.mass[i, j] / mass
            e.root_per_centre[k, j] = s
    for j in range(6):
        e.root_per_centre[2, j] = rotation[2, j] if j < 3 else 0.0


@kernel
def _invert(e: CondensationRecord) -> bool:
    """C⁻¹ in the place of C = [[A, B], [0, 1]]: [[A⁻¹, −A⁻¹ B], [0, 1]]; whether there is one."""
    m = e.root_per_centre
    inverse, product = np.empty((3, 3)), np.empty((3, 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        inverse[0, a] = m[b, 1] * m[c, 2] - m[b, 2] * m[c, 1]
        inverse[1, a] = m[b, 2] * m[c, 0] - m[b, 0] * m[c, 2]
        inverse[2, a] = m[b, 0] * m[c, 1] - m[b, 1] * m[c, 0]
    determinant = m[0, 0] * inverse[0, 0] + m[1, 0] * inverse[0, 1] + m[2, 0] * inverse[0, 2]
    if not abs(determinant) > MIN_DETERMINANT:
        return False
    for a in range(3):
        for b in range(3):
            product[a, b] = 0.0
            for c in range(3):
                product[a, b] += inverse[a, c] * m[c, 3 + b] / determinant
    for a in range(3):
        for b in range(3):
            m[a, b], m[a, 3 + b] = inverse[a, b] / determinant, -product[a, b]
            m[3 + a, b], m[3 + a, 3 + b] = 0.0, 1.0 if a == b else 0.0
    return True


@kernel
def root_of_centre(e: CondensationRecord) -> None:
    """The root's acceleration from z, in the first six entries of ``e.acceleration``."""
    a, x = e.acceleration, np.empty(6)
    for j in range(6):
        x[j] = a[j] - (e.centre_bias[j] if j < 3 else 0.0)
    for k in range(2):
        for c in range(e.free_acceleration.shape[0]):
            x[k] -= e.centre_free[k, c] * e.free_acceleration[c]
    for i in range(6):
        a[i] = 0.0
        for j in range(6):
            a[i] += e.root_per_centre[i, j] * x[j]


@kernel
def root_per_unit(e: CondensationRecord, n: int) -> None:
    """The motion per unit of each of n variables, in the first six rows of ``e.motion_per_unit``."""
    motion, free, x = e.motion_per_unit, e.free_per_unit, np.empty(6)
    for a in range(n):
        for j in range(6):
            x[j] = motion[j, a]
        for k in range(2):
            for c in range(e.free_acceleration.shape[0]):
                x[k] -= e.centre_free[k, c] * free[c, a]
        for i in range(6):
            motion[i, a] = 0.0
            for j in range(6):
                motion[i, a] += e.root_per_centre[i, j] * x[j]
