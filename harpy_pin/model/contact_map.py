"""The true contact force as an affine map of what the robot is commanded (equations.md W9).

Feet that touch are taken to stick: J_f a + J̇ v = −κ v_foot. With M a + n + B v = X y + J_fᵀ f, y =
[u; τ] the thrusts and joint torques and X = [J_tᵀ S], the force on them is affine in the command:

    f(y) = −Λ ( J_f M⁻¹ (X y − n − B v) + J̇ v + κ v_foot ) = f₀ + A y
    Λ = (J_f M⁻¹ J_fᵀ)⁻¹,   A = −Λ J_f M⁻¹ X = [G H]

G acts from the thrusts, H from the joint torques. It is the force that *sticking demands*: a foot
slides where it leaves Coulomb's cone. A change δy changes the accelerations by M⁻¹ (X + J_fᵀ A) δy.

Contacts are redundant where D = J_f M⁻¹ J_fᵀ is singular: points in one place, or more than three
on one rigid body. Then no force is the only one, and feet that turn may ask for accelerations that
no rigid body has. In these states alone Λ is (D² + ε²)⁻¹ D, nearly D's pseudo-inverse: the least
forces that come closest to what the feet ask for, never more than 1/(2ε) times that. All forces
that give the feet these accelerations move the robot alike, so that torques do not depend on the
choice as long as no corner leaves its pyramid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.cholesky import (
    add_gram,
    add_product,
    factorise,
    solve_factor,
    solve_transposed,
    solve_vector,
)
from harpy_pin.model.dynamics import DynamicsRecord, EquationsRecord
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

REDUNDANT = 1e-5
"""Contacts are redundant where a pivot of J_f M⁻¹ J_fᵀ is below this share of its largest diagonal
entry; ε is the same share. In a walk of Harpy no pivot is below a third.
"""


class ContactMapRecord(RecordOf):
    """What the kernels of this module share."""

    # indices of the foot directions that touch, packed to the front
    rows: NDArray[np.int64] = sized("3 feet", whole=True)
    factor: Vector = sized("nv", "nv")  # factor L of M = Lᵀ L (:mod:`harpy_pin.model.cholesky`)
    contact: Vector = sized("nv", "3 feet")  # L⁻ᵀ J_fᵀ, one column per touching direction
    inputs: Vector = sized("nv", "thrusts + joints")  # L⁻ᵀ X, one column per input
    response: Vector = sized(
        "nv", "thrusts + joints"
    )  # M⁻¹ (X + J_fᵀ A), change of the acceleration per input
    gain: Vector = sized("3 feet", "thrusts + joints")  # A of the touching directions
    # factor of D = J_f M⁻¹ J_fᵀ, stored like the other; that of D² + ε² if redundant
    delassus: Vector = sized("3 feet", "3 feet")
    redundant: int = ZERO  # 1 where the contacts are redundant, else 0
    drive: Vector = sized("nv")  # L⁻ᵀ (X y − n − B v)
    settling: Vector = sized("3 feet")  # −J̇ v − κ v_foot, m/s²; packed to the front
    force: Vector = sized("3 feet")  # f(y) of the touching directions, N


def contact_terms(robot: Robot) -> Records[ContactMapRecord]:
    """A new :class:`ContactMapRecord`."""
    return make_record(ContactMapRecord, robot.sizes)


@kernel
def unconstrained_drive(
    d: EquationsRecord, v: Vector, torque: Vector, thrust: Vector, drive: Vector
) -> None:
    """X y − n − B v: the generalised force without that of the ground, from a record of
    :class:`Dynamics`.

    ``thrust`` are the thrust variables, see :mod:`harpy_pin.model.rotor`.
    """
    drive[:] = -d.bias - d.damping * v + d.thruster_jacobian.T @ thrust
    drive[v.shape[0] - torque.shape[0] :] += torque


@kernel
def sticking_force(d: DynamicsRecord, w: ContactMapRecord, count: int) -> None:
    """Force that gives the first ``count`` directions in ``w.rows`` the accelerations J a =
    ``w.settling``.

    Fills factor, contact, delassus, redundant and force; turns ``w.drive`` from a generalised force
    into L⁻ᵀ drive.
    """
    rows, drive, contact, force = w.rows, w.drive, w.contact, w.force
    nv = drive.shape[0]
    factorise(d.mass_matrix, w.factor)
    contact[:, :count] = d.foot_jacobian[rows[:count]].T
    solve_transposed(w.factor, contact, count)
    solve_transposed(w.factor, drive.reshape((nv, 1)), 1)
    held = w.delassus[:count, :count]
    held[:] = 0.0
    force[:count] = w.settling[:count]
    add_gram(contact[:, :count], -drive, held, force)
    least = REDUNDANT * np.max(diagonal(held), initial=0.0)
    factorise(held, held, least)
    # where the reciprocal of a pivot is that of the floor
    w.redundant = int(np.any(diagonal(held) ** 2 * least > 0.999))
    if w.redundant:
        _square(contact, held, least)
        _times_delassus(contact, force[:count].reshape((count, 1)))
    solve_vector(held, force[:count])


@kernel
def _times_delassus(contact: Vector, columns: Vector) -> None:
    """Multiply columns (count, any) by D = Cᵀ C, in place."""
    motion, touching = np.empty(contact.shape[0]), contact[:, : columns.shape[0]]
    for y in range(columns.shape[1]):
        motion[:] = touching @ columns[:, y]
        columns[:, y] = touching.T @ motion


@kernel
def _square(contact: Vector, held: Vector, epsilon: float) -> None:
    """Factor of D² + ε²."""
    held[:] = np.eye(held.shape[0])
    _times_delassus(contact, held)
    _times_delassus(contact, held)
    diagonal(held)[:] += epsilon * epsilon
    factorise(held, held)


@kernel
def contact_gain(d: DynamicsRecord, w: ContactMapRecord, count: int) -> None:
    """A and M⁻¹ (X + J_fᵀ A), after :func:`sticking_force`; fills inputs, gain and response."""
    inputs, gain, response, contact = w.inputs, w.gain, w.response, w.contact[:, :count]
    nv, ny = inputs.shape
    nt = d.thruster_jacobian.shape[0]
    inputs[:, :nt] = d.thruster_jacobian.T
    inputs[:, nt:] = 0.0
    diagonal(inputs[nv - ny + nt :, nt:])[:] = 1.0
    solve_transposed(w.factor, inputs, ny)
    gain[:count] = 0.0
    add_product(contact.T, inputs, gain)
    gain[:count] *= -1.0
    held = w.delassus[:count, :count]
    if w.redundant:
        _times_delassus(w.contact, gain[:count])
    solve_transposed(held, gain, ny)
    solve_factor(held, gain, ny)
    response[:] = inputs
    add_product(contact, gain, response)
    solve_factor(w.factor, response, ny)
