"""What a value of a kernel can be, how its type is written in C, and which C struct a record is.

A kernel knows numbers (``real``, ``integer``, ``boolean``), arrays of numbers or of records,
records, and tuples of these. Arrays are row-major; sizes that are known when the kernel is compiled
are constants of the type.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from harpy_pin.errors import KernelError


@dataclass(frozen=True)
class Scalar:
    """A number; of two kinds the one of higher rank can hold both."""

    name: str
    rank: int

    def __str__(self) -> str:
        return self.name


BOOLEAN, INTEGER, REAL = Scalar("bool", 0), Scalar("integer", 1), Scalar("real", 2)
SINGLE = Scalar("float", 2)
"""The elements of an array of float32; a kernel computes with the real numbers that they are."""
KINDS = {"?": BOOLEAN, "l": INTEGER, "q": INTEGER, "d": REAL, "f": SINGLE}
"""Types of numbers by NumPy's letter."""


class ByPrecision(float):
    """A constant of a kernel's module that is another number where kernels compute in ``single``
    precision.
    """

    def __new__(cls, double: float, *, single: float) -> ByPrecision:
        """The number itself is that in double precision."""
        made = super().__new__(cls, double)
        made.single = single
        return made

    single: float


AXES = ("rows", "columns", "layers", "blocks")
"""What sizes are called that are known at run time only."""


@dataclass(frozen=True)
class Nothing:
    """The type of None."""


NOTHING = Nothing()


@dataclass(frozen=True)
class Struct:
    """A record."""

    dtype: np.dtype[Any] = field(
        compare=True
    )  # NumPy's, aligned, so that its layout is that of a C struct
    name: str = field(
        compare=False, default="record"
    )  # of the argument or field that it was first met as

    def __repr__(self) -> str:
        return f"{self.name}{_text(self.dtype)}"

    def fields(self) -> dict[str, Type]:
        """Types of the fields by name."""
        return _fields(self.dtype)


@dataclass(frozen=True)
class Array:
    """An array, or a view of one."""

    element: Scalar | Struct  # of what
    shape: tuple[int | str, ...]  # sizes; a string is an expression in C, known at run time only
    strides: tuple[
        int | str, ...
    ]  # distance of neighbours along each axis, in elements; a string like that of a shape

    @classmethod
    def packed(cls, element: Scalar | Struct, shape: tuple[int | str, ...]) -> Array:
        """An array without gaps."""
        strides: list[int | str] = []
        step: int | str = 1
        for size in reversed(shape):
            strides.insert(0, step)
            step = times(size, step)
        return cls(element, tuple(shape), tuple(strides))

    @property
    def is_packed(self) -> bool:
        """Whether there are certainly no gaps between its elements."""
        return self.strides == Array.packed(self.element, self.shape).strides

    @property
    def empty(self) -> bool:
        """Whether it certainly has no elements."""
        return 0 in self.shape

    @property
    def signature(self) -> Array:
        """The type with what is known at run time left open: one C function serves all of these."""
        shape = tuple(n if isinstance(n, int) else "" for n in self.shape)
        if self.is_packed:
            return Array.packed(self.element, shape)
        return Array(
            self.element, shape, tuple(n if isinstance(n, int) else "?" for n in self.strides)
        )

    def named(self, own: str) -> Array:
        """The type with names for what is known at run time, as parameters of a function."""
        if len(self.shape) > len(AXES):
            raise KernelError(f"'{own}' has {len(self.shape)} axes, more than kernels pass on")
        axes = ("size",) if len(self.shape) == 1 else AXES[: len(self.shape)]
        shape = tuple(
            n if isinstance(n, int) else f"{own}_{axis}"
            for n, axis in zip(self.shape, axes, strict=True)
        )
        if self.is_packed:
            return Array.packed(self.element, shape)
        strides = zip(self.strides, axes, strict=True)
        return Array(
            self.element,
            shape,
            tuple(n if isinstance(n, int) else f"{own}_{axis}_step" for n, axis in strides),
        )

    @property
    def sizes(self) -> list[str]:
        """Names of its sizes that are known at run time only."""
        return list(
            dict.fromkeys(
                n for n in (*self.shape, *self.strides) if isinstance(n, str) and n.isidentifier()
            )
        )


@dataclass(frozen=True)
class Tuple:
    """Several values at once."""

    items: tuple[Type, ...]

    @property
    def uniform(self) -> Scalar | None:
        """The type of all its items where they are numbers of one type."""
        first = self.items[0] if self.items else None
        return (
            first
            if isinstance(first, Scalar) and all(item == first for item in self.items)
            else None
        )


@dataclass(frozen=True)
class Function:
    """A kernel, or a function of NumPy or Python, by name."""

    target: Any


@dataclass(frozen=True)
class Fixed:
    """A truth value that is known when the kernel is compiled."""

    value: bool


Type = Scalar | Array | Struct | Tuple | Function | Nothing | Fixed


@dataclass(frozen=True)
class Value:
    """An expression of a kernel."""

    type: Type  # what it is
    code: str = (
        ""  # in C. Of an array the address of its first element; of a record the address of it.
    )
    # how tightly the outermost operator of the code binds, see :mod:`harpy_pin.kernels.operators`
    binding: int = 100
    constant: int | float | bool | None = None  # the number, where it is known when compiling
    items: tuple[Value, ...] = ()  # of a tuple
    roots: frozenset[str] = frozenset()  # names of the arguments whose memory it is
    # the same with the ways through records, p.tree.axes; a + where it may be a part of that only,
    # such as some rows,
    # and the first index of the part if it is known; nothing where no way is known
    fields: frozenset[str] = frozenset()
    volatile: bool = (
        False  # whether the code reads memory, so that its value depends on when it is evaluated
    )
    # of an array that is computed (:mod:`harpy_pin.kernels.arrays`): the element with some indices
    rule: Callable[[Sequence[Value]], Value] | None = None
    # and the arrays in memory that it reads, with whether only the element with the same indices is
    # read
    reads: tuple[tuple[Value, bool], ...] = ()


def times(a: int | str, b: int | str) -> int | str:
    """Product of two sizes."""
    if isinstance(a, int) and isinstance(b, int):
        return a * b
    if a == 1 or b == 1:
        return b if a == 1 else a
    return f"{a} * {b}"


@cache
def _text(dtype: np.dtype[Any]) -> str:
    return repr(dtype)


@cache
def _fields(dtype: np.dtype[Any]) -> dict[str, Type]:
    entries: dict[str, Type] = {}
    for name in dtype.names or ():
        base, shape = dtype[name].base, dtype[name].shape
        element = element_of(base, name)
        if shape:
            entries[name] = Array.packed(element, shape)
        else:
            entries[name] = element
    return entries


def element_of(dtype: np.dtype[Any], name: str) -> Scalar | Struct:
    """What the elements of an array of this type are; a :class:`KernelError` where a kernel has no
    such numbers.
    """
    if dtype.names is not None:
        return Struct(dtype, name)
    kind = KINDS.get(dtype.char)
    if kind is None or (kind is INTEGER and dtype.itemsize != 8) or not dtype.isnative:
        raise KernelError(
            f"a kernel knows float64, float32, int64 and bool, not {dtype} ('{name}')"
        )
    return kind
