"""The contact-force filter's computation; see :mod:`harpy_pin.governors.contact_force_filter`."""

from __future__ import annotations

import numpy as np

from harpy_pin.governors.contact_force_parameters import ContactForceFilterParameters
from harpy_pin.governors.governor import StatusRecord
from harpy_pin.ground.contact_frame import (
    all_upward,
    contact_frames,
    is_level,
    to_worlds,
    turn_feet,
)
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.contact_map import (
    ContactMapRecord,
    contact_gain,
    sticking_force,
    unconstrained_drive,
)
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.entry import (
    FADE,
    GOOD,
    HOLD_TICKS,
    MISFIT,
    all_finite,
    all_possible,
    all_possible_rows,
)
from harpy_pin.model.record import ZERO, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms

BAD_STATE, MISFIT_SIZES = -2.0, -3.0
"""What :func:`filter_forces` says of a state, and of arrays that do not fit; −1 is of forces and
commands.
"""


class ContactForceFilterRecord(StatusRecord, ContactForceFilterParameters):
    """What the kernels of the filter know and work in, besides its parameters."""

    bad_in_a_row: int = ZERO  # how many of the last states or commands were bad
    bend_share: float  # share of the way to the target bend in one update
    # (feet,) friction coefficient of each foot: that of the parameters, until it is overwritten
    friction: Vector
    # (feet, 3) normals of the ground at the feet, upwards, of length one: vertical until
    # overwritten
    normal: Vector
    frame: Vector = sized(
        "feet", 3, 3
    )  # (feet, 3, 3) of the contacts where the ground is not level
    bend: Vector = sized(
        "thrusts + joints"
    )  # (3 thrusters + joints,) δy = [δu; δτ] of the last update, N and N·m
    # (feet, 3) force that sticking demands under the bent command, world axes, N; zero in the air
    force: Vector = sized("feet", 3)
    h_r: Vector = sized("2 feet")  # (2 feet,) rows at the command as given, N
    h_w: Vector = sized("2 feet")  # (2 feet,) rows at the command as bent, N
    target: Vector = sized("thrusts + joints")  # (n_y,) the bend that the lag follows
    desired: Vector = sized(
        "3 feet"
    )  # (3 feet,) change of the force on the feet that touch, packed to the front, N
    # (n_y, 3 feet) L⁻ᵀ Aᵀ with the gain A and the factor L of the Hessian
    lift: Vector = sized("thrusts + joints", "3 feet")
    # (n_y, n_y) of the cost of a bend; then its factor L
    hessian: Vector = sized("thrusts + joints", "thrusts + joints")
    schur: Vector = sized(
        "3 feet", "3 feet"
    )  # (3 feet, 3 feet) matrix of the multipliers' equations


@kernel
def friction_limit(mu: float, share: float, margin: float, normal: float) -> float:
    """Largest tangential force in the tightened cone, N: share μ f_z − margin, and at least a fifth
    of μ f_z.

    So the cone has an inside where the normal force is small, too.
    """
    return max(share * mu * normal - margin, 0.2 * mu * normal)


@kernel
def into_cone(
    force: Vector, mu: float, share: float, margin: float, least: float, out: Vector
) -> None:
    """The force with its normal part at least ``least`` and its tangential part shortened into the
    tightened cone.
    """
    normal = max(force[2], least)
    limit = friction_limit(mu, share, margin, normal)
    tangential = np.sqrt(force[:2] @ force[:2])
    scale = limit / tangential if tangential > limit else 1.0
    out[:] = scale * force[0], scale * force[1], normal


@kernel
def cone_rows(force: Vector, mu: float) -> Vector:
    """What a foot's force (3,) keeps: the friction margin μ f_z − |f_t| and f_z, N."""
    return np.array([mu * force[2] - np.sqrt(force[:2] @ force[:2]), force[2]])


@kernel
def hold_forces(
    d: DynamicsRecord,
    w: ContactMapRecord,
    g: ContactForceFilterRecord,
    v: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> float:
    """One tick, see :meth:`harpy_pin.governors.ContactForceFilter.update`, on arrays that fit.

    Returns:
        The violation left at the changed command, N; −1, with nothing done, where a number is not
        finite, or beyond ``MAX_SAMPLE``.
    """
    if not (all_possible(torque) and all_possible_rows(thrust) and all_possible_rows(foot_force)):
        return -1.0
    if not all_upward(g.normal):
        return -1.0
    level = is_level(g.normal)
    if not level:
        contact_frames(g.normal, g.frame)
        turn_feet(d, g.frame)
    count = demand(d, w, g, v, foot_force, torque, thrust)
    g.target[:] = 0.0
    if _missing(d, w, g, count) > 1e-9:
        contact_gain(d, w, count)
        _lift_change(d, w, g, count)
        if all_finite(g.target):
            _within_authority(d, g)
        else:
            g.target[:] = 0.0
    _bend(d, w, g, torque, thrust)
    excess = _remaining(w, g, count)
    if not level:
        to_worlds(g.frame, g.force)
    return excess


@kernel
def filter_forces(
    d: DynamicsRecord,
    w: ContactMapRecord,
    g: ContactForceFilterRecord,
    q: Vector,
    v: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> float:
    """Terms of a state, then :func:`answer_terms`, which says what is returned."""
    verdict = update_terms(d, q, v)
    return answer_terms(d, w, g, verdict, v, foot_force, torque, thrust)


@kernel
def answer_terms(
    d: DynamicsRecord,
    w: ContactMapRecord,
    g: ContactForceFilterRecord,
    verdict: int,
    v: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> float:
    """:func:`hold_forces`; after a bad state or command the last change, which fades.

    ``verdict`` is what :func:`~harpy_pin.model.terms.update_terms` said of the state; torques and
    thrusts are changed in place. Returns the violation left, N; ``BAD_STATE`` for a state that no
    robot can have, −1 for such forces or a command, and ``MISFIT_SIZES``, with nothing done, where
    an array does not fit.
    """
    if verdict == MISFIT or foot_force.shape != g.force.shape:
        return MISFIT_SIZES
    if (
        thrust.shape != (d.thruster_jacobian.shape[0] // 3, 3)
        or torque.shape[0] + thrust.size != g.bend.shape[0]
    ):
        return MISFIT_SIZES
    excess = BAD_STATE
    if verdict == GOOD:
        excess = hold_forces(d, w, g, v, foot_force, torque, thrust)
    if excess >= 0.0:
        g.bad_in_a_row = 0
        g.infeasible, g.least_violation = excess > 0.0, excess
        return excess
    g.bad_samples += 1
    g.bad_in_a_row += 1
    g.infeasible, g.least_violation = 1, np.inf
    factor = FADE ** float(max(g.bad_in_a_row - HOLD_TICKS, 0))
    thrusts = thrust.reshape(thrust.size)
    thrusts += factor * g.bend[: thrust.size]
    torque += factor * g.bend[thrust.size :]
    return excess


@kernel
def demand(
    d: DynamicsRecord,
    w: ContactMapRecord,
    g: ContactForceFilterRecord,
    v: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> int:
    """Force that sticking demands of the feet that touch, at the command as given; returns its
    directions.
    """
    g.h_r[:] = g.h_w[:] = np.inf
    g.force[:] = 0.0
    count = 0
    for k in range(foot_force.shape[0]):
        if g.normal[k] @ foot_force[k] > g.contact_threshold:
            w.rows[count : count + 3] = 3 * k, 3 * k + 1, 3 * k + 2
            drift = d.foot_drift[3 * k : 3 * k + 3]
            w.settling[count : count + 3] = -drift - g.contact_damping * d.foot_velocity[k]
            count += 3
    unconstrained_drive(d, v, torque, thrust.reshape(thrust.size), w.drive)
    sticking_force(d, w, count)
    return count


@kernel
def _missing(
    d: DynamicsRecord, w: ContactMapRecord, g: ContactForceFilterRecord, count: int
) -> float:
    """Change ``desired`` that brings each force into its cone; returns the sum of its magnitudes,
    N.
    """
    for c in range(0, count, 3):
        k = w.rows[c] // 3
        force, desired = w.force[c : c + 3], g.desired[c : c + 3]
        into_cone(force, g.friction[k], g.friction_share, g.margin, g.min_normal_force, desired)
        g.h_r[2 * k : 2 * k + 2] = cone_rows(force, g.friction[k])
        # The faster a foot slides, the less its force is corrected.
        speed = np.sqrt(d.foot_velocity[k, :2] @ d.foot_velocity[k, :2])
        desired[:] = np.clip(2.0 - speed / g.sliding_speed, 0.0, 1.0) * (desired - force)
    return float(np.sum(abs(g.desired[:count])))


@kernel
def _lift_change(
    d: DynamicsRecord, w: ContactMapRecord, g: ContactForceFilterRecord, count: int
) -> None:
    """δy = H⁻¹ Aᵀ (A H⁻¹ Aᵀ)⁻¹ δf with H = Rᵀ W_a R + W_y, R the response of body and swing
    feet.
    """
    hessian, lift, response = g.hessian, g.lift[:, :count], w.response
    ny, nt = hessian.shape[0], d.thruster_jacobian.shape[0]
    weight = np.array([*g.linear, *g.angular])
    hessian[:] = response[:6].T @ (weight[:, None] * response[:6])
    diagonal(hessian)[:nt] += g.thrust
    diagonal(hessian)[nt:] += g.torque
    c = 0
    for r in range(d.foot_jacobian.shape[0]):
        if c < count and w.rows[c] == r:
            c += 1
        else:  # of a swing foot
            motion = d.foot_jacobian[r] @ response
            hessian += np.outer(g.swing * motion, motion)
    factorise(hessian, hessian)
    lift[:] = w.gain[:count].T
    solve_transposed(hessian, lift, count)
    normal, multiplier = g.schur[:count, :count], g.desired[:count]
    normal[:] = lift.T @ lift
    factorise(normal, normal, 1e-12)
    solve_vector(normal, multiplier)
    g.target[:] = lift @ multiplier
    solve_factor(hessian, g.target.reshape((ny, 1)), 1)


@kernel
def _within_authority(d: DynamicsRecord, g: ContactForceFilterRecord) -> None:
    """Shorten the target of the bend as a whole, so that it keeps its direction."""
    nt = d.thruster_jacobian.shape[0]
    thrust, torque = np.max(abs(g.target[:nt])), np.max(abs(g.target[nt:]))
    g.target *= min(1.0, g.thrust_authority / thrust, g.torque_authority / torque)


@kernel
def _bend(
    d: DynamicsRecord,
    w: ContactMapRecord,
    g: ContactForceFilterRecord,
    torque: Vector,
    thrust: Vector,
) -> None:
    """Move the bend towards its target, add it to the command, and leave its generalised force in
    ``w.drive``.

    The lag bounds the rate with which a contact switch changes the command.
    """
    nt = d.thruster_jacobian.shape[0]
    g.bend += g.bend_share * (g.target - g.bend)
    thrusts = thrust.reshape(thrust.size)
    thrusts += g.bend[:nt]
    torque += g.bend[nt:]
    w.drive[:] = d.thruster_jacobian.T @ g.bend[:nt]
    w.drive[w.drive.shape[0] - g.bend[nt:].shape[0] :] += g.bend[nt:]


@kernel
def _remaining(w: ContactMapRecord, g: ContactForceFilterRecord, count: int) -> float:
    """Force f + A δy at the bent command, its margins, and the largest violation left, N."""
    solve_transposed(w.factor, w.drive.reshape((w.drive.shape[0], 1)), 1)
    change = g.desired[:count]
    change[:] = -(w.contact[:, :count].T @ w.drive)
    solve_vector(w.delassus[:count, :count], change)
    for c in range(0, count, 3):
        k = w.rows[c] // 3
        g.force[k] = w.force[c : c + 3] + g.desired[c : c + 3]
        g.h_w[2 * k : 2 * k + 2] = cone_rows(g.force[k], g.friction[k])
    least = np.min(g.h_w)
    return np.inf if np.isnan(least) else max(-least, 0.0)
