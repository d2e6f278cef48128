"""Where the time of a run goes: the calls that the simulator makes, with a clock around each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from statistics import median
from time import perf_counter_ns
from typing import Any

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.simulation.plant import Plant

__all__ = ["Part", "Profile", "Profiler"]

TIMED = {"advance": "physics steps", "log": "log"}
"""Methods of the simulator that are timed, and what readers see."""


@dataclass(frozen=True)
class Part:
    """One part of a run.

    Attributes:
        name: what was done.
        calls: how often, the first not counted; zero for what is more than calls of one kind.
        seconds: together.
    """

    name: str
    calls: int
    seconds: float


@dataclass(frozen=True)
class Profile:
    """The parts of a run; their times exclude each other and add up to the total.

    Attributes:
        parts: in the order in which they are shown.
        ticks: control ticks.
        simulated: time, s.
        total: elapsed time, s.
    """

    parts: tuple[Part, ...]
    ticks: int
    simulated: float
    total: float

    def __getitem__(self, name: str) -> Part:
        """One part.

        Raises:
            InputError: there is none of that name.
        """
        for part in self.parts:
            if part.name == name:
                return part
        raise InputError.unknown("part", name, [part.name for part in self.parts])

    @property
    def real_time_factor(self) -> float:
        """Simulated over elapsed time, without the first calls and without the profiler's own clocks."""
        return self.simulated / (self.total - self["first calls"].seconds - self["clocks"].seconds)

    def as_dict(self) -> dict[str, Any]:
        """Names and values, ready for JSON."""
        return {**asdict(self), "real_time_factor": self.real_time_factor}


class Profiler:
    """Times the parts of a run::

        with Profiler(simulator) as profiler:
            run = simulator.run(controller, 6.0)
        profile = profiler.profile(run)

    While it is active it stands in front of the simulator's own methods, so that what is timed is what always runs.
    The controller's tick is timed by the run itself. What the clocks cost is estimated and shown as a part.

    Args:
        simulator: whose next run is timed.
    """

    def __init__(self, simulator: Plant) -> None:
        self.simulator = simulator
        self._laps: dict[str, list[int]] = {method: [] for method in TIMED}
        self._elapsed = 0

    def __enter__(self) -> Profiler:
        self._own = {method: vars(self.simulator)[method] for method in TIMED if method in vars(self.simulator)}
        for method, laps in self._laps.items():
            laps.clear()
            # An attribute of the object hides the method of its class until it is deleted again.
            setattr(self.simulator, method, _timed(getattr(self.simulator, method), laps))
        self._begin = perf_counter_ns()
        return self

    def __exit__(self, *error: object) -> None:
        self._elapsed = perf_counter_ns() - self._begin
        for method in TIMED:
            delattr(self.simulator, method)
        vars(self.simulator).update(self._own)

    @checked
    def profile(self, run: Run) -> Profile:
        """The parts of what ran.

        The first call of each part, which loads what is compiled, is a part of its own.

        Args:
            run: the only one since the profiler became active.
        """
        inside, whole = _cost_of_a_clock()
        ticks = run["tick_ns"].tolist()
        parts = [Part("controller tick", len(ticks[1:]), sum(ticks[1:]) * 1e-9)]
        first, clocks = sum(ticks[:1]), 0.0
        for method, name in TIMED.items():
            laps = self._laps[method]
            calls = len(laps[1:])
            parts.append(Part(name, calls, (sum(laps[1:]) - inside * calls) * 1e-9))
            first += sum(laps[:1])
            clocks += whole * calls
        parts += [Part("first calls", 0, first * 1e-9), Part("clocks", 0, clocks * 1e-9)]
        total = self._elapsed * 1e-9
        parts.append(Part("rest", 0, total - sum(part.seconds for part in parts)))
        simulated = float(run.metadata["end_time"] - run["t"][0]) if len(run) else 0.0
        return Profile(tuple(parts), len(ticks), simulated, total)


def _timed(function: Callable[..., Any], laps: list[int]) -> Callable[..., Any]:
    """The function with a clock around it, which appends nanoseconds."""

    def timed(*arguments: Any, **options: Any) -> Any:
        begin = perf_counter_ns()
        result = function(*arguments, **options)
        laps.append(perf_counter_ns() - begin)
        return result

    return timed


def _cost_of_a_clock(calls: int = 2000) -> tuple[float, float]:
    """What a clock adds to the lap it takes, and what to the time of the run, ns (medians)."""

    def nothing() -> None:
        return None

    timed = _timed(nothing, [])
    empty, plain, whole = [], [], []
    for _ in range(calls):
        a = perf_counter_ns()
        b = perf_counter_ns()
        nothing()
        c = perf_counter_ns()
        timed()
        d = perf_counter_ns()
        empty.append(b - a)
        plain.append(c - b)
        whole.append(d - c)
    return median(empty), median(whole) - median(plain)
