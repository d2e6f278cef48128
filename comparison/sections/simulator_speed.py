"""The simulator: one physics step beside MuJoCo's, and whole walks beside the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter_ns, process_time_ns
from typing import Any, NamedTuple

import numpy as np

from comparison.contenders import CONTENDERS, label
from comparison.measure.controllers import scenario_of
from comparison.measure.interleave import Bench, TimingSettings
from comparison.measure.statistics import Laps, ratio_of_medians, summarise
from comparison.tables import Cell, Table, in_columns
from harpy_pin.log.run import Run
from harpy_pin.model.state import Command, Vector
from harpy_pin.scenario import build
from harpy_pin.simulation.mujoco import MujocoModel, installed_version
from harpy_pin.simulation.plant import Plant
from harpy_pin.simulation.profile import Profiler

__all__ = ["WALKERS", "count_pieces", "simulator_tables", "time_simulator"]

_STEP = {
    **{f"{text}_us": (text, "µs") for text in ("p50", "p95", "p99")},
    "contacts_mean": ("feet in contact", ""),
    "deviation_mm": ("deviation", "mm"),
}
BLOCK = 20
"""Ticks per block: both simulators start from the recorded state and hold the recorded commands."""
SETTLE = 2
"""Ticks at the start of each block that are not counted: contact solvers and caches are cold."""
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


class _Engine(NamedTuple):
    """What steps.

    Attributes:
        reset: to a configuration and velocity.
        hold: takes a command, and gives the arguments of a step under it.
        step: does one step.
        contacts: feet that touch the ground.
        q: configuration.
    """

    reset: Callable[[Vector, Vector], None]
    hold: Callable[[Command], tuple[Any, ...]]
    step: Callable[..., Any]
    contacts: Callable[[], int]
    q: Callable[[], Vector]


def _ours(simulator: Plant) -> _Engine:
    return _Engine(
        reset=simulator.reset,
        hold=lambda command: (command,),
        step=simulator.advance,
        contacts=lambda: int(np.count_nonzero(simulator.state.foot_force[:, 2])),
        q=lambda: simulator.q,
    )


def _mujoco(peer: MujocoModel) -> _Engine:
    import mujoco

    def hold(command: Command) -> tuple[Any, ...]:
        peer.apply(command.torque, command.thrust)
        return peer.model, peer.data

    return _Engine(peer.reset, hold, mujoco.mj_step, lambda: peer.data.ncon, lambda: peer.data.qpos)


class _Steps:
    """Times an engine's steps through a recorded walk.

    Attributes:
        laps: (ticks, steps per tick) ns.
        contacts: (ticks,) feet that touch the ground at the end of a tick.
        deviation: largest distance of the body from the recorded one at the end of a block, along any axis, m.
    """

    def __init__(self, engine: _Engine, run: Run, dt: float) -> None:
        self.engine, self.run = engine, run
        self.laps: Laps = np.zeros((len(run), round(run.metadata["control_period"] / dt)), dtype=np.int64)
        self.contacts = np.zeros(len(run), dtype=np.int64)
        self.deviation = 0.0

    def time_block(self, begin: int, end: int) -> None:
        """See :class:`comparison.measure.interleave.Timed`."""
        engine, run, step = self.engine, self.run, self.engine.step
        engine.reset(run["q"][begin], run["v"][begin])
        for tick in range(begin, min(end, len(run))):
            arguments, laps = engine.hold(Command(run["torque"][tick], run["thrust"][tick])), self.laps[tick]
            for i in range(len(laps)):
                t0 = perf_counter_ns()
                step(*arguments)
                t1 = perf_counter_ns()
                laps[i] = t1 - t0
            self.contacts[tick] = engine.contacts()
        if end < len(run):
            self.deviation = max(self.deviation, float(np.abs(engine.q()[:3] - run["q"][end, :3]).max()))


def count_pieces(settings: TimingSettings) -> int:
    """How often :func:`time_simulator` reports progress."""
    return settings.repetitions + WALKS * len(WALKERS)


def time_simulator(bench: Bench, *, duration: float) -> dict[str, Any]:
    """Time physics steps and whole walks.

    The bench's friction is that of the ground, known to the controllers. The duration of a walk is in s.

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
    timed = {"ours": _Steps(_ours(simulator), run, simulator.dt)}
    if version is not None:
        peer = MujocoModel(
            bench.robot, friction=friction, dt=simulator.dt, gravity=simulator.gravity, foot_radius=FOOT_RADIUS
        )
        timed["MuJoCo"] = _Steps(_mujoco(peer), run, simulator.dt)
    every_block = replace(bench, settings=replace(bench.settings, warm_up=0, settle=SETTLE))
    laps, overhead = every_block.repeat(lambda _: timed, [len(run)], block=BLOCK)
    step: dict[str, Any] = {"dt_s": simulator.dt, "friction": friction}
    for name, timer in timed.items():
        step[name] = {
            **summarise([part.ravel() for part in laps[name]], overhead),
            "contacts_mean": float(timer.contacts.mean()),
            "deviation_mm": 1e3 * timer.deviation,
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


def simulator_tables(entry: dict[str, Any]) -> list[Table]:
    """The tables of :func:`time_simulator`."""
    step, note = entry["step"], NOTE
    cells: list[Cell] = []
    for name in ("ours", "MuJoCo"):
        cells += in_columns(name, step[name], _STEP)
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
