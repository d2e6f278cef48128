"""One peer, or a controller of ours: posed the problem, checked, and its times. Without the check no time counts."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from comparison.measure.replay import WBC_PHASES, TickReplay, WholeBodyChain, replay
from comparison.measure.timing import Laps, summarise_repetitions, timer_overhead, without_gc
from comparison.measure.walking import StateSequence
from comparison.peers.environment import Peer, WorkerError, interpreter, run_worker
from comparison.peers.peer_problem import FACES, VARIANTS, Expected, PeerProblem
from harpy_pin.controllers import CondensedController, WholeBodyController, WholeBodyParameters
from harpy_pin.gaits import Gait, make_gait
from harpy_pin.ground.ground import Ground
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.scenario import Scenario, build
from harpy_pin.wbc import WholeBodyLimits, WholeBodyWeights

TOLERANCE = {"acceleration": 1e-4, "torque": 1e-3, "force": 1e-3, "thrust": 1e-3}
"""Largest accepted difference from our solution, in the unit of each quantity.

The program is strictly convex, so that its solution is one point; but how forces share a load weighs 1e-5 per N²,
and where two solvers stop at a gap of 1e-8 their forces may differ by some 1e-2 N in theory, by 2e-5 N as measured.
"""


@dataclass(frozen=True)
class Answer:
    """Solutions and times of one variant of the problem."""

    # arrays shaped as those of :class:`~comparison.peers.peer_problem.Expected`, NaN where unsolved; the thrusts are
    # absent where they were given
    quantities: dict[str, Vector]
    # (repetitions, ticks) times, ns: of the complete tick, perhaps of the solve, the solver's call only
    laps: dict[str, Laps]
    overhead: float  # of the timer, ns
    versions: dict[str, str]  # of what was run

    def entry(self, problem: PeerProblem, variant: str) -> dict[str, Any]:
        """How far it is from our solutions, and its times if it is near enough."""
        entry = {**check(self.quantities, problem.expected[variant]), "versions": self.versions}
        if not entry["reason"]:
            entry["times"] = summarise_times(problem, self.laps, self.overhead)
        return entry


def measure_peer(name: str, peer: Peer, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Any]:
    """Entries of both variants of a peer."""
    names = {variant: f"{name}, thrusts {variant}" for variant in VARIANTS}
    try:
        with TemporaryDirectory() as scratch:
            asked, result = Path(scratch) / "problem.npz", Path(scratch) / "result.npz"
            problem.save(asked, repetitions)
            run_worker(interpreter(folder, name), peer.worker, asked, result)
            answers = load_answers(result, problem)
    except WorkerError as error:
        return {key: {"reason": str(error)} for key in names.values()}
    return {key: answers[variant].entry(problem, variant) for variant, key in names.items()}


def load_answers(path: Path, problem: PeerProblem) -> dict[str, Answer]:
    """Read a worker's file: the answers by variant.

    Args:
        path: ``.npz`` with ``<variant>_<quantity>``, ``<variant>_tick_ns``, ``<variant>_solve_ns``, ``overhead_ns``,
            and ``versions`` (JSON).
        problem: that was posed; gives the shapes.
    """
    answers = {}
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {key: file[key] for key in file.files}
        versions = {str(name): str(value) for name, value in json.loads(str(found["versions"])).items()}
        for variant, expected in problem.expected.items():
            quantities, laps = {}, {}
            for name in [name for name in TOLERANCE if (name, variant) != ("thrust", "given")]:
                quantities[name] = np.asarray(found[f"{variant}_{name}"], dtype=np.float64)
                if quantities[name].shape != getattr(expected, name).shape:
                    raise ValueError(f"{variant}_{name} has shape {quantities[name].shape}")
            for name in ("tick", "solve"):
                value = np.asarray(found[f"{variant}_{name}_ns"])
                if value.ndim != 2 or value.shape[1] != len(expected.solved) or value.dtype.kind not in "iu":
                    raise ValueError(f"{variant}_{name}_ns is no table of integer times, one column per tick")
                laps[name] = value.astype(np.int64)
            answers[variant] = Answer(quantities, laps, float(found["overhead_ns"]), versions)
    except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile) as error:
        raise WorkerError(f"its result cannot be read: {error}") from error
    return answers


def check(quantities: dict[str, Vector], expected: Expected) -> dict[str, Any]:
    """Compare an answer with our solutions, at every tick that our own solver solved.

    Returns:
        ``reason`` why it is not ours, empty if it is; ticks ``compared`` and ``differing``, those among them that the
        peer did not solve; largest difference and median of the ticks' largest differences by quantity.
    """
    ticks = expected.solved
    compared = int(np.count_nonzero(ticks))
    largest: dict[str, float] = {}
    median: dict[str, float] = {}
    found = {"compared": compared, "differing": 0, "difference_max": largest, "difference_median": median}
    if compared == 0:
        return {"reason": "our own solver solved nothing to compare with", **found}
    wrong, unsolved = np.zeros(compared, dtype=np.bool_), np.zeros(compared, dtype=np.bool_)
    for name, value in quantities.items():
        if value.size == 0:
            continue  # a robot without thrusters
        each = np.abs(value - getattr(expected, name))[ticks].reshape(compared, -1).max(axis=1)
        finite = each[np.isfinite(each)] if np.isfinite(each).any() else np.array([np.nan])
        largest[name], median[name] = float(finite.max()), float(np.median(finite))
        unsolved |= ~np.isfinite(each)
        wrong |= ~(each <= TOLERANCE[name])
    differing, lost = int(np.count_nonzero(wrong)), int(np.count_nonzero(unsolved))
    reason = f"not comparable: {differing} of {compared} ticks differ from our solution" if differing else ""
    reason += f", {lost} of them unsolved" if lost else ""
    return {"reason": reason, **found, "differing": differing}


def summarise_times(problem: PeerProblem, laps: dict[str, Laps], overhead: float) -> dict[str, Any]:
    """Summaries by support and by what was timed, with the least and largest median of a repetition."""
    chosen = {support: mask & (problem.counted > 0.0) for support, mask in problem.supports.items()}
    return {
        support: {what: summarise_repetitions([row[mask] for row in rows], overhead) for what, rows in laps.items()}
        for support, mask in chosen.items()
        if mask.any()
    }


OURS = "harpy_pin"
"""Our own controller's row; its tick includes the gait and decides the thrusts within their limits."""

_SETTLED = 500
"""Ticks of a walk inside C that are not counted: it begins from rest."""

WholeBody = WholeBodyController | CondensedController


def the_peers_program(robot: Robot, friction: float) -> tuple[Gait, WholeBodyParameters]:
    """Without what the peers lack: limits of thrust, a range of normal forces, more than four faces."""
    gait = make_gait(replace(robot, thrust_limit=np.inf))
    return gait, peers_parameters(gait, friction)


def peers_parameters(gait: Gait, friction: float, weights: WholeBodyWeights | None = None) -> WholeBodyParameters:
    """That program's settings of ours; those of the gait but for what is said here."""
    how = {
        "solver": "active_set",
        "min_normal_force": 0.0,
        "max_normal_force": 1e4,
        "limits": WholeBodyLimits(mu=friction, faces=FACES),
    }
    return WholeBodyParameters.for_gait(gait, weights=weights, **how)


class Ours:
    """A controller of ours on the states of the problem; one in a single call has no solver's time."""

    def __init__(self, make: Callable[[], WholeBody], sequences: Sequence[StateSequence], most: int) -> None:
        self.states = [sequence.states[:most] for sequence in sequences]
        chain = make()
        self.timers = {"tick": TickReplay(make())}
        if isinstance(chain, WholeBodyController):
            self.timers["solve"] = WholeBodyChain(chain)
        self.laps: dict[str, list[Laps]] = {what: [] for what in self.timers}
        self.commands = np.zeros((0, 0))
        self.overhead = timer_overhead()

    def replay(self, repetitions: int) -> None:
        """Time all states so many times."""
        for _ in range(repetitions):
            with without_gc():
                for what, timer in self.timers.items():
                    found = [(done.laps, done.commands) for done in (replay(timer, states) for states in self.states)]
                    laps, commands = (np.concatenate(parts) for parts in zip(*found, strict=True))
                    self.laps[what].append(laps[:, WBC_PHASES.index("solve") if what == "solve" else 0])
                    if what == "tick":
                        self.commands = commands

    def times(self) -> dict[str, Laps]:
        """(repetitions, ticks) of the tick, and of the solver's call."""
        return {what: np.array(rows) for what, rows in self.laps.items()}

    def entry(self, problem: PeerProblem) -> dict[str, Any]:
        """Checked as the peers are, on the commands of the last timed replay."""
        joints = problem.expected["decided"].torque.shape[1]
        thrust = self.commands[:, joints:].reshape(len(self.commands), -1, 3)
        quantities = {"torque": self.commands[:, :joints], "thrust": thrust}
        return Answer(quantities, self.times(), self.overhead, {}).entry(problem, "decided")


def time_inside_c(friction: float, duration: float) -> dict[str, Any]:
    """The condensed controller's ticks of a walk in one compiled call, gait and a reading of the clock included."""
    scenario = Scenario(controller="condensed", ground=Ground(mu_s=friction), duration=duration)
    runs = [build(scenario).run() for _ in range(3)]
    held = runs[0]["held"][_SETTLED:].sum(axis=1)
    laps = [run["tick_ns"][_SETTLED:] for run in runs]
    return {
        name: {"tick": summarise_repetitions([row[held == feet] for row in laps], 0.0)}
        for name, feet in (("single", 1.0), ("double", 2.0))
        if (held == feet).any()
    }
