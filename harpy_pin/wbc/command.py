"""The whole-body problem in the robot's inputs alone: z = [u; τ; s].

With the held feet's accelerations prescribed, contact forces and accelerations are affine in the inputs
(:mod:`harpy_pin.model.contact_map`, the map that the contact governor uses too): f = f₀ + A y, a = a₀ + R y with
y = [u; τ]. No equality is left, the limits of thrusts and torques are bounds, and only the friction pyramids are rows.

Contact forces and thrusts would do as variables too, but not always: they are twelve numbers on two feet, nine on one,
where the leg in the air keeps three freedoms of its own. The inputs are as many as the freedoms in every support.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numba import njit

from harpy_pin.model.cholesky import solve_factor
from harpy_pin.model.contact_map import ContactTerms, contact_force, contact_gain, unpack_terms
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.state import Vector
from harpy_pin.wbc.problem import WholeBodyProblem, add_task, mirror, motion_task, wanted_acceleration
from harpy_pin.wbc.program import UNBOUNDED, QuadraticProgram
from harpy_pin.wbc.settings import WholeBodyTargets, unpack_targets

__all__ = ["CommandProblem"]


class CommandProblem(WholeBodyProblem):
    """No equalities; bounds on thrusts and torques; the pyramid and the normal force as rows of each foot."""

    name: ClassVar[str] = "command"

    def _allocate(self) -> QuadraticProgram:
        inputs = self.n_thrust + self.joints
        bounded = inputs + self.n_slack
        program = QuadraticProgram(bounded, equalities=0, inequalities=self.foot_rows * self.feet, bounded=bounded)
        self._bound(program, torque=True, slack=inputs)
        self._terms = ContactTerms(self.robot)
        self._count = 0  # directions of the held feet
        return program

    def build(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem.build`."""
        p, w = self.program, self._terms
        self._count = _build(
            *self._given(dynamics, v, rotation, targets),
            self._pyramid,
            w.rows,
            w.work,
            p.hessian,
            p.gradient,
            p.inequality[p.bounded :],
            p.lower[p.bounded :],
            p.upper[p.bounded :],
        )

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        return np.asarray(self._terms.drive + self._terms.response @ z[: self.n_thrust + self.joints])

    def contact_force(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.contact_force`."""
        w, count = self._terms, self._count
        force = np.zeros(self.n_force)
        force[w.rows[:count]] = w.force[:count] + w.gain[:count] @ z[: self.n_thrust + self.joints]
        return force.reshape(-1, 3)


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
    pyramid,
    rows,
    work,
    hessian,
    gradient,
    inequality,
    lower,
    upper,
):
    nv = v.shape[0]
    nf = foot_drift.shape[0]
    nt = thruster_jacobian.shape[0]
    ny = nt + nv - 6
    factor, contact, inputs, response, gain, delassus, free, settling, force = unpack_terms(work, nv, nf, ny)
    body, orientation, feet, held, force_range, joints = unpack_targets(targets, nf // 3)

    # f = f₀ + A y and a = a₀ + R y.
    count = 0
    for c in range(nf):
        if held[c // 3] != 0.0:
            rows[count] = c
            settling[count] = feet[c] - foot_drift[c]
            count += 1
    for i in range(nv):
        free[i] = -bias[i] - damping[i] * v[i]
    contact_force(mass_matrix, foot_jacobian, rows, count, settling, free, factor, contact, delassus, force)
    contact_gain(thruster_jacobian, count, factor, contact, delassus, inputs, gain, response)
    for i in range(nv):
        for a in range(count):
            free[i] += contact[i, a] * force[a]
    solve_factor(factor, free.reshape((nv, 1)), 1)

    # Objective.
    for a in range(ny):
        gradient[a] = 0.0
        for b in range(a + 1):
            hessian[a, b] = 0.0
        if a < nt:
            hessian[a, a] = weights[4]
    wanted = np.empty(nv)
    wanted_acceleration(v, rotation, body, orientation, joints, wanted)
    for i in range(nv):
        weight = motion_task(i, weights)
        add_task(weight, response[i], wanted[i] - free[i], hessian, gradient)
    for a in range(count):
        add_task(weights[5], gain[a], -force[a], hessian, gradient)
    row = np.empty(ny)
    for c in range(nf):
        if held[c // 3] == 0.0:
            row[:] = 0.0
            value = feet[c] - foot_drift[c]
            for i in range(nv):
                x = foot_jacobian[c, i]
                if x != 0.0:
                    value -= x * free[i]
                    for y in range(ny):
                        row[y] += x * response[i, y]
            add_task(weights[2], row, value, hessian, gradient)
    mirror(hessian, ny)

    # Friction pyramids P (f₀ + A y) ≥ 0, and the range of the normal force.
    faces = pyramid.shape[0]
    a = 0
    for k in range(nf // 3):
        first = (faces + 1) * k
        if held[k] == 0.0:
            for r in range(first, first + faces + 1):
                inequality[r, :ny] = 0.0
                lower[r], upper[r] = -1.0, 1.0  # never active
            continue
        along_x, along_y, up = gain[a], gain[a + 1], gain[a + 2]
        for r in range(faces):
            x, y, z = pyramid[r, 0], pyramid[r, 1], pyramid[r, 2]
            out = inequality[first + r]
            for c in range(ny):
                out[c] = x * along_x[c] + y * along_y[c] + z * up[c]
            lower[first + r] = -(x * force[a] + y * force[a + 1] + z * force[a + 2])
            upper[first + r] = UNBOUNDED
        last = first + faces
        for c in range(ny):
            inequality[last, c] = up[c]
        lower[last] = force_range[2 * k] - force[a + 2]
        upper[last] = force_range[2 * k + 1] - force[a + 2]
        a += 3
    return count
