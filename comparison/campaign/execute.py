"""Has the walks of a campaign done, in processes of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from comparison.campaign.plan import Task, code_digest, plan
from comparison.campaign.settings import ENGINES, CampaignSettings
from comparison.campaign.store import Store
from comparison.campaign.summary import summarise_rows
from comparison.campaign.walks import walk_task
from comparison.measure.walking import ALONE, Progress, one_by_one
from harpy_pin.errors import HarpyError
from harpy_pin.files import finite
from harpy_pin.scenario import Mujoco
from harpy_pin.simulation.mujoco import installed_version


def run_campaign(
    settings: CampaignSettings, path: Path, *, progress: Progress = lambda done, total: None
) -> dict[str, Any]:
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


def execute(tasks: Sequence[Task], store: Store, *, progress: Progress = lambda done, total: None) -> None:
    """Do every walk that the store does not have yet; each is stored as soon as it and all before it are done.

    Raises:
        HarpyError: MuJoCo, where it is asked for, is not installed, or a walk failed.
    """
    code = code_digest()
    planned = {task.key(code): task for task in tasks}
    missing = {key: task for key, task in planned.items() if key not in store.rows}
    total = len(planned)
    progress(total - len(missing), total)
    if installed_version() is None and any(isinstance(ENGINES[task.plant], Mujoco) for task in missing.values()):
        message = "some of the campaign's walks are in MuJoCo, which is not installed: pip install 'harpy-pin[mujoco]'"
        raise HarpyError(message)
    if len(missing) > ALONE:
        for task in {(task.contender, task.plant): task for task in missing.values()}.values():
            # A moment of each contender's walk compiles here, once, what the workers then read from the cache.
            walk_task(replace(task, duration=0.01, push=0.0))
    rows = one_by_one(walk_task, list(missing.values()))
    for left, ((key, task), row) in enumerate(zip(missing.items(), rows, strict=True), start=1 - len(missing)):
        store.append(key, {"task": asdict(task), "measures": finite(row)})
        progress(total + left, total)
