"""The horizontal acceleration of the centre of mass as rows on the generalised acceleration.

The base's linear rows of M a + n are the robot's mass times the acceleration of its centre of mass, less gravity, in
base axes. So with the rotation R of the base, m = M_00 and the first three rows M_l, n_l

    c̈ = R (M_l a + n_l) / m + g

The task of the body has these rows instead of those of the body's origin where a gait demands the acceleration of the
centre of mass (:attr:`harpy_pin.gaits.gait.GaitTarget.centre_of_mass`): of a robot on soles legs, torso and arms are
heavy, and what they do moves its centre of mass against the origin of its base.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.weights import TargetsRecord

__all__: list[str] = []


@kernel
def note_centre_drift(d: DynamicsRecord, t: TargetsRecord) -> None:
    """What the velocities alone give the centre of mass, R n_l / m + g, into ``t.centre_drift``."""
    tree = d.tree
    for k in range(2):
        s = 0.0
        for i in range(3):
            s += tree.rotation[k, i] * d.bias[i]
        t.centre_drift[k] = s / d.mass_matrix[0, 0] + tree.gravity[k]


@kernel
def body_row(k: int, d: DynamicsRecord, t: TargetsRecord, v: Vector, rotation: Vector, row: Vector) -> float:
    """A row of the body's linear task along a world axis, where the centre of mass has the horizontal ones.

    Axis k is 0 or 1 of the centre of mass, or 2 of the body's origin. The row (nv,) is written, and the value that
    row · a should have, m/s², is returned.
    """
    row[:] = 0.0
    if k < 2:
        for i in range(3):
            x = rotation[k, i] / d.mass_matrix[0, 0]
            for c in range(row.shape[0]):
                row[c] += x * d.mass_matrix[i, c]
        return float(t.body[k] - t.centre_drift[k])
    value = t.body[2]
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        row[i] = rotation[2, i]
        value -= rotation[2, i] * (v[3 + a] * v[b] - v[3 + b] * v[a])
    return float(value)
