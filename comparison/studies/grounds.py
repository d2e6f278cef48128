"""Walk every controller on soft and stiff ground.

Stiffness is 4 to 80 kN/m, in this library's plant, or MuJoCo's. Friction is 0.25 and 0.15. The
tables show how far the feet slip, or when the robot fell. This takes some minutes.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import harpy_pin as hp
from comparison.contenders import OWN, label
from comparison.study import Job, Rows, Study, View, grid, scenario_of, shown, where
from harpy_pin.simulation.mujoco import PRESETS

STIFFNESSES = (4e3, 8e3, 16e3, 40e3, 80e3)
"""N/m; the damping ratio is that of the default ground, 8 kN/m, whose MuJoCo presets are walked on,
too.
"""
STEPS = ("governed/paper", "condensed")
"""Walkers that also walk with half the physics step, on the highest friction."""
DT = hp.Scenario().dt


GROUNDS: dict[str, dict[str, Any]] = {
    **{f"{k / 1e3:g} kN/m": {"stiffness": k} for k in STIFFNESSES},
    **{f"MuJoCo {name}": {"plant": hp.Mujoco(name)} for name in PRESETS},
}
"""Changes of the scenario for each ground; those of :class:`harpy_pin.Ground` but the friction
under ``stiffness``.
"""


def _jobs(s: Any) -> Iterator[Job]:
    cases = [*grid(friction=s.frictions, walker=s.walkers, dt_s=DT)]
    cases += grid(
        friction=s.frictions[:1], walker=[who for who in STEPS if who in s.walkers], dt_s=0.5 * DT
    )
    for one in grid(ground=GROUNDS, case=cases):
        yield {"ground": one["ground"], **one["case"], "duration": s.duration}


def _measured(job: Job) -> dict[str, Any]:
    changes = {"dt": job["dt_s"], **GROUNDS[job["ground"]]}
    felt = hp.Ground(
        stiffness=changes.pop("stiffness", hp.Ground().stiffness), mu_s=job["friction"]
    )
    scenario = scenario_of(job["walker"], job["friction"], duration=job["duration"], **changes)
    run = hp.walk(replace(scenario, ground=felt))
    return ending_and_slip(run) | {
        "distance_m": float(run["q"][-1, 0] - run["q"][0, 0]),
        "normal_n": float(run["foot_force"][:, :, 2].sum(axis=1).mean()),
    }


def ending_and_slip(run: hp.Run) -> dict[str, Any]:
    """How a walk ended and when, and path and net displacement of both feet per step of the
    gait.
    """
    end = float(run.metadata["end_time"])
    steps = max(end / hp.gaits.GaitParameters().step_duration, 1.0)
    slips = {name: 1e3 * float(run[f"slip_{name}"][-1].sum()) / steps for name in ("path", "net")}
    return {
        "ending": run.ending,
        "end_time_s": end,
        "path_mm": slips["path"],
        "net_mm": slips["net"],
    }


def _slip(name: str, rows: Rows) -> Any:
    (row,) = rows
    return (
        row[name]
        if row["ending"] == "completed"
        else f"{row['ending']} at {row['end_time_s']:.2f} s"
    )


STUDY = Study(
    name="grounds",
    help=__doc__,
    defaults={
        "walkers": ("governed/none", "governed/paper", "governed/filter", "condensed", OWN),
        "frictions": (0.25, 0.15),  # the highest first
        "duration": 6.0,  # s
    },
    quick={"duration": 1.5},
    jobs=_jobs,
    measure=_measured,
    views=[
        *(
            View(
                f"grounds_{{friction:g}}_{name}",
                f"Slip, {what}, mm per step, friction {{friction:g}}",
                row=lambda row: label(row["walker"]),
                across="{ground}",
                columns=partial(_slip, f"{name}_mm"),
                only=lambda row: row["dt_s"] == DT,
            )
            for name, what in (("path", "path"), ("net", "net displacement"))
        ),
        View(
            "grounds_engines",
            "The same walks in both engines, and with half the physics step",
            row=lambda row: f"{label(row['walker'])}, {row['friction']:g}, {row['ground']}",
            columns={
                "distance": (where(shown("distance_m"), dt_s=DT), "m"),
                "mean normal force": (where(shown("normal_n"), dt_s=DT), "N"),
                "path": (where(shown("path_mm"), dt_s=DT), "mm"),
                "half the step": (where(shown("path_mm"), dt_s=0.5 * DT), "mm"),
            },
            note="Per step of the walk, both feet together, mm. Friction and stiffness are known "
            "to controllers and "
            "gait. Where the path is much longer than the net displacement the feet go to and fro; "
            "where it is "
            "shorter they hop. Do not rank what differs by less than the effect of the physics "
            "step.",
            only=lambda row: row["walker"] in STEPS,
        ),
    ],
)
