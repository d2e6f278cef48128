"""The whole-body problem with the accelerations eliminated by the mass matrix: z = [u; τ; s; f]."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numba import njit

from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.state import Vector
from harpy_pin.wbc.problem import WholeBodyProblem, add_task, force_bounds, mirror, motion_task, wanted_acceleration
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.settings import WholeBodyTargets, unpack_targets

__all__ = ["EliminatedProblem"]


class EliminatedProblem(WholeBodyProblem):
    """a = M⁻¹ (J_tᵀ u + S τ + J_fᵀ f − n − B v); equalities: a triple for each foot; torques are bounds."""

    name: ClassVar[str] = "eliminated"

    def _allocate(self) -> QuadraticProgram:
        inputs = self.n_thrust + self.joints
        bounded = inputs + self.n_slack
        size = bounded + self.n_force
        program = QuadraticProgram(
            size, equalities=self.n_force, inequalities=self.foot_rows * self.feet, bounded=bounded
        )
        self._bound(program, torque=True, slack=inputs)
        self._friction(program, force=bounded)
        self._factor = np.zeros((self.nv, self.nv))
        self._response = np.zeros((self.nv, size + 1))  # M⁻¹ times a column per variable, and the drive
        return program

    def build(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem.build`."""
        p = self.program
        _build(
            *self._given(dynamics, v, rotation, targets),
            p.bounded,
            self.foot_rows - 1,
            self._factor,
            self._response,
            p.hessian,
            p.gradient,
            p.equality,
            p.equality_value,
            p.lower,
            p.upper,
        )

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        return np.asarray(self._response[:, :-1] @ z + self._response[:, -1])

    def contact_force(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.contact_force`."""
        return z[self.program.bounded :].reshape(-1, 3).copy()


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
    force,
    faces,
    factor,
    response,
    hessian,
    gradient,
    equality,
    equality_value,
    lower,
    upper,
):
    nv = v.shape[0]
    nf = foot_drift.shape[0]
    nt = thruster_jacobian.shape[0]
    n = force + nf
    body, orientation, feet, held, force_range, joints = unpack_targets(targets, nf // 3)

    response[:] = 0.0
    for i in range(nv):
        for c in range(nt):
            response[i, c] = thruster_jacobian[c, i]
        for c in range(nf):
            response[i, force + c] = foot_jacobian[c, i]
        response[i, n] = -bias[i] - damping[i] * v[i]
    for j in range(nv - 6):
        response[6 + j, nt + j] = 1.0
    factorise(mass_matrix, factor)
    solve_transposed(factor, response, n + 1)
    solve_factor(factor, response, n + 1)

    for a in range(n):
        if not nt + nv - 6 <= a < force:  # the slacks' part stays as it is
            gradient[a] = 0.0
            hessian[a, :] = 0.0
    for c in range(nt):
        hessian[c, c] = weights[4]
    for c in range(nf):
        hessian[force + c, force + c] = weights[5]
    wanted = np.empty(nv)
    wanted_acceleration(v, rotation, body, orientation, joints, wanted)
    for i in range(nv):
        weight = motion_task(i, weights)
        add_task(weight, response[i, :n], wanted[i] - response[i, n], hessian, gradient)
    row = np.empty(n + 1)
    for c in range(nf):
        row[:] = 0.0
        for i in range(nv):
            x = foot_jacobian[c, i]
            if x != 0.0:
                for y in range(n + 1):
                    row[y] += x * response[i, y]
        value = feet[c] - foot_drift[c] - row[n]
        on = held[c // 3] != 0.0
        if not on:
            add_task(weights[2], row[:n], value, hessian, gradient)
        for y in range(n):
            equality[c, y] = row[y] if on else 0.0
        if not on:
            equality[c, force + c] = 1.0
        equality_value[c] = value if on else 0.0
    mirror(hessian, n)
    force_bounds(held, force_range, faces, lower[force:], upper[force:])
