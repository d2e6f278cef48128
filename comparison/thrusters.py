"""Walks with thrusters whose magnitude or direction lags, or of which one fails, and with slow motors.

Lags are of first order (:mod:`harpy_pin.simulation.thrusters`). Two columns are of controllers that know them
(:mod:`harpy_pin.controllers.thrust_lag`); nobody knows how slow the motors are, or that a thruster fails. All have the
same limits of torque and thrust.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.store import kept_rows
from comparison.measure.starts import StartsSettings, start_velocity
from comparison.measure.walking import Progress, Rows, walk_as_far_as_it_goes
from harpy_pin import Actuators, Disturbances, Ground, Scenario, Thrusters, checks, measure
from harpy_pin.log.optional import given_thrust
from harpy_pin.simulation.mujoco import installed_version

__all__ = ["ThrusterSettings", "walk_with_lag"]

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
FAILS_AT = 1.5
"""When the left thruster fails, s."""
PLANTS = {"ours": {"name": "compliant"}, "MuJoCo": {"name": "mujoco", "preset": "stiff"}}


@dataclass(frozen=True, kw_only=True)
class ThrusterSettings(StartsSettings):
    """What is walked.

    Attributes:
        lags: of the thrusts' magnitudes, s.
        turning_lags: of their directions, s, with magnitudes that follow at once.
        failing: shares of one thruster that are left from the second step on, without lags.
        bandwidths: of the motors, Hz; None where they follow at once.
        frictions: of the ground.
        plants: names of :data:`PLANTS`.
    """

    lags: tuple[float, ...] = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)
    turning_lags: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2)
    failing: tuple[float, ...] = (0.5, 0.2, 0.0)
    bandwidths: tuple[float | None, ...] = (None, 50.0)
    frictions: tuple[float, ...] = (0.25, 0.15)
    plants: tuple[str, ...] = ("ours", "MuJoCo")
    starts: int = 3
    seed: int = 600

    def __post_init__(self) -> None:
        super().__post_init__()
        for lag in self.lags:
            checks.number("lag", lag, low=0.0)
        for lag in self.turning_lags:
            checks.number("turning_lag", lag, low=0.0)
        for share in self.failing:
            checks.number("failing", share, low=0.0, high=1.0)
        for bandwidth in self.bandwidths:
            if bandwidth is not None:
                checks.number("bandwidth", bandwidth, low=0.0, strict=True)
        for friction in self.frictions:
            checks.number("friction", friction, low=0.0)
        for plant in self.plants:
            checks.one_of("plant", plant, PLANTS)

    @classmethod
    def quick(cls) -> ThrusterSettings:
        """Few short walks: to see whether it works."""
        return cls(
            lags=(0.0, 0.1),
            turning_lags=(0.05,),
            failing=(0.5,),
            bandwidths=(None,),
            frictions=(0.25,),
            plants=("ours",),
            starts=1,
            duration=1.5,
        )


def walk_with_lag(settings: ThrusterSettings, progress: Progress | None, path: Path | None = None) -> Rows:
    """All walks.

    Returns:
        A row for each walk: what it was, and its measures.
    """
    return kept_rows({str(job): job for job in _jobs(settings)}, _walked, progress, path)


def _jobs(s: ThrusterSettings) -> Iterator[dict[str, Any]]:
    """What each walk is."""
    plants = [plant for plant in s.plants if plant == "ours" or installed_version() is not None]
    for plant, friction in product(plants, s.frictions):
        cases: list[tuple[float | None, float, float, float | None]]
        cases = [(bandwidth, lag, 0.0, None) for bandwidth, lag in product(s.bandwidths, s.lags)]
        if friction == s.frictions[0]:
            cases += [(None, 0.0, turning, None) for turning in s.turning_lags]
            cases += [(None, 0.0, 0.0, failing) for failing in s.failing]
        for (bandwidth, lag, turning, failing), walker, start in product(cases, WALKERS, range(s.starts)):
            if "knows" in walker and lag == turning == 0.0:
                continue  # there is nothing to know
            what = {"plant": plant, "friction": friction, "bandwidth": bandwidth, "lag": lag, "turning_lag": turning}
            yield {
                **what,
                "failing": failing,
                "walker": walker,
                **{"start": start, "seed": s.seed, "duration": s.duration, "jitter": s.jitter},
            }


def _walked(job: dict[str, Any]) -> dict[str, Any]:
    """Measures of one walk."""
    velocity = start_velocity(job["jitter"], job["seed"], job["start"])
    failing = None if job["failing"] is None else (0, FAILS_AT, job["failing"])
    thrusters = Thrusters(lag=job["lag"], turning_lag=job["turning_lag"], failing=failing)
    actuators = Actuators(bandwidth=job["bandwidth"], torque_share=1.0, thrusters=thrusters)
    lags = {"thrust_lag": job["lag"], "thrust_turning_lag": job["turning_lag"]}
    known = {"parameters": lags} if "knows" in job["walker"] else {}
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
    thrust = np.linalg.norm(given_thrust(run), axis=2)
    return {
        **job,
        "fell": run.ending != "completed",
        "slip_mm_per_step": measures.slip_mm_per_step,
        "thrust_n": float(thrust.sum(axis=1).mean()),
        "thrust_w": measures.thrust_power_w,
        "upright_s": float(run["t"][-1]),
        "distance_m": measures.distance_m,
    }
