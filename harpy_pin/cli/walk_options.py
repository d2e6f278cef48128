"""Options that commands share, most of which say what is walked; ``--set`` reaches every setting
there is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harpy_pin.cli.output import stderr
from harpy_pin.errors import InputError

if TYPE_CHECKING:
    from harpy_pin.model.flat_foot import FlatFoot
    from harpy_pin.model.robot import Robot
    from harpy_pin.scenario import Scenario

PYTHON = {"True": True, "False": False, "None": None}
"""Words of Python that JSON writes otherwise."""
LEG_OF_SOLE = 6
"""Joints of a leg that can hold a sole level."""
ENDLESS = 13.0
"""Range from which on a joint whose hub is a foot turns like a wheel: a little more than two turns,
rad.
"""
ROBOTS = (
    "harpy (by default), a robot that `harpy robots` lists, or a URDF or MJCF file with --feet."
)
RobotOption = Annotated[str, typer.Option(help=ROBOTS.replace(" (by default)", ""))]
FrictionOption = Annotated[
    float | None, typer.Option(help="Static friction.  [default: 0.25]", show_default=False)
]
FeetOption = Annotated[
    str | None,
    typer.Option(
        "--feet", metavar="NAME,...", help="Frames of the feet of a URDF or MJCF file, or '*_foot'."
    ),
]
FlatFeetOption = Annotated[
    str | None,
    typer.Option(
        "--flat-feet",
        metavar="LxW[@X,Y,Z[,R,P,Y]]",
        help="The feet are soles: sides, middle, m, and axes, rad.",
    ),
]
LoopsOption = Annotated[
    str | None,
    typer.Option(
        "--loops",
        metavar="FRAME:FRAME:KIND,...",
        help="Closed loops of a URDF: two frames, which are one point, or a length apart.",
    ),
]
PostureOption = Annotated[
    str | None,
    typer.Option(
        "--posture", metavar="RAD,...", help="Standing angles, of all joints or of one leg."
    ),
]
SpeedOption = Annotated[
    float | None,
    typer.Option(
        help="Forward, m/s; at 0 it stands.  [default: 0.3; 0.15 on flat feet]", show_default=False
    ),
]
PushOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="TIME:X,Y,Z", help="Push the body at this time, s, by an impulse, N·s; repeatable."
    ),
]
DurationOption = Annotated[
    float | None, typer.Option(help="Simulated time, s.", show_default=False)
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Any other setting; harpy settings lists them."
    ),
]
UrdfOption = Annotated[
    Path | None,
    typer.Option(
        "--urdf", metavar="FILE", help="A variant of Harpy's URDF; the packaged one by default."
    ),
]
JsonOption = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Also write the numbers as JSON.")
]


def read_robot_options(
    robot: str,
    feet: str | None,
    posture: str | None,
    flat_feet: str | None = None,
    loops: str | None = None,
) -> str | Robot:
    """The robot of the options: its name where it is known, else read from its file."""
    from harpy_pin.model.catalogue import catalogue_robot
    from harpy_pin.model.loading import load_robot
    from harpy_pin.model.source import named_robot

    if {feet, posture, flat_feet, loops} == {None} and not Path(robot).suffix:
        return named_robot(robot)
    frames = None if feet is None else [name.strip() for name in feet.split(",") if name.strip()]
    try:
        angles = [] if posture is None else [float(angle) for angle in posture.split(",")]
    except ValueError:
        raise InputError(
            f"--posture takes angles in rad, got '{posture}'", name="posture"
        ) from None
    if robot == "harpy":
        raise InputError(
            "--feet, --flat-feet, --loops and --posture are of a robot that --robot names",
            name="feet",
        )
    ties = [] if loops is None else [_loop(text) for text in loops.split(",")]
    if frames is not None and any(set("*?[") & set(name) for name in frames):
        model = load_robot(robot, feet=(), loops=ties).model
        frames = [name for pattern in frames for name in _matching(model, pattern)]
    if flat_feet is not None and frames is None and (listed := catalogue_robot(robot)):
        frames = list(listed.feet)
    flat = None if flat_feet is None else dict.fromkeys(frames or (), _sole(flat_feet))
    known = load_robot(robot, feet=frames, flat_feet=flat, loops=ties)
    for line in _notes(known):
        stderr.print(line, soft_wrap=True)
    if not angles:
        return named_robot(known)
    return named_robot(
        load_robot(
            robot,
            feet=frames,
            flat_feet=flat,
            loops=ties,
            posture=angles * max(len(known.joints) // len(angles), 1),
        )
    )


def _matching(model: Any, pattern: str) -> list[str]:
    """Names of links that a pattern fits, or of other frames; the pattern itself where there are
    none.
    """
    names = [frame.name for frame in model.frames]
    links = [name for name in names if model.existBodyName(name)]
    for some in (links, names):
        if found := [name for name in some if fnmatchcase(name, pattern)]:
            return list(dict.fromkeys(found))
    return [pattern]


def _loop(text: str) -> tuple[str, str, str]:
    """A closed loop from ``FRAME:FRAME:KIND``."""
    parts = text.strip().split(":")
    if len(parts) != 3:
        raise InputError(
            f"--loops takes FRAME:FRAME:point or FRAME:FRAME:length, got '{text}'", name="loops"
        )
    return parts[0], parts[1], parts[2]


def _sole(text: str) -> FlatFoot:
    """A flat foot from ``LxW``, ``LxW@X,Y,Z`` or ``LxW@X,Y,Z,ROLL,PITCH,YAW``."""
    from harpy_pin.model.flat_foot import FlatFoot

    sides, _, centre = text.partition("@")
    try:
        length, width = (float(side) for side in sides.split("x"))
        x, y, z, *turn = (float(part) for part in (centre or "0,0,0").split(","))
        roll, pitch, yaw = turn or (0.0, 0.0, 0.0)
    except ValueError:
        raise InputError(
            f"--flat-feet must look like 0.2x0.09 or 0.2x0.09@0.03,0,-0.05 (m), got '{text}'",
            name="flat_feet",
            value=text,
        ) from None
    return FlatFoot(length=length, width=width, centre=(x, y, z), orientation=(roll, pitch, yaw))


def _notes(robot: Robot) -> Iterator[str]:
    """What may be otherwise with the feet of a robot from a file than its user thinks."""
    from harpy_pin.model.legs import legs

    found, turns = legs(robot), robot.joint_upper - robot.joint_lower
    wheels = [leg.points[0] for leg in found if leg.hub and turns[leg.columns[-1] - 6] > ENDLESS]
    if wheels:
        yield (
            f"{', '.join(wheels)} on joints that turn without end: wheels do not roll here, they "
            f"are feet"
        )
    of_sole = [leg.points[0] for leg in found if len(leg.joints) == LEG_OF_SOLE]
    if of_sole and not robot.flat_feet and not wheels:
        yield (
            f"{', '.join(of_sole)} behind six joints, taken as points: for soles give "
            f"--flat-feet, such as 0.2x0.09"
        )


def read_scenario(
    texts: Sequence[str],
    *,
    friction: float | None = None,
    robot: str = "harpy",
    feet: str | None = None,
    posture: str | None = None,
    flat_feet: str | None = None,
    loops: str | None = None,
    speed: float | None = None,
    push: Sequence[str] = (),
    duration: float = 6.0,
) -> Scenario:
    """The scenario of the options; what ``--set`` says comes last."""
    from harpy_pin.scenario.settings import scenario_of

    walker = read_robot_options(robot, feet, posture, flat_feet, loops)
    settings: dict[str, Any] = {"robot": walker, "duration": duration}
    if friction is not None:
        settings["ground.mu_s"] = friction
    if push:
        settings["disturbances.pushes"] = [_read_push(text) for text in push]
    given = read_settings(texts)
    if speed is not None:
        settings |= _speed(given.get("robot", walker), given.get("gait"), speed)
    return scenario_of(settings | given)


def read_settings(texts: Sequence[str]) -> dict[str, Any]:
    """Settings by their dotted names, of texts such as ``controller.mu=0.4``.

    A value is JSON where it looks like that (``true``, ``0.4``, ``[0.3,0,0.1]``, also without
    brackets), else a name.
    """
    settings: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not all(name.split(".")):
            raise InputError(
                f"--set takes NAME=VALUE, such as controller.mu=0.4, got '{text}'; harpy "
                f"settings lists the names",
                name="set",
                value=text,
            )
        settings[name] = value if name == "state" else _read_value(value)  # "true" is a name
    return settings


def _read_value(text: str) -> Any:
    """A value as JSON or Python write it; other text is a name, such as the governor ``none``."""
    if text in PYTHON:
        return PYTHON[text]
    listed = re.sub(r",?\)", "]", text.replace("(", "["))
    for form in (listed, f"[{listed}]") if "," in text else (listed,):
        try:
            return json.loads(form)
        except (ValueError, RecursionError):
            continue
    return float(text) if re.fullmatch(r"[-+]?\.\d+", text) else text


def _speed(robot: str | Robot, gait: Any, speed: float) -> Mapping[str, Any]:
    """The setting that a speed forward is of a gait, by default the robot's first one."""
    from harpy_pin.scenario.gait_parts import GAIT_PARTS, gaits_of, why_not

    if gait is None and (why := why_not(robot, "walking")):
        raise InputError(f"{why}: it stands", name="robot", value=robot)
    kind = GAIT_PARTS.get(gaits_of(robot)[0] if gait is None else str(gait))
    return (
        {"gait.velocity": (speed, 0.0, 0.0)}
        if kind and "velocity" in kind.settings()
        else {"gait.speed": speed}
    )


def _read_push(text: str) -> dict[str, Any]:
    """A push from ``TIME:X,Y,Z``."""
    time, _, impulse = text.partition(":")
    try:
        x, y, z = (float(part) for part in impulse.split(","))
        return {"time": float(time), "impulse": (x, y, z)}
    except ValueError:
        raise InputError(
            f"a push must look like TIME:X,Y,Z (s and N·s), got '{text}'", name="push"
        ) from None
