"""Walks, contenders by name, and the states that controllers were given; a study's walks one after
the other.
"""

import hashlib
import multiprocessing
import os
import warnings
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Any, TypeVar

import numpy as np

import harpy_pin as hp
from comparison.contenders import controller_part
from comparison.measure.interrupts import without_interrupts
from harpy_pin import Disturbances, Ground, Robot, make_gait
from harpy_pin.model.state import State

Progress = Callable[[int, int], None]
"""Called after every piece of work with how many are done, and of how many."""

Rows = list[dict[str, Any]]
"""What a study found: an entry for each walk, robot or figure."""

ALONE = 40
"""Up to so many walks are done in this process."""

_Job = TypeVar("_Job")


def silent(done: int, total: int) -> None:
    """Progress that nobody is told of."""


def stage(progress: Callable[[str, int, int], None], what: str, total: int) -> Callable[[], None]:
    """Announce a stage of the work and its number of pieces; returns what to call after each
    piece.
    """
    progress(what, 0, total)
    done = count(1)
    return lambda: progress(what, next(done), total)


def one_by_one(
    walk: Callable[[_Job], dict[str, Any]], jobs: Sequence[_Job]
) -> Generator[dict[str, Any]]:
    """A row for each job, each as soon as it and all before it are there.

    Many are done in processes of their own, one a core, or by a cluster
    (:func:`comparison.campaign.cluster.workers`).

    Args:
        walk: function of a module, of one job.
        jobs: what is walked.
    """
    return PLACE.get()(walk, jobs)


def _on_this_machine(
    walk: Callable[[_Job], dict[str, Any]], jobs: Sequence[_Job]
) -> Generator[dict[str, Any]]:
    if len(jobs) <= ALONE:
        yield from map(walk, jobs)
        return
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        try:
            with without_interrupts():  # Ctrl-C ends the workers by this process
                found = pool.map(walk, jobs)
            yield from found
        except BrokenProcessPool as error:
            raise hp.HarpyError(
                "a process that walked was killed; the same command goes on with what is kept"
            ) from error
        finally:
            pool.shutdown(cancel_futures=True)


PLACE: ContextVar[Callable[..., Generator[dict[str, Any]]]] = ContextVar(
    "PLACE", default=_on_this_machine
)
"""What :func:`one_by_one` does, of the same arguments."""


def grouped(rows: Iterable[dict[str, Any]], *names: str) -> dict[tuple[Any, ...], Rows]:
    """Rows with the same values of these entries together, by the values, in the order of the
    rows.
    """
    groups: dict[tuple[Any, ...], Rows] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def walk_as_far_as_it_goes(
    scenario: hp.Scenario, controller: Callable[..., hp.Controller] | None = None
) -> hp.Run:
    """The log of a walk; that of a controller that failed ends at its failure.

    Args:
        scenario: what is walked.
        controller: makes another controller than the scenario's, from the gait.
    """
    return as_far_as_it_goes(partial(hp.walk, scenario, controller=controller))


def as_far_as_it_goes(walked: Callable[[], hp.Run]) -> hp.Run:
    """The log of a walk that is ready to begin; that of a controller that failed ends at its
    failure.
    """
    try:
        with warnings.catch_warnings():  # studies ask for such velocities on purpose
            warnings.filterwarnings(
                "ignore", "velocity .* is more than the robot walks", UserWarning
            )
            return walked()
    except hp.ControlError as error:
        if error.run is None or len(error.run) == 0:
            raise
        run: hp.Run = error.run
        return run


def scenario_of(name: str, friction: float, **changes: Any) -> hp.Scenario:
    """A contender's walk at the gait's default speed.

    The name is that of :func:`comparison.contenders.controller_part`; the controller knows the
    ground's static friction coefficient unless changes of the scenario say otherwise.
    """
    return hp.Scenario(controller=controller_part(name), ground=Ground(mu_s=friction), **changes)


def make_contender(name: str, robot: Robot, friction: float) -> Any:
    """A new controller with a gait of its own, by the name of its contender."""
    return controller_part(name).make(make_gait(robot), mu=friction, period=1e-3)


@dataclass(frozen=True)
class StateSequence:
    """States of one walk, in the order of time, one per control tick; ``name`` is the contender
    that walked.
    """

    name: str
    states: tuple[State, ...]

    def __len__(self) -> int:
        return len(self.states)

    def digest(self) -> str:
        """SHA-256 of every number, to show that replays leave the states as they were."""
        total = hashlib.sha256()
        for s in self.states:
            for array in (
                np.float64(s.t),
                s.q,
                s.v,
                s.foot_position,
                s.foot_velocity,
                s.foot_force,
            ):
                total.update(array.tobytes())
        return total.hexdigest()


def standing_ground(robot: Robot, friction: float) -> Ground:
    """Ground into which the feet of a robot that stands sink by 1 mm."""
    weight = robot.mass * hp.model.GRAVITY
    return Ground(mu_s=friction, stiffness=weight / (len(robot.feet) * 1e-3))


def recorded_walk(name: str, *, friction: float, duration: float, impulse: float = 0.0) -> hp.Run:
    """Walk in closed loop; the log ends early if the robot falls.

    Args:
        name: of :func:`scenario_of`.
        friction: of the ground, which the controller knows.
        duration: s.
        impulse: of a lateral push to alternating sides in every second, N·s: many touchdowns and
            recoveries.
    """
    times = np.arange(0.6, duration - 0.1, 1.0) if impulse else ()
    pushes = tuple(
        hp.Push(float(t), (0.0, impulse if k % 2 == 0 else -impulse, 0.0))
        for k, t in enumerate(times)
    )
    disturbances = Disturbances(pushes=pushes)
    return hp.walk(scenario_of(name, friction, duration=duration, disturbances=disturbances))


def record_states(name: str, run: hp.Run, *, least: int) -> StateSequence:
    """The states of a walk."""
    if len(run) < least:
        raise hp.InputError(
            f"the walk of '{name}' {run.ending} after {len(run)} ticks; the timing needs {least} "
            f"(more friction helps)",
            name="friction",
        )
    arrays = [run[key] for key in ("q", "v", "foot_position", "foot_velocity", "foot_force")]
    return StateSequence(
        name,
        tuple(
            State(float(t), *(array[i].copy() for array in arrays)) for i, t in enumerate(run["t"])
        ),
    )
