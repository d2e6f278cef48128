"""The same walk in both engines, tick by tick: how far the two bodies part, and how the forces on the feet differ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from comparison.contenders import label
from comparison.measure.walking import scenario_of
from comparison.study import Job, Study, Value, View, shown
from harpy_pin import walk
from harpy_pin.errors import InputError, install_line
from harpy_pin.log.run import Run
from harpy_pin.simulation.mujoco import installed_version

FRICTION = 0.25
NOTE = (
    "Our plant, then MuJoCo with the same stiffness and damping. Differences: the largest distance between the two "
    "bodies, and the root mean square over ticks and feet of the difference of the forces on a foot, normal and along "
    "the ground."
)


def _jobs(s: Any) -> Iterator[Job]:
    if installed_version() is None:
        raise InputError(f"the second engine is not installed: {install_line('mujoco')}", name="plant")
    yield from ({"walker": walker, "duration": s.duration} for walker in s.walkers)


def _measured(job: Job) -> dict[str, Any]:
    how = {"duration": job["duration"]}
    ours, theirs = (walk(scenario_of(job["walker"], FRICTION, plant=plant, **how)) for plant in ("compliant", "mujoco"))
    return compared(ours, theirs)


def compared(ours: Run, theirs: Run) -> dict[str, Any]:
    """How two runs of the same scenario differ over the ticks that both walked; of a pair of numbers ours is first."""
    both, runs = min(len(ours), len(theirs)), (ours, theirs)
    force = ours["foot_force"][:both] - theirs["foot_force"][:both]
    return {
        "endings": [run.ending for run in runs],
        "distance_m": [float(run["q"][-1, 0] - run["q"][0, 0]) for run in runs],
        "normal_n": [float(run["foot_force"][:, :, 2].sum(axis=1).mean()) for run in runs],
        "path_mm": [1e3 * float(run["slip_path"][-1].sum()) for run in runs],
        "apart_mm": 1e3 * float(np.linalg.norm(ours["q"][:both, :3] - theirs["q"][:both, :3], axis=1).max()),
        "normal_rms_n": float(np.sqrt(np.mean(force[..., 2] ** 2))),
        "tangential_rms_n": float(np.sqrt(np.mean(np.sum(force[..., :2] ** 2, axis=-1)))),
    }


def _of(engine: int, name: str) -> Value:
    return lambda rows: rows[0][name][engine]


COLUMNS: dict[str, Any] = {}
for _name, _what, _unit in (
    ("distance_m", "distance", "m"),
    ("normal_n", "mean normal", "N"),
    ("path_mm", "slip", "mm"),
):
    COLUMNS[f"{_what}, ours"] = _of(0, _name), _unit
    COLUMNS[f"{_what}, MuJoCo"] = _of(1, _name), _unit
COLUMNS |= {
    "bodies apart": (shown("apart_mm"), "mm"),
    "normal force, RMS difference": (shown("normal_rms_n"), "N"),
    "tangential force, RMS difference": (shown("tangential_rms_n"), "N"),
    "ending": lambda rows: " / ".join(dict.fromkeys(rows[0]["endings"])),
}
VIEW = View(
    name="engines",
    title="The same walk in both engines",
    row=lambda row: label(row["walker"]),
    columns=COLUMNS,
    note=NOTE,
)

STUDY = Study(
    name="engines",
    help="""Walk every controller in both engines, and compare.

    Motion and forces are compared tick by tick.
    """,
    defaults={
        "walkers": ("governed/none", "governed/paper", "governed/filter", "condensed", "wbc"),
        "duration": 6.0,  # s
    },
    quick={"duration": 1.5},
    jobs=_jobs,
    measure=_measured,
    views=(VIEW,),
)
