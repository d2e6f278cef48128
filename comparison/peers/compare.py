"""All peers on recorded states: checked first, then timed, beside our own controller on the same states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from comparison.measure.controllers import make_contender
from comparison.measure.machine import describe_all_versions, describe_machine
from comparison.measure.states import StateSequence, record_states, walk
from comparison.measure.timing import TimingSettings
from comparison.peers.environment import PEERS, Peer
from comparison.peers.growth_of_peers import ROBOTS, measure_growth
from comparison.peers.measure_peer import TOLERANCE, PeerSettings, measure_peer, summarise_times
from comparison.peers.ours import OURS, Ours, the_peers_program, time_inside_c
from comparison.peers.peer_problem import make_problem
from harpy_pin.controllers import CondensedController, WholeBodyController
from harpy_pin.files import finite
from harpy_pin.model.robot import Robot, load_harpy

RECORDED = ("governed", "wbc")
"""Whose walks give the states."""


def measure_peers(
    robot: Robot,
    sequences: Sequence[StateSequence],
    *,
    friction: float,
    settings: PeerSettings,
    folder: Path,
    peers: Mapping[str, Peer] = PEERS,
    on_step: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Check and time every peer and our own controller.

    ``folder`` has the peers' environments. ``on_step`` is called ``len(peers) + 2`` times, never while
    a clock runs.

    Returns:
        Only dicts, lists and scalars. ``contenders``: for each either a ``reason`` why it has no times, or the
        differences from our solutions and the times of ``tick`` and ``solve`` in single and double support.
    """
    most, repetitions = settings.most, settings.repetitions
    problem = make_problem(robot, sequences, friction=friction, warm_up=settings.warm_up, most=most)
    # Ours before and after the others: a drift of the machine's speed shows in the spread of its medians.
    before = (repetitions + 1) // 2
    ours = Ours(lambda: make_contender("wbc", robot, friction), sequences, most)
    mine = {
        "WBC QP": Ours(lambda: WholeBodyController(*the_peers_program(robot, friction)), sequences, most),
        "condensed WBC": Ours(lambda: CondensedController(*the_peers_program(robot, friction)), sequences, most),
    }
    for controller in (ours, *mine.values()):
        controller.replay(before)
    on_step()
    others: dict[str, Any] = {}
    for name, peer in peers.items():
        others |= measure_peer(name, peer, problem, folder, repetitions)
        on_step()
    for controller in (ours, *mine.values()):
        controller.replay(repetitions - before)
    on_step()
    contenders: dict[str, Any] = {
        OURS: {"reason": "", "times": summarise_times(problem, ours.times(), ours.overhead)},
        **{f"{OURS}, the peers' program, {name}": c.entry(problem) for name, c in mine.items()},
        **others,
    }
    return {
        "friction": friction,
        "ticks": len(problem),
        "unsolved_by_us": {name: int(np.count_nonzero(~e.solved)) for name, e in problem.expected.items()},
        "repetitions": repetitions,
        "tolerance": dict(TOLERANCE),
        "contenders": contenders,
    }


def compare_peers(
    progress: Callable[[str, int, int], None],
    *,
    friction: float,
    duration: float,
    timing: TimingSettings,
    folder: Path,
    growth: Sequence[str] = tuple(ROBOTS),
) -> dict[str, Any]:
    """Walk, then measure every peer on the states.

    The duration of a walk is in s; ``folder`` has the peers' environments; ``growth`` are the robots of the table
    of growth.

    Returns:
        ``peers``, ``machine`` and ``versions``, ready for JSON.
    """
    machine, sequences, settings = describe_machine(), [], PeerSettings.of(timing)
    for i, name in enumerate(RECORDED):
        progress("walking", i, len(RECORDED))
        run = walk(name, friction=friction, duration=duration)
        sequences.append(record_states(name, run, least=timing.warm_up + 50))
    progress("walking", len(RECORDED), len(RECORDED))
    total, steps = len(PEERS) + 3, count(1)
    progress("peers", 0, total)
    peers = measure_peers(
        load_harpy(),
        sequences,
        friction=friction,
        settings=settings,
        folder=folder,
        on_step=lambda: progress("peers", next(steps), total),
    )
    inside = {"reason": "", "times": time_inside_c(friction, duration)}
    peers["contenders"] = {f"{OURS}, condensed WBC inside C, a walk of its own": inside, **peers["contenders"]}
    peers["growth"] = measure_growth(folder, settings, robots=growth)
    progress("peers", total, total)
    document: dict[str, Any] = finite({"peers": peers, "machine": machine, "versions": describe_all_versions()})
    return document
