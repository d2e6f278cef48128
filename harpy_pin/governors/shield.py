"""A shield behind any controller or policy: what comes out keeps the motors' limits and, as predicted, the feet's grip.

It is the contact-force filter (:mod:`harpy_pin.governors.contact_force_filter`) with what a foreign source of commands
needs besides: limits of torques and thrusts, an answer to commands that are not finite, and a report for every command.
"Nearest" has the filter's meaning: the least change of the motion of body and swing feet, thrusts and torques that
brings every foot's force to its nearest point, at the same normal force, in the tightened cone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from harpy_pin.arguments import checked
from harpy_pin.governors.contact_force_filter import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.governors.contact_force_kernels import friction_limit
from harpy_pin.model.contact_map import ContactForceMap
from harpy_pin.model.entry import FADE, HOLD_TICKS, as_command
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector

__all__ = ["Shield", "ShieldReport"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ShieldReport:
    """What a shield changed in one command, and why; it shares no memory with the shield.

    Attributes:
        changed: whether the command that came out differs from the one that went in.
        safe: whether no foot that touches is predicted to slip or to lift under the command that came out, and state
            and command were numbers. The prediction is that of feet that stick, see the filter.
        reasons: what was wrong, such as ``friction left_foot``, ``normal force right_foot``, ``torque left_knee`` (the
            motor's limit), ``thrust left_thruster`` (its limit), ``fading`` (of an earlier change), ``bad state`` or
            ``bad command`` (not all finite numbers). A foot that slides already is named; its
            force is corrected less, as by the filter.
        torque: (joints,) change of the torques, N·m.
        thrust: (thrusters, 3) change of the thrusts, N.
        before: (feet, 2) friction margin μ f_z − |f_t| and normal force f_z, N, predicted under the command that went
            in, within the limits of motors and thrusters; +inf for a swing foot, NaN where nothing could be predicted.
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
    """Lets a command through, or the nearest one that keeps motors in their limits and feet from slipping.

    One object for each robot: it remembers its last change, which follows with the filter's lag of 2 ms, so that a
    contact switch does not make the command jump. Until it has followed, the report says ``safe=False``; with
    ``parameters=ContactForceFilterParameters(lag=0.0)`` there is no lag.

    A command that is not all finite numbers is answered by the last one that came out, for
    :data:`~harpy_pin.model.entry.HOLD_TICKS` ticks, and then fades out. For such a state see the filter.

    Args:
        robot: with feet and thrusters, a free flyer.
        mu: friction coefficient of the ground.
        period: time between commands, s.
        parameters: other settings of the filter; their ``mu`` is replaced.

    Attributes:
        governor: the filter.
    """

    @checked
    def __init__(
        self, robot: Robot, *, mu: float, period: float = 1e-3, parameters: ContactForceFilterParameters | None = None
    ) -> None:
        settings = replace(parameters if parameters is not None else ContactForceFilterParameters(), mu=mu)
        self.robot = robot
        self.governor = ContactForceFilter(robot, settings, period=period)
        self._map = ContactForceMap(robot, damping=settings.contact_damping)
        self._torque_limit = robot.torque_limit
        self.reset()

    def reset(self) -> None:
        """Forget the last change, and the last command."""
        self.governor.reset()
        self._last = Command(np.zeros(len(self.robot.joints)), np.zeros((len(self.robot.thrusters), 3)))
        self._bad_in_a_row = 0

    def __call__(self, state: State, command: Command) -> tuple[Command, ShieldReport]:
        """The command to be sent, and the report.

        Args:
            state: measured.
            command: of any controller or policy; it is not overwritten.

        Returns:
            A new command, and what was changed.

        Raises:
            InputError: an array of the state or of the command has the wrong shape, or no numbers.
        """
        given = as_command(command, self.robot)
        if not (np.isfinite(given.torque).all() and np.isfinite(given.thrust).all()):
            return self._hold(given)
        self._bad_in_a_row = 0
        status = self.governor.status
        limited, reasons = self._within_limits(given)
        bad = status.bad_samples
        bent = self.governor.update(state, Command(limited.torque.copy(), limited.thrust.copy()))
        feet = len(self.robot.feet)
        if status.bad_samples > bad:
            reasons.append("bad state")
            before = after = np.full((feet, 2), np.nan)
            result, _ = self._within_limits(bent)
        else:
            before, after = status.h_r.reshape(feet, 2).copy(), status.h_w.reshape(feet, 2).copy()
            reasons += self._short_of(before)
            result, over = self._within_limits(bent)
            if over:  # the change itself went beyond the limits: what is left of it is less
                reasons += [reason for reason in over if reason not in reasons]
                after = self._margins(state, result, np.isfinite(before[:, 0]))
            elif not reasons and self.governor.bend.any():
                reasons.append("fading")
        self._last = result
        safe = bool((after >= 0.0).all())
        return self._copy(result), self._report(given, result, reasons, before, after, safe=safe)

    def _hold(self, given: Command) -> tuple[Command, ShieldReport]:
        """The last command in the place of one that is not all finite numbers; then less and less of it."""
        self._bad_in_a_row += 1
        if self._bad_in_a_row > HOLD_TICKS:
            self._last.torque *= FADE
            self._last.thrust *= FADE
        unknown = np.full((len(self.robot.feet), 2), np.nan)
        report = self._report(given, self._last, ["bad command"], unknown, unknown, safe=False)
        return self._copy(self._last), report

    def _within_limits(self, command: Command) -> tuple[Command, list[str]]:
        """A copy within the limits of motors and thrusters, and what was beyond."""
        limit, most = self._torque_limit, self.robot.thrust_limit
        size = np.linalg.norm(command.thrust, axis=1)
        over, strong = np.abs(command.torque) > limit, size > most
        reasons = []
        if over.any():
            reasons += [f"torque {self.robot.joints[j]}" for j in np.flatnonzero(over)]
        if strong.any():
            reasons += [f"thrust {self.robot.thrusters[k]}" for k in np.flatnonzero(strong)]
        thrust = command.thrust.copy()
        if strong.any():
            thrust[strong] *= (most / size[strong])[:, None]
        return Command(np.minimum(np.maximum(command.torque, -limit), limit), thrust), reasons

    def _short_of(self, margins: Vector) -> list[str]:
        """Which feet the governor finds outside its tightened cone, or with too small a normal force."""
        p, reasons = self.governor.parameters, []
        for k, (foot, (margin, normal)) in enumerate(zip(self.robot.feet, margins.tolist(), strict=True)):
            if margin == np.inf:  # in the air
                continue
            mu, carried = float(self.governor.friction[k]), max(normal, p.min_normal_force)
            limit = friction_limit(mu, p.friction_share, p.margin, carried)
            if mu * normal - margin > limit:
                reasons.append(f"friction {foot}")
            if normal < p.min_normal_force:
                reasons.append(f"normal force {foot}")
        return reasons

    def _margins(self, state: State, command: Command, touching: Vector) -> Vector:
        """(feet, 2) friction margin and normal force that sticking demands under a command."""
        dynamics = self.governor.dynamics
        force = self._map.update(
            dynamics, state.v, torque=command.torque, thrust=command.thrust, touching=touching.astype(np.float64)
        )
        slip = self.governor.friction * force[:, 2] - np.hypot(force[:, 0], force[:, 1])
        return np.where(touching[:, None], np.column_stack((slip, force[:, 2])), np.inf)

    @staticmethod
    def _copy(command: Command) -> Command:
        return Command(command.torque.copy(), command.thrust.copy())

    @staticmethod
    def _report(
        given: Command, result: Command, reasons: list[str], before: Vector, after: Vector, *, safe: bool
    ) -> ShieldReport:
        torque, thrust = result.torque - given.torque, result.thrust - given.thrust
        return ShieldReport(
            changed=bool(torque.any() or thrust.any()),
            safe=safe,
            reasons=tuple(reasons),
            torque=torque,
            thrust=thrust,
            before=before,
            after=after.copy(),
        )
