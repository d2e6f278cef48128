"""Chattering of a signal, measured: how far it travels and how often it turns back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError

__all__ = ["Chattering", "chattering"]


@dataclass(frozen=True)
class Chattering:
    """How much a signal chatters.

    Attributes:
        variation_per_s: total variation per second, summed over the components, in units of the signal per s.
        reversals_per_s: changes of direction per second, summed over the components. A smooth signal has as many at a
            shorter step; one that chatters has more.
    """

    variation_per_s: float
    reversals_per_s: float


def chattering(signal: ArrayLike, *, period: float) -> Chattering:
    """Total variation and reversals of a sampled signal.

    Increments smaller than 1e-9 of the component's range are rounding, not motion: they end no direction.

    Args:
        signal: (n,) or (n, components).
        period: time between samples, s.

    Raises:
        InputError: fewer than two samples, or a period that is not positive.
    """
    checks.number("period", period, low=0.0, strict=True)
    values = np.asarray(signal, dtype=np.float64)
    values = values.reshape(len(values), -1)
    if len(values) < 2:
        raise InputError("chattering needs at least two samples", name="signal")
    duration = (len(values) - 1) * period
    reversals = 0
    for column in values.T:
        steps = np.diff(column)
        moving = steps[np.abs(steps) > 1e-9 * np.ptp(column)]
        reversals += int(np.count_nonzero(np.diff(np.sign(moving))))
    return Chattering(float(np.abs(np.diff(values, axis=0)).sum() / duration), reversals / duration)
