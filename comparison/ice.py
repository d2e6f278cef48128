"""Walks over a strip of ice that the controller knows nothing of, with and without an estimate of the friction.

The estimate's settings were chosen on strips of 0.2 and 0.1 on ground of 0.6, at 0.2 and 0.4 m/s, with seeds 100 and
101. What is walked here is at other friction, at another speed, on strips at other places and with other seeds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from comparison.contenders import label
from comparison.measure.walking import Progress, Rows, grouped, tracked
from comparison.tables import Cell, Table
from harpy_pin import Disturbances, Ground, Noise, Scenario, checks, walk
from harpy_pin.log.run import Run

__all__ = ["IceSettings", "ice_tables", "walk_ice"]

STEP = 0.75
"""Duration of a step of the default gait, s."""
LOADED = 1.0
"""Normal force of a foot that is on the ground, N."""
WALKERS: dict[str, dict[str, Any]] = {
    "condensed": {"name": "condensed"},
    "wbc": {"name": "wbc"},
    "paper": {"name": "governed", "governor": "paper"},
    "filter": {"name": "governed", "governor": "filter"},
}
"""Controllers of a scenario by the name of their row."""
SENSORS = {"exact": Disturbances(), "noise, 2 ms": Disturbances(noise=Noise.typical(), delay=2e-3)}
_ON = {False: "off", True: "on"}


@dataclass(frozen=True, kw_only=True)
class IceSettings:
    """What is walked.

    Attributes:
        friction: of the ground, which the controllers assume.
        ice: static friction coefficients of the strip.
        place: where the strip begins, m, before a random shift by up to a step.
        length: of the strip, m.
        plants: engines.
        walks: how many of each kind, with other places and other noise.
        duration: of a walk, s.
        seed: of the first walk.
    """

    friction: float = 0.8
    ice: tuple[float, ...] = (0.15,)
    place: float = 0.6
    length: float = 0.6
    plants: tuple[str, ...] = ("compliant", "mujoco")
    walks: int = 5
    duration: float = 7.5
    seed: int = 0

    def __post_init__(self) -> None:
        checks.whole("walks", self.walks, low=1)
        checks.whole("seed", self.seed)
        checks.number("duration", self.duration, low=STEP)

    @classmethod
    def quick(cls) -> IceSettings:
        """Few walks: to see whether it works."""
        return cls(plants=("compliant",), walks=1, place=0.3, length=0.3, duration=3.0)


def walk_ice(settings: IceSettings, progress: Progress | None = None) -> Rows:
    """All walks, each with and without the estimate.

    Returns:
        A row for each walk: what it was, and its slip in each step.
    """
    seeds = range(settings.seed, settings.seed + settings.walks)
    jobs = list(product(settings.ice, settings.plants, SENSORS, WALKERS, seeds, (False, True)))
    rows = []
    for ice, plant, sensors, walker, seed, estimate in tracked(jobs, progress):
        begin = settings.place + 0.3 * STEP * float(np.random.default_rng([seed, 77]).random())
        strip = (begin, begin + settings.length, ice)
        scenario = Scenario(
            controller=WALKERS[walker] | {"parameters": {"estimate_friction": estimate}},
            plant=plant,
            ground=Ground(mu_s=settings.friction, friction_strips=(strip,)),
            disturbances=replace(SENSORS[sensors], seed=seed),
            duration=settings.duration,
        )
        run = walk(scenario)
        what = {"ice": ice, "plant": plant, "sensors": sensors, "walker": walker, "seed": seed, "estimate": estimate}
        rows.append({**what, **_slips(run, strip)})
    return rows


def _slips(run: Run, strip: tuple[float, float, float]) -> dict[str, Any]:
    """Path of both feet along the ground in every step, mm: steps with a loaded foot on the strip, and later ones."""
    x, load = run["foot_position"][..., 0], run["foot_force"][..., 2]
    on_ice = np.any((x >= strip[0]) & (x < strip[1]) & (load > LOADED), axis=1)
    path = 1e3 * run["slip_path"].sum(axis=1)
    step = np.floor(run["t"] / STEP + 1e-9).astype(int)
    ice: list[float] = []
    after: list[float] = []
    for n in range(int(step[-1]) + 1):
        rows = np.flatnonzero(step == n)
        slip = float(path[rows[-1]] - path[max(rows[0] - 1, 0)])
        if on_ice[rows].any():
            ice.append(slip)
        elif ice:
            after.append(slip)
    estimate = float(run["friction_estimate"].min()) if "friction_estimate" in run else None
    return {"fell": run.ending != "completed", "ice_mm": ice, "after_mm": after, "lowest_estimate": estimate}


def ice_tables(rows: Rows) -> list[Table]:
    """Falls and slip per step, for each plant."""
    tables = []
    for (ice, plant), here in grouped(rows, "ice", "plant").items():
        cells: list[Cell] = []
        for (walker, sensors, estimate), same in grouped(here, "walker", "sensors", "estimate").items():
            name = label(walker) if walker in ("condensed", "wbc") else f"{walker} governor"
            place = f"{name}, {sensors}, estimate {_ON[estimate]}"
            slips = [slip for row in same for slip in row["ice_mm"]]
            after = [slip for row in same for slip in row["after_mm"]]
            cells.append(Cell(place, "fell", f"{sum(row['fell'] for row in same)} of {len(same)}"))
            cells.append(Cell(place, "median on ice", float(np.median(slips)) if slips else None, "mm"))
            cells.append(Cell(place, "worst on ice", max(slips, default=None), "mm"))
            cells.append(Cell(place, "worst after", max(after, default=None), "mm"))
            if estimate:
                cells.append(Cell(place, "lowest estimate", min(row["lowest_estimate"] for row in same)))
        note = "Slip per step: path of both feet along the ground, over all steps of all walks, up to a fall."
        tables.append(Table(f"ice_{plant}_{ice:g}", f"A strip of {ice:g}, {plant} plant", tuple(cells), note))
    return tables
