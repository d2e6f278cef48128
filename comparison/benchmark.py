"""The whole comparison, from settings to one document that report and JSON share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from comparison.contenders import CONTENDERS
from comparison.limitations import limitations
from comparison.machine import describe_all_versions, describe_machine
from comparison.quality import achieved, pushed, walk_all
from comparison.states import StateSequence, record_states
from comparison.statistics import finite
from comparison.timing import TimingResult, TimingSettings, count_passes, time_contenders
from harpy_pin import checks
from harpy_pin.robot import load_harpy

__all__ = ["LOW_FRICTION", "Progress", "Settings", "compare"]

LOW_FRICTION = 0.25
"""The paper's friction coefficient."""

RECORDED = ("governed", "wbc")
"""Whose walks give the states for the timing."""

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and of how much."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What to compare, and how thoroughly.

    Attributes:
        friction: friction coefficient of the main condition.
        low_friction: of the further condition.
        duration: of a walk, s.
        seed: of the order of turns and of the pushes.
        pushes: walks with a push per contender and friction coefficient.
        push_speed: m/s.
        timing: how to time.
    """

    friction: float = 0.8
    low_friction: float = LOW_FRICTION
    duration: float = 6.0
    seed: int = 0
    pushes: int = 5
    push_speed: float = 0.1
    timing: TimingSettings = field(default_factory=TimingSettings)

    def __post_init__(self) -> None:
        checks.number("friction", self.friction, low=0.0)
        checks.number("low_friction", self.low_friction, low=0.0)
        checks.number("duration", self.duration, low=0.2)
        checks.number("seed", self.seed, low=0.0)
        checks.number("pushes", self.pushes, low=0.0)
        checks.number("push_speed", self.push_speed, low=0.0)
        checks.number("repetitions", self.timing.repetitions, low=1.0)
        checks.number("warm_up", self.timing.warm_up, low=1.0)
        checks.number("block", self.timing.block, low=self.timing.settle, strict=True)

    @classmethod
    def quick(cls, **changes: Any) -> Settings:
        """Shorter walks, fewer repetitions: to see whether it works, not to quote."""
        timing = TimingSettings(repetitions=3, programs=500, samples=30)
        return cls(**{"duration": 2.0, "pushes": 2, "timing": timing, **changes})


def compare(settings: Settings, progress: Progress = lambda what, done, total: None) -> dict[str, Any]:
    """Walk, time, check and describe.

    Args:
        settings: what to compare.
        progress: called between pieces of work, never while the clock runs.

    Returns:
        The document: only dicts, lists, strings, finite numbers and null.

    Raises:
        HarpyError: a setting is out of its domain, or a walk ended too early to give states.
    """
    machine = describe_machine()
    robot = load_harpy()
    rng = np.random.default_rng(settings.seed)

    def stage(what: str, total: int) -> Callable[[], None]:
        done = 0
        progress(what, 0, total)

        def step() -> None:
            nonlocal done
            done += 1
            progress(what, done, total)

        return step

    # The first walk compiles what is not cached yet; nothing of it is timed.
    conditions = {"": settings.friction, "_low_friction": settings.low_friction}
    walks, pushes, sequences = {}, {}, {}
    step = stage("walking", len(conditions) * len(CONTENDERS) * (1 + settings.pushes))
    for key, friction in conditions.items():
        runs = walk_all(robot, friction=friction, duration=settings.duration, on_walk=step)
        least = settings.timing.warm_up + 50
        sequences[key] = [record_states(name, runs[name], least=least) for name in RECORDED]
        walks[key] = achieved(runs)
        pushes[key] = pushed(
            robot,
            friction=friction,
            duration=settings.duration,
            speed=settings.push_speed,
            seeds=range(settings.seed, settings.seed + settings.pushes),
            on_walk=step,
        )

    results: dict[str, TimingResult] = {}
    step = stage("timing", sum(count_passes(settings.timing, len(s)) for s in sequences.values()))
    for key, friction in conditions.items():
        results[key] = time_contenders(
            robot, sequences[key], friction=friction, settings=settings.timing, rng=rng, on_pass=step
        )

    document: dict[str, Any] = {}
    for key in conditions:
        document[f"timing{key}"] = results[key].timing
    for key in conditions:
        document[f"walk{key}"] = walks[key]
    for key in conditions:
        document[f"walk_pushed{key}"] = pushes[key]
    for key in conditions:
        document[f"checks{key}"] = results[key].checks
    for key in conditions:
        document[f"activity{key}"] = results[key].activity
    document["settings"] = asdict(settings) | {"states": _describe_states(sequences[""])}
    document["machine"] = machine
    document["versions"] = describe_all_versions()
    document["limitations"] = limitations()
    result: dict[str, Any] = finite(document)
    return result


def _describe_states(sequences: list[StateSequence]) -> str:
    parts = [f"{len(s)} of the walk of '{s.name}'" for s in sequences]
    return " and ".join(parts) + ", each replayed in the order of time by every contender"
