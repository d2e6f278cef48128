"""How late the ticks of a loop at 1 kHz begin and how long they take, minute after minute, and on what kernel."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.measure.machine import describe_machine
from comparison.measure.tick_replay import without_gc
from comparison.measure.walking import Progress, Rows
from comparison.tables import Cell, Table
from harpy_pin import Ground, InputError, checks
from harpy_pin.compiled.kernels import wait_for_all
from harpy_pin.scenario import Scenario, Walk, build

__all__ = ["JitterSettings", "jitter_tables", "measure_jitter"]

PERIOD, SPIN = 1_000_000, 150_000
"""Between deadlines, and how long before one the loop stops sleeping and polls the clock, ns."""
STEPS = 2
"""Physics steps in a period."""
EDGES = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000, 10_000_000)
"""Of the histogram, µs."""
MAX_SECONDS = 7200.0
"""Of a measurement, whose times are kept in memory."""


@dataclass(frozen=True, kw_only=True)
class JitterSettings:
    """What is measured.

    Attributes:
        seconds: of each loop.
        controllers: by name; each walks Harpy at friction 0.25.
        priority: of the loop under ``SCHED_FIFO``, 1 to 99; 0 leaves the scheduler as it is.
    """

    seconds: float = 600.0
    controllers: tuple[str, ...] = ("condensed", "wbc")
    priority: int = 0

    def __post_init__(self) -> None:
        checks.number("seconds", self.seconds, low=0.01, high=MAX_SECONDS)
        checks.whole("priority", self.priority, high=99)


def measure_jitter(settings: JitterSettings, progress: Progress) -> Rows:
    """One row for each controller: counts of its ticks by how late they began, and by how long they took.

    Raises:
        InputError: the system does not permit the priority, or is not Linux.
    """
    if not hasattr(os, "sched_setscheduler"):
        raise InputError("jitter is measured on Linux, whose scheduler it names", name="priority")
    rows = []
    for done, name in enumerate(settings.controllers):
        progress(done, len(settings.controllers))
        with _scheduled(settings.priority):  # before minutes are spent
            pass
        motion = build(Scenario(controller=name, ground=Ground(mu_s=0.25), duration=MAX_SECONDS))
        _tick(motion)
        wait_for_all()
        with _scheduled(settings.priority), without_gc():
            kernel = _kernel()
            late, took, missed = _loop(motion, round(settings.seconds * 1e9 / PERIOD))
        numbers = {"late": _summary(late), "took": _summary(took)}
        rows.append({"controller": name, "seconds": settings.seconds, "missed": missed, "kernel": kernel, **numbers})
    progress(len(rows), len(rows))
    return rows


def jitter_tables(rows: Rows) -> list[Table]:
    """The histogram, and its percentiles."""
    kinds = {"late": "late", "took": "tick"}
    bins = [f"{low} to {high} µs" for low, high in pairwise(EDGES)]
    counts, ends = [], []
    for row in rows:
        for kind, word in kinds.items():
            column = f"{row['controller']}, {word}"
            counts += [Cell(name, column, n) for name, n in zip(bins, row[kind]["counts"], strict=True)]
            ends += [Cell(column, name, row[kind][name], "µs") for name in ("median", "99.9 %", "most")]
        ends.append(Cell(f"{row['controller']}, late", "deadlines missed", row["missed"]))
    used = {cell.row for cell in counts if cell.value}
    first = rows[0]
    title = f"Ticks of a loop at 1 kHz over {first['seconds']:g} s each"
    note = f"Late: begin of a tick after its deadline. Tick: one step of the controller. {first['kernel']}."
    return [
        Table("jitter", f"{title}, count", tuple(cell for cell in counts if cell.row in used), note),
        Table("jitter_ends", f"{title}, µs", tuple(ends)),
    ]


def _tick(motion: Walk) -> None:
    """One tick of the controller, and the physics until the next."""
    motion.simulator.advance(motion.controller.step(motion.simulator.state), steps=STEPS)


def _loop(motion: Walk, periods: int) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """How late each tick began and how long the controller took, ns; and how many deadlines were missed."""
    simulator, controller, clock = motion.simulator, motion.controller, time.perf_counter_ns
    times = np.zeros((2, periods), dtype=np.int64)
    ticks = period = 0
    begin = clock() + 10 * PERIOD
    while period < periods:
        deadline = begin + period * PERIOD
        time.sleep(max(deadline - clock() - SPIN, 0) * 1e-9)
        while (now := clock()) < deadline:
            pass
        command = controller.step(simulator.state)
        times[0, ticks], times[1, ticks] = now - deadline, clock() - now
        simulator.advance(command, steps=STEPS)
        ticks += 1
        period += 1 + max((clock() - deadline) // PERIOD, 0)  # what has passed is not made up for
    return times[0, :ticks], times[1, :ticks], periods - ticks


def _summary(times: NDArray[np.int64]) -> dict[str, Any]:
    """Counts in the histogram, and percentiles in µs."""
    values = times * 1e-3
    median, high, most = np.percentile(values, (50.0, 99.9, 100.0))
    counts = np.histogram(values, EDGES)[0].tolist()
    return {"counts": counts, "median": median, "99.9 %": high, "most": most}


@contextmanager
def _scheduled(priority: int) -> Iterator[None]:
    """Run under ``SCHED_FIFO``."""
    if not priority:
        yield
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        message = f"the system does not permit priority {priority} under SCHED_FIFO: {error.strerror}"
        raise InputError(message, name="priority", value=priority) from error
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


def _kernel() -> str:
    """The state of the operating system's kernel that decides how late the latest ticks are."""
    machine = describe_machine()
    policies = {os.SCHED_OTHER: "SCHED_OTHER", os.SCHED_FIFO: f"SCHED_FIFO {os.sched_getparam(0).sched_priority}"}
    cpu = Path("/sys/devices/system/cpu")
    governor = _first_line(cpu / "cpu0/cpufreq/scaling_governor") or "none visible"
    return (
        f"{machine['os']} ({platform.version()}), {machine['cpu']}, {machine['cores']} cores, "
        f"{policies.get(os.sched_getscheduler(0), 'another scheduler')}, frequency governor: {governor}, "
        f"isolated cores: {_first_line(cpu / 'isolated') or 'none'}, load at the begin {machine['load_1min']:.1f}"
    )


def _first_line(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except OSError:
        return ""
