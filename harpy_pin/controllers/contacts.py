"""Contacts on ground that is not level: what concerns a foot, in the frame of its contact.

Every formulation, the condensed program, the cones and the estimate of the friction say z where they mean the normal.
So Jacobian, drift, target and force of every foot are expressed in its contact frame once, after the tasks are known,
and what follows stays as it is. The forces that are logged are in world axes again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.ground.contact_frame import contact_frame, to_contact, to_world, turn_feet
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.controllers.tasks import TasksRecord
    from harpy_pin.gaits.gait import GaitTargetRecord
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.model.record import Records
    from harpy_pin.wbc.weights import TargetsRecord

__all__: list[str] = []


@kernel
def load_on(normal: Vector, force: Vector) -> float:
    """Part of a force (3,) along a normal, N."""
    return float(normal[0] * force[0] + normal[1] * force[1] + normal[2] * force[2])


@kernel
def below_ground(g: GaitTargetRecord, k: int, place: Vector) -> bool:
    """Whether a foot is below the ground's tangent plane at its target."""
    n = g.normal[k]
    above = n[2] * (place[2] - g.ground_height[k])
    for i in range(2):
        above += n[i] * (place[i] - g.body[i] - g.foot_position[k, i])
    below: bool = above <= 0.0
    return below


@kernel
def turn_into_contacts(r: TasksRecord, g: GaitTargetRecord, foot_force: Vector) -> None:
    """Terms, targets and measured forces of the feet in the frames of their contacts.

    Args:
        r: element of the tasks' record, its terms and targets in world axes.
        g: element of the gait's, with normals of length one.
        foot_force: (feet, 3) as measured, world axes, N.
    """
    d, t = r.dynamics, r.targets
    for k in range(t.held.shape[0]):
        contact_frame(g.normal[k, 0], g.normal[k, 1], g.normal[k, 2], t.frame[k])
    _one_frame_for_a_sole(r)
    turn_feet(d, t.frame)
    for k in range(t.held.shape[0]):
        to_contact(t.frame[k], t.feet[k])
        for i in range(3):
            t.measured[k, i] = foot_force[k, i]
        to_contact(t.frame[k], t.measured[k])
    t.tilted = 1


@kernel
def _one_frame_for_a_sole(r: TasksRecord) -> None:
    """All corners of a flat foot have the frame of the first."""
    t, feet = r.targets, r.tasks.flat_feet
    first = 0
    for n in range(feet.shape[0]):
        for k in range(first + 1, first + feet[n]):
            for i in range(3):
                for j in range(3):
                    t.frame[k, i, j] = t.frame[first, i, j]
        first += feet[n]


@kernel
def forces_in_world(t: TargetsRecord, force: Vector) -> None:
    """Contact forces (3 feet,) in world axes, in place."""
    if t.tilted:
        for k in range(t.held.shape[0]):
            to_world(t.frame[k], force[3 * k : 3 * k + 3])


@kernel
def turn_feet_of(dynamics: Records[DynamicsRecord], frame: Vector) -> None:
    turn_feet(dynamics[0], frame)


@kernel
def target_tilt(up: Vector, x: float, y: float, z: float, w: float) -> tuple[float, float, float, float]:
    """The quaternion of the body seen from a target body that leans, by the smallest rotation from upright to ``up``.

    Args:
        up: (3,) the target's z axis, of length one.
        x: of the body's quaternion.
        y: of the body's quaternion.
        z: of the body's quaternion.
        w: of the body's quaternion, its real part.
    """
    c = np.sqrt(0.5 * (1.0 + up[2]))
    a, b = 0.5 * up[1] / c, -0.5 * up[0] / c
    return c * x + a * w + b * z, c * y - a * z + b * w, c * z + a * y - b * x, c * w - a * x - b * y
