"""The whole comparison, from settings to one document that report and JSON share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from comparison.campaign.plan import QUICK, CampaignSettings
from comparison.campaign.walks import run_campaign
from comparison.contenders import CONTENDERS, OWN
from comparison.measure.timing import Bench, TimingSettings, describe_all_versions, describe_machine
from comparison.measure.walking import record_states, recorded_walk, stage
from comparison.sections.ticks import (
    WALKS,
    tick_checks,
    time_formulations,
    time_own_walks,
    time_simulator,
    time_ticks,
)
from comparison.sections.timing import time_parts
from harpy_pin import checks, measure
from harpy_pin.files import finite
from harpy_pin.model.loading import load_harpy

FRICTION = 0.25
"""The paper's friction coefficient."""

RECORDED = ("governed/paper", OWN)
"""Whose walks give the states for the timing. Walks by ProxQP are the same to 1e-8 m, but not to
the last digit.
"""

PUSHED = ("governed/filter", OWN)
"""Whose walks with pushes give the states for the sections on ticks and formulations."""

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and of how much."""


@dataclass(frozen=True, kw_only=True)
class Settings(checks.Checked):
    """What to compare, and how thoroughly."""

    # friction coefficient of the walks whose states are timed
    friction: float = checks.setting(FRICTION, low=0.0, high=checks.MAX_FRICTION)
    duration: float = checks.setting(6.0, low=0.2)  # of a walk, s
    seed: int = checks.setting(0, checks.whole)  # of the order in which candidates are timed
    # of the pushes during the walks on which every controller's tick is timed, N·s
    impulse: float = checks.setting(3.0, low=0.0)
    timing: TimingSettings = field(default_factory=TimingSettings)  # how to time
    campaign: CampaignSettings = field(default_factory=CampaignSettings)  # its walks

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.ticks(self.duration, 1e-3)
        checks.number("block", self.timing.block, low=self.timing.settle, strict=True)

    @classmethod
    def quick(cls, **changes: Any) -> Settings:
        """Shorter walks, fewer repetitions, fewer sizes: to see whether it works, not to quote."""
        timing, campaign = (
            TimingSettings(repetitions=3, programs=500, samples=30),
            CampaignSettings(**QUICK),
        )
        less: dict[str, Any] = {"duration": 2.0, "timing": timing, "campaign": campaign}
        return cls(**less | changes)


def compare(
    settings: Settings,
    progress: Progress = lambda what, done, total: None,
    *,
    rows: Path | None = None,
) -> dict[str, Any]:
    """Walk, time, check and describe.

    Progress is called between pieces of work, never while the clock runs. The campaign keeps its
    rows in the file ``rows``, if there is one, and goes on from them.

    Returns:
        The document: only dicts, lists, strings, finite numbers and null. Its tables are made in
        :mod:`comparison.report.report`.
    """
    document: dict[str, Any] = {"machine": describe_machine()}
    robot, timing, least = load_harpy(), settings.timing, settings.timing.warm_up + 50
    how: dict[str, Any] = {"friction": settings.friction, "duration": settings.duration}

    def bench(name: str, stream: Sequence[int] | int, pieces: int = timing.repetitions) -> Bench:
        """What a section needs to time: the friction, and random numbers of its own by their
        stream.
        """
        step, rng = stage(progress, name, pieces), np.random.default_rng(stream)
        return Bench(
            robot=robot, friction=settings.friction, settings=timing, rng=rng, on_pass=step
        )

    step, runs = stage(progress, "walking", len(CONTENDERS)), {}
    for name in CONTENDERS:  # nothing of these walks is timed: the first ones compile
        runs[name] = recorded_walk(name, **how)
        step()
    sequences = [record_states(name, runs[name], least=least) for name in RECORDED]
    document["walk"] = {name: dict(measure(run).as_dict()) for name, run in runs.items()}
    passes = len(sequences) * (1 + timing.repetitions)
    document |= time_parts(bench("timing", settings.seed, passes), sequences)
    step, pushed = stage(progress, "pushed walks", len(PUSHED)), []
    for name in PUSHED:
        run = recorded_walk(name, impulse=settings.impulse, **how)
        pushed.append(record_states(name, run, least=least))
        step()
    document["ticks"] = {
        "friction": settings.friction,
        "impulse": settings.impulse,
        "contenders": time_ticks(bench("ticks", [settings.seed, 1]), pushed),
        "own_walks": time_own_walks(
            bench("own walks", [settings.seed, 2]), settings.impulse, settings.duration
        ),
    }
    checks, ticks = document["checks"], tick_checks(document["ticks"]["contenders"])
    document["checks"] = checks | ticks | {"passed": checks["passed"] and ticks["passed"]}
    document["formulations"] = time_formulations(
        bench("formulations", [settings.seed, 3]), pushed[1]
    )
    whole = bench("simulator", [settings.seed, 4], WALKS * len(CONTENDERS))
    document["simulator"] = time_simulator(whole, duration=min(settings.duration, 4.0))
    with TemporaryDirectory() as folder:  # nothing is timed meanwhile
        kept = rows or Path(folder) / "rows.jsonl"
        document["campaign"] = run_campaign(
            settings.campaign, kept, progress=partial(progress, "campaign")
        )
    states = " and ".join(f"{len(s)} of the walk of '{s.name}'" for s in sequences)
    states += ", each replayed in the order of time"
    document["settings"] = asdict(settings) | {"states": states}
    document["versions"] = describe_all_versions()
    text = (Path(__file__).parent / "report" / "limitations.txt").read_text(encoding="utf-8")
    document["limitations"] = [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]
    result: dict[str, Any] = finite(document)
    return result
