"""What every governor offers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from harpy_pin import checks
from harpy_pin.model.record import Record, field
from harpy_pin.model.state import Vector

__all__ = ["Governor", "GovernorStatus", "check_batch"]


def check_batch(x: Vector, x_r: Vector, applied: Vector) -> None:
    """Check the arguments of an ``update_batch``.

    Args:
        x: (N, 9) measured states [c; ċ; u].
        x_r: (N, 6) targets.
        applied: (N, 6) applied references of the last tick, overwritten by those of this one. What ``update_batch``
            returns is (N,) the least violation of each, N.

    Raises:
        InputError: shapes that do not match, or entries that are not finite.
    """
    checks.vector("x", x, (len(x), 9))
    checks.vector("x_r", x_r, (len(x), 6))
    checks.vector("applied", applied, (len(x), 6))


@dataclass(slots=True)
class GovernorStatus:
    """What a governor saw and did at its last update; its arrays are overwritten by the next.

    Attributes:
        names: of the constraint rows.
        h_r: (rows,) constraints at the target reference; positive is satisfied.
        h_w: (rows,) constraints at the applied reference, before the update.
        rate: (w,) ẋ_w.
        infeasible: the governor promises nothing: no reference satisfies its rows, or (the paper's) both references
            violate one and it is repairing.
        least_violation: where it is infeasible, the least violation that could be achieved, N (the paper's: not known);
            +inf where the readings were no numbers: the reference then stays where it was.
    """

    names: tuple[str, ...]
    h_r: Vector
    h_w: Vector
    rate: Vector
    infeasible: bool = False
    least_violation: float = 0.0

    @classmethod
    def from_record(cls, names: tuple[str, ...], record: Record) -> GovernorStatus:
        """A status whose arrays are the fields ``h_r``, ``h_w`` and ``rate`` of a governor's record."""
        return cls(names, field(record, "h_r"), field(record, "h_w"), field(record, "rate"))

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
