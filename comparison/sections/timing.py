"""How long each controller takes for the same states.

Complete ticks, phases, isolated governor updates and isolated solves are timed in separate replays, so that clocks
between the phases add nothing to the complete tick. All replays are interleaved, block by block of a sequence and in an
order drawn anew for each block, so that a drift of the machine's speed affects all of them alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from comparison.measure.controllers import CONTENDERS, make_contender, make_governed, make_whole_body
from comparison.measure.interleave import Bench, Timed, TimingSettings
from comparison.measure.isolated import IsolatedGovernor, IsolatedSolver
from comparison.measure.states import StateSequence
from comparison.measure.statistics import Laps, ratio_of_medians, summarise
from comparison.measure.tick_replay import GOVERNED_PHASES, WBC_PHASES, GovernedChain, TickReplay, WholeBodyChain
from comparison.measure.verification import ExpectedReplay, record_expected
from harpy_pin.errors import InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc import installed_solvers

__all__ = ["TimingResult", "count_passes", "time_contenders"]

COMMAND_TOLERANCE = 1e-6
"""Largest accepted difference between a timed command and the expected one, N and N·m."""

WBC_SHARE = 0.05
"""Largest accepted share of the QP controller's commands that differ; the governed controllers' must not differ at all.

Where a program is hard (the robot falls, say), the point at which an iterative solver stops depends on rounding, and
that on where its memory lies. Such ticks are counted and shown.
"""

OPTIMAL = 1e-6
"""Residual of stationarity, or relative gap of the objective, up to which a solution counts as optimal."""


@dataclass
class TimingResult:
    """Times and checks of one friction coefficient.

    Attributes:
        timing: summaries of each contender's tick and phases, and the ratios.
        checks: what was checked, and whether it held (``passed``).
        activity: share of ticks with violated rows, and the solver's iterations, on each sequence.
    """

    timing: dict[str, Any]
    checks: dict[str, Any]
    activity: dict[str, Any]


def count_passes(settings: TimingSettings, sequences: int) -> int:
    """How often :func:`time_contenders` reports progress."""
    return sequences * (1 + settings.repetitions)


def time_contenders(bench: Bench, sequences: Sequence[StateSequence]) -> TimingResult:
    """Time all contenders on all sequences.

    Raises:
        InputError: a sequence is shorter than the warm-up.
    """
    robot, friction, settings = bench.robot, bench.friction, bench.settings
    for sequence in sequences:
        if len(sequence) <= settings.warm_up:
            raise InputError(f"{len(sequence)} states are too few for a warm-up of {settings.warm_up}", name="states")
    digests = [sequence.digest() for sequence in sequences]
    expectations: list[ExpectedReplay] = []
    for sequence in sequences:
        expectations.append(
            record_expected(robot, friction, sequence, keep=settings.programs, samples=settings.samples)
        )
        bench.on_pass()

    run = _TimingRun(robot, friction)

    def start(k: int) -> dict[str, Timed]:
        run.start(sequences[k], expectations[k])
        return run.timed

    def end(repetition: int, k: int) -> None:
        run.compare(expectations[k])
        if repetition == 0:
            run.judge_solutions()
        bench.on_pass()

    quiet = replace(bench, on_pass=lambda: None)  # a pass is one sequence here
    laps, overhead = quiet.repeat(start, [len(s) for s in sequences], block=settings.block, end=end)

    unchanged = digests == [sequence.digest() for sequence in sequences]
    return TimingResult(
        _summary(laps, overhead), _checks(run, sequences, expectations, unchanged), _activity(sequences, expectations)
    )


class _TimingRun:
    """The controllers that are timed, and their results so far."""

    def __init__(self, robot: Robot, friction: float) -> None:
        self.compared = dict.fromkeys(CONTENDERS, 0)
        self.differing = dict.fromkeys(CONTENDERS, 0)
        self.command_difference = 0.0
        self.gaps: dict[str, list[Vector]] = {}
        self.failures: dict[str, int] = {}
        governed, wbc = make_governed(robot, friction), make_whole_body(robot, friction)
        self.replays: dict[str, TickReplay] = {
            **{f"{name}/tick": TickReplay(make_contender(name, robot, friction)) for name in CONTENDERS},
            "governed/chain": GovernedChain(governed),
            "wbc/chain": WholeBodyChain(wbc),
        }
        spare, strained = make_governed(robot, friction).governor, make_governed(robot, 0.0).governor
        assert spare is not None
        assert strained is not None
        self.governor = IsolatedGovernor(spare, governed.period)
        self.strained = IsolatedGovernor(strained, governed.period)
        self.solvers = {
            "solve_alone": IsolatedSolver(make_whole_body(robot, friction).problem.program, "proxqp", reuse=True)
        }
        for name in ("proxqp", "daqp"):
            if name in installed_solvers():
                program = make_whole_body(robot, friction).problem.program
                self.solvers[f"solve_alone_{name}"] = IsolatedSolver(program, name)
        self.timed: dict[str, Timed] = {
            **self.replays,
            "governed/governor_alone": self.governor,
            "governed/governor_alone_violated": self.strained,
            **{f"wbc/{phase}": solver for phase, solver in self.solvers.items()},
        }

    def start(self, sequence: StateSequence, expected: ExpectedReplay) -> None:
        """Begin a sequence with every timer."""
        for timer in self.replays.values():
            timer.start(sequence.states)
        self.governor.start(expected.governor)
        self.strained.start(expected.strained)
        for solver in self.solvers.values():
            solver.start(expected.program.programs, expected.program.solutions)

    def compare(self, expected: ExpectedReplay) -> None:
        """Compare the commands of a finished sequence with the expected ones."""
        for key, timer in self.replays.items():
            name = key.partition("/")[0]
            difference = np.abs(timer.commands - expected.commands[name]).max(axis=1)
            self.compared[name] += len(difference)
            self.differing[name] += len(difference) - int(np.count_nonzero(difference <= COMMAND_TOLERANCE))
            self.command_difference = max(self.command_difference, float(difference.max()))

    def judge_solutions(self) -> None:
        """Keep how good the isolated solvers' solutions of a finished sequence are."""
        for phase, solver in self.solvers.items():
            self.gaps.setdefault(phase, []).append(solver.gaps[np.isfinite(solver.gaps)])
            self.failures[phase] = self.failures.get(phase, 0) + solver.failures


def _summary(laps: Mapping[str, list[Laps]], overhead: float) -> dict[str, Any]:
    timing: dict[str, Any] = {name: {} for name in CONTENDERS}
    phases = {"governed/chain": GOVERNED_PHASES, "wbc/chain": WBC_PHASES}
    for key, parts in laps.items():
        name, what = key.split("/")
        for k, phase in enumerate(phases.get(key, ())):
            timing[name][phase] = summarise([part[:, k] for part in parts], overhead)
        if key in phases:
            timing[name][what] = summarise([part.sum(axis=1) for part in parts], overhead * len(phases[key]))
        else:
            timing[name][what] = summarise(parts, overhead)
    timing["ratio"] = ratio_of_medians(laps["wbc/tick"], laps["governed/tick"], overhead)
    libraries = [phase for phase in timing["wbc"] if phase.startswith("solve_alone_")]
    fastest = min(libraries, key=lambda phase: timing["wbc"][phase]["p50_us"])
    for key, phase in (("ratio_solve_over_governor", "solve_alone"), ("ratio_library_over_governor", fastest)):
        timing[key] = {
            "phase": phase,
            **ratio_of_medians(laps[f"wbc/{phase}"], laps["governed/governor_alone"], overhead),
        }
    timing["timer_overhead_ns"] = overhead
    return timing


def _checks(
    run: _TimingRun, sequences: Sequence[StateSequence], expectations: Sequence[ExpectedReplay], unchanged: bool
) -> dict[str, Any]:
    programs = [expected.program for expected in expectations]
    residuals = np.concatenate([p.stationarity for p in programs])
    failures = {s.name: int(np.count_nonzero(~p.usable)) for s, p in zip(sequences, programs, strict=True)}
    checks: dict[str, Any] = {
        "states_unchanged": unchanged,
        "commands_compared": sum(run.compared.values()),
        "commands_differing": sum(run.differing.values()),
        "commands_differing_by_controller": dict(run.differing),
        "command_difference_max": run.command_difference,
        "governor_difference_max": max(run.governor.difference, run.strained.difference),
        "qp_solves": int(sum(len(p.usable) for p in programs)),
        "qp_failures": sum(failures.values()),
        "qp_failures_by_states": failures,
        "qp_inaccurate": int(sum(np.count_nonzero(p.statuses == 1) for p in programs)),
        "qp_failures_sampled": sum(p.failed_sampled for p in programs),
        "qp_failures_feasible": sum(p.failed_feasible for p in programs),
        "qp_violation_max": max(p.violation for p in programs),
        "qp_sampled": len(residuals),
        "qp_stationarity_max": float(residuals.max()) if len(residuals) else None,
        "qp_not_optimal": int(np.count_nonzero(residuals > OPTIMAL)),
    }
    for phase, parts in run.gaps.items():
        gaps, name = np.concatenate(parts), phase.removeprefix("solve_")
        checks[f"{name}_failures"] = run.failures[phase]
        checks[f"{name}_compared"] = len(gaps)
        checks[f"{name}_better"] = int(np.count_nonzero(gaps < -OPTIMAL))
        checks[f"{name}_worse"] = int(np.count_nonzero(gaps > OPTIMAL))
        checks[f"{name}_gap_max"] = float(np.abs(gaps).max()) if len(gaps) else None
    checks["passed"] = bool(
        unchanged
        and run.differing["ungoverned"] == run.differing["governed"] == 0
        and run.differing["wbc"] <= WBC_SHARE * run.compared["wbc"]
        and max(run.governor.difference, run.strained.difference) <= COMMAND_TOLERANCE
        and all(np.isfinite(expected.commands[name]).all() for expected in expectations for name in CONTENDERS)
    )
    return checks


def _activity(sequences: Sequence[StateSequence], expectations: Sequence[ExpectedReplay]) -> dict[str, Any]:
    return {
        sequence.name: {
            "ticks": len(sequence),
            "governor_rows_violated": expected.governor.active,
            "governor_infeasible": expected.governor.infeasible,
            "strained_rows_violated": expected.strained.active,
            "qp_iterations_mean": float(expected.program.iterations.mean()),
            "qp_iterations_max": int(expected.program.iterations.max()),
        }
        for sequence, expected in zip(sequences, expectations, strict=True)
    }
