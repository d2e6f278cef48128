"""The whole-body problem with every unknown kept but the torques: z = [u; s; f; a]."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numba import njit

from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.state import Vector
from harpy_pin.wbc.problem import WholeBodyProblem, add_task, force_bounds, mirror, motion_task, wanted_acceleration
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.settings import WholeBodyTargets, unpack_targets

__all__ = ["FullProblem"]


class FullProblem(WholeBodyProblem):
    """Equalities: the floating base's rows of the dynamics, and a triple for each foot; rows for the torques.

    Nothing is inverted: this is the form that most controllers solve, and the one to read first.
    """

    name: ClassVar[str] = "full"

    def _allocate(self) -> QuadraticProgram:
        bounded = self.n_thrust + self.n_slack
        program = QuadraticProgram(
            bounded + self.n_force + self.nv,
            equalities=6 + self.n_force,
            inequalities=self.foot_rows * self.feet + self.joints,
            bounded=bounded,
        )
        self._bound(program, torque=False, slack=self.n_thrust)
        self._friction(program, force=bounded)
        self._offset = np.zeros(self.joints)
        return program

    def build(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem.build`."""
        p = self.program
        _build(
            *self._given(dynamics, v, rotation, targets),
            self._torque_limit,
            p.bounded,
            self.foot_rows - 1,
            p.hessian,
            p.gradient,
            p.equality,
            p.equality_value,
            p.inequality,
            p.lower,
            p.upper,
            self._offset,
        )

    def inputs(self, z: Vector, out: Vector) -> None:
        """See :meth:`WholeBodyProblem.inputs`."""
        nt = self.n_thrust
        out[:nt] = z[:nt]
        torque = out[nt:]
        np.dot(self.program.inequality[-self.joints :], z, out=torque)
        torque += self._offset

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        return z[-self.nv :].copy()

    def contact_force(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.contact_force`."""
        return z[self.program.bounded : -self.nv].reshape(-1, 3).copy()


@njit(cache=True)
def _build(  # type: ignore[no-untyped-def]
    mass_matrix,
    bias,
    damping,
    foot_jacobian,
    foot_drift,
    thruster_jacobian,
    v,
    rotation,
    targets,
    weights,
    torque_limit,
    force,
    faces,
    hessian,
    gradient,
    equality,
    equality_value,
    inequality,
    lower,
    upper,
    offset,
):
    nv = v.shape[0]
    nf = foot_drift.shape[0]
    nt = thruster_jacobian.shape[0]
    acceleration = force + nf  # where the variables a begin
    body, orientation, feet, held, force_range, joints = unpack_targets(targets, nf // 3)

    # Objective: diagonal but for the feet in the air.
    motion_hessian = hessian[acceleration:, acceleration:]
    motion_gradient = gradient[acceleration:]
    motion_hessian[:] = 0.0
    wanted = np.empty(nv)
    wanted_acceleration(v, rotation, body, orientation, joints, wanted)
    for i in range(nv):
        weight = motion_task(i, weights)
        motion_hessian[i, i] = weight
        motion_gradient[i] = -weight * wanted[i]
    for c in range(nt):
        hessian[c, c] = weights[4]
    for c in range(nf):
        hessian[force + c, force + c] = weights[5]
        if held[c // 3] == 0.0:
            add_task(weights[2], foot_jacobian[c], feet[c] - foot_drift[c], motion_hessian, motion_gradient)
    mirror(motion_hessian, nv)

    # Floating-base rows of the dynamics; feet held, or without force; joint rows of the dynamics within the torques.
    for i in range(6):
        for c in range(nt):
            equality[i, c] = -thruster_jacobian[c, i]
        for c in range(nf):
            equality[i, force + c] = -foot_jacobian[c, i]
        for j in range(nv):
            equality[i, acceleration + j] = mass_matrix[i, j]
        equality_value[i] = -bias[i]
    for c in range(nf):
        on = held[c // 3] != 0.0
        equality[6 + c, force + c] = 0.0 if on else 1.0
        for j in range(nv):
            equality[6 + c, acceleration + j] = foot_jacobian[c, j] if on else 0.0
        equality_value[6 + c] = feet[c] - foot_drift[c] if on else 0.0
    force_bounds(held, force_range, faces, lower[force:], upper[force:])
    start = force + (faces + 1) * (nf // 3)
    for j in range(nv - 6):
        row = inequality[start + j]
        for c in range(nt):
            row[c] = -thruster_jacobian[c, 6 + j]
        for c in range(nf):
            row[force + c] = -foot_jacobian[c, 6 + j]
        for i in range(nv):
            row[acceleration + i] = mass_matrix[6 + j, i]
        offset[j] = bias[6 + j] + damping[6 + j] * v[6 + j]
        lower[start + j] = -torque_limit[j] - offset[j]
        upper[start + j] = torque_limit[j] - offset[j]
