"""The contact-force filter's settings and computation; see :mod:`harpy_pin.governors.contact_force_filter`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.gaits.fitting import leg_length
from harpy_pin.gaits.straight import TUNED_MASS
from harpy_pin.governors.governor import StatusRecord
from harpy_pin.ground.contact_frame import all_upward, contact_frame, is_level, to_world, turn_feet
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.contact_map import ContactMapRecord, contact_gain, sticking_force, unconstrained_drive
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.entry import FADE, GOOD, HOLD_TICKS, MISFIT, all_finite, all_possible, all_possible_rows
from harpy_pin.model.record import ZERO, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms

TUNED_LEG = 0.7000000000000001
"""Length of Harpy's legs, m, by :func:`~harpy_pin.gaits.fitting.leg_length`."""
BAD_STATE, MISFIT_SIZES = -2.0, -3.0
"""What :func:`filter_forces` says of a state, and of arrays that do not fit; −1 is of forces and commands."""


@dataclass(frozen=True, kw_only=True)
class ContactForceFilterParameters:
    """Settings of :class:`~harpy_pin.governors.ContactForceFilter`; the defaults are Harpy's.

    For another robot :meth:`for_robot` scales them. The weights were found by a random search over slip on walks at
    friction 0.2, 0.15 and 0.1, without pushes (``docs/limitations.md``); its script was not kept.

    Attributes:
        mu: friction coefficient μ_s of the ground.
        friction_share: share of μ that is used; 1 − share is the known relative error of μ.
        margin: N kept between the tangential force and the cone, for the error of the predicted force.
        min_normal_force: least normal force of a foot that touches, N.
        contact_threshold: measured normal force that counts as touching, N.
        contact_damping: κ, rate at which a touching foot is taken to come to rest, 1/s.
        linear: weights on the change of the body's linear acceleration, body axes, s⁴/m².
        angular: weights on that of its angular acceleration, body axes, s⁴/rad².
        swing: weight on that of a foot in the air.
        thrust: weight on the change of each thrust, 1/N².
        torque: weight on the change of each torque, 1/(N·m)².
        thrust_authority: largest change of any component of a thrust, N.
        torque_authority: largest change of a torque, N·m; of a joint target with stiffness K_p, this over K_p.
        lag: time constant with which the change follows its target, s; zero for none. It bounds the rate of the change
            by twice the authority over the lag, so that a contact switch does not make the command jump.
        sliding_speed: speed of a foot from which on its force is corrected less, m/s; not at all from twice this speed
            on. No force inside the cone makes a sliding foot stick, and attempts make the walk worse.
    """

    mu: float = 0.25
    friction_share: float = 0.95
    margin: float = 0.2
    min_normal_force: float = 1.0
    contact_threshold: float = 1.0
    contact_damping: float = 100.0
    linear: tuple[float, float, float] = (0.04, 1.0, 0.1)
    angular: tuple[float, float, float] = (0.015, 2e-6, 0.0075)
    swing: float = 5.0
    thrust: float = 1e-5
    torque: float = 1e-2
    thrust_authority: float = 40.0
    torque_authority: float = 7.5
    lag: float = 0.002
    sliding_speed: float = 0.07

    def __post_init__(self) -> None:
        checks.number("mu", self.mu, low=0.0)
        checks.number("friction_share", self.friction_share, low=0.0, high=1.0, strict=True)
        checks.numbers(
            self, "margin", "min_normal_force", "contact_threshold", "contact_damping", "swing", "lag", low=0.0
        )
        checks.gains("linear", self.linear)
        checks.gains("angular", self.angular)
        checks.numbers(
            self, "thrust", "torque", "thrust_authority", "torque_authority", "sliding_speed", low=0.0, strict=True
        )

    @classmethod
    @checked
    def for_robot(cls, robot: Robot, *, mu: float = 0.25) -> ContactForceFilterParameters:
        """Settings for a robot: Harpy's, scaled with its mass m and the length l of its legs.

        Forces scale with m, torques with m l, the weights on their squares with one over the square of that, and those
        on squared angular accelerations with l².

        Args:
            robot: any; where it has no legs, only its mass counts.
            mu: friction coefficient μ_s of the ground.
        """
        plain, mass, leg = cls(mu=mu), robot.mass / TUNED_MASS, (leg_length(robot) or TUNED_LEG) / TUNED_LEG
        x, y, z = plain.angular
        return replace(
            plain,
            margin=plain.margin * mass,
            min_normal_force=plain.min_normal_force * mass,
            contact_threshold=plain.contact_threshold * mass,
            angular=(x * leg**2, y * leg**2, z * leg**2),
            thrust=plain.thrust / mass**2,
            torque=plain.torque / (mass * leg) ** 2,
            thrust_authority=plain.thrust_authority * mass,
            torque_authority=plain.torque_authority * mass * leg,
        )

    @classmethod
    @checked
    def robust(
        cls,
        *,
        mu: float,
        friction_error: float = 0.05,
        force_error: float = 0.2,
        mass_error: float = 0.0,
        delay: float = 0.0,
        load: float = 40.0,
        force_rate: float = 200.0,
    ) -> ContactForceFilterParameters:
        """Settings tightened for known bounds on errors, in newtons.

        The force on a foot differs from the predicted one by at most δ = e_f + ε_m F + T Ḟ. Friction then holds if
        |f_t| + δ ≤ (1 − ε_μ) μ (f_z − δ), which is the cone with share 1 − ε_μ and margin (1 + (1 − ε_μ) μ) δ.

        Args:
            mu: nominal μ_s.
            friction_error: ε_μ, relative.
            force_error: e_f, error of the prediction itself, N.
            mass_error: ε_m, relative.
            delay: T, between measurement and action, s.
            load: F, largest force on a foot, N; by default Harpy's weight.
            force_rate: Ḟ, how fast the force on a foot changes away from impacts, N/s.

        Raises:
            InputError: a bound is negative, or the friction error is not below one.
        """
        share = 1.0 - checks.number("friction_error", friction_error, low=0.0, high=0.999)
        error = (
            checks.number("force_error", force_error, low=0.0)
            + checks.number("mass_error", mass_error, low=0.0) * checks.number("load", load, low=0.0)
            + checks.number("delay", delay, low=0.0) * checks.number("force_rate", force_rate, low=0.0)
        )
        return cls(mu=mu, friction_share=share, margin=(1.0 + share * mu) * error)


class ContactForceFilterRecord(StatusRecord, ContactForceFilterParameters):
    """What the kernels of the filter know and work in, besides its parameters."""

    bad_in_a_row: int = ZERO  # how many of the last states or commands were bad
    bend_share: float  # share of the way to the target bend in one update
    friction: Vector  # (feet,) friction coefficient of each foot: that of the parameters, until it is overwritten
    normal: Vector  # (feet, 3) normals of the ground at the feet, upwards, of length one: vertical until overwritten
    frame: Vector = sized("feet", 3, 3)  # (feet, 3, 3) of the contacts where the ground is not level
    bend: Vector = sized("thrusts + joints")  # (3 thrusters + joints,) δy = [δu; δτ] of the last update, N and N·m
    # (feet, 3) force that sticking demands under the bent command, world axes, N; zero in the air
    force: Vector = sized("feet", 3)
    h_r: Vector = sized("2 feet")  # (2 feet,) rows at the command as given, N
    h_w: Vector = sized("2 feet")  # (2 feet,) rows at the command as bent, N
    target: Vector = sized("thrusts + joints")  # (n_y,) the bend that the lag follows
    desired: Vector = sized("3 feet")  # (3 feet,) change of the force on the feet that touch, packed to the front, N
    # (n_y, 3 feet) L⁻ᵀ Aᵀ with the gain A and the factor L of the Hessian
    lift: Vector = sized("thrusts + joints", "3 feet")
    # (n_y, n_y) of the cost of a bend; then its factor L
    hessian: Vector = sized("thrusts + joints", "thrusts + joints")
    schur: Vector = sized("3 feet", "3 feet")  # (3 feet, 3 feet) matrix of the multipliers' equations


@kernel
def friction_limit(mu: float, share: float, margin: float, normal: float) -> float:
    """Largest tangential force in the tightened cone, N: share μ f_z − margin, and at least a fifth of μ f_z.

    So the cone has an inside where the normal force is small, too.
    """
    return max(share * mu * normal - margin, 0.2 * mu * normal)


@kernel
def into_cone(force: Vector, mu: float, share: float, margin: float, least: float, out: Vector) -> None:
    """The force with its normal part at least ``least`` and its tangential part shortened into the tightened cone."""
    normal = max(force[2], least)
    limit = friction_limit(mu, share, margin, normal)
    tangential = np.sqrt(force[0] * force[0] + force[1] * force[1])
    scale = limit / tangential if tangential > limit else 1.0
    out[0] = scale * force[0]
    out[1] = scale * force[1]
    out[2] = normal


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
        The violation left at the changed command, N; −1, with nothing done, where a number is not finite, or beyond
        ``MAX_SAMPLE``.
    """
    if not (all_possible(torque) and all_possible_rows(thrust) and all_possible_rows(foot_force)):
        return -1.0
    if not all_upward(g.normal):
        return -1.0
    level = is_level(g.normal)
    if not level:
        for k in range(g.frame.shape[0]):
            contact_frame(g.normal[k, 0], g.normal[k, 1], g.normal[k, 2], g.frame[k])
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
        for k in range(g.frame.shape[0]):
            to_world(g.frame[k], g.force[k])
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

    ``verdict`` is what :func:`~harpy_pin.model.terms.update_terms` said of the state; torques and thrusts are changed
    in place. Returns the violation left, N; ``BAD_STATE`` for a state that no robot can have, −1 for such forces or a
    command, and ``MISFIT_SIZES``, with nothing done, where an array does not fit.
    """
    if verdict == MISFIT or foot_force.shape != g.force.shape:
        return MISFIT_SIZES
    if thrust.shape != (d.thruster_jacobian.shape[0] // 3, 3) or torque.shape[0] + thrust.size != g.bend.shape[0]:
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
    for k in range(thrust.shape[0]):
        for i in range(3):
            thrust[k, i] += factor * g.bend[3 * k + i]
    for j in range(torque.shape[0]):
        torque[j] += factor * g.bend[thrust.size + j]
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
    """Force that sticking demands of the feet that touch, at the command as given; returns its directions."""
    count = 0
    for k in range(foot_force.shape[0]):
        g.h_r[2 * k] = g.h_r[2 * k + 1] = g.h_w[2 * k] = g.h_w[2 * k + 1] = np.inf
        for i in range(3):
            g.force[k, i] = 0.0
        n, f = g.normal[k], foot_force[k]
        push = f[2] if n[0] == 0.0 and n[1] == 0.0 else n[0] * f[0] + n[1] * f[1] + n[2] * f[2]
        if push > g.contact_threshold:
            for i in range(3):
                w.rows[count + i] = 3 * k + i
                w.settling[count + i] = -d.foot_drift[3 * k + i] - g.contact_damping * d.foot_velocity[k, i]
            count += 3
    unconstrained_drive(d, v, torque, thrust.reshape(thrust.size), w.drive)
    sticking_force(d, w, count)
    return count


@kernel
def _missing(d: DynamicsRecord, w: ContactMapRecord, g: ContactForceFilterRecord, count: int) -> float:
    """Change ``desired`` that brings each force into its cone; returns the sum of its magnitudes, N."""
    force, desired = w.force, g.desired
    change = 0.0
    for c in range(0, count, 3):
        k = w.rows[c] // 3
        into_cone(force[c : c + 3], g.friction[k], g.friction_share, g.margin, g.min_normal_force, desired[c : c + 3])
        g.h_r[2 * k] = g.friction[k] * force[c + 2] - np.sqrt(force[c] ** 2 + force[c + 1] ** 2)
        g.h_r[2 * k + 1] = force[c + 2]
        # The faster a foot slides, the less its force is corrected.
        speed = np.sqrt(d.foot_velocity[k, 0] ** 2 + d.foot_velocity[k, 1] ** 2)
        share = min(max(2.0 - speed / g.sliding_speed, 0.0), 1.0)
        for i in range(3):
            desired[c + i] = share * (desired[c + i] - force[c + i])
            change += abs(desired[c + i])
    return change


@kernel
def _lift_change(d: DynamicsRecord, w: ContactMapRecord, g: ContactForceFilterRecord, count: int) -> None:
    """δy = H⁻¹ Aᵀ (A H⁻¹ Aᵀ)⁻¹ δf with H = Rᵀ W_a R + W_y, R the response of body and swing feet."""
    hessian, lift, response, target = g.hessian, g.lift, w.response, g.target
    nv, ny = response.shape
    nt = d.thruster_jacobian.shape[0]
    hessian[:] = 0.0
    for y in range(ny):
        hessian[y, y] = g.thrust if y < nt else g.torque
    for i in range(3):
        _add_square(g.linear[i], response[i], hessian)
    for i in range(3):
        _add_square(g.angular[i], response[3 + i], hessian)
    # Swing feet.
    motion = np.empty(ny)
    c = 0
    for r in range(d.foot_jacobian.shape[0]):
        if c < count and w.rows[c] == r:
            c += 1
            continue
        motion[:] = 0.0
        for i in range(nv):
            x = d.foot_jacobian[r, i]
            if x != 0.0:
                for y in range(ny):
                    motion[y] += x * response[i, y]
        _add_square(g.swing, motion, hessian)
    factorise(hessian, hessian)
    for y in range(ny):
        for a in range(count):
            lift[y, a] = w.gain[a, y]
    solve_transposed(hessian, lift, count)
    normal = g.schur[:count, :count]
    normal[:] = 0.0
    for y in range(ny):
        for a in range(count):
            for b in range(a + 1):
                normal[a, b] += lift[y, a] * lift[y, b]
    factorise(normal, normal, 1e-12)
    multiplier = g.desired[:count]
    solve_vector(normal, multiplier)
    for y in range(ny):
        s = 0.0
        for a in range(count):
            s += lift[y, a] * multiplier[a]
        target[y] = s
    solve_factor(hessian, target.reshape((ny, 1)), 1)


@kernel
def _within_authority(d: DynamicsRecord, g: ContactForceFilterRecord) -> None:
    """Shorten the target of the bend as a whole, so that it keeps its direction."""
    nt = d.thruster_jacobian.shape[0]
    scale = 1.0
    for y in range(g.target.shape[0]):
        authority = g.thrust_authority if y < nt else g.torque_authority
        if abs(g.target[y]) > authority / scale:
            scale = authority / abs(g.target[y])
    for y in range(g.target.shape[0]):
        g.target[y] *= scale


@kernel
def _bend(d: DynamicsRecord, w: ContactMapRecord, g: ContactForceFilterRecord, torque: Vector, thrust: Vector) -> None:
    """Move the bend towards its target, add it to the command, and leave its generalised force in ``w.drive``.

    The lag bounds the rate with which a contact switch changes the command.
    """
    nt = d.thruster_jacobian.shape[0]
    nv, base = w.drive.shape[0], w.drive.shape[0] - g.bend.shape[0]
    w.drive[:] = 0.0
    for y in range(g.bend.shape[0]):
        g.bend[y] += g.bend_share * (g.target[y] - g.bend[y])
        if y < nt:
            thrust[y // 3, y % 3] += g.bend[y]
            for i in range(nv):
                w.drive[i] += d.thruster_jacobian[y, i] * g.bend[y]
        else:
            torque[y - nt] += g.bend[y]
            w.drive[base + y] += g.bend[y]


@kernel
def _remaining(w: ContactMapRecord, g: ContactForceFilterRecord, count: int) -> float:
    """Force f + A δy at the bent command, its margins, and the largest violation left, N."""
    nv, change = w.drive.shape[0], g.desired
    solve_transposed(w.factor, w.drive.reshape((nv, 1)), 1)
    for c in range(count):
        s = 0.0
        for i in range(nv):
            s -= w.contact[i, c] * w.drive[i]
        change[c] = s
    solve_vector(w.delassus[:count, :count], change[:count])
    violation = 0.0
    for c in range(0, count, 3):
        k = w.rows[c] // 3
        force = g.force[k]
        for i in range(3):
            force[i] = w.force[c + i] + change[c + i]
        g.h_w[2 * k] = g.friction[k] * force[2] - np.sqrt(force[0] ** 2 + force[1] ** 2)
        g.h_w[2 * k + 1] = force[2]
        if np.isnan(g.h_w[2 * k]):
            return np.inf
        violation = max(violation, -g.h_w[2 * k], -g.h_w[2 * k + 1])
    return violation


@kernel
def _add_square(weight: float, row: Vector, hessian: Vector) -> None:
    """Add weight · row rowᵀ to the lower triangle."""
    for a in range(row.shape[0]):
        x = weight * row[a]
        for b in range(a + 1):
            hessian[a, b] += x * row[b]
