"""The same walks on grounds from soft to stiff, in this library's plant and in MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

from comparison.contenders import label
from comparison.measure.controllers import scenario_of
from comparison.measure.walking import Rows, grouped
from comparison.study import Job, Study, Value, crossed
from comparison.tables import Cell, Table
from harpy_pin import Ground, Mujoco, Scenario, walk
from harpy_pin.gaits import GaitParameters
from harpy_pin.simulation.mujoco import PRESETS, installed_version

STIFFNESSES = (4e3, 8e3, 16e3, 40e3, 80e3)
"""N/m; the damping ratio is that of the default ground, 8 kN/m, whose MuJoCo presets are walked on, too."""
STEPS = ("governed/paper", "condensed")
"""Walkers that also walk with half the physics step, on the highest friction."""
NOTE = (
    "Per step of the walk, both feet together, mm. Friction and stiffness are known to controllers and gait. Where the "
    "path is much longer than the net displacement the feet go to and fro; where it is shorter they hop. Do not rank "
    "what differs by less than the effect of the physics step."
)
ABSENT = " MuJoCo is not installed: pip install 'harpy-pin[mujoco]'."


def _grounds() -> dict[str, dict[str, Any]]:
    """Changes of the scenario for each ground; those of :class:`Ground` but the friction under ``stiffness``."""
    own: dict[str, dict[str, Any]] = {f"{k / 1e3:g} kN/m": {"stiffness": k} for k in STIFFNESSES}
    if installed_version() is None:
        return own
    return own | {f"MuJoCo {name}": {"plant": Mujoco(name)} for name in PRESETS}


def _jobs(s: Any) -> Iterator[Job]:
    dt = Scenario().dt
    cases = [(*case, dt) for case in product(s.frictions, s.walkers)]
    cases += [(s.frictions[0], walker, 0.5 * dt) for walker in STEPS if walker in s.walkers]
    for ground, (friction, walker, step) in product(_grounds(), cases):
        yield {"ground": ground, "friction": friction, "walker": walker, "dt_s": step, "duration": s.duration}


def _measured(job: Job) -> dict[str, Any]:
    changes = {"dt": job["dt_s"], **_grounds()[job["ground"]]}
    felt = Ground(stiffness=changes.pop("stiffness", Ground().stiffness), mu_s=job["friction"])
    scenario = scenario_of(job["walker"], job["friction"], duration=job["duration"], **changes)
    run = walk(replace(scenario, ground=felt))
    end = float(run.metadata["end_time"])
    steps = max(end / GaitParameters().step_duration, 1.0)
    return {
        "ending": run.ending,
        "end_time_s": end,
        "distance_m": float(run["q"][-1, 0] - run["q"][0, 0]),
        "normal_n": float(run["foot_force"][:, :, 2].sum(axis=1).mean()),
        "path_mm": 1e3 * float(run["slip_path"][-1].sum()) / steps,
        "net_mm": 1e3 * float(run["slip_net"][-1].sum()) / steps,
    }


def _slip(name: str) -> Value:
    """Of a walk that came to its end."""
    return lambda rows: (
        rows[0][name] if rows[0]["ending"] == "completed" else f"{rows[0]['ending']} at {rows[0]['end_time_s']:.2f} s"
    )


def _tables(rows: Rows) -> list[Table]:
    """Path and net displacement at each friction; then both engines beside each other."""
    coarse = max(row["dt_s"] for row in rows)
    usual = [row for row in rows if row["dt_s"] == coarse]
    tables = [
        crossed(
            f"grounds_{friction:g}_{what.split()[0]}", f"Slip, {what}, mm per step, friction {friction:g}", here,
            lambda row: label(row["walker"]), lambda row: str(row["ground"]), _slip(name),
        )
        for (friction,), here in grouped(usual, "friction").items()
        for name, what in (("path_mm", "path"), ("net_mm", "net displacement"))
    ]  # fmt: skip
    fine = {(row["ground"], row["walker"]): row for row in rows if row["dt_s"] < coarse}
    cells = []
    for row in usual:
        other = fine.get((row["ground"], row["walker"]))
        if other is not None and row["friction"] == other["friction"]:
            name, ground = label(row["walker"]), row["ground"]
            cells.append(Cell(f"{name}: distance, m", ground, row["distance_m"]))
            cells.append(Cell(f"{name}: mean normal force, N", ground, row["normal_n"]))
            cells.append(Cell(f"{name}: path, mm", ground, row["path_mm"]))
            cells.append(Cell(f"{name}: path with half the step, mm", ground, other["path_mm"]))
    note = NOTE + (ABSENT if installed_version() is None else f" MuJoCo {installed_version()}.")
    title = f"The same walks in both engines, friction {usual[0]['friction']:g}, physics step {1e3 * coarse:g} ms"
    return [*tables, Table("grounds_engines", title, tuple(cells), note)]


STUDY = Study(
    name="grounds",
    help="""Walk every controller on soft and stiff ground.

    Stiffness is 4 to 80 kN/m, or MuJoCo's. Friction is 0.25 and 0.15. The tables show how far the feet slip, or when
    the robot fell. This takes some minutes.
    """,
    defaults={
        "walkers": ("governed/none", "governed/paper", "governed/filter", "condensed", "wbc"),
        "frictions": (0.25, 0.15),  # the highest first
        "duration": 6.0,  # s
    },
    quick={"duration": 1.5},
    jobs=_jobs,
    measure=_measured,
    tables=_tables,
)
