"""Shapes that a kernel states for its arguments: constants in C, and checked where Python calls the
kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import repeat
from typing import Any

import numpy as np

from harpy_pin.errors import InputError, shown
from harpy_pin.kernels.types import UNKNOWN, Size

Shape = tuple[int | str, ...] | str
ANY = -1  # a size that may be any, for bridge.c
_LEAST, _SYMBOL, _FACTORS = 1_000, 1_000_000, 1_000
_FLOAT = np.dtype(np.float64)


def constant_shape(stated: Shape | None, dtypes: Mapping[str, Any], axes: int) -> tuple[Size, ...]:
    """What is known of an array's shape when a kernel is compiled; nothing of a size that is
    not.

    It follows from what the kernel states and from the types of the arguments that are arrays, by
    name.
    """
    if stated is None:
        return (UNKNOWN,) * axes
    if isinstance(stated, str):
        return _field_shape(stated, dtypes)
    return tuple(entry if isinstance(entry, int) else UNKNOWN for entry in stated)


def encode(shape: tuple[Size, ...], stated: Shape | None, symbols: dict[str, int]) -> list[int]:
    """Sizes as bridge.c checks them: a size, any, a least size, or a multiple of a size that has a
    name.
    """
    if stated is None or isinstance(stated, str):
        return [n if isinstance(n, int) else ANY for n in shape]
    return [_encode(entry, symbols) for entry in stated]


def _encode(entry: int | str, symbols: dict[str, int]) -> int:
    number, name = _parse(entry)
    if not name:
        return number
    if name == "+":
        return -(_LEAST + number)
    return -(_SYMBOL + _FACTORS * symbols.setdefault(name, len(symbols)) + number)


def check_shapes(kernel: str, shapes: Mapping[str, Shape], given: Mapping[str, Any]) -> None:
    """Check arguments against what a kernel states; an :class:`InputError` says what was
    expected.
    """
    sizes: dict[str, int] = {}
    dtypes = {name: getattr(value, "dtype", None) for name, value in given.items()}
    for name, shape in shapes.items():
        value = given[name]
        if isinstance(shape, str) and "." not in shape:
            if not isinstance(value, int | np.integer) or not 0 <= value <= sizes[shape]:
                _refuse(kernel, name, f"a whole number from 0 to {sizes[shape]}", value)
            continue
        desired = _field_shape(shape, dtypes) if isinstance(shape, str) else shape
        fits = (
            isinstance(value, np.ndarray) and value.dtype == _FLOAT and value.ndim == len(desired)
        )
        if not fits or not all(map(_is, value.shape, desired, repeat(sizes))):
            known = ", ".join(f"{key} = {size}" for key, size in sizes.items())
            text = ", ".join(map(str, desired)) + ("," if len(desired) == 1 else "")
            _refuse(
                kernel,
                name,
                f"a float64 array of shape ({text})" + (f" with {known}" if known else ""),
                value,
            )


def _refuse(kernel: str, name: str, desired: str, value: Any) -> None:
    found = (
        f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else shown(value)
    )
    raise InputError(f"{name} of {kernel} must be {desired}, got {found}", name=name, value=value)


def _field_shape(path: str, dtypes: Mapping[str, Any]) -> tuple[int, ...]:
    """The shape of a field, ``"p.tree.axes"``."""
    argument, *names = path.split(".")
    dtype: Any = dtypes.get(argument)
    try:
        for name in names:
            dtype = dtype[name]
        return tuple(dtype.shape)
    except (TypeError, KeyError, IndexError):
        raise InputError(
            f"{argument} must be a record with '{'.'.join(names)}'", name=argument
        ) from None


@cache
def _parse(entry: int | str) -> tuple[int, str]:
    """Factor and name of an entry of a shape; without a name it is the number itself, with ``+``
    the least number.
    """
    if isinstance(entry, int):
        return entry, ""
    if entry.endswith("+"):
        return int(entry[:-1]), "+"
    name = entry.lstrip("0123456789")
    return int(entry[: -len(name)] or 1), name


def _is(size: int, desired: int | str, sizes: dict[str, int]) -> bool:
    """Whether a size is what it should be; a name that is met for the first time stands for it from
    now on.
    """
    number, name = _parse(desired)
    if not name:
        return size == number
    if name == "+":
        return size >= number
    return size == number * sizes.setdefault(name, size // number)
