"""Tables of flights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from comparison.flights import CONTROLLERS, FRICTION, PLANTS
from comparison.measure.walking import grouped
from comparison.tables import Cell, Table, number_text

__all__ = ["flight_tables"]

COLUMNS: dict[str, tuple[str, Callable[[Any], Any], int]] = {
    "height_m": ("height, m", min, 3),
    "distance_m": ("distance, m", min, 3),
    "place_mm": ("place, mm", max, 2),
    "hover_mm": ("hover, mm", max, 2),
    "peak": ("peak / weight", max, 2),
    "slip_mm": ("slip, mm", max, 2),
    "energy_j": ("energy, J", np.median, 3),
    "power_w": ("power, W", np.median, 3),
    "cost": ("J/(N·m)", np.median, 2),
}
"""By the name in a row: the column's, how tries are put together, and digits."""


def flight_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """A row for each manoeuvre, controller and plant."""
    cells = []
    for (name, controller, plant), here in grouped(rows, "flight", "controller", "plant").items():
        place = f"{name}, {CONTROLLERS[controller]}, {PLANTS[plant]}"
        cells.append(Cell(place, "stands", f"{sum(row['stands'] for row in here)} of {len(here)}"))
        for key, (column, together, digits) in COLUMNS.items():
            values = [row[key] for row in here if row.get(key) is not None]
            cells.append(Cell(place, column, number_text(float(together(values)), digits) if values else ""))
    return [Table("flights", "Flights of Harpy", tuple(cells), NOTE)]


NOTE = (
    f"Friction {FRICTION:g}, noisy measurements. Of all tries: least height of the jump or flight and least distance "
    "of the feet, greatest error of the landing and of the hovering body, greatest force of both feet and greatest "
    "slip in landing; medians of the energy. Fans of 18 N from 1 kW, motors of 0.6 N·m/√W, both assumed."
)
