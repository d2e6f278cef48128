"""Coulomb friction in the joints, found together with the contact forces at the end of a step.

A joint whose friction suffices to hold it does not move at all; another one has the whole friction against its motion.
Contact forces and joint friction are found in turn (Gauss–Seidel), each with the other given, until neither changes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import solve_transposed
from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.simulation.implicit_contact import contact_step

if TYPE_CHECKING:
    from harpy_pin.ground.ground import GroundRecord
    from harpy_pin.simulation.step import StepRecord

ROUNDS = 200
"""Most rounds of a step."""
TOLERANCE = 1e-9
"""Change of a joint's friction, as a share of its limit, that ends them."""


class JointFrictionRecord(RecordOf):
    """Coulomb friction of the joints; without it, arrays of no joints."""

    limit: Vector  # (joints,) N·m
    torque: Vector = sized("joints")  # (joints,) of the last step, N·m
    columns: Vector = sized("nv", "joints")  # (nv, joints) L⁻ᵀ S, with M + dt B = Lᵀ L
    free: Vector = sized("3 feet")  # (3 feet,) velocities of the feet under that friction without contact forces, m/s


def joint_friction_record(*, nv: int, feet: int, limit: Vector) -> Records[JointFrictionRecord]:
    """A new :class:`JointFrictionRecord`, with the Coulomb friction ``limit`` (joints,), N·m, in the joints."""
    joints = len(limit) if limit.any() else 0
    return make_record(JointFrictionRecord, {"nv": nv, "feet": feet, "joints": joints}, limit=limit[:joints])


@kernel
def step_with_friction(s: StepRecord, ground: GroundRecord, v: Vector, tolerance: float, sweeps: int) -> int:
    """Contact forces and joint friction; adds the latter's part to the last of the step's columns.

    Columns, mobility and free velocities are those for the contact alone, v (nv,) is the velocity at the beginning of
    the step; tolerance and most sweeps are the contact solver's. Returns the sweeps of the last contact problem,
    ``sweeps + 1`` if it or the rounds did not converge.
    """
    f, dt = s.joints, s.dt
    nv, nc, joints = v.shape[0], s.force.shape[0], f.limit.shape[0]
    columns, own = s.columns, f.columns
    for i in range(nv):
        for j in range(joints):
            own[i, j] = 1.0 if i == 6 + j else 0.0
    solve_transposed(s.factor, own, joints)
    for j in range(joints):  # last step's friction is the first guess
        for i in range(nv):
            columns[i, nc] += dt * own[i, j] * f.torque[j]
    used = 0
    for _ in range(ROUNDS):
        for a in range(nc):
            f.free[a] = s.free[a]
            for j in range(joints):
                for i in range(nv):
                    f.free[a] += dt * columns[i, a] * own[i, j] * f.torque[j]
        used = contact_step(s.mobility, f.free, s.height, s.friction, dt, ground, s.force, tolerance, sweeps)
        change = 0.0
        for j in range(joints):
            speed, mobility = v[6 + j], 0.0
            for i in range(nv):
                drive = columns[i, nc]
                for c in range(nc):
                    drive += dt * columns[i, c] * s.force[c]
                speed += own[i, j] * drive
                mobility += dt * own[i, j] * own[i, j]
            torque = min(max(f.torque[j] - speed / mobility, -f.limit[j]), f.limit[j])
            more = torque - f.torque[j]
            for i in range(nv):
                columns[i, nc] += dt * own[i, j] * more
            f.torque[j] = torque
            if f.limit[j] > 0.0:
                change = max(change, abs(more) / f.limit[j])
        if change <= TOLERANCE:
            return used
    return sweeps + 1
