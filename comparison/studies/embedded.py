"""What a tick costs on a microcontroller: instructions counted in QEMU, flash, memory and stack.

Controllers are exported as C (:mod:`harpy_pin.export`). Each is counted on the states of its own walk, and once more
on those of the condensed controller's walk, which are the same for all; the pushes are the same in every walk. Beside
our own QP, which begins with the last tick's active set, DAQP solves the same program from nothing, in its own C.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparison.measure.walking import Progress, Rows, tracked
from comparison.peers.daqp_c import daqp_count, daqp_source
from comparison.studies.exchange_bound import search_bound
from comparison.study import Study, View, shown
from harpy_pin import HarpyError, Push, Robot
from harpy_pin.compiled import kernel
from harpy_pin.controllers.tasks import task_terms
from harpy_pin.controllers.whole_body_tick import ProgramTickRecord
from harpy_pin.export.board import CHIPS, measure, missing_tools
from harpy_pin.export.code import controller_code
from harpy_pin.export.exported_controllers import Exportable, exportable
from harpy_pin.export.folder import write_folder
from harpy_pin.export.recording import CONTROLLERS, Recording, answers, ready, record
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.model.entry import GOOD
from harpy_pin.model.source import loaded_robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.active_set import EXCHANGES
from harpy_pin.wbc.input_space import build_inputs

LABELS = {
    "paper": "paper's governor",
    "filter": "contact-force filter",
    "condensed": "condensed WBC",
    "wbc": "QP, last active set",
    "daqp": "QP, DAQP's C",
}
FRICTION = {"harpy": 0.25}
OTHERS_FRICTION = 0.5
WEAK = 0.2
"""Share of the motors' torque that the condensed controller has where the dearest tick is looked for."""
Bound = Callable[[str, str], int]
SAME = "condensed"
"""Whose walk gives the states that are the same for all controllers."""
WALK = 10.0
"""Length of a motion whose states tell single from double precision, s."""


@kernel
def _build(r: ProgramTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector) -> int:
    """All of the whole-body QP's tick but its solution."""
    d = r.control.dynamics
    if task_terms(r.control, target, q, v, foot_force) != GOOD:
        return 1
    build_inputs(d, r.control.targets, r.problem, r.terms, r.program, v, d.tree.rotation)
    return 0


def _counted(settings: Any, progress: Progress) -> Rows:
    """Count every controller on every chip.

    Returns:
        A row for each robot, controller, precision, chip and level; and one with ``chip`` None for the difference
        between the precisions.
    """
    missing = missing_tools()
    if missing is not None:
        raise HarpyError(f"the compiler for ARM, or QEMU, is missing: {missing}")
    with tempfile.TemporaryDirectory() as place:
        daqp = daqp_source(Path(place))
        jobs: list[Callable[[], dict[str, Any]]] = []
        for name in settings.robots:
            jobs += _jobs(name, settings, Path(place), daqp)
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            found = pool.map(lambda job: job(), jobs)
            return [next(found) for _ in tracked(jobs, progress)]


def _jobs(name: str, settings: Any, place: Path, daqp: Path | None) -> list[Callable[[], dict[str, Any]]]:
    """What there is to do for a robot."""
    robot = loaded_robot(name)
    kinds = CONTROLLERS if name == "harpy" else ("condensed", "wbc")
    walks = {kind: _record(robot, settings.duration, np.random.default_rng(settings.seed), kind) for kind in kinds}
    many = _many(robot, settings)
    jobs: list[Callable[[], dict[str, Any]]] = []

    def exported(what: Exportable, kind: str, walker: str, *, single: bool) -> tuple[tuple[Path, Path], int]:
        """Folders with its C, named as the controller in it, for its own walk and for all's, and its memory, B."""
        precision, folders = "float" if single else "double", []
        for walk in dict.fromkeys((walker, SAME)):
            folders.append(place / f"{name}_{kind}_{precision}_{walk}")
            written = write_folder(what, walks[walk], folders[-1], name=folders[-1].name, single=single, readme=False)
        return (folders[0], folders[-1]), written.code.ram

    for kind in kinds:
        for single in (True, False):
            what = exportable(ready(robot, kind, duration=0.1, friction=_friction(robot), single=single).controller)
            precision, chips = "float" if single else "double", [c for c in settings.chips if single or CHIPS[c].double]
            limited = place / f"{name}_{kind}_{single}_limited"
            bound = _bound(kind, what, (walks[kind], walks[SAME]), limited, single=single)
            rows = [
                {"robot": name, "controller": kind, "precision": precision, "chip": chip, "level": level}
                for chip in chips
                for level in settings.levels
            ]
            if rows:
                program = exported(what, kind, kind, single=single)
                jobs += [partial(_count, row, *program, bound) for row in rows]
            if kind == "wbc" and daqp is not None and rows and not single:  # in floats it does not end
                folders, ram = exported(replace(what, step=_build, kind="daqp"), "daqp", kind, single=False)
                for folder in folders:
                    daqp_count(folder, folder.name, what)
                jobs += [partial(_count, row | {"controller": "daqp"}, folders, ram, None, daqp) for row in rows]
            if single:
                jobs.append(partial(_difference, name, kind, what, many))
    return jobs


def _count(
    row: dict[str, Any], folders: tuple[Path, Path], ram: int, bound: Bound | None, daqp: Path | None = None
) -> dict[str, Any]:
    """The row with what was counted on its chip at its level of optimisation; DAQP's source if that solves it."""
    flags, sources = [row["level"]], ["count.c"]
    if daqp is not None:
        flags += ["-I", str(daqp / "include")]
        sources += [str(path) for path in sorted((daqp / "src").glob("*.c"))]
    every = {f: measure(f, f.name, CHIPS[row["chip"]], flags=flags, sources=sources) for f in dict.fromkeys(folders)}
    own, same = (every[folder] for folder in folders)
    return row | {
        "ticks": len(own.instructions),
        "median": float(np.median(own.instructions)),
        "worst": int(own.instructions.max()),
        "same_ticks": len(same.instructions),
        "same_median": float(np.median(same.instructions)),
        "same_worst": int(same.instructions.max()),
        "flash": None if daqp is not None else own.flash,
        "ram": None if daqp is not None else ram,
        "stack": max(found.stack for found in every.values()),
        "equal": None if daqp is not None else not any(found.different for found in every.values()),
        "bound": None if bound is None else bound(row["chip"], row["level"]),
    }


def _bound(kind: str, what: Exportable, walks: tuple[Recording, ...], folder: Path, *, single: bool) -> Bound | None:
    """An upper end of a tick beside its searches' own: see :mod:`comparison.studies.exchange_bound`.

    The rest is at most the worst tick that was counted, of the condensed controller with motors so weak that it always
    enters the larger program, with thrusts and torques as unknowns, too.
    """
    if kind not in ("condensed", "wbc"):
        return None
    record = what.record.copy()
    if kind == "condensed":
        for name in ("torque_limit", "input_lower", "input_upper"):
            record["condensed"][name][..., -len(what.robot.joints) :] *= WEAK
    places = [record["condensed"][0][name] for name in ("free", "limited")] if kind == "condensed" else [record[0]]
    systems = EXCHANGES if kind == "condensed" else 2 * EXCHANGES
    search = "exchange" if kind == "condensed" else "search"
    folders = [folder] if kind == SAME else [folder, folder.with_name(f"{folder.name}_same")]
    for place, states in zip(folders, walks, strict=False):
        write_folder(replace(what, record=record), states, place, name="weak", single=single, readme=False)

    def bound(chip: str, level: str) -> int:
        rest = max(int(measure(f, "weak", CHIPS[chip], flags=[level]).instructions.max()) for f in folders)
        for part in places:
            records = [np.array([part[name]], part[name].dtype) for name in ("program", search, "dual")]
            rest += search_bound(tuple(records), folder, chip, single=single, level=level, systems=systems)
        return rest

    return bound


def _difference(robot: str, kind: str, what: Exportable, many: Recording) -> dict[str, Any]:
    """The row that compares single with double precision on this machine."""
    single, double = (controller_code(what, "controller", single=s) for s in (True, False))
    ours, status = answers(what, single, many)
    theirs, expected = answers(what, double, many)
    gap = np.abs(ours - theirs).max(axis=1)
    return {
        "robot": robot,
        "controller": kind,
        "chip": None,
        "states": len(many),
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


def _many(robot: Robot, settings: Any) -> Recording:
    """States of as many motions as it takes, each with other pushes."""
    rng = np.random.default_rng([settings.seed, 1])
    parts: list[Recording] = []
    while (missing := settings.states - sum(map(len, parts))) > 0:
        part = _record(robot, min(WALK, max(1e-3 * missing, 0.5)), rng)
        parts.append(Recording(part.target[:missing], {n: rows[:missing] for n, rows in part.inputs.items()}))
    target = np.concatenate([part.target for part in parts])
    inputs = {name: np.concatenate([part.inputs[name] for part in parts]) for name in parts[0].inputs}
    return Recording(target, inputs)


def _robot(row: dict[str, Any]) -> str:
    return f"{row['robot']}, {LABELS[row['controller']]}"


_COUNT: dict[str, Any] = {
    "own walk, median": shown("median"),
    "own walk, worst": shown("worst"),
    "same states, median": shown("same_median"),
    "same states, worst": shown("same_worst"),
    "bound": shown("bound"),
}
_STATES = "On the walk of each controller, and on the same states for all: those of the condensed controller's walk. "
_MEMORY = {"flash": (shown("flash"), "B"), "RAM": (shown("ram"), "B")}
VIEWS = (
    View(
        "embedded",
        "Instructions of a tick on a Cortex-M4F, float, -O2",
        row=_robot,
        columns=_COUNT | {"ms at 168 MHz": lambda rows: rows[0]["median"] / 168e3} | _MEMORY,
        note=_STATES + "Milliseconds are of its own walk, for one instruction in each cycle, the least there is.",
        only=lambda row: (row["chip"], row.get("level"), row.get("precision")) == ("m4", "-O2", "float"),
    ),
    View(
        "embedded_{robot}_{precision}",
        "Instructions of a tick of {robot}, {precision}, {ticks} states",
        row=lambda row: f"{LABELS[row['controller']]}, {CHIPS[row['chip']].title} {row['level']}",
        columns=_COUNT | _MEMORY | {"stack": (shown("stack"), "B"), "equal": shown("equal")},
        note=_STATES
        + "Counted in QEMU; an instruction takes a cycle or more. The bound is the most that a tick can take: "
        "exchanges allowed times the dearest exchange, and the rest of the dearest tick. Equal: every command is that "
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
        note="Largest difference of a torque (N m) or thrust (N) in a tick; both precisions have the same settings.",
        only=lambda row: row["chip"] is None,
    ),
)

STUDY = Study(
    name="embedded",
    help="""Count what a tick costs on a microcontroller.

    Instructions, flash, memory and stack on a Cortex-M4F, M7 and M33 in QEMU: the paper's governor, the contact-force
    filter, the condensed controller, and the whole-body QP by its last active set and by DAQP's own C, for Harpy,
    Solo12 and Bolt, on a walk of each controller and on the same recorded states for all. Needs gcc-arm-none-eabi,
    libnewlib-arm-none-eabi and qemu-system-arm; DAQP's source is fetched from its package.
    """,
    defaults={
        "robots": ("harpy", "solo12", "bolt"),
        "chips": tuple(CHIPS),
        "levels": ("-O2", "-O3"),  # of the compiler
        "duration": 2.0,  # of the recorded motion, s, a tick each millisecond; it is pushed twice; at most 4
        "states": 100_000,  # on which single precision is compared with double
        "seed": 0,  # of the pushes in those states
    },
    quick={"robots": ("harpy",), "chips": ("m4",), "levels": ("-O2",), "duration": 0.4, "states": 1000},
    all_at_once=_counted,
    views=VIEWS,
    only="robots",
)
