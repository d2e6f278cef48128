"""What all parts of a scenario have in common: a name, their own checks, and a form that JSON keeps exactly."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, TypeVar, cast

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.named_controllers import GOVERNORS
from harpy_pin.deprecated import new_value
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.walking.schedules import FOUR_FEET, TWO_FEET

__all__ = ["Part", "check_part_name", "plain", "read_part", "read_record"]

_Part = TypeVar("_Part", bound="Part")
_Record = TypeVar("_Record")


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a scenario: settings that are checked when it is made.

    Attributes:
        name: what the part is called on the command line and in files.
    """

    name: ClassVar[str]

    def to_dict(self) -> dict[str, Any]:
        """Name and settings, ready for JSON and exact."""
        return {"name": self.name, **plain(asdict(self))}


@checked
def read_part(kinds: Mapping[str, type[_Part]], what: str, value: Any) -> _Part:
    """A part from itself, its name, or what :meth:`Part.to_dict` made of it.

    Args:
        kinds: class of each name.
        what: the part is, for messages.
        value: to read.

    Raises:
        InputError: an unknown name or setting, or a value out of its domain.
    """
    if isinstance(value, tuple(kinds.values())):
        return cast("_Part", value)
    if isinstance(value, str):
        value = {"name": value}
    if not isinstance(value, Mapping):
        valid = ", ".join(sorted({kind.__name__ for kind in kinds.values()}))
        raise InputError(f"{what} must be a part ({valid}) or a name, got {shown(value)}", name=what, value=value)
    name = new_value(what, value.get("name"))
    if name is None:
        raise InputError(f"the {what} needs a 'name'; valid names: {', '.join(sorted(kinds))}", name=what, value=value)
    check_part_name(kinds, what, name)
    return read_record(kinds[str(name)], f"{what} '{name}'", {key: value[key] for key in value if key != "name"})


def check_part_name(kinds: Mapping[str, type[Part]], what: str, name: object) -> None:
    """Refuse a part that there is not; a schedule or a governor is told where it goes.

    Args:
        kinds: class of each name.
        what: the part is.
        name: of the part.

    Raises:
        InputError: an unknown name.
    """
    hint = ""
    if isinstance(name, str):
        if what == "gait" and name in (*FOUR_FEET, *TWO_FEET):
            hint = f"'{name}' is a schedule: --schedule {name}, Walking(schedule='{name}')"
        if what == "controller" and name in GOVERNORS:
            hint = f"it is Governed(governor='{name}'), --governor {name}"
    checks.one_of(what, name, kinds, hint=hint)


def read_record(kind: type[_Record], what: str, value: Any) -> _Record:
    """A dataclass from itself, or from a mapping of its attributes.

    Raises:
        InputError: unknown names, missing ones, or values out of their domains.
    """
    if isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        raise InputError(f"{what} must be a {kind.__name__} or a mapping, got {shown(value)}", name=what, value=value)
    valid = [entry.name for entry in fields(kind)]  # type: ignore[arg-type]
    for name in value:
        checks.one_of(f"entry of the {what}", name, valid)
    try:
        return kind(**value)
    except TypeError as error:
        raise InputError(f"{what}: {error}", name=what, value=value) from None


def plain(value: Any) -> Any:
    """Mappings, lists, numbers and names as JSON has them, with memory of their own; NumPy's become Python's."""
    return json.loads(json.dumps(value, allow_nan=False, default=lambda other: other.tolist()))
