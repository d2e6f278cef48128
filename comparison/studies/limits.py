"""Walks at the limits of the motors: strong damping, weak and slow motors, and joint friction that no model has.

Two things are known to the controllers: the joint damping and the motors' peak torques. Two are not: how slow the
motors are, and friction in the joints. Every controller has the same torque limits, and the plant clips what is beyond.
What gives way at these limits (:mod:`harpy_pin.wbc.giving_way`) was chosen on walks from exact starts; the walks here
begin with other velocities.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from comparison.campaign.settings import JOINT_DAMPING
from comparison.campaign.walks import damped_harpy
from comparison.measure.walking import Rows, grouped, walk_as_far_as_it_goes
from comparison.study import STARTS, Job, Study, Value, crossed, fell, most, start_velocity, tabulated
from comparison.tables import Table, number_text
from harpy_pin import Actuators, Disturbances, Ground, Scenario, measure

WALKERS: dict[str, dict[str, Any]] = {
    "none": {"name": "governed", "governor": "none", "limits": True},
    "paper": {"name": "governed", "governor": "paper", "limits": True},
    "filter": {"name": "governed", "governor": "filter", "limits": True},
    "rigid": {"name": "condensed", "parameters": {"limits": {"give_way": 1.0}}},
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
KNOWN = {"damping": "damping {:g} N·m·s/rad", "torque": "torque limits × {:g}", "bandwidth": "motors of {:g} Hz"}
UNKNOWN = {"viscous": "unknown viscous {:g} N·m·s/rad", "coulomb": "unknown Coulomb {:g} N·m"}
ACTUATORS = {"bandwidth": "bandwidth", "viscous": "viscous_friction", "coulomb": "coulomb_friction"}


def _jobs(s: Any) -> Iterator[Job]:
    cases = [(kind, value) for kind in (*KNOWN, *UNKNOWN) for value in getattr(s, kind)]
    for start, gait, friction, (kind, value), walker in product(range(s.starts), s.gaits, s.frictions, cases, WALKERS):
        if gait == "commanded" and WALKERS[walker]["name"] == "governed":
            continue  # it cannot turn
        what = {"gait": gait, "friction": friction, "kind": kind, "value": value, "walker": walker}
        yield {**what, "start": start, "seed": s.seed, "duration": s.duration, "jitter": s.jitter}


def scenario_of(job: Job) -> Scenario:
    """What is walked; the controller knows its torque limits."""
    kind, value, controller = job["kind"], job["value"], dict(WALKERS[job["walker"]])
    share = value if kind == "torque" else 1.0
    if share < 1.0 and controller["name"] != "governed":
        parameters = controller.get("parameters", {})
        controller["parameters"] = {**parameters, "limits": {**parameters.get("limits", {}), "torque_scale": share}}
    unknown = {ACTUATORS[kind]: value} if kind in ACTUATORS else {}
    actuators = Actuators(torque_share=share, **unknown)
    return Scenario(
        gait=GAITS[job["gait"]],
        controller=controller,
        ground=Ground(mu_s=job["friction"]),
        disturbances=Disturbances(actuators=actuators, start_velocity=start_velocity(job)),
        duration=job["duration"],
        urdf=damped_harpy(value * JOINT_DAMPING) if kind == "damping" else None,
    )


def _measured(job: Job) -> dict[str, Any]:
    run = walk_as_far_as_it_goes(scenario_of(job))
    measures = measure(run)
    return {
        "fell": run.ending != "completed",
        "slip_mm_per_step": measures.slip_mm_per_step,
        "tracking_rms_mm": measures.tracking_rms_mm,
        "distance_m": measures.distance_m,
    }


def _place(row: dict[str, Any]) -> str:
    kind, value = row["kind"], row["value"]
    return (KNOWN | UNKNOWN)[kind].format(value * JOINT_DAMPING if kind == "damping" else value)


def slip_or_falls(rows: Rows) -> str:
    """Falls, or the median slip."""
    count = sum(row["fell"] for row in rows)
    if count:
        return f"fell {count}/{len(rows)}"
    return number_text(float(np.median([row["slip_mm_per_step"] for row in rows])), 2)


def _tables(rows: Rows) -> list[Table]:
    """Falls and slip over all walks; then a table for each gait and friction."""

    def of(kinds: dict[str, str], what: Value, *, fallen: bool = True) -> Value:
        return lambda rows: what([row for row in rows if row["kind"] in kinds and (fallen or not row["fell"])])

    columns: dict[str, Any] = {}
    for name, kinds in (("limits", KNOWN), ("joint friction", UNKNOWN)):
        columns[f"{name}: fell"] = of(kinds, fell)
        columns[f"{name}: worst slip"] = of(kinds, most("slip_mm_per_step"), fallen=False), "mm"
    summary = tabulated(
        "limits", "Falls, and the worst slip of the walks that did not fall", rows, lambda row: row["walker"], columns,
        "Limits: damping, torque limits and slow motors. Joint friction: viscous and Coulomb, in no model.",
    )  # fmt: skip
    note = (
        "Median slip over the starts; where walks fell, how many. rigid: the condensed WBC in which nothing gives way; "
        "est.: the one in which tasks do, with joint friction estimated. All have the same torque limits."
    )
    return [summary] + [
        crossed(
            f"limits_{gait}_{friction:g}", f"Slip per step, mm, or falls: {gait} gait, friction {friction:g}", here,
            _place, lambda row: row["walker"], slip_or_falls, note,
        )
        for (gait, friction), here in grouped(rows, "gait", "friction").items()
    ]  # fmt: skip


STUDY = Study(
    name="limits",
    help="""Walk with damped joints, weak motors and joint friction.

    Damping is strong, motors are also slow, and no model has the joint friction. The ungoverned and the paper's
    controller, the contact-force filter, the condensed controller with and without tasks that give way, and the
    whole-body QP. This takes many minutes.
    """,
    example="--out limits.jsonl",
    defaults=STARTS
    | {
        "damping": (0.1, 1.0, 10.0, 30.0, 50.0),  # factors on the joint damping, known to the controllers
        "torque": (0.7, 0.5, 0.3),  # shares of the peak torque, known to the controllers
        "bandwidth": (200.0, 50.0, 20.0),  # of the motors, Hz
        "viscous": (0.5, 1.0, 3.0, 5.0),  # friction in the joints, N·m·s/rad
        "coulomb": (0.1, 0.3, 1.0),  # friction in the joints, N·m
        "frictions": (0.8, 0.25, 0.15),  # of the ground
        "gaits": tuple(GAITS),
        "seed": 500,
    },
    quick={
        **{"damping": (50.0,), "torque": (0.3,), "bandwidth": (50.0,), "viscous": (1.0,), "coulomb": (0.3,)},
        **{"frictions": (0.25,), "gaits": ("straight",), "duration": 1.5},
    },
    jobs=_jobs,
    measure=_measured,
    tables=_tables,
)
