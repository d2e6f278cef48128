"""Why a whole-body controller falls where others stand: the same walk, with one factor as usual."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from comparison.campaign.execute import execute
from comparison.campaign.levels import level_key, level_text
from comparison.campaign.plan import Task, code_digest
from comparison.campaign.settings import JOINT_DAMPING
from comparison.campaign.store import Store
from harpy_pin.scenario import Compliant, Straight
from harpy_pin.simulation.ground import Ground

__all__ = ["USUAL", "variations", "with_reasons"]

USUAL: Mapping[str, Any] = {
    "push": 0.0,
    "mass_error": 0.0,
    "friction_error": 0.0,
    "noise": 0.0,
    "delay": 0.0,
    "stiffness": Ground.stiffness,
    "damping": 1.0,
    "plant": Compliant.name,
    "speed": Straight().speed,
    "ice": 0.0,
    "joint_damping": JOINT_DAMPING,
    "torque_share": 1.0,
    "bandwidth": 0.0,
}
"""The level of each factor at which nothing is unusual; friction has none."""


def variations(task: Task) -> dict[str, Task]:
    """The walk with one factor as usual, by the factor; factors that are as usual are left out.

    Args:
        task: a walk.
    """
    return {f: replace(task, **{f: level}) for f, level in USUAL.items() if getattr(task, f) != level}


def with_reasons(
    exceptions: Sequence[Mapping[str, Any]],
    tasks: Sequence[Task],
    path: Path,
    *,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """Exceptions with ``reasons``: texts of the levels without any one of which the controller that fell stands.

    Args:
        exceptions: of :func:`comparison.campaign.exceptions.exceptions_of`.
        tasks: of the campaign.
        path: of the campaign's file, which keeps the further walks, too.
        scheduler: see :func:`comparison.campaign.execute.execute`.
        progress: is told how many walks are done.
    """
    code, by_place = code_digest(), {(task.seed, task.contender): task for task in tasks}
    fell = [(entry, [by_place[entry["seed"], name] for name in entry["fell"]]) for entry in exceptions]
    walks = [other for _, those in fell for task in those for other in variations(task).values()]
    with Store(path) as store:
        execute(walks, store, scheduler=scheduler, progress=progress)

        def stands(task: Task) -> bool:
            return not store.rows[task.key(code)]["measures"]["fell"]

        return [{**entry, "reasons": _reasons(those, stands)} for entry, those in fell]


def _reasons(fell: Sequence[Task], stands: Callable[[Task], bool]) -> list[str]:
    """Levels without any one of which all that fell stand."""
    first = variations(fell[0])
    helps = [factor for factor in first if all(stands(variations(task)[factor]) for task in fell)]
    return [level_text(factor, level_key(getattr(fell[0], factor))) for factor in helps]
