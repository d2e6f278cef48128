"""Has the walks of a campaign done by a cluster: one of its own on this machine, or one that exists."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from importlib import import_module
from typing import Any

from comparison.campaign.plan import Task, code_digest
from comparison.campaign.settings import ENGINES
from comparison.campaign.store import Store
from comparison.campaign.walks import walk_task
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.files import Shield, finite, without_interrupts
from harpy_pin.scenario import Mujoco
from harpy_pin.simulation.mujoco import installed_version

__all__ = ["execute"]

RETRIES = 2
"""How often a walk that raised is tried again, and a walk whose workers died beyond the scheduler's own patience."""

PATIENCE = 30.0
"""How long to wait for a scheduler and its first worker, s."""


def execute(
    tasks: Sequence[Task],
    store: Store,
    *,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Do every walk that the store does not have yet; each is stored as it arrives.

    The walks are done by the workers of a Dask scheduler at an address, which need this code, or by a cluster on this
    machine with one worker per usable core. Progress is called with walks done and walks in all.

    Raises:
        HarpyError: Dask, or MuJoCo where it is asked for, is not installed; the cluster cannot be reached or lacks this
            code; or a walk failed.
    """
    code = code_digest()
    missing = {task.key(code): task for task in tasks}
    total = len(missing)
    for key in store.rows.keys() & missing.keys():
        del missing[key]
    progress(total - len(missing), total)
    if not missing:
        return
    _require_engines(missing)
    dask = _dask()
    with _client(dask, missing, scheduler) as client:
        futures = {
            client.submit(walk_task, task, code, key=f"walk-{key}", retries=RETRIES, pure=False): key
            for key, task in missing.items()
        }
        done = total - len(missing)
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
def _client(dask: Any, missing: dict[str, Task], scheduler: str | None) -> Iterator[Any]:
    """A client of the cluster that is to do the walks."""
    if scheduler is not None:
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
        return
    _compile(missing)
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


def _require_engines(missing: dict[str, Task]) -> None:
    """Refuse walks that cannot be done here, before the first one is done."""
    if installed_version() is None and any(isinstance(ENGINES[task.plant], Mujoco) for task in missing.values()):
        message = "some of the campaign's walks are in MuJoCo, which is not installed: pip install 'harpy-pin[mujoco]'"
        raise HarpyError(message)


def _compile(missing: dict[str, Task]) -> None:
    """Compile once, here, what the workers are then to read from the cache: a moment of each contender's walk."""
    some = {(task.contender, task.plant): task for task in missing.values()}
    for task in some.values():
        walk_task(replace(task, duration=0.01, push=0.0), code_digest())
