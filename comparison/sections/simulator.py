"""The simulator: whole walks beside the wall clock."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter_ns, process_time_ns
from typing import Any

import numpy as np

from comparison.contenders import CONTENDERS, label
from comparison.measure.controllers import scenario_of
from comparison.measure.timing import Bench
from comparison.tables import Cell, Table
from harpy_pin.scenario import build

WALKERS = CONTENDERS
"""Controllers whose walks are timed as a whole."""

WALKS = 3
"""Walks of each controller beside the wall clock."""


def time_simulator(bench: Bench, *, duration: float) -> dict[str, Any]:
    """Time whole walks on ground of the bench's friction, known to the controllers; the duration is in s.

    Returns:
        By ``walk`` of each controller how many times faster than real time it was (median, least and largest of three;
        and by processor time, which other processes disturb less), and how it ended.
    """
    found: dict[str, list[tuple[float, float, str]]] = {name: [] for name in WALKERS}
    for name in WALKERS:
        build(scenario_of(name, bench.friction, duration=0.02)).run()  # loads what is compiled
    for _ in range(WALKS):
        for k in bench.rng.permutation(len(WALKERS)):
            name = WALKERS[int(k)]
            walk = build(scenario_of(name, bench.friction, duration=duration))
            begin, begin_busy = perf_counter_ns(), process_time_ns()
            run = walk.run()
            busy, elapsed = process_time_ns() - begin_busy, perf_counter_ns() - begin
            end = 1e9 * run.metadata["end_time"]
            found[name].append((end / elapsed, end / max(busy, 1), run.ending))
            bench.on_pass()
    walks = {}
    for name, rows in found.items():
        wall, processor, endings = zip(*rows, strict=True)
        times = {"real_time": float(np.median(wall)), "low": min(wall), "high": max(wall)}
        walks[name] = {**times, "processor_time": float(np.median(processor)), "ending": endings[-1]}
    return {"walk": walks}


def simulator_table(entry: Mapping[str, Any]) -> Table:
    """The table of :func:`time_simulator`."""
    cells: list[Cell] = []
    for name, row in entry["walk"].items():
        cells.append(Cell(label(name), "times real time", row["real_time"], "", row["low"], row["high"]))
        cells.append(Cell(label(name), "by processor time", row["processor_time"]))
        cells.append(Cell(label(name), "ending", row["ending"]))
    title = "Closed-loop walks: simulated time over wall clock, log included"
    note = "Median of three; in brackets the slowest and the fastest."
    return Table("simulator_walk", title, tuple(cells), note)
