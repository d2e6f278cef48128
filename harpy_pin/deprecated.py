"""Names of the release before: they work, with a warning that says the new one. The next release drops them."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from inspect import signature
from types import ModuleType
from typing import Any, TypeVar

__all__ = ["around_call", "new_entries", "new_name", "new_value", "renamed_arguments", "start_of", "warn_of_old_name"]

_T = TypeVar("_T", bound=Callable[..., Any])

NAMES = {
    "CommandGovernorParameters": "FootholdGovernorParameters",
    "ContactForceGovernor": "ContactForceFilter",
    "ContactGovernorParameters": "ContactForceFilterParameters",
    "ExplicitController": "CondensedController",
    "ExplicitLaw": "CondensedSolver",
    "LawStatus": "CondensedStatus",
    "Patch": "FlatFoot",
    "named_gait": "make_named_gait",
}
"""Classes and functions."""
PACKAGES = {
    "control": ("controllers",),
    "explicit": ("wbc.condensed",),
    "gait": ("gaits",),
    "governor": ("governors", "gaits"),
    "mujoco": ("simulation.mujoco",),
    "plant": ("simulation", "log"),
}
"""Where the names of a package are now."""
VALUES = {
    "controller": {"explicit": "condensed"},
    "governor": {"contact": "filter"},
    "formulation": {"command": "input_space", "force": "contact_force"},
}
"""Values of settings."""
ENTRIES = {
    "reading": "evaluate_at",
    "patches": "friction_strips",
    "law_status": "condensed_status",
    "wanted_force": "desired_force",
}
"""Signals and settings in files."""


_BETWEEN = ("dataclasses", "harpy_pin", "importlib", "lazy_loader")
"""Packages that stand between the place that uses an old name and the warning."""


def warn_of_old_name(old: str, new: str) -> None:
    """Say the new name, once for each place that uses the old one."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _BETWEEN:
        level, frame = level + 1, frame.f_back
    message = f"'{old}' is now '{new}'; the old name goes with the next release"
    warnings.warn(message, DeprecationWarning, stacklevel=level)


def new_name(old: str) -> Any:
    """What a name of ``harpy_pin`` of the release before stands for now.

    Raises:
        AttributeError: it never was one.
    """
    if old in PACKAGES:
        return import_module(f"harpy_pin.{old}")
    if old in NAMES:
        warn_of_old_name(old, NAMES[old])
        return getattr(import_module("harpy_pin"), NAMES[old])
    raise AttributeError(f"module 'harpy_pin' has no attribute '{old}'")


def new_value(setting: str, value: _T | Any) -> Any:
    """The value of a setting, by its new name."""
    known = VALUES.get(setting, {})
    if isinstance(value, str) and value in known:
        warn_of_old_name(value, known[value])
        return known[value]
    return value


def new_entries(data: Any) -> Any:
    """Mappings of a file that was written with old names, with the new ones, at every depth."""
    if isinstance(data, Mapping):
        entries = {ENTRIES.get(name, name): new_entries(value) for name, value in data.items()}
        for setting, known in VALUES.items():
            if isinstance(entries.get(setting), str):
                entries[setting] = known.get(entries[setting], entries[setting])
        return entries
    return [new_entries(value) for value in data] if isinstance(data, list) else data


def around_call(target: _T, look: Callable[[dict[str, Any]], None]) -> _T:
    """A function, or a class, whose named arguments are looked at, and may be changed, before each call or making."""
    function: Any = target.__init__ if isinstance(target, type) else target  # type: ignore[misc]

    @wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        look(given)
        return function(*args, **given)

    if isinstance(target, type):
        target.__init__ = call  # type: ignore[misc]
        return target
    return call  # type: ignore[return-value]


def renamed_arguments(**names: str) -> Callable[[_T], _T]:
    """Lets a function, or the making of a class, take arguments by their old names too.

    Args:
        names: the new name of each old one.
    """

    def look(given: dict[str, Any]) -> None:
        for old in names.keys() & given.keys():
            warn_of_old_name(old, names[old])
            given[names[old]] = given.pop(old)

    return lambda target: around_call(target, look)


def start_of(gait: Any, penetration: float) -> Any:
    """``gait.initial_state(penetration=...)``, of a gait of one's own by the argument's old name too."""
    try:
        old = "sink" in signature(gait.initial_state).parameters
    except (TypeError, ValueError):
        old = False
    if old:
        warn_of_old_name("initial_state(sink=)", "initial_state(penetration=)")
        return gait.initial_state(sink=penetration)
    return gait.initial_state(penetration=penetration)


class _OldPackage(ModuleType):
    """A package under its old name, whose names are looked for where they are now."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        old = self.__name__.removeprefix("harpy_pin.")
        for package in PACKAGES[old]:
            found = getattr(import_module(f"harpy_pin.{package}"), NAMES.get(name, name), None)
            if found is not None:
                warn_of_old_name(f"harpy_pin.{old}.{name}", f"harpy_pin.{package}.{NAMES.get(name, name)}")
                return found
        raise AttributeError(f"module '{self.__name__}' has no attribute '{name}'")


class _OldPackages(MetaPathFinder, Loader):
    """Finds the old packages, so that ``import harpy_pin.plant`` works."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        return ModuleSpec(name, self) if name.removeprefix("harpy_pin.") in PACKAGES and "." in name else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _OldPackage(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        pass


sys.meta_path.insert(0, _OldPackages())  # before a folder that an older version left behind
