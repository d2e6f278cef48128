"""A time step on ground that is not flat: motion and force of every foot in the frame of its contact.

In that frame the third axis is the normal, so that the equations of the flat ground's step hold unchanged: penetration
and normal force along the normal, friction in the tangent plane. A foot feels the tangent plane below it at the
beginning of the step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.model.contact_frame import contact_frame, to_contact, to_world
from harpy_pin.model.dynamics import EquationsRecord
from harpy_pin.model.state import Vector
from harpy_pin.simulation.terrain.surface import TerrainRecord, surface_height, surface_normal

if TYPE_CHECKING:
    from harpy_pin.simulation.step import StepRecord

__all__: list[str] = []


@kernel
def into_contact_frames(d: EquationsRecord, t: TerrainRecord, s: StepRecord, v: Vector) -> None:
    """Heights, free velocities, columns of the Jacobian and the forces guessed, in the frames of the contacts.

    Args:
        d: of the dynamics at the beginning of the step.
        t: of the ground's surface.
        s: of the step; its columns hold the Jacobian in world axes, its forces are those of the step before.
        v: (nv,) generalised velocity.
    """
    for k in range(s.height.shape[0]):
        place, frame = d.foot_position[k], s.frame[k]
        nx, ny, nz = surface_normal(t, place[0], place[1])
        contact_frame(nx, ny, nz, frame)
        s.height[k] = (place[2] - surface_height(t, place[0], place[1])) * nz
        free = s.free[3 * k : 3 * k + 3]
        for c in range(3):
            free[c] = 0.5 * s.dt * d.foot_drift[3 * k + c]
            for i in range(v.shape[0]):
                free[c] += d.foot_jacobian[3 * k + c, i] * v[i]
        to_contact(frame, free)
        to_contact(frame, s.force[3 * k : 3 * k + 3])
        for i in range(v.shape[0]):
            to_contact(frame, s.columns[i, 3 * k : 3 * k + 3])


@kernel
def forces_to_world(s: StepRecord) -> None:
    """The forces of the step in world axes."""
    for k in range(s.height.shape[0]):
        to_world(s.frame[k], s.force[3 * k : 3 * k + 3])
