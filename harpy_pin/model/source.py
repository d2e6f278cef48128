"""Robots of one's own as scenarios and logs write them down: what they are read from, ready for
JSON.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import asdict
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, reason
from harpy_pin.model.catalogue import CATALOGUE, known_name
from harpy_pin.model.flat_foot import FlatFoot
from harpy_pin.model.loading import load_harpy, load_robot
from harpy_pin.model.robot import Robot
from harpy_pin.model.rotor import Rotor

ENTRIES = {"file", "model", "sha256", *signature(load_robot).parameters} - {"urdf"}
CHANGED = ("armature", "damping", "upperDryFrictionLimit", "effortLimit")
"""Arrays of the model that methods of :class:`Robot` change."""


def plain_source(value: Any) -> Any:
    """A :attr:`Robot.source` as JSON has it: null for infinity."""
    value = asdict(value) if isinstance(value, FlatFoot | Rotor) else value
    if isinstance(value, Mapping):
        return {str(name): plain_source(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain_source(inner) for inner in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if value == np.inf else value


@checked
def read_robot(source: Mapping[str, Any]) -> Robot:
    """The robot of a :attr:`Robot.source`, also as :func:`plain_source` writes it.

    It has ``file``, a path or a name, other arguments of :func:`load_robot`, and ``model``, arrays
    that are changed. ``sha256`` is that of the file: if it is another one, a warning says so.
    """
    for name in source:
        checks.one_of("entry of the robot", name, ENTRIES)
    if "file" not in source:
        raise InputError(
            "this robot was read from a MuJoCo model, not from a file: give the file", name="robot"
        )
    given = plain_source(source)
    arrays = checks.mapping("model", given.pop("model", {}))
    written = given.pop("sha256", None)
    try:
        if given.get("flat_feet") is not None:
            feet = checks.mapping("flat_feet", given["flat_feet"])
            given["flat_feet"] = {name: FlatFoot(**foot) for name, foot in feet.items()}
        for rotor in given.get("rotors", ()):
            rotor["limit"] = _infinite(rotor["limit"])
        given["rotors"] = [Rotor(**rotor) for rotor in given.get("rotors", ())] or None
        robot = load_robot(given.pop("file"), **given)
    except (TypeError, LookupError) as error:
        raise InputError(
            f"this describes no robot: {reason(error)}", name="robot", value=source
        ) from error
    if written not in (None, robot.source.get("sha256")):
        warnings.warn(f"'{source['file']}' was another file when it was written down", stacklevel=3)
    for name, values in arrays.items():
        checks.one_of("array of the robot's model", name, CHANGED)
        array = _infinite(checks.array(f"{name} of the robot", values, robot.model.nv))
        robot = robot.with_arrays({name: array})
    return robot


def _infinite(values: Any) -> Any:
    """Numbers of which null is infinity."""
    return np.nan_to_num(np.array(values, dtype=np.float64), nan=np.inf)


def named_robot(robot: Any) -> str | Robot:
    """A robot, or its source, as scenarios hold it: the name of one that is known, else the
    robot.
    """
    if isinstance(robot, Mapping):
        robot = read_robot(robot)
    if not isinstance(robot, Robot):
        name = known_name(robot)
        path = isinstance(name, str) and (Path(name).suffix or Path(name).name != name)
        hint = (
            "a file comes with its feet: hp.load_robot(path, feet=...), --robot FILE --feet "
            "NAME,..."
            if path
            else ""
        )
        checks.one_of("robot", name, ("harpy", *CATALOGUE), hint=hint)
        return str(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they were shown when it was read
        same = "file" in robot.source and read_robot(robot.source).model == robot.model
    if not same:
        raise InputError(
            f"'{robot.name}' is not what its file says, which no scenario can write down: "
            f"change it by "
            "with_joints, or give hp.walk a gait of it",
            name="robot",
            value=robot,
        )
    if robot.source == {"file": robot.label}:
        return robot.label
    return "harpy" if robot.source == load_harpy().source else robot


def loaded_robot(robot: Any) -> Robot:
    """A robot that may be given by its name."""
    robot = robot if isinstance(robot, Robot) else named_robot(robot)
    return (
        load_harpy() if robot == "harpy" else load_robot(robot) if isinstance(robot, str) else robot
    )
