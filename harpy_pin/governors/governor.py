"""What every governor offers."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import ZERO, Record, RecordOf, flag, make_record
from harpy_pin.model.state import Vector


def check_update(x: Vector, x_r: Vector, size: int, dt: float) -> None:
    """Say what is wrong with the arguments of an ``update``, which may hold NaN, if anything is.

    Raises:
        InputError: wrong shapes, other arrays than of float64, or a time since the last update that
            is none.
    """
    checks.number("dt", dt, low=0.0)
    for name, value, shape in (("x", x, (9,)), ("x_r", x_r, (size,))):
        checks.array(name, value, shape)
        if not isinstance(value, np.ndarray) or value.dtype != np.float64:
            raise InputError(
                f"{name} must be a float64 array, got {value!r}", name=name, value=value
            )


class StatusRecord(RecordOf):
    """What a :class:`GovernorStatus` tells, for kernels."""

    infeasible: int = ZERO
    stuck: int = ZERO
    bad_samples: int = ZERO
    least_violation: float = 0.0


def _recorded(name: str, kind: type) -> Any:
    """An attribute that is a number of a record."""
    return property(
        lambda self: kind(self._record[name][0]),
        lambda self, value: self._record.__setitem__(name, value),
        doc="A number of the record, see the attributes of the class.",
    )


@fixed_arrays("h_r", "h_w", "rate")
class GovernorStatus(KeepsViews):
    """What a governor saw and did at its last update; its arrays are overwritten by the next.

    Args:
        names: of the constraint rows.
        h_r: (rows,) constraints at the target reference; positive is satisfied.
        h_w: (rows,) constraints at the applied reference, before the update.
        rate: (w,) ẋ_w.
        record: with the fields of a :class:`StatusRecord`, which a governor's kernel writes; by
            default its own.

    Attributes:
        stuck: the paper's governor has been repairing for so long that its reference does not
            follow the target, see :class:`harpy_pin.governors.erg.ExplicitReferenceGovernor`.
        bad_samples: updates with a state or target that was no good sample, since the last reset;
            see :meth:`Governor.update`.
        infeasible: no reference satisfies the rows, or (the paper's) both references violate one
            and it is repairing.
        least_violation: where it is infeasible, the least violation that could be achieved, N (the
            paper's: not known); +inf where the sample was bad: the reference then stays where it
            was.
    """

    infeasible: bool = _recorded("infeasible", bool)
    stuck: bool = _recorded("stuck", bool)
    bad_samples: int = _recorded("bad_samples", int)
    least_violation: float = _recorded("least_violation", float)

    def __init__(
        self,
        names: tuple[str, ...],
        h_r: Vector,
        h_w: Vector,
        rate: Vector,
        record: Record | None = None,
    ) -> None:
        self.names, self.h_r, self.h_w, self.rate = names, h_r, h_w, rate
        self._record = make_record(StatusRecord) if record is None else record
        infeasible = flag(self._record, "infeasible")
        self._signals: dict[str, ArrayLike] = {"h_r": h_r, "h_w": h_w, "infeasible": infeasible}

    def bad(self) -> None:
        """Count a bad sample: the status is infeasible, and the reference stays where it was."""
        self.bad_samples += 1
        self.infeasible, self.least_violation = True, float("inf")

    def signals(self) -> dict[str, ArrayLike]:
        """What is logged of it, by name: arrays that stay where they are."""
        return self._signals

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

    @property
    def status(self) -> GovernorStatus:
        """Status of the last update."""
        ...

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r.

        Args:
            x_r: (w,) target reference.
        """
        ...

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """Advance x_w by one tick.

        Args:
            x: (9,) measured [c; ċ; u]: position (m) and velocity (m/s) of the body, centre of
                pressure (m).
            x_r: (w,) target reference.
            dt: time since the last update, s.

        Returns:
            x_w, the array :attr:`applied` itself. Where x or x_r are not all finite numbers of at
            most :data:`~harpy_pin.model.entry.MAX_SAMPLE` it stays as it was, and the status says
            so: the next good sample is answered as if the bad one had never come.

        Raises:
            InputError: wrong shapes, no numbers at all, or a dt that is negative or not finite.
        """
        ...
