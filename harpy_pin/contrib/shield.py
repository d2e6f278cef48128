"""A shield behind any controller or policy: what comes out keeps the motors' limits and, as
predicted, the feet's grip.

It is the contact-force filter (:mod:`harpy_pin.governors.contact_force_filter`) with what a foreign
source of commands needs besides: limits of torques and thrusts, an answer to commands that are not
finite, and a report for every command. "Nearest" has the filter's meaning: the least change of the
motion of body and swing feet, thrusts and torques that brings every foot's force to its nearest
point, at the same normal force, in the tightened cone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.governors.contact_force_filter import ContactForceFilter
from harpy_pin.governors.contact_force_kernels import (
    ContactForceFilterRecord,
    answer_terms,
    cone_rows,
    friction_limit,
)
from harpy_pin.governors.contact_force_parameters import ContactForceFilterParameters
from harpy_pin.governors.thrust import limit_thrust
from harpy_pin.kernels import kernel
from harpy_pin.model.contact_map import ContactMapRecord, sticking_force, unconstrained_drive
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.entry import FADE, HOLD_TICKS, all_finite, as_command, as_state, refuse_law
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.model.terms import update_terms


@dataclass(frozen=True, slots=True, kw_only=True)
class ShieldReport:
    """What a shield changed in one command, and why; it shares no memory with the shield.

    Attributes:
        changed: whether the command that came out differs from the one that went in.
        safe: whether no foot that touches is predicted to slip or to lift under the command that
            came out, and state and command were numbers. The prediction is that of feet that stick,
            see the filter.
        reasons: what was wrong, such as ``friction left_foot``, ``normal force right_foot``,
            ``torque left_knee`` (the motor's limit), ``thrust left_thruster`` (its limit),
            ``fading`` (of an earlier change), ``bad state`` or ``bad command`` (not all finite
            numbers). A foot that slides already is named; its force is corrected less, as by the
            filter.
        torque: (joints,) change of the torques, N·m.
        thrust: (thrusters, 3) change of the thrusts, N.
        before: (feet, 2) friction margin μ f_z − |f_t| and normal force f_z, N, predicted under the
            command that went in, within the limits of motors and thrusters; +inf for a swing foot,
            NaN where nothing could be predicted.
        after: (feet, 2) the same under the command that came out.
    """

    changed: bool
    safe: bool
    reasons: tuple[str, ...]
    torque: Vector
    thrust: Vector
    before: Vector
    after: Vector


class Shield(KeepsViews):
    """Lets a command through, or the nearest one that keeps motors in their limits and feet from
    slipping.

    One object for each robot: it remembers its last change, which follows with the filter's lag of
    2 ms, so that a contact switch does not make the command jump. Until it has followed, the report
    says ``safe=False``; with ``parameters=ContactForceFilterParameters(lag=0.0)`` there is no lag.

    A command that is not all finite numbers is answered by the last one that came out, for
    :data:`~harpy_pin.model.entry.HOLD_TICKS` ticks, and then fades out. For such a state see the
    filter.

    Args:
        robot: with feet and thrusters, a free flyer.
        mu: friction coefficient of the ground.
        period: time between commands, s.
        parameters: other settings of the filter, by default those that fit the robot; their ``mu``
            is replaced.

    Attributes:
        governor: the filter.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        *,
        mu: float,
        period: float = 1e-3,
        parameters: ContactForceFilterParameters | None = None,
    ) -> None:
        self.robot = robot
        mu = checks.number("mu", mu, low=0.0)
        self._loop = ShieldLoop(robot, 1, mu=mu, period=period, parameters=parameters)
        self.governor: ContactForceFilter = self._loop.governor
        self._limited = [
            *(f"torque {joint}" for joint in robot.joints),
            *(f"thrust {name}" for name in robot.thrusters),
        ]

    def reset(self) -> None:
        """Forget the last change, and the last command."""
        self.governor.reset()
        self._loop.reset()

    def __call__(self, state: State, command: Command) -> tuple[Command, ShieldReport]:
        """The command to be sent, and the report.

        Args:
            state: measured.
            command: of any controller or policy; it is not overwritten.

        Returns:
            A new command, and what was changed.

        Raises:
            InputError: an array of the state or of the command has the wrong shape, or no numbers;
                or the command has a motors' law.
        """
        state, given = as_state(state, self.robot), as_command(command, self.robot)
        refuse_law(given)
        arrays = (state.q, state.v, state.foot_force, given.torque, given.thrust)
        friction = self.governor.friction[None].copy()
        answer = self._loop.answer(friction, tuple(array[None] for array in arrays))
        if not answer.bad_command[0]:
            self.governor.dynamics.finite = not answer.bad_state[0]
        torque, thrust = answer.torque[0], answer.thrust[0]
        report = ShieldReport(
            changed=bool(answer.changed[0]),
            safe=bool(answer.safe[0]),
            reasons=tuple(self._reasons(answer)),
            torque=torque - given.torque,
            thrust=thrust - given.thrust,
            before=answer.before[0],
            after=answer.after[0],
        )
        return Command(torque, thrust), report

    def _reasons(self, answer: ShieldAnswer) -> list[str]:
        """The flags of an answer in words."""
        if answer.bad_command[0]:
            return ["bad command"]
        names, rows, beyond = self._limited, self.governor.status.names, answer.beyond[0]
        reasons = [names[k] for k in np.flatnonzero(beyond[0])]
        if answer.excess[0] < 0.0:
            return [*reasons, "bad state"]
        reasons += [rows[k] for k in np.flatnonzero(answer.short[0])]
        reasons += [names[k] for k in np.flatnonzero(beyond[1] & ~beyond[0])]
        return reasons or (["fading"] if self.governor.bend.any() else [])


@dataclass(frozen=True, slots=True)
class ShieldAnswer:
    """What came out for n commands.

    Attributes:
        torque: (n, joints) to be sent, N·m.
        thrust: (n, thrusters, 3) to be sent, N.
        before: (n, feet, 2) margins under the command that went in, N, see :class:`ShieldReport`.
        after: (n, feet, 2) under the command that came out, N.
        excess: (n,) violation that is left, N; −1 for a bad state.
        changed: (n,) whether the command that came out differs from the one that went in.
        safe: (n,) whether no foot that touches is predicted to slip or lift, and state and command
            were numbers.
        bad_command: (n,) whether the command was not all finite numbers.
        short: (n, feet, 2) whether each foot had too little friction, and too little normal force.
        beyond: (n, 2, joints + thrusters) what was beyond its limit, of the command given and of
            the corrected one.
    """

    torque: Vector
    thrust: Vector
    before: Vector
    after: Vector
    excess: Vector
    changed: NDArray[np.bool_]
    safe: NDArray[np.bool_]
    bad_command: NDArray[np.bool_]
    short: NDArray[np.bool_]
    beyond: NDArray[np.bool_]

    @property
    def limited(self) -> NDArray[np.bool_]:
        """(n,) whether a torque or a thrust was beyond its limit."""
        return np.asarray(self.beyond.any(axis=(1, 2)))

    @property
    def bad_state(self) -> NDArray[np.bool_]:
        """(n,) whether the state was not all finite numbers."""
        return self.excess < 0.0


class LimitsRecord(RecordOf):
    """Limits of a command."""

    torque_limit: Vector  # (joints,) N·m
    thrust_limit: float  # of each thruster, N


@fixed_arrays("bend")
class ShieldLoop:
    """The filter, the limits and the memories of n shields.

    Args:
        robot: with feet and thrusters, a free flyer.
        n: number of robots.
        mu: friction coefficient of the filter, which each call gives anew.
        period: time between commands, s.
        parameters: other settings of the filter, by default those that fit the robot; their ``mu``
            is replaced.

    Attributes:
        governor: the filter, whose records serve the whole loop.
        bend: (n, thrust variables + joints) the last change of each robot.
    """

    def __init__(
        self,
        robot: Robot,
        n: int,
        *,
        mu: float,
        period: float,
        parameters: ContactForceFilterParameters | None,
    ) -> None:
        feet, thrusters, joints = len(robot.feet), len(robot.thrusters), len(robot.joints)
        given = (
            parameters if parameters is not None else ContactForceFilterParameters.for_robot(robot)
        )
        settings = replace(given, mu=mu)
        self.governor = ContactForceFilter(robot, settings, period=period)
        self._limits = make_record(
            LimitsRecord, torque_limit=robot.torque_limit, thrust_limit=robot.thrust_limit
        )
        self.bend: Vector = np.zeros((n, 3 * thrusters + joints))
        in_a_row = np.zeros((n, 2), dtype=np.int64)  # bad states, bad commands
        self._memory = (self.bend, np.zeros((n, joints)), np.zeros((n, thrusters, 3)), in_a_row)
        self._feet = feet

    def reset(self, which: NDArray[np.int64] | NDArray[np.bool_] | slice = slice(None)) -> None:
        """Forget the last changes and commands of some robots."""
        for memory in self._memory:
            memory[which] = 0

    def answer(self, friction: Vector, given: tuple[Vector, ...]) -> ShieldAnswer:
        """The commands to be sent.

        Args:
            friction: (n, feet) friction coefficients.
            given: (n, nq) configurations, (n, nv) velocities, (n, feet, 3) measured forces, (n,
                joints) torques and (n, thrusters, 3) thrusts.
        """
        torque, thrust = given[3:]
        n, feet, rows = len(torque), self._feet, torque.shape[1] + thrust.shape[1]
        flags = np.zeros((3, n), dtype=np.bool_)
        a = ShieldAnswer(
            torque=np.empty(torque.shape),
            thrust=np.empty(thrust.shape),
            before=np.full((n, feet, 2), np.nan),
            after=np.full((n, feet, 2), np.nan),
            excess=np.zeros(n),
            changed=flags[0],
            safe=flags[1],
            bad_command=flags[2],
            short=np.zeros((n, feet, 2), dtype=np.bool_),
            beyond=np.zeros((n, 2, rows), dtype=np.bool_),
        )
        governor = self.governor
        shield_all(
            (governor.dynamics._record_, governor.terms, governor._record_, self._limits),
            (friction, *self._memory),
            given,
            (a.torque, a.thrust, a.before, a.after, a.excess),
            (a.changed, a.safe, a.bad_command, a.short, a.beyond),
        )
        return a


@kernel
def shield_all(
    records: tuple[
        Records[DynamicsRecord],
        Records[ContactMapRecord],
        Records[ContactForceFilterRecord],
        Records[LimitsRecord],
    ],
    memory: tuple[Vector, Vector, Vector, Vector, NDArray[np.int64]],
    given: tuple[Vector, ...],
    results: tuple[Vector, ...],
    flags: tuple[NDArray[np.bool_], ...],
) -> None:
    """One robot after the other; the order of the arrays is that of :meth:`ShieldLoop.answer`."""
    dynamics, terms, record, limits = records
    friction, bend, last_torque, last_thrust, in_a_row = memory
    q, v, foot_force, torque, thrust = given
    new_torque, new_thrust, before, after, excess = results
    changed, safe, bad_command, short, beyond = flags
    g, most, feet = record[0], limits[0], before.shape[1]
    for i in range(q.shape[0]):
        u, f = new_torque[i], new_thrust[i]
        u[:] = torque[i]
        f[:] = thrust[i]
        if not (all_finite(u) and all_finite(f.reshape((f.size,)))):
            bad_command[i] = True
            in_a_row[i, 1] += 1
            if in_a_row[i, 1] > HOLD_TICKS:
                last_torque[i] *= FADE
                last_thrust[i] *= FADE
            u[:] = last_torque[i]
            f[:] = last_thrust[i]
            changed[i] = True
            continue
        in_a_row[i, 1] = 0
        _mark(most, u, f, beyond[i, 0])
        within_limits(most, u, f)
        g.friction[:] = friction[i]
        g.bend[:] = bend[i]
        g.bad_in_a_row = in_a_row[i, 0]
        verdict = update_terms(dynamics[0], q[i], v[i])
        excess[i] = max(
            answer_terms(dynamics[0], terms[0], g, verdict, v[i], foot_force[i], u, f), -1.0
        )
        in_a_row[i, 0] = g.bad_in_a_row
        if excess[i] < 0.0:
            within_limits(most, u, f)
        else:
            bend[i] = g.bend
            before[i] = g.h_r.reshape((feet, 2))
            after[i] = g.h_w.reshape((feet, 2))
            _short_of(g, before[i], short[i])
            _mark(most, u, f, beyond[i, 1])
            if within_limits(most, u, f):  # less of the change is left
                _margins(dynamics[0], terms[0], g, v[i], u, f, after[i])
            safe[i] = np.all(after[i].reshape(2 * feet) >= 0.0)
        last_torque[i] = u
        last_thrust[i] = f
        changed[i] = np.any(u != torque[i]) | np.any(f.reshape(f.size) != thrust[i].reshape(f.size))


@kernel
def _mark(most: LimitsRecord, torque: Vector, thrust: Vector, beyond: NDArray[np.bool_]) -> None:
    """Which torques, then which thrusts, are beyond their limits."""
    joints = torque.shape[0]
    beyond[:joints] = abs(torque) > most.torque_limit
    beyond[joints:] = np.sqrt(np.sum(thrust * thrust, axis=1)) > most.thrust_limit


@kernel
def within_limits(most: LimitsRecord, torque: Vector, thrust: Vector) -> bool:
    """Bring a command within ``torque_limit`` and ``thrust_limit``, in place; returns whether it
    was beyond them.
    """
    over = float(np.max(abs(torque) - most.torque_limit)) > 0.0
    torque[:] = np.clip(torque, -most.torque_limit, most.torque_limit)
    return limit_thrust(thrust, most.thrust_limit) or over


@kernel
def _short_of(g: ContactForceFilterRecord, before: Vector, short: NDArray[np.bool_]) -> None:
    """Which feet are outside the filter's tightened cone, or have too small a normal force."""
    for k in range(before.shape[0]):
        margin, normal = before[k, 0], before[k, 1]
        if margin == np.inf:
            continue
        mu, carried = g.friction[k], max(normal, g.min_normal_force)
        limit = friction_limit(mu, g.friction_share, g.margin, carried)
        short[k, 0] = mu * normal - margin > limit
        short[k, 1] = normal < g.min_normal_force


@kernel
def _margins(
    d: DynamicsRecord,
    w: ContactMapRecord,
    g: ContactForceFilterRecord,
    v: Vector,
    torque: Vector,
    thrust: Vector,
    out: Vector,
) -> None:
    """Friction margin and normal force that sticking demands under another command, after
    :func:`hold_forces`.
    """
    count = 3 * np.sum(out[:, 0] != np.inf)
    unconstrained_drive(d, v, torque, thrust.reshape(thrust.size), w.drive)
    sticking_force(d, w, count)
    for c in range(0, count, 3):
        k = w.rows[c] // 3
        out[k] = cone_rows(w.force[c : c + 3], g.friction[k])
