"""Walks with thrusters that follow their commands by a lag, and with slow motors.

The lag is of first order, of the thrust's magnitude (:mod:`harpy_pin.simulation.thrusters`). Two columns are of
controllers that know it (:mod:`harpy_pin.controllers.thrust_lag`); nobody knows how slow the motors are. All have the
same limits of torque and thrust.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.store import kept_rows
from comparison.measure.walking import Progress, Rows, grouped, tracked, walk_as_far_as_it_goes
from comparison.tables import Cell, Table, number_text
from harpy_pin import Actuators, Disturbances, Ground, Scenario, Thrusters, checks, measure
from harpy_pin.simulation.mujoco import installed_version

__all__ = ["ThrusterSettings", "thruster_tables", "walk_with_lag"]

WALKERS: dict[str, dict[str, Any]] = {
    "none": {"name": "governed", "governor": "none", "limits": True},
    "paper": {"name": "governed", "governor": "paper", "limits": True},
    "filter": {"name": "governed", "governor": "filter", "limits": True},
    "condensed": {"name": "condensed"},
    "QP": {"name": "wbc"},
    "condensed, knows": {"name": "condensed"},
    "QP, knows": {"name": "wbc"},
}
"""Controllers by the name of their column."""
PLANTS = {"ours": {"name": "compliant"}, "MuJoCo": {"name": "mujoco", "preset": "stiff"}}


@dataclass(frozen=True, kw_only=True)
class ThrusterSettings:
    """What is walked.

    Attributes:
        lags: of the thrusts, s.
        bandwidths: of the motors, Hz; None where they follow at once.
        frictions: of the ground.
        plants: names of :data:`PLANTS`.
        starts: how many starts each walk has.
        jitter: standard deviation of the starting velocity along x and y, m/s.
        duration: of a walk, s.
        seed: of the starts.
    """

    lags: tuple[float, ...] = (0.0, 0.01, 0.03, 0.1, 0.3)
    bandwidths: tuple[float | None, ...] = (None, 50.0)
    frictions: tuple[float, ...] = (0.25, 0.15)
    plants: tuple[str, ...] = ("ours", "MuJoCo")
    starts: int = 3
    jitter: float = 0.02
    duration: float = 6.0
    seed: int = 600

    def __post_init__(self) -> None:
        for lag in self.lags:
            checks.number("lag", lag, low=0.0)
        for bandwidth in self.bandwidths:
            if bandwidth is not None:
                checks.number("bandwidth", bandwidth, low=0.0, strict=True)
        for friction in self.frictions:
            checks.number("friction", friction, low=0.0)
        for plant in self.plants:
            checks.one_of("plant", plant, PLANTS)
        checks.whole("starts", self.starts, low=1)
        checks.number("jitter", self.jitter, low=0.0)
        checks.number("duration", self.duration, low=0.1)
        checks.whole("seed", self.seed)

    @classmethod
    def quick(cls) -> ThrusterSettings:
        """Few short walks: to see whether it works."""
        return cls(lags=(0.0, 0.1), bandwidths=(None,), frictions=(0.25,), plants=("ours",), starts=1, duration=1.5)


def walk_with_lag(settings: ThrusterSettings, progress: Progress | None, path: Path | None = None) -> Rows:
    """All walks.

    Args:
        settings: which.
        progress: is told how many are done.
        path: of a file that keeps every finished walk, so that the next call goes on; rows of other code are left
            aside.

    Returns:
        A row for each walk: what it was, and its measures.
    """
    return kept_rows(tracked(list(_jobs(settings)), progress), _walked, path)


def _jobs(s: ThrusterSettings) -> Iterator[dict[str, Any]]:
    """What each walk is."""
    plants = [plant for plant in s.plants if plant == "ours" or installed_version() is not None]
    cases = product(plants, s.frictions, s.bandwidths, s.lags, WALKERS, range(s.starts))
    for plant, friction, bandwidth, lag, walker, start in cases:
        if "knows" in walker and lag == 0.0:
            continue  # there is nothing to know
        what = {"plant": plant, "friction": friction, "bandwidth": bandwidth, "lag": lag, "walker": walker}
        yield {**what, "start": start, "seed": s.seed, "duration": s.duration, "jitter": s.jitter}


def _walked(job: dict[str, Any]) -> dict[str, Any]:
    """Measures of one walk."""
    rng = np.random.default_rng([job["seed"], job["start"]])
    velocity = (*(job["jitter"] * rng.standard_normal(2)).tolist(), 0.0, 0.0, 0.0, 0.0)
    actuators = Actuators(bandwidth=job["bandwidth"], torque_share=1.0, thrusters=Thrusters(lag=job["lag"]))
    known = {"parameters": {"thrust_lag": job["lag"]}} if "knows" in job["walker"] else {}
    scenario = Scenario(
        gait={"name": "hand"},
        controller={**WALKERS[job["walker"]], **known},
        plant=PLANTS[job["plant"]],
        ground=Ground(mu_s=job["friction"]),
        disturbances=Disturbances(actuators=actuators, start_velocity=velocity),
        duration=job["duration"],
    )
    run = walk_as_far_as_it_goes(scenario)
    measures = measure(run)
    thrust = np.linalg.norm(run["thrust"], axis=2).sum(axis=1)
    return {
        "fell": run.ending != "completed",
        "slip_mm_per_step": measures.slip_mm_per_step,
        "thrust_n": float(thrust.mean()),
        "distance_m": measures.distance_m,
    }


def thruster_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """Slip or falls, and thrust: a table for each engine and friction."""
    tables = []
    for (plant, friction), here in grouped(rows, "plant", "friction").items():
        slip, thrust = [], []
        for (bandwidth, lag, walker), same in grouped(here, "bandwidth", "lag", "walker").items():
            motors = "" if bandwidth is None else f", motors of {bandwidth:g} Hz"
            place = f"{1e3 * lag:g} ms{motors}"
            fell = sum(row["fell"] for row in same)
            median = {
                name: number_text(float(np.median([row[name] for row in same])), 2)
                for name in ("slip_mm_per_step", "thrust_n")
            }
            slip.append(Cell(place, walker, f"fell {fell}/{len(same)}" if fell else median["slip_mm_per_step"]))
            thrust.append(Cell(place, walker, "" if fell else median["thrust_n"]))
        where = f"{plant}, friction {friction:g}"
        name = f"{plant}_{friction:g}".lower()
        tables.append(Table(f"thrusters_slip_{name}", f"Slip per step, mm, or falls: {where}", tuple(slip), NOTE))
        tables.append(Table(f"thrusters_thrust_{name}", f"Thrust commanded, N: {where}", tuple(thrust), THRUST))
    return tables


NOTE = "Median over the starts, by the lag of the thrusts; where walks fell, how many. Two columns know the lag."
THRUST = "Sum of both magnitudes, mean of a walk, median over the starts; empty where a walk fell."
