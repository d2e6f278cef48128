"""Isolated timing of a governor's update and of a solver's solve, on recorded inputs."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter_ns

import numpy as np

from comparison.measure.statistics import Laps
from harpy_pin.governors import Governor
from harpy_pin.model.record import Record
from harpy_pin.model.state import Vector
from harpy_pin.wbc import QuadraticProgram, make_solver

__all__ = ["GovernorTrace", "IsolatedGovernor", "IsolatedSolver"]


@dataclass(frozen=True)
class GovernorTrace:
    """Inputs and outputs of the governor over a sequence.

    Attributes:
        start: (6,) reference it was reset to.
        measured: (ticks, 9) [c; ċ; u].
        references: (ticks, 6) x_r.
        results: (ticks, 6) x_w.
        active: share of ticks with a violated row, at x_r or at x_w.
        infeasible: share of ticks with a violated row at both.
    """

    start: Vector
    measured: Vector
    references: Vector
    results: Vector
    active: float
    infeasible: float


class IsolatedGovernor:
    """Times one update of the governor after the other.

    Attributes:
        laps: (ticks,) times, ns.
        difference: largest difference from the expected x_w so far (m, m/s).
        active: (ticks,) whether a row was violated at x_r.
    """

    def __init__(self, governor: Governor, dt: float) -> None:
        self.governor, self.dt = governor, dt
        self.laps: Laps = np.zeros(0, dtype=np.int64)
        self.difference = 0.0

    def start(self, trace: GovernorTrace) -> None:
        """Begin a sequence."""
        self.trace = trace
        self.laps = np.zeros(len(self.trace.measured), dtype=np.int64)
        self.active = np.zeros(len(self.laps), dtype=np.bool_)
        self.governor.reset(self.trace.start)

    def time_block(self, begin: int, end: int) -> None:
        """Time the updates from ``begin`` to before ``end``."""
        trace, dt, clock, update = self.trace, self.dt, perf_counter_ns, self.governor.update
        for i in range(begin, min(end, len(self.laps))):
            x, x_r = trace.measured[i], trace.references[i]
            t0 = clock()
            x_w = update(x, x_r, dt)
            t1 = clock()
            self.laps[i] = t1 - t0
            self.difference = max(self.difference, float(np.abs(x_w - trace.results[i]).max()))
            self.active[i] = bool((self.governor.status.h_r < 0.0).any())


class IsolatedSolver:
    """Times one solver on recorded programs, one solve after the other as in a walk.

    The program is filled with the recorded ones outside the timed span; ``reuse`` tries the last active set first.

    Attributes:
        laps: (programs,) times, ns.
        gaps: (programs,) how far the objective lies above that of the expected solution, relative to its size, in the
            present sequence; NaN where one of the two is missing.
        failures: programs of the present sequence that were not solved.
    """

    def __init__(self, program: QuadraticProgram, solver: str, *, reuse: bool = False) -> None:
        self.program = program
        self.solver = make_solver(solver, program, reuse=reuse)
        self.laps: Laps = np.zeros(0, dtype=np.int64)
        self.gaps: Vector = np.zeros(0)
        self.failures = 0

    def start(self, programs: Record, expected: Vector) -> None:
        """Begin a sequence, with a solver that starts cold.

        Programs are records of :class:`harpy_pin.wbc.QuadraticProgram`; ``expected``, (programs, n), are solutions to
        compare with, NaN where there is none.
        """
        self.programs, self.expected = programs, expected
        self.laps = np.zeros(len(programs), dtype=np.int64)
        self.gaps = np.full(len(programs), np.nan)
        self.failures = 0
        self.solver.reset()

    def time_block(self, begin: int, end: int) -> None:
        """Time the solves from ``begin`` to before ``end``."""
        program, clock = self.program, perf_counter_ns
        for i in range(begin, min(end, len(self.laps))):
            program.record[0] = self.programs[i]
            t0 = clock()
            solution = self.solver.solve(program)
            t1 = clock()
            self.laps[i] = t1 - t0
            if solution.usable:
                best = program.objective(self.expected[i])
                self.gaps[i] = (program.objective(solution.z) - best) / max(abs(best), 1.0)
            else:
                self.failures += 1
