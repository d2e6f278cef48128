"""How much a sampled signal chatters."""

from typing import NamedTuple

import numpy as np

from harpy_pin.model.state import Vector


class Chattering(NamedTuple):
    """Total variation and changes of direction, both summed over the components.

    A smooth signal has as many changes of direction at a shorter step; one that chatters has more.
    """

    variation_per_s: float  # units of the signal per s
    reversals_per_s: float  # 1/s


def chattering(signal: Vector, *, period: float) -> Chattering:
    """That of a signal (n,) or (n, components), two samples at least, with a period between them,
    s.

    Increments smaller than 1e-9 of the component's range are rounding, not motion: they end no
    direction.
    """
    values = signal.reshape(len(signal), -1)
    duration = (len(values) - 1) * period
    reversals = 0
    for column in values.T:
        steps = np.diff(column)
        moving = steps[np.abs(steps) > 1e-9 * np.ptp(column)]
        reversals += int(np.count_nonzero(np.diff(np.sign(moving))))
    return Chattering(float(np.abs(np.diff(values, axis=0)).sum() / duration), reversals / duration)
