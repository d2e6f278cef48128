"""What the ticks of all controllers have in common: the command, and the answer to bad samples.

A sample or targets that are not finite are answered by the last command, which fades after
``HOLD_TICKS`` ticks. All arrays are as in :class:`harpy_pin.model.state.State`.
"""

from __future__ import annotations

from harpy_pin.kernels import kernel
from harpy_pin.model.entry import FADE, GOOD, HOLD_TICKS
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector

BAD_SAMPLE = 16
"""Status: the state or the targets are not finite, or the gait turns and the controller cannot."""
FALLBACK = 8
"""Status: the program has no solution, or none was found: the last command is held, then the
posture.
"""
VIOLATED = 1
"""Status: the governor's constraint does not hold with the command given."""


class TickRecord(RecordOf):
    """What every tick keeps."""

    verdict: int = ZERO  # what the last sample was, see :mod:`harpy_pin.model.entry`
    bad_samples: int = ZERO  # how many were bad since the last reset
    bad_in_a_row: int = ZERO  # how many of the last samples were bad
    torque: Vector = sized("joints")  # (joints,) of the command, N·m
    thrust: Vector = sized("thrusters", 3)  # (thrusters, 3) of the command, world axes, N


@kernel
def fading(r: TickRecord) -> float:
    """Count bad samples by the verdict; returns the factor on the last command."""
    if r.verdict == GOOD:
        r.bad_in_a_row = 0
    else:
        r.bad_samples += 1
        r.bad_in_a_row += 1
    return FADE if r.bad_in_a_row > HOLD_TICKS else 1.0
