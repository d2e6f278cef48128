"""All peers on recorded states: checked first, then timed, beside our own controller on the same states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.measure.controllers import make_whole_body
from comparison.measure.interleave import TimingSettings
from comparison.measure.machine import describe_all_versions, describe_machine
from comparison.measure.states import StateSequence, record_states, walk
from comparison.measure.statistics import Laps, finite, summarise_repetitions
from comparison.measure.tick_replay import WBC_PHASES, TickReplay, WholeBodyChain, replay, timer_overhead, without_gc
from comparison.peers.check import TOLERANCE, Answer, check, load_answers
from comparison.peers.environment import PEERS, Peer, default_folder, interpreter
from comparison.peers.growth_of_peers import MU, ROBOTS, growth_row, standing_problem
from comparison.peers.peer_problem import FACES, PeerProblem, make_problem
from comparison.peers.pinocchio_terms import compare_terms
from comparison.peers.solvers import compare_solvers, record_programs
from comparison.peers.worker import WorkerError, run_worker
from harpy_pin.controllers import CondensedController, WholeBodyController, WholeBodyParameters
from harpy_pin.errors import InputError
from harpy_pin.gaits import Gait, make_gait
from harpy_pin.model.robot import Robot, load_harpy
from harpy_pin.scenario import Scenario, build
from harpy_pin.simulation import Ground
from harpy_pin.wbc import WholeBodyLimits

__all__ = ["OURS", "PeerSettings", "compare_peers", "measure_growth", "measure_peers"]

RECORDED = ("governed", "wbc")
"""Whose walks give the states."""

OURS = "harpy_pin"
"""Our own controller's row; its tick includes the gait and decides the thrusts within their limits."""


_SETTLED = 500
"""Ticks of a walk inside C that are not counted: it begins from rest."""


_Controller = WholeBodyController | CondensedController


@dataclass(frozen=True, kw_only=True)
class PeerSettings:
    """How much to measure.

    Attributes:
        most: ticks of each sequence, from its start.
        warm_up: ticks of each sequence that are not counted.
        repetitions: of every replay.
        programs: programs for the QP solvers.
    """

    most: int = 4000
    warm_up: int = 50
    repetitions: int = 5
    programs: int = 300

    @classmethod
    def of(cls, timing: TimingSettings) -> PeerSettings:
        """As thorough as the rest of a comparison."""
        return cls(
            most=max(2 * timing.programs, 2 * timing.warm_up),
            warm_up=timing.warm_up,
            repetitions=min(timing.repetitions, 5),
            programs=3 * timing.samples,
        )


def measure_peers(
    robot: Robot,
    sequences: Sequence[StateSequence],
    *,
    friction: float,
    settings: PeerSettings,
    folder: Path | None = None,
    peers: Mapping[str, Peer] = PEERS,
    on_step: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Check and time every peer and our own controller.

    Environments lie in the default folder if none is given. ``on_step`` is called ``len(peers) + 4`` times, never while
    a clock runs.

    Returns:
        Only dicts, lists and scalars. ``contenders``: for each either a ``reason`` why it has no times, or the
        differences from our solutions and the times of ``tick`` and ``solve`` in single and double support;
        ``solvers``: see :func:`~comparison.peers.solvers.compare_solvers`; ``terms``: see
        :func:`~comparison.peers.pinocchio_terms.compare_terms`.
    """
    folder = default_folder() if folder is None else folder
    problem = make_problem(robot, sequences, friction=friction, warm_up=settings.warm_up, most=settings.most)
    # Ours before and after the others: a drift of the machine's speed shows in the spread of its medians.
    before = (settings.repetitions + 1) // 2
    ours = _Ours(lambda: make_whole_body(robot, friction), sequences, settings.most)
    same = _Ours(lambda: WholeBodyController(*_the_peers_program(robot, friction)), sequences, settings.most)
    condensed = _Ours(lambda: CondensedController(*_the_peers_program(robot, friction)), sequences, settings.most)
    for controller in (ours, same, condensed):
        controller.replay(before)
    on_step()
    contenders: dict[str, Any] = {}
    for name, peer in peers.items():
        contenders |= _measure(name, peer, problem, folder, settings.repetitions)
        on_step()
    for controller in (ours, same, condensed):
        controller.replay(settings.repetitions - before)
    on_step()
    times = _times(problem, np.array(ours.tick), np.array(ours.solve), ours.overhead)
    mine = {"WBC QP": same, "condensed WBC": condensed}
    contenders = {**{f"{OURS}, the peers' program, {name}": c.entry(problem) for name, c in mine.items()}, **contenders}
    terms = compare_terms(
        robot,
        sequences,
        friction=friction,
        warm_up=settings.warm_up,
        most=settings.most,
        repetitions=settings.repetitions,
    )
    on_step()
    programs = record_programs(robot, sequences, friction=friction, warm_up=settings.warm_up, most=settings.programs)
    solvers = compare_solvers(programs)
    on_step()
    return {
        "friction": friction,
        "ticks": len(problem),
        "unsolved_by_us": {name: int(np.count_nonzero(~e.solved)) for name, e in problem.expected.items()},
        "repetitions": settings.repetitions,
        "tolerance": dict(TOLERANCE),
        "contenders": {OURS: {"reason": "", "times": times}, **contenders},
        "programs": len(programs),
        "solvers": solvers,
        "terms": terms,
    }


def _the_peers_program(robot: Robot, friction: float) -> tuple[Gait, WholeBodyParameters]:
    """Without what the peers lack: limits of thrust, a range of normal forces, more than four faces."""
    return make_gait(replace(robot, thrust_limit=np.inf)), _peers_parameters(friction)


def _peers_parameters(friction: float) -> WholeBodyParameters:
    return WholeBodyParameters(
        min_normal_force=0.0, max_normal_force=1e4, limits=WholeBodyLimits(mu=friction, faces=FACES)
    )


def measure_growth(folder: Path, settings: PeerSettings, *, peers: Mapping[str, Peer] = PEERS) -> dict[str, Any]:
    """A tick of everybody on each of :data:`~comparison.peers.growth_of_peers.ROBOTS`; a reason where there is none.

    Args:
        folder: of the environments.
        settings: warm-up and repetitions.
        peers: by name.
    """
    rows: dict[str, Any] = {}
    for robot in ROBOTS:
        with TemporaryDirectory() as scratch:
            made = standing_problem(robot, Path(scratch), warm_up=settings.warm_up)
            if isinstance(made, str):
                rows[robot] = {"reason": made}
                continue
            problem, gait, sequence = made
            entries = {}
            for name, kind in (("WBC QP", WholeBodyController), ("condensed WBC", CondensedController)):
                entries[f"{OURS}, {name}"] = _grown(kind, problem, gait, sequence, settings.repetitions)
            for name, peer in peers.items():
                entries[name] = _measure(name, peer, problem, folder, settings.repetitions)[f"{name}, thrusts decided"]
        rows[robot] = growth_row(robot, problem, entries)
    return rows


def _grown(
    kind: type[_Controller], problem: PeerProblem, gait: Callable[[], Gait], sequence: StateSequence, repetitions: int
) -> dict[str, Any]:
    try:
        ours = _Ours(lambda: kind(gait(), _peers_parameters(MU)), [sequence], len(sequence))
    except InputError as error:
        return {"reason": str(error).splitlines()[0]}
    ours.replay(repetitions)
    return ours.entry(problem)


class _Ours:
    """A controller of ours on the states of the problem; one in a single call has no solver's time."""

    def __init__(self, make: Callable[[], _Controller], sequences: Sequence[StateSequence], most: int) -> None:
        self.states = [sequence.states[:most] for sequence in sequences]
        self.ticks, chain = TickReplay(make()), make()
        self.chain = WholeBodyChain(chain) if isinstance(chain, WholeBodyController) else None
        self.tick: list[Laps] = []
        self.solve: list[Laps] = []
        self.commands = np.zeros((0, 0))
        self.overhead = timer_overhead()

    def replay(self, repetitions: int) -> None:
        solve = WBC_PHASES.index("solve")
        for _ in range(repetitions):
            with without_gc():
                tick, commands = [], []
                for states in self.states:
                    timer = replay(self.ticks, states)
                    tick.append(timer.laps[:, 0])
                    commands.append(timer.commands)
                self.tick.append(np.concatenate(tick))
                self.commands = np.concatenate(commands)
                chain = self.chain
                if chain is not None:
                    self.solve.append(np.concatenate([replay(chain, states).laps[:, solve] for states in self.states]))

    def entry(self, problem: PeerProblem) -> dict[str, Any]:
        """Checked as the peers are, on the commands of the last timed replay."""
        tick, solve = np.array(self.tick), np.array(self.solve) if self.solve else None
        joints = problem.expected["decided"].torque.shape[1]
        quantities = {
            "torque": self.commands[:, :joints],
            "thrust": self.commands[:, joints:].reshape(len(self.commands), -1, 3),
        }
        verdict = check(Answer(quantities, tick, tick, self.overhead, {}), problem.expected["decided"])
        entry = asdict(verdict)
        if verdict.passed:
            entry["times"] = _times(problem, tick, solve, self.overhead)
        return entry


def _measure(name: str, peer: Peer, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Any]:
    """Entries of all variants of a peer."""
    entries: dict[str, Any] = {}
    try:
        answers = _answers(name, peer, problem, folder, repetitions)
    except WorkerError as error:
        return {f"{name}, thrusts {v}": {"reason": peer.variants[v] or str(error)} for v in peer.variants}
    for variant, impossible in peer.variants.items():
        key = f"{name}, thrusts {variant}"
        answer = answers.get(variant)
        if answer is None:
            entries[key] = {"reason": impossible or "its result lacks this variant"}
            continue
        verdict = check(answer, problem.expected[variant])
        entries[key] = {**asdict(verdict), "versions": answer.versions}
        if verdict.passed:
            entries[key]["times"] = _times(problem, answer.tick, answer.solve, answer.overhead, answer.terms)
    return entries


def _answers(name: str, peer: Peer, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Answer]:
    with TemporaryDirectory() as scratch:
        asked, result = Path(scratch) / "problem.npz", Path(scratch) / "result.npz"
        problem.save(asked, repetitions)
        run_worker(interpreter(folder, name), peer.worker, asked, result)
        return load_answers(result, problem)


def _times(
    problem: PeerProblem, tick: Laps, solve: Laps | None, overhead: float, terms: Laps | None = None
) -> dict[str, Any]:
    """Summaries by support and by what was timed, with the least and largest median of a repetition."""
    counted: NDArray[np.bool_] = problem.counted > 0.0
    result: dict[str, Any] = {}
    for support, mask in problem.supports.items():
        chosen = mask & counted
        if not chosen.any():
            continue
        result[support] = {}
        for what, laps in (("tick", tick), ("solve", solve), ("terms", terms)):
            if laps is None:
                continue
            result[support][what] = summarise_repetitions([row[chosen] for row in laps], overhead)
    return result


def _inside_c(friction: float, duration: float) -> dict[str, Any]:
    """The condensed controller's ticks of a walk in one compiled call, gait and a reading of the clock included."""
    scenario = Scenario(controller="condensed", ground=Ground(mu_s=friction), duration=duration)
    runs = [build(scenario).run() for _ in range(3)]
    held = runs[0]["held"][_SETTLED:].sum(axis=1)
    supports = {"single": held == 1.0, "double": held == 2.0}
    laps = [run["tick_ns"][_SETTLED:] for run in runs]
    return {
        name: {"tick": summarise_repetitions([row[mask] for row in laps], 0.0)}
        for name, mask in supports.items()
        if mask.any()
    }


def compare_peers(
    progress: Callable[[str, int, int], None], *, friction: float, duration: float, timing: TimingSettings, folder: Path
) -> dict[str, Any]:
    """Walk, then measure every peer on the states.

    The duration of a walk is in s; ``folder`` has the peers' environments.

    Returns:
        ``peers``, ``machine`` and ``versions``, ready for JSON.
    """
    machine = describe_machine()
    sequences = []
    for i, name in enumerate(RECORDED):
        progress("walking", i, len(RECORDED))
        run = walk(name, friction=friction, duration=duration)
        sequences.append(record_states(name, run, least=timing.warm_up + 50))
    progress("walking", len(RECORDED), len(RECORDED))
    total = len(PEERS) + 5
    progress("peers", 0, total)
    steps = count(1)
    peers = measure_peers(
        load_harpy(),
        sequences,
        friction=friction,
        settings=PeerSettings.of(timing),
        folder=folder,
        on_step=lambda: progress("peers", next(steps), total),
    )
    inside = {"reason": "", "times": _inside_c(friction, duration)}
    peers["contenders"] = {f"{OURS}, condensed WBC inside C, a walk of its own": inside, **peers["contenders"]}
    peers["growth"] = measure_growth(folder, PeerSettings.of(timing))
    progress("peers", total, total)
    document: dict[str, Any] = finite({"peers": peers, "machine": machine, "versions": describe_all_versions()})
    return document
