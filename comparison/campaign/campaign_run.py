"""A whole campaign: plan, execute, summarise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from comparison.campaign.execute import execute
from comparison.campaign.plan import code_digest, plan
from comparison.campaign.settings import CampaignSettings
from comparison.campaign.store import Store
from comparison.campaign.summary import summarise_rows
from harpy_pin.files import finite

__all__ = ["run_campaign"]


def run_campaign(
    settings: CampaignSettings,
    path: Path,
    *,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Do the walks that the file lacks, and summarise those of this campaign.

    The rows are kept in a file of JSON lines; those of other settings or other code in it are left aside. The walks are
    done by the Dask scheduler of an address, or by a cluster on this machine.

    Raises:
        HarpyError: a setting is out of its domain, the file cannot be used, or the cluster fails.
    """
    tasks = plan(settings)
    with Store(path) as store:
        execute(tasks, store, scheduler=scheduler, progress=progress)
        summary = summarise_rows(tasks, store.rows)
    result: dict[str, Any] = finite({"settings": asdict(settings), "code": code_digest(), **summary})
    return result
