"""The complete tick of every controller and governor, interleaved on the same states.

The states are those of walks with pushes: touchdowns, recoveries, ticks where constraints are active.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter_ns
from typing import Any

import numpy as np

from comparison.contenders import CONTENDERS, FORCES, controller_part, label
from comparison.measure.replay import TickReplay
from comparison.measure.states import StateSequence
from comparison.measure.timing import Bench, Laps, summarise, summarise_repetitions
from comparison.tables import Cell, Table, in_columns, percentiles
from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.gaits import make_gait
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State
from harpy_pin.wbc import WholeBodyLimits, installed_solvers

RATES = (1, 2, 5, 10)
"""Control rates, kHz, whose periods a tick may miss."""

COLD = 200
"""Ticks right after a reset that are timed."""


def make_all(robot: Robot, friction: float) -> dict[str, Any]:
    """Every controller and governor of the campaign, the QP in contact forces, and QPs that reuse no active set."""
    made = {
        name: controller_part(name).make(make_gait(robot), mu=friction, period=1e-3, fitting={}) for name in CONTENDERS
    }
    programs: dict[str, dict[str, Any]] = {FORCES: {"formulation": "contact_force"}}
    for solver in (name for name in ("proxqp", "daqp") if name in installed_solvers()):
        programs[f"wbc/{solver}"] = {"solver": solver, "reuse": False}
    for name, settings in programs.items():
        parameters = WholeBodyParameters(limits=WholeBodyLimits(mu=friction), **settings)
        made[name] = WholeBodyController(make_gait(robot), parameters)
    return made


def time_ticks(bench: Bench, sequences: Sequence[StateSequence]) -> dict[str, Any]:
    """Time the complete tick of every controller.

    Returns:
        For each contender percentiles, µs, the least and largest median of a repetition, how many ticks were longer
        than the periods of :data:`RATES`, and the ticks right after a reset.
    """
    timed = {name: TickReplay(controller) for name, controller in make_all(bench.robot, bench.friction).items()}

    def start(k: int) -> dict[str, TickReplay]:
        for timer in timed.values():
            timer.start(sequences[k].states)
        return timed

    laps, overhead = bench.repeat(start, [len(sequence) for sequence in sequences], block=bench.settings.block)
    result: dict[str, Any] = {}
    for name, timer in timed.items():
        times = np.maximum(np.concatenate(laps[name])[:, 0] - overhead, 1.0) * 1e-3
        cold = summarise([_first_ticks(timer.controller, sequences[0].states)], overhead)
        result[name] = {
            **summarise_repetitions(laps[name], overhead),
            "misses": {f"{rate} kHz": int(np.count_nonzero(times > 1e3 / rate)) for rate in RATES},
            "cold_p50_us": cold["p50_us"],
            "cold_p99_us": cold["p99_us"],
        }
    return result


def _first_ticks(controller: Any, states: Sequence[State]) -> Laps:
    """Times of ticks right after a reset, ns: no warm start, no active set, no applied reference."""
    chosen = np.linspace(0, len(states) - 1, min(COLD, len(states))).astype(int)
    laps = np.zeros(len(chosen), dtype=np.int64)
    for k, i in enumerate(chosen):
        controller.reset()
        begin = perf_counter_ns()
        controller.step(states[i])
        laps[k] = perf_counter_ns() - begin
    return laps


def ticks_tables(ticks: Mapping[str, Any]) -> list[Table]:
    """Percentiles of every controller, its missed deadlines, and its ticks after a reset."""
    times: list[Cell] = []
    misses: list[Cell] = []
    for name, entry in ticks["contenders"].items():
        row = label(name)
        times.append(Cell(row, "p50", entry["p50_us"], "µs", entry["low_us"], entry["high_us"]))
        times += percentiles(row, entry, first="p95_us")
        misses.append(Cell(row, "ticks", entry["samples"]))
        misses += [Cell(row, f"missed, {rate}", count) for rate, count in entry["misses"].items()]
        misses += in_columns(row, entry, {f"cold_{p}_us": (f"after a reset, {p}", "µs") for p in ("p50", "p99")})
    friction = ticks["friction"]
    title = f"Complete tick of every controller, µs, friction {friction:g}, pushes of {ticks['impulse']:g} N·s"
    of_misses = (
        "How many ticks took longer than the period of a control rate; no core is reserved and Python is not real-time."
    )
    return [
        Table("ticks", title, tuple(times), "In brackets: least and largest median of a repetition."),
        Table("misses", f"Deadlines and cold ticks, friction {friction:g}", tuple(misses), of_misses),
    ]
