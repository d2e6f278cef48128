"""The search: every variant gets the same number of settings, on the same walks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.plan import Task, code_digest
from comparison.campaign.settings import JOINT_DAMPING
from comparison.campaign.store import Store
from comparison.measure.walking import Progress
from comparison.tuning.objective import Outcome, Score, walk_scenario
from comparison.tuning.search import propose
from comparison.tuning.training import JUDGING_SEED, TRAINING_SEED, judging_tasks, scenario_with, training_tasks
from comparison.tuning.variants import PAPER, VARIANTS, Point, Variant
from harpy_pin import checks

__all__ = ["TuneSettings", "tune"]

FIRST_SHARE = 0.35
"""Share of the walks after which settings that are worse than the best ones there are given up."""


@dataclass(frozen=True, kw_only=True)
class TuneSettings:
    """How much is searched.

    Attributes:
        budget: settings that each variant gets, the published ones among them.
        train: walks of each setting.
        judge: walks of the published and of the best settings, apart from those.
        duration: of a walk, s.
        joint_damping: of every joint, N·m·s/rad, known to the controllers.
        seed: of the proposals.
        variants: who is tuned, see :data:`comparison.tuning.variants.VARIANTS`, in their order there.
    """

    budget: int = 150
    train: int = 30
    judge: int = 60
    duration: float = 5.0
    joint_damping: float = JOINT_DAMPING
    seed: int = 0
    variants: tuple[str, ...] = tuple(VARIANTS)

    def __post_init__(self) -> None:
        checks.numbers(self, "budget", "train", "judge", low=1.0, high=1e6)
        checks.ticks(checks.number("duration", self.duration, low=1.5), 1e-3)
        checks.number("joint damping", self.joint_damping, low=0.0, high=1e6)
        checks.number("seed", self.seed, low=0.0)
        for name in self.variants:
            checks.one_of("variant", name, VARIANTS)
        object.__setattr__(self, "variants", tuple(name for name in VARIANTS if name in self.variants))


def tune(settings: TuneSettings, path: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Search the settings of every variant, and judge the best ones.

    Args:
        settings: how much.
        path: of the journal (JSON lines); settings that it holds are not walked again.
        progress: called with settings done and settings in all.

    Returns:
        The search's settings and, by variant, the best settings and the scores of these and of the published ones.

    Raises:
        HarpyError: a setting is out of its domain, or the file cannot be used.
    """
    found: dict[str, Any] = {}
    each = settings.budget + 2
    with Store(path) as store:
        for k, name in enumerate(settings.variants):

            def done(index: int, first: int = k * each) -> None:
                if progress is not None:
                    progress(first + index, each * len(settings.variants))

            start = found.get(f"none/{name.rpartition('/')[2]}", {}).get("factors")
            found[name] = _Search(name, settings, store, start).run(done)
    seeds = {"proposals": settings.seed, "training": TRAINING_SEED, "judging": JUDGING_SEED}
    how = {name: getattr(settings, name) for name in ("budget", "train", "judge", "duration", "joint_damping")}
    document: dict[str, Any] = {**how, "seeds": seeds, "variants": found}
    papers = [name for name in found if name in PAPER]
    if papers:
        document["best_paper"] = _better(min(papers, key=lambda name: float(found[name]["training"]["cost"])), found)
    return document


def _better(name: str, found: Mapping[str, Any]) -> str:
    """The variant with the settings that were found, or its own name where the published ones are the best."""
    return name if found[name]["factors"] == VARIANTS[name].published else f"{name}/tuned"


class _Search:
    """The search of one variant.

    Args:
        name: of the variant.
        settings: how much is searched.
        store: of finished settings.
        start: gains that were found without a governor.
    """

    def __init__(self, name: str, settings: TuneSettings, store: Store, start: Point | None = None) -> None:
        self.name, self.settings, self.store, self.start = name, settings, store, start
        self.variant: Variant = VARIANTS[name]
        self.training = training_tasks(settings.train, settings.duration, settings.joint_damping)
        self.judging = judging_tasks(settings.judge, settings.duration, settings.joint_damping)

    def run(self, done: Any) -> dict[str, Any]:
        """The best settings, and what they and the published ones came to.

        Args:
            done: called with how many settings are done.
        """
        best: Point = self.variant.published
        row = published = self._row(best, self.training)
        for index in range(1, self.settings.budget):
            done(index)
            rng = np.random.default_rng([self.settings.seed, *self.name.encode(), index])
            point = propose(self.variant, index, self.settings.budget, best, rng, self.start)
            tried = self._row(point, self.training, row["costs"])
            if not _hopeless(tried["costs"], row["costs"]) and sum(tried["costs"]) < sum(row["costs"]):
                best, row = point, tried
        done(self.settings.budget)
        scores = {"published, training": published["score"], "training": row["score"]}
        scores["published, judging"] = self._row(self.variant.published, self.judging)["score"]
        done(self.settings.budget + 1)
        scores["judging"] = self._row(best, self.judging)["score"]
        done(self.settings.budget + 2)
        return {"factors": dict(best), "controller": self.variant.settings(best), **scores}

    def _row(self, point: Point, tasks: Sequence[Task], best: Sequence[float] = ()) -> dict[str, Any]:
        """What settings come to on walks, from the journal where it has them.

        Args:
            point: the settings.
            tasks: the walks.
            best: costs of the best settings so far, walk by walk. Walks end where these settings are hopeless.
        """
        key = self._key(point, tasks, best)
        if key not in self.store.rows:
            outcomes: list[Outcome] = []
            controller = self.variant.controller(point)
            for task in tasks:
                outcomes.append(walk_scenario(scenario_with(task, controller)))
                if _hopeless([one.cost for one in outcomes], best):
                    break
            found = {"variant": self.name, "point": dict(point), "costs": [one.cost for one in outcomes]}
            self.store.append(key, {**found, "score": asdict(Score.of(outcomes))})
        return self.store.rows[key]

    def _key(self, point: Point, tasks: Sequence[Task], best: Sequence[float]) -> str:
        """Identifies settings, walks, what ends them early, and the code that does them."""
        what = {
            "code": [code_digest(), _own_digest()],
            "controller": self.variant.settings(point),
            "tasks": [asdict(t) for t in tasks],
            "best": list(best),
        }
        return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:24]


def _hopeless(costs: Sequence[float], best: Sequence[float]) -> bool:
    """Whether settings are given up: they cost more than the best ones on the first walks, or in all.

    Args:
        costs: of the walks done.
        best: costs of the best settings on all walks; empty where there are none yet.
    """
    first = int(np.ceil(FIRST_SHARE * len(best)))
    if len(costs) >= first and sum(costs[:first]) > sum(best[:first]):
        return True
    return bool(best) and sum(costs) > sum(best)


def _own_digest() -> str:
    """Hash of what walks and scores."""
    folder = Path(__file__).parent
    parts = (folder / name for name in ("objective.py", "training.py"))
    return hashlib.sha256(b"\0".join(part.read_bytes() for part in parts)).hexdigest()[:24]
