"""What every robot does, a row for each: its walks under one controller."""

from __future__ import annotations

import numpy as np

from comparison.contenders import label
from comparison.measure.walking import Rows, grouped
from comparison.tables import Cell, Table

__all__ = ["slip_and_falls", "summary_tables"]

COURSES = {"course": "course", "friction 0.3": "course, friction 0.3", "ten metres": "ten metres"}
"""Columns of courses, which are walked in both engines."""
WALKS = {
    "friction 0.1": ("friction 0.1",),
    "crawl, pace, bound": ("crawl", "pace", "bound"),
    "random": ("random",),
    "noise and delay": ("random, noise and delay",),
    "pushed": ("pushed",),
}
"""Columns of what is walked in the compliant plant, and what each holds."""


def summary_tables(rows: Rows) -> list[Table]:
    """A table for each controller: its slip per step, and how many of its walks fall."""
    note = "Slip, mm per step, the median of the walks; of courses in the compliant plant and in MuJoCo. Off path: rms."
    tables = []
    for (controller,), walks in grouped(rows, "controller").items():
        cells = [cell for (robot,), own in grouped(walks, "robot").items() for cell in _cells(str(robot), own)]
        tables.append(Table(f"walks_{controller}", f"Walks, {label(controller)}", tuple(cells), note))
    return tables


def _cells(robot: str, rows: Rows) -> list[Cell]:
    """The row of a robot."""
    by = {(what, plant): walks for (what, plant), walks in grouped(rows, "what", "plant").items()}
    plants = list(dict.fromkeys(row["plant"] for row in rows))
    cells = [Cell(robot, "speed", max(row["speed_m_s"] for row in rows), "m/s")]
    for column, what in COURSES.items():
        if column == "ten metres" and (what, plants[0]) not in by:
            continue
        cells.append(Cell(robot, column, " / ".join(slip_and_falls(by.get((what, plant), [])) for plant in plants)))
    course = by.get(("course", plants[0]), [])
    cells += [Cell(robot, "off path", row["path_rms_mm"], "mm") for row in course]
    for column, kinds in WALKS.items():
        told = [slip_and_falls(by[what, plants[0]]) for what in kinds if (what, plants[0]) in by]
        if told:
            cells.append(Cell(robot, column, ", ".join(told)))
    return cells


def slip_and_falls(rows: Rows) -> str:
    """Median slip per step, and the falls if there are any."""
    if not rows:
        return "–"
    fell = sum(row["fell"] for row in rows)
    if len(rows) == 1 and fell:
        return "falls"
    slip = f"{np.median([row['slip_mm_per_step'] for row in rows]):.2f}"
    return f"{slip}, {fell} of {len(rows)} fall{'s' if fell == 1 else ''}" if fell else slip
