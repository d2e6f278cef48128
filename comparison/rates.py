"""How much one machine does in a second: walks, environment steps, whole-body optima, and a tick inside C."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from comparison.measure.walking import Progress, Rows, grouped
from comparison.tables import Table, in_columns
from harpy_pin import CondensedBatch, Ground, Stairs, checks, load_robot, make_gait
from harpy_pin.compiled.kernels import wait_for_all
from harpy_pin.gaits import Standing
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot, load_harpy
from harpy_pin.scenario import Scenario, build

__all__ = ["RatesSettings", "measure_rates", "rates_tables"]


GROUNDS = {
    "flat": Ground(mu_s=0.6),
    "up a slope of 10°": Ground(mu_s=0.6, slope=float(np.radians(10.0))),
    "up stairs": Ground(mu_s=0.6, terrain=Stairs(rise=0.05)),
}
TERRAIN_WALK = 10.0
"""Duration of a walk on one of them, s."""


@dataclass(frozen=True, kw_only=True)
class RatesSettings:
    """What is measured.

    Attributes:
        seconds: of each walk.
        robots: of the batches of optima, by name.
        size: robots of a batch, and environments.
        rounds: of each figure; the median is told, and the best.
        seed: of the actions, and of which states of a walk make a batch.
    """

    seconds: float = 60.0
    robots: tuple[str, ...] = ("harpy", "solo12", "g1")
    size: int = 4096
    rounds: int = 15
    seed: int = 0

    def __post_init__(self) -> None:
        checks.number("seconds", self.seconds, low=1.0)
        checks.whole("size", self.size, low=1)
        checks.whole("rounds", self.rounds, low=1)

    @classmethod
    def quick(cls) -> RatesSettings:
        """Harpy alone, a few rounds."""
        return cls(seconds=10.0, robots=("harpy",), size=1024, rounds=3)


def measure_rates(settings: RatesSettings, progress: Progress) -> Rows:
    """One row for each figure."""
    rows: Rows = []
    total = 3 + len(GROUNDS) + 2 * len(settings.robots)
    rows.append(_row("walk under the condensed controller, log included", "× real time", _real_time(settings)))
    progress(1, total)
    rows.append(
        _row("condensed controller's tick inside C, gait included", "µs", _ticks(_walk(settings.seconds)), least=True)
    )
    progress(2, total)
    for name, ticks in _ticks_on_terrain(settings).items():
        rows.append(_row(f"the same at friction 0.6, {name}", "µs", ticks, least=True))
        progress(len(rows), total)
    rows.append(_row("Gymnasium environments, all cores", "steps/s", _environments(settings)))
    progress(len(rows), total)
    for name in settings.robots:
        robot = load_harpy() if name == "harpy" else load_robot(name)
        for dtype in (np.float64, np.float32):
            rates = _optima(robot, dtype, settings)
            rows.append(_row(f"whole-body optima, {name}, {np.dtype(dtype).name}, all cores", "per second", rates))
            progress(len(rows), total)
    return rows


def rates_tables(rows: Rows) -> list[Table]:
    """The figures as a table for each unit."""
    note = "Of several rounds; other work on the machine lowers the medians."
    tables = []
    for (unit,), same in grouped(rows, "unit").items():
        columns = {name: (name, unit) for name in ("median", "best")}
        cells = [cell for row in same for cell in in_columns(row["what"], row, columns)]
        tables.append(Table("rates", f"Rates, {unit}", tuple(cells), note))
    return tables


def _row(what: str, unit: str, values: list[float], *, least: bool = False) -> dict[str, Any]:
    best = min(values) if least else max(values)
    return {"what": what, "unit": unit, "median": float(np.median(values)), "best": best}


def _walk(seconds: float) -> Run:
    return build(Scenario(controller="condensed", ground=Ground(mu_s=0.25), duration=seconds)).run()


def _real_time(settings: RatesSettings) -> list[float]:
    """Simulated seconds in a second of the clock."""
    rates = []
    _walk(1.0)
    wait_for_all()
    for _ in range(settings.rounds):
        begin = perf_counter()
        _walk(settings.seconds)
        rates.append(settings.seconds / (perf_counter() - begin))
    return rates


def _ticks(walk: Run) -> list[float]:
    """µs of each tick after the first second, of which a clock's reading is a part."""
    return [float(ns) * 1e-3 for ns in walk["tick_ns"][1000:]]


def _ticks_on_terrain(settings: RatesSettings) -> dict[str, list[float]]:
    """Likewise on each ground, one walk after the other in turn."""
    found: dict[str, list[float]] = {name: [] for name in GROUNDS}
    for _ in range(settings.rounds):
        for name, ground in GROUNDS.items():
            found[name] += _ticks(build(Scenario(ground=ground, duration=TERRAIN_WALK)).run())
    return found


def _environments(settings: RatesSettings) -> list[float]:
    """Steps a second of many environments under small random actions."""
    from harpy_pin.gym.batched_env import ACTIONS, BatchedEnv  # Gymnasium is an extra that only this figure needs

    worlds, random = BatchedEnv(settings.size), np.random.default_rng(settings.seed)
    idle, rates = np.zeros(settings.size, dtype=np.bool_), []
    for _ in range(settings.rounds + 1):
        action = random.uniform(-0.2, 0.2, (settings.size, ACTIONS))
        begin = perf_counter()
        worlds.step(action, idle)
        rates.append(settings.size / (perf_counter() - begin))
    worlds.close()
    return rates[1:]  # the first compiles


def _optima(robot: Robot, dtype: Any, settings: RatesSettings) -> list[float]:
    """Optima a second, at states of a walk or, of another robot, of standing with its weight shifted."""
    random, n = np.random.default_rng(settings.seed), settings.size
    batch = CondensedBatch(robot, n, dtype=dtype)
    if robot.name == "harpy":
        walk, gait = _walk(10.0), make_gait(robot, speed=0.3)
        chosen = random.integers(1000, len(walk), n)
        q, v, force = (walk[name][chosen].astype(dtype) for name in ("q", "v", "foot_force"))
        for i, row in enumerate(chosen):
            batch.targets.fill(gait.update(float(walk["t"][row])), i)
    else:
        standing = Standing(robot)
        q = np.tile(standing.initial_state()[0], (n, 1)).astype(dtype)
        q[:, 7:] += 0.02 * random.standard_normal((n, q.shape[1] - 7)).astype(dtype)
        v = 0.05 * random.standard_normal((n, robot.model.nv)).astype(dtype)
        force = np.zeros((n, len(robot.feet), 3), dtype)
        force[:, :, 2] = robot.mass * 9.81 / len(robot.feet)
    rates = []
    for _ in range(settings.rounds + 1):
        begin = perf_counter()
        batch.step(q, v, force)
        rates.append(n / (perf_counter() - begin))
    batch.close()
    return rates[1:]
