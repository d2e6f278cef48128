"""Walk with damped joints, weak motors and joint friction.

The ungoverned and the paper's controller, the contact-force filter, the condensed controller with
and without tasks that give way, and the whole-body QP by own search. They know the joint damping
and the motors' peak torques, but neither how slow the motors are nor the friction in the joints,
which is in no model. All have the same torque limits, and the plant clips what is beyond. What
gives way was chosen on walks from exact starts; the walks here begin with other velocities. This
takes many minutes.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from comparison.campaign.plan import JOINT_DAMPING
from comparison.campaign.walks import damped_harpy
from comparison.contenders import LIMITED, OWN_PART
from comparison.study import (
    STARTS,
    Job,
    Rows,
    Study,
    Value,
    View,
    fell,
    grid,
    most,
    number_text,
    start_velocity,
    starts,
    walking,
    where,
)
from harpy_pin import Actuators, Disturbances, Ground, Scenario

WALKERS: dict[str, Mapping[str, Any]] = {
    **LIMITED,
    "rigid": {"name": "condensed", "parameters": {"limits": {"give_way": 1.0}}},
    "condensed": {"name": "condensed"},
    "QP": OWN_PART,
    "est.": {"name": "condensed", "parameters": {"estimate_joint_friction": True}},
    "law": {"name": "condensed", "parameters": {"joint_stiffness": 1.0, "joint_damping": 0.3}},
}
"""Controllers by the name of their column: ``rigid`` is the condensed WBC in which nothing gives
way, ``QP`` the whole-body QP by own search, ``est.`` the condensed WBC with joint friction
estimated, ``law`` the one whose motors hold its joint targets.
"""
GAITS: dict[str, dict[str, Any]] = {
    "straight": {"name": "hand"},
    "commanded": {"name": "commanded", "velocity": (0.2, 0.0, 0.2)},
}
KNOWN = {
    "damping": "damping {:g} N·m·s/rad",
    "torque": "torque limits × {:g}",
    "bandwidth": "motors of {:g} Hz",
}
UNKNOWN = {"viscous": "unknown viscous {:g} N·m·s/rad", "coulomb": "unknown Coulomb {:g} N·m"}
ACTUATORS = {"bandwidth": "bandwidth", "viscous": "viscous_friction", "coulomb": "coulomb_friction"}


def _jobs(s: Any) -> Iterator[Job]:
    cases = [
        {"kind": kind, "value": value} for kind in (*KNOWN, *UNKNOWN) for value in getattr(s, kind)
    ]
    for one in grid(**starts(s), gait=s.gaits, friction=s.frictions, case=cases, walker=WALKERS):
        case, governed = one.pop("case"), WALKERS[one["walker"]]["name"] == "governed"
        if one["gait"] == "straight" or not governed:  # which cannot turn
            yield one | case


def scenario(job: Job) -> Scenario:
    """What is walked; the controller knows its torque limits."""
    kind, value, controller = job["kind"], job["value"], dict(WALKERS[job["walker"]])
    share = value if kind == "torque" else 1.0
    if share < 1.0 and controller["name"] != "governed":
        parameters = controller.get("parameters", {})
        controller["parameters"] = {
            **parameters,
            "limits": {**parameters.get("limits", {}), "torque_scale": share},
        }
    unknown = {ACTUATORS[kind]: value} if kind in ACTUATORS else {}
    return Scenario(
        gait=GAITS[job["gait"]],
        controller=controller,
        ground=Ground(mu_s=job["friction"]),
        disturbances=Disturbances(
            actuators=Actuators(torque_share=share, **unknown), start_velocity=start_velocity(job)
        ),
        duration=job["duration"],
        urdf=damped_harpy(value * JOINT_DAMPING) if kind == "damping" else None,
    )


def _place(row: dict[str, Any]) -> str:
    kind, value = row["kind"], row["value"]
    return (KNOWN | UNKNOWN)[kind].format(value * JOINT_DAMPING if kind == "damping" else value)


def slip_or_falls(rows: Rows) -> str:
    """Falls, or the median slip."""
    if count := sum(row["fell"] for row in rows):
        return f"fell {count}/{len(rows)}"
    return number_text(float(np.median([row["slip_mm_per_step"] for row in rows])), 2)


def _of(kinds: dict[str, str], what: Value) -> Value:
    return lambda rows: what([row for row in rows if row["kind"] in kinds])


_WORST = where(most("slip_mm_per_step"), fell=False)
STUDY = Study(
    name="limits",
    help=__doc__,
    example="--out limits.jsonl",
    defaults=STARTS
    | {
        "damping": (
            0.1,
            1.0,
            10.0,
            30.0,
            50.0,
        ),  # factors on the joint damping, known to the controllers
        "torque": (0.7, 0.5, 0.3),  # shares of the peak torque, known to the controllers
        "bandwidth": (200.0, 50.0, 20.0),  # of the motors, Hz
        "viscous": (0.5, 1.0, 3.0, 5.0),  # friction in the joints, N·m·s/rad
        "coulomb": (0.1, 0.3, 1.0),  # friction in the joints, N·m
        "frictions": (0.8, 0.25, 0.15),  # of the ground
        "gaits": tuple(GAITS),
        "seed": 500,
    },
    quick={
        **{
            "damping": (50.0,),
            "torque": (0.3,),
            "bandwidth": (50.0,),
            "viscous": (1.0,),
            "coulomb": (0.3,),
        },
        **{"frictions": (0.25,), "gaits": ("straight",), "duration": 1.5},
    },
    jobs=_jobs,
    measure=walking(scenario, "slip_mm_per_step", "tracking_rms_mm", "distance_m"),
    views=[
        View(
            "limits",
            "Falls, and the worst slip of the walks that did not fall",
            row="{walker}",
            columns={
                "limits: fell": _of(KNOWN, fell),
                "limits: worst slip": (_of(KNOWN, _WORST), "mm"),
                "joint friction: fell": _of(UNKNOWN, fell),
                "joint friction: worst slip": (_of(UNKNOWN, _WORST), "mm"),
            },
            note="Limits: damping, torque limits and slow motors. Joint friction: viscous and "
            "Coulomb, in no model.",
        ),
        View(
            name="limits_{gait}_{friction:g}",
            title="Slip per step, mm, or falls: {gait} gait, friction {friction:g}",
            row=_place,
            across="{walker}",
            columns=slip_or_falls,
            note="Median slip over the starts; where walks fell, how many. rigid: the condensed "
            "WBC in which nothing "
            "gives way; est.: joint friction estimated; law: with joint targets for the motors; "
            "QP: by own search. "
            "All have the same torque limits.",
        ),
    ],
)
