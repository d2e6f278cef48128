"""Records: the form in which kernels take what an object knows.

A record is a structured array of one element with named fields. So a kernel reads like its equation
(``p.stiffness``, never ``p[0]``), and one argument crosses from Python into compiled code where
there would be twenty: 0.3 µs instead of 1.1. The shapes of the fields belong to its type, so
kernels are compiled anew for a robot of another size.

A kernel whose argument has such a type gets the element. Fields that are arrays are views: kernels
write into them.

What the fields are called and mean is said by a class, which is never instantiated::

    class SpringRecord(RecordOf):
        stiffness: float  # N/m
        force: Vector = sized("feet", 3)  # world axes, N

    record = make_record(SpringRecord, {"feet": 2}, stiffness=8000.0)  # a Records[SpringRecord]

Types and shapes of the fields are those of the values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from inspect import get_annotations
from math import prod
from sys import byteorder
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError
from harpy_pin.model.memory import room

Record = NDArray[np.void]  # a structured array of shape (1,)
NO_SIZES: Mapping[str, int] = {}
ALIGNED, PLACE = 32, 16
"""Records begin 16 bytes beyond a multiple of 32. There the vectors of their matrices lie well;
elsewhere ticks of the whole-body QP and of the contact-force filter take 1.15 times as long.
"""


class RecordOf:
    """Base of the classes that say which fields the elements of a record have.

    A field is an annotated name: ``float`` or ``int`` (flags are 0 or 1), an array, the class of a
    record that is a part of this one, or :class:`Records` of it where there are several. A class
    has the fields of its bases besides its own: of other records, so that one kernel takes several
    kinds of them, and of the dataclass whose numbers it holds.
    """

    def __init_subclass__(cls) -> None:
        _FIELDS[cls] = tuple(
            dict.fromkeys(name for one in reversed(cls.__mro__) for name in get_annotations(one))
        )
        _BEGINNING[cls] = {
            name: vars(one)[name]
            for one in reversed(cls.__mro__)
            if issubclass(one, RecordOf)
            for name in get_annotations(one)
            if name in vars(one)
        }

    if TYPE_CHECKING:

        def __getitem__(self, name: str) -> Any:
            """A field."""

        def __setitem__(self, name: str, value: ArrayLike) -> None:
            """Write a field."""


_FIELDS: dict[type[RecordOf], tuple[str, ...]] = {}
"""Names of the fields by class, in the order of the classes, bases first, which is that in
memory.
"""
_BEGINNING: dict[type[RecordOf], dict[str, Any]] = {}
"""What fields of a class are where a record is made without them."""
ZERO: Any = np.int64(0)  # what a field that is a whole number begins with


@dataclass(frozen=True)
class _Sized:
    """An array that is made with each record."""

    shape: tuple[int | str, ...]
    fill: float
    whole: bool

    def made(self, sizes: Mapping[str, int]) -> NDArray[Any]:
        """The array, with sizes for the names of its shape."""
        shape = [_size(entry, sizes) for entry in self.shape]
        return np.full(shape, self.fill, np.int64 if self.whole else np.float64)


def sized(*shape: int | str, fill: float = 0.0, whole: bool = False) -> Any:
    """A field that is an array, which every record has of its own.

    It is of real or whole numbers, ``fill`` to begin with. In its shape ``"3 feet + 1"`` is three
    times what a record's sizes have as ``feet``, and one.
    """
    return _Sized(shape, fill, whole)


def _size(entry: int | str, sizes: Mapping[str, int]) -> int:
    """A size of a field, as a number."""
    if isinstance(entry, int):
        return entry
    terms = (term.split() for term in entry.split("+"))
    return sum(
        prod(int(word) if word.isdigit() else sizes[word] for word in term) for term in terms
    )


Kind = TypeVar("Kind", bound=RecordOf)
Kind_co = TypeVar("Kind_co", bound=RecordOf, covariant=True)

if TYPE_CHECKING:

    class Records(np.ndarray[Any, np.dtype[np.void]], Generic[Kind_co]):
        """A structured array whose elements have the fields of a class."""

        @overload  # type: ignore[override]
        def __getitem__(self, index: str) -> NDArray[Any]: ...
        @overload
        def __getitem__(self, index: int | np.integer[Any]) -> Kind_co: ...
        @overload
        def __getitem__(self, index: slice) -> Records[Kind_co]: ...
        def __getitem__(self, index: Any) -> Any: ...

else:

    class Records(Generic[Kind_co]):
        """A structured array whose elements have the fields of a class: a word for annotations
        only.
        """


@overload
def make_record(
    kind: type[Kind], sizes: Mapping[str, int] = ..., /, **values: ArrayLike
) -> Records[Kind]: ...
@overload
def make_record(kind: None = None, /, **values: ArrayLike) -> Records[Any]: ...
def make_record(
    kind: type[RecordOf] | None = None, sizes: Mapping[str, int] = NO_SIZES, /, **values: ArrayLike
) -> Any:
    """A record with a field for each value.

    Args:
        kind: class of its element; a record without one has the fields that are given.
        sizes: numbers by the names in the shapes of the class.
        values: numbers or arrays. Integers and booleans of NumPy, and ``bool``, become int64;
            another record becomes a part of this one; the rest is float64.

    Raises:
        InputError: the class has other fields.
    """
    if kind is not None:
        beginning = {name: value for name, value in _BEGINNING[kind].items() if name not in values}
        values |= {
            name: v.made(sizes) if isinstance(v, _Sized) else v for name, v in beginning.items()
        }
        names = _FIELDS[kind]
        if values.keys() != {*names}:
            unknown, absent = sorted(values.keys() - {*names}), sorted({*names} - values.keys())
            raise InputError(
                f"a {kind.__name__} has no fields {unknown}, and needs {absent}",
                name="kind",
                value=kind,
            )
        values = {name: values[name] for name in names}
    arrays = {name: np.asarray(value) for name, value in values.items()}
    shapes = {name: () if array.dtype.names else array.shape for name, array in arrays.items()}
    layout = _layout(tuple((name, _kind(value), shapes[name]) for name, value in values.items()))
    memory = room(layout.itemsize + ALIGNED)
    record = np.ndarray((1,), layout, memory, (PLACE - memory.ctypes.data) % ALIGNED)
    for name, array in arrays.items():
        record[name] = array
    return record


def field(record: Record, name: str) -> NDArray[Any]:
    """A field as a view into the record; of a number an array without axes."""
    view: NDArray[Any] = record[name][0, ...]
    return view


def flag(record: Record, name: str) -> NDArray[np.bool_]:
    """A field that is 0 or 1 as a truth value without axes: a view into its lowest byte."""
    view: NDArray[np.bool_] = (
        field(record, name).reshape(1).view(np.bool_)[0 if byteorder == "little" else -1, ...]
    )
    return view


def same_layout(record: Record, own: Record) -> Record:
    """A record that kernels take in the place of one's own; an :class:`InputError` where its fields
    are others.
    """
    if record.dtype != own.dtype or record.shape != own.shape:
        raise InputError(
            "record must be that of the same robot and class", name="record", value=record
        )
    return record


def fields(record: Record) -> dict[str, Any]:
    """Fields by name, for a larger record that holds those of a smaller one.

    They come after its own.
    """
    columns = ((name, record[name]) for name in record.dtype.names or ())
    return {name: column if column.dtype.names else column[0] for name, column in columns}


@cache
def _layout(parts: tuple[tuple[str, Any, tuple[int, ...]], ...]) -> np.dtype[np.void]:
    """Type of the records with these fields: one object for equal types, which a kernel compares at
    a glance.
    """
    return np.dtype(list(parts), align=True)


def _kind(value: ArrayLike) -> Any:
    """Type of a field. A Python integer is a number like any other: ``mu=1`` must not compile
    kernels anew.
    """
    if isinstance(value, np.ndarray) and value.dtype.names:
        return value.dtype
    whole = isinstance(value, bool | np.integer | np.bool_)
    if isinstance(value, np.ndarray):
        whole = value.dtype.kind in "ib"
    return np.int64 if whole else np.float64
