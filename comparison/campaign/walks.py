"""The walks of a campaign: what one is, how all are done, in processes of their own, and why a
controller fell.

Exceptions are scenarios in which a whole-body controller falls and somebody else stands; their
reasons are the levels without which it stands, too.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.campaign.plan import (
    ENGINES,
    FACTORS,
    JOINT_DAMPING,
    CampaignSettings,
    Task,
    code_digest,
    level_key,
    plan,
)
from comparison.campaign.store import Store, do_missing
from comparison.campaign.summary import WHOLE_BODY, summarise_rows
from comparison.contenders import controller_part, label
from comparison.measure.walking import ALONE, Progress, silent, walk_as_far_as_it_goes
from comparison.tables import Cell, Table, number_text
from harpy_pin.files import finite

MEASURES = (
    "fell",
    "duration_s",
    "distance_m",
    "slip_mm_per_step",
    "net_slip_mm_per_step",
    "late_slip_mm_per_step",
    "sliding",
    "low_force",
    "tracking_rms_mm",
    "thrust_rms_n",
    "solver_failures",
    "solver_fallbacks",
)
"""What is kept of :class:`harpy_pin.log.Measures`."""

ICE = (0.4, 0.7)
"""Where the strip of ice begins and ends, as shares of the way that the walk is to go: about two
steps.
"""


def walk_task(task: Task) -> dict[str, Any]:
    """Walk the scenario of a task, and measure.

    Returns:
        The measures :data:`MEASURES`, ``fall_time_s`` (None without a fall) and ``ending``. A
        controller that fails counts as a fall at that moment.
    """
    run = walk_as_far_as_it_goes(scenario(task))
    measures, fell = hp.measure(run).as_dict(), run.ending != "completed"
    row: dict[str, Any] = {name: measures[name] for name in MEASURES}
    return row | {
        "fell": fell,
        "fall_time_s": measures["duration_s"] if fell else None,
        "ending": run.ending,
    }


def scenario(task: Task) -> hp.Scenario:
    """The scenario of a task."""
    gait = _gait()
    rng = np.random.default_rng(task.seed)
    start = task.jitter * rng.standard_normal(2)
    push = draw_push(task, gait, rng)
    begin, end = (share * task.speed * task.duration for share in ICE)
    # no less slippery than what is beside it
    ice = ((begin, end, min(task.ice, task.friction)),) if task.ice else ()
    ground = hp.Ground(mu_s=task.friction, stiffness=task.stiffness, friction_strips=ice)
    assert ground.damping is not None
    return hp.Scenario(
        ground=replace(ground, damping=task.damping * ground.damping),
        plant=ENGINES[task.plant],
        gait=hp.Straight(speed=task.speed),
        controller=_controller(task),
        disturbances=hp.Disturbances(
            mass_error=task.mass_error,
            start_velocity=(*start, 0.0, 0.0, 0.0, 0.0),
            pushes=(push,) if task.push > 0.0 else (),
            noise=hp.Noise.typical(task.noise),
            delay=task.delay,
            seed=task.seed,
            actuators=hp.Actuators(
                torque_share=task.torque_share or None, bandwidth=task.bandwidth or None
            ),
        ),
        duration=task.duration,
        urdf=None if task.joint_damping == JOINT_DAMPING else damped_harpy(task.joint_damping),
    )


def _controller(task: Task) -> hp.scenario.ControllerPart:
    """The controller of a task, which knows the torque limits where there are any."""
    part = controller_part(task.contender, mu=task.friction * (1.0 + task.friction_error))
    if task.torque_share == 0.0:
        return part
    if isinstance(part, hp.Governed):
        return replace(part, limits=True)
    limits = {**part.parameters.get("limits", {}), "torque_scale": task.torque_share}
    return replace(part, parameters={**part.parameters, "limits": limits})


_folder = cache(TemporaryDirectory)
"""For files of robots; it ends with the process."""


@cache
def damped_harpy(joint_damping: float) -> str:
    """Path of Harpy's URDF with this damping in every joint, N·m·s/rad; the file is deleted when
    the process ends.
    """
    text = re.sub(
        r'damping="[^"]*"',
        f'damping="{joint_damping:g}"',
        hp.model.harpy_urdf().read_text(encoding="utf-8"),
    )
    path = Path(_folder().name) / f"{joint_damping:g}.urdf"
    path.write_text(text, encoding="utf-8")
    return str(path)


def draw_push(task: Task, gait: hp.gaits.StraightGait, rng: np.random.Generator) -> hp.Push:
    """The lateral push of a task: its side and its step are drawn; its middle is the middle of
    single support.

    It is never in the first step, nor in the last two, so that the walk after the push is seen.
    """
    step, duration = gait.step_duration, 0.1
    last = max(int(task.duration / step) - 2, 2)
    index, side = int(rng.integers(1, last)), float(rng.choice((-1.0, 1.0)))
    middle = step * (index + 0.5 * (1.0 + gait.double_support))
    return hp.Push(middle - 0.5 * duration, (0.0, side * task.push, 0.0), duration)


@cache
def _gait() -> hp.gaits.StraightGait:
    """A gait of the scenarios, for the times of its steps: they are the same at every speed."""
    return hp.make_gait(hp.load_harpy())


def run_campaign(
    settings: CampaignSettings, path: Path, *, progress: Progress = silent
) -> dict[str, Any]:
    """Do the walks that the file lacks, and summarise those of this campaign.

    The rows are kept in a file of JSON lines; those of other settings or other code in it are left
    aside.
    """
    tasks = plan(settings)
    with Store(path) as store:
        execute(tasks, store, progress=progress)
        summary = summarise_rows(tasks, store.rows)
    result: dict[str, Any] = finite(
        {"settings": asdict(settings), "code": code_digest(), **summary}
    )
    return result


def execute(tasks: Sequence[Task], store: Store, *, progress: Progress = silent) -> None:
    """Do every walk that the store does not have yet; each is stored as soon as it and all before
    it are done.
    """
    code = code_digest()
    planned = {task.key(code): task for task in tasks}
    missing = [task for key, task in planned.items() if key not in store.rows]
    if len(missing) > ALONE:
        for task in {(task.contender, task.plant): task for task in missing}.values():
            # A moment of each contender's walk compiles here, once, what the workers then read from
            # the cache.
            walk_task(replace(task, duration=0.01, push=0.0))
    do_missing(store, planned, _row, progress)


def _row(task: Task) -> dict[str, Any]:
    return {"task": asdict(task), "measures": walk_task(task)}


USUAL: dict[str, Any] = {
    name: factor.usual for name, factor in FACTORS.items() if factor.usual is not None
}
"""The level of each factor at which nothing is unusual; friction has none."""

_NOTE = (
    "By seed. 'Who' slipped least of those that stood. 'Stands without': the levels without any "
    "one of which all WBCs "
    "that fell stand."
)


def variations(task: Task) -> dict[str, Task]:
    """The walk with one factor as usual, by the factor; factors that are as usual are left out."""
    unusual = (
        factor for factor in FACTORS if factor in USUAL and getattr(task, factor) != USUAL[factor]
    )
    return {factor: replace(task, **{factor: USUAL[factor]}) for factor in unusual}


def with_reasons(
    exceptions: Sequence[Mapping[str, Any]],
    tasks: Sequence[Task],
    path: Path,
    *,
    progress: Progress = silent,
) -> list[dict[str, Any]]:
    """Exceptions with ``reasons``: texts of the levels without any one of which the controllers
    that fell stand.
    """
    code, by_place = code_digest(), {(task.seed, task.contender): task for task in tasks}
    fell = [
        (entry, [by_place[entry["seed"], name] for name in entry["fell"]]) for entry in exceptions
    ]
    walks = [other for _, those in fell for task in those for other in variations(task).values()]
    with Store(path) as store:
        execute(walks, store, progress=progress)

        def stands(task: Task) -> bool:
            return not store.rows[task.key(code)]["measures"]["fell"]

        def reasons(those: Sequence[Task]) -> list[str]:
            return [
                FACTORS[factor].text(level_key(getattr(those[0], factor)))
                for factor in variations(those[0])
                if all(stands(variations(task)[factor]) for task in those)
            ]

        return [{**entry, "reasons": reasons(those)} for entry, those in fell]


def exceptions_table(summary: Mapping[str, Any]) -> Table:
    """The table of a summary's exceptions."""
    cells: list[Cell] = []
    for entry in summary["exceptions"]:
        row = str(entry["seed"])
        least = min(entry["stood"], key=entry["stood"].get)
        cells += [
            *(
                Cell(row, f"{label(name)} fell at", entry["fell"].get(name), "s")
                for name in WHOLE_BODY
            ),
            Cell(row, "others that stood", len(entry["stood"])),
            Cell(row, "their least slip", entry["stood"][least], "mm"),
            Cell(
                row,
                "scenario",
                ", ".join(FACTORS[factor].text(key) for factor, key in entry["levels"].items()),
            ),
            Cell(row, "who", f"{label(least)}, {number_text(entry['stood'][least])} mm"),
            Cell(row, "stands without", " or ".join(entry.get("reasons", ())) or None),
        ]
    title = f"Scenarios in which a WBC fell and another stood: {len(summary['exceptions'])}"
    return Table("exceptions", title, tuple(cells), _NOTE)
