"""Input checks shared by the constructors: each returns what it checked, or raises
:class:`InputError`.
"""

import inspect
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, fields
from functools import cache, partial
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError, shown

_Kind = TypeVar("_Kind")

MAX_TICKS = 10_000_000  # most ticks of a run, whose log is kept in memory
MAX_FRICTION = 10.0  # coefficient of friction that no pair of materials comes near
MAX_LAG = 1e3  # largest time constant of thrusts, s
ORTHONORMAL = 1e-6  # largest error of R Rᵀ of a rotation


def number(
    name: str, value: Any, *, low: float = -math.inf, high: float = math.inf, strict: bool = False
) -> float:
    """A finite number within [low, high] (``strict``: above ``low``), as a float."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        result = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{name} must be a number, got {shown(value)}", name=name, value=value
        ) from None
    below = result <= low if strict else result < low
    if not math.isfinite(result) or below or result > high:
        bounds = []
        if low > -math.inf:
            bounds.append(f"{'>' if strict else '≥'} {low:g}")
        if high < math.inf:
            bounds.append(f"≤ {high:g}")
        desired = " and ".join(["finite", *bounds])
        raise InputError(f"{name} must be {desired}, got {result!r}", name=name, value=value)
    return result


def keep(holder: Any, **values: Any) -> None:
    """Give a frozen dataclass the values that a check has made of its own."""
    for name, value in values.items():
        object.__setattr__(holder, name, value)


def rule(check: Callable[..., Any] = number, *, called: str = "", **bounds: Any) -> dict[str, Any]:
    """Metadata of a field of a :class:`Checked` dataclass, which keeps what a check returns of its
    value.

    Args:
        check: of this module, or one's own of a name and a value.
        called: how messages name it, where its own name does not do.
        bounds: further arguments of the check.
    """
    return {"check": partial(check, **bounds), "called": called}


def setting(default: Any, check: Callable[..., Any] = number, **how: Any) -> Any:
    """A field with a default, which is not checked, and a :func:`rule`; None as default allows
    None.
    """
    return field(default=default, metadata=rule(check, **how))


class Checked:
    """Base of dataclasses whose fields are checked by their :func:`rule` as they are made."""

    whose = ""
    """What stands in front of the names of the fields in messages."""

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, called, check, default in _rules(kind):
            value = getattr(self, name)
            if value is not default:
                object.__setattr__(self, name, check(called, value))


@cache
def _rules(kind: Any) -> tuple[tuple[str, str, Callable[..., Any], Any], ...]:
    """Name of each field that is checked, what messages call it, its check, and its default."""
    return tuple(
        (
            entry.name,
            entry.metadata["called"] or f"{kind.whose}{entry.name}",
            entry.metadata["check"],
            entry.default,
        )
        for entry in fields(kind)
        if "check" in entry.metadata
    )


def multiple(name: str, value: float, of: str, unit: float, *, low: int = 1) -> int:
    """How many times a time ``unit`` fits into the time ``value``, s; at least ``low`` times, and a
    whole number.

    Messages call the unit ``of``.
    """
    count = round(min(value / unit, MAX_TICKS))
    if count < low or abs(count * unit - value) > 1e-9:
        raise InputError(
            f"{name} {value:g} s must be a multiple of the {of} {unit:g} s", name=name, value=value
        )
    return count


def ticks(duration: float, period: float) -> int:
    """How many periods there are in a duration, at least one and at most :data:`MAX_TICKS`."""
    if duration > MAX_TICKS * period:
        raise InputError(
            f"duration {duration:g} s is more than {MAX_TICKS} periods of {period:g} s",
            name="duration",
        )
    return max(round(duration / period), 1)


def whole(name: str, value: Any, *, low: float = 0, high: float = math.inf) -> int:
    """A whole number within [low, high], as an int."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | np.integer)
        or not low <= value <= high
    ):
        bounds = f"≥ {low}" if high == math.inf else f"≥ {low} and ≤ {high}"
        raise InputError(
            f"{name} must be a whole number {bounds}, got {shown(value)}", name=name, value=value
        )
    return int(value)


def instance(name: str, value: Any, kind: type[_Kind]) -> _Kind:
    """An object of a class."""
    if not isinstance(value, kind):
        raise InputError(
            f"{name} must be a {kind.__name__}, got {shown(value)}", name=name, value=value
        )
    return value


def mapping(name: str, value: Any) -> Mapping[str, Any]:
    """A mapping."""
    if not isinstance(value, Mapping):
        raise InputError(f"{name} must be a mapping, got {shown(value)}", name=name, value=value)
    return value


def function(name: str, value: Any, arguments: int | None = None) -> None:
    """Refuse what cannot be called, or not with so many arguments; None is no function that was
    given.
    """
    if value is not None and not callable(value):
        raise InputError(f"{name} must be a function, got {shown(value)}", name=name, value=value)
    if value is None or arguments is None:
        return
    try:
        inspect.signature(value).bind(*range(arguments))
    except ValueError:  # of a function in C, which says nothing of its arguments
        return
    except TypeError:
        raise InputError(
            f"{name} must be a function of {arguments} argument{'s' * (arguments > 1)}, got "
            f"{shown(value)}",
            name=name,
            value=value,
        ) from None


def path(name: str, value: Any) -> Path:
    """The path of a file."""
    try:
        possible = isinstance(value, str | PathLike) and b"\0" not in os.fsencode(value)
    except UnicodeEncodeError:
        possible = False
    if not possible:
        raise InputError(f"{name} must be a path, got {shown(value)}", name=name, value=value)
    return Path(value)


def names(name: str, value: Any) -> tuple[str, ...]:
    """Names of parts of a robot; one name alone is not taken for its letters."""
    if not isinstance(value, Sequence) or not all(
        isinstance(entry, str) and entry.isprintable() for entry in value
    ):
        raise InputError(
            f"{name} must be a tuple of names, got {shown(value)}", name=name, value=value
        )
    if isinstance(value, str):
        raise InputError(
            f"{name} must be a tuple of names, got the name {shown(value)} alone",
            name=name,
            value=value,
        )
    return tuple(value)


def one_of(kind: str, value: Any, valid: Iterable[str], *, hint: str = "") -> str:
    """A name that is one of ``valid``, which messages list; a hint says what else may have been
    meant.
    """
    names = tuple(valid)
    if not isinstance(value, str) or value not in names:
        raise InputError.unknown(kind, value, names, hint)
    return value


def record(name: str, value: Any, kind: type[_Kind]) -> _Kind:
    """A dataclass from itself, or from a mapping of its attributes; unknown and missing names are
    refused.
    """
    if isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        raise InputError(
            f"{name} must be a {kind.__name__} or a mapping, got {shown(value)}",
            name=name,
            value=value,
        )
    for key in value:
        one_of(f"entry of the {name}", key, inspect.signature(kind).parameters)
    try:
        return kind(**value)
    except TypeError as error:
        raise InputError(f"{name}: {error}", name=name, value=value) from None


def array(name: str, value: ArrayLike, shape: int | tuple[int, ...] | None) -> NDArray[np.float64]:
    """A float64 array of the given shape, or of any (a copy, in C order); entries may be NaN, and
    masked ones are.
    """
    desired = (shape,) if isinstance(shape, int) else shape
    try:
        given = np.asarray(value)
        if given.dtype.kind in "USMm":
            raise TypeError
        if (
            type(value) is not np.ndarray
            and isinstance(value, np.ma.MaskedArray)
            and given.dtype.kind in "fiub"
        ):
            given = np.where(np.ma.getmaskarray(value), np.nan, given)
        result = None if np.iscomplexobj(given) else np.array(given, dtype=np.float64, order="C")
    except (TypeError, OverflowError, ValueError):
        raise InputError(
            f"{name} must be an array of numbers, got {shown(value)}", name=name, value=value
        ) from None
    if result is None:
        raise InputError(f"{name} must be real numbers, got {shown(value)}", name=name, value=value)
    if desired is not None and result.shape != desired:
        raise InputError(
            f"{name} must have shape {desired}, got {result.shape}", name=name, value=value
        )
    return result


def vector(name: str, value: ArrayLike, shape: int | tuple[int, ...]) -> NDArray[np.float64]:
    """A finite float64 array of the given shape (a copy, in C order)."""
    result = array(name, value, shape)
    if not np.all(np.isfinite(result)):
        raise InputError(
            f"{name} must be finite, got {shown(result.tolist())}", name=name, value=value
        )
    return result


def fixed_vector(name: str, value: ArrayLike, size: int = 3, **bounds: Any) -> tuple[float, ...]:
    """A finite vector as a tuple, for settings that do not change; bounds are those of
    :func:`number`.
    """
    return tuple(number(name, entry, **bounds) for entry in vector(name, value, size).tolist())


def rotation(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """A rotation matrix (3, 3), to 1e-6."""
    result = vector(name, value, (3, 3))
    if np.abs(result @ result.T - np.eye(3)).max() > ORTHONORMAL or np.linalg.det(result) < 0.0:
        message = f"{name} must be a rotation: orthonormal, of determinant 1; got"
        raise InputError(f"{message} {shown(result.tolist())}", name=name, value=value)
    return result


def gains(name: str, value: ArrayLike, size: int = 3) -> NDArray[np.float64]:
    """Non-negative gains of one vector: a scalar is repeated ``size`` times."""
    given = array(name, value, None)
    result = vector(name, np.full(size, given) if given.ndim == 0 else given, size)
    if np.any(result < 0.0):
        raise InputError(
            f"{name} must not be negative, got {shown(result.tolist())}", name=name, value=value
        )
    return result


def fixed_gains(
    name: str, value: ArrayLike, size: int = 3, *, high: float = math.inf
) -> float | tuple[float, ...]:
    """Non-negative gains for settings that do not change: a tuple, or a scalar for all."""
    if isinstance(value, int | float):
        return number(name, value, low=0.0, high=high)
    return fixed_vector(name, value, size, low=0.0, high=high)
