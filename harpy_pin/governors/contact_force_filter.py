"""A governor for the true contact force: it bends thrusts and joint targets until sticking is possible.

The reduced-order model knows one force, along one leg, and a reference can scale it but not turn it (equations.md §2).
The full model knows the force on every foot, affine in thrusts and torques (:mod:`harpy_pin.model.contact_map`): here
each foot's force is put back into Coulomb's cone in closed form, and the change is lifted back to the command,

    minimise    ‖W_a δa‖² + ‖W_y δy‖²      δa = M⁻¹ (X + J_fᵀ A) δy: what the change does to body and swing feet
    subject to  A δy = f* − f

with f* the force of each foot with its tangential part shortened into the cone, and its normal part as the weight
demands. The torque part is the bend K_p⁻¹ δτ of the joint targets, the thrust part that of the body's reference. No
active set, no iteration: three Cholesky factors. Inactive, it changes nothing.

What holds: for feet that stick, with the whole change applied, the force on each foot is f*, to rounding: inside the
cone tightened by the margins. So no foot slides while the error of the predicted force (measured in
``docs/governors.md``) and the share of the change that still lags stay below the margins. The change is bounded: where
the authority does not suffice it is shortened as a whole, and the violation left is in the status.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.governors.governor import GovernorStatus
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.contact_map import (
    ContactMapRecord,
    contact_gain,
    contact_terms,
    sticking_force,
    unconstrained_drive,
)
from harpy_pin.model.dynamics import Dynamics, DynamicsRecord
from harpy_pin.model.entry import FADE, FLOAT64, HOLD_TICKS, all_finite, all_finite_rows, as_command, as_state
from harpy_pin.model.record import RecordOf, Records, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector

__all__ = ["ContactForceFilter", "ContactForceFilterParameters"]


@dataclass(frozen=True, kw_only=True)
class ContactForceFilterParameters:
    """Settings of :class:`ContactForceFilter`.

    The weights were found by a random search over slip on walks at friction 0.2, 0.15 and 0.1, without pushes
    (``docs/governors.md``); its script was not kept.

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
        torque_authority: largest change of a torque, N·m: with joint stiffness K_p the joint target bends by at most
            this over K_p.
        lag: time constant with which the bend follows its target, s. It bounds the bend's rate by twice the authority
            over the lag: a contact switch reaches the command as a slope, not as a jump. Zero is none.
        sliding_speed: speed from which on the governor gives up on a foot, m/s, entirely so at twice this: sliding, it
            cannot be brought to stick by a force inside the cone, and chasing it makes the walk worse than ungoverned.
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
        for name in ("margin", "min_normal_force", "contact_threshold", "contact_damping", "swing", "lag"):
            checks.number(name, getattr(self, name), low=0.0)
        checks.gains("linear", self.linear)
        checks.gains("angular", self.angular)
        for name in ("thrust", "torque", "thrust_authority", "torque_authority", "sliding_speed"):
            checks.number(name, getattr(self, name), low=0.0, strict=True)

    @classmethod
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
        """Settings tightened for known bounds on what is not known, in newtons.

        The force on a foot differs from the predicted one by at most δ = e_f + ε_m F + T Ḟ. Friction then holds if
        |f_t| + δ ≤ (1 − ε_μ) μ (f_z − δ), which is the cone with share 1 − ε_μ and margin (1 + (1 − ε_μ) μ) δ.

        Args:
            mu: nominal μ_s.
            friction_error: ε_μ, relative.
            force_error: e_f, error of the prediction itself, N.
            mass_error: ε_m, relative.
            delay: T, between measurement and action, s.
            load: F, largest force on a foot, N.
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


class ContactForceFilterRecord(RecordOf):
    """What :class:`ContactForceFilter` knows and works in.

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
        torque_authority: largest change of a torque, N·m: with joint stiffness K_p the joint target bends by at most
            this over K_p.
        lag: time constant with which the bend follows its target, s. It bounds the bend's rate by twice the authority
            over the lag: a contact switch reaches the command as a slope, not as a jump. Zero is none.
        sliding_speed: speed from which on the governor gives up on a foot, m/s, entirely so at twice this: sliding, it
            cannot be brought to stick by a force inside the cone, and chasing it makes the walk worse than ungoverned.
        bend_share: share of the way to the target bend in one update.
        friction: (feet,) friction coefficient of each foot: that of the parameters, to be overwritten between updates
            by whoever knows better.
        bend: (3 thrusters + joints,) δy = [δu; δτ] of the last update, N and N·m.
        force: (feet, 3) force that sticking demands under the bent command, world axes, N; zero in the air.
        h_r: (2 feet,) rows at the command as given, N.
        h_w: (2 feet,) rows at the command as bent, N.
        target: (n_y,) the bend that the lag follows.
        desired: (3 feet,) change of the force on the feet that touch, packed to the front, N.
        lift: (n_y, 3 feet) L⁻ᵀ Aᵀ with the gain A and the factor L of the Hessian.
        hessian: (n_y, n_y) of the cost of a bend; then its factor L.
        schur: (3 feet, 3 feet) matrix of the multipliers' equations.
    """

    mu: float
    friction_share: float
    margin: float
    min_normal_force: float
    contact_threshold: float
    contact_damping: float
    linear: Vector
    angular: Vector
    swing: float
    thrust: float
    torque: float
    thrust_authority: float
    torque_authority: float
    lag: float
    sliding_speed: float
    bend_share: float
    friction: Vector
    bend: Vector
    force: Vector
    h_r: Vector
    h_w: Vector
    target: Vector
    desired: Vector
    lift: Vector
    hessian: Vector
    schur: Vector


class ContactForceFilter:
    """Holds the contact force of every foot in its friction cone; a filter behind any controller's command.

    Where q, v, the foot forces or the command are not all finite numbers, the last bend is held for
    :data:`~harpy_pin.model.entry.HOLD_TICKS` ticks and then fades out; the status says that nothing is promised, and
    counts. The next good sample is answered as if the bad ones had never come.

    Args:
        robot: with feet and thrusters, a free flyer.
        parameters: settings.
        period: time between updates, s.

    Attributes:
        dynamics: terms of the last update.
        status: of the last update; its rows are, per foot, the friction margin μ f_z − |f_t| and f_z, both in N, at
            the command as given (``h_r``) and as bent (``h_w``), +inf for a foot in the air; ``rate`` is δy.
        bend: (3 thrusters + joints,) δy = [δu; δτ] of the last update, N and N·m.
        force: (feet, 3) force that sticking demands under the bent command, world axes, N; zero in the air.
        friction: (feet,) friction coefficient of each foot: that of the parameters, to be overwritten between updates
            by whoever knows better.
        terms: what the contact-force map works in.
        record: what the kernel of an update reads and works in.
    """

    def __init__(
        self, robot: Robot, parameters: ContactForceFilterParameters | None = None, *, period: float = 1e-3
    ) -> None:
        self.robot = robot
        self.parameters = parameters if parameters is not None else ContactForceFilterParameters()
        self.period = checks.number("period", period, low=0.0, strict=True)
        self.dynamics = Dynamics(robot)
        if robot.rotors:
            raise InputError("the governor of the contact force bends free thrusters, not rotors", name="robot")
        feet, ny = len(robot.feet), robot.n_thrust + len(robot.joints)
        nf, p = 3 * feet, self.parameters
        self.terms = contact_terms(robot)
        self.record = make_record(
            ContactForceFilterRecord,
            **asdict(p),
            bend_share=1.0 - np.exp(-self.period / p.lag) if p.lag > 0.0 else 1.0,
            friction=np.full(feet, p.mu),
            bend=np.zeros(ny),
            force=np.zeros((feet, 3)),
            h_r=np.zeros(2 * feet),
            h_w=np.zeros(2 * feet),
            target=np.zeros(ny),
            desired=np.zeros(nf),
            lift=np.zeros((ny, nf)),
            hessian=np.zeros((ny, ny)),
            schur=np.zeros((nf, nf)),
        )
        self.bend: Vector = field(self.record, "bend")
        self.force: Vector = field(self.record, "force")
        self.friction: Vector = field(self.record, "friction")
        names = tuple(f"{row} {foot}" for foot in robot.feet for row in ("friction", "normal force"))
        self.status = GovernorStatus(names, field(self.record, "h_r"), field(self.record, "h_w"), self.bend)
        self._in_a_row = 0
        v, torque, thrust = np.zeros(robot.model.nv), np.zeros(len(robot.joints)), np.zeros((len(robot.thrusters), 3))
        hold.prepare(self.dynamics.record, self.terms, self.record, v, self.force, torque, thrust)

    def reset(self) -> None:
        """Forget the bend, and the bad samples."""
        self.bend[:] = 0.0
        self.status.bad_samples = self._in_a_row = 0

    def update(self, state: State, command: Command) -> Command:
        """Bend a command, in place.

        Args:
            state: measured; a foot whose measured normal force exceeds the threshold is taken to touch.
            command: of any controller.

        Returns:
            The command itself; where its arrays are not float64, and so cannot hold the bend, a copy.

        Raises:
            InputError: an array of the state or of the command has the wrong shape, or no numbers.
        """
        dynamics, status, torque, thrust = self.dynamics, self.status, command.torque, command.thrust
        try:
            if torque.dtype is not FLOAT64 or thrust.dtype is not FLOAT64:
                return self.update(state, as_command(command, self.robot))
            dynamics.update(state.q, state.v)
            excess = -1.0
            if dynamics.finite:
                excess = hold(dynamics.record, self.terms, self.record, state.v, state.foot_force, torque, thrust)
        except Exception:
            given, fit = as_state(state, self.robot), as_command(command, self.robot)
            if given is state and fit is command:
                raise
            return self.update(given, fit)
        if excess < 0.0:
            return self._bridge(state, command)
        self._in_a_row = 0
        status.infeasible = excess > 0.0
        status.least_violation = excess
        return command

    def _bridge(self, state: State, command: Command) -> Command:
        """Answer a state or command that does not fit, or is not all numbers."""
        if as_command(command, self.robot) is not command or as_state(state, self.robot) is not state:
            return self.update(as_state(state, self.robot), as_command(command, self.robot))
        status = self.status
        status.infeasible, status.least_violation = True, float("inf")
        status.bad_samples += 1
        self._in_a_row += 1
        bend = self.bend * FADE ** max(self._in_a_row - HOLD_TICKS, 0)
        split = command.thrust.size
        command.thrust += bend[:split].reshape(-1, 3)
        command.torque += bend[split:]
        return command


@kernel
def into_cone(force: Vector, mu: float, share: float, margin: float, least: float, out: Vector) -> None:
    """The force with its normal part at least ``least`` and its tangential part shortened into the tightened cone.

    The tightened cone is |f_t| ≤ share μ f_z − margin, and never narrower than a fifth of the real one, so that it
    keeps an inside where the normal force is small.
    """
    normal = max(force[2], least)
    limit = max(share * mu * normal - margin, 0.2 * mu * normal)
    tangential = np.sqrt(force[0] * force[0] + force[1] * force[1])
    scale = limit / tangential if tangential > limit else 1.0
    out[0] = scale * force[0]
    out[1] = scale * force[1]
    out[2] = normal


@kernel
def hold(
    dynamics: Records[DynamicsRecord],
    terms: Records[ContactMapRecord],
    record: Records[ContactForceFilterRecord],
    v: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> float:
    return hold_forces(dynamics[0], terms[0], record[0], v, foot_force, torque, thrust)


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
    """One tick; returns the violation left at the bent command, N; −1, with nothing done, for what does not fit."""
    if v.shape != d.bias.shape or foot_force.shape != g.force.shape:
        return -1.0
    if thrust.shape != (d.thruster_jacobian.shape[0] // 3, 3) or torque.shape[0] + thrust.size != g.bend.shape[0]:
        return -1.0
    if not (all_finite(torque) and all_finite_rows(thrust) and all_finite_rows(foot_force)):
        return -1.0
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
    return _remaining(w, g, count)


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
        if foot_force[k, 2] > g.contact_threshold:
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
        # A foot that slides is given up, gradually.
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
    # Feet in the air.
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

    The lag is short: contact switches reach the command as a bounded rate, not as a jump.
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
