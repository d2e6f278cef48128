"""Records: the form in which kernels take what an object knows.

A record is a structured array of one element with named fields. So a kernel reads like its equation
(``p.stiffness``, never ``p[0]``), and one argument crosses from Python into compiled code where there would be
twenty: 0.3 µs instead of 1.1. The shapes of the fields belong to its type, so kernels are compiled anew for a robot
of another size (:mod:`harpy_pin.model.compiling` says so while it happens).

In a kernel, ``p = record[0]`` gives access to the fields. Fields that are arrays are views: kernels write into them.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Record", "RecordViews", "field", "fields", "make_record"]

Record = NDArray[np.void]
"""A structured array of shape (1,)."""


class RecordViews:
    """Base of objects whose attributes are views of their record.

    They refuse to be copied or pickled: the attributes of a copy would be arrays that no kernel reaches.
    """

    __slots__ = ()

    def __reduce__(self) -> NoReturn:
        """Refuse."""
        raise TypeError(f"a {type(self).__name__} holds views and cannot be copied or pickled; make a new one")


def make_record(**values: ArrayLike) -> Record:
    """A record with a field for each value.

    Args:
        values: numbers or arrays. Integers and booleans of NumPy, and ``bool``, become int64; another record becomes a
            part of this one; the rest is float64.
    """
    arrays = {name: np.asarray(value) for name, value in values.items()}
    shapes = {name: () if array.dtype.names else array.shape for name, array in arrays.items()}
    record = np.zeros(1, _layout(tuple((name, _kind(value), shapes[name]) for name, value in values.items())))
    for name, array in arrays.items():
        record[name] = array
    return record


def field(record: Record, name: str) -> NDArray[Any]:
    """A field that is an array, as a view into the record."""
    view: NDArray[Any] = record[name][0]
    return view


def fields(record: Record) -> dict[str, Any]:
    """Fields by name, for a larger record that holds those of a smaller one.

    They come after its own.
    """
    return {name: record[name][0] for name in record.dtype.names or ()}


@cache
def _layout(parts: tuple[tuple[str, Any, tuple[int, ...]], ...]) -> np.dtype[np.void]:
    """Type of the records with these fields: one object for equal types, which a kernel compares at a glance."""
    return np.dtype(list(parts), align=True)


def _kind(value: ArrayLike) -> Any:
    """Type of a field. A Python integer is a number like any other: ``mu=1`` must not compile kernels anew."""
    if isinstance(value, np.ndarray) and value.dtype.names:
        return value.dtype
    whole = isinstance(value, bool | np.integer | np.bool_)
    if isinstance(value, np.ndarray):
        whole = value.dtype.kind in "ib"
    return np.int64 if whole else np.float64
