"""Replays recorded states through our controllers, in a process of its own, as peers are.

That process calls :func:`main`. With ``HARPY_PIN_FOR_A_WHEEL`` in its environment kernels are
compiled as those of wheels are.
"""

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from comparison.measure.inside_c import ReplayInsideC, overhead_inside_c
from comparison.measure.replay import TickReplay, replay
from comparison.measure.timing import Laps, timer_overhead, without_gc
from comparison.measure.walking import StateSequence
from comparison.peers.peer_problem import OWN_SEARCH, Case
from harpy_pin.controllers import CondensedController, WholeBodyController
from harpy_pin.kernels import compiler
from harpy_pin.model.state import State, Vector

WholeBody = WholeBodyController | CondensedController


def contenders(case: Case) -> dict[str, Callable[[], WholeBody]]:
    """What makes each of our controllers, by the name of its row."""
    gait, p = case.gait, case.parameters
    return {
        "condensed WBC": lambda: CondensedController(gait, p),
        "whole-body QP, own search": lambda: WholeBodyController(gait, replace(p, **OWN_SEARCH)),
        "whole-body QP, ProxQP": lambda: _by_proxqp(case),
    }


def _by_proxqp(case: Case) -> WholeBodyController:
    """The formulation with which ProxQP is fastest; on soles ``input_space`` poses another program,
    and on ankles it is not exact.
    """
    short = not case.ankles and not case.gait.robot.flat_feet
    formulation = "input_space" if short else "full"
    return WholeBodyController(
        case.gait, replace(case.parameters, solver="proxqp", formulation=formulation)
    )


@dataclass(frozen=True)
class Timed:
    """Commands of the last replay, and the times of all."""

    commands: Vector  # (ticks, joints + 3 thrusters) torques, N·m, and thrusts, N
    laps: dict[
        str, Laps
    ]  # (repetitions, ticks) of ``tick``, called from Python, and ``inside`` C, ns
    overhead: dict[str, float]  # of the clocks, ns
    versions: dict[str, str]  # compiler and flags of the kernels


def time_ours(case: Case, repetitions: int) -> dict[str, Timed]:
    """Replay a case through every contender, one after the other in each repetition."""
    timers: dict[str, dict[str, TickReplay]] = {}
    first = case.sequences[0].states[0]
    for name, make in contenders(case).items():
        timers[name] = {"tick": TickReplay(make())}
        inside = make()
        if inside.calls(first) is not None:
            timers[name]["inside"] = ReplayInsideC(inside)
    laps: dict[tuple[str, str], list[Laps]] = {
        (name, what): [] for name in timers for what in timers[name]
    }
    commands: dict[str, Vector] = {}
    with without_gc():
        overhead = {"tick": timer_overhead(), "inside": overhead_inside_c()}
        for _ in range(repetitions):
            for name, what in laps:
                parts = []
                for sequence in case.sequences:
                    timer = replay(timers[name][what], sequence.states)
                    parts.append((timer.laps[:, 0], timer.commands))
                times, answers = (np.concatenate(part) for part in zip(*parts, strict=True))
                laps[name, what].append(times)
                commands[name] = answers
    found: dict[str, Timed] = {}
    versions = {"compiler": compiler.version(), "flags": " ".join(compiler.FLAGS)}
    for name in timers:
        own = {what: np.array(rows) for (of, what), rows in laps.items() if of == name}
        found[name] = Timed(commands[name], own, overhead, versions)
    return found


def save(path: Path, case: Case, repetitions: int) -> None:
    """Write the file that the worker reads."""
    path.write_bytes(pickle.dumps((case, repetitions)))


def main(case_file: str, result_file: str) -> None:
    """Time what :func:`save` wrote; the result is the pickle of a mapping from a contender to its
    :class:`Timed`.
    """
    case, repetitions = pickle.loads(Path(case_file).read_bytes())
    case = replace(case, sequences=tuple(map(_as_measured, case.sequences)))
    Path(result_file).write_bytes(pickle.dumps(time_ours(case, repetitions)))


def _as_measured(sequence: StateSequence) -> StateSequence:
    """The states in arrays that are made here: those of pickle have a dtype object of their own,
    which is converted.
    """

    def made(array: Vector) -> Vector:
        own = np.zeros(array.shape)
        own[...] = array
        return own

    names = ("q", "v", "foot_position", "foot_velocity", "foot_force")
    states = (State(s.t, *(made(getattr(s, name)) for name in names)) for s in sequence.states)
    return replace(sequence, states=tuple(states))
