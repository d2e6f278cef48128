"""What a value of a kernel can be, how its type is written in C, and which C struct a record is.

A kernel knows numbers (``real``, ``integer``, ``boolean``), arrays of numbers or of records,
records, and tuples of these. Arrays are row-major; sizes that are known when the kernel is compiled
are constants of the type.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from harpy_pin.errors import KernelError
from harpy_pin.kernels.code import Code, infix, variable


@dataclass(frozen=True)
class Scalar:
    """A number; of two kinds the one of higher rank can hold both."""

    name: str
    rank: int

    def __str__(self) -> str:
        return self.name


BOOLEAN = Scalar("bool", 0)
INTEGER = Scalar("integer", 1)
REAL = Scalar("real", 2)
SINGLE = Scalar("float", 2)
"""The elements of an array of float32; a kernel computes with the real numbers that they are."""
KINDS = {"?": BOOLEAN, "l": INTEGER, "q": INTEGER, "d": REAL, "f": SINGLE}
"""Types of numbers by NumPy's letter."""


@dataclass(frozen=True)
class Nothing:
    """What a kernel without a result gives."""


NOTHING = Nothing()


@dataclass(frozen=True)
class Struct:
    """A record."""

    # NumPy's, aligned, so that its layout is that of a C struct
    dtype: np.dtype[Any]
    # of the argument or field that it was first met as
    name: str = field(compare=False, default="record")

    def __repr__(self) -> str:
        return f"{self.name}{_text(self.dtype)}"

    def fields(self) -> dict[str, Type]:
        """Types of the fields by name."""
        return _fields(self.dtype)


Size = int | Code
"""A size; C where it is known at run time only."""
UNKNOWN = Code("")
"""A size of an argument that is known at run time only."""
UNKNOWN_STEP = Code("?")
"""The same of a distance between neighbours, where there are gaps."""
AXES = ("rows", "columns", "layers", "blocks")
"""What sizes are called that are known at run time only."""


def known(sizes: tuple[Size, ...]) -> tuple[int, ...] | None:
    """Sizes that are all known when compiling."""
    found = tuple(size for size in sizes if isinstance(size, int))
    return found if len(found) == len(sizes) else None


@dataclass(frozen=True)
class Array:
    """An array, or a view of one."""

    element: Scalar | Struct  # of what
    shape: tuple[Size, ...]
    strides: tuple[Size, ...]  # distance of neighbours along each axis, in elements

    @classmethod
    def packed(cls, element: Scalar | Struct, shape: tuple[Size, ...]) -> Array:
        """An array without gaps."""
        strides: list[Size] = [1] if shape else []
        for size in reversed(shape[1:]):
            strides.insert(0, _times(size, strides[0]))
        return cls(element, tuple(shape), tuple(strides))

    @property
    def is_packed(self) -> bool:
        """Whether there are certainly no gaps between its elements."""
        return self.strides == Array.packed(self.element, self.shape).strides

    @property
    def empty(self) -> bool:
        """Whether it certainly has no elements."""
        return 0 in self.shape

    def mapped(self, size: Callable[[int, Code], Size], step: Callable[[int, Code], Size]) -> Array:
        """The type with others in the place of sizes and steps that are known at run time only, by
        axis.
        """
        shape = tuple(
            n if isinstance(n, int) else size(axis, n) for axis, n in enumerate(self.shape)
        )
        if self.is_packed:
            return Array.packed(self.element, shape)
        strides = enumerate(self.strides)
        return Array(
            self.element, shape, tuple(n if isinstance(n, int) else step(a, n) for a, n in strides)
        )

    @property
    def signature(self) -> Array:
        """The type with what is known at run time left open: one C function serves all of these."""
        return self.mapped(lambda axis, _: UNKNOWN, lambda axis, _: UNKNOWN_STEP)

    def named(self, own: str) -> Array:
        """The type with names for what is known at run time, as parameters of a function."""
        if len(self.shape) > len(AXES):
            raise KernelError(f"'{own}' has {len(self.shape)} axes, more than kernels pass on")
        names = [f"{own}_{axis}" for axis in (("size",) if len(self.shape) == 1 else AXES)]
        return self.mapped(
            lambda axis, _: variable(names[axis]), lambda axis, _: variable(f"{names[axis]}_step")
        )

    @property
    def sizes(self) -> list[Code]:
        """Its sizes and steps that are variables, each once."""
        sizes = (*self.shape, *self.strides)
        return list(dict.fromkeys(n for n in sizes if isinstance(n, Code) and n.is_name))


@dataclass(frozen=True)
class Tuple:
    """Several values at once."""

    items: tuple[Type, ...]


@dataclass(frozen=True)
class Fixed:
    """A truth value that is known when the kernel is compiled."""

    value: bool


Type = Scalar | Array | Struct | Tuple | Nothing | Fixed


def _times(a: Size, b: Size) -> Size:
    """Product of two sizes."""
    if isinstance(a, int) and isinstance(b, int):
        return a * b
    if a == 1 or b == 1:
        return b if a == 1 else a
    return infix(
        a if isinstance(a, Code) else Code(str(a)), "*", b if isinstance(b, Code) else Code(str(b))
    )


@cache
def _text(dtype: np.dtype[Any]) -> str:
    return repr(dtype)


@cache
def _fields(dtype: np.dtype[Any]) -> dict[str, Type]:
    fields: dict[str, Type] = {}
    for name in dtype.names or ():
        element, shape = element_of(dtype[name].base, name), dtype[name].shape
        fields[name] = Array.packed(element, shape) if shape else element
    return fields


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
