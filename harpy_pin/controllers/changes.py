"""Changes of single settings in a record of parameters, by their names."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from harpy_pin import checks
from harpy_pin.errors import InputError, shown

__all__ = ["changed"]

Record = TypeVar("Record")


def changed(record: Record, changes: Mapping[str, Any], *, fixed: Collection[str] = (), inside: str = "") -> Record:
    """A copy of a frozen dataclass with other values, checked as when it is made.

    Args:
        record: may hold further dataclasses.
        changes: values by name; those of a record inside as a mapping. Lists become tuples.
        fixed: names that may not change; those of a record inside after its name and a dot.
        inside: name of the record and a dot, for messages; empty at the top.

    Raises:
        InputError: unknown or fixed name, a value of the wrong kind or out of its domain.
    """
    if not isinstance(changes, Mapping):
        raise InputError(f"parameters {inside[:-1] or 'of the controller'} must be a mapping, got {shown(changes)}")
    valid = [entry.name for entry in fields(record)]  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in changes.items():
        checks.one_of("parameter", name, valid)
        if inside + name in fixed:
            raise InputError(f"parameter '{inside}{name}' has an argument of its own", name=name, value=value)
        default = getattr(record, name)
        if is_dataclass(default):
            value = changed(default, value, fixed=fixed, inside=f"{inside}{name}.")
        elif isinstance(default, bool) and not isinstance(value, bool):
            raise InputError(f"{inside}{name} must be true or false, got {shown(value)}", name=name, value=value)
        values[name] = tuple(value) if isinstance(value, list) else value
    return replace(record, **values)  # type: ignore[type-var]
