"""Whether what is written and what is read afterwards may be the same memory."""

from __future__ import annotations

from collections.abc import Iterable

from harpy_pin.kernels.arrays import as_array
from harpy_pin.kernels.types import Value


def may_meet(view: Value, value: Value) -> bool:
    """Whether two views of the same memory may share some elements."""
    return not (view.fields and value.fields) or bool(stems(view.fields) & stems(value.fields))


def may_overlap(view: Value, value: Value) -> bool:
    """Whether two views of the same memory may share some elements, but not each with itself.

    Rows, their parts from the same index on, and equal fields of records are the same or have
    nothing in common.
    """
    alike = as_array(view).strides == as_array(value).strides
    if alike and view.code == value.code:
        return False
    if not (alike and view.fields and value.fields):
        return may_meet(view, value)
    common = stems(view.fields) & stems(value.fields)
    paths = {path for path in view.fields | value.fields if path.partition("+")[0] in common}
    return len(paths) > len(common) or any(path.endswith("+") for path in paths)


def stems(paths: Iterable[str]) -> set[str]:
    """Ways to memory, without which part of it."""
    return {path.partition("+")[0] for path in paths}


def ways(way: str, given: dict[str, Value]) -> frozenset[str]:
    """Ways to memory as the caller knows them; nothing for memory of the function's own."""
    name, dot, rest = way.partition("+")[0].partition(".")
    paths = given[name].fields or given[name].roots if name in given else frozenset[str]()
    return frozenset(f"{path}{dot}{rest}" for path in paths)
