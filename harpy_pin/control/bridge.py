"""What a controller commands while its measurements are no numbers."""

from __future__ import annotations

from harpy_pin.model.entry import FADE, HOLD_TICKS
from harpy_pin.model.state import Command

__all__ = ["Bridge"]


class Bridge:
    """Holds the last good command for ``HOLD_TICKS`` = 20 bad samples in a row, then fades it by ``FADE`` = 0.9 a tick.

    A sample is bad where its time, or a measurement that the controller reads, is no finite number. Nothing else of the
    controller moves meanwhile, so that the next good sample is answered as if the bad ones had never come.

    Attributes:
        bad_samples: how many there were since the last reset.
        in_a_row: how many of them since the last good sample; the controller sets it to zero at a good one.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what there was."""
        self.bad_samples = self.in_a_row = 0

    def hold(self, command: Command) -> None:
        """Count a bad sample, and hold or fade the last good command, in place."""
        self.bad_samples += 1
        self.in_a_row += 1
        if self.in_a_row > HOLD_TICKS:
            command.torque *= FADE
            command.thrust *= FADE
