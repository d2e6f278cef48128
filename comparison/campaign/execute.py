"""Has the walks of a campaign done by a cluster: one of its own on this machine, or one that exists."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from comparison.campaign.plan import Task, code_digest, plan
from comparison.campaign.settings import ENGINES, CampaignSettings
from comparison.campaign.store import Store
from comparison.campaign.summary import summarise_rows
from comparison.campaign.walks import walk_task
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.files import Shield, finite, without_interrupts
from harpy_pin.scenario import Mujoco
from harpy_pin.simulation.mujoco import installed_version

RETRIES = 2
"""How often a walk that raised is tried again, and a walk whose workers died beyond the scheduler's own patience."""

PATIENCE = 30.0
"""How long to wait for a scheduler and its first worker, s."""

Progress = Callable[[int, int], None]
"""Called with walks done and walks in all."""


def run_campaign(
    settings: CampaignSettings,
    path: Path,
    *,
    scheduler: str | None = None,
    progress: Progress = lambda done, total: None,
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


def execute(
    tasks: Sequence[Task], store: Store, *, scheduler: str | None = None, progress: Progress = lambda done, total: None
) -> None:
    """Do every walk that the store does not have yet; each is stored as it arrives.

    The walks are done by the workers of a Dask scheduler at an address, which need this code, or by a cluster on this
    machine with one worker per usable core.

    Raises:
        HarpyError: Dask, or MuJoCo where it is asked for, is not installed; the cluster cannot be reached or lacks this
            code; or a walk failed.
    """
    code = code_digest()
    planned = {task.key(code): task for task in tasks}
    missing = {key: task for key, task in planned.items() if key not in store.rows}
    done, total = len(planned) - len(missing), len(planned)
    progress(done, total)
    if not missing:
        return
    if installed_version() is None and any(isinstance(ENGINES[task.plant], Mujoco) for task in missing.values()):
        message = "some of the campaign's walks are in MuJoCo, which is not installed: pip install 'harpy-pin[mujoco]'"
        raise HarpyError(message)
    dask = _dask()
    with _cluster(dask, missing) if scheduler is None else _connected(dask, scheduler) as client:
        futures = {
            client.submit(walk_task, task, code, key=f"walk-{key}", retries=RETRIES, pure=False): key
            for key, task in missing.items()
        }
        try:
            for future in dask.as_completed(list(futures)):
                key = futures.pop(future)
                store.append(key, {"task": asdict(missing[key]), "measures": finite(_result(future))})
                future.release()
                done += 1
                progress(done, total)
        finally:
            client.cancel(list(futures))


def _result(future: Any) -> dict[str, Any]:
    """The row of a finished walk; errors that a user can mend are told as such."""
    try:
        row: dict[str, Any] = future.result()
        return row
    except HarpyError:
        raise
    except ModuleNotFoundError as error:
        message = f"a worker lacks '{error.name}': start the workers in this checkout"
        raise InputError(message, name="scheduler") from error
    except Exception as error:
        raise HarpyError(f"a walk failed on the cluster: {error}") from error


def _dask() -> Any:
    """Dask's distributed scheduler, where it is installed."""
    try:
        return import_module("distributed")
    except ImportError as error:
        raise HarpyError("the campaign needs Dask: pip install 'dask[distributed]'") from error


@contextmanager
def _connected(dask: Any, scheduler: str) -> Iterator[Any]:
    """A client of a cluster that exists."""
    try:
        client = dask.Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"no scheduler answers at '{scheduler}'", name="scheduler", value=scheduler) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError as error:
            raise InputError(f"the scheduler at '{scheduler}' has no workers", name="scheduler") from error
        yield client


@contextmanager
def _cluster(dask: Any, missing: dict[str, Task]) -> Iterator[Any]:
    """A client of a cluster on this machine."""
    for task in {(task.contender, task.plant): task for task in missing.values()}.values():
        # A moment of each contender's walk compiles here, once, what the workers then read from the cache.
        walk_task(replace(task, duration=0.01, push=0.0), code_digest())
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ExitStack() as started:
        # Ctrl-C ends the workers by this process, which closes the cluster; a signal waits until it can be closed.
        with Shield(saving=True), without_interrupts():
            cluster = dask.LocalCluster(
                n_workers=min(cores, len(missing)),
                threads_per_worker=1,
                processes=True,
                dashboard_address=":0",
                silence_logs=logging.CRITICAL,
            )
            client = started.enter_context(dask.Client(started.enter_context(cluster)))
        yield client
