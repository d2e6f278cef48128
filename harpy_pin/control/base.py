"""What the controllers of this library offer beyond ``step``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from numpy.typing import ArrayLike

from harpy_pin.state import Command, State

__all__ = ["Controller"]


class Controller(Protocol):
    """A controller that logs itself.

    The simulator asks for no more than ``step``; the rest is used where it is there.

    Attributes:
        period: time between ticks, s.
    """

    period: float

    def step(self, state: State) -> Command:
        """Command of one tick; its arrays may be overwritten by the next."""
        ...

    def reset(self) -> None:
        """Forget the past: integrals, applied references, warm starts."""
        ...

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Signals of the last tick to log, the same names and shapes each time."""
        ...

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        ...
