"""The same walks on grounds from soft to stiff, in this library's plant and in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from comparison.contenders import label
from comparison.measure.controllers import scenario_of
from comparison.measure.walking import Progress, Rows, grouped, tracked
from comparison.tables import Cell, Table
from harpy_pin import GaitParameters, Ground, Mujoco, Scenario, checks, walk
from harpy_pin.simulation.mujoco import PRESETS, installed_version

__all__ = ["STIFFNESSES", "WALKERS", "GroundsSettings", "ground_tables", "walk_grounds"]

WALKERS = ("governed/none", "governed/paper", "governed/filter", "condensed", "wbc")
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


@dataclass(frozen=True, kw_only=True)
class GroundsSettings:
    """What is walked.

    Attributes:
        frictions: static friction coefficients, the highest first.
        duration: of a walk, s.
    """

    frictions: tuple[float, ...] = (0.25, 0.15)
    duration: float = 6.0

    def __post_init__(self) -> None:
        checks.number("duration", self.duration, low=0.0, strict=True)
        for friction in self.frictions:
            checks.number("frictions", friction, low=0.0)

    @classmethod
    def quick(cls) -> GroundsSettings:
        """Walks of 1.5 s: a look, not to quote."""
        return cls(duration=1.5)


def _grounds() -> dict[str, dict[str, Any]]:
    """Changes of the scenario for each ground; those of :class:`Ground` but the friction under ``stiffness``."""
    own: dict[str, dict[str, Any]] = {f"{k / 1e3:g} kN/m": {"stiffness": k} for k in STIFFNESSES}
    if installed_version() is None:
        return own
    return own | {f"MuJoCo {name}": {"plant": Mujoco(name)} for name in PRESETS}


def walk_grounds(settings: GroundsSettings, progress: Progress | None = None) -> Rows:
    """Walk every controller on every ground.

    Returns:
        A row for each walk: ``ground``, ``friction``, ``walker``, ``dt_s``, ``ending``, ``end_time_s``, ``distance_m``,
        ``normal_n`` (mean total normal force), ``path_mm`` and ``net_mm`` (slip per step of the walk).
    """
    cases: list[tuple[float, str, dict[str, Any]]] = [(*case, {}) for case in product(settings.frictions, WALKERS)]
    cases += [(settings.frictions[0], walker, {"dt": 0.5 * Scenario().dt}) for walker in STEPS]
    rows = []
    for (ground, changes), (friction, walker, step) in tracked(list(product(_grounds().items(), cases)), progress):
        more = {name: value for name, value in changes.items() if name != "stiffness"}
        felt = Ground(stiffness=changes.get("stiffness", Ground().stiffness), mu_s=friction)
        scenario = replace(scenario_of(walker, friction, duration=settings.duration, **more, **step), ground=felt)
        rows.append({"ground": ground, "friction": friction, "walker": walker} | _measure(scenario))
    return rows


def _measure(scenario: Scenario) -> dict[str, Any]:
    """What is kept of a walk."""
    run = walk(scenario)
    end = float(run.metadata["end_time"])
    steps = max(end / GaitParameters().step_duration, 1.0)
    return {
        "dt_s": scenario.dt,
        "ending": run.ending,
        "end_time_s": end,
        "distance_m": float(run["q"][-1, 0] - run["q"][0, 0]),
        "normal_n": float(run["foot_force"][:, :, 2].sum(axis=1).mean()),
        "path_mm": 1e3 * float(run["slip_path"][-1].sum()) / steps,
        "net_mm": 1e3 * float(run["slip_net"][-1].sum()) / steps,
    }


def ground_tables(rows: Rows) -> list[Table]:
    """The tables of :func:`walk_grounds`."""
    coarse = max(row["dt_s"] for row in rows)
    usual = [row for row in rows if row["dt_s"] == coarse]
    tables = []
    for (friction,), here in grouped(usual, "friction").items():
        for key, what in (("path_mm", "path"), ("net_mm", "net displacement")):
            cells = [Cell(label(row["walker"]), row["ground"], _slip(row, key)) for row in here]
            title = f"Slip, {what}, mm per step, friction {friction:g}"
            tables.append(Table(f"grounds_{friction:g}_{what.split()[0]}", title, tuple(cells)))
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


def _slip(row: dict[str, Any], key: str) -> float | str:
    """Slip of a walk that came to its end."""
    return float(row[key]) if row["ending"] == "completed" else f"{row['ending']} at {row['end_time_s']:.2f} s"
