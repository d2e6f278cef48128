"""The same walk in both engines, tick by tick: how far the two bodies part, and how the forces on the feet differ."""

from __future__ import annotations

from typing import Any

import numpy as np

from comparison.contenders import label
from comparison.measure.controllers import scenario_of
from comparison.measure.walking import Rows
from comparison.tables import Cell, Table
from harpy_pin import walk
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.simulation.mujoco import installed_version

__all__ = ["FRICTION", "WALKERS", "engine_table", "walk_engines"]

WALKERS = ("governed/none", "governed/paper", "governed/filter", "condensed", "wbc")
FRICTION = 0.25
ENGINES = ("ours", "MuJoCo")
NOTE = (
    "Our plant, then MuJoCo with the same stiffness and damping. Differences: the largest distance between the two "
    "bodies, and the root mean square over ticks and feet of the difference of the forces on a foot, normal and along "
    "the ground."
)


def walk_engines(*, duration: float, friction: float = FRICTION) -> Rows:
    """Walk every controller in both engines, for a duration in s.

    Returns:
        A row for each walker: ``walker``, ``endings``, ``distance_m``, ``normal_n`` and ``path_mm`` (pairs: ours and
        MuJoCo's; mean total normal force, and slip of both feet in the whole walk), ``apart_mm``, ``normal_rms_n`` and
        ``tangential_rms_n``, over the ticks that both walked.

    Raises:
        InputError: MuJoCo is not installed.
    """
    if installed_version() is None:
        raise InputError("the second engine is not installed: pip install 'harpy-pin[mujoco]'", name="plant")
    rows = []
    for walker in WALKERS:
        ours, theirs = (
            walk(scenario_of(walker, friction, duration=duration, plant=plant)) for plant in ("compliant", "mujoco")
        )
        rows.append({"walker": walker} | _compare(ours, theirs))
    return rows


def _compare(ours: Run, theirs: Run) -> dict[str, Any]:
    """How two runs of the same scenario differ."""
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


def engine_table(rows: Rows) -> Table:
    """The table of :func:`walk_engines`."""
    cells = []
    for row in rows:
        walker = label(row["walker"])
        for key, what in (("distance_m", "distance, m"), ("normal_n", "mean normal, N"), ("path_mm", "slip, mm")):
            cells += [Cell(f"{what}, {name}", walker, value) for name, value in zip(ENGINES, row[key], strict=True)]
        cells.append(Cell("bodies apart, mm", walker, row["apart_mm"]))
        cells.append(Cell("normal force, RMS difference, N", walker, row["normal_rms_n"]))
        cells.append(Cell("tangential force, RMS difference, N", walker, row["tangential_rms_n"]))
        cells.append(Cell("ending", walker, " / ".join(dict.fromkeys(row["endings"]))))
    return Table("engines", "The same walk in both engines", tuple(cells), f"{NOTE} MuJoCo {installed_version()}.")
