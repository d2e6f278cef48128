"""Thrusts and torques as functions of the contact forces (:mod:`harpy_pin.wbc.condensed.condense`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import solve_factor
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.centre import root_per_unit
from harpy_pin.wbc.condensed.root import joint_torques, recover

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.condensed.condense import CondensationRecord
    from harpy_pin.wbc.weights import TargetsRecord

__all__: list[str] = []


@kernel
def input_map(
    d: DynamicsRecord,
    t: TargetsRecord,
    r: CondensationRecord,
    v: Vector,
    response: Vector,
    gain: Vector,
    at_rest: Vector,
    fixed: bool,
) -> None:
    """Thrusts and torques as an affine function of the contact forces: [u; τ] = at_rest + gain f.

    With all of o fixed at zero, they are a function of y = [u; …], which holds the force of a stance foot and the free
    acceleration of a swing foot: [u; τ] = at_rest + gain y. Between them are the free accelerations ε.

    Args:
        d: element of the dynamics' record.
        t: of the targets' record.
        r: of the equations' record, factored.
        v: (nv,) generalised velocity.
        response: (6, n) L⁻ᵀ G of these variables; becomes K⁻¹ G.
        gain: (thrusts + joints, n) out; zero columns for the forces of swing feet.
        at_rest: (thrusts + joints,) out.
        fixed: whether all of o is.
    """
    n, thrusts = response.shape[1], d.thruster_jacobian.shape[0]
    first = thrusts + r.others.shape[0]
    nothing = np.zeros(n - first if fixed else n)
    recover(r, nothing)
    for c in range(thrusts):
        at_rest[c] = r.free_acceleration[c]
    joint_torques(d, r, v, nothing, at_rest[thrusts:])
    solve_factor(r.factor, response, n)
    _free_per_unit(t, r, response, first, fixed)
    _motion_per_unit(t, r, response, thrusts)
    _input_per_unit(d, t, r, gain, first if fixed else 0)


@kernel
def _free_per_unit(t: TargetsRecord, r: CondensationRecord, response: Vector, first: int, fixed: bool) -> None:
    """Entries of o per unit of each variable, into ``free_per_unit``."""
    free, n = r.free_per_unit, response.shape[1]
    for c in range(r.inverse_weight.shape[0]):
        for a in range(n):
            free[c, a] = 0.0
        if r.inverse_weight[c] != 0.0:
            for i in range(6):
                x = -r.inverse_weight[c] * r.free_map[i, c]
                for a in range(n):
                    free[c, a] += x * response[i, a]
        elif fixed and (c < first or t.held[(c - first) // 3] == 0.0):
            free[c, c] = 1.0


@kernel
def _motion_per_unit(t: TargetsRecord, r: CondensationRecord, response: Vector, thrusts: int) -> None:
    """Generalised accelerations per unit of each variable, into ``motion_per_unit``."""
    free, motion, n = r.free_per_unit, r.motion_per_unit, response.shape[1]
    for j in range(6):
        for a in range(n):
            motion[j, a] = 0.0
        for i in range(6):
            x = r.inverse_body_weight[j] * r.mass[i, j]
            for a in range(n):
                motion[j, a] += x * response[i, a]
    if r.centred:
        root_per_unit(r, n)
    others = r.others.shape[0]
    first = thrusts + others
    for c in range(others):
        row = r.others[c]
        for a in range(n):
            motion[row, a] = free[thrusts + c, a]
    limbs, joints, rows = r.inverse.shape
    for k in range(limbs):
        held = t.held[rows * k // 3] != 0.0
        for b in range(joints):
            row = r.limb[k, b]
            for a in range(n):
                motion[row, a] = 0.0
            for j in range(6):
                x = r.limb_map[k, b, j]
                for a in range(n):
                    motion[row, a] += x * motion[j, a]
            if not held:
                for j in range(rows):
                    x = r.inverse[k, b, j]
                    for a in range(n):
                        motion[row, a] += x * free[first + rows * k + j, a]


@kernel
def _input_per_unit(d: DynamicsRecord, t: TargetsRecord, r: CondensationRecord, gain: Vector, first: int) -> None:
    """Thrusts and torques per unit of each variable; the columns of the feet begin at ``first``."""
    free, motion, n = r.free_per_unit, r.motion_per_unit, gain.shape[1]
    nv, thrusts = d.bias.shape[0], d.thruster_jacobian.shape[0]
    for c in range(thrusts):
        for a in range(n):
            gain[c, a] = free[c, a]
    for j in range(6, nv):
        row = thrusts + j - 6
        for a in range(n):
            gain[row, a] = 0.0
        for i in range(nv):
            x = d.mass_matrix[j, i]
            if x != 0.0:  # limbs do not feel each other
                for a in range(n):
                    gain[row, a] += x * motion[i, a]
        for c in range(thrusts):
            x = d.thruster_jacobian[c, j]
            if x != 0.0:
                for a in range(n):
                    gain[row, a] -= x * free[c, a]
    limbs, joints, rows = r.inverse.shape
    for k in range(limbs):
        if t.held[rows * k // 3] != 0.0:
            for b in range(joints):
                j = r.limb[k, b]
                for a in range(rows):
                    gain[thrusts + j - 6, first + rows * k + a] -= d.foot_jacobian[rows * k + a, j]
