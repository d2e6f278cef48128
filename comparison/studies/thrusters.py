"""Walk Harpy with thrusters as they are.

Their magnitudes lag by up to 1 s, their directions by up to 0.2 s, both by first order, or one of
them fails; also with slow motors, and in both engines: the ungoverned and the paper's controller,
the contact-force filter, the condensed controller and the whole-body QP by own search, and these
two where they know the lags. Nobody knows how slow the motors are, or that a thruster fails. All
have the same limits of torque and thrust. This takes many minutes.
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.contenders import LIMITED, OWN_PART, published_parameters
from comparison.studies.limits import slip_or_falls
from comparison.studies.margins import pd_lag_margin
from comparison.study import (
    STARTS,
    Cell,
    Job,
    Rows,
    Study,
    Table,
    Value,
    View,
    grid,
    kept,
    median,
    number_text,
    start_velocity,
    starts,
    walk_as_far_as_it_goes,
)
from harpy_pin.log.optional import given_thrust

WALKERS: dict[str, Mapping[str, Any]] = {
    **LIMITED,
    "condensed": {"name": "condensed"},
    "QP": OWN_PART,
    "condensed, knows": {"name": "condensed"},
    "QP, knows": OWN_PART,
}
"""Controllers by the name of their column; ``QP`` is the whole-body QP by own search."""
FAILS_AT = 1.5
"""When the left thruster fails, s."""
PLANTS = {"ours": {"name": "compliant"}, "MuJoCo": {"name": "mujoco", "preset": "stiff"}}


def _jobs(s: Any) -> Iterator[Job]:
    none = {"bandwidth": None, "lag": 0.0, "turning_lag": 0.0, "failing": None}
    for where in grid(plant=s.plants, friction=s.frictions):
        cases = [none | one for one in grid(bandwidth=s.bandwidths, lag=s.lags)]
        if where["friction"] == s.frictions[0]:
            cases += [
                none | one for one in (*grid(turning_lag=s.turning_lags), *grid(failing=s.failing))
            ]
        for one in grid(case=cases, walker=WALKERS, **starts(s)):
            job = where | one.pop("case") | one
            if (
                "knows" not in job["walker"] or job["lag"] or job["turning_lag"]
            ):  # else there is nothing to know
                yield job


def scenario(job: Job) -> hp.Scenario:
    """What is walked."""
    failing = None if job["failing"] is None else (0, FAILS_AT, job["failing"])
    thrusters = hp.Thrusters(lag=job["lag"], turning_lag=job["turning_lag"], failing=failing)
    actuators = hp.Actuators(bandwidth=job["bandwidth"], torque_share=1.0, thrusters=thrusters)
    lags = {"thrust_lag": job["lag"], "thrust_turning_lag": job["turning_lag"]}
    part = WALKERS[job["walker"]]
    known = (
        {"parameters": {**part.get("parameters", {}), **lags}} if "knows" in job["walker"] else {}
    )
    return hp.Scenario(
        gait={"name": "hand"},
        controller={**part, **known},
        plant=PLANTS[job["plant"]],
        ground=hp.Ground(mu_s=job["friction"]),
        disturbances=hp.Disturbances(actuators=actuators, start_velocity=start_velocity(job)),
        duration=job["duration"],
    )


def _measured(job: Job) -> dict[str, Any]:
    run = walk_as_far_as_it_goes(scenario(job))
    found = kept(run, "slip_mm_per_step", "distance_m", "thrust_power_w")
    return found | {
        "thrust_n": float(np.linalg.norm(given_thrust(run), axis=2).sum(axis=1).mean()),
        "thrust_w": found.pop("thrust_power_w"),
        "upright_s": float(run["t"][-1]),
    }


def _place(row: dict[str, Any]) -> str:
    """What thrusters and motors are."""
    if row["turning_lag"] > 0.0:
        return f"directions {1e3 * row['turning_lag']:g} ms"
    if row["failing"] is not None:
        return f"{100 * row['failing']:g} % of one left"
    return f"{1e3 * row['lag']:g} ms" + (
        "" if row["bandwidth"] is None else f", motors of {row['bandwidth']:g} Hz"
    )


def _unless_fallen(name: str, rows: Rows) -> str:
    """The median, of walks of which none fell."""
    return "" if any(row["fell"] for row in rows) else number_text(median(name)(rows), 2)


def _view(name: str, title: str, what: Value, note: str) -> View:
    return View(
        lambda row: f"thrusters_{name}_{row['plant']}_{row['friction']:g}".lower(),
        f"{title}: {{plant}}, friction {{friction:g}}",
        row=_place,
        across="{walker}",
        columns=what,
        note=note,
    )


def _margins(rows: Rows) -> Iterable[Table]:
    """Lags that the linear argument allows where only thrusts act."""
    governed, p = hp.controllers.GovernedParameters(), published_parameters()
    loops = {
        "paper: position": (
            float(np.max(governed.centre.k_pt)),
            float(np.max(governed.centre.k_dt)),
        ),
        "paper: roll and yaw": (governed.attitude.k_p, governed.attitude.k_d),
        "WBCs: position": p.body,
        "WBCs: orientation": p.orientation,
    }
    cells = []
    for name, (k_p, k_d) in loops.items():
        cells.append(Cell(name, "k_d / k_p", 1e3 * k_d / k_p, "ms"))
        if name.startswith("WBCs"):
            cells.append(
                Cell(name, "held over a tick", 1e3 * pd_lag_margin(k_p, k_d, period=p.period), "ms")
            )
    note = (
        "Largest lag of thrusts with which the loop is stable, if nothing else gives the "
        "acceleration commanded."
    )
    yield Table("thrusters_margins", "Lags that the linear argument allows", tuple(cells), note)


STUDY = Study(
    name="thrusters",
    help=__doc__,
    example="--out thrusters.jsonl",
    defaults=STARTS
    | {
        "lags": (0.0, 0.01, 0.03, 0.1, 0.3, 1.0),  # of the thrusts' magnitudes, s
        "turning_lags": (
            0.02,
            0.05,
            0.1,
            0.2,
        ),  # of their directions, s, with magnitudes that follow at once
        "failing": (
            0.5,
            0.2,
            0.0,
        ),  # shares of one thruster that are left from the second step on, without lags
        "bandwidths": (None, 50.0),  # of the motors, Hz; None where they follow at once
        "frictions": (0.25, 0.15),
        "plants": tuple(PLANTS),
        "starts": 3,
        "seed": 600,
    },
    quick={
        **{
            "lags": (0.0, 0.1),
            "turning_lags": (0.05,),
            "failing": (0.5,),
            "bandwidths": (None,),
            "frictions": (0.25,),
        },
        **{"plants": ("ours",), "starts": 1, "duration": 1.5},
    },
    jobs=_jobs,
    measure=_measured,
    views=[
        _margins,
        _view(
            "slip",
            "Slip per step, mm, or falls",
            slip_or_falls,
            "Median over the starts; where walks fell, how many. Two columns know the lags.",
        ),
        _view(
            "thrust",
            "Thrust, N",
            partial(_unless_fallen, "thrust_n"),
            "Sum of both magnitudes, as they were; mean of a walk, median over the starts; empty "
            "where a walk fell.",
        ),
        _view(
            "power",
            "Power of the thrusters, W",
            partial(_unless_fallen, "thrust_w"),
            "Of fans that take 1 kW for 18 N, by momentum theory at other thrusts; empty where a "
            "walk fell.",
        ),
    ],
)
