"""The simulator: one physics step beside MuJoCo's, and whole walks beside the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns, process_time_ns
from typing import Any

import numpy as np

from comparison.contenders import CONTENDERS
from comparison.measure.controllers import scenario_of
from comparison.measure.interleave import Bench, TimingSettings, interleave
from comparison.measure.statistics import Laps, ratio_of_medians, summarise
from comparison.tables import Cell, Table
from harpy_pin.log.run import Run
from harpy_pin.model.state import Command, Vector
from harpy_pin.scenario import build
from harpy_pin.simulation.mujoco import MujocoModel, installed_version
from harpy_pin.simulation.plant import Plant
from harpy_pin.simulation.profile import Profiler

__all__ = ["WALKERS", "count_pieces", "simulator_tables", "time_simulator"]

BLOCK = 20
"""Ticks per block: both simulators start from the recorded state and hold the recorded commands."""
SETTLE = 4
"""Steps at the start of each block that are not counted: contact solvers and caches are cold."""
STEPPED = 2.0
"""Longest walk whose states and commands are stepped through, s."""
FOOT_RADIUS = 5e-3
"""Of the spheres that stand for the point feet in MuJoCo, m; the plane lies as much lower."""
WALKS = 3
"""Walks of each controller beside the wall clock."""
WALKERS = CONTENDERS
"""Controllers whose walks are timed as a whole."""
ABSENT = "mujoco is not installed: pip install -e '.[mujoco]'"

NOTE = (
    "Both step through the same recorded walk, interleaved in blocks of 20 ticks: same bodies, armature, joint "
    "damping, step, states and commands, called from Python. Setting torques and thrusts is part of our time (an "
    "argument) and not of MuJoCo's. Ours: point feet, a spring with a one-sided damper, Stribeck friction in Coulomb's "
    "disc, exact stick, Gauss–Seidel; it ends with the terms of the next state, which the controller needs. MuJoCo: "
    "spheres of 5 mm, its default soft contact, friction pyramid, Newton, semi-implicit Euler; without joint limits "
    "and visual geometry. Deviation: of the body from the recorded walk at the end of a block."
)


class _Ours:
    """Steps of the simulator through a recorded walk."""

    def __init__(self, simulator: Plant, run: Run) -> None:
        self.simulator = simulator
        self.steps = _Steps(run, simulator.dt)

    def time_block(self, begin: int, end: int) -> None:
        """See :class:`comparison.measure.interleave.Timed`."""
        simulator, steps = self.simulator, self.steps
        advance = simulator.advance
        simulator.reset(*steps.state(begin))
        for tick in range(begin, min(end, len(steps))):
            command, laps = steps.command(tick), steps.laps[tick]
            for i in range(len(laps)):
                t0 = perf_counter_ns()
                advance(command)
                t1 = perf_counter_ns()
                laps[i] = t1 - t0
            steps.contacts[tick] = np.count_nonzero(simulator.state.foot_force[:, 2])
        steps.compare(end, simulator.q)


class _MuJoCo:
    """Steps of MuJoCo through a recorded walk."""

    def __init__(self, peer: MujocoModel, run: Run, dt: float) -> None:
        import mujoco

        self.peer = peer
        self.step: Callable[[Any, Any], None] = mujoco.mj_step
        self.steps = _Steps(run, dt)

    def time_block(self, begin: int, end: int) -> None:
        """See :class:`comparison.measure.interleave.Timed`."""
        peer, steps = self.peer, self.steps
        step, model, data = self.step, peer.model, peer.data
        peer.reset(*steps.state(begin))
        for tick in range(begin, min(end, len(steps))):
            command = steps.command(tick)
            peer.apply(command.torque, command.thrust)
            laps = steps.laps[tick]
            for i in range(len(laps)):
                t0 = perf_counter_ns()
                step(model, data)
                t1 = perf_counter_ns()
                laps[i] = t1 - t0
            steps.contacts[tick] = data.ncon
        steps.compare(end, data.qpos)


class _Steps:
    """A recorded walk, and the results of stepping through it.

    Attributes:
        laps: (ticks, steps per tick) ns.
        contacts: (ticks,) feet that touch the ground at the end of a tick.
        deviation: largest distance of the body from the recorded one at the end of a block, along any axis, m.
    """

    def __init__(self, run: Run, dt: float) -> None:
        self.run = run
        self.laps: Laps = np.zeros((len(run), round(run.metadata["control_period"] / dt)), dtype=np.int64)
        self.contacts = np.zeros(len(run), dtype=np.int64)
        self.deviation = 0.0

    def __len__(self) -> int:
        return len(self.run)

    def state(self, tick: int) -> tuple[Vector, Vector]:
        """Configuration and velocity at a tick."""
        return self.run["q"][tick], self.run["v"][tick]

    def command(self, tick: int) -> Command:
        """What was commanded at a tick."""
        return Command(self.run["torque"][tick], self.run["thrust"][tick])

    def compare(self, tick: int, q: Vector) -> None:
        """Compare a configuration with that of a tick, where the walk lasted so long."""
        if tick < len(self):
            self.deviation = max(self.deviation, float(np.abs(q[:3] - self.run["q"][tick, :3]).max()))

    def counted(self) -> Laps:
        """The times that count."""
        step = np.arange(self.laps.size) % (BLOCK * self.laps.shape[1])
        laps: Laps = self.laps.ravel()[step >= SETTLE]
        return laps


def count_pieces(settings: TimingSettings) -> int:
    """How often :func:`time_simulator` reports progress."""
    return settings.repetitions + WALKS * len(WALKERS)


def time_simulator(bench: Bench, *, duration: float) -> dict[str, Any]:
    """Time physics steps and whole walks.

    Args:
        bench: its friction is that of the ground, known to the controllers; its ``on_pass`` is called after each
            walk, too.
        duration: of a walk, s.

    Returns:
        ``step``: of each engine percentiles, µs, or why it was not timed, and the ratio of the medians; ``walk``: how
        many times faster than real time each walk was (median, least and largest of three; and by processor time,
        which other processes disturb less), and how it ended; ``profile``: where the time of the walk of the paper's
        governor went, µs per tick.
    """
    return {
        "step": _time_steps(bench, min(duration, STEPPED)),
        "walk": _time_walks(bench, duration),
        "profile": _profile(bench.friction, duration),
    }


def _time_steps(bench: Bench, duration: float) -> dict[str, Any]:
    friction = bench.friction
    walk = build(scenario_of("governed/paper", friction, duration=duration))
    simulator, run = walk.simulator, walk.run()
    version = installed_version()
    timed: dict[str, _Ours | _MuJoCo] = {"ours": _Ours(simulator, run)}
    if version is not None:
        peer = MujocoModel(
            bench.robot, friction=friction, dt=simulator.dt, gravity=simulator.gravity, foot_radius=FOOT_RADIUS
        )
        timed["MuJoCo"] = _MuJoCo(peer, run, simulator.dt)
    laps: dict[str, list[Laps]] = {name: [] for name in timed}
    overheads = []
    for _ in range(bench.settings.repetitions):
        overheads.append(interleave(list(timed.values()), len(run), block=BLOCK, rng=bench.rng))
        for name, timer in timed.items():
            laps[name].append(timer.steps.counted())
        bench.on_pass()
    overhead = float(np.median(overheads))
    step: dict[str, Any] = {"dt_s": simulator.dt, "friction": friction}
    for name, timer in timed.items():
        step[name] = {
            **summarise(laps[name], overhead),
            "contacts_mean": float(timer.steps.contacts.mean()),
            "deviation_mm": 1e3 * timer.steps.deviation,
        }
    if version is None:
        return step | {"MuJoCo": {"absent": ABSENT}}
    step["MuJoCo"]["version"] = version
    return step | {"ratio": ratio_of_medians(laps["ours"], laps["MuJoCo"], overhead)}


def _time_walks(bench: Bench, duration: float) -> dict[str, Any]:
    for name in WALKERS:
        build(scenario_of(name, bench.friction, duration=0.02)).run()  # loads what is compiled
    wall: dict[str, list[float]] = {name: [] for name in WALKERS}
    processor: dict[str, list[float]] = {name: [] for name in WALKERS}
    endings: dict[str, str] = {}
    for _ in range(WALKS):
        for k in bench.rng.permutation(len(WALKERS)):
            name = WALKERS[int(k)]
            walk = build(scenario_of(name, bench.friction, duration=duration))
            begin, begin_busy = perf_counter_ns(), process_time_ns()
            run = walk.run()
            busy, elapsed = process_time_ns() - begin_busy, perf_counter_ns() - begin
            wall[name].append(1e9 * run.metadata["end_time"] / elapsed)
            processor[name].append(1e9 * run.metadata["end_time"] / max(busy, 1))
            endings[name] = run.ending
            bench.on_pass()
    return {
        name: {
            "real_time": float(np.median(wall[name])),
            "low": min(wall[name]),
            "high": max(wall[name]),
            "processor_time": float(np.median(processor[name])),
            "ending": endings[name],
        }
        for name in WALKERS
    }


def _profile(friction: float, duration: float) -> dict[str, float]:
    walk = build(scenario_of("governed/paper", friction, duration=duration))
    with Profiler(walk.simulator) as profiler:
        run = walk.run()
    profile = profiler.profile(run)
    return {part.name: 1e6 * part.seconds / profile.ticks for part in profile.parts}


def simulator_tables(entry: dict[str, Any], label: Callable[[str], str]) -> list[Table]:
    """The tables of :func:`time_simulator`.

    Args:
        entry: what it returned.
        label: a contender's name for readers.
    """
    step, note = entry["step"], NOTE
    cells: list[Cell] = []
    for name in ("ours", "MuJoCo"):
        found = step[name]
        cells += [Cell(name, text, found.get(f"{text}_us"), "µs") for text in ("p50", "p95", "p99")]
        cells.append(Cell(name, "feet in contact", found.get("contacts_mean")))
        cells.append(Cell(name, "deviation", found.get("deviation_mm"), "mm"))
    if "ratio" in step:
        ratio = step["ratio"]
        cells.append(Cell("ours / MuJoCo", "p50", ratio["p50"], "", ratio["min"], ratio["max"]))
        note += f" MuJoCo {step['MuJoCo']['version']}."
    else:
        note += f" MuJoCo was not timed: {step['MuJoCo']['absent']}."
    title = f"One physics step of {1e3 * step['dt_s']:g} ms of the full robot, µs, friction {step['friction']:g}"
    walks: list[Cell] = []
    for name, row in entry["walk"].items():
        walks.append(Cell(label(name), "times real time", row["real_time"], "", row["low"], row["high"]))
        walks.append(Cell(label(name), "by processor time", row["processor_time"]))
        walks.append(Cell(label(name), "ending", row["ending"]))
    parts = [Cell(name, "per tick", value, "µs") for name, value in entry["profile"].items()]
    return [
        Table("simulator_step", title, tuple(cells), note),
        Table(
            "simulator_walk",
            "Closed-loop walks: simulated time over wall clock, log included",
            tuple(walks),
            "Median of three; in brackets the slowest and the fastest.",
        ),
        Table("simulator_profile", "Where the time of a walk goes, paper's governor, µs per tick", tuple(parts)),
    ]
