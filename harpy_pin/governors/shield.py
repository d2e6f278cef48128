"""A shield behind any controller or policy: what comes out keeps the motors' limits and, as predicted, the feet's grip.

It is the contact-force filter (:mod:`harpy_pin.governors.contact_force_filter`) with what a foreign source of commands
needs besides: limits of torques and thrusts, an answer to commands that are not finite, and a report for every command.
"Nearest" has the filter's meaning: the least change of the motion of body and swing feet, thrusts and torques that
brings every foot's force to its nearest point, at the same normal force, in the tightened cone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.governors.contact_force_filter import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.governors.shield_loop import ShieldAnswer, ShieldLoop
from harpy_pin.model.entry import as_command, as_state
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
        self.robot = checks.instance("robot", robot, Robot)
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
            InputError: an array of the state or of the command has the wrong shape, or no numbers.
        """
        state, given = as_state(state, self.robot), as_command(command, self.robot)
        arrays = (state.q, state.v, state.foot_force, given.torque, given.thrust)
        friction = self.governor.friction[None].copy()
        answer = self._loop.answer(friction, tuple(array[None] for array in arrays))
        if not answer.bad_command[0]:
            self._note(float(answer.excess[0]))
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

    def _note(self, excess: float) -> None:
        """Keep the filter's status as its own update does; the violation that is left is negative for a bad state."""
        status = self.governor.status
        if excess < 0.0:
            status.bad()
        else:
            status.infeasible, status.least_violation = excess > 0.0, excess
        self.governor.dynamics.finite = excess >= 0.0

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
