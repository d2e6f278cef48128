"""The search for settings: every variant gets the same number of settings, on the same walks.

What counts is falls first, then slip, then tracking. The walks are of the wide campaign's
distribution, from seeds of their own.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import log1p
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.plan import JOINT_DAMPING, CampaignSettings, Task, code_digest, plan
from comparison.campaign.store import Store
from comparison.campaign.walks import scenario
from comparison.contenders import PAPER, VARIANTS, Point, Range, Variant
from comparison.study import (
    Cell,
    Progress,
    Table,
    Value,
    View,
    in_columns,
    shown,
    silent,
    walk_as_far_as_it_goes,
    where,
)
from harpy_pin import Scenario, checks, measure
from harpy_pin.scenario import Compliant, ControllerPart

TRAINING_SEED, JUDGING_SEED = 61211, 86028
"""Seeds of the walks; the wide campaign has another one, 40427."""

FALL = 1000.0
"""Cost of a fall: more than the slip of all walks of a search together, so that falls come
first.
"""

MAX_SLIP = 1000.0
"""Slip per step beyond which more of it counts no more, mm."""


@dataclass(frozen=True)
class Outcome:
    """What came of one walk."""

    fell: bool  # whether the robot fell, or its controller failed
    slip: float  # per step, mm
    tracking: float  # rms distance of the body from its target, mm

    @property
    def cost(self) -> float:
        """1000 for a fall; otherwise log(1 + slip / 1 mm) + tracking / 1 m.

        The logarithm lets a walk count by the factor of its slip, so that no single bad walk
        decides, and a decimetre of tracking error counts as a tenth more slip.
        """
        return (
            FALL
            if self.fell
            else log1p(min(self.slip, MAX_SLIP)) + min(self.tracking, MAX_SLIP) / 1000.0
        )


def score_of(outcomes: Iterable[Outcome]) -> dict[str, Any]:
    """What came of several walks: ``walks``, ``falls``, ``cost``, the sum, ``slip_median`` and
    ``tracking_median``, mm.

    A fall counts as more slip than any: the median is None if half of them or more fell. Tracking
    is that of those that did not fall, None if all did.
    """
    found = list(outcomes)
    slip = float(np.median([np.inf if one.fell else one.slip for one in found]))
    tracking = [one.tracking for one in found if not one.fell]
    return {
        "walks": len(found),
        "falls": sum(one.fell for one in found),
        "slip_median": slip if np.isfinite(slip) else None,
        "tracking_median": float(np.median(tracking)) if tracking else None,
        "cost": float(sum(one.cost for one in found)),
    }


def walk_scenario(scenario: Scenario) -> Outcome:
    """Walk, and measure."""
    run = walk_as_far_as_it_goes(scenario)
    measures = measure(run)
    return Outcome(run.ending != "completed", measures.slip_mm_per_step, measures.tracking_rms_mm)


def tasks_of(
    seed: int, count: int, duration: float, joint_damping: float = JOINT_DAMPING
) -> list[Task]:
    """Walks of a search, in the library's own engine, or those that judge what it found, in both
    engines, by seed.
    """
    alone = {"contenders": ("governed/none",), "joint_dampings": (joint_damping,)}
    tasks = plan(CampaignSettings.of("wide", walks=count, duration=duration, seed=seed, **alone))
    return (
        [replace(task, plant=Compliant.name) for task in tasks] if seed == TRAINING_SEED else tasks
    )


def scenario_with(task: Task, controller: ControllerPart) -> Scenario:
    """The scenario of a task, walked by another controller with the task's error of friction."""
    drawn = scenario(task)
    return replace(drawn, controller=replace(controller, mu=drawn.mu))


RANDOM_SHARE = 0.3
"""Share of the budget that is drawn from the whole space."""
FIRST_STEP, LAST_STEP = 0.3, 0.05
"""Standard deviation of a change at the beginning and at the end, as a share of the range's
logarithm.
"""
CHANGED = 0.3
"""Probability with which a change of the best touches a setting."""
FIRST_SHARE = 0.35
"""Share of the walks after which settings that are worse than the best ones there are given up."""

_NOTE = (
    "Falls, median slip per step (a fall counts as more than any) and median tracking error of the "
    "walks that did not "
    "fall, with published and with found settings."
)


COUNT: dict[str, Any] = {"low": 1, "high": 1_000_000}
"""How many walks or settings there may be."""


@dataclass(frozen=True, kw_only=True)
class TuneSettings(checks.Checked):
    """How much is searched."""

    # settings that each variant gets, the published ones among them
    budget: int = checks.setting(150, checks.whole, **COUNT)
    train: int = checks.setting(30, checks.whole, **COUNT)  # walks of each setting
    # walks of the published and of the best settings, apart from those
    judge: int = checks.setting(60, checks.whole, **COUNT)
    duration: float = checks.setting(5.0, low=1.5)  # of a walk, s
    # of every joint, N·m·s/rad, known to the controllers
    joint_damping: float = checks.setting(JOINT_DAMPING, low=0.0, high=1e6, called="joint damping")
    seed: int = checks.setting(0, checks.whole)  # of the proposals
    # who is tuned, see :data:`comparison.contenders.VARIANTS`, in their order there
    variants: tuple[str, ...] = tuple(VARIANTS)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.ticks(self.duration, 1e-3)
        for name in self.variants:
            checks.one_of("variant", name, VARIANTS)
        object.__setattr__(
            self, "variants", tuple(name for name in VARIANTS if name in self.variants)
        )


def tune(settings: TuneSettings, path: Path, progress: Progress = silent) -> dict[str, Any]:
    """Search the settings of every variant, and judge the best ones.

    Args:
        settings: how much.
        path: of the journal (JSON lines); settings that it holds are not walked again.
        progress: called with settings done and settings in all.

    Returns:
        The search's settings and, by variant, the best settings and the scores of these and of the
        published ones.
    """
    found: dict[str, Any] = {}
    each = settings.budget + 2
    with Store(path) as store:
        for k, name in enumerate(settings.variants):

            def done(index: int, first: int = k * each) -> None:
                progress(first + index, each * len(settings.variants))

            start = found.get(f"none/{name.rpartition('/')[2]}", {}).get("factors")
            found[name] = _search(name, settings, store, start, done)
    how = {
        name: getattr(settings, name)
        for name in ("budget", "train", "judge", "duration", "joint_damping")
    }
    seeds = {"proposals": settings.seed, "training": TRAINING_SEED, "judging": JUDGING_SEED}
    document: dict[str, Any] = {**how, "seeds": seeds, "variants": found}
    papers = [name for name in found if name in PAPER]
    if papers:
        best = min(papers, key=lambda name: float(found[name]["training"]["cost"]))
        published = found[best]["factors"] == VARIANTS[best].published
        document["best_paper"] = best if published else f"{best}/tuned"
    return document


def _search(
    name: str,
    settings: TuneSettings,
    store: Store,
    start: Point | None,
    done: Callable[[int], None],
) -> dict[str, Any]:
    """The best settings of a variant, and what they and the published ones came to.

    ``start`` are gains that were found without a governor; ``done`` is called with how many
    settings are done.
    """
    variant = VARIANTS[name]
    how = settings.duration, settings.joint_damping
    training, judging = (
        tasks_of(TRAINING_SEED, settings.train, *how),
        tasks_of(JUDGING_SEED, settings.judge, *how),
    )
    best: Point = variant.published
    row = published = _row(name, best, training, store)
    for index in range(1, settings.budget):
        done(index)
        rng = np.random.default_rng([settings.seed, *name.encode(), index])
        point = propose(variant, index, settings.budget, best, rng, start)
        tried = _row(name, point, training, store, row["costs"])
        if not _hopeless(tried["costs"], row["costs"]) and sum(tried["costs"]) < sum(row["costs"]):
            best, row = point, tried
    done(settings.budget)
    scores = {"published, training": published["score"], "training": row["score"]}
    scores["published, judging"] = _row(name, variant.published, judging, store)["score"]
    done(settings.budget + 1)
    scores["judging"] = _row(name, best, judging, store)["score"]
    done(settings.budget + 2)
    return {"factors": dict(best), "controller": variant.settings(best), **scores}


def propose(
    variant: Variant,
    index: int,
    budget: int,
    best: Point,
    rng: np.random.Generator,
    start: Point | None = None,
) -> Point:
    """Settings number ``index`` of a search: the published ones, random ones, then changes of the
    best so far.

    Changes become smaller. The second settings may be a start that is known to be good, of any of
    the variant's paths; the others are at their published values.
    """
    if index == 0:
        return variant.published
    if index == 1 and start is not None:
        return {**variant.published, **start}
    if index <= RANDOM_SHARE * budget:
        return {path: _drawn(span, rng) for path, span in variant.space.items()}
    progress = (index - RANDOM_SHARE * budget) / max((1.0 - RANDOM_SHARE) * budget, 1.0)
    step = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** progress
    paths = list(variant.space)
    touched = [path for path in paths if rng.random() < CHANGED] or [
        paths[int(rng.integers(len(paths)))]
    ]
    return {
        **best,
        **{path: _drawn(variant.space[path], rng, best[path], step) for path in touched},
    }


def _drawn(span: Any, rng: np.random.Generator, value: Any = None, step: float = 0.0) -> Any:
    """A value of the whole span, or a change of one by a step."""
    if not isinstance(span, Range):
        return span.values[int(rng.integers(len(span.values)))]
    if value is None:
        return float(np.exp(rng.uniform(np.log(span.low), np.log(span.high))))
    moved = value * np.exp(step * np.log(span.high / span.low) * rng.standard_normal())
    return float(np.clip(moved, span.low, span.high))


def _row(
    name: str, point: Point, tasks: Sequence[Task], store: Store, best: Sequence[float] = ()
) -> dict[str, Any]:
    """What settings of a variant come to on walks, from the journal where it has them.

    ``best`` are the costs of the best settings so far, walk by walk: walks end where these settings
    are hopeless.
    """
    variant = VARIANTS[name]
    # Settings, walks, what ends them early, and the code that does them.
    what = {
        "code": [code_digest(), hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:24]],
        "controller": variant.settings(point),
        "tasks": [asdict(t) for t in tasks],
        "best": list(best),
    }
    key = hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:24]
    if key not in store.rows:
        outcomes: list[Outcome] = []
        controller = variant.controller(point)
        for task in tasks:
            outcomes.append(walk_scenario(scenario_with(task, controller)))
            if _hopeless([one.cost for one in outcomes], best):
                break
        found = {"variant": name, "point": dict(point), "costs": [one.cost for one in outcomes]}
        store.append(key, {**found, "score": score_of(outcomes)})
    return store.rows[key]


def _hopeless(costs: Sequence[float], best: Sequence[float]) -> bool:
    """Whether settings are given up: they cost more than the best ones on the first walks, or in
    all.

    Args:
        costs: of the walks done.
        best: costs of the best settings on all walks; empty where there are none yet.
    """
    first = int(np.ceil(FIRST_SHARE * len(best)))
    if len(costs) >= first and sum(costs[:first]) > sum(best[:first]):
        return True
    return bool(best) and sum(costs) > sum(best)


_SETTINGS = ("published", "found")
_SHOWN: dict[str, tuple[Value, str]] = {
    "falls": (shown("falls"), ""),
    "slip": (lambda rows: "fell" if (x := rows[0]["slip_median"]) is None else x, "mm"),
    "tracking": (shown("tracking_median"), "mm"),
}
_SCORES = View(
    "tuning_{which}",
    "Tuning: {walks} {which} walks each; best of {budget} settings",
    row="{label}",
    columns={
        f"{what}, {settings}": (where(value, settings=settings), unit)
        for settings in _SETTINGS
        for what, (value, unit) in _SHOWN.items()
    },
    note=_NOTE,
)


def tuning_tables(document: Mapping[str, Any]) -> list[Table]:
    """The scores on training walks and on judging walks, the least slip there, and the settings
    that were found.
    """
    found = document["variants"]
    rows = [
        {"which": which, "label": VARIANTS[name].label, "settings": settings, **entry[key]}
        for which in ("training", "judging")
        for name, entry in found.items()
        for settings, key in zip(_SETTINGS, (f"published, {which}", which), strict=True)
    ]
    return [
        *_SCORES.of([{"budget": document["budget"], **row} for row in rows]),
        _least_table(found),
        *(_settings_table(name, entry) for name, entry in found.items()),
    ]


def _least_table(found: Mapping[str, Any]) -> Table:
    """Of each governor the variant that slips least on the judging walks, with the settings that
    were found.
    """
    least: dict[str, Mapping[str, Any]] = {}
    for name, entry in found.items():
        governor, _, variant = VARIANTS[name].label.partition(", ")
        slip = entry["judging"]["slip_median"]
        if slip is not None and slip < least.get(governor, {"slip": np.inf})["slip"]:
            least[governor] = {"slip": slip, "falls": entry["judging"]["falls"], "variant": variant}
    columns = {"slip": ("slip", "mm"), "falls": ("falls", ""), "variant": ("variant", "")}
    cells = [
        cell for governor, entry in least.items() for cell in in_columns(governor, entry, columns)
    ]
    return Table(
        "tuning_least",
        "Tuning: the variants that slip least on the judging walks",
        tuple(cells),
        _NOTE,
    )


def _settings_table(name: str, entry: Mapping[str, Any]) -> Table:
    cells = []
    for path, factor in entry["factors"].items():
        value = entry["controller"]
        for part in path.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
        text = ", ".join(f"{number:.3g}" for number in value) if isinstance(value, list) else value
        row = path.partition(".")[2]
        cells.append(Cell(row, "found", "as published" if text is None else text))
        cells.append(Cell(row, "multiple", factor if isinstance(factor, float) else None))
    return Table(f"tuning_{name}", f"Settings found: {VARIANTS[name].label}", tuple(cells))
