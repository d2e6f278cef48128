"""Kernels as the Python they are, all the way down: slow, and an oracle for what is made of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import CellType, FunctionType
from typing import Any

import numpy as np


def run_plain(function: FunctionType, arguments: tuple[Any, ...]) -> Any:
    """Call a kernel's function, and the kernels that it calls, as Python."""
    with np.errstate(all="ignore"):
        return _plain(function)(*map(_with_attributes, arguments))


class _Names(dict[str, Any]):
    """The names of a module, with kernels as the Python they are, and functions of C's library for NumPy's own."""

    def __init__(self, known: dict[str, Any]) -> None:
        super().__init__({n: v for n, v in known.items() if not hasattr(v, "py_func") and v is not np})
        self._known = known

    def __missing__(self, name: str) -> Any:
        value = self._known[name]
        return _Library() if value is np else _plain(value.py_func)


_FUNCTIONS: dict[FunctionType, Callable[..., Any]] = {}


def _plain(function: FunctionType) -> Callable[..., Any]:
    """The function with other globals."""
    if function not in _FUNCTIONS:
        code, known = function.__code__, _Names(function.__globals__)
        cells = tuple(CellType(_with_attributes(cell.cell_contents)) for cell in function.__closure__ or ())
        made = FunctionType(code, known, code.co_name, function.__defaults__, cells)
        _FUNCTIONS[function] = made
    return _FUNCTIONS[function]


class _Library:
    """NumPy, with exponential and circular functions of C's library: NumPy's own differ in the last place."""

    def __getattr__(self, name: str) -> Any:
        own: dict[str, Callable[..., float]] = {"sin": math.sin, "cos": math.cos, "tanh": math.tanh, "exp": math.exp}
        own |= {"arctan2": math.atan2, "arccos": math.acos}
        return _quiet(own[name]) if name in own else getattr(np, name)


def _quiet(function: Callable[..., float]) -> Callable[..., float]:
    """The function with NaN and infinity in the place of exceptions, as in C."""

    def quiet(*numbers: float) -> np.float64:
        try:
            return np.float64(function(*numbers))
        except ValueError:
            return np.float64(np.nan)
        except OverflowError:
            return np.float64(np.inf)

    return quiet


def _with_attributes(value: Any) -> Any:
    """A record whose fields are attributes, as in a kernel."""
    if isinstance(value, tuple):
        return tuple(map(_with_attributes, value))
    if isinstance(value, np.void):
        return np.asarray(value).view(np.recarray)[()]
    if isinstance(value, np.ndarray) and value.dtype.names:
        return value.view(np.recarray)
    return _plain(value.py_func) if hasattr(value, "py_func") else value
