"""Has the walks of a campaign done, in processes of their own, and finds why a whole-body controller fell.

Exceptions are scenarios in which a whole-body controller falls and somebody else stands; their reasons are the levels
without which it stands, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

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
from comparison.campaign.walks import walk_task
from comparison.contenders import label
from comparison.measure.walking import ALONE, Progress, silent
from comparison.tables import Cell, Table, number_text
from harpy_pin.errors import HarpyError
from harpy_pin.files import finite
from harpy_pin.ground.ground import Ground
from harpy_pin.scenario import Compliant, Mujoco, Straight
from harpy_pin.simulation.mujoco import installed_version


def run_campaign(settings: CampaignSettings, path: Path, *, progress: Progress = silent) -> dict[str, Any]:
    """Do the walks that the file lacks, and summarise those of this campaign.

    The rows are kept in a file of JSON lines; those of other settings or other code in it are left aside.

    Raises:
        HarpyError: a setting is out of its domain, the file cannot be used, or a walk failed.
    """
    tasks = plan(settings)
    with Store(path) as store:
        execute(tasks, store, progress=progress)
        summary = summarise_rows(tasks, store.rows)
    result: dict[str, Any] = finite({"settings": asdict(settings), "code": code_digest(), **summary})
    return result


def execute(tasks: Sequence[Task], store: Store, *, progress: Progress = silent) -> None:
    """Do every walk that the store does not have yet; each is stored as soon as it and all before it are done.

    Raises:
        HarpyError: MuJoCo, where it is asked for, is not installed, or a walk failed.
    """
    code = code_digest()
    planned = {task.key(code): task for task in tasks}
    missing = [task for key, task in planned.items() if key not in store.rows]
    if installed_version() is None and any(isinstance(ENGINES[task.plant], Mujoco) for task in missing):
        message = "some of the campaign's walks are in MuJoCo, which is not installed: pip install 'harpy-pin[mujoco]'"
        raise HarpyError(message)
    if len(missing) > ALONE:
        for task in {(task.contender, task.plant): task for task in missing}.values():
            # A moment of each contender's walk compiles here, once, what the workers then read from the cache.
            walk_task(replace(task, duration=0.01, push=0.0))
    do_missing(store, planned, _row, progress)


def _row(task: Task) -> dict[str, Any]:
    return {"task": asdict(task), "measures": walk_task(task)}


USUAL: Mapping[str, Any] = {
    **dict.fromkeys(("push", "mass_error", "friction_error", "noise", "delay", "ice", "bandwidth"), 0.0),
    "stiffness": Ground.stiffness,
    "damping": 1.0,
    "plant": Compliant.name,
    "speed": Straight().speed,
    "joint_damping": JOINT_DAMPING,
    "torque_share": 1.0,
}
"""The level of each factor at which nothing is unusual; friction has none."""

_NOTE = (
    "By seed. 'Who' slipped least of those that stood. 'Stands without': the levels without any one of which all WBCs "
    "that fell stand."
)


def variations(task: Task) -> dict[str, Task]:
    """The walk with one factor as usual, by the factor; factors that are as usual are left out."""
    unusual = (factor for factor in FACTORS if factor in USUAL and getattr(task, factor) != USUAL[factor])
    return {factor: replace(task, **{factor: USUAL[factor]}) for factor in unusual}


def with_reasons(
    exceptions: Sequence[Mapping[str, Any]], tasks: Sequence[Task], path: Path, *, progress: Progress = silent
) -> list[dict[str, Any]]:
    """Exceptions with ``reasons``: texts of the levels without any one of which the controllers that fell stand.

    Args:
        exceptions: of a campaign's summary.
        tasks: of the campaign.
        path: of the campaign's file, which keeps the further walks, too.
        progress: called with how many walks are done, and of how many.
    """
    code, by_place = code_digest(), {(task.seed, task.contender): task for task in tasks}
    fell = [(entry, [by_place[entry["seed"], name] for name in entry["fell"]]) for entry in exceptions]
    walks = [other for _, those in fell for task in those for other in variations(task).values()]
    with Store(path) as store:
        execute(walks, store, progress=progress)

        def stands(task: Task) -> bool:
            return not store.rows[task.key(code)]["measures"]["fell"]

        return [{**entry, "reasons": _reasons(those, stands)} for entry, those in fell]


def _reasons(fell: Sequence[Task], stands: Callable[[Task], bool]) -> list[str]:
    """Levels without any one of which all that fell stand."""
    return [
        FACTORS[factor].text(level_key(getattr(fell[0], factor)))
        for factor in variations(fell[0])
        if all(stands(variations(task)[factor]) for task in fell)
    ]


def exceptions_table(summary: Mapping[str, Any]) -> Table:
    """The table of a summary's exceptions."""
    cells: list[Cell] = []
    for entry in summary["exceptions"]:
        row = str(entry["seed"])
        least = min(entry["stood"], key=entry["stood"].get)
        cells += [
            *(Cell(row, f"{label(name)} fell at", entry["fell"].get(name), "s") for name in WHOLE_BODY),
            Cell(row, "others that stood", len(entry["stood"])),
            Cell(row, "their least slip", entry["stood"][least], "mm"),
            Cell(row, "scenario", ", ".join(FACTORS[factor].text(key) for factor, key in entry["levels"].items())),
            Cell(row, "who", f"{label(least)}, {number_text(entry['stood'][least])} mm"),
            Cell(row, "stands without", " or ".join(entry.get("reasons", ())) or None),
        ]
    title = f"Scenarios in which a WBC fell and another stood: {len(summary['exceptions'])}"
    return Table("exceptions", title, tuple(cells), _NOTE)
