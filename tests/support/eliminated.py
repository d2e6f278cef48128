"""The whole-body problem with the accelerations eliminated by the mass matrix, in plain NumPy: an oracle.

z = [u; τ; s; f] and a = M⁻¹ (J_tᵀ u + S τ + J_fᵀ f − n − B v); equalities: a triple for each foot; torques are bounds.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin.wbc.problem import WholeBodyProblem
from harpy_pin.wbc.program import QuadraticProgram


class EliminatedProblem(WholeBodyProblem):
    """Agrees with every formulation of the library, and shares none of their kernels."""

    name: ClassVar[str] = "eliminated"

    def _allocate(self):
        inputs = self.n_thrust + self.joints
        bounded = inputs + self.n_slack
        program = QuadraticProgram(
            bounded + self.n_force, equalities=self.n_force, inequalities=self.foot_rows * self.feet, bounded=bounded
        )
        self._bound(program, torque=True, slack=inputs)
        self._friction(program, force=bounded)
        return program

    def build(self, dynamics, v, rotation, targets):
        p, w, d = self.program, self.weights, dynamics
        inputs, force = self.n_thrust + self.joints, p.bounded
        size, nv = len(p.gradient), self.nv
        columns = np.zeros((nv, size))
        columns[:, : self.n_thrust] = d.thruster_jacobian.T
        columns[6:, self.n_thrust : inputs] = np.eye(self.joints)
        columns[:, force:] = d.foot_jacobian.T
        mass = np.tril(d.mass_matrix) + np.tril(d.mass_matrix, -1).T
        self._response = np.linalg.solve(mass, columns)
        self._drift = np.linalg.solve(mass, -d.bias - self.robot.model.damping * v)

        desired = np.concatenate(
            (rotation.T @ targets.body - np.cross(v[3:6], v[:3]), targets.orientation, targets.joints)
        )
        weights = np.repeat((w.body, w.orientation, w.posture), (3, 3, nv - 6))
        weighted = weights[:, None] * self._response
        slack = np.zeros(size)
        slack[inputs:force] = self.limits.slack
        own = np.diag(1e-3 * slack)
        p.hessian[:] = own + self._response.T @ weighted
        p.gradient[:] = slack - weighted.T @ (desired - self._drift)
        p.hessian[range(self.n_thrust), range(self.n_thrust)] += w.thrust
        p.hessian[range(force, size), range(force, size)] += w.force

        for k in range(self.feet):
            foot, own_force = slice(3 * k, 3 * k + 3), slice(force + 3 * k, force + 3 * k + 3)
            motion = d.foot_jacobian[foot] @ self._response
            value = targets.feet[k] - d.foot_drift[foot] - d.foot_jacobian[foot] @ self._drift
            rows = slice(force + self.foot_rows * k, force + self.foot_rows * (k + 1))
            if targets.held[k]:
                p.equality[foot], p.equality_value[foot] = motion, value
                p.lower[rows] = [*np.zeros(self.foot_rows - 1), targets.force_range[k, 0]]
                p.upper[rows.stop - 1] = targets.force_range[k, 1]
            else:
                p.hessian += w.swing * motion.T @ motion
                p.gradient -= w.swing * motion.T @ value
                p.equality[foot], p.equality_value[foot] = 0.0, 0.0
                p.equality[foot, own_force] = np.eye(3)
                p.lower[rows], p.upper[rows.stop - 1] = -1.0, 1.0

    def acceleration(self, z):
        return self._response @ z + self._drift

    def contact_force(self, z):
        return z[self.program.bounded :].reshape(-1, 3).copy()
