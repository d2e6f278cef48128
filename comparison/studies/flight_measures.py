"""What became of a flight: where it landed, how hard, and what it cost."""

from __future__ import annotations

from typing import Any

import numpy as np

from harpy_pin import Run
from harpy_pin.contrib.flight import Fly, Jump
from harpy_pin.contrib.flight.flying_gait import PHASES
from harpy_pin.log.power import PRESETS, Motors, power

MOTORS = Motors(constant=0.6)
"""Of Harpy's joints: assumed."""
WALKED_ON, UPRIGHT, OVER = 0.3, 0.05, 0.03
"""How far it walks after a landing, m; how upright and how near its height it must stand, rad and m."""


def walk_measures(run: Run) -> dict[str, Any]:
    """What a walk costs; nothing of one that fell.

    Args:
        run: the walk.
    """
    if run.ending != "completed":
        return {"stands": False, "fell_s": float(run["t"][-1])}
    way = float(run["q"][-1, 0] - run["q"][0, 0])
    return {"stands": True, "distance_m": way, "peak": _peak(run, slice(None)), **_cost(run, slice(None))}


def flight_measures(run: Run, flight: Jump | Fly, walks: bool) -> dict[str, Any]:
    """What became of a flight.

    Args:
        run: its log.
        flight: what was asked for.
        walks: whether it should walk on.
    """
    phase = run["flight_phase"].ravel()
    air, land = (np.flatnonzero(phase == PHASES.index(name)) for name in ("air", "land"))
    if len(land) == 0:
        return {"stands": False, "fell_s": float(run["t"][-1])}
    q, feet, plan, slip = run["q"], run["foot_position"], run["body_plan"], run["slip_path"]
    before, after = feet[air[0] - 1].mean(axis=0), feet[land[-1]].mean(axis=0)
    still = _hovering(plan, air)
    flown = slice(int(np.flatnonzero(phase == PHASES.index("bend"))[0]), int(land[-1]) + 1)
    return {
        "stands": _stands(run, walks),
        "height_m": float(q[air, 2].max() - q[air[0], 2]),
        "distance_m": float(np.hypot(*(after - before)[:2])),
        "place_mm": float(1e3 * np.hypot(*((after - before)[:2] - (flight.forward, flight.left)))),
        "hover_mm": float(1e3 * np.linalg.norm(q[still, :3] - plan[still], axis=1).max()) if len(still) else None,
        "peak": _peak(run, land),
        "slip_mm": float(1e3 * (slip[land[-1]] - slip[land[0]]).sum()),
        **_cost(run, flown, float(np.hypot(flight.forward, flight.left))),
    }


def _peak(run: Run, ticks: Any) -> float:
    """Largest force of both feet, per weight."""
    force = np.linalg.norm(run["foot_force"][ticks], axis=2).sum(axis=1)
    return float(force.max() / (float(run.metadata["mass"]) * 9.81))


def _hovering(plan: Any, air: Any) -> Any:
    """Ticks of the air in which the plan stays where it is, but for the first second."""
    rest = np.linalg.norm(np.diff(plan[air], axis=0), axis=1) < 1e-9
    ticks = air[1:][rest]
    return ticks[1000:]


def _stands(run: Run, walks: bool) -> bool:
    """Whether it stands at the end, or walked on."""
    if run.ending != "completed":
        return False
    end, q = run["q"][-1], run["q"]
    if walks:
        gait = np.flatnonzero(run["flight_phase"].ravel() == PHASES.index("gait"))
        return len(gait) > 0 and float(end[0] - q[gait[0], 0]) >= WALKED_ON
    tilt = 2.0 * float(np.hypot(end[3], end[4]))
    height = float(end[2] - run["foot_position"][-1, :, 2].mean() - q[0, 2])
    return tilt < UPRIGHT and abs(height) < OVER


def _cost(run: Run, ticks: slice, distance: float | None = None) -> dict[str, Any]:
    """Energy, power, and cost of transport."""
    found = power(run, motors=MOTORS, propulsion=PRESETS["fan"])
    battery = found.battery[ticks]
    energy = float(battery.sum() * found.period)
    path = found.path if distance is None else distance
    cost = energy / (found.weight * path) if path > 0.1 else None
    return {"energy_j": energy, "power_w": float(battery.mean()), "cost": cost}
