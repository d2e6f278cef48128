"""Walks at the limits of the motors: strong damping, weak and slow motors, and joint friction that no model has.

Two things are known to the controllers: the joint damping and the motors' peak torques. Two are not: how slow the
motors are, and friction in the joints. Every controller has the same torque limits, and the plant clips what is beyond.
What gives way at these limits (:mod:`harpy_pin.wbc.giving_way`) was chosen on walks from exact starts; the walks here
begin with other velocities.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.settings import JOINT_DAMPING
from comparison.campaign.store import kept_rows
from comparison.campaign.walks import damped_harpy
from comparison.measure.starts import StartsSettings, start_velocity
from comparison.measure.walking import Progress, Rows, grouped, walk_as_far_as_it_goes
from comparison.tables import Cell, Table, number_text
from harpy_pin import Actuators, Disturbances, Ground, Scenario, checks, measure

__all__ = ["LimitsSettings", "limit_tables", "walk_limits"]

RIGID = {"limits": {"give_way": 1.0}}
WALKERS: dict[str, dict[str, Any]] = {
    "none": {"name": "governed", "governor": "none", "limits": True},
    "paper": {"name": "governed", "governor": "paper", "limits": True},
    "filter": {"name": "governed", "governor": "filter", "limits": True},
    "rigid": {"name": "condensed", "parameters": RIGID},
    "condensed": {"name": "condensed"},
    "QP": {"name": "wbc"},
    "est.": {"name": "condensed", "parameters": {"estimate_joint_friction": True}},
}
"""Controllers by the name of their column: ``rigid`` is the condensed WBC in which nothing gives way, ``est.`` the one
with joint friction estimated."""
GAITS: dict[str, dict[str, Any]] = {
    "straight": {"name": "hand"},
    "commanded": {"name": "commanded", "velocity": (0.2, 0.0, 0.2)},
}


@dataclass(frozen=True, kw_only=True)
class LimitsSettings(StartsSettings):
    """What is walked.

    Attributes:
        damping: factors on the joint damping, known to the controllers.
        torque: shares of the peak torque, known to the controllers.
        bandwidth: of the motors, Hz.
        viscous: friction in the joints, N·m·s/rad.
        coulomb: friction in the joints, N·m.
        frictions: of the ground.
        gaits: names of :data:`GAITS`.
    """

    damping: tuple[float, ...] = (0.1, 1.0, 10.0, 30.0, 50.0)
    torque: tuple[float, ...] = (0.7, 0.5, 0.3)
    bandwidth: tuple[float, ...] = (200.0, 50.0, 20.0)
    viscous: tuple[float, ...] = (0.5, 1.0, 3.0, 5.0)
    coulomb: tuple[float, ...] = (0.1, 0.3, 1.0)
    frictions: tuple[float, ...] = (0.8, 0.25, 0.15)
    gaits: tuple[str, ...] = ("straight", "commanded")
    seed: int = 500

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("damping", "torque", "bandwidth", "viscous", "coulomb", "frictions"):
            for value in getattr(self, name):
                checks.number(name, value, low=0.0, strict=name != "frictions")
        for gait in self.gaits:
            checks.one_of("gait", gait, GAITS)

    @classmethod
    def quick(cls) -> LimitsSettings:
        """Few short walks: to see whether it works."""
        return cls(
            damping=(50.0,),
            torque=(0.3,),
            bandwidth=(50.0,),
            viscous=(1.0,),
            coulomb=(0.3,),
            frictions=(0.25,),
            gaits=("straight",),
            duration=1.5,
        )


def walk_limits(settings: LimitsSettings, progress: Progress | None, path: Path | None = None) -> Rows:
    """All walks.

    Returns:
        A row for each walk: what it was, and its measures.
    """
    return kept_rows({str(job): job for job in _jobs(settings)}, _walked, progress, path)


def _jobs(s: LimitsSettings) -> Iterator[dict[str, Any]]:
    """What each walk is, but for the settings that all share."""
    cases = [(kind, value) for kind in (*KNOWN, *UNKNOWN) for value in getattr(s, kind)]
    for start, gait, friction, (kind, value), walker in product(range(s.starts), s.gaits, s.frictions, cases, WALKERS):
        if gait == "commanded" and WALKERS[walker]["name"] == "governed":
            continue  # it cannot turn
        what = {"gait": gait, "friction": friction, "kind": kind, "value": value, "walker": walker}
        yield {**what, "start": start, "seed": s.seed, "duration": s.duration, "jitter": s.jitter}


def _walked(job: dict[str, Any]) -> dict[str, Any]:
    """Measures of one walk."""
    kind, value = job["kind"], job["value"]
    share = value if kind == "torque" else 1.0
    names = {"bandwidth": "bandwidth", "viscous": "viscous_friction", "coulomb": "coulomb_friction"}
    unknown = {names[kind]: value} if kind in names else {}
    velocity = start_velocity(job["jitter"], job["seed"], job["start"])
    scenario = Scenario(
        gait=GAITS[job["gait"]],
        controller=_controller(job["walker"], share),
        ground=Ground(mu_s=job["friction"]),
        disturbances=Disturbances(actuators=Actuators(torque_share=share, **unknown), start_velocity=velocity),
        duration=job["duration"],
        urdf=damped_harpy(value * JOINT_DAMPING) if kind == "damping" else None,
    )
    run = walk_as_far_as_it_goes(scenario)
    measures = measure(run)
    return {
        **job,
        "fell": run.ending != "completed",
        "slip_mm_per_step": measures.slip_mm_per_step,
        "tracking_rms_mm": measures.tracking_rms_mm,
        "distance_m": measures.distance_m,
    }


def _controller(walker: str, share: float) -> dict[str, Any]:
    """The controller's part, which knows its torque limits."""
    part = dict(WALKERS[walker])
    if share < 1.0 and part["name"] != "governed":
        parameters = part.get("parameters", {})
        part["parameters"] = {**parameters, "limits": {**parameters.get("limits", {}), "torque_scale": share}}
    return part


KNOWN = ("damping", "torque", "bandwidth")
UNKNOWN = ("viscous", "coulomb")

TITLES = {
    "damping": "damping {:g} N·m·s/rad",
    "torque": "torque limits × {:g}",
    "bandwidth": "motors of {:g} Hz",
    "viscous": "unknown viscous {:g} N·m·s/rad",
    "coulomb": "unknown Coulomb {:g} N·m",
}


def limit_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """Falls and slip over all walks; then a table for each gait and friction."""
    tables = [_summary(rows)]
    for (gait, friction), here in grouped(rows, "gait", "friction").items():
        cells = []
        for (kind, value, walker), same in grouped(here, "kind", "value", "walker").items():
            place = TITLES[kind].format(value * JOINT_DAMPING if kind == "damping" else value)
            cells.append(Cell(place, walker, _outcome(same)))
        title = f"Slip per step, mm, or falls: {gait} gait, friction {friction:g}"
        tables.append(Table(f"limits_{gait}_{friction:g}", title, tuple(cells), NOTE))
    return tables


def _summary(rows: Sequence[dict[str, Any]]) -> Table:
    """Of everybody the falls and the largest slip, under limits and under joint friction that nobody told of."""
    cells = []
    for (walker,), same in grouped(rows, "walker").items():
        for what, kinds in (("limits", KNOWN), ("joint friction", UNKNOWN)):
            walks = [row for row in same if row["kind"] in kinds]
            slips = [row["slip_mm_per_step"] for row in walks if not row["fell"]]
            cells.append(Cell(walker, f"{what}: fell", f"{sum(row['fell'] for row in walks)} of {len(walks)}"))
            cells.append(Cell(walker, f"{what}: worst slip", max(slips, default=None), "mm"))
    note = "Limits: damping, torque limits and slow motors. Joint friction: viscous and Coulomb, in no model."
    return Table("limits", "Falls, and the worst slip of the walks that did not fall", tuple(cells), note)


NOTE = (
    "Median slip over the starts; where walks fell, how many. rigid: the condensed WBC in which nothing gives way; "
    "est.: the one in which tasks do, with joint friction estimated. All have the same torque limits."
)


def _outcome(rows: Sequence[dict[str, Any]]) -> str:
    """Falls, or the median slip."""
    fell = sum(row["fell"] for row in rows)
    if fell:
        return f"fell {fell}/{len(rows)}"
    return number_text(float(np.median([row["slip_mm_per_step"] for row in rows])), 2)
