"""Settings of a scenario by their dotted names, such as ``controller.mu``: one table of what all
the parts have.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any, NamedTuple

from harpy_pin.arguments import checked
from harpy_pin.ground.ground import Ground
from harpy_pin.scenario.controller_parts import CONTROLLER_PARTS, ControllerPart
from harpy_pin.scenario.disturbances import Disturbances
from harpy_pin.scenario.gait_parts import GAIT_PARTS
from harpy_pin.scenario.parts import Part, defaults_of
from harpy_pin.scenario.plant_parts import PLANT_PARTS
from harpy_pin.scenario.scenario import Scenario


class Setting(NamedTuple):
    """A setting of a scenario.

    Attributes:
        name: with dots.
        default: its value where none is given.
        parts: names of the parts that have it; all where there are none.
        meaning: from the documentation.
    """

    name: str
    default: Any
    parts: tuple[str, ...]
    meaning: str


@checked
def scenario_of(settings: Mapping[str, Any]) -> Scenario:
    """The scenario with these settings.

    Args:
        settings: values by dotted names, such as ``{"controller": "wbc",
            "controller.weights.swing": 0.5}``.

    Raises:
        InputError: an unknown name, or a value out of its domain.
        RobotError: the robot is not installed.
    """
    tree: dict[str, Any] = {}
    for name, value in settings.items():
        *above, last = str(name).split(".")
        place = tree
        for part in above:
            inner = place.get(part, {})
            place[part] = inner if isinstance(inner, dict) else {"name": inner}
            place = place[part]
        if isinstance(place.get(last), dict):
            place[last]["name"] = value
        else:
            place[last] = value
    return Scenario.from_dict(tree)


def settings_table() -> list[Setting]:
    """All settings that a scenario can have."""
    parts: dict[str, Mapping[str, type[Part]]] = {
        "gait": GAIT_PARTS,
        "controller": CONTROLLER_PARTS,
        "plant": PLANT_PARTS,
    }
    records = {"ground": Ground(), "disturbances": Disturbances()}
    meanings = _meanings(Scenario)
    found: list[Setting] = []
    for name, parameter in inspect.signature(Scenario).parameters.items():
        default = next(iter(parts[name])) if name in parts else parameter.default
        found.append(Setting(name, "" if name in records else default, (), meanings[name]))
        if name in records:
            found += _inside(records[name], f"{name}.", ())
        owners: dict[str, list[str]] = {}
        for kind in parts.get(name, {}).values():
            for setting in kind.settings():
                owners.setdefault(setting, []).append(kind.name)
        for setting, names in owners.items():
            kind = parts[name][names[0]]
            of = () if len(names) == len(parts[name]) else tuple(names)
            default, meaning = kind.settings()[setting], _meanings(kind).get(setting, "")
            if issubclass(kind, ControllerPart) and not meaning:
                meaning = _meanings(kind.further)[setting]
            if setting != "parameters":
                found += _entry(f"{name}.{setting}", default, of, meaning)
    return found


def _entry(name: str, default: Any, of: tuple[str, ...], meaning: str) -> list[Setting]:
    """A setting, or those inside it."""
    if is_dataclass(default):
        return list(_inside(default, f"{name}.", of))
    return [Setting(name, default, of, meaning)]


def _inside(record: Any, above: str, of: tuple[str, ...]) -> Iterator[Setting]:
    """The settings of a record, or of its class; the name of the record and a dot stand above
    them.
    """
    kind = record if isinstance(record, type) else type(record)
    meanings, defaults = _meanings(kind), defaults_of(kind)
    for name, default in (defaults if record is kind else vars(record)).items():
        yield from _entry(above + name, default, of, meanings.get(name, ""))


def _meanings(kind: type) -> dict[str, str]:
    """What the attributes of a class mean, by its documentation and that of its bases."""
    texts = (
        inspect.cleandoc(one.__doc__ or "").partition("Attributes:\n")[2]
        for one in reversed(kind.__mro__)
    )
    found = (
        pair for text in texts for pair in re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text, re.M)
    )
    return {name: " ".join(meaning.split()) for name, meaning in found}
