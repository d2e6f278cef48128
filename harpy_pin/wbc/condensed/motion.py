"""Accelerations and torques of the forces that were chosen."""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.elimination import ROOT, SIDES, EliminationRecord, back_substitute
from harpy_pin.wbc.condensed.limbs import LimbsRecord, move_limbs
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.optimum import root_multiplier


@kernel
def move(
    d: DynamicsRecord,
    e: EliminationRecord,
    b: LimbsRecord,
    n: NewtonRecord,
    torque: Vector,
    found: bool,
) -> None:
    """a, and the torques (joints,); ``found`` says whether λ is that of the optimum."""
    columns, first = np.empty((SIDES,)), n.bare.shape[0]
    others = n.multiplier[ROOT : first + n.limits]
    root_multiplier(n, found)
    columns[:ROOT], columns[ROOT], others[: first - ROOT] = n.bare[:ROOT], 1.0, n.bare[ROOT:]
    back_substitute(e, columns, others)
    move_limbs(b, e, columns[:ROOT], others)
    _joint_torques(d, e, b, n, torque)


@kernel
def _joint_torques(
    d: DynamicsRecord, e: EliminationRecord, b: LimbsRecord, n: NewtonRecord, torque: Vector
) -> None:
    """τ = M a + n − Jᵀ f − J_tᵀ u of the joints."""
    torque[:] = e.bias[ROOT:] + d.mass_matrix[ROOT:] @ e.acceleration
    if n.thrust.shape[0] > 0:
        torque -= d.thruster_jacobian[:, ROOT:].T @ n.thrust
    rows = b.inverse.shape[2]
    for k in range(b.joint.shape[0]):
        first, joint = 3 * b.foot[k], b.joint[k]
        own = d.foot_jacobian[first : first + rows]
        torque[joint - ROOT] -= own[:, joint].T @ n.force[first : first + rows]
    for k in range(b.beside.shape[0]):
        first = 3 * b.beside[k]
        own = d.foot_jacobian[first : first + 3, ROOT:]
        torque -= own.T @ n.force[first : first + 3]
