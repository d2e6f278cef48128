"""Who walks: robot and controller of a run, found from what its log says."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.log.run import Run
from harpy_pin.model.catalogue import CATALOGUE, HARPY_FEET, HARPY_THRUSTERS
from harpy_pin.model.loading import load_harpy, load_robot
from harpy_pin.model.robot import Robot
from harpy_pin.model.source import read_robot


class NamedController(NamedTuple):
    """A controller as pages name it."""

    label: str  # on pages
    name: str  # as :func:`harpy_pin.controllers.make_controller` knows it
    governor: str | None = None  # of the governed controller; None for the others


CONTROLLERS = {
    "condensed": NamedController("Condensed controller", "condensed"),
    "wbc": NamedController("Whole-body QP", "wbc"),
    "none": NamedController("No governor", "governed", "none"),
    "paper": NamedController("Paper's governor", "governed", "paper"),
    "filter": NamedController("Contact-force filter", "governed", "filter"),
}
"""Controllers by the names of the live page's settings."""


@checked
def robot_of(run: Run, urdf: str | Path | None = None) -> Robot:
    """Load the robot that a run was logged with.

    The log holds the names of robot, feet and thrusters. A robot of the library is found by them:
    Harpy, the variant of Harpy that the run's scenario names, or a robot of the catalogue. Of other
    robots it holds the file.

    Args:
        run: the log.
        urdf: file of the robot, or its name in the catalogue, where the log does not lead to it.

    Raises:
        InputError: the log does not say enough; the message says what to give.
        RobotError: the file is missing or malformed, or lacks a foot or a thruster of the log.
    """
    feet, thrusters = _names(run, "feet"), _names(run, "thrusters")
    source, scenario, own = (run.metadata.get(key) for key in ("robot_source", "scenario", "own"))
    if urdf in CATALOGUE:
        return load_robot(str(urdf))
    name = run.metadata.get("robot")
    if urdf is None and name in CATALOGUE:
        robot = load_robot(str(name))
        if (robot.feet, robot.thrusters, robot.nq) == (feet, thrusters, run["q"].shape[1]):
            return robot
    if feet is None or (feet == HARPY_FEET and thrusters == HARPY_THRUSTERS):
        own_gait = isinstance(own, list) and "gait" in own
        variant = scenario.get("urdf") if isinstance(scenario, dict) and not own_gait else None
        return load_harpy(urdf or (variant if isinstance(variant, str) else None))
    if isinstance(source, dict):
        return read_robot(source if urdf is None else {**source, "file": str(urdf)})
    if urdf is not None:
        return load_robot(Path(urdf), feet=feet, thrusters=thrusters or ())
    raise InputError(
        f"the log is of a robot {shown(name)} with the feet {shown(feet, 200)}, which is not "
        f"known by name: "
        "give its URDF, as urdf or --robot FILE",
        name="urdf",
    )


def _names(run: Run, kind: str) -> tuple[str, ...] | None:
    """Names of feet or thrusters in a log; None where it has none."""
    names = run.metadata.get(kind)
    return tuple(str(name) for name in names) if isinstance(names, list | tuple) else None


SOLVERS = {"proxqp": "ProxQP", "active_set": "own search"}
"""Solvers of the whole-body QP as pages name them; others by their own names."""


def _solver_of(part: dict[str, Any]) -> str:
    """The solver of a controller's part."""
    parameters = part.get("parameters")
    name = str((parameters if isinstance(parameters, dict) else {}).get("solver", "proxqp"))
    return SOLVERS.get(name, name)


def name_of(run: Run) -> str:
    """What walks, in words: from the scenario where there is one, else the name of the controller's
    class.

    The whole-body QP is named with its solver.
    """
    scenario, own = run.metadata.get("scenario"), run.metadata.get("own")
    part = scenario.get("controller") if isinstance(scenario, dict) else None
    if isinstance(part, dict) and not (isinstance(own, list) and "controller" in own):
        for known in CONTROLLERS.values():
            if known.name == part.get("name") and known.governor in (None, part.get("governor")):
                return f"{known.label}, {_solver_of(part)}" if known.name == "wbc" else known.label
    return str(run.metadata.get("controller", "Run"))
