"""The robots that are known by name, at a glance."""

from __future__ import annotations

import re
from dataclasses import dataclass

from harpy_pin.model.catalogue import CATALOGUE, CatalogueRobot, installed_data
from harpy_pin.model.robot import HARPY_FEET, load_harpy, load_robot

__all__ = ["KnownRobot", "robots"]


@dataclass(frozen=True)
class KnownRobot:
    """What is known of a robot.

    Attributes:
        name: for :func:`harpy_pin.model.robot.load_robot` and :class:`harpy_pin.scenario.Scenario`.
        feet: names of its feet; none for robots that fly.
        flat: whether these are flat.
        rotors: how many it has.
        mass: kg; None where the extra ``robots`` is not installed.
        joints: how many are actuated; None likewise.
        licence: of its files; None where they do not say, or are not installed.
    """

    name: str
    feet: tuple[str, ...]
    flat: bool
    rotors: int
    mass: float | None
    joints: int | None
    licence: str | None


def robots() -> dict[str, KnownRobot]:
    """All robots that are known by name, such as ``"go2"``; ``list(robots())`` are the names.

    Files of robots other than Harpy are in example-robot-data, the extra ``robots``.
    """
    harpy = load_harpy()
    known = {"harpy": KnownRobot("harpy", HARPY_FEET, False, 0, harpy.mass, len(harpy.joints), "BSD-2-Clause")}
    return known | {name: _known(name, entry) for name, entry in CATALOGUE.items()}


def _known(name: str, entry: CatalogueRobot) -> KnownRobot:
    mass, joints, licence = None, None, None
    if installed_data() is not None:
        robot = load_robot(name)
        mass, joints, licence = robot.mass, len(robot.joints), _licence(entry)
    return KnownRobot(name, entry.feet, bool(entry.flat_feet), len(entry.rotors), mass, joints, licence)


def _licence(entry: CatalogueRobot) -> str | None:
    """What the page beside a robot's files says."""
    page = entry.path().parents[1] / "README.md"
    if not page.is_file():
        return None
    found = re.search(r"^licen[cs]e: *(.+?) *$", page.read_text(errors="replace"), re.MULTILINE | re.IGNORECASE)
    return found.group(1) if found is not None else None
