"""Thrusters of the true robot that are not what the controllers believe: slow to follow, idling,
saturated, turning.

The magnitude of a thrust follows its goal, which is the command within its limits, by a lag of
first order. Its direction turns towards that of the command along the great circle, in axes of the
body. A rotor has a fixed direction, so only its thrust lags.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.kernels import kernel
from harpy_pin.model.record import ZERO, Record, RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector

MAX_THRUST = 1e6  # N, and N/s
NO_THRUST = 1e-9  # thrust below which a command has no direction, N


def _read_failing(name: str, value: Any) -> tuple[int, float, float]:
    """Index, time and share of what fails; an :class:`InputError` where these are not three values
    in their domains.
    """
    try:
        index, time, share = value
    except (TypeError, ValueError):
        raise InputError(
            f"{name} must be (index, time, share), got {shown(value)}", name="failing", value=value
        ) from None
    index = checks.whole(f"{name} index", index)
    time = checks.number(f"{name} time", time, low=0.0)
    return index, time, checks.number(f"{name} share", share, low=0.0, high=1.0)


@dataclass(frozen=True, kw_only=True)
class Thrusters(checks.Checked):
    """What thrusters of the true robot do that the model does not say; nothing by default.

    Thrusts have settled at the first command. Limits are of the magnitude, for each thruster.

    Attributes:
        lag: time constant of the magnitude, s. 0: the thrust is there at once.
        rate: fastest change of the goal that the thrust follows, N/s; None: any.
        least: thrust that never stops, N, in the last direction where the command has none. Rotors
            have limits of their own.
        largest: N; None: any.
        turning_lag: time constant of the angle between the thrust's and the command's direction, s.
            0: the thrust has the command's direction.
        failing: (index of a thruster, time since the reset in s, share of its thrust that is left
            from then on); None: none fails.

    Raises:
        InputError: a value out of its domain.
    """

    whose = "thrusters' "
    lag: float = checks.setting(0.0, low=0.0, high=checks.MAX_LAG)
    rate: float | None = checks.setting(None, low=0.0, high=MAX_THRUST, strict=True)
    least: float = checks.setting(0.0, low=0.0, high=MAX_THRUST)
    largest: float | None = checks.setting(None, high=MAX_THRUST)
    turning_lag: float = checks.setting(0.0, low=0.0, high=checks.MAX_LAG)
    failing: tuple[int, float, float] | None = checks.setting(None, _read_failing)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.largest is not None:
            checks.number("thrusters' largest", self.largest, low=self.least)

    def __bool__(self) -> bool:
        """Whether there is anything that the model does not say."""
        return self != Thrusters()

    def _response(self, dt: float) -> tuple[Vector, Vector]:
        """How a magnitude follows a constant goal over a step dt, s; a lag of second order has
        another.

        Returns the transition (2, 2) of [distance to the goal; rate of change], and the mean
        distance to the goal (2,) by those at the beginning.
        """
        transition, mean = np.zeros((2, 2)), np.zeros(2)
        if self.lag > 0.0:
            transition[0, 0] = math.exp(-dt / self.lag)
            mean[0] = -math.expm1(-dt / self.lag) * self.lag / dt
        return transition, mean


class ThrustersRecord(RecordOf):
    """The thrusters."""

    ideal: int  # whether the thrust is the command
    available: float  # share of the largest magnitude that there is at present
    failing: int  # index of the thruster that fails; −1 where none does
    remaining_steps: float  # until then
    left: float  # share of its thrust that is left
    slew: float  # largest change of a goal in a step, N
    least: float  # of the magnitudes, N
    largest: float  # of the magnitudes, N
    remaining: float  # share of the angle to the command's direction that a step leaves
    transition: Vector  # (2, 2) of [distance to the goal; rate of change] over a step
    mean_away: Vector  # (2,) distance to the goal in the mean of a step, by those at its beginning
    goal: Vector = sized("thrusters")  # (thrusters,) N
    # (thrusters, 2) magnitude at the end of the last step, N, and its rate of change, N/s
    level: Vector = sized("thrusters", 2)
    direction: Vector = sized("thrusters", 3)  # (thrusters, 3) body axes; not of rotors
    mean_thrust: Vector = sized("thrusts")  # (thrust variables,) over the last step, N
    settled: int = ZERO  # 0 before the first command


def thrusters_record(
    thrusters: Thrusters, *, count: int, variables: int, dt: float
) -> Records[ThrustersRecord]:
    """The thrusters, for kernels: ``count`` thrusters and rotors with so many thrust variables, at
    steps of dt, s.
    """
    p = thrusters
    transition, mean = p._response(dt)
    record = make_record(
        ThrustersRecord,
        {"thrusters": count, "thrusts": variables},
        ideal=np.int64(not p),
        available=1.0,
        failing=np.int64(-1 if p.failing is None else p.failing[0]),
        remaining_steps=math.inf,
        left=1.0 if p.failing is None else p.failing[2],
        slew=math.inf if p.rate is None else p.rate * dt,
        least=p.least,
        largest=math.inf if p.largest is None else p.largest,
        remaining=math.exp(-dt / p.turning_lag) if p.turning_lag > 0.0 else 0.0,
        transition=transition,
        mean_away=mean,
    )
    record["direction"][0, :, 2] = 1.0
    if p.failing is not None:
        checks.whole("index of the thruster that fails", p.failing[0], high=max(count - 1, 0))
    settle_thrusters(record, p, dt)
    return record


def settle_thrusters(record: Record, thrusters: Thrusters, dt: float) -> None:
    """Make the record of thrusters as at the start: thrusts settle at the next command."""
    record["settled"] = 0
    record["available"] = 1.0
    record["remaining_steps"] = (
        math.inf if thrusters.failing is None else round(thrusters.failing[1] / dt)
    )


@kernel
def drive_thrusters(m: ThrustersRecord, rotation: Vector, command: Vector) -> None:
    """Thrusts of a step under constant thrust variables, N, into ``mean_thrust``; rotation: body to
    world axes.
    """
    if m.ideal:
        m.mean_thrust[:] = command
        return
    count = m.goal.shape[0]
    free = (command.shape[0] - count) // 2  # three variables of each, one of each rotor
    largest = m.largest * m.available
    for k in range(free):
        c = command[3 * k : 3 * k + 3]
        size = np.sqrt(c @ c)
        if size > NO_THRUST:
            turn(m.direction[k], rotation, c, size, m.remaining if m.settled else 0.0)
        level = max(_follow(m, k, min(max(size, m.least), largest)), 0.0)
        m.mean_thrust[3 * k : 3 * k + 3] = level * (rotation @ m.direction[k])
    for k in range(free, count):
        goal = command[2 * free + k]
        m.mean_thrust[2 * free + k] = _follow(m, k, min(max(goal, -largest), largest))
    m.settled = 1
    m.remaining_steps -= 1.0
    if m.remaining_steps < 0.0:
        if m.failing < free:
            m.mean_thrust[3 * m.failing : 3 * m.failing + 3] *= m.left
        else:
            m.mean_thrust[2 * free + m.failing] *= m.left


@kernel
def _follow(m: ThrustersRecord, k: int, goal: float) -> float:
    """Mean of a step of one thruster's magnitude, which follows a goal."""
    if m.settled == 0:
        m.goal[k], m.level[k] = goal, (goal, 0.0)
        return goal
    m.goal[k] += min(max(goal - m.goal[k], -m.slew), m.slew)
    state = np.array([m.level[k, 0] - m.goal[k], m.level[k, 1]])
    m.level[k] = m.transition @ state
    m.level[k, 0] += m.goal[k]
    return float(m.goal[k] + m.mean_away @ state)


@kernel
def turn(
    direction: Vector, rotation: Vector, command: Vector, size: float, remaining: float
) -> None:
    """Turn a direction (3,) of body axes towards that of a command in world axes, by a share of
    their angle.
    """
    goal = rotation[:, :3].T @ command / size
    cosine = min(max(float(goal @ direction), -1.0), 1.0)
    angle = np.arccos(cosine)
    sine = np.sin(angle)
    old, new = 0.0, 1.0
    if remaining > 0.0 and sine > 1e-6:
        old, new = np.sin(remaining * angle) / sine, np.sin((1.0 - remaining) * angle) / sine
    elif remaining > 0.0 and cosine < 0.0:
        return  # straight against it: no great circle leads there
    direction[:] = old * direction + new * goal
