"""The simulator: one physics step beside MuJoCo's, and whole walks beside the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from time import perf_counter, perf_counter_ns
from typing import Any

import numpy as np

from comparison.statistics import Laps, ratio_of_medians, summarise
from comparison.tables import Cell, Table
from comparison.ticks import make_everyone
from comparison.turns import Player, TimingSettings, counted, take_turns
from harpy_pin.control import make_controller
from harpy_pin.gait import make_gait
from harpy_pin.ground import Ground
from harpy_pin.profile import profile_run
from harpy_pin.robot import Robot
from harpy_pin.simulation import Simulator
from harpy_pin.state import Command

__all__ = ["WALKERS", "count_pieces", "simulator_tables", "time_simulator"]

DT = 5e-4
"""Physics step of both, s: the simulator's default."""

WALKERS = ("governed/none", "governed/paper", "governed/contact", "wbc")
"""Whose walks are timed as a whole."""


class _Ours:
    """Steps of the simulator, the robot standing under a joint PD that sways its height."""

    def __init__(self, robot: Robot, friction: float, steps: int) -> None:
        gait = make_gait(robot, speed=0.0)
        self.simulator = Simulator(robot, Ground(mu_s=friction), dt=DT)
        self.start = gait.initial_state(sink=self.simulator.static_sink)
        self.simulator.reset(*self.start)
        self.command = Command(np.zeros(6), np.zeros((2, 3)))
        self.laps: Laps = np.zeros(steps, dtype=np.int64)

    def play(self, begin: int, end: int) -> None:
        """See :class:`Player`."""
        simulator, command, posture = self.simulator, self.command, self.start[0][7:]
        for i in range(begin, min(end, len(self.laps))):
            command.torque[:] = 1000.0 * (posture + _sway(i) - simulator.q[7:]) - 5.0 * simulator.v[6:]
            t0 = perf_counter_ns()
            simulator.advance(command)
            t1 = perf_counter_ns()
            self.laps[i] = t1 - t0


class _MuJoCo:
    """Steps of MuJoCo: the same URDF, motion, step and friction; small spheres for feet, on a plane."""

    def __init__(self, robot: Robot, friction: float, steps: int) -> None:
        import mujoco

        self.step = mujoco.mj_step
        spec = mujoco.MjSpec.from_file(str(robot.urdf))
        spec.body("base").add_freejoint()
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5.0, 5.0, 0.1], friction=[friction, 0.0, 0.0])
        for name in robot.feet:
            frame = robot.model.frames[robot.frame_id(name)]
            joint = robot.model.names[frame.parentJoint]
            body = next(b for b in spec.bodies if any(j.name == joint for j in b.joints))
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[1e-3, 0.0, 0.0],
                pos=frame.placement.translation,
                mass=0.0,
                friction=[friction, 0.0, 0.0],
            )
        model = spec.compile()
        model.dof_armature[:] = robot.model.armature
        model.dof_damping[:] = robot.model.damping
        model.opt.timestep = DT
        self.model, self.data = model, mujoco.MjData(model)
        q, _ = make_gait(robot, speed=0.0).initial_state()
        self.data.qpos[:3] = q[:3]
        self.data.qpos[3:7] = q[6], q[3], q[4], q[5]
        self.data.qpos[7:] = q[7:]
        self.posture = q[7:].copy()
        self.laps: Laps = np.zeros(steps, dtype=np.int64)
        self.contacts = 0

    def play(self, begin: int, end: int) -> None:
        """See :class:`Player`."""
        step, model, data, posture = self.step, self.model, self.data, self.posture
        for i in range(begin, min(end, len(self.laps))):
            data.qfrc_applied[6:] = 1000.0 * (posture + _sway(i) - data.qpos[7:]) - 5.0 * data.qvel[6:]
            t0 = perf_counter_ns()
            step(model, data)
            t1 = perf_counter_ns()
            self.laps[i] = t1 - t0
            self.contacts += data.ncon


def _sway(step: int) -> Any:
    """Change of the joint targets, rad: hips and knees bend a little, once a second."""
    bend = 0.03 * np.sin(2.0 * np.pi * DT * step)
    return np.array([0.0, bend, -2.0 * bend, 0.0, bend, -2.0 * bend])


def count_pieces(settings: TimingSettings) -> int:
    """How often :func:`time_simulator` reports progress."""
    return settings.repetitions + len(WALKERS)


def time_simulator(
    robot: Robot,
    *,
    friction: float,
    duration: float,
    settings: TimingSettings,
    rng: np.random.Generator,
    on_piece: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Time physics steps and whole walks.

    Args:
        robot: who stands and walks.
        friction: of the ground, known to the controllers.
        duration: of a walk, s.
        settings: how to time.
        rng: draws the order of turns.
        on_piece: called after each pass and each walk.

    Returns:
        ``step``: of each engine percentiles, µs, or why it was not timed, and the ratio of the medians; ``walk``: how
        many times faster than real time each walk was (median, least and largest of three), and where the time of
        the walk of the paper's governor went, µs per tick.
    """
    laps: dict[str, list[Laps]] = {"ours": [], "MuJoCo": []}
    overheads, contacts = [], 0
    steps = settings.warm_up + 2 * settings.block
    present = find_spec("mujoco") is not None
    for _ in range(settings.repetitions):
        ours = _Ours(robot, friction, steps)
        peer = _MuJoCo(robot, friction, steps) if present else None
        players: list[Player] = [ours] if peer is None else [ours, peer]
        overheads.append(take_turns(players, steps, block=settings.block, rng=rng))
        laps["ours"].append(ours.laps[counted(steps, settings)])
        if peer is not None:
            laps["MuJoCo"].append(peer.laps[counted(steps, settings)])
            contacts = peer.contacts
        on_piece()
    overhead = float(np.median(overheads))
    step: dict[str, Any] = {"ours": summarise(laps["ours"], overhead)}
    if present:
        step["MuJoCo"] = {**summarise(laps["MuJoCo"], overhead), "contacts_mean": contacts / steps}
        step["ratio"] = ratio_of_medians(laps["ours"], laps["MuJoCo"], overhead)
    else:
        step["MuJoCo"] = {"absent": "mujoco is not installed: pip install -e '.[mujoco]'"}
    everyone = make_everyone(robot, friction)
    walk: dict[str, Any] = {}
    for name in WALKERS:
        controller, factors = everyone[name], []
        for _ in range(3):
            simulator = Simulator(robot, Ground(mu_s=friction), dt=DT)
            simulator.reset(*controller.gait.initial_state(sink=simulator.static_sink))
            controller.reset()
            begin = perf_counter()
            run = simulator.run(controller, duration)
            factors.append(len(run) * controller.period / (perf_counter() - begin))
        walk[name] = {"real_time": float(np.median(factors)), "low": min(factors), "high": max(factors)}
        on_piece()
    return {"step": step, "walk": walk, "profile": _profile(robot, friction, duration)}


def _profile(robot: Robot, friction: float, duration: float) -> dict[str, float]:
    gait = make_gait(robot)
    simulator = Simulator(robot, Ground(mu_s=friction), dt=DT)
    simulator.reset(*gait.initial_state(sink=simulator.static_sink))
    _, profile = profile_run(simulator, make_controller("governed", gait, mu=friction), duration)
    return {name: 1e6 * seconds / profile.ticks for name, seconds in profile.parts.items()}


def simulator_tables(entry: dict[str, Any], label: Callable[[str], str]) -> list[Table]:
    """The tables of :func:`time_simulator`.

    Args:
        entry: what it returned.
        label: a contender's name for readers.
    """
    step = entry["step"]
    columns = {"p50_us": "p50", "p95_us": "p95", "p99_us": "p99"}
    cells = [
        Cell(name, text, step[name].get(key), "µs") for name in ("ours", "MuJoCo") for key, text in columns.items()
    ]
    note = (
        f"The robot stands and sways; the same URDF, step ({1e3 * DT:g} ms) and friction, both called from Python. "
        "MuJoCo integrates semi-implicitly and solves its soft contact model; ours solves the compliant ground with "
        "Stribeck friction implicitly."
    )
    if "ratio" in step:
        ratio = step["ratio"]
        cells.append(Cell("ours / MuJoCo", "p50", ratio["p50"], "", ratio["min"], ratio["max"]))
    else:
        note += f" MuJoCo was not timed: {step['MuJoCo']['absent']}."
    walks = [
        Cell(label(name), "times real time", row["real_time"], "", row["low"], row["high"])
        for name, row in entry["walk"].items()
    ]
    parts = [Cell(name, "per tick", value, "µs") for name, value in entry["profile"].items()]
    return [
        Table("simulator_step", "One physics step of the full robot, µs", tuple(cells), note),
        Table("simulator_walk", "Closed-loop walks: simulated time over wall clock, log included", tuple(walks)),
        Table("simulator_profile", "Where the time of a walk goes, paper's governor, µs per tick", tuple(parts)),
    ]
