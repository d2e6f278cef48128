"""Pushes: forces on the body that a simulation applies from outside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.model.state import Vector

MAX_IMPULSE = 1e6  # N·s along an axis


@dataclass(frozen=True)
class Push(checks.Checked):
    """A force on the body's origin that grows and fades as half a sine.

    Each physics step applies the mean of the force over the step, so that the impulse is whole
    whatever the step.

    Attributes:
        time: when it begins, s.
        impulse: (3,) integral of the force, world axes, N·s, at most 1e6 along each.
        duration: how long it lasts, s.
    """

    time: float = field(metadata=checks.rule(low=0.0, called="time of the push"))
    impulse: tuple[float, float, float] = field(
        metadata=checks.rule(checks.fixed_vector, low=-MAX_IMPULSE, high=MAX_IMPULSE)
    )
    duration: float = checks.setting(0.1, low=0.0, strict=True, called="duration of the push")

    @checked
    def share(self, begin: float, end: float) -> float:
        """Share of the impulse that falls between two times, s.

        Args:
            begin: the earlier time, s.
            end: the later time, s.
        """

        def before(t: float) -> float:
            return 0.5 - 0.5 * math.cos(
                math.pi * min(max((t - self.time) / self.duration, 0.0), 1.0)
            )

        return before(end) - before(begin)


def _are_pushes(pushes: Sequence[Push]) -> None:
    if not isinstance(pushes, Sequence):
        raise InputError(
            f"pushes must be a tuple of pushes, got {shown(pushes)}", name="pushes", value=pushes
        )
    for push in pushes:
        checks.instance("a push", push, Push)


def push_forces(pushes: Sequence[Push], t: float, dt: float, steps: int) -> Vector:
    """(steps, 3) mean force of pushes over each of the physics steps dt, s, from the time t on,
    world axes, N.
    """
    _are_pushes(pushes)
    force = np.zeros((steps, 3))
    for push in pushes:
        if push.time < t + steps * dt and push.time + push.duration > t:
            for n in range(steps):
                begin = t + n * dt
                force[n] += push.share(begin, begin + dt) / dt * np.array(push.impulse)
    return force


def check_pushes(pushes: Sequence[Push], begin: float, end: float) -> None:
    """Refuse pushes that end before a run begins or begin after it ends, s."""
    _are_pushes(pushes)
    for push in pushes:
        if push.time + push.duration <= begin or push.time >= end:
            raise InputError(
                f"a push at {push.time:g} s lies outside the run from {begin:g} to {end:g} s",
                name="pushes",
                value=push,
            )
