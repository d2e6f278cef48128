"""Scenarios of releases before 0.2, whose settings were not sorted into parts: arguments, attributes and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypedDict

from harpy_pin.controllers.parameters import GovernedParameters, WholeBodyParameters
from harpy_pin.deprecated import ENTRIES, new_entries, warn_of_old_name
from harpy_pin.errors import InputError, shown
from harpy_pin.scenario.controller_parts import CONTROLLER_PARTS, Condensed, Governed
from harpy_pin.scenario.disturbances import Disturbances
from harpy_pin.scenario.gait_parts import GAIT_PARTS, Commanded, gaits_of
from harpy_pin.scenario.parts import Part, read_part, read_record
from harpy_pin.scenario.plant_parts import PLANT_PARTS, Compliant
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.sensors import Noise

__all__ = ["MOVED", "FlatSettings", "is_flat", "old_value", "parts_of", "parts_of_file"]

MOVED = {
    "governor": ("controller", "governor"),
    "evaluate_at": ("controller", "evaluate_at"),
    "reading": ("controller", "evaluate_at"),
    "limits": ("controller", "limits"),
    "thrust": ("controller", "thrust"),
    "parameters": ("controller", "parameters"),
    "assumed_friction": ("controller", "mu"),
    "assumed_stiffness": ("gait", "stiffness"),
    "speed": ("gait", "speed"),
    "command": ("gait", "velocity"),
    "plant_preset": ("plant", "preset"),
    "pushes": ("disturbances", "pushes"),
    "noise": ("disturbances", "noise"),
    "delay": ("disturbances", "delay"),
    "mass_error": ("disturbances", "mass_error"),
    "start_velocity": ("disturbances", "start_velocity"),
    "seed": ("disturbances", "seed"),
}
"""Part and name of each setting now."""
_KINDS: dict[str, Mapping[str, type[Part]]] = {"gait": GAIT_PARTS, "controller": CONTROLLER_PARTS, "plant": PLANT_PARTS}
_WITHOUT_EFFECT: dict[str, tuple[object, ...]] = {
    "governor": (None, "none"),
    "evaluate_at": ("measured", "tracked"),
    "limits": (False, True),
    "thrust": (True,),
    "assumed_stiffness": (None,),
    "plant_preset": (None,),
    "command": ((), []),
}
"""Values that a part without the setting took before."""


class FlatSettings(TypedDict, total=False):
    """The settings that were arguments of a scenario; for their meaning see the part that has them now."""

    governor: str | None
    evaluate_at: str
    reading: str
    limits: bool
    thrust: bool
    parameters: Mapping[str, Any]
    assumed_friction: float | None
    assumed_stiffness: float | None
    speed: float
    command: Sequence[Sequence[float]]
    plant_preset: str | None
    pushes: Sequence[Push]
    noise: Noise
    delay: float
    mass_error: float
    start_velocity: Sequence[float]
    seed: int


def parts_of(robot: str, given: Mapping[str, Any], flat: Mapping[str, Any]) -> dict[str, Any]:
    """The parts of a scenario, with settings that were given by their old names.

    Args:
        robot: of the scenario.
        given: gait, controller, plant and disturbances as they were given; none where they were not.
        flat: settings by their old names.

    Raises:
        TypeError: a name that never was a setting.
        InputError: a setting that the part does not have.
    """
    for name in flat:
        if name not in MOVED:
            raise TypeError(f"Scenario() has no argument '{name}'")
    settings = {ENTRIES.get(name, name): value for name, value in flat.items()}
    parts = _parts_without_settings(robot, given, settings)
    for name in flat:
        part = MOVED[name][0]
        warn_of_old_name(f"Scenario({name}=...)", f"Scenario({part}={_example(robot, name, parts[part])})")
    return _with_settings(parts, settings, strict=True)


def is_flat(data: Mapping[str, Any]) -> bool:
    """Whether a file's scenario has settings that are now those of parts."""
    return not MOVED.keys().isdisjoint(data)


def parts_of_file(data: Mapping[str, Any]) -> dict[str, Any]:
    """What :meth:`Scenario.from_dict` reads, from the scenario of an old file."""
    data = new_entries(data)
    flat = {name: value for name, value in data.items() if name in MOVED}
    rest = {name: value for name, value in data.items() if name not in MOVED}
    parts = _parts_without_settings(str(data.get("robot", "harpy")), rest, flat)
    return rest | _with_settings(parts, flat, strict=False)


def old_value(scenario: Any, name: str) -> Any:
    """A setting of a scenario by its old name."""
    part, new = MOVED[name]
    warn_of_old_name(f"scenario.{name}", f"scenario.{part}.{new}")
    none = _WITHOUT_EFFECT.get(name, (None,))[0]
    return getattr(getattr(scenario, part), new, none)


def _parts_without_settings(robot: str, given: Mapping[str, Any], flat: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The parts as mappings: as they were given, or what they are by default.

    Args:
        robot: of the scenario.
        given: the parts as they were given.
        flat: settings by their old names, by which the controller is chosen.
    """
    parts: dict[str, dict[str, Any]] = {"disturbances": _as_mapping(given.get("disturbances"))}
    defaults = {"gait": gaits_of(robot)[0], "controller": _default_controller(flat), "plant": Compliant.name}
    for part, default in defaults.items():
        value = given.get(part)
        parts[part] = read_part(_KINDS[part], part, default if value is None else value).to_dict()
    return parts


def _with_settings(
    parts: dict[str, dict[str, Any]], flat: Mapping[str, Any], *, strict: bool
) -> dict[str, dict[str, Any]]:
    """The parts with flat settings in their places.

    Args:
        parts: as mappings; they are changed.
        flat: settings by their old names.
        strict: whether a setting that a part does not have is refused; else it is dropped, as it had no effect.
    """
    for name, value in flat.items():
        part, new = MOVED[name]
        if part == "disturbances" or new in parts[part]:
            if name != "command" or len(value):
                parts[part][new] = value
        elif strict and name != "speed" and not _without_effect(name, value):
            named = parts[part]["name"]
            raise InputError(f"the {part} '{named}' has no '{new}', got {shown(value)}", name=name, value=value)
    if parts["gait"]["name"] == Commanded.name and "speed" in flat and not len(flat.get("command", ())):
        parts["gait"]["velocity"] = (flat["speed"], 0.0, 0.0)
    return parts


def _default_controller(flat: Mapping[str, Any]) -> str:
    """The controller where none is named: the governed one with a setting that only this one has."""
    own = {entry.name for entry in fields(GovernedParameters)} - {entry.name for entry in fields(WholeBodyParameters)}
    parameters = flat.get("parameters") or {}
    names = parameters if isinstance(parameters, Mapping) else ()
    default = {"governor": None, "evaluate_at": "measured", "limits": False, "thrust": True}
    changed = any(flat.get(name, value) != value for name, value in default.items())
    return Governed.name if changed or not own.isdisjoint(names) else Condensed.name


def _without_effect(name: str, value: Any) -> bool:
    """Whether a part without this setting took the value before."""
    return any(type(value) is type(other) and value == other for other in _WITHOUT_EFFECT.get(name, ()))


def _as_mapping(value: Disturbances | Mapping[str, Any] | None) -> dict[str, Any]:
    """Disturbances as a mapping."""
    value = {} if value is None else value
    return read_record(Disturbances, "disturbances", value).to_dict()


def _example(robot: str, name: str, built: Mapping[str, Any]) -> str:
    """How a setting is given now: to the part that is built if it has it, else to one of the robot's, else to any.

    Args:
        robot: of the scenario.
        name: of the setting, the old one.
        built: the part.
    """
    part, new = MOVED[name]
    if part == "disturbances":
        return f"Disturbances({new}=...)"
    for kind_name in (built["name"], *(gaits_of(robot) if part == "gait" else ()), *_KINDS[part]):
        kind = _KINDS[part][kind_name]
        settings = [entry.name for entry in fields(kind)]
        if new in settings:
            return f"{kind.__name__}({new}=...)"
        if name == "speed" and "velocity" in settings:
            return f"{kind.__name__}(velocity=...)"
    raise AssertionError(f"no {part} has the setting '{new}'")
