"""The whole comparison, from settings to one document that report and JSON share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from comparison.campaign.execute import run_campaign
from comparison.campaign.settings import QUICK, CampaignSettings
from comparison.measure.controllers import CONTENDERS
from comparison.measure.machine import describe_all_versions, describe_machine
from comparison.measure.states import StateSequence, pushed_walk, record_states, walk
from comparison.measure.timing import Bench, TimingSettings
from comparison.sections.formulations import time_formulations
from comparison.sections.growth import FACES, time_growth
from comparison.sections.simulator import WALKERS, WALKS, time_simulator
from comparison.sections.ticks import time_ticks
from comparison.sections.timing import count_passes, time_contenders
from harpy_pin import checks, measure
from harpy_pin.files import finite
from harpy_pin.model.robot import Robot, load_harpy

FRICTION = 0.25
"""The paper's friction coefficient."""

RECORDED = ("governed", "wbc")
"""Whose walks give the states for the timing."""

PUSHED = {"filter": "governed/filter", "wbc": "wbc"}
"""Whose walks with pushes give the states for the sections on ticks and formulations."""

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and of how much."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What to compare, and how thoroughly.

    Attributes:
        friction: friction coefficient of the walks whose states are timed.
        duration: of a walk, s.
        seed: of the order in which candidates are timed.
        impulse: of the pushes during the walks on which every controller's tick is timed, N·s.
        faces: numbers of faces of the friction pyramid, of the section on growth.
        timing: how to time.
        campaign: the walks of the campaign, where it is asked for.
    """

    friction: float = FRICTION
    duration: float = 6.0
    seed: int = 0
    impulse: float = 3.0
    faces: tuple[int, ...] = FACES
    timing: TimingSettings = field(default_factory=TimingSettings)
    campaign: CampaignSettings = field(default_factory=CampaignSettings)

    def __post_init__(self) -> None:
        checks.numbers(self, "friction", low=0.0, high=checks.MAX_FRICTION)
        checks.ticks(checks.number("duration", self.duration, low=0.2), 1e-3)
        checks.numbers(self, "seed", "impulse", low=0.0)
        checks.number("repetitions", self.timing.repetitions, low=1.0)
        checks.number("warm_up", self.timing.warm_up, low=1.0)
        checks.number("block", self.timing.block, low=self.timing.settle, strict=True)

    @classmethod
    def quick(cls, **changes: Any) -> Settings:
        """Shorter walks, fewer repetitions, fewer sizes: to see whether it works, not to quote."""
        timing = TimingSettings(repetitions=3, programs=500, samples=30)
        given = {
            "duration": 2.0,
            "faces": FACES[:2],
            "timing": timing,
            "campaign": CampaignSettings(**QUICK),
            **changes,
        }
        return cls(**given)


@dataclass(frozen=True)
class SectionInputs:
    """What an optional section of the document may use.

    Attributes:
        robot: that walked.
        settings: of the comparison.
        pushed: states of walks with pushes on low friction: of the contact-force filter, and of the QP controller.
        rows: file of the campaign's rows; None where they are not to be kept.
        progress: of the comparison.
    """

    robot: Robot
    settings: Settings
    pushed: list[StateSequence]
    rows: Path | None
    progress: Progress

    def stage(self, what: str, total: int) -> Callable[[], None]:
        """Announce a stage of the work and its number of pieces; returns what to call after each piece."""
        return _stage(self.progress, what, total)

    def bench(self, name: str, stream: int, pieces: int | None = None) -> Bench:
        """What a section needs to time: the friction, and random numbers of its own by their stream.

        Progress has one piece for each repetition by default.
        """
        settings = self.settings
        return Bench(
            robot=self.robot,
            friction=settings.friction,
            settings=settings.timing,
            rng=np.random.default_rng([settings.seed, stream]),
            on_pass=self.stage(name, settings.timing.repetitions if pieces is None else pieces),
        )


def _ticks(inputs: SectionInputs) -> dict[str, Any]:
    measured = time_ticks(inputs.bench("ticks", 1), inputs.pushed)
    return {"friction": inputs.settings.friction, "impulse": inputs.settings.impulse, "contenders": measured}


def _growth(inputs: SectionInputs) -> dict[str, Any]:
    s, stage = inputs.settings, partial(inputs.stage, "growth")
    return time_growth(inputs.robot, repetitions=s.timing.repetitions, seed=s.seed, faces=s.faces, stage=stage)


def _simulator(inputs: SectionInputs) -> dict[str, Any]:
    bench = inputs.bench("simulator", 4, WALKS * len(WALKERS))
    return time_simulator(bench, duration=min(inputs.settings.duration, 4.0))


def _campaign(inputs: SectionInputs) -> dict[str, Any]:
    """Many walks; nothing is timed meanwhile."""
    with TemporaryDirectory() as folder:
        rows = inputs.rows or Path(folder) / "rows.jsonl"
        return run_campaign(inputs.settings.campaign, rows, progress=partial(inputs.progress, "campaign"))


SECTIONS: dict[str, Callable[[SectionInputs], dict[str, Any]]] = {
    "ticks": _ticks,
    "formulations": lambda inputs: time_formulations(inputs.bench("formulations", 3), inputs.pushed[1]),
    "growth": _growth,
    "simulator": _simulator,
    "campaign": _campaign,
}
"""Optional sections of the document by name, in the order in which they are measured, one after the other.

What a section returns stands in the document under its name; its tables are made in :mod:`comparison.report.contents`.
"""


def _stage(progress: Progress, what: str, total: int) -> Callable[[], None]:
    progress(what, 0, total)
    done = count(1)
    return lambda: progress(what, next(done), total)


def compare(
    settings: Settings,
    progress: Progress = lambda what, done, total: None,
    *,
    sections: Sequence[str] = (),
    rows: Path | None = None,
) -> dict[str, Any]:
    """Walk, time, check and describe.

    Progress is called between pieces of work, never while the clock runs. The campaign keeps its rows in the file
    ``rows``, if there is one, and goes on from them; ``sections`` are names of :data:`SECTIONS`.

    Returns:
        The document: only dicts, lists, strings, finite numbers and null.

    Raises:
        HarpyError: a setting is out of its domain, or a walk ended too early to give states.
    """
    for name in sections:
        checks.one_of("section", name, SECTIONS)
    document: dict[str, Any] = {"machine": describe_machine()}
    robot, rng, least = load_harpy(), np.random.default_rng(settings.seed), settings.timing.warm_up + 50
    step = _stage(progress, "walking", len(CONTENDERS))
    runs = {}
    for name in CONTENDERS:  # nothing of these walks is timed: the first ones compile
        runs[name] = walk(name, friction=settings.friction, duration=settings.duration)
        step()
    sequences = [record_states(name, runs[name], least=least) for name in RECORDED]
    document["walk"] = {name: dict(measure(run).as_dict()) for name, run in runs.items()}
    step = _stage(progress, "timing", count_passes(settings.timing, len(sequences)))
    bench = Bench(robot=robot, friction=settings.friction, settings=settings.timing, rng=rng, on_pass=step)
    document |= time_contenders(bench, sequences)
    pushed = []
    if sections:
        step = _stage(progress, "pushed walks", len(PUSHED))
        how = {"friction": settings.friction, "duration": settings.duration, "impulse": settings.impulse}
        for name, contender in PUSHED.items():
            pushed.append(record_states(name, pushed_walk(contender, **how), least=least))
            step()
    inputs = SectionInputs(robot, settings, pushed, rows, progress)
    document |= {name: section(inputs) for name, section in SECTIONS.items() if name in sections}
    states = " and ".join(f"{len(s)} of the walk of '{s.name}'" for s in sequences)
    states += ", each replayed in the order of time by every contender"
    document["settings"] = asdict(settings) | {"states": states}
    document["versions"] = describe_all_versions()
    names = ("limitations", *(["limitations_of_the_campaign"] if "campaign" in document else []))
    document["limitations"] = [sentence for name in names for sentence in _limitations(name)]
    result: dict[str, Any] = finite(document)
    return result


def _limitations(name: str) -> list[str]:
    """What is printed with every result: the paragraphs of a file of the report."""
    text = (Path(__file__).parent / "report" / f"{name}.txt").read_text(encoding="utf-8")
    return [" ".join(part.split()) for part in text.split("\n\n")]
