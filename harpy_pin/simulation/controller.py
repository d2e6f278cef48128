"""What the simulator asks of a controller."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from harpy_pin.model.state import Command, State

__all__ = ["Controller"]


@runtime_checkable
class Controller(Protocol):
    """Anything with ``step(state) -> Command``.

    Members that are used where they are there:

    - ``period``: time between ticks, s (1 ms where there is none);
    - ``reset()``: forget the past, that is integrals, applied references and warm starts;
    - ``telemetry() -> Mapping[str, ArrayLike]``: signals of the last tick to log, the same names and shapes each tick;
    - ``describe() -> Mapping[str, Any]``: parameters, for the log's metadata.

    All controllers of this library have all four.
    """

    def step(self, state: State) -> Command:
        """Command of one tick; its arrays may be overwritten by the next.

        Args:
            state: what was measured; its arrays belong to the caller, and are overwritten by the next tick.
        """
        ...
