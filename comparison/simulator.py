"""The simulator: one physics step beside MuJoCo's, and closed-loop walks beside the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter_ns, process_time_ns
from typing import Any, Protocol

import numpy as np

from comparison.campaign.plan import contenders
from comparison.mujoco_peer import MujocoPeer, mujoco_version
from comparison.replay import timer_overhead, without_gc
from comparison.statistics import Laps, ratio_of_medians, summarise
from harpy_pin.control import GovernedController, WholeBodyController, make_controller
from harpy_pin.gait import make_gait
from harpy_pin.ground import Ground
from harpy_pin.robot import Robot
from harpy_pin.run import Run
from harpy_pin.simulation import Simulator
from harpy_pin.state import Command, Vector

__all__ = ["BLOCK", "NOTES", "count_turns", "measure_simulator"]

BLOCK = 20
"""Ticks per turn: both simulators start from the recorded state and hold the recorded commands."""
SETTLE = 4
"""Steps at the start of each turn that are not counted: contact solvers start cold, and caches are another's."""
STEPPED = 2.0
"""Longest walk whose states and commands are stepped through, s."""
WALKED = 4.0
"""Longest walk beside the wall clock, s."""
WALKS = 3
"""Walks of each controller beside the wall clock."""

NOTES = (
    "Both steps are called from Python on the same URDF, armature, joint damping, states and commands, at the same "
    "step; setting torques and thrusts is part of ours (its argument) and not of MuJoCo's time.",
    "Ours: point feet, normal force of a spring with a one-sided damper, Stribeck friction in Coulomb's disc, exact "
    "stick, Gauss–Seidel. MuJoCo: spheres of 5 mm at the feet, its default soft contact, friction pyramid without "
    "Stribeck effect, Newton solver, semi-implicit Euler; no joint limits in either.",
    "MuJoCo's step leaves the next state's terms to the next step; ours ends by evaluating them, for the controller.",
)


class _Stepper(Protocol):
    """A simulator that takes turns."""

    def reset(self, q: Vector, v: Vector) -> None: ...

    def step(self, command: Command, laps: Laps) -> None:
        """As many steps as there are laps, each timed."""
        ...

    def feet_in_contact(self) -> int: ...

    def position(self) -> Vector: ...


class _Ours:
    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator

    def reset(self, q: Vector, v: Vector) -> None:
        self.simulator.reset(q, v)

    def step(self, command: Command, laps: Laps) -> None:
        advance = self.simulator.advance
        for i in range(len(laps)):
            begin = perf_counter_ns()
            advance(command)
            laps[i] = perf_counter_ns() - begin

    def feet_in_contact(self) -> int:
        return int(np.count_nonzero(self.simulator.state.foot_force[:, 2] > 0.0))

    def position(self) -> Vector:
        return self.simulator.q[:3]


class _Mujoco:
    def __init__(self, peer: MujocoPeer) -> None:
        import mujoco

        self.peer = peer
        self._mj_step: Callable[[Any, Any], None] = mujoco.mj_step

    def reset(self, q: Vector, v: Vector) -> None:
        self.peer.reset(q, v)

    def step(self, command: Command, laps: Laps) -> None:
        self.peer.apply(command)
        mj_step, model, data = self._mj_step, self.peer.model, self.peer.data
        for i in range(len(laps)):
            begin = perf_counter_ns()
            mj_step(model, data)
            laps[i] = perf_counter_ns() - begin

    def feet_in_contact(self) -> int:
        return int(self.peer.data.ncon)

    def position(self) -> Vector:
        return np.asarray(self.peer.data.qpos[:3])


@dataclass
class _Steps:
    """What one simulator's turns gave."""

    laps: list[Laps] = field(default_factory=list)
    deviation: float = 0.0
    contacts: list[int] = field(default_factory=list)


def count_turns(repetitions: int) -> int:
    """How often :func:`measure_simulator` reports progress."""
    return repetitions + WALKS * len(contenders())


def measure_simulator(
    robot: Robot,
    *,
    friction: float,
    duration: float,
    repetitions: int,
    rng: np.random.Generator,
    on_turn: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Time the physics step, and walks in closed loop.

    Args:
        robot: who walks.
        friction: of the ground, known to the controllers.
        duration: longest walk, s.
        repetitions: of the pass through the steps.
        rng: draws the order of turns.
        on_turn: called after each repetition and each walk, never while the clock runs.

    Returns:
        ``step``: percentiles of ours and MuJoCo's, µs, and their ratio; ``walks``: simulated over elapsed time of each
        controller.
    """
    return {
        "friction": friction,
        "step": _time_steps(robot, friction, min(duration, STEPPED), repetitions, rng, on_turn),
        "walks": _time_walks(robot, friction, min(duration, WALKED), rng, on_turn),
        "notes": list(NOTES),
    }


def _make(
    robot: Robot, friction: float, controller: str = "governed", governor: str = "paper"
) -> tuple[Simulator, GovernedController | WholeBodyController]:
    gait = make_gait(robot)
    simulator = Simulator(robot, Ground(mu_s=friction))
    simulator.reset(*gait.initial_state(sink=simulator.static_sink))
    return simulator, make_controller(controller, gait, mu=friction, governor=governor)


def _time_steps(
    robot: Robot,
    friction: float,
    duration: float,
    repetitions: int,
    rng: np.random.Generator,
    on_turn: Callable[[], None],
) -> dict[str, Any]:
    simulator, controller = _make(robot, friction)
    run = simulator.run(controller, duration)
    steppers: dict[str, _Stepper] = {"harpy_pin": _Ours(simulator)}
    installed = mujoco_version()
    if installed is not None:
        steppers["mujoco"] = _Mujoco(MujocoPeer(robot, friction=friction, dt=simulator.dt))
    names = list(steppers)
    found = {name: _Steps() for name in names}
    substeps = round(run.metadata["control_period"] / simulator.dt)
    overheads = []
    for _ in range(repetitions):
        taken: dict[str, list[Laps]] = {name: [] for name in names}
        with without_gc():
            overheads.append(timer_overhead())
            for begin in range(0, len(run), BLOCK):
                for k in rng.permutation(len(names)):
                    name = names[int(k)]
                    taken[name].append(_play(steppers[name], run, begin, substeps, found[name]))
        for name in names:
            found[name].laps.append(np.concatenate(taken[name]))
        on_turn()
    overhead = float(np.median(overheads))
    result: dict[str, Any] = {"dt_s": simulator.dt, "mujoco_version": installed or "not installed"}
    for name in names:
        result[name] = {
            **summarise(found[name].laps, overhead),
            "feet_in_contact": float(np.mean(found[name].contacts)),
            "deviation_mm": 1e3 * found[name].deviation,
        }
    if installed is None:
        return result | {"mujoco": None, "ratio": None}
    return result | {"ratio": ratio_of_medians(found["harpy_pin"].laps, found["mujoco"].laps, overhead)}


def _play(stepper: _Stepper, run: Run, begin: int, substeps: int, found: _Steps) -> Laps:
    """One turn: from a recorded state through the recorded commands; the times that count."""
    end = min(begin + BLOCK, len(run))
    laps: Laps = np.zeros((end - begin) * substeps, dtype=np.int64)
    stepper.reset(run["q"][begin], run["v"][begin])
    for i, k in enumerate(range(begin, end)):
        stepper.step(Command(run["torque"][k], run["thrust"][k]), laps[i * substeps : (i + 1) * substeps])
        found.contacts.append(stepper.feet_in_contact())
    if end < len(run):
        found.deviation = max(found.deviation, float(np.abs(stepper.position() - run["q"][end, :3]).max()))
    return laps[SETTLE:]


def _time_walks(
    robot: Robot, friction: float, duration: float, rng: np.random.Generator, on_turn: Callable[[], None]
) -> dict[str, Any]:
    names = {f"{c}/{g}" if g else c: (c, g or "none") for c, g in contenders()}
    for controller, governor in names.values():
        simulator, made = _make(robot, friction, controller, governor)
        simulator.run(made, 0.02)  # loads what is compiled
    factors: dict[str, list[float]] = {name: [] for name in names}
    on_cpu: dict[str, list[float]] = {name: [] for name in names}
    endings: dict[str, str] = {}
    for _ in range(WALKS):
        for k in rng.permutation(len(names)):
            name = list(names)[int(k)]
            simulator, made = _make(robot, friction, *names[name])
            begin, begin_cpu = perf_counter_ns(), process_time_ns()
            run = simulator.run(made, duration)
            busy, elapsed = process_time_ns() - begin_cpu, perf_counter_ns() - begin
            factors[name].append(1e9 * run.metadata["end_time"] / elapsed)
            on_cpu[name].append(1e9 * run.metadata["end_time"] / busy)
            endings[name] = run.ending
            on_turn()
    return {
        "duration_s": duration,
        "contenders": {
            name: {
                "real_time_factor": float(np.median(f)),
                "low": min(f),
                "high": max(f),
                "cpu_factor": float(np.median(on_cpu[name])),
                "us_per_tick": 1e6 * made.period / float(np.median(f)),
                "ending": endings[name],
            }
            for name, f in factors.items()
        },
    }
