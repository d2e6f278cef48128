"""Walks of a study: one after the other with progress, each to its end or to the failure of its controller."""

from __future__ import annotations

import multiprocessing
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import Any, TypeVar

from harpy_pin.errors import ControlError, HarpyError
from harpy_pin.files import without_interrupts
from harpy_pin.log.run import Run
from harpy_pin.scenario import Scenario, walk
from harpy_pin.simulation.loop import Controller

Progress = Callable[[int, int], None]
"""Called after every piece of work with how many are done, and of how many."""

Rows = list[dict[str, Any]]
"""What a study found: an entry for each walk, robot or figure."""

ALONE = 40
"""Up to so many walks are done in this process."""

_Job = TypeVar("_Job")


def tracked(jobs: Sequence[_Job], progress: Progress | None) -> Iterator[_Job]:
    """The jobs one by one; progress is called when the next one is asked for."""
    for done, job in enumerate(jobs, start=1):
        yield job
        if progress is not None:
            progress(done, len(jobs))


def one_by_one(walk: Callable[[_Job], dict[str, Any]], jobs: Sequence[_Job]) -> Iterator[dict[str, Any]]:
    """A row for each job, each as soon as it and all before it are there; many in processes of their own, one a core.

    Args:
        walk: function of a module, of one job.
        jobs: what is walked.
    """
    if len(jobs) <= ALONE:
        yield from map(walk, jobs)
        return
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        try:
            with without_interrupts():  # Ctrl-C ends the workers by this process
                found = pool.map(walk, jobs)
            yield from found
        except BrokenProcessPool as error:
            raise HarpyError("a process that walked was killed; the same command goes on with what is kept") from error
        finally:
            pool.shutdown(cancel_futures=True)


def grouped(rows: Sequence[dict[str, Any]], *names: str) -> dict[tuple[Any, ...], Rows]:
    """Rows with the same values of these entries together, by the values, in the order of the rows."""
    groups: dict[tuple[Any, ...], Rows] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def walk_as_far_as_it_goes(scenario: Scenario, controller: Callable[..., Controller] | None = None) -> Run:
    """The log of a walk; that of a controller that failed ends at its failure.

    Args:
        scenario: what is walked.
        controller: makes another controller than the scenario's, from the gait.

    Raises:
        ControlError: the controller failed before the first tick was logged.
    """
    return as_far_as_it_goes(partial(walk, scenario, controller=controller))


def as_far_as_it_goes(walked: Callable[[], Run]) -> Run:
    """The log of a walk that is ready to begin; that of a controller that failed ends at its failure."""
    try:
        with warnings.catch_warnings():  # studies ask for such velocities on purpose
            warnings.filterwarnings("ignore", "velocity .* is more than the robot walks", UserWarning)
            return walked()
    except ControlError as error:
        if error.run is None or len(error.run) == 0:
            raise
        run: Run = error.run
        return run
