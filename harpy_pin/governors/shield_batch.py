"""Shields for many environments in one compiled loop; :class:`~harpy_pin.governors.Shield` is the loop for one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.governors.contact_force_filter import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.governors.contact_force_kernels import ContactForceFilterRecord, friction_limit, hold_forces
from harpy_pin.model.contact_map import sticking_force, unconstrained_drive
from harpy_pin.model.dynamics import DynamicsRecord, update_terms
from harpy_pin.model.entry import FADE, GOOD, HOLD_TICKS, all_finite, all_finite_rows
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.model.contact_map import ContactMapRecord

__all__ = ["ShieldBatch", "ShieldBatchReport"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ShieldBatchReport:
    """What a batch of shields did, one entry for each environment; see :class:`~harpy_pin.governors.ShieldReport`.

    Attributes:
        changed: (n,) whether the command that came out differs from the one that went in.
        safe: (n,) whether no foot that touches is predicted to slip or lift, and state and command were numbers.
        limited: (n,) whether a torque or a thrust was beyond its limit.
        short: (n, feet, 2) whether each foot had too little friction, and too little normal force.
        bad_state: (n,) whether the state was not all finite numbers.
        bad_command: (n,) whether the command was not all finite numbers.
        before: (n, feet, 2) friction margin and normal force under the command that went in, N.
        after: (n, feet, 2) under the command that came out, N.
    """

    changed: NDArray[np.bool_]
    safe: NDArray[np.bool_]
    limited: NDArray[np.bool_]
    short: NDArray[np.bool_]
    bad_state: NDArray[np.bool_]
    bad_command: NDArray[np.bool_]
    before: Vector
    after: Vector


class LimitsRecord(RecordOf):
    """Limits of a command.

    Attributes:
        torque_limit: (joints,) N·m.
        thrust_limit: of each thruster, N.
    """

    torque_limit: Vector
    thrust_limit: float


@fixed_arrays("mu")
class ShieldBatch(KeepsViews):
    """A shield for each of n environments with the same robot, in one call.

    Every environment has a memory of its own, as if it had a :class:`~harpy_pin.governors.shield.Shield` of its own.
    The time of a call grows linearly with n.

    Args:
        robot: with feet and thrusters, a free flyer.
        n: number of environments.
        mu: friction coefficient of the ground, one for all or (n,).
        period: time between commands, s.
        parameters: other settings of the filter; their ``mu`` is replaced.

    Attributes:
        mu: (n,) friction coefficients, to be overwritten where more is known.

    Raises:
        InputError: n is no positive integer, or a friction is negative or not finite.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        n: int,
        *,
        mu: ArrayLike,
        period: float = 1e-3,
        parameters: ContactForceFilterParameters | None = None,
    ) -> None:
        self.robot = checks.instance("robot", robot, Robot)
        self.n = checks.whole("n", n, low=1, high=checks.MAX_TICKS)
        given = checks.array("mu", mu, None)
        self.mu = checks.vector("mu", np.full(self.n, given) if given.ndim == 0 else given, self.n)
        for value in self.mu:
            checks.number("mu", value, low=0.0)
        feet, thrusters, joints = len(robot.feet), len(robot.thrusters), len(robot.joints)
        settings = replace(parameters if parameters is not None else ContactForceFilterParameters(), mu=self.mu[0])
        self._governor = ContactForceFilter(robot, settings, period=period)  # its records serve the whole loop
        self._limits = make_record(LimitsRecord, torque_limit=robot.torque_limit, thrust_limit=robot.thrust_limit)
        self._bend = np.zeros((self.n, 3 * thrusters + joints))
        self._last_torque, self._last_thrust = np.zeros((self.n, joints)), np.zeros((self.n, thrusters, 3))
        self._in_a_row = np.zeros((self.n, 2), dtype=np.int64)  # bad states, bad commands
        nq, nv = robot.model.nq, robot.model.nv
        self._shapes = {
            "q": (self.n, nq),
            "v": (self.n, nv),
            "foot_force": (self.n, feet, 3),
            "torque": (self.n, joints),
            "thrust": (self.n, thrusters, 3),
        }

    def reset(self, which: ArrayLike | None = None) -> None:
        """Forget the last changes and commands.

        Args:
            which: indices or mask of the environments; all by default.
        """
        chosen = checks.selection("which", which, len(self._in_a_row))
        for memory in (self._bend, self._last_torque, self._last_thrust, self._in_a_row):
            memory[chosen] = 0

    def __call__(
        self, q: ArrayLike, v: ArrayLike, foot_force: ArrayLike, torque: ArrayLike, thrust: ArrayLike
    ) -> tuple[Vector, Vector, ShieldBatchReport]:
        """The commands to be sent, and the report.

        Args:
            q: (n, nq) configurations.
            v: (n, nv) generalised velocities.
            foot_force: (n, feet, 3) measured contact forces, world axes, N.
            torque: (n, joints) of the commands, N·m; not overwritten.
            thrust: (n, thrusters, 3) of the commands, world axes, N; not overwritten.

        Returns:
            New arrays (n, joints) and (n, thrusters, 3), and what was changed.

        Raises:
            InputError: an array has the wrong shape, or no numbers.
        """
        given = {"q": q, "v": v, "foot_force": foot_force, "torque": torque, "thrust": thrust}
        arrays = {name: checks.array(name, value, self._shapes[name]) for name, value in given.items()}
        friction = np.repeat(self.mu, len(self.robot.feet)).reshape(self.n, -1)
        return self._answer(friction, tuple(arrays.values()))[:3]

    def _answer(
        self, friction: Vector, given: tuple[Vector, ...]
    ) -> tuple[Vector, Vector, ShieldBatchReport, NDArray[np.bool_], Vector]:
        """What :meth:`__call__` returns; then what was beyond its limits, and the violation that is left.

        Args:
            friction: (n, feet) friction coefficients.
            given: the arrays of :meth:`__call__`, of the right shapes.

        Returns:
            At the end (n, 2, joints + thrusters), for the command given and for the corrected one, and (n,), N; -1
            for a bad state.
        """
        n, feet, joints = self.n, len(self.robot.feet), len(self.robot.joints)
        new = np.empty(self._shapes["torque"]), np.empty(self._shapes["thrust"])
        margins = np.full((n, feet, 2), np.nan), np.full((n, feet, 2), np.nan)
        changed, safe, bad_command = np.zeros((3, n), dtype=np.bool_)
        short = np.zeros((n, feet, 2), dtype=np.bool_)
        beyond, excess = np.zeros((n, 2, joints + len(self.robot.thrusters)), dtype=np.bool_), np.zeros(n)
        governor = self._governor
        _shield_all(
            (governor.dynamics.record, governor.terms, governor.record, self._limits),
            (friction, self._bend, self._last_torque, self._last_thrust, self._in_a_row),
            given,
            (*new, *margins, excess),
            (changed, safe, bad_command, short, beyond),
        )
        report = ShieldBatchReport(
            changed=changed,
            safe=safe,
            limited=np.asarray(beyond.any(axis=(1, 2))),
            short=short,
            bad_state=excess < 0.0,
            bad_command=bad_command,
            before=margins[0],
            after=margins[1],
        )
        return *new, report, beyond, excess


@kernel
def _shield_all(
    records: tuple[
        Records[DynamicsRecord], Records[ContactMapRecord], Records[ContactForceFilterRecord], Records[LimitsRecord]
    ],
    memory: tuple[Vector, Vector, Vector, Vector, NDArray[np.int64]],
    given: tuple[Vector, ...],
    results: tuple[Vector, ...],
    flags: tuple[NDArray[np.bool_], ...],
) -> None:
    """One environment after the other; the order of the arrays is that of :meth:`ShieldBatch._answer`."""
    dynamics, terms, record, limits = records
    friction, bend, last_torque, last_thrust, in_a_row = memory
    q, v, foot_force, torque, thrust = given
    new_torque, new_thrust, before, after, excess = results
    changed, safe, bad_command, short, beyond = flags
    g, most = record[0], limits[0]
    for i in range(q.shape[0]):
        u, f = new_torque[i], new_thrust[i]
        u[:] = torque[i]
        f[:] = thrust[i]
        if not (all_finite(u) and all_finite_rows(f)):
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
        excess[i] = -1.0
        if update_terms(dynamics[0], q[i], v[i]) == GOOD:
            excess[i] = hold_forces(dynamics[0], terms[0], g, v[i], foot_force[i], u, f)
        if excess[i] < 0.0:
            in_a_row[i, 0] += 1
            _add_held(FADE ** max(in_a_row[i, 0] - HOLD_TICKS, 0), bend[i], u, f)
            within_limits(most, u, f)
        else:
            in_a_row[i, 0] = 0
            bend[i] = g.bend
            for k in range(before.shape[1]):
                for c in range(2):
                    before[i, k, c], after[i, k, c] = g.h_r[2 * k + c], g.h_w[2 * k + c]
            _short_of(g, before[i], short[i])
            _mark(most, u, f, beyond[i, 1])
            if within_limits(most, u, f):  # less of the change is left
                _margins(dynamics[0], terms[0], g, v[i], u, f, after[i])
            safe[i] = True
            for k in range(after.shape[1]):
                safe[i] = safe[i] and after[i, k, 0] >= 0.0 and after[i, k, 1] >= 0.0
        last_torque[i] = u
        last_thrust[i] = f
        changed[i] = _differs(u, torque[i]) or _differs(f.reshape(f.size), thrust[i].reshape(f.size))


@kernel
def _differs(a: Vector, b: Vector) -> bool:
    different = False
    for j in range(a.shape[0]):
        different = different or a[j] != b[j]
    return different


@kernel
def _mark(most: LimitsRecord, torque: Vector, thrust: Vector, beyond: NDArray[np.bool_]) -> None:
    """Which torques, then which thrusts, are beyond their limits."""
    joints = torque.shape[0]
    for j in range(joints):
        beyond[j] = abs(torque[j]) > most.torque_limit[j]
    for k in range(thrust.shape[0]):
        size = np.sqrt(thrust[k, 0] ** 2 + thrust[k, 1] ** 2 + thrust[k, 2] ** 2)
        beyond[joints + k] = size > most.thrust_limit


@kernel
def within_limits(most: LimitsRecord, torque: Vector, thrust: Vector) -> bool:
    """Bring a command within ``torque_limit`` and ``thrust_limit`` of a record, in place.

    Returns:
        Whether it was beyond them.
    """
    over = False
    for j in range(torque.shape[0]):
        if abs(torque[j]) > most.torque_limit[j]:
            over = True
            torque[j] = most.torque_limit[j] if torque[j] > 0.0 else -most.torque_limit[j]
    for k in range(thrust.shape[0]):
        size = np.sqrt(thrust[k, 0] ** 2 + thrust[k, 1] ** 2 + thrust[k, 2] ** 2)
        if size > most.thrust_limit:
            over = True
            for i in range(3):
                thrust[k, i] *= most.thrust_limit / size
    return over


@kernel
def _add_held(share: float, bend: Vector, torque: Vector, thrust: Vector) -> None:
    """Add a share of the last change."""
    split = thrust.size
    for y in range(bend.shape[0]):
        if y < split:
            thrust[y // 3, y % 3] += share * bend[y]
        else:
            torque[y - split] += share * bend[y]


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
    """Friction margin and normal force that sticking demands under another command, after :func:`hold_forces`."""
    count = 0
    for k in range(out.shape[0]):
        if out[k, 0] != np.inf:
            count += 3
    unconstrained_drive(d, v, torque, thrust.reshape(thrust.size), w.drive)
    sticking_force(d, w, count)
    for c in range(0, count, 3):
        k = w.rows[c] // 3
        tangential = np.sqrt(w.force[c] ** 2 + w.force[c + 1] ** 2)
        out[k, 0], out[k, 1] = g.friction[k] * w.force[c + 2] - tangential, w.force[c + 2]
