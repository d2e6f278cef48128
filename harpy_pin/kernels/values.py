"""What an expression of a kernel stands for: each kind of value with its type and its C."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from harpy_pin.kernels.code import ATOM, BINDING, NONE, UNARY, Code, c, joined
from harpy_pin.kernels.types import Array, Scalar, Size, Struct


class Refused(Exception):
    """Something that kernels do not have."""


def refuse_if(condition: bool, reason: str) -> None:
    """Refuse what kernels do not have."""
    if condition:
        raise Refused(reason)


def refused(node: ast.AST, reason: str = "") -> Refused:
    """The refusal of a piece of source, which the message begins with."""
    return Refused(f"'{ast.unparse(node)}'{reason}")


class Number(NamedTuple):
    """A number."""

    type: Scalar
    code: Code
    constant: int | float | bool | None = None  # the number, where it is known when compiling


@dataclass(frozen=True)
class View:
    """An array in memory, or a part of one; without axes it is one element of it."""

    type: Array
    base: Code  # the address of the array; NULL where it has no elements
    offset: Code | None = None  # of its first element from there, in elements
    roots: frozenset[str] = NONE  # names of the arguments whose memory it is
    # the same with the ways through records, p.tree.axes; a + where it may be a part of that only,
    # such as some rows, and the first index of the part if it is known; nothing where no way is
    # known
    ways: frozenset[str] = NONE
    made: bool = False  # whether it is memory that nothing has a name for yet

    @property
    def address(self) -> Code:
        """The address of the first element."""
        if self.offset is None:
            return self.base
        return c("{} + {}", self.base.within(BINDING["+"]), self.offset, binding=BINDING["+"])

    def at(self, offset: Code | None) -> View:
        """The view from an element on."""
        if offset is None:
            return self
        both = offset if self.offset is None else joined([self.offset, offset], " + ", BINDING["+"])
        return View(self.type, self.base, both, self.roots, self.ways)

    @property
    def shape(self) -> tuple[Size, ...]:
        """Its sizes."""
        return self.type.shape

    @property
    def element(self) -> Scalar | Struct:
        """The type of its elements."""
        return self.type.element

    @property
    def target(self) -> View:
        """The memory that is written where this array is."""
        return self

    @property
    def is_null(self) -> bool:
        """Whether it has no elements, and no memory."""
        return self.base.text == "NULL"

    @property
    def place(self) -> Code:
        """Its first element, to be written."""
        return c("{}[{}]", self.base.within(ATOM), self.offset or "0")


@dataclass(frozen=True)
class Computed:
    """An array that is in no memory yet."""

    element: Scalar
    shape: tuple[Size, ...]
    # the element with some indices; None where elements are left as they are found in memory
    rule: Callable[[Sequence[Number]], Number] | None = None
    # the arrays in memory that it reads, with whether only the element with the same indices is
    # read
    reads: tuple[tuple[View, bool], ...] = ()
    every: Number | None = None  # what all its elements are
    target: View | None = None  # the array whose elements it chooses


@dataclass(frozen=True)
class Record:
    """A record in memory."""

    type: Struct
    code: Code
    pointer: bool  # whether the code is the address of it; or the record itself
    roots: frozenset[str] = NONE  # as those of a view
    ways: frozenset[str] = NONE

    @property
    def address(self) -> Code:
        """The address of it."""
        return self.code if self.pointer else c("&{}", self.code, binding=UNARY)


def memory_at(
    address: Code, kind: Array | Struct, roots: frozenset[str], ways: frozenset[str]
) -> View | Record:
    """The array or the record that is at an address."""
    if isinstance(kind, Array):
        return View(kind, address, None, roots, ways)
    return Record(kind, address, True, roots, ways)


@dataclass(frozen=True)
class Items:
    """Several values at once."""

    items: tuple[Value, ...]


@dataclass(frozen=True)
class Named:
    """A kernel, or a module or function of Python, by its name."""

    target: Any


@dataclass(frozen=True)
class Done:
    """A call that gives nothing."""

    code: Code


AnArray = View | Computed
Value = Number | View | Computed | Record | Items | Named | Done
