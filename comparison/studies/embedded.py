"""Count what a tick costs on a microcontroller.

Instructions, flash, memory and stack on a Cortex-M4F, M7 and M33 in QEMU, for Harpy, Solo12 and
Bolt: the paper's governor, the contact-force filter, the condensed controller, and the whole-body
QP by own search. Each is exported as C and counted on the states of its own walk, and once more on
those of the condensed controller's, which are the same for all; the pushes are the same in every
walk. Needs gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any, NamedTuple

import numpy as np

from comparison.study import Job, Study, View, grid, shown
from harpy_pin import HarpyError, Push, Robot
from harpy_pin.export.board import CHIPS, measure, missing_tools
from harpy_pin.export.code import controller_code
from harpy_pin.export.exported_controllers import Exportable, exportable
from harpy_pin.export.folder import write_folder
from harpy_pin.export.recording import CONTROLLERS, Recording, answers, ready, record
from harpy_pin.model.source import loaded_robot

LABELS = {
    "paper": "paper's governor",
    "filter": "contact-force filter",
    "condensed": "condensed WBC",
    "wbc": "QP, own search",
}
FRICTION = {"harpy": 0.25}
OTHERS_FRICTION = 0.5
SAME = "condensed"
"""Whose walk gives the states that are the same for all controllers."""
WALK = 10.0
"""Length of a motion whose states tell single from double precision, s."""


class Case(NamedTuple):
    """What is exported once, for every chip and every level of optimisation."""

    robot: str  # its name
    controller: str  # by its name for export
    precision: str  # float or double
    duration: float  # of the recorded motion, s
    seed: int  # of its pushes

    def write(self, what: Exportable, walk: str, name: str) -> tuple[Path, int]:
        """A new folder with its C for the walk of a controller, and the memory that it takes, B."""
        folder = Path(mkdtemp(dir=_place().name)) / name
        states = _walk(self.robot, walk, self.duration, self.seed)
        written = write_folder(
            what, states, folder, name=name, single=self.precision == "float", readme=False
        )
        return folder, written.code.ram


_place = cache(TemporaryDirectory)
"""The folder of all that is written; it ends with the process."""


def _jobs(s: Any) -> Iterator[Job]:
    """Every controller on every chip; and, with ``chip`` None, the difference between the
    precisions.
    """
    missing = missing_tools()
    if missing is not None:
        raise HarpyError(f"the compiler for ARM, or QEMU, is missing: {missing}")
    doubles = [chip for chip in s.chips if CHIPS[chip].double]
    for robot in s.robots:
        for kind in CONTROLLERS if robot == "harpy" else ("condensed", "wbc"):
            cases = [*grid(controller=kind, precision="float", chip=s.chips, level=s.levels)]
            cases.append({"controller": kind, "precision": "float", "chip": None})
            cases += grid(controller=kind, precision="double", chip=doubles, level=s.levels)
            same = {"robot": robot, "duration": s.duration, "seed": s.seed, "states": s.states}
            yield from (same | one for one in cases)


def _measured(job: Job) -> dict[str, Any]:
    """What was counted on a chip at a level of optimisation, on its own walk and on the same for
    all.
    """
    case = Case(*(job[name] for name in Case._fields))
    if job["chip"] is None:
        return _difference(case, job["states"])
    folders, ram = _exported(case)
    every = [measure(f, f.name, CHIPS[job["chip"]], flags=[job["level"]]) for f in folders]
    own, same = every[0], every[-1]
    return {
        "ticks": len(own.instructions),
        "median": float(np.median(own.instructions)),
        "worst": int(own.instructions.max()),
        "same_ticks": len(same.instructions),
        "same_median": float(np.median(same.instructions)),
        "same_worst": int(same.instructions.max()),
        "flash": own.flash,
        "ram": ram,
        "stack": max(found.stack for found in every),
        "equal": not any(found.different for found in every),
    }


@cache
def _what(case: Case) -> Exportable:
    robot = loaded_robot(case.robot)
    single, friction = case.precision == "float", _friction(robot)
    return exportable(
        ready(robot, case.controller, duration=0.1, friction=friction, single=single).controller
    )


@cache
def _exported(case: Case) -> tuple[list[Path], int]:
    """Folders with its C for its own walk and, if that is another one, for all's; and its memory,
    B.
    """
    folders, ram = [], 0
    for walk in dict.fromkeys((case.controller, SAME)):
        name = f"{case.robot}_{case.controller}_{case.precision}_{walk}"
        folder, ram = case.write(_what(case), walk, name)
        folders.append(folder)
    return folders, ram


def _difference(case: Case, states: int) -> dict[str, Any]:
    """Single beside double precision on this machine, on states of as many motions as it takes,
    pushed differently.
    """
    what, many = _what(case), _many(case.robot, states, case.seed)
    single, double = (controller_code(what, "controller", single=s) for s in (True, False))
    ours, status = answers(what, single, many)
    theirs, expected = answers(what, double, many)
    gap = np.abs(ours - theirs).max(axis=1)
    return {
        "median": float(np.median(gap)),
        "p99": float(np.quantile(gap, 0.99)),
        "p999": float(np.quantile(gap, 0.999)),
        "worst": float(gap.max()),
        "largest_command": float(np.abs(theirs).max()),
        "other_status": int(np.count_nonzero(status != expected)),
    }


def _friction(robot: Robot) -> float:
    return FRICTION.get(robot.name, OTHERS_FRICTION)


def _record(robot: Robot, duration: float, rng: np.random.Generator, kind: str = SAME) -> Recording:
    """States of a motion under a controller, by its name for export, pushed from both sides."""
    pushes = []
    for time in np.arange(0.3, duration - 0.2, 0.9):
        x, y = 0.15 * robot.mass * rng.uniform(-1.0, 1.0, 2)
        pushes.append(Push(float(time), (float(x), float(y), 0.0)))
    motion = ready(robot, kind, duration=duration, friction=_friction(robot), pushes=pushes)
    return record(motion, exportable(motion.controller))


@cache
def _walk(robot: str, kind: str, duration: float, seed: int) -> Recording:
    return _record(loaded_robot(robot), duration, np.random.default_rng(seed), kind)


@cache
def _many(name: str, states: int, seed: int) -> Recording:
    rng, robot = np.random.default_rng([seed, 1]), loaded_robot(name)
    parts: list[Recording] = []
    while (missing := states - sum(map(len, parts))) > 0:
        part = _record(robot, min(WALK, max(1e-3 * missing, 0.5)), rng)
        parts.append(
            Recording(part.target[:missing], {n: rows[:missing] for n, rows in part.inputs.items()})
        )
    target = np.concatenate([part.target for part in parts])
    return Recording(
        target, {n: np.concatenate([part.inputs[n] for part in parts]) for n in parts[0].inputs}
    )


def _robot(row: dict[str, Any]) -> str:
    return f"{row['robot']}, {LABELS[row['controller']]}"


_COUNT: dict[str, Any] = {
    "own walk, median": shown("median"),
    "own walk, worst": shown("worst"),
    "same states, median": shown("same_median"),
    "same states, worst": shown("same_worst"),
}
_STATES = (
    "On the walk of each controller, and on the same states for all: those of the condensed "
    "controller's walk. "
)
_MEMORY = {"flash": (shown("flash"), "B"), "RAM": (shown("ram"), "B")}
STUDY = Study(
    name="embedded",
    help=__doc__,
    defaults={
        "robots": ("harpy", "solo12", "bolt"),
        "chips": tuple(CHIPS),
        "levels": ("-O2", "-O3"),  # of the compiler
        # of the recorded motion, s, a tick each millisecond; it is pushed twice; at most 4
        "duration": 2.0,
        "states": 100_000,  # on which single precision is compared with double
        "seed": 0,  # of the pushes in those states
    },
    quick={
        "robots": ("harpy",),
        "chips": ("m4",),
        "levels": ("-O2",),
        "duration": 0.4,
        "states": 1000,
    },
    jobs=_jobs,
    measure=_measured,
    views=[
        View(
            "embedded",
            "Instructions of a tick on a Cortex-M4F, float, -O2",
            row=_robot,
            columns=_COUNT | {"ms at 168 MHz": lambda rows: rows[0]["median"] / 168e3} | _MEMORY,
            note=_STATES
            + "Milliseconds are of its own walk, for one instruction in each cycle, the least "
            "there is.",
            only=lambda row: (
                (row["chip"], row.get("level"), row.get("precision")) == ("m4", "-O2", "float")
            ),
        ),
        View(
            "embedded_{robot}_{precision}",
            "Instructions of a tick of {robot}, {precision}, {ticks} states",
            row=lambda row: (
                f"{LABELS[row['controller']]}, {CHIPS[row['chip']].title} {row['level']}"
            ),
            columns=_COUNT | _MEMORY | {"stack": (shown("stack"), "B"), "equal": shown("equal")},
            note=_STATES
            + "Counted in QEMU; an instruction takes a cycle or more. Equal: every command is that "
            "of this machine, in every bit.",
            only=lambda row: row["chip"] is not None,
        ),
        View(
            "embedded_precision",
            "Float against double, {states} states",
            row=_robot,
            columns={
                "median": (shown("median"), "N"),
                "p99": (shown("p99"), "N"),
                "p99.9": (shown("p999"), "N"),
                "largest": (shown("worst"), "N"),
                "of": (shown("largest_command"), "N"),
                "other status": shown("other_status"),
            },
            note="Largest difference of a torque (N m) or thrust (N) in a tick; both precisions "
            "have the same "
            "settings.",
            only=lambda row: row["chip"] is None,
        ),
    ],
    only="robots",
)
