"""Tables of walks with thrusters as they are, and what a linear argument says of lags."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from comparison.measure.walking import Rows, grouped
from comparison.tables import Cell, Table, number_text
from harpy_pin import WholeBodyParameters
from harpy_pin.controllers.lag_margins import pd_lag_margin
from harpy_pin.controllers.parameters import GovernedParameters

__all__ = ["thruster_tables"]

QUANTITIES = {
    "slip_mm_per_step": ("slip", "Slip per step, mm, or falls"),
    "thrust_n": ("thrust", "Thrust, N"),
    "thrust_w": ("power", "Power of the thrusters, W"),
}
NOTES = {
    "slip": "Median over the starts; where walks fell, how many. Two columns know the lags.",
    "thrust": "Sum of both magnitudes, as they were; mean of a walk, median over the starts; empty where a walk fell.",
    "power": "Of fans that take 1 kW for 18 N, by momentum theory at other thrusts; empty where a walk fell.",
}


def thruster_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """The margins, and slip or falls, thrust and power: tables for each engine and friction."""
    tables = [_margins()]
    for (plant, friction), here in grouped(rows, "plant", "friction").items():
        for key, (short, title) in QUANTITIES.items():
            cells = [_cell(place, key, same) for place, same in _places(here)]
            where = f"{plant}, friction {friction:g}"
            name = f"thrusters_{short}_{plant}_{friction:g}".lower()
            tables.append(Table(name, f"{title}: {where}", tuple(cells), NOTES[short]))
    return tables


def _places(rows: Rows) -> list[tuple[str, Rows]]:
    """What the thrusters and motors are, and its walks by one controller."""
    found = []
    for what, same in grouped(rows, "bandwidth", "lag", "turning_lag", "failing", "walker").items():
        bandwidth, lag, turning, failing = what[:4]
        motors = "" if bandwidth is None else f", motors of {bandwidth:g} Hz"
        place = f"{1e3 * lag:g} ms{motors}"
        if turning > 0.0:
            place = f"directions {1e3 * turning:g} ms"
        elif failing is not None:
            place = f"{100 * failing:g} % of one left"
        found.append((place, same))
    return found


def _cell(place: str, key: str, walks: Rows) -> Cell:
    """A median, or how many fell."""
    fell = sum(walk["fell"] for walk in walks)
    text = number_text(float(np.median([walk[key] for walk in walks])), 2)
    if fell:
        text = f"fell {fell}/{len(walks)}" if key == "slip_mm_per_step" else ""
    return Cell(place, walks[0]["walker"], text)


def _margins() -> Table:
    """Lags that the linear argument allows where only thrusts act."""
    governed, p = GovernedParameters(), WholeBodyParameters()
    loops = {
        "paper: position": (float(np.max(governed.centre.k_pt)), float(np.max(governed.centre.k_dt))),
        "paper: roll and yaw": (governed.attitude.k_p, governed.attitude.k_d),
        "WBCs: position": p.body,
        "WBCs: orientation": p.orientation,
    }
    cells = []
    for name, (k_p, k_d) in loops.items():
        cells.append(Cell(name, "k_d / k_p", 1e3 * k_d / k_p, "ms"))
        if name.startswith("WBCs"):
            cells.append(Cell(name, "held over a tick", 1e3 * pd_lag_margin(k_p, k_d, period=p.period), "ms"))
    note = "Largest lag of thrusts with which the loop is stable, if nothing else gives the acceleration commanded."
    return Table("thrusters_margins", "Lags that the linear argument allows", tuple(cells), note)
