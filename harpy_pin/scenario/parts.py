"""What all parts of a scenario have in common: a name, their own checks, and a form that JSON keeps
exactly.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass
from functools import cache
from typing import Any, ClassVar, Self, TypeVar, cast, get_type_hints

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.named_controllers import GOVERNORS
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.walking.schedules import SCHEDULES

_Part = TypeVar("_Part", bound="Part")
type_hints = cache(get_type_hints)  # compiles every annotation


@dataclass(frozen=True, kw_only=True)
class Part(checks.Checked):
    """A part of a scenario: settings that are checked when it is made.

    Attributes:
        name: what the part is called on the command line and in files.
        extension: the module outside the core that registers it, which files remember; empty for
            the core's parts.
    """

    name: ClassVar[str]
    extension: ClassVar[str] = ""

    @classmethod
    def settings(cls) -> dict[str, Any]:
        """The settings by name, with their defaults."""
        return defaults_of(cls)

    @classmethod
    @checked
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """The part with settings by their names.

        Args:
            settings: values by name.

        Raises:
            InputError: a value out of its domain.
        """
        return checks.record(f"part '{cls.name}'", settings, cls)

    def to_dict(self) -> dict[str, Any]:
        """Name and settings, ready for JSON and exact."""
        outside = {"import": self.extension} if self.extension else {}
        return {"name": self.name, **outside, **plain(asdict(self))}


@checked
def read_part(
    kinds: Mapping[str, type[_Part]], what: str, value: Any, usual: Sequence[str] = ()
) -> _Part:
    """A part from itself, its name, or what :meth:`Part.to_dict` made of it.

    Args:
        kinds: class of each name.
        what: the part is, for messages.
        value: to read. A mapping without a name, or None, is the first usual part that has all its
            settings.
        usual: names among which a part is chosen where none is named; all of them by default.

    Raises:
        InputError: an unknown name or setting, or a value out of its domain.
    """
    if isinstance(value, tuple(kinds.values())):
        return cast("_Part", value)
    if isinstance(value, str):
        value = {"name": value}
    value, usual = {} if value is None else value, usual or (*kinds,)
    if not isinstance(value, Mapping):
        valid = ", ".join(sorted({kind.__name__ for kind in kinds.values()}))
        raise InputError(
            f"{what} must be a part ({valid}) or a name, got {shown(value)}", name=what, value=value
        )
    settings = {key: value[key] for key in value if key not in ("name", "import")}
    name = value.get("name")
    if name is None:
        fitting = (name for name in usual if settings.keys() <= kinds[name].settings().keys())
        name = next(fitting, usual[0])
    if "import" in value and (not isinstance(name, str) or name not in kinds):
        raise InputError(
            f"the {what} {shown(name)} is known after 'import {value['import']}', which is missing",
            name=what,
            value=value,
        )
    check_part_name(kinds, what, name)
    kind = kinds[str(name)]
    for key in settings:
        owners = [other for other, part in kinds.items() if key in part.settings()]
        hint = f"it is a setting of the {what} '{owners[0]}'" if owners else ""
        checks.one_of(f"setting of the {what} '{name}'", key, kind.settings(), hint=hint)
    return kind.from_settings(settings)


def check_part_name(kinds: Mapping[str, type[Part]], what: str, name: object) -> None:
    """Refuse a part that is none of these kinds; for a schedule or a governor the message says
    where it goes.
    """
    hint = ""
    if isinstance(name, str):
        if what == "gait" and name in SCHEDULES:
            hint = f"'{name}' is a schedule: Walking(schedule='{name}'), --set gait.schedule={name}"
        if what == "controller" and name in GOVERNORS:
            hint = f"it is Governed(governor='{name}'), --set controller.governor={name}"
    checks.one_of(what, name, kinds, hint=hint)


def defaults_of(kind: type) -> dict[str, Any]:
    """The attributes of a dataclass by name, with their defaults.

    One without a default has None, or its class where that is a dataclass.
    """
    found: dict[str, Any] = {}
    for entry in fields(kind):
        if entry.default_factory is not MISSING:
            found[entry.name] = entry.default_factory()
        elif entry.default is not MISSING:
            found[entry.name] = entry.default
        else:
            inside = type_hints(kind)[entry.name]
            found[entry.name] = inside if is_dataclass(inside) else None
    return found


def plain(value: Any) -> Any:
    """Mappings, lists, numbers and names as JSON has them, with memory of their own; NumPy's become
    Python's.
    """
    return json.loads(json.dumps(value, allow_nan=False, default=lambda other: other.tolist()))
