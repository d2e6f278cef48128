"""How long the ticks of walking robots take, and how far the condensed WBC is from the WBC QP at the same states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from comparison.measure.thread_ticks import time_ticks_of_two
from comparison.measure.walking import Rows
from comparison.tables import Table, in_columns
from harpy_pin import Condensed, Scenario, WholeBody, build
from harpy_pin.model.state import Vector

__all__ = ["tick_table", "ticks_of"]

LATE = 2e3
"""Longest tick that is asked for, µs."""
POSTURE = 1e-9
"""Weight of the QP's posture task, which the condensed WBC has not: the smaller, the nearer are the two."""
_COLUMNS = {
    "condensed_us": ("condensed", "µs"),
    "condensed_worst_us": ("condensed, worst", "µs"),
    "qp_us": ("QP", "µs"),
    "qp_worst_us": ("QP, worst", "µs"),
    "late": ("over 2 ms", ""),
    "apart": ("apart", ""),
    "apart_99": ("apart, 99 %", ""),
    "apart_worst": ("apart, largest", ""),
}


def ticks_of(scenario: Scenario) -> dict[str, Any]:
    """Times of a walk under the condensed WBC and of the QP at its states, and how far their torques are apart."""
    qp = WholeBody(parameters={"weights": {"posture": POSTURE}})
    condensed, other = replace(scenario, controller=Condensed()), replace(scenario, controller=qp)
    times, apart = time_ticks_of_two(build(condensed), build(other))
    return {**_times("condensed", times[:, 0]), **_times("qp", times[:, 1]), "late": int((times > LATE).sum())} | {
        "apart": float(np.median(apart)),
        "apart_99": float(np.quantile(apart, 0.99)),
        "apart_worst": float(apart.max()),
    }


def _times(name: str, times: Vector) -> dict[str, float]:
    return {f"{name}_us": float(np.median(times)), f"{name}_worst_us": float(times.max())}


def tick_table(rows: Rows) -> Table:
    """A row for each robot."""
    cells = [cell for row in rows for cell in in_columns(row["robot"], row, _COLUMNS)]
    note = (
        "On the course at friction 0.8, every tick called from Python, in time of the thread: medians and worst. "
        "Apart: largest difference of the condensed WBC's torques from the QP's, over the largest torque."
    )
    return Table("walking_ticks", "Ticks", tuple(cells), note)
