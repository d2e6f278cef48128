"""Complete ticks of every controller, formulation and solver on the same states; whole walks beside
the wall clock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from time import perf_counter_ns
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.contenders import CONTENDERS, label
from comparison.measure.inside_c import ReplayInsideC, overhead_inside_c
from comparison.measure.replay import WBC_PHASES, ProxQPReplay, TickReplay, WholeBodyChain, replay
from comparison.measure.timing import Bench, summarise, summarise_repetitions
from comparison.measure.walking import StateSequence, make_contender, recorded_walk, scenario_of
from comparison.tables import Cell, Table, in_columns, percentiles
from harpy_pin.contrib.solvers import SOLVERS
from harpy_pin.wbc import FORMULATIONS, QPStatus
from harpy_pin.wbc.solvers import ProxQPSolver

TOLERANCE = 1e-6
"""Largest accepted difference between a timed command and an untimed one, N and N·m."""

PROXQP_SHARE = 0.05
"""Largest accepted share of the commands by ProxQP that differ; those of the others must not differ
at all.

Where a program is hard (the robot falls, say), the point at which an iterative solver stops depends
on rounding, and that on where its memory lies. Such ticks are counted and shown.
"""


def make_all(robot: hp.Robot, friction: float) -> dict[str, Any]:
    """Every controller and governor of the campaign, and the QP by DAQP."""
    return {name: make_contender(name, robot, friction) for name in (*CONTENDERS, "wbc/daqp")}


def proxqp_replay(robot: hp.Robot, friction: float) -> ProxQPReplay:
    """The contender ``wbc`` with ProxQP's own timer on."""
    gait = hp.make_gait(robot)
    parameters = hp.controllers.WholeBodyParameters.for_gait(gait, limits={"mu": friction})
    return ProxQPReplay(lambda solver: hp.WholeBodyController(gait, parameters, solver=solver))


def time_ticks(bench: Bench, sequences: Sequence[StateSequence]) -> dict[str, Any]:
    """Time the complete tick of every controller, as Python calls it and inside C, in turn.

    Returns:
        For each contender percentiles, µs, the least and largest median of a repetition, and how
        many commands were ``compared`` with those of an untimed replay
        and ``differing``; and, unless a part of its tick is Python's, ``inside_c`` with the same
        percentiles, and how many of its commands were ``differing`` from those in Python. For
        ``wbc`` also ``own_timer``, ProxQP's own share of its ticks by its own timer, and
        ``fallbacks``, in how many ticks of a replay the dual method followed ProxQP.
    """
    timed = {
        name: TickReplay(controller)
        for name, controller in make_all(bench.robot, bench.friction).items()
    }
    inside = {
        name: ReplayInsideC(controller)
        for name, controller in make_all(bench.robot, bench.friction).items()
    }
    inside = {
        name: timer
        for name, timer in inside.items()
        if timer.controller.calls(sequences[0].states[0])
    }
    untimed = [
        {
            name: replay(TickReplay(controller), sequence.states).commands
            for name, controller in make_all(bench.robot, bench.friction).items()
        }
        for sequence in sequences
    ]
    wrong, differing = dict.fromkeys(timed, 0), dict.fromkeys(inside, 0)
    own_timer, fallbacks = proxqp_replay(bench.robot, bench.friction), [0]

    def start(k: int) -> dict[str, TickReplay]:
        every = (
            timed
            | {f"{name}{_INSIDE}": timer for name, timer in inside.items()}
            | {_OWN_TIMER: own_timer}
        )
        for timer in every.values():
            timer.start(sequences[k].states)
        return every

    def end(repetition: int, k: int) -> None:
        for name, each in timed.items():
            apart = np.abs(each.commands - untimed[k][name]).max(axis=1)
            wrong[name] += len(apart) - int(np.count_nonzero(apart <= TOLERANCE))
        for name, timer in inside.items():
            differing[name] += int(np.any(timer.commands != timed[name].commands, axis=1).sum())
        fallbacks[0] += timed["wbc"].controller.fallbacks if repetition == 0 else 0

    lengths, overhead_c = [len(sequence) for sequence in sequences], overhead_inside_c()
    laps, overhead = bench.repeat(start, lengths, block=bench.settings.block, end=end)
    result: dict[str, Any] = {}
    compared = bench.settings.repetitions * sum(lengths)
    for name in timed:
        result[name] = summarise_repetitions(laps[name], overhead)
        result[name] |= {"compared": compared, "differing": wrong[name]}
    for name in inside:
        summary = summarise_repetitions(
            [part[:, 0] for part in laps[f"{name}{_INSIDE}"]], overhead_c
        )
        result[name]["inside_c"] = {**summary, "differing": differing[name]}
    own = summarise_repetitions([part[:, 0] for part in laps[_OWN_TIMER]])
    result["wbc"] |= {"own_timer": own, "fallbacks": fallbacks[0]}
    return result


def tick_checks(contenders: Mapping[str, Any]) -> dict[str, Any]:
    """How many commands of :func:`time_ticks` differed, and whether that is accepted."""
    inside = sum(
        entry["inside_c"]["differing"] for entry in contenders.values() if "inside_c" in entry
    )
    accepted = {"wbc": PROXQP_SHARE}
    return {
        "commands_compared": sum(entry["compared"] for entry in contenders.values()),
        "commands_differing_by_controller": {
            name: entry["differing"] for name, entry in contenders.items()
        },
        "differing_inside_c": inside,
        "passed": not inside
        and all(
            entry["differing"] <= accepted.get(name, 0.0) * entry["compared"]
            for name, entry in contenders.items()
        ),
    }


_INSIDE = ", inside C"
_OWN_TIMER = "ProxQP's own timer"


def time_own_walks(bench: Bench, impulse: float, duration: float) -> dict[str, Any]:
    """Ticks of each controller on a pushed walk of its own, in the closed loop; impulse in N·s,
    duration in s.

    They are timed inside C; those of ``wbc`` in Python, from which ProxQP is called.

    Returns:
        For each of :data:`CONTENDERS` percentiles, µs, and how the walk ended.
    """
    found: dict[str, list[Any]] = {name: [] for name in CONTENDERS}
    for _ in range(bench.settings.repetitions):
        for k in bench.rng.permutation(len(CONTENDERS)):
            name = CONTENDERS[int(k)]
            found[name].append(
                recorded_walk(name, friction=bench.friction, duration=duration, impulse=impulse)
            )
        bench.on_pass()
    first, overhead = bench.settings.warm_up, overhead_inside_c()
    return {
        name: {
            **summarise_repetitions([run["tick_ns"][first:] for run in runs], overhead),
            "ending": runs[0].ending,
        }
        for name, runs in found.items()
    }


def ticks_table(ticks: Mapping[str, Any]) -> Table:
    """Percentiles of every controller."""
    times: list[Cell] = []
    for name, entry in ticks["contenders"].items():
        row = label(name)
        times += percentiles(row, entry)
        for where, found in (
            ("inside C", entry.get("inside_c")),
            (_OWN_TIMER, entry.get("own_timer")),
            ("own walk", ticks.get("own_walks", {}).get(name)),
        ):
            cells = percentiles(row, found) if found else []
            times += [
                cell._replace(column=f"{where}, {cell.column}")
                for cell in cells
                if cell.column in ("p50", "p99")
            ]
    friction = ticks["friction"]
    title = (
        f"Complete tick of every controller, µs, friction {friction:g}, pushes of "
        f"{ticks['impulse']:g} N·s"
    )
    note = (
        "Called from Python, then inside C, on the same states for all; own walk: inside C in the "
        "closed loop, where "
        "each controller meets its own states, up to a fall. ProxQP and DAQP come as modules of "
        "Python: C cannot call "
        "them, so their ticks, own walks too, are timed in Python. ProxQP's own timer: what ProxQP "
        "itself says that "
        "it takes of these ticks (setup_time and solve_time), without Python and without handing "
        "the program over. "
        "In brackets: least and largest median of a repetition."
    )
    return Table("ticks", title, tuple(times), note)


STATES = 500
"""States of the walk that are used, from its middle."""

LOOSE = "input_space, proxqp to 1e-6 without duality gap"
"""ProxQP where the gap is not checked, to a larger tolerance."""

COLUMNS = {
    "tick_p50_us": ("tick", "µs"),
    "build_p50_us": ("build", "µs"),
    "solve_p50_us": ("solve", "µs"),
    "solve_p99_us": ("solve, p99", "µs"),
    "unsolved": ("not solved", ""),
    "violation_max": ("largest violation", ""),
    "difference_max": ("largest difference", "N, N·m"),
}


class _CheckedChain(WholeBodyChain):
    """Keeps status and violation of every solve beside its times."""

    def start(self, states: Any) -> None:
        """See :meth:`TickReplay.start`."""
        super().start(states)
        self.unsolved, self.violation = 0, 0.0

    def _keep(self, i: int, command: Any) -> None:
        super()._keep(i, command)
        solution = self.controller.solution
        self.unsolved += solution.status is not QPStatus.SOLVED
        if solution.usable:
            self.violation = max(self.violation, solution.violation)


def time_formulations(bench: Bench, sequence: StateSequence) -> dict[str, Any]:
    """Time every formulation with every solver.

    Returns:
        For each configuration medians of the tick and its phases, the tail of the solve, ticks that
        were not solved, the largest violation of a constraint, and the largest difference of a
        command (N, N·m) from that of the ``full`` formulation solved by DAQP.
    """
    robot, settings = bench.robot, bench.settings
    begin = max((len(sequence) - STATES) // 2, 0)
    states = sequence.states[begin : begin + STATES]
    gait = hp.make_gait(robot)
    plain = hp.controllers.WholeBodyParameters.for_gait(gait, limits={"mu": bench.friction})
    made = {
        f"{formulation}, {solver}": hp.WholeBodyController(
            gait, replace(plain, formulation=formulation, solver=solver)
        )
        for formulation, solver in product(FORMULATIONS, SOLVERS)
    }
    made[LOOSE] = hp.WholeBodyController(
        gait, plain, solver=partial(ProxQPSolver, tolerance=1e-6, gap=None)
    )
    timed = {name: _CheckedChain(controller) for name, controller in made.items()}

    def start(_: int) -> dict[str, _CheckedChain]:
        for timer in timed.values():
            timer.start(states)
        return timed

    laps, overhead = bench.repeat(
        start, [len(states)], block=max(settings.block // 5, 2 * settings.settle)
    )
    reference = timed["full, daqp"].commands  # an active-set method ends there to rounding
    result: dict[str, Any] = {}
    for name, timer in timed.items():
        tick = summarise([part.sum(axis=1) for part in laps[name]], len(WBC_PHASES) * overhead)
        phases = dict(zip(WBC_PHASES, np.moveaxis(np.array(laps[name]), 2, 0), strict=True))
        build, solve = (summarise(list(phases[phase]), overhead) for phase in ("build", "solve"))
        result[name] = {
            "tick_p50_us": tick["p50_us"],
            "build_p50_us": build["p50_us"],
            "solve_p50_us": solve["p50_us"],
            "solve_p99_us": solve["p99_us"],
            "unsolved": int(timer.unsolved),
            "violation_max": timer.violation,
            "difference_max": float(np.abs(timer.commands - reference).max()),
        }
    return result


def formulations_table(entry: dict[str, Any], friction: float) -> Table:
    """The table of :func:`time_formulations`."""
    cells = [cell for name, row in entry.items() for cell in in_columns(name, row, COLUMNS)]
    note = (
        f"Medians unless stated, on {STATES} states of the pushed walk of the QP controller. "
        "The difference is that of the commands from the full formulation solved by an active-set "
        "method. 'full' and "
        "'input_space' are the same problem: where it is not small, the solver stopped short."
    )
    return Table(
        "formulations",
        f"Formulations and solvers of the program, friction {friction:g}",
        tuple(cells),
        note,
    )


WALKS = 3
"""Walks of each controller beside the wall clock."""


def time_simulator(bench: Bench, *, duration: float) -> dict[str, Any]:
    """Time whole walks on ground of the bench's friction, known to the controllers; the duration is
    in s.

    Returns:
        Of each controller how many times faster than real time it was (median, least and largest
        of three), and how it ended.
    """
    found: dict[str, list[tuple[float, str]]] = {name: [] for name in CONTENDERS}
    for name in CONTENDERS:
        hp.build(scenario_of(name, bench.friction, duration=0.02)).run()  # loads what is compiled
    for _ in range(WALKS):
        for k in bench.rng.permutation(len(CONTENDERS)):
            name = CONTENDERS[int(k)]
            walk = hp.build(scenario_of(name, bench.friction, duration=duration))
            begin = perf_counter_ns()
            run = walk.run()
            elapsed = perf_counter_ns() - begin
            found[name].append((1e9 * run.metadata["end_time"] / elapsed, run.ending))
            bench.on_pass()
    walks = {}
    for name, rows in found.items():
        times, endings = zip(*rows, strict=True)
        spread = {"value": float(np.median(times)), "low": min(times), "high": max(times)}
        walks[name] = {"real_time": spread, "ending": endings[-1]}
    return walks


def simulator_table(walks: Mapping[str, Any]) -> Table:
    """The table of :func:`time_simulator`."""
    columns = {"real_time": ("times real time", ""), "ending": ("ending", "")}
    cells = [cell for name, row in walks.items() for cell in in_columns(label(name), row, columns)]
    title = "Closed-loop walks: simulated time over wall clock, log included"
    note = "Median of three; in brackets the slowest and the fastest."
    return Table("simulator_walk", title, tuple(cells), note)
