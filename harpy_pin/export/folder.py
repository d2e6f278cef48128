"""A folder with a controller in C, and everything to build, check and count it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.export.board import CHIPS, board_text, measure, missing_tools
from harpy_pin.export.code import Code, about_target, controller_code, lengths, number_text, shipped
from harpy_pin.export.exported_controllers import Exportable, exportable, exportable_walk
from harpy_pin.export.recording import WALK, Recording, answers, ready, record
from harpy_pin.files import OwnFolder
from harpy_pin.kernels.compiler import work_folder
from harpy_pin.model.robot import Robot
from harpy_pin.model.source import loaded_robot
from harpy_pin.simulation.sensing import EstimatedState

SHIPPED = ("CMakeLists.txt", "check.c", "count.c", "arm-none-eabi.cmake", "board/startup.c")
TICKS, EVERY, WALK_TICKS = 200, 10, 600
"""Recorded ticks, and how far they are apart in ticks of the motion; those of walks and estimators
are not apart.
"""
PRECISIONS = ("float", "double")


@dataclass(frozen=True)
class Exported:
    """What was written."""

    code: Code  # the controller in C
    what: Exportable  # the controller
    ticks: int  # that were recorded
    folder: Path  # where it is


@checked
def export(
    robot: str | Robot,
    folder: str | Path,
    *,
    controller: str = "condensed",
    precision: str = "float",
    force: bool = False,
) -> Exported:
    """Export a controller of a robot, or its state estimator, with ticks of a motion that fits the
    robot.

    Args:
        robot: ``harpy``, a name of :data:`~harpy_pin.model.catalogue.CATALOGUE`, or one's own.
        folder: where to; new, empty, or an exported one. Nothing in it that was not exported is
            replaced.
        controller: one of :data:`~harpy_pin.export.recording.CONTROLLERS`, ``estimator``, or
            ``walk``, the condensed controller with a walking gait.
        precision: ``float`` or ``double``.
        force: take a folder with other files, too, and replace those of the same names.

    Raises:
        InputError: an unknown name, or a controller that does not take the robot.
        RobotError: the robot's files are not installed.
        RunFileError: the folder has other files, or cannot be written.
        HarpyError: single precision, and there is no C compiler.
    """
    checks.one_of("precision", precision, PRECISIONS)
    single = precision == "float"
    motion = ready(loaded_robot(robot), controller, duration=1e-3 * TICKS * EVERY, single=single)
    place, felt = OwnFolder(folder, force=force), motion.sensors
    if isinstance(felt, EstimatedState):
        what, rows = exportable(felt.estimator), slice(TICKS)
    elif controller == WALK:
        what, rows = exportable_walk(motion.controller), slice(WALK_TICKS)
    else:
        what, rows = exportable(motion.controller), slice(None, None, EVERY)
    every = record(motion, what)
    recording = Recording(
        every.target[rows], {name: given[rows] for name, given in every.inputs.items()}
    )
    name = re.sub(r"^(?=\d)|\W", "_", f"{what.robot.name}_{what.kind}", flags=re.ASCII)
    return write_folder(what, recording, place, name=name, single=single)


def write_folder(
    what: Exportable,
    given: Recording,
    folder: str | Path | OwnFolder,
    *,
    name: str,
    single: bool,
    readme: bool = True,
) -> Exported:
    """Write a controller, recorded ticks of it, and the page about it, for which it is measured
    where there are tools.

    Raises:
        InputError: the name, of the files, functions and structs, is none in C.
        RunFileError: the folder is not new, empty or an exported one, or cannot be written.
        HarpyError: numbers are of single precision, and there is no C compiler.
    """
    if not (name.isascii() and name.isidentifier()):
        raise InputError(f"name must be one in C, got {shown(name)}", name="name", value=name)
    place = folder if isinstance(folder, OwnFolder) else OwnFolder(folder)
    code = controller_code(what, name, single=single)
    names = {"name": name, "NAME": name.upper(), "real": code.real}
    recorded = names | _ticks(what, code, given)
    texts = {f"{name}.h": code.header, f"{name}.c": code.source, f"{name}.hpp": code.cpp}
    texts |= {own: shipped(own, **recorded) for own in ("vectors.h", "vectors.c")}
    texts |= {own: shipped(own, **names) for own in SHIPPED}
    texts |= {f"board/{chip.machine}.ld": board_text(chip) for chip in CHIPS.values()}
    if readme:
        inputs = ", ".join(what.inputs)
        about = {
            "title": what.title,
            "robot": what.robot.name,
            "inputs": inputs,
            "target": about_target(what),
        }
        texts["README.md"] = shipped(
            "README.md", **names, **about, cost=_cost(code, texts, len(given))
        )
    place.write(texts)
    return Exported(code, what, len(given), place.path)


def _cost(code: Code, texts: Mapping[str, str], ticks: int) -> str:
    """What can be measured here of flash, memory and instructions."""
    lines = [f"One `{code.name}_state` takes {code.ram} bytes of RAM."]
    if missing_tools() is not None:
        return lines[0]
    lines += [
        "",
        "| | flash, bytes | stack, bytes | instructions of a tick, median | worst |",
        "|---|---:|---:|---:|---:|",
    ]
    with work_folder() as folder:
        OwnFolder(folder).write(texts)
        for chip in CHIPS.values():
            if code.real == "double" and not chip.double:
                continue
            found = measure(Path(folder), code.name, chip)
            counts = found.instructions
            lines.append(
                f"| {chip.title} | {found.flash} | {found.stack} | {np.median(counts):.0f} | "
                f"{counts.max()} |"
            )
    lines += [
        "",
        f"Counted in QEMU over the {ticks} recorded ticks, compiled with `-O2`; flash with what it "
        "needs of the mathematical library. An instruction takes a cycle or more, so that these "
        "are no times.",
    ]
    return "\n".join(lines)


def _ticks(what: Exportable, code: Code, given: Recording) -> dict[str, object]:
    """Recorded ticks, and their commands and statuses, as texts in C."""
    commands, statuses = answers(what, code, given)
    place, begin = given.target.shape[1], 0
    arguments = []
    for n in lengths(what.inputs).values():
        arguments.append(f"row + {place}")
        place += n
    for n in lengths(what.outputs).values():
        arguments.append(f"command + {begin}")
        begin += n
    return {
        **{"ticks": len(given), "width": place, "outputs": begin, "inputs": ", ".join(what.inputs)},
        "rows": _rows(
            np.hstack([given.target, *(given.inputs[name] for name in what.inputs)]), code
        ),
        "commands": _rows(commands, code),
        "statuses": ", ".join(map(str, statuses)),
        "arguments": ", ".join(arguments),
    }


def _rows(values: NDArray[Any], code: Code) -> str:
    single = code.real == "float"
    lines = (
        "    {" + ", ".join(number_text(value, single=single) for value in row) + "},"
        for row in values
    )
    return "\n".join(lines).replace("(real)", "")
