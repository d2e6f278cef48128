"""Where the time of a closed-loop walk goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Any

from harpy_pin.errors import InputError
from harpy_pin.run import Run
from harpy_pin.simulation import Simulator, Steppable

__all__ = ["Profile", "profile_run"]


@dataclass(frozen=True)
class Profile:
    """Times of one run.

    Attributes:
        total: wall clock of the run, s.
        simulated: time that passed in it, s.
        ticks: control ticks.
        parts: share of the wall clock by part, s; they add up to the total.
        calls: how often each part ran.
    """

    total: float
    simulated: float
    ticks: int
    parts: dict[str, float]
    calls: dict[str, int]

    @property
    def real_time(self) -> float:
        """Simulated time over wall clock."""
        return self.simulated / self.total


class _Stopwatch:
    """Adds up the time spent in a function."""

    def __init__(self) -> None:
        self.nanoseconds, self.calls = 0, 0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any) -> Any:
            begin = perf_counter_ns()
            try:
                return function(*args)
            finally:
                self.nanoseconds += perf_counter_ns() - begin
                self.calls += 1

        return timed


@contextmanager
def _timing(owner: Any, name: str) -> Iterator[_Stopwatch]:
    """Time one method of one object, and leave the object as it was."""
    watch = _Stopwatch()
    own = vars(owner).get(name) if hasattr(owner, "__dict__") else None
    try:
        setattr(owner, name, watch.around(getattr(owner, name)))
    except AttributeError as error:
        message = f"{type(owner).__name__} has slots and no room for a timed '{name}'; it cannot be profiled"
        raise InputError(message, name="controller", value=owner) from error
    try:
        yield watch
    finally:
        if own is None:
            delattr(owner, name)
        else:
            setattr(owner, name, own)


def profile_run(simulator: Simulator, controller: Steppable, duration: float, **options: Any) -> tuple[Run, Profile]:
    """Run a controller, and measure where the time goes.

    The results are those of :meth:`Simulator.run`. Each measured call costs two readings of the clock and a Python call
    more, about 0.2 µs; a tick has three with the default periods, a physics step two.

    Args:
        simulator: reset to the start.
        controller: to run.
        duration: simulated time, s.
        options: further arguments of :meth:`Simulator.run`.

    Returns:
        The log and the profile.

    Raises:
        InputError: the controller has no step, or slots that leave no room to time it.
        HarpyError: as :meth:`Simulator.run` does.
    """
    with (
        _timing(controller, "step") as control,
        _timing(simulator, "advance") as physics,
        _timing(simulator.dynamics, "update") as terms,
    ):
        begin = perf_counter_ns()
        run = simulator.run(controller, duration, **options)
        total = perf_counter_ns() - begin
    nanoseconds = {
        "controller": control.nanoseconds,
        "physics: rigid-body terms": terms.nanoseconds,
        "physics: contact step, integration": physics.nanoseconds - terms.nanoseconds,
        "states, checks, log": total - control.nanoseconds - physics.nanoseconds,
    }
    calls = dict(zip(nanoseconds, (control.calls, terms.calls, physics.calls, control.calls), strict=True))
    return run, Profile(
        total=total * 1e-9,
        simulated=len(run) * float(run.metadata["control_period"]),
        ticks=len(run),
        parts={name: value * 1e-9 for name, value in nanoseconds.items()},
        calls=calls,
    )
