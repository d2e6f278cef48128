"""Our own controllers, timed and checked as the peers are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from comparison.measure.replay import WBC_PHASES, TickReplay, WholeBodyChain, replay
from comparison.measure.states import StateSequence
from comparison.measure.timing import Laps, summarise_repetitions, timer_overhead, without_gc
from comparison.peers.measure_peer import Answer
from comparison.peers.peer_problem import FACES, PeerProblem
from harpy_pin.controllers import CondensedController, WholeBodyController, WholeBodyParameters
from harpy_pin.gaits import Gait, make_gait
from harpy_pin.ground.ground import Ground
from harpy_pin.model.robot import Robot
from harpy_pin.scenario import Scenario, build
from harpy_pin.wbc import WholeBodyLimits, WholeBodyWeights

OURS = "harpy_pin"
"""Our own controller's row; its tick includes the gait and decides the thrusts within their limits."""

_SETTLED = 500
"""Ticks of a walk inside C that are not counted: it begins from rest."""

_DEFAULT = WholeBodyWeights()

WholeBody = WholeBodyController | CondensedController


def the_peers_program(robot: Robot, friction: float) -> tuple[Gait, WholeBodyParameters]:
    """Without what the peers lack: limits of thrust, a range of normal forces, more than four faces."""
    return make_gait(replace(robot, thrust_limit=np.inf)), peers_parameters(friction)


def peers_parameters(friction: float, weights: WholeBodyWeights = _DEFAULT) -> WholeBodyParameters:
    """That program's settings of ours."""
    limits = WholeBodyLimits(mu=friction, faces=FACES)
    return WholeBodyParameters(min_normal_force=0.0, max_normal_force=1e4, limits=limits, weights=weights)


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
                    column = WBC_PHASES.index("solve") if what == "solve" else 0
                    laps, commands = [], []
                    for states in self.states:
                        done = replay(timer, states)
                        laps.append(done.laps[:, column])
                        commands.append(done.commands)
                    self.laps[what].append(np.concatenate(laps))
                    if what == "tick":
                        self.commands = np.concatenate(commands)

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
    masks = {"single": held == 1.0, "double": held == 2.0}
    return {
        name: {"tick": summarise_repetitions([row[mask] for row in laps], 0.0)}
        for name, mask in masks.items()
        if mask.any()
    }
