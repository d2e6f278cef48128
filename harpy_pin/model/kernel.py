"""Kernels that Python may call, too: what it gives them is checked, what kernels give each other is not.

A compiled function reads and writes where the sizes of its arrays should be, and not where they are: an array that is
too short would be memory of somebody else. ``@kernel(...)`` above ``@njit`` states the shapes. In compiled code the
name still stands for the compiled function itself, so that this costs kernels nothing; a call from Python costs some
microseconds more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, update_wrapper
from inspect import signature
from itertools import repeat
from typing import Any, TypeVar, cast

import numpy as np
from numba.core.errors import TypingError

from harpy_pin.errors import InputError

__all__ = ["kernel"]

_Function = TypeVar("_Function", bound=Callable[..., Any])
Shape = tuple[int | str, ...] | str
_FLOAT = np.dtype(np.float64)


def kernel(**shapes: Shape) -> Callable[[_Function], _Function]:
    """Check the arguments of a compiled function where Python calls it.

    Args:
        shapes: for each argument that is an array its shape. An entry is a number, a name such as ``"n"`` that stands
            for the same number everywhere, a multiple of it (``"3n"``), or the least number (``"7+"``). ``"p.rate"`` in
            the place of a shape means that of a field of the argument ``p``. A number instead of an array is at most
            what a name stands for where the name is in the place of the shape.
    """

    def decorate(compiled: _Function) -> _Function:
        return cast(_Function, _Kernel(compiled, shapes))

    return decorate


class _Kernel:
    """A compiled function whose arguments are checked where Python calls it."""

    def __init__(self, compiled: Any, shapes: Mapping[str, Shape]) -> None:
        update_wrapper(self, compiled.py_func)
        self._compiled = compiled
        self._signature = signature(compiled.py_func)
        self._shapes = shapes
        defaults = [parameter.default is not parameter.empty for parameter in self._signature.parameters.values()]
        self._least = len(defaults) - sum(defaults)
        # What Numba takes the name for in compiled code.
        self._numba_type_ = compiled._numba_type_
        unknown = shapes.keys() - self._signature.parameters.keys()
        assert not unknown, f"{compiled.py_func.__name__} has no arguments {unknown}"

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if named or len(arguments) < self._least:
            given: Mapping[str, Any] = self._signature.bind(*arguments, **named).arguments
        else:
            given = dict(zip(self._signature.parameters, arguments, strict=False))
        sizes: dict[str, int] = {}
        for name, shape in self._shapes.items():
            self._check(name, given[name], self._wanted(shape, given), sizes)
        try:
            return self._compiled(*arguments, **named)
        except TypingError as error:
            kinds = ", ".join(f"{name}: {type(value).__name__}" for name, value in given.items())
            raise InputError(f"{self._called} does not take these arguments ({kinds})", name=self._called) from error

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_compiled"], name)

    @property
    def _called(self) -> str:
        return str(self._compiled.py_func.__name__)

    def _wanted(self, shape: Shape, given: Mapping[str, Any]) -> Shape:
        """The shape, read from a record where it is that of a field."""
        if not isinstance(shape, str) or "." not in shape:
            return shape
        argument, name = shape.split(".")
        try:
            return tuple(np.shape(given[argument][name]))
        except (TypeError, ValueError, IndexError, KeyError):
            raise InputError(f"{argument} of {self._called} must be a record with '{name}'", name=argument) from None

    def _check(self, name: str, value: Any, shape: Shape, sizes: dict[str, int]) -> None:
        if isinstance(shape, str):
            if not isinstance(value, int | np.integer) or not 0 <= value <= sizes[shape]:
                self._refuse(name, f"a whole number from 0 to {sizes[shape]}", value)
            return
        fits = isinstance(value, np.ndarray) and value.dtype == _FLOAT and value.ndim == len(shape)
        if not fits or not all(map(_is, value.shape, shape, repeat(sizes))):
            known = ", ".join(f"{key} = {size}" for key, size in sizes.items())
            text = ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "")
            self._refuse(name, f"a float64 array of shape ({text})" + (f" with {known}" if known else ""), value)

    def _refuse(self, name: str, wanted: str, value: Any) -> None:
        found = f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else f"{value!r:.60}"
        raise InputError(f"{name} of {self._called} must be {wanted}, got {found}", name=name, value=value)


@cache
def _parse(entry: int | str) -> tuple[int, str]:
    """Factor and name of an entry of a shape; without a name it is the number itself, with ``+`` the least number."""
    if isinstance(entry, int):
        return entry, ""
    if entry.endswith("+"):
        return int(entry[:-1]), "+"
    name = entry.lstrip("0123456789")
    return int(entry[: -len(name)] or 1), name


def _is(size: int, wanted: int | str, sizes: dict[str, int]) -> bool:
    """Whether a size is what it should be; a name that is met for the first time stands for it from now on."""
    number, name = _parse(wanted)
    if not name:
        return size == number
    if name == "+":
        return size >= number
    return size == number * sizes.setdefault(name, size // number)
