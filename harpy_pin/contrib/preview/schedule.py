"""When each foot of a trot stands and swings, and the intervals of the horizon."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harpy_pin.model.state import Vector

ROUNDING = 1e-6
"""Of times, as a share of a stride."""


class Horizon(NamedTuple):
    """Intervals in which no foot is lifted or set down, from the present on.

    Attributes:
        times: (N + 1,) at which they begin and end, s.
        contact: (N, feet) whether each foot is on the ground.
        stance: (N, feet) which stance of a foot it is, or that comes next: zero for the one under
            way, or for the next one of a foot in the air.
        touchdown: (N, feet) when that stance begins, s; negative where it has begun.
    """

    times: Vector
    contact: NDArray[np.bool_]
    stance: NDArray[np.int64]
    touchdown: Vector


def horizon(
    phase: Vector, *, stance: float, swing: float, duration: float, longest: float
) -> Horizon:
    """The intervals of a gait that goes on with the same durations.

    Args:
        phase: (feet,) share of its stride, from touchdown to touchdown, that each foot has done.
        stance: time that a foot is on the ground, s.
        swing: time that it is in the air, s.
        duration: how far to look, s.
        longest: largest length of an interval, s.
    """
    stride = stance + swing
    duty = stance / stride
    strides = np.arange(np.ceil(duration / stride) + 1.0)
    away = [(((event - phase) % 1.0)[:, None] + strides) * stride for event in (0.0, duty)]
    inside = np.concatenate(away).ravel()
    inside = np.sort(inside[(inside > ROUNDING * stride) & (inside < duration)])
    events = [0.0]
    for event in (*inside, duration):
        if event - events[-1] > ROUNDING * stride:
            count = int(np.ceil((event - events[-1]) / longest - ROUNDING))
            events += np.linspace(events[-1], event, count + 1)[1:].tolist()
    times = np.array(events)
    clock = 0.5 * (times[1:] + times[:-1])[:, None] / stride + phase
    contact = clock % 1.0 < duty
    number = np.where(contact, np.floor(clock), np.ceil(clock)).astype(np.int64)
    first = np.where(contact[0], 0, 1)  # of a foot in the air the next one counts as the first
    touchdown = (number - phase) * stride
    return Horizon(times, contact, number - first, touchdown)
