"""Walk over ice with and without estimated friction.

The condensed controller, the whole-body QP by own search, the paper's governor and the
contact-force filter, none of which knows of the strip, in both engines, with exact measurements and
with noise and delay. The estimate's settings were chosen on strips of 0.2 and 0.1 on ground of 0.6,
at 0.2 and 0.4 m/s, with seeds 100 and 101. What is walked here is at other friction, at another
speed, on strips at other places and with other seeds.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.contenders import OWN, OWN_PART, label
from comparison.study import Job, Rows, Study, View, fell, grid, shown

STEP = 0.75
"""Duration of a step of the default gait, s."""
LOADED = 1.0
"""Normal force of a foot that is on the ground, N."""
WALKERS: dict[str, Mapping[str, Any]] = {
    "condensed": {"name": "condensed"},
    OWN: OWN_PART,
    "paper": {"name": "governed", "governor": "paper"},
    "filter": {"name": "governed", "governor": "filter"},
}
"""Controllers of a scenario by the name of their row."""
SENSORS = {
    "exact": hp.Disturbances(),
    "noise, 2 ms": hp.Disturbances(noise=hp.Noise.typical(), delay=2e-3),
}


def _jobs(s: Any) -> Iterator[Job]:
    seeds = range(s.seed, s.seed + s.walks)
    for job in grid(
        ice=s.ice,
        plant=s.plants,
        sensors=SENSORS,
        walker=WALKERS,
        seed=seeds,
        estimate=(False, True),
    ):
        begin = s.place + 0.3 * STEP * float(np.random.default_rng([job["seed"], 77]).random())
        strip = [begin, begin + s.length, job["ice"]]
        yield {**job, "friction": s.friction, "strip": strip, "duration": s.duration}


def _measured(job: Job) -> dict[str, Any]:
    part = WALKERS[job["walker"]]
    scenario = hp.Scenario(
        controller={
            **part,
            "parameters": {**part.get("parameters", {}), "estimate_friction": job["estimate"]},
        },
        plant=job["plant"],
        ground=hp.Ground(mu_s=job["friction"], friction_strips=(tuple(job["strip"]),)),
        disturbances=replace(SENSORS[job["sensors"]], seed=job["seed"]),
        duration=job["duration"],
    )
    return slips(hp.walk(scenario), *job["strip"][:2])


def slips(run: hp.Run, begin: float, end: float) -> dict[str, Any]:
    """Path of both feet along the ground in every step, mm: steps with a loaded foot on the strip,
    and later ones.
    """
    x, load = run["foot_position"][..., 0], run["foot_force"][..., 2]
    on_ice = np.any((x >= begin) & (x < end) & (load > LOADED), axis=1)
    path = 1e3 * run["slip_path"].sum(axis=1)
    step = np.floor(run["t"] / STEP + 1e-9).astype(int)
    first = np.flatnonzero(np.diff(step, prepend=-1))
    slip = np.diff(path[np.append(np.maximum(first - 1, 0), -1)])  # in each step
    icy = np.logical_or.reduceat(on_ice, first)
    after = ~icy & np.logical_or.accumulate(icy)
    estimate = float(run["friction_estimate"].min()) if "friction_estimate" in run else None
    slips_mm = {"ice_mm": slip[icy].tolist(), "after_mm": slip[after].tolist()}
    return {"fell": run.ending != "completed", **slips_mm, "lowest_estimate": estimate}


def _place(row: dict[str, Any]) -> str:
    return (
        f"{label(row['walker'])}, {row['sensors']}, estimate {'on' if row['estimate'] else 'off'}"
    )


def _of_all(name: str, put: Callable[[list[float]], float], rows: Rows) -> float | None:
    """Of the steps of all walks."""
    found = [slip for row in rows for slip in row[name]]
    return float(put(found)) if found else None


STUDY = Study(
    name="ice",
    help=__doc__,
    defaults={
        "friction": 0.8,  # of the ground, which the controllers assume
        "ice": (0.15,),  # static friction coefficients of the strip
        "place": 0.6,  # where it begins, m, before a random shift by up to a step
        "length": 0.6,  # m
        "plants": ("compliant", "mujoco"),
        "walks": 5,  # of each kind, with other places and other noise
        "duration": 7.5,  # s
        "seed": 0,  # of the first walk
    },
    quick={"plants": ("compliant",), "walks": 1, "place": 0.3, "length": 0.3, "duration": 3.0},
    jobs=_jobs,
    measure=_measured,
    views=[
        View(
            "ice_{plant}_{ice:g}",
            "A strip of {ice:g}, {plant} plant",
            row=_place,
            columns={
                "fell": fell,
                "median on ice": (partial(_of_all, "ice_mm", np.median), "mm"),
                "worst on ice": (partial(_of_all, "ice_mm", max), "mm"),
                "worst after": (partial(_of_all, "after_mm", max), "mm"),
                "lowest estimate": shown("lowest_estimate", min),
            },
            note="Slip per step: path of both feet along the ground, over all steps of all walks, "
            "up to a fall.",
        )
    ],
)
