"""Whether what is written and what is read afterwards may be the same memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from harpy_pin.kernels.code import NONE
from harpy_pin.kernels.values import Number, View


def may_meet(view: View, other: View) -> bool:
    """Whether two views of the same memory may share some elements."""
    return not (view.ways and other.ways) or bool(stems(view.ways) & stems(other.ways))


def may_overlap(view: View, other: View) -> bool:
    """Whether two views of the same memory may share some elements, but not each with itself.

    Rows, their parts from the same index on, and equal fields of records are the same or have
    nothing in common.
    """
    alike = view.type.strides == other.type.strides
    if alike and view.address.text == other.address.text:
        return False
    if not (alike and view.ways and other.ways):
        return may_meet(view, other)
    common = stems(view.ways) & stems(other.ways)
    ways = {way for way in view.ways | other.ways if way.partition("+")[0] in common}
    return len(ways) > len(common) or any(way.endswith("+") for way in ways)


def stems(ways: Iterable[str]) -> frozenset[str]:
    """Ways to memory, without which part of it."""
    return frozenset(way.partition("+")[0] for way in ways)


def part_of(view: View, begins: Sequence[Number]) -> frozenset[str]:
    """Ways to a part of an array, with where the part begins if that is all there is to know."""
    begin = begins[0].constant if len(begins) == 1 else None
    parts = {way: "" if "+" in way or begin is None else str(begin) for way in view.ways}
    return frozenset(f"{way.partition('+')[0]}+{begin}" for way, begin in parts.items())


def ways_of_caller(way: str, given: dict[str, frozenset[str]]) -> frozenset[str]:
    """Ways to memory of a kernel's arguments as the caller knows them, by the names of the
    arguments; nothing for memory of the kernel's own.
    """
    name, dot, rest = way.partition("+")[0].partition(".")
    return frozenset(f"{path}{dot}{rest}" for path in given.get(name, NONE))
