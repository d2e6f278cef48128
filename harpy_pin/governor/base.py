"""What every governor offers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from harpy_pin.state import Vector

__all__ = ["Governor", "GovernorStatus"]


@dataclass(slots=True)
class GovernorStatus:
    """What a governor saw and did at its last update; its arrays are overwritten by the next.

    Attributes:
        names: of the constraint rows.
        h_r: (rows,) constraints at the target reference; positive is satisfied.
        h_w: (rows,) constraints at the applied reference, before the update.
        rate: (w,) ẋ_w.
        infeasible: both references violated a row: the governor was repairing, and promises nothing.
    """

    names: tuple[str, ...]
    h_r: Vector
    h_w: Vector
    rate: Vector
    infeasible: bool = False
    least_violation: float = 0.0

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the rows that the target reference violates."""
        return tuple(name for name, h in zip(self.names, self.h_r, strict=True) if h < 0.0)


class Governor(Protocol):
    """Turns a target reference x_r into an applied reference x_w.

    Attributes:
        applied: (w,) x_w.
        status: of the last update.
    """

    applied: Vector
    status: GovernorStatus

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r."""
        ...

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """Advance x_w by one tick.

        Args:
            x: (9,) measured [c; ċ; u]: position (m) and velocity (m/s) of the body, centre of pressure (m).
            x_r: (w,) target reference.
            dt: time since the last update, s.

        Returns:
            x_w, the array :attr:`applied` itself.
        """
        ...
